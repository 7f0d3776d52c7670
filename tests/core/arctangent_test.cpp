// SPDX-License-Identifier: MIT
#include <membrane/core/arctangent.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

TEMPLATE_TEST_CASE("the angle is that of the standard library", "[arctangent]", float, double) {
    using S = TestType;
    Random random(1);
    const S epsilon = std::numeric_limits<S>::epsilon();
    for (int i = 0; i < cases(200'000); ++i) {
        // Near the axes and the diagonals as well, and of any size.
        const double angle = random.chance(0.5) ? random.number(-std::numbers::pi, std::numbers::pi)
                                                : std::numbers::pi / 8 * random.index(17) + random.number(-1e-6, 1e-6);
        const double size = std::pow(10.0, random.number(-30.0, 30.0));
        const auto y = static_cast<S>(size * std::sin(angle)), x = static_cast<S>(size * std::cos(angle));
        CAPTURE(y, x);
        const double expected = std::atan2(static_cast<double>(y), static_cast<double>(x));
        REQUIRE(std::abs(arctangent(y, x) - expected) <= 4 * epsilon * std::abs(expected));
    }
    constexpr S pi = std::numbers::pi_v<S>;
    CHECK(arctangent(S(0), S(0)) == 0);
    CHECK(arctangent(S(0), S(1)) == 0);
    CHECK(arctangent(S(1), S(0)) == pi / 2);
    CHECK(arctangent(S(0), S(-1)) == pi);
    CHECK(arctangent(S(-1), S(0)) == -pi / 2);
    CHECK(arctangent(S(1), S(1)) == pi / 4);
    for (const S large : {std::numeric_limits<S>::max() / 2, std::numeric_limits<S>::max()}) {
        CHECK(arctangent(large, large) == pi / 4);
        CHECK(arctangent(large, -large) == Approx(3 * pi / 4));
        CHECK(arctangent(-large, large) == -pi / 4);
    }
    CHECK(std::isnan(arctangent(std::numeric_limits<S>::quiet_NaN(), S(1))));
    CHECK(std::isnan(arctangent(S(1), std::numeric_limits<S>::quiet_NaN())));
}

TEMPLATE_TEST_CASE("each lane has the bits of its number alone", "[arctangent][lanes]", float, double) {
    using S = TestType;
    Random random(2);
    for (int i = 0; i < cases(10'000); ++i) {
        const auto numbers = [&] { return Lanes<S>::of([&](std::size_t) { return random.number(S(-1), S(1)); }); };
        const Lanes<S> y = numbers();
        Lanes<S> x = numbers();
        if (random.chance(0.5)) x = 3 + x;  // small angles in all lanes
        if (random.chance(0.1)) x.set(1, std::numeric_limits<S>::infinity());
        if (random.chance(0.1)) x.set(0, std::numeric_limits<S>::quiet_NaN());
        const Lanes<S> angle = arctangent(y, x);
        for (std::size_t l = 0; l < Lanes<S>::count; ++l) {
            const S alone = arctangent(y[l], x[l]);
            REQUIRE((angle[l] == alone || (std::isnan(angle[l]) && std::isnan(alone))));
            REQUIRE(std::isnan(alone) != std::isfinite(x[l]));
        }
    }
}
