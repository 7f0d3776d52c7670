// SPDX-License-Identifier: MIT
#include <membrane/solve/boundary_conditions.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/newton.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

static_assert(Constraint<PointAttachment<double>, double> && Constraint<VertexAttachment<double>, double>);
static_assert(Constraint<PinnedVertices, double> && Constraint<PointLoad<double>, double>);

namespace {

constexpr double dt = 1e-3;

std::array<Index, 3> corners_of(const TriangleMesh<double>& mesh, Index f) {
    return {mesh.triangles()(0, f), mesh.triangles()(1, f), mesh.triangles()(2, f)};
}

std::vector<Index> as_vector(const std::array<Index, 3>& corners) { return {corners.begin(), corners.end()}; }
std::vector<double> as_vector(const Vector3<double>& weights) { return {weights[0], weights[1], weights[2]}; }

/// A point of a triangle, as forceps hold it.
Grasp<double> grasp_of(const TriangleMesh<double>& mesh, Index f, const Vector3<double>& barycentric) {
    return {.triangle = f, .corners = corners_of(mesh, f), .barycentric = barycentric};
}

/// A unit sphere of 42 vertices on springs of mixed stiffness.
template <class Law>
struct Small {
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, Law> network;
    VirtualVolumeSprings<double> foundation;

    Small(const Law& law, Random& random, const std::vector<Index>& pinned = {})
        : mesh(icosphere({.radius = 1, .subdivisions = 1})),
          network(mesh, law, {.stiffness = numbers(random), .pinned = pinned}),
          foundation(mesh, {.stiffness = 2.0}) {}

    static std::vector<double> numbers(Random& random) {
        std::vector<double> stiffness(120);
        for (double& k : stiffness) k = random.number(1.0, 3.0);
        return stiffness;
    }
    test::SmallMembrane<MassSpringNetwork<double, Law>> oracle(const std::vector<Index>& fixed = {}) const {
        return {network, mesh.positions(), 2.0, fixed};
    }
};

constexpr double negligible = 1e-13;
const SolverOptions<double> to_the_end{.layers = unlimited, .sweeps = 50, .force_tolerance = negligible};

/// Runs `check(law)` with every law.
template <class Check>
void with_each_law(Check check) {
    SECTION("linear") { check(LinearSpring{}); }
    SECTION("exponential") { check(ExponentialSpring{.stiffening = 4}); }
    SECTION("of one's own") { check(test::CubicSpring{.b = 2}); }
}

}  // namespace

TEST_CASE("what a point of a triangle is held with is what Newton's method finds", "[constraints]") {
    with_each_law([](const auto& law) {
        for (int seed = 1; seed <= cases(12); ++seed) {
            CAPTURE(seed);
            Random random(static_cast<std::uint64_t>(seed));
            const Small membrane(law, random);
            Vector3<double> weights = random.barycentric();
            if (seed % 4 == 1) weights = {0, 1, 0};
            if (seed % 4 == 2) weights = {0.25, 0, 0.75};
            const Index f = random.index(80);
            const auto corners = corners_of(membrane.mesh, f);
            const Vector3<double> place = point_at(triangle_at(membrane.mesh.positions(), corners), weights);
            const Vector3<double> target = place + 0.15 * random.vector();
            const Tool<double> tool{.position = target};

            QuasiStaticSolver solver(membrane.network, to_the_end, SafeStep{.omega = 1.3});
            Points<double> x = membrane.mesh.positions();
            const auto held = pull(tool, grasp_of(membrane.mesh, f, weights));
            const auto report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation, held);
            REQUIRE(report.converged);
            REQUIRE(norm<double>(point_at(triangle_at(x, corners), weights) - target) < 1e-11);

            auto oracle = membrane.oracle();
            oracle.held = {{as_vector(corners), as_vector(weights), target}};
            const auto expected = oracle.equilibrium(x);
            REQUIRE((x - expected.x).cwiseAbs().maxCoeff() < 1e-10);
            REQUIRE(norm<double>(report.reactions[0] + expected.holding[0]) < 1e-9 * norm(report.reactions[0]));
        }
    });
}

TEST_CASE("a load comes to rest where Newton's method does", "[constraints]") {
    with_each_law([](const auto& law) {
        for (int seed = 1; seed <= cases(12); ++seed) {
            CAPTURE(seed);
            Random random(static_cast<std::uint64_t>(seed));
            const std::vector<Index> pinned{random.index(42), random.index(42)};
            const Small membrane(law, random, pinned);
            const Index f = random.index(80), g = random.index(80);
            const Vector3<double> weights = random.barycentric(), others = random.barycentric();
            const Vector3<double> force = 0.4 * random.vector(), other = 0.4 * random.vector();

            QuasiStaticSolver solver(membrane.network, to_the_end, SafeStep{.omega = 1.3});
            Points<double> x = membrane.mesh.positions();
            const auto report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation,
                                                         load(corners_of(membrane.mesh, f), weights, force),
                                                         load(corners_of(membrane.mesh, g), others, other));
            REQUIRE(report.converged);
            REQUIRE(report.reactions[0] == -force);
            REQUIRE(report.reactions[1] == -other);

            auto oracle = membrane.oracle(pinned);
            oracle.loads = {{as_vector(corners_of(membrane.mesh, f)), as_vector(weights), force},
                            {as_vector(corners_of(membrane.mesh, g)), as_vector(others), other}};
            REQUIRE((x - oracle.equilibrium(x).x).cwiseAbs().maxCoeff() < 1e-10);
        }
    });
}

TEST_CASE("pins hold vertices where they are, and feel what is pulled elsewhere", "[constraints]") {
    for (int seed = 1; seed <= cases(12); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Small membrane(LinearSpring{}, random);
        const auto order = test::random_order(42, random);
        const Index pulled = order[0];
        const std::vector<Index> pinned(order.begin() + 1, order.begin() + 5);
        const Vector3<double> target = 1.2 * point(membrane.mesh.positions(), pulled) + 0.1 * random.vector();

        QuasiStaticSolver solver(membrane.network, to_the_end, SafeStep{.omega = 1.3});
        Points<double> x = membrane.mesh.positions();
        const auto report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation, pin(pinned),
                                                     pull(pulled, target), pin({}));
        REQUIRE(report.converged);
        REQUIRE(report.reactions.size() == 3);
        for (const Index v : pinned) REQUIRE(point(x, v) == point(membrane.mesh.positions(), v));
        REQUIRE(point(x, pulled) == target);  // to the bit

        auto oracle = membrane.oracle(pinned);
        oracle.held = {{{pulled}, {1.0}, target}};
        const auto expected = oracle.equilibrium(x);
        REQUIRE((x - expected.x).cwiseAbs().maxCoeff() < 1e-10);
        REQUIRE(norm<double>(report.reactions[1] + expected.holding[0]) < 1e-9);
        Vector3<double> on_pins(0, 0, 0);
        for (const Index v : pinned) on_pins += membrane.network.force_on(v, x).force;
        REQUIRE(norm<double>(report.reactions[0] - on_pins) < 1e-12);
        REQUIRE(report.reactions[2] == Vector3<double>(0, 0, 0));
    }
}

TEST_CASE("pins seed no queue: where nothing else acts, nothing is visited", "[constraints]") {
    Random random(1);
    const Small membrane(LinearSpring{}, random);
    QuasiStaticSolver solver(membrane.network, to_the_end);
    Points<double> x = membrane.mesh.positions();
    const std::vector<Index> pinned{3, 4, 3};
    const auto report = solver.step(x, dt, membrane.network, membrane.foundation, pin(pinned));
    CHECK(report.converged);
    CHECK(report.moved.empty());
    CHECK(solver.queue().vertices().empty());
    CHECK(report.reactions[0] == Vector3<double>(0, 0, 0));
}

TEST_CASE("a vertex can be held by its place in a triangle, too", "[constraints]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Small membrane(LinearSpring{}, random);
        const Index f = random.index(80);
        const Index k = random.index(3), v = corners_of(membrane.mesh, f)[static_cast<std::size_t>(k)];
        const Vector3<double> target = point(membrane.mesh.positions(), v) + 0.2 * random.vector();
        QuasiStaticSolver first(membrane.network, to_the_end), second(membrane.network, to_the_end);
        Points<double> x = membrane.mesh.positions(), y = x;
        const auto by_vertex =
            test::run_to_equilibrium(first, x, dt, membrane.network, membrane.foundation, pull(v, target));
        const auto by_point = test::run_to_equilibrium(
            second, y, dt, membrane.network, membrane.foundation,
            pull(Tool<double>{.position = target}, grasp_of(membrane.mesh, f, Vector3<double>::Unit(k))));
        REQUIRE((x - y).cwiseAbs().maxCoeff() < 1e-11);
        REQUIRE(norm<double>(by_vertex.reactions[0] - by_point.reactions[0]) < 1e-10);
    }
}

TEST_CASE("nothing is held by forceps that hold nothing", "[constraints]") {
    Random random(1);
    const Small membrane(LinearSpring{}, random);
    QuasiStaticSolver solver(membrane.network, to_the_end);
    Points<double> x = membrane.mesh.positions();
    const auto report = solver.step(x, dt, membrane.network, membrane.foundation,
                                    pull(Tool<double>{.position = {5, 5, 5}}, Grasp<double>{}));
    CHECK(report.status == StepStatus::advanced);
    CHECK(report.vertex_updates == 0);
    CHECK(report.reactions[0] == Vector3<double>(0, 0, 0));
    CHECK(same_bits(x, membrane.mesh.positions()));
}

TEST_CASE("the network's own pins cannot be pulled away", "[constraints]") {
    Random random(1);
    const std::vector<Index> pinned{7, 8, 9};
    const Small membrane(LinearSpring{}, random, pinned);
    QuasiStaticSolver solver(membrane.network, to_the_end);
    Points<double> x = membrane.mesh.positions();
    const auto report = test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation,
                                                 pull(7, Vector3<double>(2, 2, 2)), pin(pinned));
    CHECK(report.converged);
    CHECK(same_bits(x, membrane.mesh.positions()));
}

namespace {

/// A small membrane under constraints, at rest, with few and with many layers free to move.
struct AtRest {
    Random random;
    Small<LinearSpring> membrane;
    QuasiStaticSolver<double> solver;
    Points<double> x;
    Points<double> pushed = Points<double>::Zero(3, 42);  // what acts on vertices that are not held
    std::vector<Index> held;                              // vertices

    AtRest(int seed, Index layers)
        : random(static_cast<std::uint64_t>(seed)),
          membrane(LinearSpring{}, random),
          solver(membrane.network, {.layers = layers, .sweeps = 50, .force_tolerance = negligible}),
          x(membrane.mesh.positions()) {}

    void push(const std::array<Index, 3>& corners, const Vector3<double>& weights, const Vector3<double>& force) {
        for (int k = 0; k < 3; ++k) pushed.col(corners[static_cast<std::size_t>(k)]) += weights[k] * force;
    }
    template <class... Constraints>
    StepReport<double> run_to_equilibrium(const Constraints&... constraints) {
        const auto report =
            test::run_to_equilibrium(solver, x, dt, membrane.network, membrane.foundation, constraints...);
        REQUIRE(report.converged);
        return report;
    }
    /// What acts from outside is in balance with the foundation, up to what is left unbalanced anywhere: also beyond
    /// the layers that were free to move.
    void check_balance(const StepReport<double>& report) const {
        Vector3<double> reactions(0, 0, 0), sum(0, 0, 0);
        double residuals = 0, forces = 0;
        for (Index v = 0; v < 42; ++v) {
            const Vector3<double> volume = membrane.foundation.force_on(v, point(x, v), point(x, v), dt).force;
            const Vector3<double> springs = membrane.network.force_on(v, x).force;
            sum += volume;
            forces += norm(volume) + norm(springs);
            if (std::find(held.begin(), held.end(), v) != held.end()) continue;
            residuals += norm<double>(volume + springs + point(pushed, v));
        }
        for (const auto& reaction : report.reactions) reactions += reaction;
        REQUIRE(norm(reactions) > 1e-3);
        REQUIRE(norm<double>(reactions - sum) <= residuals + 1e-12 * forces);
    }
};

template <class Check>
void with_few_and_many_layers(Check check) {
    for (const Index layers : {1, 2, 100}) {
        for (int seed = 1; seed <= cases(10); ++seed) {
            CAPTURE(layers, seed);
            AtRest scene(seed, layers);
            check(scene);
        }
    }
}

}  // namespace

TEST_CASE("at rest the reaction of a held vertex is the sum of the volume springs", "[constraints]") {
    with_few_and_many_layers([](AtRest& scene) {
        const Index v = scene.random.index(42);
        scene.held = {v};
        const Vector3<double> target = 1.2 * point(scene.x, v) + 0.1 * scene.random.vector();
        scene.check_balance(scene.run_to_equilibrium(pull(v, target)));
    });
}

TEST_CASE("at rest the reaction of a held point is the sum of the volume springs", "[constraints]") {
    with_few_and_many_layers([](AtRest& scene) {
        const Index f = scene.random.index(80);
        const auto corners = corners_of(scene.membrane.mesh, f);
        const Vector3<double> weights = scene.random.barycentric();
        const Tool<double> tool{.position = 1.1 * point_at(triangle_at(scene.x, corners), weights)};
        const auto report = scene.run_to_equilibrium(pull(tool, grasp_of(scene.membrane.mesh, f, weights)));
        scene.push(corners, weights, -report.reactions[0]);
        scene.check_balance(report);
    });
}

TEST_CASE("at rest loads are the opposite of the sum of the volume springs", "[constraints]") {
    with_few_and_many_layers([](AtRest& scene) {
        const auto corners = corners_of(scene.membrane.mesh, scene.random.index(80));
        const Vector3<double> weights = scene.random.barycentric(), force = scene.random.vector();
        scene.push(corners, weights, force);
        scene.check_balance(scene.run_to_equilibrium(load(corners, weights, force)));
    });
}

TEST_CASE("at rest the reactions of pins, a vertex and a point add up to the volume springs", "[constraints]") {
    with_few_and_many_layers([](AtRest& scene) {
        const auto order = test::random_order(42, scene.random);
        const Index f = scene.random.index(80);
        const auto corners = corners_of(scene.membrane.mesh, f);
        std::vector<Index> others;  // no corner of the triangle: what acts there would be in two reactions
        for (const Index v : order) {
            if (std::find(corners.begin(), corners.end(), v) == corners.end()) others.push_back(v);
        }
        scene.held = {others[0], others[1], others[2]};
        const std::vector<Index> pinned{others[1], others[2]};
        const Vector3<double> weights = scene.random.barycentric();
        const Tool<double> tool{.position = 1.1 * point_at(triangle_at(scene.x, corners), weights)};
        const Vector3<double> target = 1.2 * point(scene.x, others[0]);
        const auto report = scene.run_to_equilibrium(pin(pinned), pull(tool, grasp_of(scene.membrane.mesh, f, weights)),
                                                     pull(others[0], target));
        scene.push(corners, weights, -report.reactions[1]);
        scene.check_balance(report);
    });
}

TEST_CASE("at rest a pressing tool carries the sum of the volume springs", "[constraints]") {
    for (const Index layers : {2, 100}) {
        for (int seed = 1; seed <= cases(10); ++seed) {
            CAPTURE(layers, seed);
            Random random(static_cast<std::uint64_t>(seed));
            const Small membrane(LinearSpring{}, random);
            QuasiStaticSolver solver(membrane.network, {.layers = layers, .sweeps = 50, .force_tolerance = negligible});
            AabbTree tree(membrane.mesh);
            ContactTracker tracker(membrane.mesh);
            Points<double> x = membrane.mesh.positions();
            const Vector3<double> from = random.unit_vector();
            StepReport<double> report;
            Tool<double> tool{.radius = 0.2};
            for (int tick = 0; tick < 3000; ++tick) {
                tool.position = std::max(1.25 - 0.01 * tick, 1.05) * from;
                const auto contact = tracker.update(tree, x, tool);
                report = solver.step(x, dt, membrane.network, membrane.foundation, press(tool, contact));
                REQUIRE(report.status == StepStatus::advanced);
                tree.refit(x, report.moved);
                if (tick > 20 && report.converged) break;
            }
            REQUIRE(report.converged);
            // All that the tool does to the vertices is the opposite of its reaction, and they are all free: what is
            // unbalanced inside the layers is below what is negligible.
            Vector3<double> sum(0, 0, 0);
            double residuals = 42 * negligible, forces = 0;
            for (Index v = 0; v < 42; ++v) {
                const Vector3<double> volume = membrane.foundation.force_on(v, point(x, v), point(x, v), dt).force;
                const Vector3<double> springs = membrane.network.force_on(v, x).force;
                sum += volume;
                forces += norm(volume) + norm(springs);
                if (!solver.queue().contains(v)) residuals += norm<double>(volume + springs);
            }
            REQUIRE(norm(report.reactions[0]) > 1e-2);
            REQUIRE(norm<double>(report.reactions[0] - sum) <= residuals + 1e-12 * forces);
        }
    }
}

TEMPLATE_TEST_CASE("constraints that make no sense are distinguished from others", "[constraints][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const std::array<Index, 3> corners{0, 1, 2};
    const Vector3<S> inside(S(0.2), S(0.3), S(0.5)), somewhere(1, 2, 3);
    const auto held_at = [](const Vector3<S>& weights, const Vector3<S>& target) {
        return PointAttachment<S>{.triangle = 0, .corners = {0, 1, 2}, .barycentric = weights, .target = target}
            .valid();
    };
    CHECK(pull(3, somewhere).valid());
    CHECK(load(corners, inside, somewhere).valid());
    CHECK(held_at(inside, somewhere));
    CHECK(PointAttachment<S>{}.valid());
    CHECK(pin({}).valid());
    for (int k = 0; k < 3; ++k) CHECK(load<S>(corners, Vector3<S>::Unit(k), somewhere).valid());
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        for (int k = 0; k < 3; ++k) {
            CAPTURE(bad, k);
            Vector3<S> wrong = somewhere, weights = inside;
            wrong[k] = weights[k] = bad;
            CHECK_FALSE(pull(3, wrong).valid());
            CHECK_FALSE(load(corners, inside, wrong).valid());
            CHECK_FALSE(load(corners, weights, somewhere).valid());
            CHECK_FALSE(held_at(inside, wrong));
            CHECK_FALSE(held_at(weights, somewhere));
            CHECK_FALSE(pull(Tool<S>{.position = wrong}, Grasp<S>{.triangle = 0, .barycentric = inside}).valid());
        }
    }
    for (const Vector3<S>& weights : {Vector3<S>(-S(0.1), S(0.6), S(0.5)), Vector3<S>(S(0.5), S(0.5), S(0.5)),
                                      Vector3<S>(0, 0, 0), Vector3<S>(2, 0, -1), Vector3<S>(S(0.3), S(0.3), S(0.39))}) {
        CAPTURE(weights);
        CHECK_FALSE(load(corners, weights, somewhere).valid());
        CHECK_FALSE(held_at(weights, somewhere));
    }
}
