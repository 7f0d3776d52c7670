// SPDX-License-Identifier: MIT
#include <membrane/certify/factored_convexity.hpp>

#include "support/catch.hpp"
#include "support/convexity_check.hpp"
#include "support/eigenvalues.hpp"

using namespace membrane;

TEST_CASE("factors: nowhere near is the stiffness less than the bound", "[factored_convexity]") {
    test::bounds_hold_nearby<FactoredConvexity>(0.4);
}

TEST_CASE("springs that pull make up for a foundation that is not there", "[factored_convexity]") {
    // A flat sheet, stretched in its rim: only the tension holds it.
    const auto mesh = disc<double>({.radius = 1, .rings = 4});
    const Adjacency adjacency(mesh);
    const auto rim = adjacency.border_vertices();
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = {rim.begin(), rim.end()}});
    const Points<double> x = 1.1 * mesh.positions();
    EquilibriumProblem problem(network);
    REQUIRE(problem.assign(x, network, NoFoundation{}) == ProblemStatus::valid);
    FactoredConvexity sharp(problem);
    const double bound = sharp.eigenvalue_bound(problem, 1e-4);
    CHECK(bound > 0);
    test::StillMembrane still(network, x, 0);
    std::vector<Eigen::Index> rows;
    for (Index v = 0; v < x.cols(); ++v) {
        for (int k = 0; k < 3 && !problem.fixed(v); ++k) rows.push_back(3 * v + k);
    }
    const Eigen::MatrixXd H = Eigen::MatrixXd(still.stiffness(x))(rows, rows);
    const double truth = test::eigenvalues_of(H)[0];
    CHECK(bound <= truth);
    CHECK(bound >= truth / 16);
    BlockConvexity blocks(problem);
    CHECK_FALSE(blocks.eigenvalue_bound(problem, 1e-4) > 0);
}

TEST_CASE("where nothing is free, or nothing holds, there is no bound to be wrong", "[factored_convexity]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 0});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    EquilibriumProblem problem(network);
    FactoredConvexity sharp(problem);
    REQUIRE(problem.assign(mesh.positions(), network, NoFoundation{}) == ProblemStatus::valid);
    CHECK_FALSE(sharp.eigenvalue_bound(problem, 1e-6) > 0);
    REQUIRE(problem.assign(0 * mesh.positions(), network, NoFoundation{}) == ProblemStatus::valid);
    CHECK_FALSE(sharp.eigenvalue_bound(problem, 1e-6) > 0);
}
