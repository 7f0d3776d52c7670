// SPDX-License-Identifier: MIT
#include <membrane/certify/convexity.hpp>

#include <cmath>

#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"
#include "support/convexity_check.hpp"

using namespace membrane;

TEST_CASE("blocks: nowhere near is the stiffness less than the bound", "[convexity]") {
    test::bounds_hold_nearby<BlockConvexity>(0.3);
}

TEST_CASE("a spring between two fixed vertices does not hide those after it", "[convexity]") {
    Points<double> x(3, 3);
    x << 0, 1, 0.5,             //
        0, 0, std::sqrt(0.75),  //
        0, 0, 0;
    Triangles triangles(3, 1);
    triangles.col(0) << 0, 1, 2;
    const TriangleMesh<double> mesh(x, triangles);
    const MassSpringNetwork network(mesh, LinearSpring{},
                                    {.stiffness = 1.0, .rest_length = std::vector(3, 0.9), .pinned = {0, 1}});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 1.0});
    EquilibriumProblem problem(network);
    REQUIRE(problem.assign(x, network, foundation) == ProblemStatus::valid);
    BlockConvexity convexity(problem);
    // Along the normal: the foundation, and the tension of two springs over their length.
    CHECK(convexity.eigenvalue_bound(problem, 0) == Approx(1 + 2 * 0.1).epsilon(1e-3));
}

TEST_CASE("blocks are even where one spring of many pushes", "[convexity]") {
    // Weights 1 would leave k - 2 p, the best leave the smallest eigenvalue: k - 2 p as well for a single spring, and
    // more than k - 4 p for two in a row, of which the middle vertex feels both.
    Points<double> x = Points<double>::Zero(3, 3);
    x.row(0) << -1, 0, 1;
    x(1, 1) = 1e-9;
    Triangles triangles(3, 1);
    triangles.col(0) << 0, 1, 2;
    const TriangleMesh<double> mesh(x, triangles);
    const MassSpringNetwork network(mesh, LinearSpring{},
                                    {.stiffness = 1.0, .rest_length = std::vector{1.1, 1.0, 1.1}});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 1.0});
    EquilibriumProblem problem(network);
    REQUIRE(problem.assign(x, network, foundation) == ProblemStatus::valid);
    BlockConvexity convexity(problem);
    CHECK(convexity.eigenvalue_bound(problem, 0) == Approx(1 - 3 * 0.1).epsilon(1e-3));
}
