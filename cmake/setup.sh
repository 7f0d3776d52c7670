# Sourced by tests/run, examples/run, bench/run and .ci/run: sets the machine up, configures, builds.
# Bash; the caller has `set -euo pipefail`. What is said goes to stderr, so that a program's output stays its own.

# The same in every environment, and in one that sets nothing: dpkg needs a path.
export LC_ALL=C.UTF-8 PATH

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '== %s\n' "$*" >&2; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

# usage FILE: the comment at the top of a script is its help.
usage() { sed -n '2,/^[^#]/{s/^# \{0,1\}//p}' "$1"; }

# require PACKAGE...: installs what is missing on Debian or Ubuntu, and runs no apt at all where nothing is.
require() {
    if ! command -v dpkg-query apt-get > /dev/null; then
        command -v cmake ninja c++ > /dev/null || die "this needs what Debian and Ubuntu call: $*"
        return
    fi
    local package missing=()
    for package in "$@"; do
        [[ $(dpkg-query --show --showformat '${db:Status-Status}' "$package" 2> /dev/null) == installed ]] ||
            missing+=("$package")
    done
    if ((${#missing[@]} == 0)); then return; fi

    local as_root=()
    if ((EUID != 0)); then
        command -v sudo > /dev/null || die "packages are missing; as root: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    say "installing ${missing[*]}"
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -qq --yes --no-install-recommends "${missing[@]}" > /dev/null
}

# With ccache, if there is one, a clean clone is built at no cost from what was built before. It cannot keep precompiled
# headers.
cache_options=()
if command -v ccache > /dev/null; then
    export CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
    cache_options=(-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON)
fi

# runs_here BENCHMARK: whether this processor has what the benchmark is built for.
runs_here() {
    local flag flags=()
    case $1 in
        *_avx2*) flags=(avx2) ;;
        *_avx512*) flags=(avx512f avx512dq avx512vl avx512bw fma) ;;
    esac
    for flag in "${flags[@]}"; do grep -qsw "$flag" /proc/cpuinfo || return; done
}

# configure PRESET PART... [-- CMAKE ARGUMENT...]: build/PRESET with these parts (tests, examples, benchmarks). A part that
# was asked for before stays, so that nothing is built twice.
configure() {
    local preset=$1 options=()
    shift
    if [[ ! -f $root/build/$preset/CMakeCache.txt ]]; then
        options+=(-DMEMBRANE_BUILD_{TESTS,EXAMPLES,BENCHMARKS}=OFF)
    fi
    while (($# > 0)) && [[ $1 != -- ]]; do
        options+=(-D "MEMBRANE_BUILD_${1^^}=ON")
        shift
    done
    if (($# > 0)); then shift; fi

    local version log
    version=$(cmake --version | sed -n '1s/[^0-9]*//p')
    [[ $(printf '%s\n' 3.25 "$version" | sort --version-sort | head -n 1) == 3.25 ]] ||
        die "CMake 3.25 or newer is needed (Debian 12, Ubuntu 23.04), this is $version"
    say "configuring build/$preset"
    log=$(cd "$root" && cmake --preset "$preset" "${cache_options[@]}" "${options[@]}" "$@" 2>&1) || die "cmake failed"$'\n'"$log"
}

# build PRESET TARGET...
build() {
    local preset=$1
    shift
    say "building ${*#membrane_}"
    cmake --build "$root/build/$preset" --parallel "$(nproc)" --target "$@" >&2
}

# assimp's CMake package names zlib's library, which Debian's does not bring.
test_packages=(g++ cmake ninja-build libeigen3-dev catch2 libcgal-dev libseccomp-dev libcli11-dev libassimp-dev
    libtinyobjloader-dev zlib1g-dev)
example_packages=(g++ cmake ninja-build libeigen3-dev libcli11-dev nlohmann-json3-dev libassimp-dev
    libtinyobjloader-dev zlib1g-dev gnuplot-nox)
bench_packages=(g++ cmake ninja-build libeigen3-dev libbenchmark-dev nlohmann-json3-dev gnuplot-nox
    libbullet-dev libcgal-dev libembree-dev libfcl-dev)
truth_packages=(calculix-ccx)
check_packages=(clang clang-format-14 clang-tidy debootstrap doxygen g++-mingw-w64-x86-64-posix git libclang-rt-dev meson
    pkg-config python3 valgrind)

# one_core: sets `pinned`, the command that keeps another on the core of this script, where there is taskset.
one_core() {
    pinned=()
    if command -v taskset > /dev/null; then pinned=(taskset --cpu-list "$(taskset -cp $$ | grep -oE '[0-9]+$')"); fi
}

# median FILE [COLUMN]: of the numbers in a column, the first if none is given; of an even count the lower one.
median() {
    awk -v column="${2-1}" '{ print $column }' "$1" | sort -g | awk '{ all[NR] = $1 } END { print all[int((NR + 1) / 2)] }'
}
