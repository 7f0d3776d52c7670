# The force of a peel over the displacement of the forceps, with its closed form: a strip and a circle.
set terminal svg size 900,560 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key at screen 0.745, graph 1 left top Left reverse samplen 2 spacing 1.3
set multiplot layout 2,1
set lmargin 11
set rmargin at screen 0.73
set ylabel 'force [mN]'
set xlabel 'displacement of the forceps [mm]'
set yrange [0:*]
set xrange [0:*]
set title 'Peel of a strip at 90 degrees' font ',15'
plot data index 0 title 'force on the forceps' lc '#d0532f' lw 1.6, \
     data index 1 title 'closed form' lc '#12507b' lw 1.6 dt 2
set title 'Peel of a circle at 120 degrees' font ',15'
plot data index 2 title 'force on the forceps' lc '#d0532f' lw 1.6, \
     data index 3 title 'closed form, straight front' lc '#12507b' lw 1.6 dt 2
