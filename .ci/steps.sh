# Sourced by .ci/run and .ci/release: named steps, each one's share of the time. Stops at the first that fails.
# Bash; the caller has sourced cmake/setup.sh.

exec < /dev/null  # no input from a terminal

current=packages begun=0 names=() seconds=()

# ended: the step that was begun last, and how long it took.
ended() {
    names+=("$current")
    seconds+=("$((SECONDS - begun))")
    begun=$SECONDS
}

# shares: each step's part of the time.
shares() {
    local i
    printf '\n'
    for i in "${!names[@]}"; do
        printf '%5d s %3d %%  %s\n' "${seconds[i]}" "$((100 * seconds[i] / (SECONDS > 0 ? SECONDS : 1)))" "${names[i]}"
    done
}

failed() {
    ended
    shares
    printf '\nFAILED after %d s: %s\n' "$SECONDS" "$current"
}
trap failed EXIT

# step NAME COMMAND...
step() {
    ended
    current=$1
    printf '\n=== %d. %s\n' "${#names[@]}" "$current"
    shift
    "$@"
    printf '=== %s: passed in %d s\n' "$current" "$((SECONDS - begun))"
}

# sanitized [CMAKE ARGUMENT...]: the tests of code with its own memory access, with assertions and sanitizers.
sanitized() {
    configure asan tests -- "$@"
    build asan membrane_tests
    (cd "$root" && ctest --preset asan)
}

# all_passed: after the last step.
all_passed() {
    ended
    trap - EXIT
    shares
    printf '\nAll %d steps passed in %d s.\n' "$((${#names[@]} - 1))" "$SECONDS"
}
