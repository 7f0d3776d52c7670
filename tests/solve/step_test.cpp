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

TEST_CASE("a status has the name that it has in a program", "[solver]") {
    CHECK(to_string(membrane::StepStatus::advanced) == "advanced");
    CHECK(to_string(membrane::StepStatus::bad_time_step) == "bad_time_step");
    CHECK(to_string(membrane::StepStatus::invalid_input) == "invalid_input");
    CHECK(to_string(membrane::StepStatus::unstable) == "unstable");
    CHECK(to_string(membrane::StepStatus::too_many_contact_points) == "too_many_contact_points");
    CHECK(to_string(membrane::StepStatus::wrong_vertex_count) == "wrong_vertex_count");
    CHECK(to_string(membrane::StepStatus::network_missed_split) == "network_missed_split");
    CHECK(to_string(membrane::StepStatus::foundation_missed_split) == "foundation_missed_split");
    CHECK(to_string(membrane::StepStatus::solver_missed_split) == "solver_missed_split");
    CHECK(to_string(membrane::StepStatus::contact_missed_split) == "contact_missed_split");
}
