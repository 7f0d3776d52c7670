#!/usr/bin/env bash
# bench/support.sh [--out DIR]
#
# The topic `support` of bench/run; bench/support is a folder. Presses, slides and draws membranes that a rim supports, a
# foundation, or both: how far the force of a step is off the equilibrium, and how long a tick takes, with and without
# the coarse correction. Installs what is missing (Debian, Ubuntu) and prints a table. Writes support.csv and support.svg
# to DIR (build/bench). Takes three minutes.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

results=$root/build/bench
while (($# > 0)); do
    case $1 in
        --help)
            usage "$0"
            exit
            ;;
        --out)
            (($# > 1)) || die "--out needs a folder"
            results=$(realpath --canonicalize-missing "$2")
            shift
            ;;
        *) die "there is no option $1" ;;
    esac
    shift
done

require "${bench_packages[@]}"
configure release benchmarks
build release benchmark_support
say "measuring"
one_core
nice "${pinned[@]}" "$root/build/release/bench/benchmark_support" "$results"
(cd "$results" && gnuplot "$root/bench/support/support.gnuplot")
say "figures and the plot are in $results"
