# Run in the folder of the tables of `bench/run tear`.
set terminal svg size 900,1140 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'tear.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 3,2 title 'Tears on meshes of several sizes and directions' font ',15'
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set xtics nomirror
set ytics nomirror
set key top left reverse Left spacing 1.1 samplen 2 font ',10'
colours = '#1a1a1a #2471a3 #c0392b'
colour(i) = word(colours, i)
pale(i) = word('#c4c4c4 #a9c9e3 #eab3ab', i)
distinct(table) = system("awk 'NR > 1 && NF && !seen[$1]++ { printf \"%s \", $1 }' " . table)
only(c, name) = column(1) == real(name) ? column(c) : NaN
meshes = distinct('tear_grids.tsv')

set title 'Paths in pure shear, grids of all directions'
set xlabel 'edges'
set ylabel 'edges'
set yrange [-2:2]
plot 0.7 dt 2 lc '#999999' notitle, -0.7 dt 2 lc '#999999' notitle, \
     for [i = 1:words(meshes)] 'tear_paths.tsv' using 3:(only(4, word(meshes, i))) with lines lc rgb colour(i) lw 0.8 \
         title word(meshes, i) . ' edges high'

set title 'Largest distance from the line'
set xlabel 'direction of the grid [degrees]'
set yrange [0:1.6]
plot 0.7 dt 2 lc '#999999' notitle, \
     for [i = 1:words(meshes)] 'tear_grids.tsv' using 2:(only(3, word(meshes, i))) with linespoints pt 7 ps 0.5 \
         lc rgb colour(i) title word(meshes, i) . ' edges high'

legs = distinct('tear_trousers.tsv')
only_first(c, name) = column(2) == 0 ? only(c, name) : NaN

set title 'Trousers, grids of all directions; bold: of 0 degrees'
set xlabel 'displacement of a hand [edges]'
set ylabel 'force over the closed form'
set yrange [0:2]
plot 1 dt 2 lc '#999999' notitle, \
     for [i = 1:words(legs)] 'tear_trousers.tsv' every 6 using 3:(only(4, word(legs, i))) with lines \
         lc rgb pale(i) lw 0.4 notitle, \
     for [i = 1:words(legs)] 'tear_trousers.tsv' using 3:(only_first(4, word(legs, i))) with lines \
         lc rgb colour(i) lw 0.9 title word(legs, i) . ' edges over a leg'

set title 'Trousers, mean force on grids of all directions'
set xlabel 'direction of the grid [degrees]'
set yrange [0.8:1.4]
plot 0.95 dt 2 lc '#999999' notitle, 1.05 dt 2 lc '#999999' notitle, \
     for [i = 1:words(legs)] 'tear_trouser_means.tsv' using 2:(only(3, word(legs, i))) with linespoints pt 7 ps 0.5 \
         lc rgb colour(i) title word(legs, i) . ' edges over a leg'

set title 'Force per length at which it begins'
set xlabel 'edge [mm]'
set ylabel 'N/m'
set logscale x 2
set xrange [0.4:2.5]
set yrange [0:5]
plot 'tear_criteria.tsv' using 1:2 with linespoints pt 7 ps 0.6 lc rgb colour(2) lw 1.8 title 'EnergyRelease', \
     '' using 1:3 with linespoints pt 7 ps 0.6 lc rgb colour(3) lw 1.8 title 'LargestTension'
unset multiplot
