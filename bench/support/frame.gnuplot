# Run in the folder of frame.tsv: time of a frame and of its parts against the number of vertices.
set terminal svg size 760,460 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'frame.svg'
set datafile separator tab
set title 'Time of a frame and of its parts' font ',15'
set xlabel 'vertices'
set ylabel 'time [µs]'
set logscale xy
set xtics nomirror (162, 642, 2562, 10242)
set ytics nomirror format '%g'
set mytics 10
set yrange [0.005:3000]
set grid ytics lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set xrange [130:13000]
set key outside right center reverse Left spacing 1.3 samplen 2
set style data linespoints
set pointsize 0.6

# The duration of one tick of a haptic loop.
set arrow from graph 0, first 1000 to graph 1, first 1000 nohead dt 2 lc '#999999'
set label '1 kHz' at graph 0.01, first 1000 offset 0, 0.6 textcolor '#777777' font ',11'

micro(name) = 1e6 * column(name)
plot 'frame.tsv' using 'vertices':(micro('frame')) title 'frame' lc '#1a1a1a' lw 2.6 pt 7, \
     '' using 'vertices':(micro('solve')) title 'solve' lc '#c0392b' lw 1.8 pt 7, \
     '' using 'vertices':(micro('normals')) title 'normals' lc '#2471a3' lw 1.8 pt 7, \
     '' using 'vertices':(micro('refit')) title 'refit' lc '#1e8449' lw 1.8 pt 7, \
     '' using 'vertices':(micro('contact')) title 'contact' lc '#d68910' lw 1.8 pt 7, \
     '' using 'vertices':(micro('force')) title 'force' lc '#7d3c98' lw 1.8 pt 7
