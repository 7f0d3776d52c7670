// SPDX-License-Identifier: MIT
#include <membrane/core/check.hpp>

#include <limits>

#include "support/catch.hpp"

// Compiled with -ffast-math -fno-finite-math-only: with the first alone no header compiles.

using namespace membrane;

namespace {

/// The number, out of the optimiser's sight.
template <class S>
S hidden(S number) {
    volatile S copy = number;
    return copy;
}

}  // namespace

TEMPLATE_TEST_CASE("numbers that are not finite are recognised also under fast math", "[fast_math]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    for (const S number : {S(0), S(1), S(-1), Limits::min(), Limits::max(), Limits::lowest()}) {
        CHECK(is_finite(hidden(number)));
    }
    Eigen::Matrix<S, 3, Eigen::Dynamic> points(3, 4);
    points.setOnes();
    CHECK(is_finite(points));
    for (const S number : {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN()}) {
        CHECK_FALSE(is_finite(hidden(number)));
        CHECK_FALSE(is_finite(number));
        points(1, 2) = hidden(number);
        CHECK_FALSE(is_finite(points));
    }
}

TEST_CASE("this program is compiled with fast math", "[fast_math]") {
#ifdef __NO_MATH_ERRNO__
    SUCCEED();
#else
    FAIL("compile tests/fast_math with -ffast-math -fno-finite-math-only");
#endif
}
