// SPDX-License-Identifier: MIT
#pragma once

#include <cstdlib>

/// How many random cases to run: `full` in an optimised build, or `in_long_run` in one that was asked to be long
/// (`tests/run --long` sets MEMBRANE_LONG_TESTS), or a fifth in one that was asked to be short (MEMBRANE_SHORT_TESTS); a
/// twentieth where asserts or a sanitizer make each case slow. At least one.
///
///     for (int seed = 1; seed <= cases(200); ++seed) {
///         CAPTURE(seed);
inline int cases(int full, int in_long_run) {
#if defined(NDEBUG) && !defined(__SANITIZE_ADDRESS__)
    if (std::getenv("MEMBRANE_LONG_TESTS") != nullptr) return in_long_run;
    return std::getenv("MEMBRANE_SHORT_TESTS") == nullptr ? full : full < 5 ? 1 : full / 5;
#else
    static_cast<void>(in_long_run);
    return full < 20 ? 1 : full / 20;
#endif
}
inline int cases(int full) { return cases(full, full); }
