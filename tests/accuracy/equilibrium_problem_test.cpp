// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium_problem.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

struct Scene {
    TriangleMesh<double> mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{}, {.stiffness = 3.0, .pinned = {8}}};
    VirtualVolumeSprings<double> foundation{mesh, {.stiffness = 0.7, .damping = 5.0}};
    Points<double> x;
    EquilibriumProblem problem{network};

    explicit Scene(test::Random& random) : x(test::jittered(mesh.positions(), 0.1, random)) {}

    template <class... Constraints>
    ProblemStatus assign(const Constraints&... constraints) {
        return problem.assign(x, network, foundation, constraints...);
    }
    Points<double> forces_at(const Points<double>& y) {
        Points<double> force = y;
        std::vector<double> magnitude(static_cast<std::size_t>(y.cols()));
        problem.forces(y, force, magnitude);
        return force;
    }
};

}  // namespace

TEST_CASE("the forces of a problem are those of network, foundation at rest and loads", "[equilibrium_problem]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Scene scene(random);
        const Vector3<double> target = random.vector<double>(), force = random.vector<double>();
        const auto weights = random.barycentric();
        const std::array<Index, 2> pinned{3, 4};
        REQUIRE(scene.assign(pull(5, target), pin(pinned), load({5, 6, 7}, weights, force)) == ProblemStatus::valid);
        Points<double> expected = scene.x;
        expected.col(5) = target;
        CHECK(scene.problem.given() == scene.x);
        CHECK(scene.problem.centre() == expected);
        const Points<double> y = test::jittered(scene.x, 0.1, random);
        const Points<double> found = scene.forces_at(y);
        for (Index v = 0; v < y.cols(); ++v) {
            const Vector3<double> here = point(y, v);
            Vector3<double> sum = scene.network.force_on(v, y).force + 0.7 * (point(scene.mesh.positions(), v) - here);
            if (v >= 5 && v <= 7) sum += weights[v - 5] * force;
            CHECK(norm<double>(found.col(v) - sum) < 1e-14 * 20);
            CHECK(scene.problem.fixed(v) == (v == 3 || v == 4 || v == 5 || v == 8));
        }
    }
}

TEST_CASE("rounding of forces stays below what is said of it", "[equilibrium_problem]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Scene scene(random);
        const Vector3<double> heavy = 1e6 * random.vector<double>();
        REQUIRE(scene.assign(load({5, 6, 7}, {1, 0, 0}, heavy)) == ProblemStatus::valid);
        const Points<double> y = test::jittered(scene.x, 0.1, random);
        Points<double> force = y;
        std::vector<double> magnitude(static_cast<std::size_t>(y.cols()));
        scene.problem.forces(y, force, magnitude);
        for (Index v = 0; v < y.cols(); ++v) {
            using Long = Eigen::Matrix<long double, 3, 1>;
            const Long here = y.col(v).cast<long double>();
            Long sum = static_cast<long double>(0.7) * (scene.mesh.positions().col(v).cast<long double>() - here);
            for (const auto& end : scene.network.springs_of(v)) {
                const Long edge = y.col(end.other).cast<long double>() - here;
                sum += end.stiffness * (1 - end.rest_length / edge.norm()) * edge;
            }
            if (v == 5) sum += heavy.eigen().cast<long double>();
            const auto off = static_cast<double>((sum - force.col(v).cast<long double>()).norm());
            CHECK(off <= scene.problem.rounding() * magnitude[static_cast<std::size_t>(v)]);
        }
    }
}

TEST_CASE("nothing that is held is left in a projected force", "[equilibrium_problem]") {
    test::Random random(1);
    Scene scene(random);
    const PointAttachment<double> held{0, {0, 12, 14}, {0.5, 0.3, 0.2}, random.vector<double>()};
    REQUIRE(scene.assign(held, pull(5, point(scene.x, 5))) == ProblemStatus::valid);
    Points<double> f = test::jittered(scene.x, 1, random);
    scene.problem.project(f);
    for (const Index v : {5, 8}) CHECK(f.col(v).isZero(0));
    CHECK((0.5 * f.col(0) + 0.3 * f.col(12) + 0.2 * f.col(14)).norm() < 1e-15);
    CHECK(f.col(20).norm() > 0);
}

TEST_CASE("a reaction is shared out among the vertices it comes from", "[equilibrium_problem]") {
    test::Random random(1);
    Scene scene(random);
    const std::array<Index, 2> pinned{3, 4};
    const Vector3<double> weights(0.5, 0.3, 0.2), target(1, 2, 3);
    const PointAttachment<double> held{0, {0, 12, 14}, weights, target};
    REQUIRE(scene.assign(pull(5, target), pin(pinned), held) == ProblemStatus::valid);
    const auto shares = [&](const auto& constraint) {
        std::vector<double> sum(42);
        for_each_term(constraint, [&](const ConstraintTerm& term) { EquilibriumProblem::share(term, sum); });
        return sum;
    };
    CHECK(shares(pull(5, target))[5] == 1);
    CHECK(shares(pin(pinned))[3] == 1);
    CHECK(shares(pin(pinned))[5] == 0);
    CHECK(shares(held)[12] == Approx(0.3 / 0.38));
    CHECK(shares(PointAttachment<double>{}) == std::vector<double>(42));
    CHECK(shares(load({0, 1, 2}, weights, target)) == std::vector<double>(42));
}

TEST_CASE("only some vertices may be left free", "[equilibrium_problem]") {
    test::Random random(1);
    Scene scene(random);
    REQUIRE(scene.assign(pull(5, point(scene.x, 5))) == ProblemStatus::valid);
    CHECK(scene.problem.fix_all_but(std::array<Index, 3>{4, 5, 8}) == ProblemStatus::valid);
    for (Index v = 0; v < 42; ++v) CHECK(scene.problem.fixed(v) == (v != 4));
    CHECK(scene.problem.fix_all_but(std::array<Index, 1>{42}) == ProblemStatus::invalid_input);
    REQUIRE(scene.assign(PointAttachment<double>{0, {0, 12, 14}, {0.5, 0.5, 0}, point(scene.x, 0)}) ==
            ProblemStatus::valid);
    CHECK(scene.problem.fix_all_but(std::array<Index, 2>{0, 12}) == ProblemStatus::valid);
    CHECK(scene.problem.fix_all_but(std::array<Index, 2>{0, 14}) == ProblemStatus::unsupported);
}

TEST_CASE("a pinned vertex stays, and the last to hold a vertex decides", "[equilibrium_problem]") {
    test::Random random(1);
    Scene scene(random);
    const Vector3<double> one(1, 2, 3), two(4, 5, 6);
    REQUIRE(scene.assign(pull(8, one), pull(7, one), pull(7, two)) == ProblemStatus::valid);
    CHECK(scene.problem.centre().col(8) == scene.x.col(8));
    CHECK(scene.problem.centre().col(7) == two);
}

TEST_CASE("another membrane's numbers are refused", "[equilibrium_problem]") {
    test::Random random(1);
    Scene scene(random);
    const auto other = icosphere<double>({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(other, LinearSpring{}, {.stiffness = 1.0});
    CHECK(scene.problem.assign(scene.x, network, scene.foundation) == ProblemStatus::invalid_input);
    const VirtualVolumeSprings foundation(other, {.stiffness = 1.0});
    CHECK(scene.problem.assign(scene.x, scene.network, foundation) == ProblemStatus::invalid_input);
    CHECK(scene.problem.assign(other.positions(), scene.network, scene.foundation) == ProblemStatus::invalid_input);
    CHECK(scene.assign() == ProblemStatus::valid);
}
