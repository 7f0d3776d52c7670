# The force of a capsulorhexis over the length of the tear, with the forces of surgeons.
set terminal svg size 900,320 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key at screen 0.745, graph 1 left top Left reverse samplen 2 spacing 1.3
set lmargin 11
set rmargin at screen 0.73
set ylabel 'force [mN]'
set xlabel 'length of the tear [mm]'
set yrange [0:*]
set xrange [0:*]
set title 'Capsulorhexis' font ',15'
plot data index 0 title 'force on the forceps' lc '#d0532f' lw 1.6, \
     17.16 title 'novice, RMS' lc '#12507b' lw 1.6 dt 3, \
     8.97 title 'expert, RMS' lc '#12507b' lw 1.6 dt 2
