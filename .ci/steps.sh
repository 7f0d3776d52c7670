# Sourced by .ci/run and .ci/release: named steps, with the time of each. Stops at the first that fails.
# Bash; the caller has sourced cmake/setup.sh.

exec < /dev/null  # no input from a terminal

passed=$(mktemp) current="installing packages" beside=

stopped() {
    if [[ -n $beside ]]; then kill -- "-$beside" 2> /dev/null || true; fi
    printf '\n%s\n\nFAILED after %d s: %s\n' "$(cat "$passed")" "$SECONDS" "$current"
    rm "$passed"
}
trap stopped EXIT

# count_processor_time: sets `processor_time` to the seconds that this shell's commands have taken. In a pipe it would
# count that of another shell.
count_processor_time() {
    local times=$passed.$BASHPID
    times > "$times"
    processor_time=$(awk -F '[ms ]+' 'END { printf "%d", 60 * $1 + $2 + 60 * $3 + $4 }' "$times")
    rm "$times"
}

# step NAME COMMAND...: with its time, and the time of processors that it took.
step() {
    local begun=$SECONDS before processor_time
    count_processor_time
    before=$processor_time
    current=$1
    printf '\n=== %s\n' "$current"
    "${@:2}"
    count_processor_time
    printf '%5d s, %5d of a processor  %s\n' $((SECONDS - begun)) $((processor_time - before)) "$1" |
        tee --append "$passed"
}

# side_by_side STEPS STEPS: two functions of steps at the same time, since a core is idle while the other compiles the
# last long file of a step, or packages are fetched. What the second one prints follows after all of the first.
side_by_side() {
    local log
    log=$(mktemp)
    set -m  # makes it and all its children a group, which can be killed
    ("$2") > "$log" 2>&1 &
    beside=$!
    set +m
    "$1"
    current="the last step above"
    if wait "$beside"; then beside=; fi
    cat "$log"
    rm "$log"
    [[ -z $beside ]]
}

# sanitized [CMAKE ARGUMENT...]: the tests of code with its own memory access, with assertions and sanitizers.
sanitized() {
    configure asan tests -- "$@"
    build asan membrane_tests
    (cd "$root" && ctest --preset asan)
}

# all_passed: after the last step.
all_passed() {
    trap - EXIT
    printf '\n%s\n\nAll %d steps passed in %d s.\n' "$(cat "$passed")" "$(wc --lines < "$passed")" "$SECONDS"
    rm "$passed"
}
