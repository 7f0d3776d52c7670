// SPDX-License-Identifier: MIT
#include <membrane/model/mass_spring_network.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/meshes.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;

template <class S>
S expected_eigenvalue(const Matrix3<S>& a) {
    return static_cast<S>(test::eigenvalues_of(a.template cast<double>())[2]);
}

/// Minus the change of the force on `v` by its own position, by central differences.
template <class Network>
Matrix3<double> stiffness_block(const Network& network, Index v, Points<double> x, double h) {
    Matrix3<double> block;
    for (int k = 0; k < 3; ++k) {
        const double here = x(k, v);
        x(k, v) = here + h;
        const Vector3<double> after = network.force_on(v, x).force;
        x(k, v) = here - h;
        block.col(k) = (network.force_on(v, x).force - after) / (2 * h);
        x(k, v) = here;
    }
    return (block + block.transpose()) / 2;
}

template <class Law>
void largest_curvature_is_that_of_the_forces(const Law& law) {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = random.index(3)});
        const MassSpringNetwork network(mesh, law, {.stiffness = 3.0});
        const Points<double> x = test::jittered(mesh.positions(), 0.08, random);
        for (int n = 0; n < 20; ++n) {
            const Index v = random.index(mesh.vertex_count());
            const double found = largest_eigenvalue(network.hessian(v, x));
            const double expected = expected_eigenvalue(stiffness_block(network, v, x, 1e-5));
            REQUIRE(std::abs(found - expected) <= 1e-6 * network.force_on(v, x).stiffness);
            // The bound that costs nothing holds, and is not wasteful.
            REQUIRE(found <= network.force_on(v, x).stiffness * (1 + 1e-12));
            REQUIRE(network.force_on(v, x).stiffness <= 3 * std::max(found, 3.0));
        }
    }
}

}  // namespace

TEST_CASE("largest curvature of a vertex is that of its forces, for every law", "[curvature]") {
    SECTION("linear") { largest_curvature_is_that_of_the_forces(LinearSpring{}); }
    SECTION("exponential") { largest_curvature_is_that_of_the_forces(ExponentialSpring{}); }
    SECTION("of one's own") { largest_curvature_is_that_of_the_forces(test::CubicSpring{}); }
}

TEMPLATE_TEST_CASE("largest curvature by hand", "[curvature]", TEST_SCALARS) {
    using S = TestType;
    // A flat star of six equal springs at rest: 3 k in the plane, nothing across.
    const auto mesh = disc<S>({.radius = 1, .rings = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = S(2)});
    CHECK(largest_eigenvalue(network.hessian(0, mesh.positions())) == Approx(6));
    CHECK(network.force_on(0, mesh.positions()).stiffness == 12);
    // All ends in one point: the springs have no direction, any may be the stiff one.
    const Points<S> collapsed = Points<S>::Zero(3, 7);
    CHECK(largest_eigenvalue(network.hessian(0, collapsed)) == 12);
    const MassSpringNetwork none(mesh, LinearSpring{}, {.stiffness = S(0)});
    CHECK(largest_eigenvalue(none.hessian(0, mesh.positions())) == 0);
}
