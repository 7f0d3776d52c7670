# Measured forces and the fitted model.
set terminal svg size 900,330 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key top left Left reverse samplen 2 spacing 1.3
set title 'A lens under an indenter' font ',15'
set xlabel 'depth [mm]'
set ylabel 'force [mN]'
set yrange [0:*]
plot data index 0 title 'fitted' lc '#12507b' lw 1.6, \
     data index 1 with points title 'measured' lc '#b3541e' pt 7 ps 0.7
