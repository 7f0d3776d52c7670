// SPDX-License-Identifier: MIT
#include <membrane/accuracy/stiffness_operator.hpp>

#include <array>
#include <vector>

#include <Eigen/Core>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

struct Scene {
    TriangleMesh<double> mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{}, {.stiffness = 2.0}};
    VirtualVolumeSprings<double> foundation;
    Points<double> x;
    EquilibriumProblem problem{network};
    StiffnessOperator stiffness{problem};

    Scene(test::Random& random, double volume, double amplitude)
        : foundation(mesh, {.stiffness = volume}), x(test::jittered(mesh.positions(), amplitude, random)) {}

    template <class... Constraints>
    void assign(const Constraints&... constraints) {
        REQUIRE(problem.assign(x, network, foundation, constraints...) == ProblemStatus::valid);
        stiffness.at(problem, x);
    }
    Points<double> forces_at(const Points<double>& y) const {
        Points<double> force = y;
        std::vector<double> magnitude(static_cast<std::size_t>(y.cols()));
        problem.forces(y, force, magnitude);
        return force;
    }
};

}  // namespace

TEST_CASE("stiffness times a displacement is the change of the forces", "[stiffness_operator]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Scene scene(random, 0.5, 0.2);
        scene.assign();
        const Points<double> displacement = test::jittered<double>(Points<double>::Zero(3, 42), 1, random);
        const double h = 1e-5;
        const Points<double> expected =
            (scene.forces_at(scene.x - h * displacement) - scene.forces_at(scene.x + h * displacement)) / (2 * h);
        Points<double> found = displacement;
        scene.stiffness.multiply(scene.problem, displacement, found);
        CHECK((found - expected).norm() < 1e-7 * expected.norm());
        CHECK(inner(displacement, found) <= scene.stiffness.largest() * inner(displacement, displacement));
        // Of a foundation much stiffer than the springs, and whatever was before.
        Scene stiff(random, 1e3, 0.2);
        stiff.assign();
        CHECK(stiff.stiffness.largest() >= 1e3);
        CHECK(stiff.stiffness.largest() <= 2 * (1e3 + 6 * 2.0));
        stiff.assign();
        CHECK(stiff.stiffness.largest() <= 2 * (1e3 + 6 * 2.0));
    }
}

TEST_CASE("conjugate gradients find the displacement that balances a force", "[stiffness_operator]") {
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Scene scene(random, random.number(0.5, 3.0), 0.02);
        const PointAttachment<double> held{0, {0, 12, 14}, random.barycentric(), random.vector<double>()};
        scene.assign(held, pin(std::array{5, 6}));
        const Points<double> force = test::jittered<double>(Points<double>::Zero(3, 42), 1, random);
        Points<double> used = force, displacement = Points<double>::Zero(3, 42);
        const auto report =
            scene.stiffness.solve(scene.problem, used, displacement, {.tolerance = 1e-10, .iterations = 200});
        CHECK(report.convex);
        CHECK(report.converged);
        CHECK(report.iterations < 100);
        Points<double> response = displacement;
        scene.stiffness.multiply(scene.problem, displacement, response);
        Points<double> left = force - response, projected = displacement, whole = force;
        scene.problem.project(left);
        scene.problem.project(projected);
        scene.problem.project(whole);
        CHECK(left.norm() < 2e-10 * whole.norm());
        CHECK((projected - displacement).norm() < 1e-13 * displacement.norm());
        const auto again = scene.stiffness.solve(scene.problem, used = force, displacement, {.tolerance = 1e-9});
        CHECK(again.iterations == 0);
    }
}

TEST_CASE("a direction in which the energy does not grow is seen", "[stiffness_operator]") {
    test::Random random(1);
    Scene scene(random, 0.1, 0);
    scene.x *= 0.5;  // all springs are pressed together
    scene.assign();
    Points<double> force = test::jittered<double>(Points<double>::Zero(3, 42), 1, random), displacement = 0 * force;
    const auto report =
        scene.stiffness.solve(scene.problem, force, displacement, {.tolerance = 1e-10, .iterations = 200});
    CHECK_FALSE(report.convex);
    CHECK_FALSE(report.converged);
    CHECK(is_finite(displacement));
}
