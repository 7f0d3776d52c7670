// SPDX-License-Identifier: MIT
#include <numbers>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/trousers.hpp"

// Closed form: each leg takes toughness times thickness / 2, but for its stretch. `bench/run tear` has finer meshes and
// more directions.
TEMPLATE_TEST_CASE("a strip that is torn like trousers takes the force of the closed form, on any grid", "[tear]",
                   double, float) {
    const int directions = cases(3, 20), edges = cases_are_slow ? 4 : 12;
    double mean = 0;
    for (int i = 0; i < directions; ++i) {
        const double turn = 60.0 * i / directions;
        const auto found = test::tear_trousers<TestType>({.width = 4, .turn = turn * std::numbers::pi / 180}, edges);
        CAPTURE(turn, found.mean, found.low, found.high);
        CHECK(found.mean == Approx(1).epsilon(0.1));
        mean += found.mean / directions;
    }
    CHECK(mean == Approx(1).epsilon(0.05));
}
