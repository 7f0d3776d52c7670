// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdlib>
#include <limits>

#if defined(NDEBUG) && !defined(__SANITIZE_ADDRESS__)
inline constexpr bool cases_are_slow = false;
#else
inline constexpr bool cases_are_slow = true;  // asserts, or a sanitizer
#endif

/// Whether tests that take seconds run in full, as with `tests/run --long`.
inline bool in_full() { return !cases_are_slow && std::getenv("MEMBRANE_LONG_TESTS") != nullptr; }

/// How many random cases to run: `usual`; `in_long_run` times MEMBRANE_LONG_TESTS where that is set, to 1 by
/// `tests/run --long` and to more by `tests/campaign`; a twentieth where asserts or a sanitizer make each case slow. At
/// least one.
///
///     for (int seed = 1; seed <= cases(200, 20'000); ++seed) {
///         CAPTURE(seed);
inline int cases(int usual, int in_long_run) {
    if (cases_are_slow) return (std::max)(1, usual / 20);
    const char* const times = std::getenv("MEMBRANE_LONG_TESTS");
    if (times == nullptr) return usual;
    const long long all = (std::max)(1LL, std::atoll(times)) * in_long_run;
    return static_cast<int>((std::min)(all, static_cast<long long>(std::numeric_limits<int>::max())));
}
/// All of `most` in a long run, an eighth otherwise; a twentieth where each case is slow.
inline int cases(int most) { return cases(cases_are_slow ? most : (std::max)(1, most / 8), most); }
