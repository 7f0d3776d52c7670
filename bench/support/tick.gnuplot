# Run in the folder of tick.csv: time of a tick against the number of vertices, ours by scalar and instruction set, and
# Bullet's.
set terminal svg size 900,420 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'tick.svg'
set datafile separator comma
set multiplot layout 1,2 title 'A tick while a tool of 2 mm slides, against the size of the mesh' font ',15'
set xlabel 'vertices'
set logscale xy
set xtics nomirror (642, '2562' 2562, '10k' 10242, '41k' 40962)
set ytics nomirror format '%g'
set xrange [500:53000]
set yrange [10:50000]
set grid ytics lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set key top left reverse Left spacing 1.1 samplen 2 font ',12'
set style data linespoints
set pointsize 0.6

# The duration of one tick of a haptic loop.
set arrow from graph 0, first 1000 to graph 1, first 1000 nohead dt 2 lc '#999999'
set label '1 kHz' at graph 0.9, first 1000 offset 0, -0.6 textcolor '#777777' font ',11'

# Columns of the file: build, scalar, vertices, layers, sweeps, us, us_contact, us_sweep, us_other, error_percent,
# bullet_us.
rows(build, scalar, layers) = \
    sprintf("< awk -F, '$1 == \"%s\" && $2 == \"%s\" && $4 == %s' tick.csv", build, scalar, layers)
builds = system("awk -F, 'NR > 1 && !seen[$1]++ { print $1 }' tick.csv")
colours = '#1a1a1a #2471a3 #1e8449'
do for [layers in '6 3'] {
    set ylabel (layers eq '6' ? 'time of a tick [µs]' : '')
    set title (layers eq '6' ? '6 layers, 2 sweeps' : '3 layers, 1 sweep')
    plot rows(word(builds, 1), 'double', layers) using 3:11 title 'Bullet' lc '#c0392b' lw 2.6 pt 7, \
         for [i = 1:words(builds)] for [scalar in 'double float'] rows(word(builds, i), scalar, layers) using 3:6 \
             title word(builds, i) . ', ' . scalar lc rgb word(colours, i) lw 1.8 dt 1 + (scalar eq 'float') pt 7
    unset key
}
