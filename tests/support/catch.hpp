// SPDX-License-Identifier: MIT
#pragma once

// The one place that knows which Catch2 is installed: version 2 is a single header, version 3 is not. An exception that
// is not expected ends its test; to catch it at each check would cost a twentieth of the build.
#define CATCH_CONFIG_FAST_COMPILE
#if __has_include(<catch2/catch_all.hpp>)
#include <catch2/catch_all.hpp>
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
#else
#include <catch2/catch.hpp>
inline auto ContainsSubstring(const std::string& text) { return Catch::Matchers::Contains(text); }
#endif

// For `TEMPLATE_TEST_CASE("...", "[...]", TEST_SCALARS)`. Where float differs from double by more than roundings, as in
// lanes and ranges, a test names both itself. Tests of many laws, rules or elements take some of them only with
// `if constexpr (all_types)`.
#ifdef MEMBRANE_TEST_ALL_TYPES
#define TEST_SCALARS double, float
inline constexpr bool all_types = true;
#else
#define TEST_SCALARS double
inline constexpr bool all_types = false;
#endif
