# What all plots share, loaded before each.
set encoding utf8
set grid lc "#e2e2e2" lw 0.7
set border 3 lc "#444444"
set tics nomirror
set style data lines
