// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/spring_stiffness.hpp>
#include <membrane/solve/tool_contact.hpp>
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

TEST_CASE("a rim that its user moves takes the membrane along", "[pinned]") {
    const auto cap = spherical_cap({.radius = 0.01, .diameter = 0.015, .rings = 8});
    const auto rim = border(cap);
    const MassSpringNetwork network(cap, LinearSpring{}, {.stiffness = 40.0, .pinned = rim});
    const VirtualVolumeSprings soft(cap, {.stiffness = 1.0});
    const auto is_woken = [&](const SolverOptions<double>& options, bool wakes) {
        QuasiStaticSolver solver(network, options);
        Points<double> x = cap.positions();
        StepReport<double> report;
        for (int tick = 0; tick < 2000 && !(tick > 60 && report.converged); ++tick) {
            if (tick > 20 && tick <= 40) {
                for (const Index v : rim) x.col(v) += 5e-5 * Vector3<double>(1, 0.5, 0.2);
            }
            if (wakes) solver.wake_all();
            report = solver.step(x, 1e-3, network, soft);
            REQUIRE(report.status == StepStatus::advanced);
        }
        REQUIRE(report.converged);
        return x;
    };
    const SolverOptions<double> all{.layers = unlimited, .sweeps = 4};
    const auto x = is_woken(all, false), y = is_woken(all, true);
    CHECK((x - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((x - cap.positions()).colwise().norm().minCoeff() > 1e-6);
    const SolverOptions<double> as_needed{.layers = unlimited, .adaptive_layers = true, .sweeps = 4};
    CHECK((is_woken(as_needed, false) - y).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("a rim at rest wakes nothing", "[pinned]") {
    const auto cap = spherical_cap({.radius = 0.01, .diameter = 0.015, .rings = 8});
    const MassSpringNetwork network(cap, LinearSpring{}, {.stiffness = 40.0, .pinned = border(cap)});
    QuasiStaticSolver solver(network);
    Points<double> x = 1.1 * cap.positions();  // out of equilibrium
    for (int tick = 0; tick < 3; ++tick) CHECK(solver.step(x, 1e-3, network, NoFoundation{}).vertex_updates == 0);
}

TEST_CASE("a ball on a sphere beside pinned vertices comes to rest", "[pinned]") {
    Random random(5);
    const double ball = mean_edge(mesh);
    for (int seed = 1; seed <= 30; ++seed) {
        const bool one = seed % 2 == 0;
        std::vector<Index> pins;
        for (Index v = 20 % (one ? 21 : 2); v < mesh.vertex_count(); v += one ? mesh.vertex_count() : 2)
            pins.push_back(v);
        CAPTURE(seed, one);
        const auto network = network_with(pins);
        QuasiStaticSolver<double> solver(network, {.layers = 6, .sweeps = 2});
        AabbTree<double> tree(mesh);
        ContactTracker<double> tracker(mesh);
        auto x = mesh.positions();
        const Vector3<double> above = point(mesh.positions(), 20) + random.vector(-0.7 * ball, 0.7 * ball);
        const Vector3<double> out = above.normalized();
        const double depth = 0.5 * ball * seed / 30;
        StepReport<double> report;
        for (int tick = 0; tick < 500 && !(tick > 100 && report.converged); ++tick) {
            const double in = depth * std::min(1.0, tick / 100.0);
            const Tool<double> tool{.position = (0.01 + ball - in) * out, .radius = ball};
            report = solver.step(x, 1e-3, network, foundation, press(tool, tracker.update(tree, x, tool)));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
        }
        CHECK(report.converged);
    }
}
