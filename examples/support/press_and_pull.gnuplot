# Force and depth over time, with `name` of the scene and the phases as labels and objects.
set terminal svg size 1000,500 font "Helvetica,Arial,sans-serif,13" background "#ffffff"
set output picture
set key at screen 0.71, graph 1 left top Left reverse samplen 2 spacing 1.3
set multiplot layout 2,1 title 'Force and depth, '.name font ',15'
set lmargin 9
set tmargin 2.5
set rmargin at screen 0.7
set yrange [0:*]
set ylabel 'force [mN]'
plot data index 0 title 'felt, −k x − μ v' lc '#8a8f94' lw 1.6, \
     data index 1 title 'reaction' lc '#12507b' lw 1.6, \
     data index 2 title 'reaction without volume springs' lc '#d0532f' lw 1.6 dt 2
unset label
set xlabel 'time [s]'
set ylabel 'depth [mm]'
plot data index 3 title 'depth of the tool' lc '#333333' lw 1.6, \
     data index 4 title 'displacement of the held point' lc '#7a4ea3' lw 1.6
