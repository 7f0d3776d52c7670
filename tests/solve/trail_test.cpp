// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/catch.hpp"

// What a tool that slides leaves behind: its cost does not grow with the length of the slide, and nothing of it stays.

using namespace membrane;

namespace {

constexpr double radius = 0.01, tool_radius = 2e-3, depth = 1e-3, speed = 0.05, dt = 1e-3;  // [m], [m/s], [s]

/// Mean numbers of a tick, over a hundred ticks.
struct Work {
    double moved = 0, updates = 0;
};

/// A tool that is pressed into a membrane and slides at constant depth along a circle.
template <Real S, class Network, class Volume>
struct Slide {
    const TriangleMesh<S>& mesh;
    const Network& network;
    const Volume& volume;
    bool flat = false;  ///< the membrane is a disc, otherwise a sphere
    QuasiStaticSolver<S> solver{network, SolverOptions<S>{.layers = 6, .sweeps = 2}};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh};
    Points<S> x = mesh.positions();
    int now = 0;

    Tool<S> tool() const {
        const double deep = depth * std::min(now / 60.0, 1.0), slid = speed * dt * std::max(now - 60, 0);
        const double angle = slid / (flat ? 0.4 * radius : radius), around = 0.2 * std::sin(0.37 * angle);
        const Vector3<double> on_sphere = Vector3<double>(std::sin(angle), around, std::cos(angle)).normalized();
        const Vector3<double> on_disc(0.4 * radius * std::cos(angle), 0.4 * radius * std::sin(angle), 0);
        const double height = tool_radius - deep;
        const Vector3<double> at = flat ? Vector3<double>(on_disc + height * Vector3<double>::UnitZ())
                                        : Vector3<double>((radius + height) * on_sphere);
        return {.position = at.template cast<S>(), .radius = static_cast<S>(tool_radius)};
    }

    /// Ticks until number `end`; means over the last hundred.
    template <class Move>
    Work play_until(int end, const Move& move) {
        Work work;
        for (; now < end; ++now) {
            move(x);
            const auto held = tool();
            const auto contact = tracker.update(tree, x, held);
            const auto report = solver.step(x, S(dt), network, volume, press(held, contact));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
            if (now < end - 100) continue;
            REQUIRE(contact.touching());
            work.moved += static_cast<double>(report.moved.size()) / 100;
            work.updates += static_cast<double>(report.vertex_updates) / 100;
        }
        return work;
    }

    /// After a long slide a tick makes hardly more updates than after a short one. How many also depends on the mesh
    /// below the tool, and on a soft foundation the trail becomes longer until its beginning has come to rest.
    template <class Move>
    void check(const Move& move) {
        const Work first = play_until(300, move);
        for (const int end : {800, 1600}) {
            const Work later = play_until(end, move);
            CAPTURE(end);
            CHECK(later.moved < 1.7 * first.moved);
            CHECK(later.updates < 1.7 * first.updates);
        }
    }
    void check() {
        check([](auto&) {});
    }
};

template <Real S, class Network, class Volume>
Slide<S, Network, Volume> slide(const TriangleMesh<S>& mesh, const Network& network, const Volume& volume,
                                bool flat = false) {
    return {mesh, network, volume, flat};
}

}  // namespace

TEMPLATE_TEST_CASE("however long a tool slides, a tick makes no more updates", "[trail]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = radius, .subdivisions = 3});
    const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(40)});
    for (const S stiffness : {S(8), S(0.8)}) {
        for (const S damping : {S(0), S(2.5e-3)}) {
            CAPTURE(stiffness, damping);
            const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = stiffness, .damping = damping * stiffness});
            slide<S>(mesh, network, foundation).check();
        }
    }
}

TEST_CASE("however long a tool slides on a fine mesh, a tick makes no more updates", "[trail]") {
    const auto mesh = icosphere({.radius = radius, .subdivisions = 4});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    slide<double>(mesh, network, foundation).check();
}

TEST_CASE("however long a tool slides on a tissue, a tick makes no more updates", "[trail][tissue]") {
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.4, .thickness = 20e-6};
    SECTION("with bending, on a foundation") {
        const auto mesh = icosphere({.radius = radius, .subdivisions = 3});
        const MassSpringNetwork<double, LinearSpring> none(mesh, {}, {.stiffness = 0.0});
        const Tissue tissue(none, triangular_springs(mesh, material), bending_springs(mesh, 1e-7));
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
        slide<double>(mesh, tissue, foundation).check();
    }
    SECTION("stretched over a ring, without a foundation") {
        const auto mesh = disc({.radius = radius, .rings = 16});
        const MassSpringNetwork<double, LinearSpring> rim(mesh, {}, {.stiffness = 0.0, .pinned = border(mesh)});
        const Tissue tissue(rim, triangular_springs(mesh, material, 1.05));
        slide<double>(mesh, tissue, NoFoundation{}, true).check();
    }
}

TEST_CASE("however long a tool slides on a body that turns, a tick makes no more updates", "[trail]") {
    const auto mesh = icosphere({.radius = radius, .subdivisions = 3});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    MovingBody body(mesh);
    double angle = 0;
    slide<double>(mesh, network, on(body, foundation)).check([&](Points<double>& x) {
        angle += 2e-3;
        const Eigen::AngleAxisd turn(angle, Eigen::Vector3d(1, 2, 3).normalized());
        REQUIRE(body.move_to(RigidFrame<double>{.rotation = turn.toRotationMatrix()}, x));
    });
}

TEST_CASE("what a tool that slid has left behind comes to rest while the tool stays, and when it is out", "[trail]") {
    const auto mesh = icosphere({.radius = radius, .subdivisions = 3});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 40.0});
    for (const double stiffness : {8.0, 0.8}) {
        for (const bool lifted : {false, true}) {
            CAPTURE(stiffness, lifted);
            const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness, .damping = 2.5e-3 * stiffness});
            auto moving = slide<double>(mesh, network, foundation);
            moving.play_until(400, [](auto&) {});
            auto& x = moving.x;
            auto held = moving.tool();
            if (lifted) held.position *= 2;
            StepReport<double> report;
            for (int tick = 0; tick < 2000 && !report.converged; ++tick) {
                const auto contact = moving.tracker.update(moving.tree, x, held);
                report = moving.solver.step(x, dt, network, foundation, press(held, contact));
                moving.tree.refit(x, report.moved);
            }
            REQUIRE(report.converged);
            if (lifted) {
                CHECK((x - mesh.positions()).cwiseAbs().maxCoeff() < 1e-9);
            } else {  // no force on any vertex that has ever moved, but under the tool
                for (Index v = 0; v < mesh.vertex_count(); ++v) {
                    const auto queue = moving.solver.queue().vertices();
                    const bool asleep = std::find(queue.begin(), queue.end(), v) == queue.end();
                    if (!asleep || point(x, v) == point(mesh.positions(), v)) continue;
                    const Vector3<double> force =
                        network.force_on(v, x).force + foundation.force_on(v, point(x, v), point(x, v), dt).force;
                    CHECK(norm(force) < 2 * network.force_tolerance());
                }
            }
        }
    }
}
