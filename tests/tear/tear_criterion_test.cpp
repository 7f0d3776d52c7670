// SPDX-License-Identifier: MIT
#include <membrane/tear/tear_criterion.hpp>

#include "support/catch.hpp"
#include "support/refusal.hpp"

using namespace membrane;

TEST_CASE("a tear opens by energy from toughness times thickness on, along the driving force", "[tear]") {
    const EnergyRelease criterion{.toughness = 1000, .thickness = 1e-5};
    CHECK(criterion.resistance() == Approx(0.01));
    TipState<double> tip{{0, 0.00999, 0}, 1e9, {1, 0, 0}, {0, 1, 0}};
    CHECK_FALSE(criterion.opens(tip));
    tip.driving_force = {0.006, 0.00801, 0};
    CHECK(criterion.opens(tip));
    CHECK(criterion.direction(tip) == tip.driving_force);
}

TEST_CASE("a tear opens by tension across the largest one", "[tear]") {
    const LargestTension criterion{.strength = 5};
    TipState<double> tip{{1e9, 0, 0}, 4.9, Vector3<double>(1, 1, 0) / std::sqrt(2.0), {0, 1, 0}};
    CHECK_FALSE(criterion.opens(tip));
    tip.tension = 5;
    CHECK(criterion.opens(tip));
    const auto direction = criterion.direction(tip);
    CHECK(std::abs(dot<double>(direction, tip.tension_direction)) < 1e-15);
    CHECK(dot<double>(direction, tip.heading) > 0);
    CHECK(criterion.resistance() == 0);
}

TEST_CASE("constants of a tear are checked", "[tear]") {
    CHECK(test::refusal([] {
              EnergyRelease{0, 1}.validate();
          }) == "EnergyRelease: toughness must be finite and positive [J/m^2], got 0");
    CHECK(test::refusal([] {
              EnergyRelease{1, -1}.validate();
          }) == "EnergyRelease: thickness must be finite and positive [m], got -1");
    CHECK(test::refusal([] { LargestTension{-2}.validate(); }) ==
          "LargestTension: strength must be finite and positive [N/m], got -2");
}
