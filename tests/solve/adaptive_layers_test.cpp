// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/run_to_equilibrium.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double radius = 0.01, stiffness = 40, dt = 1e-3;

struct Membrane {
    explicit Membrane(double foundation_stiffness, Index subdivisions = 2)
        : mesh(icosphere({.radius = radius, .subdivisions = subdivisions})),
          network(mesh, LinearSpring{}, {.stiffness = stiffness}),
          foundation(mesh, {.stiffness = foundation_stiffness, .damping = 1e-3}) {}

    /// Largest force on any vertex but `held`, without damping [N].
    [[nodiscard]] double residual(const Points<double>& x, Index held = no_index) const {
        double largest = 0;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Vector3<double> here = point(x, v);
            const Vector3<double> force = network.force_on(v, x).force + foundation.force_on(v, here, here, dt).force;
            if (v != held) largest = std::max(largest, norm(force));
        }
        return largest;
    }

    [[nodiscard]] Vector3<double> pushed(Index v, double part) const { return (1 - part) * point(mesh.positions(), v); }

    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;
};

}  // namespace

TEST_CASE("with layers as needed, converged speaks of the whole membrane", "[solver][queue]") {
    Index fewest_layers = unlimited, max_layers = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane membrane(stiffness * std::pow(10, random.number(-1.5, 1.0)));
        const double tolerance = stiffness * radius * std::pow(10, random.number(-7.0, -2.0));
        const Index max_vertex_updates = random.chance(0.3) ? 300 + random.index(1000) : unlimited;
        QuasiStaticSolver solver(membrane.network, {.layers = unlimited,
                                                    .adaptive_layers = true,
                                                    .sweeps = 1 + random.index(6),
                                                    .max_vertex_updates = max_vertex_updates,
                                                    .force_tolerance = tolerance});
        Points<double> x = membrane.mesh.positions();
        int converged = 0;
        for (int hold = 0; hold < 6; ++hold) {
            const Index v = random.chance(0.3) ? no_index : random.index(membrane.mesh.vertex_count());
            const double part = random.number(-0.2, 0.2);
            for (int tick = 0; tick < 2000; ++tick) {
                const auto report = v == no_index ? solver.step(x, dt, membrane.network, membrane.foundation)
                                                  : solver.step(x, dt, membrane.network, membrane.foundation,
                                                                pull(v, membrane.pushed(v, part)));
                REQUIRE(report.status == StepStatus::advanced);
                REQUIRE(report.vertex_updates <= max_vertex_updates);
                if (v != no_index && solver.queue().layer_count() > 0) {
                    fewest_layers = std::min(fewest_layers, solver.queue().layer_count());
                    max_layers = std::max(max_layers, solver.queue().layer_count());
                }
                if (!report.converged) continue;
                ++converged;
                REQUIRE(report.residual <= tolerance);
                REQUIRE(membrane.residual(x, v) <= tolerance * (1 + 1e-9));
                break;
            }
        }
        REQUIRE(converged == 6);
    }
    CHECK(fewest_layers <= 2);
    CHECK(max_layers >= 8);
}

TEST_CASE("with layers as needed a tool is pressed against as by the whole membrane", "[solver][queue]") {
    const Membrane membrane(0.1 * stiffness);
    const auto press_on = [&](SolverOptions<double> options) {
        QuasiStaticSolver solver(membrane.network, options);
        AabbTree<double> tree(membrane.mesh);
        ContactTracker<double> tracker(membrane.mesh);
        Points<double> x = membrane.mesh.positions();
        StepReport<double> report;
        Index updates = 0;
        for (int tick = 1; tick <= 200; ++tick) {
            const double deep = 1.5e-3 * std::min(tick / 50.0, 1.0);
            const Tool<double> tool{.position = {0, 0, radius + 3e-3 - deep}, .radius = 3e-3, .time = tick * dt};
            const auto contact = tracker.update(tree, x, tool);
            report = solver.step(x, dt, membrane.network, membrane.foundation, press(tool, contact));
            tree.refit(x, report.moved);
            updates += report.vertex_updates;
        }
        return std::pair(report.reactions[0], updates);
    };
    const auto [exact, all_updates] = press_on({.layers = unlimited, .sweeps = 64});
    double before = 1;
    Index updates_before = 0;
    for (const double part : {1e-2, 1e-3, 1e-4}) {
        CAPTURE(part);
        const auto [force, updates] = press_on(
            {.layers = unlimited, .adaptive_layers = true, .sweeps = 64, .force_tolerance = part * norm(exact)});
        const double error = norm<double>(force - exact) / norm(exact);
        CHECK(error < 4 * part);
        CHECK(error < before);
        CHECK(updates > updates_before);
        before = error;
        updates_before = updates;
    }
    CHECK(updates_before < all_updates / 2);
    CHECK(before < 1e-2);
}

TEST_CASE("a membrane comes to rest however little time its steps have", "[solver][deadline]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane membrane(stiffness * std::pow(10, random.number(-1.0, 1.0)));
        const SolverOptions<double> options{
            .layers = unlimited, .adaptive_layers = random.chance(0.5), .sweeps = 1 + random.index(10)};
        QuasiStaticSolver solver(membrane.network, options);
        const Deadline over([] { return 0.0; }, -1.0);
        const Index v = random.index(162);
        Points<double> x = membrane.mesh.positions();
        StepReport<double> report;
        int ticks = 0;
        for (; !report.converged; ++ticks) {
            REQUIRE(ticks < 100'000);
            report =
                solver.step_until(over, x, dt, membrane.network, membrane.foundation, pull(v, membrane.pushed(v, 0.1)));
            REQUIRE(report.status == StepStatus::advanced);
            REQUIRE(report.vertex_updates <= 33 + 2 * 162);
        }
        CHECK(ticks > 20);
        CHECK(membrane.residual(x, v) <= membrane.network.force_tolerance());
    }
}

TEST_CASE("what a limit of updates leaves out is the farthest, in colours too", "[solver][queue]") {
    const Membrane membrane(stiffness / 10, 3);
    const Index v = 5;
    const auto force = [&](UpdateOrder order, Index max_vertex_updates) {
        QuasiStaticSolver solver(
            membrane.network,
            {.layers = unlimited, .sweeps = 4, .order = order, .max_vertex_updates = max_vertex_updates});
        Points<double> x = membrane.mesh.positions();
        StepReport<double> report;
        for (int tick = 0; tick < 300; ++tick) {
            report = solver.step(x, dt, membrane.network, membrane.foundation, pull(v, membrane.pushed(v, 0.1)));
            REQUIRE(report.vertex_updates <= max_vertex_updates);
        }
        return norm(report.reactions[0]);
    };
    const double exact = force(UpdateOrder::breadth_first, unlimited);
    for (const UpdateOrder order : {UpdateOrder::breadth_first, UpdateOrder::colour_layers, UpdateOrder::colour_all}) {
        CHECK(force(order, unlimited) == Approx(exact).epsilon(1e-6));
        CHECK(force(order, 1000) == Approx(exact).epsilon(0.02));
    }
}
