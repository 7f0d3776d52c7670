# The force on the hand with the normals of the triangles and with smooth ones, over time and as a spectrum.
set terminal svg size 900,560 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key at screen 0.745, graph 1 left top Left reverse samplen 2 spacing 1.3
set multiplot layout 2,1
set lmargin 9
set rmargin at screen 0.73
set title 'A slide over triangles: the force on the hand' font ',15'
set xlabel 'time [s]'
set ylabel 'force [mN]'
set yrange [0:*]
plot data index 0 title 'normals of the triangles' lc '#d0532f' lw 1.6, \
     data index 1 title 'smooth normals' lc '#12507b' lw 1.6
set title 'Its spectrum above 100 Hz' font ',15'
set xlabel 'frequency [Hz]'
set ylabel 'amplitude [mN]'
set xrange [100:500]
plot data index 2 title 'normals of the triangles' lc '#d0532f' lw 1.6, \
     data index 3 title 'smooth normals' lc '#12507b' lw 1.6
