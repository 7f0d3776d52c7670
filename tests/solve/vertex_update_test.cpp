// SPDX-License-Identifier: MIT
#include <membrane/solve/step_rule.hpp>

#include <array>
#include <cmath>
#include <cstdint>

#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/packed_vertices.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/spring_law_check.hpp"
#include "support/vertex_energy.hpp"

using namespace membrane;
using test::Random;

namespace {

/// A small membrane in the middle of a step.
template <class Law>
struct MidStep {
    explicit MidStep(std::uint64_t seed, const Law& law = {})
        : random(seed),
          network(mesh, law, {.stiffness = 3.0, .mass = 0.5}),
          foundation(mesh, {.stiffness = 2.0, .damping = 0.3}),
          rows(42),
          start(test::jittered(mesh.positions(), 0.1, random)),
          x(test::jittered(start, 0.05, random)),
          v(random.index(42)) {
        rows.begin_step();
        for (Index w = 0; w < 42; ++w) {
            rows.load(w, start_ref, network);
            rows.set_position(w, point(x, w));
        }
        rows.row(rows.force, v).set(force, 7);
    }
    Random random;
    TriangleMesh<double> mesh = icosphere({.radius = 1, .subdivisions = 1});
    MassSpringNetwork<double, Law> network;
    VirtualVolumeSprings<double> foundation;
    VertexRows<double> rows;
    Points<double> start, x;
    ConstPointsRef<double> start_ref{start}, now_ref{rows.positions()};
    Index v;
    Vector3<double> force = random.vector();
    StepInput<double, MassSpringNetwork<double, Law>, VirtualVolumeSprings<double>> scene{start_ref, now_ref,    0.1,
                                                                                          network,   foundation, rows};
};

/// Moves a vertex by a given length, with or without descent.
template <bool descends>
struct Stride {
    static constexpr bool guarantees_descent = descends;
    double length;  // [m]

    template <Number N>
    [[nodiscard]] N compliance(const VertexState<N>& vertex) const noexcept {
        return length / norm(vertex.force);
    }
};

/// The displacement of vertex `v` in a pack.
template <class Step, class Rule>
Vector3<double> displacement_by(Step& step, const Rule& rule) {
    PackedVertices<double> packed(step.network);
    const std::array<std::size_t, 1> end{1};
    packed.assign({&step.v, 1}, end, step.network);
    packed.begin_step(step.scene);
    packed.update(0, 1, step.scene, rule, Constrained::by_force, OneThread());
    const Vector3<double> by = step.rows.position_of(step.v) - point(step.x, step.v);
    step.rows.set_position(step.v, point(step.x, step.v));
    return by;
}

}  // namespace

TEST_CASE("the force on a vertex is the sum of all that pull on it", "[update]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        MidStep<LinearSpring> step(static_cast<std::uint64_t>(seed));
        const Index v = step.v;
        const auto springs = step.network.force_on(v, step.x);
        const auto foundation = step.foundation.force_on(v, point(step.x, v), point(step.start, v), 0.1);
        const Vector3<double> force = springs.force + foundation.force + step.force;
        const double stiffness = springs.stiffness + foundation.stiffness + 7;

        REQUIRE(norm<double>(total_force(step.scene, v).force - force) < 1e-13);
        REQUIRE(total_force(step.scene, v).stiffness == Approx(stiffness));
        // What damping holds back is no rest.
        const Vector3<double> lasting =
            springs.force + step.force - 2.0 * (point(step.x, v) - point(step.foundation.anchors(), v));
        REQUIRE(norm<double>(undamped_force(step.scene, v, force) - lasting) < 1e-13);
    }
}

TEST_CASE("a displacement on which springs stiffen is halved until the energy does not rise, others are not",
          "[update]") {
    int halved = 0;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        const auto check = [&](auto& step) {
            const Index v = step.v;
            const Vector3<double> pull = total_force(step.scene, v).force;
            const double length = step.random.number(0.0, 0.5);
            const Vector3<double> displacement = length * direction<double>(pull, pull);
            const auto same = [&](const Vector3<double>& other) { return norm<double>(other - displacement) < 1e-12; };
            const Vector3<double> found = displacement_by(step, Stride<true>{length});
            const auto others = non_network_force(step.scene, v);
            const auto energy = [&](const Vector3<double>& by) {
                return test::energy_change(step.network, v, by, step.x).change - dot<double>(others.force, by) +
                       others.stiffness * squared_norm(by) / 2;
            };
            REQUIRE(same(displacement_by(step, Stride<false>{1e-3 * length}) * 1e3));
            if (same(found)) return;
            ++halved;
            const double times = std::log2(norm(displacement) / norm(found));
            REQUIRE(times == Approx(std::round(times)));
            REQUIRE(norm<double>(cross(displacement, found)) < 1e-12);
            REQUIRE(energy(found) <= energy({0, 0, 0}) + 1e-12);
            REQUIRE(energy(2 * found) > energy({0, 0, 0}));
        };
        MidStep<ExponentialSpring> exponential(static_cast<std::uint64_t>(seed));
        MidStep<test::CubicSpring> cubic(static_cast<std::uint64_t>(seed));
        check(exponential);
        check(cubic);
        MidStep<LinearSpring> linear(static_cast<std::uint64_t>(seed));
        REQUIRE(norm(displacement_by(linear, Stride<true>{9})) == Approx(9));
    }
    CHECK(halved > cases(30));
}

TEST_CASE("what the majoriser of a tissue says descends does, by the energy", "[update][tissue]") {
    int proved = 0, unknown = 0;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<double>(random).mesh();
        const Material material{.young_modulus = 1e3, .poisson_ratio = random.number(0.0, 0.45), .thickness = 1e-2};
        const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = random.number(0.0, 10.0)});
        const Tissue tissue(springs, triangular_springs(mesh, material, random.number(0.9, 1.1)),
                            bending_springs(mesh, random.number(0.0, 0.1)), pressure(mesh, random.number(-1.0, 1.0)));
        const auto x = test::jittered(mesh.positions(), 0.1, random);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            VertexState<double> state;
            static_cast<EnergyMajoriser<double>&>(state) = test::majoriser(tissue, v, x);
            const Vector3<double> displacement =
                random.number(0.0, 4.0) * (BlockStep{.omega = 1}.compliance(state) * state.force);
            const bool descends = surely_descends(state, displacement);
            ++(descends ? proved : unknown);
            const auto energy = test::energy_change(tissue, v, displacement, x);
            if (descends) REQUIRE(energy.change <= 1e-12 * energy.size);
        }
    }
    CHECK(proved > cases(100));
    CHECK(unknown > cases(100));
}

TEST_CASE("a step diverges beyond two over the curvature", "[update]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        MidStep<LinearSpring> step(static_cast<std::uint64_t>(seed));
        const double others = non_network_force(step.scene, step.v).stiffness;
        const double limit = 2 / (largest_eigenvalue(step.network.hessian(step.v, step.x)) + others);
        REQUIRE_FALSE(diverges(step.scene, step.v, 0.999 * limit));
        REQUIRE(diverges(step.scene, step.v, 1.001 * limit));
    }
}
