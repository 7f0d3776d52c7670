// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdlib>

#if defined(NDEBUG) && !defined(__SANITIZE_ADDRESS__)
inline constexpr bool cases_are_slow = false;
#else
inline constexpr bool cases_are_slow = true;  // asserts, or a sanitizer
#endif

/// How many random cases to run: `usual`, or `in_long_run` where `tests/run --long` asks for it (MEMBRANE_LONG_TESTS); a
/// twentieth where asserts or a sanitizer make each case slow. At least one.
///
///     for (int seed = 1; seed <= cases(200, 20'000); ++seed) {
///         CAPTURE(seed);
inline int cases(int usual, int in_long_run) {
    if (cases_are_slow) return (std::max)(1, usual / 20);
    return std::getenv("MEMBRANE_LONG_TESTS") != nullptr ? in_long_run : usual;
}
/// All of `most` in a long run, a fifth otherwise; a twentieth where each case is slow.
inline int cases(int most) { return cases(cases_are_slow ? most : (std::max)(1, most / 5), most); }
