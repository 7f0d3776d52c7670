// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <cstdint>
#include <utility>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

// Which vertices are pinned is the network's affair, and that of the network of the step alone.

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

const TriangleMesh<double> mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
const VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 4.0, .damping = 0.02});

auto network_with(std::vector<Index> pinned) {
    return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 40.0, .pinned = std::move(pinned)});
}

std::vector<Index> some_vertices(Random& random) {
    std::vector<Index> some;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (random.chance(0.1)) some.push_back(v);
    }
    return some;
}

SolverOptions<double> options_of(Random& random) {
    return {.layers = random.chance(0.3) ? unlimited : random.index(4),
            .adaptive_layers = random.chance(0.3),
            .sweeps = 1 + random.index(3)};
}

}  // namespace

TEST_CASE("a solver does not care what another network than that of the step has pinned", "[pinned]") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        CAPTURE(seed);
        Random random(seed);
        const auto network = network_with(some_vertices(random)), other = network_with(some_vertices(random));
        const auto options = options_of(random);
        QuasiStaticSolver one(network, options), two(other, options);
        auto x = mesh.positions(), y = x;
        Index v = random.index(mesh.vertex_count());
        for (int tick = 0; tick < 12; ++tick) {
            if (random.chance(0.2)) v = random.index(mesh.vertex_count());
            if (random.chance(0.2)) one.wake_all(), two.wake_all();
            const Vector3<double> target = point(mesh.positions(), v) + random.vector(-2e-3, 2e-3);
            const auto step = one.step(x, 1e-3, network, foundation, pull(v, target));
            const auto again = two.step(y, 1e-3, network, foundation, pull(v, target));
            REQUIRE(same_bits(x, y));
            REQUIRE(step.vertex_updates == again.vertex_updates);
            REQUIRE(step.converged == again.converged);
        }
    }
}

TEST_CASE("what the network of the step pins does not move, whatever went before", "[pinned]") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        CAPTURE(seed);
        Random random(seed);
        const auto free = network_with({});
        const auto pinned = some_vertices(random);
        const auto network = network_with(pinned);
        QuasiStaticSolver solver(free, options_of(random));
        auto x = mesh.positions();
        const Index v = random.index(mesh.vertex_count());
        for (int tick = 0; tick < 6; ++tick) {  // in motion, with something to predict
            const Vector3<double> target = (1 + 0.02 * tick) * point(mesh.positions(), v);
            REQUIRE(solver.step(x, 1e-3, free, foundation, pull(v, target)).status == StepStatus::advanced);
        }
        const auto before = x;
        for (int tick = 6; tick < 200; ++tick) {
            if (tick == 9) solver.wake_all();
            const Vector3<double> target = (1 + 0.02 * (tick < 12 ? tick : 12)) * point(mesh.positions(), v);
            const auto report = solver.step(x, 1e-3, network, foundation, pull(v, target));
            REQUIRE(report.status == StepStatus::advanced);
            for (const Index fixed : pinned) REQUIRE(same_bits(point(x, fixed), point(before, fixed)));
        }
        for (int tick = 0; tick < 3000; ++tick) {  // and does not keep the others from their rest
            const auto report = solver.step(x, 1e-3, network, foundation);
            if (report.converged) break;
            REQUIRE(tick < 2999);
        }
    }
}
