// SPDX-License-Identifier: MIT
#pragma once

/// How many random cases to run: `full` in an optimised build; a twentieth, but at least one, where asserts or a
/// sanitizer make each case slow.
///
///     for (int seed = 1; seed <= cases(200); ++seed) {
///         CAPTURE(seed);
inline int cases(int full) {
#if defined(NDEBUG) && !defined(__SANITIZE_ADDRESS__)
    return full;
#else
    return full < 20 ? 1 : full / 20;
#endif
}
