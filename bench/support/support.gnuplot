# Run in the folder of support.csv: the error of the force in each scene, by setting, in the order of the table. Errors
# below 0.003 % are at the left border.
set terminal svg size 900,560 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'support.svg'
set datafile separator comma
set title 'Error of the force against the equilibrium' font ',15'
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set logscale x
set xrange [0.003:2000]
set xtics nomirror 0.01, 10, 1000
set xlabel 'rms over the path [%]'
set yrange [] reverse
set offsets 0, 0, 0.7, 0.7
set ytics nomirror font ',10'
set key outside bottom center horizontal
settings = '"6 layers" "all layers" "6 layers corrected" "corrected in each tick" "corrected and unbalanced woken"'
colours = '#c0392b #d68910 #1a1a1a #2471a3 #1e8449'
rows(setting) = sprintf("< awk -F, '$3 == \"%s\"' support.csv", setting)
name(scene, vertices) = sprintf('%s, %s', scene, vertices)
plot for [i = 1:words(settings)] rows(word(settings, i)) using ($4 > 0.003 ? $4 : 0.003):0:yticlabels(name(strcol(1), strcol(2))) \
    with points pt 7 ps 0.7 lc rgb word(colours, i) title word(settings, i)
