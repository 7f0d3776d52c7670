// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <membrane/certify/convexity.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"
#include "support/sparse_newton.hpp"

namespace test {

/// Holds a `ConvexityModel` against the smallest eigenvalue at random states within its radius; `share` of the cases at
/// least must be found convex.
template <membrane::ConvexityModel Model>
void bounds_hold_nearby(double share) {
    using namespace membrane;
    int convex = 0;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = {7}});
        const double stiffness = std::pow(10, random.number(-1.5, 0.5));
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness});
        const Points<double> x = jittered(mesh.positions(), std::pow(10, random.number(-4.0, -1.0)), random);
        const Index held = 8 + random.index(30);
        const double radius = std::pow(10, random.number(-6.0, -1.5));
        EquilibriumProblem problem(network);
        REQUIRE(problem.assign(x, network, foundation, pull(held, point(x, held))) == ProblemStatus::valid);
        Model model(problem);
        const double bound = model.eigenvalue_bound(problem, radius);
        CAPTURE(stiffness, radius, bound);
        if (!(bound > 0)) continue;
        ++convex;
        StillMembrane still(network, mesh.positions(), stiffness);
        for (int i = 0; i < 5; ++i) {
            Points<double> y = x;
            for (Index v = 0; v < y.cols(); ++v) {
                if (!problem.fixed(v)) y.col(v) += (i == 0 ? -1 : random.number()) * radius * random.unit_vector();
            }
            std::vector<Eigen::Index> rows;
            for (Index v = 0; v < y.cols(); ++v) {
                for (int k = 0; k < 3 && !problem.fixed(v); ++k) rows.push_back(3 * v + k);
            }
            const Eigen::MatrixXd H = Eigen::MatrixXd(still.stiffness(y))(rows, rows);
            REQUIRE(eigenvalues_of(H)[0] >= bound);
        }
    }
    CHECK(convex >= share * cases(100));
}

}  // namespace test
