# Run in the folder of the threshold tables: times by the tree's balance threshold, relative to the default.
set terminal svg size 900,400 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'tree.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 1,2 title "Times by the tree's balance threshold" font ',15' \
    margins 0.085, 0.87, 0.16, 0.89 spacing 0.06
set xlabel 'balance threshold'
set logscale x 2
set logscale y
set xtics nomirror (1, 2, 4, 8, 16, 32, 64)
set ytics nomirror (0.4, 0.5, 0.7, 1, 1.5, 2, 3, 5)
set grid ytics lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
unset key
set style data linespoints
set pointsize 0.6

default = 16  # of TreeOptions
set arrow from default, graph 0 to default, graph 1 nohead dt 2 lc '#999999'

names = '"closest point" "touching sphere" "first hit" "refit of the moved" build'
colours = '#1a1a1a #c0392b #d68910 #1e8449 #2471a3'
array at_default[words(names)]
do for [vertices in '642 10242'] {
    file = sprintf('threshold_%s.tsv', vertices)
    set xrange [*:*]
    set yrange [*:*]
    do for [i = 1:words(names)] {
        stats file using (column('threshold') == default ? column(word(names, i)) : NaN) nooutput
        at_default[i] = STATS_mean
    }
    set xrange [0.9:72]
    set yrange [0.38:6]
    set ylabel (vertices eq '642' ? 'time, as a part of that at 16' : '')
    set label 1 vertices . ' vertices' at graph 0.03, 0.06 textcolor '#444444'
    named_at = vertices eq '10242' ? 64 : 0
    plot for [i = 1:words(names)] file using 'threshold':(column(word(names, i)) / at_default[i]) \
             lc rgb word(colours, i) lw 1.8 pt 7, \
         for [i = 1:words(names)] file \
             using (column('threshold') == named_at ? named_at : NaN): \
                 (column(word(names, i)) / at_default[i]):(word(names, i)) \
             with labels left offset 1, 0 font ',12' textcolor rgb word(colours, i)
}
