# Run in the folder of the stability tables: fraction of 200 scenes that diverge, by rule and time step. Curves that coincide
# are drawn broad and pale below narrow and dark.
set terminal svg size 900,400 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'stability.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 1,2 title 'Fraction of 200 membranes that diverge' font ',15'
set yrange [-4:104]
set ytics nomirror 0, 25, 100
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set style data linespoints
set pointsize 0.5

names = '"explicit Euler" "all at once" "(4), one by one" "(4), with refusal" "safe step" "block step"'
colours = '#c0392b #d68910 #b8c4c6 #1e8449 #9ecbe8 #1a1a1a'
widths = '1.8 1.8 6 1.8 6 1.8'

set xlabel 'dt, in units of sqrt(m / k)'
set ylabel 'diverging [%]'
set logscale x
set xrange [0.19:10.5]
set xtics nomirror (0.2, 0.3, 0.5, 0.7, 1, 2, 5, 10)
set key at graph 0.98, graph 0.62 right opaque reverse Left spacing 1.2 samplen 2
plot for [i = 1:6] 'stability_dt.tsv' using (column('dt') / 100):(column(word(names, i))) \
    title word(names, i) lc rgb word(colours, i) lw (word(widths, i) + 0) pt 7

unset logscale x
unset ylabel
unset key
set xlabel 'dt, relative to the theoretical limit of the scene'
set xrange [0.795:1.305]
set xtics nomirror 0.8, 0.1, 1.3
set arrow from 1, graph 0 to 1, graph 1 nohead dt 2 lc '#999999'
plot for [i = 1:4] 'stability_limit.tsv' using (column('limit') / 100):(column(word(names, i))) \
    title word(names, i) lc rgb word(colours, i) lw (word(widths, i) + 0) pt 7
