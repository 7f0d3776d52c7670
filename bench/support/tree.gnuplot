# Run in the folder of the threshold tables: times by the tree's balance threshold, relative to the default; a panel for each
# operation, so that no curve hides another.
set terminal svg size 900,300 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'tree.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 1,5 title "Times by the tree's balance threshold, over those at 16" font ',15' \
    margins 0.055, 0.985, 0.17, 0.8 spacing 0.015
set xlabel 'balance threshold'
set logscale x 2
set logscale y
set xtics nomirror (1, 2, 4, 8, 16, 32, 64)
set ytics nomirror (0.4, 0.5, 0.7, 1, 1.5, 2, 3, 5)
set grid ytics lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set style data linespoints
set pointsize 0.5
set key top right samplen 1.5

default = 16  # of TreeOptions
set arrow from default, graph 0 to default, graph 1 nohead dt 2 lc '#999999'

names = '"closest point" "touching sphere" "first hit" "refit of the moved" build'
do for [i = 1:words(names)] {
    name = word(names, i)
    set title name font ',12'
    set xrange [*:*]
    set yrange [*:*]
    stats 'threshold_642.tsv' using (column('threshold') == default ? column(name) : NaN) name 'small' nooutput
    stats 'threshold_10242.tsv' using (column('threshold') == default ? column(name) : NaN) name 'large' nooutput
    set xrange [0.9:72]
    set yrange [0.38:6]
    plot 'threshold_10242.tsv' using 'threshold':(column(name) / large_mean) title (i == 1 ? '10,242 vertices' : '') \
             lc '#d68910' lw 3.5 pt 7, \
         'threshold_642.tsv' using 'threshold':(column(name) / small_mean) title (i == 1 ? '642' : '') \
             lc '#1b4f72' lw 1.5 pt 7
    set format y ''
}
