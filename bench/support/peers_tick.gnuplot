# Run in the folder of the tables: time of a tick against the number of vertices, ours and Bullet's.
set terminal svg size 900,420 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'peers_tick.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 1,2 title 'A tick while a tool slides, against the size of the mesh' font ',15'
set xlabel 'vertices'
set logscale xy
set xtics nomirror (162, 642, '2562' 2562, '10k' 10242, '41k' 40962, '164k' 163842, '655k' 655362)
set ytics nomirror format '%g'
set xrange [130:800000]
set yrange [8:50000]
set grid ytics lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set key bottom right reverse Left spacing 1.1 samplen 2 font ',12'
set style data linespoints
set pointsize 0.6

# The duration of one tick of a haptic loop.
set arrow from graph 0, first 1000 to graph 1, first 1000 nohead dt 2 lc '#999999'
set label '1 kHz' at graph 0.9, first 1000 offset 0, 0.6 textcolor '#777777' font ',11'

names = '"block step, double" "safe step, double" "block step, float" "safe step, float" Bullet'
colours = '#1a1a1a #2471a3 #1a1a1a #2471a3 #c0392b'
do for [tool in 'same fine'] {
    set ylabel (tool eq 'same' ? 'time of a tick [µs]' : '')
    set title (tool eq 'same' ? 'the same tool' : 'a tool as many edges wide')
    plot for [i = 1:5] sprintf('peers_tick_%s.tsv', tool) using 'vertices':(1e6 * column(word(names, i))) \
        title word(names, i) lc rgb word(colours, i) lw (i == 5 ? 2.6 : 1.8) dt 1 + (i == 3 || i == 4) pt 7
    unset key
}
