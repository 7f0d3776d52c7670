# Two recordings: displacement of the tool, force, and difference of the forces.
set terminal svg size 900,640 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key at screen 0.745, graph 1 left top Left reverse samplen 2 spacing 1.3
stats data index 4 using 2 nooutput
set multiplot layout 3,1 title 'Two traces' font ',15'
set xrange [0:*]
set lmargin 9
set rmargin at screen 0.73
set yrange [0:*]
set ylabel 'displacement [mm]'
plot data index 0 title 'first' lc '#7fb3d5' lw 3, data index 1 title 'second' lc '#7a2e0e' lw 1.4 dt 2
set ylabel 'force [N]'
plot data index 2 title 'first' lc '#7fb3d5' lw 3, data index 3 title 'second' lc '#7a2e0e' lw 1.4 dt 2
set ylabel 'apart [N]'
set yrange [0:(STATS_max > 0 ? 1.05 * STATS_max : 1)]
set xlabel 'tick'
plot data index 4 title 'second less first' lc '#555555' lw 1.6
