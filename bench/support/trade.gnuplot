# Run in the folder of trade.csv: time of a tick against the error of its force. Dots: all settings; lines above: 1 to 16 sweeps
# of 3 layers, below: the Pareto fronts of the default rule. The error is the distance from the equilibrium: where a foundation
# has viscosity, that of a sliding tool contains the viscous force.
set terminal svg size 900,800 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'trade.svg'
set datafile separator comma
set multiplot layout 2,2 title 'Time of a tick against the distance from equilibrium: a tool slides at 50 mm/s, 1.5 mm deep' font ',15'
set logscale xy
set yrange [0.00003:50]
set format y '%g'
set ytics nomirror (0.0001, 0.001, 0.01, 0.1, 1, 10)
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set key bottom left opaque reverse Left spacing 1.2 samplen 2
set style data linespoints
set pointsize 0.6

# Columns of the file: scene, vertices, foundation, scalar, rule, predicted, layers, sweeps, contact_iterations, time,
# force_error, position_error, front.
rows(what) = sprintf("< awk -F, '$1 == \"slide\" && %s' trade.csv", what)
by_sweeps(what) = rows(what) . ' | sort -t , -k 8n'
of(vertices, foundation) = sprintf('$2 == %d && $3 == %g', vertices, foundation)
by(rule, predicted, iterations) = \
    sprintf(' && $4 == "double" && $5 == "%s" && $6 == %d && $7 == 3 && $9 == %d', rule, predicted, iterations)
all_by(rule, predicted) = sprintf(' && $4 == "double" && $5 == "%s" && $6 == %d', rule, predicted)
front(scalar) = sprintf(' && $4 == "%s" && $5 == "block" && $6 && $13', scalar)

set xrange [12:1500]
set xtics nomirror (20, 50, 100, 200, 500, 1000)
do for [vertices in '162 642'] {
    here = of(int(vertices), 0.1)
    set ylabel (vertices eq '162' ? 'error of the force [%]' : '')
    set title vertices . ' vertices, 3 layers: by rule'
    plot rows(here . all_by('published', 0)) using (1e6 * $10):(100 * $11) with points pt 7 ps 0.3 lc '#7f8c8d' notitle, \
         rows(here . all_by('safe', 1)) using (1e6 * $10):(100 * $11) with points pt 7 ps 0.3 lc '#2471a3' notitle, \
         rows(here . all_by('block', 1)) using (1e6 * $10):(100 * $11) with points pt 7 ps 0.3 lc '#1a1a1a' notitle, \
         by_sweeps(here . by('published', 0, 1)) using (1e6 * $10):(100 * $11) title '(4) as published' lc '#7f8c8d' lw 1.8 pt 7, \
         by_sweeps(here . by('published', 1, 3)) using (1e6 * $10):(100 * $11) title '(4), contact 3 x, predicted' lc '#d68910' lw 1.8 pt 7, \
         by_sweeps(here . by('safe', 1, 3)) using (1e6 * $10):(100 * $11) title 'safe step' lc '#2471a3' lw 1.8 pt 7, \
         by_sweeps(here . by('block', 0, 3)) using (1e6 * $10):(100 * $11) title 'block step, not predicted' lc '#1a1a1a' dt 2 lw 1.4 pt 6, \
         by_sweeps(here . by('block', 1, 3)) using (1e6 * $10):(100 * $11) title 'block step, the default' lc '#1a1a1a' lw 2.6 pt 7
    unset key
}

set key top right opaque reverse Left spacing 1.2 samplen 2
set xlabel 'time of a tick [µs]'
set ylabel 'error of the force [%]'
set title '642 vertices: fronts by foundation / springs'
plot for [i = 1:4] rows(of(642, real(word('0.01 0.1 1 10', i))) . all_by('block', 1)) using (1e6 * $10):(100 * $11) \
         with points pt 7 ps 0.3 lc rgb word('#c0392b #1a1a1a #2471a3 #1e8449', i) notitle, \
     for [i = 1:4] rows(of(642, real(word('0.01 0.1 1 10', i))) . front('double')) using (1e6 * $10):(100 * $11) \
         title word('0.01 0.1 1 10', i) lc rgb word('#c0392b #1a1a1a #2471a3 #1e8449', i) lw 1.8 pt 7

set xrange [12:5000]
set xtics nomirror (20, 50, 100, 200, 500, 1000, 2000, 5000)
set ylabel ''
set title 'foundation / springs 0.1: fronts by vertices'
plot for [i = 1:3] rows(of(int(word('162 642 2562', i)), 0.1) . all_by('block', 1)) using (1e6 * $10):(100 * $11) \
         with points pt 7 ps 0.3 lc rgb word('#d68910 #1a1a1a #7d3c98', i) notitle, \
     for [i = 1:3] rows(of(int(word('162 642 2562', i)), 0.1) . front('double')) using (1e6 * $10):(100 * $11) \
         title word('162 642 2562', i) lc rgb word('#d68910 #1a1a1a #7d3c98', i) lw 1.8 pt 7, \
     rows(of(642, 0.1) . front('float')) using (1e6 * $10):(100 * $11) title '642, float' lc '#1a1a1a' dt 2 lw 1.4 pt 6
