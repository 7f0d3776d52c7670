// SPDX-License-Identifier: MIT
#include <membrane/accuracy/convexity.hpp>

#include <array>
#include <cmath>

#include <membrane/mesh/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/convexity_check.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("no spring is less stiff than the bound while its ends are near", "[convexity]") {
    int known = 0;
    double tightest = 1;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Spring<double> spring{0, 1, random.number(0.1, 10.0), random.number(0.0, 2.0)};
        const Vector3<double> reach = random.number(0.2, 2.0) * random.unit_vector();
        const double way = std::pow(10, random.number(-6.0, 0.0)) * norm(reach);
        CAPTURE(spring.stiffness, spring.rest_length, norm(reach), way);
        const auto bound = least_stiffness(spring, reach, way);
        if (!bound) continue;
        ++known;
        const Eigen::Matrix3d along = bound->u * bound->u.transpose();
        const Eigen::Matrix3d least = bound->along * along + bound->across * (Eigen::Matrix3d::Identity() - along);
        for (int i = 0; i < 10; ++i) {
            const double part = i == 0 ? 1 : random.number();
            const Vector3<double> aside = i == 0 ? Vector3<double>(-bound->u) : random.unit_vector();
            const Vector3<double> there = reach + part * way * aside, u = there / norm(there);
            const double q = spring.rest_length / norm(there);
            const Eigen::Matrix3d stiffness =
                spring.stiffness * ((1 - q) * Eigen::Matrix3d::Identity() + q * u * u.transpose());
            const double above = test::eigenvalues_of(stiffness - least)[0];
            REQUIRE(above >= -1e-13 * spring.stiffness);
            tightest = std::min(tightest, above / spring.stiffness);
            REQUIRE(test::eigenvalues_of(stiffness).cwiseAbs().maxCoeff() <= spring.stiffness * (1 + 1e-12));
        }
    }
    CHECK(known > cases(20'000) / 4);
    CHECK(tightest < 1e-10);
}

TEST_CASE("springs that may become too short have no bound", "[convexity]") {
    const Spring<double> spring{0, 1, 1, 1};
    CHECK(least_stiffness(spring, {1, 0, 0}, 0.1));
    CHECK_FALSE(least_stiffness(spring, {1, 0, 0}, 0.5));
    CHECK_FALSE(least_stiffness(spring, {0.5, 0, 0}, 0.01));
    CHECK_FALSE(least_stiffness(spring, {0, 0, 0}, 0));
    CHECK(least_stiffness(Spring<double>{0, 1, 1, 0}, {1, 0, 0}, 0.4));
    CHECK_FALSE(least_stiffness(Spring<double>{0, 1, 1, 0}, {1, 0, 0}, 0.6));
}

TEST_CASE("blocks: nowhere near is the stiffness less than the bound", "[convexity]") {
    test::bounds_hold_nearby<BlockConvexity>(0.3);
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
    const VirtualVolumeSprings backing(mesh, {.stiffness = 1.0});
    RestProblem problem(network);
    REQUIRE(problem.take(x, network, backing) == ProblemStatus::sound);
    BlockConvexity convexity(problem);
    CHECK(convexity.around(problem, 0) == Approx(1 - 3 * 0.1).epsilon(1e-3));
}
