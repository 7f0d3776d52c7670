// SPDX-License-Identifier: MIT
#include <algorithm>
#include <numbers>
#include <type_traits>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/torn_centre.hpp"
#include "support/trousers.hpp"

// Closed form: each leg takes toughness times thickness / 2, but for its stretch. In a long run as `bench/run tear`.
// The mean force of legs that stretch by 5 % depends less on the grid.
TEMPLATE_TEST_CASE("a strip that is torn like trousers takes the force of the closed form, on any mesh and grid",
                   "[tear]", TEST_SCALARS) {
    const int directions = cases(1, 20);
    const bool is_long = directions >= 20;
    const std::vector<int> widths = is_long && std::is_same_v<TestType, double> ? std::vector{4, 6, 8} : std::vector{4};
    const int edges = cases_are_slow ? 4 : is_long ? 20 : 6;
    for (const double strain : {0.02, 0.05}) {
        if (!in_full() && strain == 0.05) continue;
        double mean = 0, least = 10, largest = 0;
        for (const int width : widths) {
            for (int i = 0; i < directions; ++i) {
                const double turn = is_long ? 60.0 * i / (directions - 1) : 25;
                const auto found = test::tear_trousers<TestType>({.width = width,
                                                                  .turn = turn * std::numbers::pi / 180,
                                                                  .strain = strain,
                                                                  .steps = is_long ? 20 : 10},
                                                                 edges);
                CAPTURE(strain, width, turn, found.mean, found.low, found.high, found.relaxed, found.lost);
                CHECK(found.mean == Approx(1).epsilon(0.1));
                CHECK(std::abs(found.lost) < 0.002);
                CHECK(found.relaxed > 0);
                CHECK(found.relaxed < 0.2);  // what folds beside the tip release as they snap over
                mean += found.mean / (directions * static_cast<double>(widths.size()));
                least = std::min(least, found.mean), largest = std::max(largest, found.mean);
            }
        }
        CAPTURE(strain, mean, least, largest);
        CHECK(mean == Approx(1).epsilon(0.05));
        CHECK(largest - least <= 0.1 * mean);
    }
}

// A drag on each vertex that is above the membrane's stiffness: jumps take several ticks, and the drag takes their
// energy.
TEMPLATE_TEST_CASE("in a viscous fluid the hands' work is stored, or taken by tear and drag", "[tear]", TEST_SCALARS) {
    const double bar = std::is_same_v<TestType, double> ? 0.01 : 0.03;
    for (const double turn : {0.0, 20.0, 45.0}) {
        if (!in_full() && turn != 20) continue;
        const auto found = test::tear_trousers<TestType>(
            {.width = 4, .turn = turn * std::numbers::pi / 180, .strain = 0.1, .relative_drag = 1.5, .steps = 1},
            cases_are_slow ? 2 : 4, 1.0 / 500);
        CAPTURE(turn, found.torn, found.damped, found.relaxed, found.lost);
        CHECK(found.torn + found.damped == Approx(1).margin(bar));
        CHECK(found.damped > 0.1);
        CHECK(std::abs(found.lost) < 0.002);
    }
}

TEMPLATE_TEST_CASE("in a viscous fluid tear and drag take what a stretched sheet gives around a cut", "[tear]",
                   TEST_SCALARS) {
    const auto found = test::tear_from_centre<TestType>({.rows = 24, .turn = 0.3, .relative_drag = 5}, 2);
    CAPTURE(found.torn, found.damped, found.relaxed, found.lost);
    CHECK(found.torn + found.damped == Approx(1).margin(std::is_same_v<TestType, double> ? 0.01 : 0.03));
    CHECK(found.damped > 0.05);
    CHECK(std::abs(found.lost) < 0.002);
}
