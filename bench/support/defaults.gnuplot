# Run in the folder of the tables: error of a tick's force against its time, each default of the solver varied alone.
set terminal svg size 960,760 font 'Helvetica,Arial,sans-serif,13' background '#ffffff'
set output 'defaults.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 2,3 title "The solver's defaults (ringed), each varied alone" font ',15' \
    margins 0.085, 0.985, 0.075, 0.9 spacing 0.06, 0.16
set logscale xy
set xrange [10:3000]
set yrange [0.003:100]
set xtics nomirror (10, 30, 100, 300, 1000, 3000)
set ytics nomirror (0.01, 0.1, 1, 10, 100)
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set style data linespoints
set pointsize 0.5

# A table has the time of a tick and the error of its force, by mesh or by alternative.
names = '"162 vertices" "642 vertices" "2562 vertices" "642 vertices, forceps"'
errors = '"error, 162" "error, 642" "error, 2562" "error, forceps"'
titles = '"162 vertices" "642" "2562" "642, forceps"'
colours = '0xd68910 0x1a1a1a 0x7d3c98 0x1e8449'
colour(i) = int(word(colours, i))
micro(name) = 1e6 * column(name)
percent(i) = column(word(errors, i))

set ylabel 'error of the force [%]'
set key at graph 1, 1 right top opaque reverse Left samplen 1.2 font ',12'
do for [k = 1:3] {
    option = word('layers sweeps contact_iterations', k)
    default = int(word('6 2 3', k))
    file = sprintf('defaults_%s.tsv', option)
    at_default = sprintf("< awk -F'\\t' 'NR == 1 || $1 == %d' %s", default, file)
    labelled = k == 1 ? 4 : 2
    set title sprintf('%s, default: %d', option, default) noenhanced
    plot for [i = 1:4] file using (micro(word(names, i))):(percent(i)) \
             title word(titles, i) lc rgb colour(i) lw 1.8 pt 7, \
         for [i = 1:4] at_default using (micro(word(names, i))):(percent(i)) \
             with points pt 6 ps 1.3 lw 1.5 lc rgb colour(i) notitle, \
         file using (micro(word(names, labelled))):(percent(labelled)):(strcol(option)) \
             with labels left offset 0.9, 0.2 font ',10' textcolor rgb colour(labelled) notitle
    unset key
    unset ylabel
}

# From the alternative to the default.
tables = 'defaults_slide.tsv defaults_draw_out.tsv'
mesh(vertices) = vertices == 162 ? 1 : vertices == 642 ? 2 : 3
hue(file) = colour(file eq word(tables, 2) ? 4 : mesh(column('vertices')))
set xlabel 'time of a tick [µs]'
set key at graph 1, 1 right top opaque reverse Left samplen 0.8 font ',12'
do for [k = 1:2] {
    others = k == 1 ? '"not predicted"' : '"safe step" "(4), lightest stable mass"'
    other_errors = k == 1 ? '"error, not predicted"' : '"error, safe" "error, (4)"'
    set title (k == 1 ? 'prediction' : 'rule')
    if (k == 1) { set ylabel 'error of the force [%]' }
    plot for [j = 1:words(others)] for [file in tables] file \
             using (micro(word(others, j))):(column(word(other_errors, j))): \
                 (micro('default') - micro(word(others, j))): \
                 (column('error, default') - column(word(other_errors, j))):(hue(file)) \
             with vectors nohead lw 1.4 lc rgb variable notitle, \
         for [j = 1:words(others)] for [file in tables] file \
             using (micro(word(others, j))):(column(word(other_errors, j))):(hue(file)) \
             with points pt (k == 1 ? 4 : 4 * j) ps 0.7 lw 1.5 lc rgb variable notitle, \
         for [i = 0:1] for [file in tables] file using (micro('default')):(column('error, default')):(hue(file)) \
             with points pt (i == 0 ? 7 : 6) ps (i == 0 ? 0.5 : 1.3) lw 1.5 lc rgb variable notitle, \
         for [j = 1:words(others)] keyentry with points pt (k == 1 ? 4 : 4 * j) ps 0.7 lw 1.5 lc '#444444' \
             title word(others, j), \
         keyentry with points pt 7 ps 0.5 lc '#444444' \
             title (k == 1 ? 'predicted, the default' : 'block step, the default')
    unset ylabel
}

# Times only: the errors are the same.
unset logscale
set title 'order: time breadth first / by colours'
set xlabel 'vertices'
set xrange [0.4:4.6]
set yrange [0:2.7]
set xtics nomirror ('162' 1, '642' 2, '2562' 3, 'forceps' 4)
set ytics nomirror 0, 0.5, 2.5
place(file) = file eq word(tables, 2) ? 4 : column(0) + 1
part(other, default) = column(other) / column(default)
plot for [file in tables] file using (place(file) - 0.18):(part('breadth first', 'default')):(0.32):(hue(file)) \
         with boxes fill solid 1 lc rgb variable notitle, \
     for [file in tables] file \
         using (place(file) + 0.18):(part('breadth first, float', 'default, float')):(0.32):(hue(file)) \
         with boxes fill empty lw 1.5 lc rgb variable notitle, \
     1 with lines lc '#777777' dt 2 notitle, \
     keyentry with boxes fill solid 1 lc '#444444' title 'double', \
     keyentry with boxes fill empty lw 1.5 lc '#444444' title 'float'
