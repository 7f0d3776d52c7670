# Run in the folder of the tables of `bench/run tissue`: published experiments and the library's numbers for them.
# Bands: the published constants changed one at a time. Points: mean and deviation.
set terminal svg size 900,1100 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'tissue.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 3,2 title 'Measured on tissue, and from the constants that others published' font ',15'
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set xtics nomirror
set ytics nomirror
set style fill solid 0.25 noborder
set key top left reverse Left spacing 1.2 samplen 2

set title 'Pig cornea: its middle rises'
set xlabel 'pressure [mmHg]'
set ylabel 'µm'
set xrange [0:31]
set yrange [0:700]
$rise << EOD
pressure	mean	deviation
27.25	437	63
EOD
$linked << EOD
pressure	mean	deviation
27.25	307	65
EOD
plot 'tissue_pig.tsv' using 1:3:4 with filledcurves lc rgb '#2471a3' title 'band', \
     '' using 1:2 with lines lw 2 lc rgb '#2471a3' title 'E 0.188 MPa', \
     $rise using 1:2:3 with yerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1a1a1a' title 'measured, 7 eyes', \
     $linked using 1:2:3 with yerrorbars pt 6 ps 0.7 lw 1.5 lc rgb '#7f8c8d' title 'the same, cross-linked'

set title 'Cornea: its middle becomes thinner from 5 mmHg on'
set ylabel '%'
set xrange [4:32]
set yrange [0:13]
$pig << EOD
pressure	mean	deviation
29.8	6.42	1.5
EOD
$human << EOD
pressure	mean	deviation
30.2	2.85	0.09
EOD
plot 'tissue_human.tsv' using 1:6:7 with filledcurves lc rgb '#c0392b' title 'band, human', \
     '' using 1:5 with lines lw 2 lc rgb '#c0392b' title 'E 0.25 MPa, human', \
     'tissue_pig.tsv' using 1:6:7 with filledcurves lc rgb '#2471a3' title 'band, pig', \
     '' using 1:5 with lines lw 2 lc rgb '#2471a3' title 'E 0.188 MPa, pig', \
     $pig using 1:2:3 with yerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1a1a1a' title 'measured, pig', \
     $human using 1:2:3 with yerrorbars pt 6 ps 0.7 lw 1.5 lc rgb '#7b241c' title 'measured, human'

set title 'Pig sclera at 15 mmHg under a flat punch'
set xlabel 'depth [mm]'
set ylabel 'mN'
set xrange [0:0.85]
set yrange [0:140]
$measured << EOD
depth	low	high
0	0	0
0.8	88	120
EOD
plot $measured using 1:2:3 with filledcurves lc rgb '#1a1a1a' title 'measured, 130 ± 20 N/m', \
     'tissue_punch.tsv' using 1:3:4 with filledcurves lc rgb '#2471a3' title 'band', \
     '' using 1:2 with lines lw 2 lc rgb '#2471a3' title 'E 0.188 MPa, of the cornea'

set title 'Strips of amnion'
set xlabel 'strain [%]'
set ylabel 'MPa'
set xrange [0:37]
set yrange [0:1.2]
$fresh << EOD
strain	stress	deviation
11.808	0.144	0.037
32.695	0.820	0.028
EOD
$acellular << EOD
strain	stress	deviation
12.2	0.142	0.026
33.777	0.796	0.045
EOD
plot 'tissue_strips.tsv' using 1:2 with lines lw 2 lc rgb '#2471a3' title 'through the fresh ones', \
     $fresh using 1:2:3 with yerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1a1a1a' title 'measured, fresh', \
     $acellular using 1:2:3 with yerrorbars pt 6 ps 0.7 lw 1.5 lc rgb '#c0392b' title 'measured, acellular'

set title 'Empty lens bag, pulled at its rim'
set xlabel 'E [MPa]'
set ylabel 'mN/mm'
set xrange [0.5:7]
set yrange [0:900]
$range << EOD
modulus	low	high
0.5	25.2	342.7
7	25.2	342.7
EOD
plot $range using 1:2:3 with filledcurves lc rgb '#1a1a1a' title 'measured, all of 22', \
     'tissue_bags.tsv' using 1:2:3:4 with yerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#2471a3' \
         title 'capsule of 11 to 15 µm, and 3.5 µm'

set title 'Predicted over measured'
set xlabel 'ratio'
unset ylabel
set key bottom left reverse Left
set logscale x
set xrange [0.5:5]
set xtics (0.5, 0.7, 1, 1.5, 2, 3, 4)
set yrange [-2.6:3.6]
set ytics ('rise, pig' 3, 'thinning, pig' 2, 'punch, pig' 1, 'thinning, human' 0)
set arrow from 1,-0.6 to 1,3.6 nohead lc '#999999' dt 2
plot 'tissue_ratios.tsv' using 1:(3 - $0):2:3 with xerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#2471a3' \
         title 'published constants', \
     '' using 6:(2.65 - $0) with points pt 6 ps 0.8 lw 1.5 lc rgb '#2471a3' title 'one modulus fitted to the pigs', \
     '' using (1):(2.75 - $0):4:5 with xerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1a1a1a' title 'measured'
unset multiplot
