# Run in the folder of the tables of `bench/run tissue`: measured curves, and those by the library's laws. Points:
# measured. Full lines: from constants that were not fitted to the curve; bands: with each other set of such constants.
# Broken lines: fitted to the curve.
set terminal svg size 900,1500 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'tissue_curves.svg'
set datafile separator tab
set multiplot layout 5,2 \
    title "Points: measured. Full lines: from constants that were not fitted to the curve. Broken: fitted" font ',14'
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set xtics nomirror
set ytics nomirror
set style fill solid 0.25 noborder
set key top left reverse Left spacing 1.2 samplen 2
data = 'tissue_curves.tsv'
across = '#c0392b'
along = '#2471a3'

array titles[9] = ['Pig skin, more along the fibres', 'Pig skin, more across the fibres', \
                   'Pig skin, equal stretches', 'Pig skin, across the fibres alone', \
                   'Pig skin, along the fibres alone', 'Skin of mouse 115', 'Skin of mouse 119', \
                   'Skin of mouse 116', 'Skin of mouse 121']
array axes[9] = ['along', 'across', 'in both directions', 'across', 'along', 'across', 'across', 'across', 'across']
set ylabel 'stress [MPa]'
set xtics 0.05
set format y '%.1f'
do for [k = 1:9] {
    set title titles[k]
    set xlabel 'stretch '.axes[k]
    set xrange [1:(k <= 5 ? 1.24 : 1.18)]
    set yrange [0:(k <= 5 ? 0.8 : 0.4)]
    step = k <= 5 ? 0.2 : 0.1
    set ytics step
    plot data index 2 * k - 2 using 1:4:5 with filledcurves lc rgb across notitle, \
         data index 2 * k - 1 using 1:4:5 with filledcurves lc rgb along notitle, \
         data index 2 * k - 2 using 1:3 with lines lw 2 lc rgb across title 'across', \
         data index 2 * k - 1 using 1:3 with lines lw 2 lc rgb along title 'along', \
         data index 2 * k - 2 using 1:6 with lines lw 1.5 dt 2 lc rgb across notitle, \
         data index 2 * k - 1 using 1:6 with lines lw 1.5 dt 2 lc rgb along notitle, \
         data index 2 * k - 2 using 1:2 with points pt 7 ps 0.6 lc rgb across notitle, \
         data index 2 * k - 1 using 1:2 with points pt 7 ps 0.6 lc rgb along notitle
}
set title 'Human eye under pressure'
set xlabel 'pressure [mmHg]'
set ylabel 'growth from 10 mmHg on [µl]'
set format y '%g'
set xtics 5
set xrange [10:41]
set yrange [0:140]
set ytics 20
set key opaque
plot data index 18 using 1:4:5 with filledcurves lc rgb across notitle, \
     data index 19 using 1:4:5 with filledcurves lc rgb along notitle, \
     data index 18 using 1:3 with lines lw 2 lc rgb across title 'from strips of sclera', \
     data index 19 using 1:3 with lines lw 2 lc rgb along title 'from sclera under pressure', \
     data index 18 using 1:6 with lines lw 1.5 dt 2 lc rgb '#1a1a1a' title 'fitted', \
     data index 18 using 1:2 with points pt 7 ps 0.6 lc rgb '#1a1a1a' title 'measured, by the author''s equation'
unset multiplot
