# Run in the folder of the tables of `bench/run truth`: differences of the library from CalculiX by load.
set terminal svg size 900,760 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'truth.svg'
set datafile separator tab
set datafile columnheaders
set multiplot layout 3,3 \
    title 'The library beside CalculiX: difference [%] by load; dashed: the bound' font ',15'
set grid lc '#d8d8d8' lw 0.7
set border 3 lc '#444444'
set xtics nomirror
set ytics nomirror
set samples 2
set style data linespoints
set pointsize 0.5
set logscale x
set key top right reverse Left spacing 1.1 samplen 2 font ',10'
colours = '#1a1a1a #2471a3 #c0392b #d68910 #1e8449'
colour(i) = word(colours, i)

difference(c) = 100 * (column(c) / column(2) - 1)

set title '1. pressure'
set xlabel 'Pa'
set yrange [-0.2:0.2]
plot 0.1 dt 2 lc '#999999' notitle, -0.1 dt 2 lc '#999999' notitle, \
     'truth_pressure.tsv' using 1:(difference(3)) title 'rings' lc rgb colour(1) pt 7, \
     'truth_irregular_pressure.tsv' using 1:(difference(3)) title 'DistMesh' lc rgb colour(2) pt 7

set title '2. patch'
set xlabel 'mm'
set yrange [-0.6:0.6]
plot 0.3 dt 2 lc '#999999' notitle, -0.3 dt 2 lc '#999999' notitle, \
     'truth_patch.tsv' using 1:(difference(3)) title 'rings' lc rgb colour(1) pt 7, \
     'truth_irregular_patch.tsv' using 1:(difference(3)) title 'DistMesh' lc rgb colour(2) pt 7

set title '3. patch on a foundation'
set yrange [-3:6]
plot 1 dt 2 lc '#999999' notitle, -1 dt 2 lc '#999999' notitle, \
     'truth_foundation.tsv' using 1:(difference(4)) title 'even rings' lc rgb colour(1) pt 7, \
     '' using 1:(difference(3)) title 'graded DistMesh' lc rgb colour(2) pt 7

set title '4, 7. cornea, capsule'
set xlabel 'Pa'
set yrange [-2:2]
plot 1 dt 2 lc '#999999' notitle, -1 dt 2 lc '#999999' notitle, \
     'truth_cap.tsv' using 1:(difference(3)) title 'cornea' lc rgb colour(1) pt 7, \
     'truth_capsule.tsv' using 1:(difference(3)) title 'capsule' lc rgb colour(2) pt 7

set key bottom right
do for [ball in 'a b c'] {
    set title '6' . ball . '. ball of ' . (ball eq 'a' ? '0.5' : ball eq 'b' ? '1' : '2') . ' mm'
    set xlabel 'depth [radii]'
    set yrange [-10:5]
    plot 1 dt 2 lc '#999999' notitle, -1 dt 2 lc '#999999' notitle, \
         for [i = 3:5] 'truth_ball_' . ball . '.tsv' using 1:(difference(i)) \
             title word('vertex edge face', i - 2) lc rgb colour(i - 2) pt 7, \
         '' using 1:(difference(12)) title 'graded DistMesh' lc rgb colour(4) pt 7
}

set key top right
set title '8. shells that bend'
set xlabel 'Pa'
set yrange [-10:20]
plot 3 dt 2 lc '#999999' notitle, -3 dt 2 lc '#999999' notitle, \
     'truth_shell.tsv' using 1:(difference(3)) title 'cornea, DistMesh' lc rgb colour(2) pt 7, \
     '' using 1:(difference(4)) title 'cornea, rings' lc rgb colour(1) pt 7, \
     '' using 1:(100 * (column(3) / column(8) - 1)) title 'cornea, no shear' lc rgb colour(4) pt 7, \
     'truth_plate.tsv' using 1:(difference(3)) title 'plate, hinged' lc rgb colour(3) pt 7

set title '9. two balls'
set xlabel 'depth [radii]'
set yrange [-10:10]
plot 1 dt 2 lc '#999999' notitle, -1 dt 2 lc '#999999' notitle, \
     'truth_tools.tsv' using 1:(difference(3)) title 'each of two' lc rgb colour(1) pt 7, \
     '' using 1:(difference(4)) title 'by faces' lc rgb colour(4) pt 7, \
     '' using 1:(difference(6)) title 'graded DistMesh' lc rgb colour(2) pt 7
unset multiplot

# What triangles as large as the contact do to the force of a ball, against the depth in edges.
set terminal svg size 900,330 font 'Helvetica,Arial,sans-serif,12' background '#ffffff'
set output 'facets.svg'
set multiplot layout 1,3 title 'Force of a ball: difference [%] by depth over edge' font ',15'
edge = 5.0 / 28  # [mm]
names = 'vertex edge face'
over(i) = 'over ' . word('a an a', i + 1) . ' ' . word(names, i + 1)
radius(ball) = ball eq 'a' ? 0.5 : ball eq 'b' ? 1 : 2
set xlabel 'depth / edge'
set xrange [0.05:10]
set yrange [-30:45]
set key top right
plot_of(first, step) = sprintf("plot 0 lc '#999999' notitle, for [b in 'a b c'] for [i = 0:2] 'truth_ball_'.b.'.tsv' using ($1 * radius(b) / edge):(difference(%d + %d * i)) title (b eq 'a' ? over(i) : '') lc rgb colour(i + 1) pt 7", first, step)
set title 'vertices carry the contact'
eval plot_of(3, 1)
set title 'faces carry it'
eval plot_of(6, 2)
set title 'faces, FacetCorrection'
eval plot_of(7, 2)
unset multiplot
