# Run in the folder of the trade tables: what the error of a tick's force costs, by rule; a point for each number of sweeps.
set terminal svg size 900,400 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'trade.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 1,2 title 'What accuracy costs: a tool slides, 1 to 16 sweeps of 3 layers' font ',15'
set xlabel 'time of a tick [µs]'
set logscale xy
set xrange [20:800]
set yrange [0.0005:30]
set xtics nomirror (20, 50, 100, 200, 500)
set ytics nomirror (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30)
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set key bottom left opaque reverse Left spacing 1.2 samplen 2
set style data linespoints
set pointsize 0.6

micro(name) = 1e6 * column(name)
do for [vertices in '162 642'] {
    file = sprintf('trade_%s.tsv', vertices)
    set ylabel (vertices eq '162' ? 'error of the force [%]' : '')
    set label 1 vertices . ' vertices' at graph 0.97, 0.95 right textcolor '#444444'
    plot file using (micro('(4) as published')):'error' title '(4) as published' lc '#7f8c8d' lw 1.8 pt 7, \
         '' using (micro('(4), contact visited 4 x')):'error, 4 x' title '(4), contact visited 4 x' lc '#d68910' lw 1.8 pt 7, \
         '' using (micro('safe step')):'error, safe' title 'safe step' lc '#2471a3' lw 1.8 pt 7, \
         '' using (micro('block step, the default')):'error, block' title 'block step, the default' lc '#1a1a1a' lw 2.6 pt 7
    unset key
}
