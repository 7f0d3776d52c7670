// SPDX-License-Identifier: MIT
#include <membrane/solve/step.hpp>

#include <limits>

#include "support/catch.hpp"
#include "support/refusal.hpp"

using membrane::SolverOptions;

TEST_CASE("solver options out of range are refused by name") {
    const auto refused = [](SolverOptions<double> options) { return test::refusal([&] { options.validate(); }); };
    CHECK(refused({}).empty());
    CHECK(refused({.layers = membrane::unlimited, .sweeps = 1000000, .max_vertex_updates = 1}).empty());
    CHECK(refused({.layers = -1}) == "QuasiStaticSolver: layers must be at least 0, got -1");
    CHECK(refused({.sweeps = 0}) == "QuasiStaticSolver: sweeps must be at least 1, got 0");
    CHECK(refused({.max_vertex_updates = 0}) == "QuasiStaticSolver: max_vertex_updates must be at least 1, got 0");
    CHECK(refused({.max_contact_points = -5}) == "QuasiStaticSolver: max_contact_points must be at least 0, got -5");
    CHECK(refused({.max_packed_vertices = -1}) == "QuasiStaticSolver: max_packed_vertices must be at least 0, got -1");
    for (const double bad :
         {-1e-9, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
        CHECK_THAT(refused({.force_tolerance = bad}),
                   ContainsSubstring("QuasiStaticSolver: force_tolerance must be finite and not negative [N], got "));
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
    CHECK(report.vertex_updates == 0);
}

#define CHECK_NAME(status) CHECK(to_string(membrane::StepStatus::status) == #status)

TEST_CASE("a status has the name that it has in a program", "[solver]") {
    CHECK_NAME(advanced);
    CHECK_NAME(bad_time_step);
    CHECK_NAME(invalid_input);
    CHECK_NAME(unstable);
    CHECK_NAME(too_many_contact_points);
    CHECK_NAME(wrong_vertex_count);
    CHECK_NAME(network_missed_split);
    CHECK_NAME(foundation_missed_split);
    CHECK_NAME(solver_missed_split);
    CHECK_NAME(contact_missed_split);
}
