// SPDX-License-Identifier: MIT
#include <membrane/solve/step.hpp>

#include <limits>

#include "support/catch.hpp"
#include "support/refusal.hpp"

using membrane::SolverOptions;

TEST_CASE("solver options out of range are refused by name") {
    const auto refused = [](SolverOptions<double> options) { return test::refusal([&] { options.check(); }); };
    CHECK(refused({}).empty());
    CHECK(refused({.layers = membrane::unlimited, .sweeps = 1000000, .most_visits = 1}).empty());
    CHECK(refused({.layers = -1}) == "QuasiStaticSolver: layers must be at least 0, got -1");
    CHECK(refused({.sweeps = 0}) == "QuasiStaticSolver: sweeps must be at least 1, got 0");
    CHECK(refused({.most_visits = 0}) == "QuasiStaticSolver: most_visits must be at least 1, got 0");
    CHECK(refused({.most_touches = -5}) == "QuasiStaticSolver: most_touches must be at least 0, got -5");
    CHECK(refused({.most_in_groups = -1}) == "QuasiStaticSolver: most_in_groups must be at least 0, got -1");
    for (const double bad :
         {-1e-9, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
        CHECK_THAT(refused({.negligible_force = bad}),
                   ContainsSubstring("QuasiStaticSolver: negligible_force must be finite and not negative [N], got "));
        CHECK_THAT(refused({.rigid_stiffness = bad}),
                   ContainsSubstring("QuasiStaticSolver: rigid_stiffness must be finite and not negative [N/m], got "));
    }
}

TEST_CASE("a report begins as a step that did nothing") {
    const membrane::StepReport<float> report;
    CHECK(report.status == membrane::StepStatus::advanced);
    CHECK_FALSE(report.converged);
    CHECK(report.moved.empty());
    CHECK(report.reactions.empty());
    CHECK(report.visits == 0);
}
