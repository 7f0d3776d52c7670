// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <membrane/collision/aabb_tree.hpp>
#include <membrane/collision/contact_tracker.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/mesh/shapes.hpp>
#include <membrane/solve/press.hpp>

#include "support/catch.hpp"

using namespace membrane;

namespace {

constexpr double radius = 0.01, dt = 1e-3;
constexpr int ticks_of_motion = 300, ticks = 3000;

/// A body that turns and shifts for a while, and then stands still.
RigidFrame<double> body_at(int tick) {
    const double part = std::min(tick, ticks_of_motion) / static_cast<double>(ticks_of_motion);
    const bool moves = tick < ticks_of_motion;
    const Vector3<double> axis = Vector3<double>(1, 2, -1).normalized(), way(0.004, -0.002, 0.003);
    RigidFrame<double> body;
    body.rotation = Eigen::AngleAxisd(0.7 * part, axis).matrix();
    body.origin = part * way;
    if (moves) body.velocity = way / (ticks_of_motion * dt);
    if (moves) body.angular_velocity = 0.7 / (ticks_of_motion * dt) * axis;
    return body;
}

/// A membrane on the body, seen from the body or from the world.
struct Membrane {
    TriangleMesh<double> mesh = icosphere({.radius = radius, .subdivisions = 2});
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{}, NetworkOptions<double>{.stiffness = 40}};
    VirtualVolumeSprings<double> backing{mesh, VolumeOptions<double>{.stiffness = 8, .damping = 0.02}};
    QuasiStaticSolver<double> solver{
        network, SolverOptions<double>{.layers = unlimited, .sweeps = 10, .negligible_force = 1e-14}};
    AabbTree<double> tree{mesh};
    ContactTracker<double> tracker{mesh};
    Points<double> x = mesh.positions();

    Points<double> anchors_on(const RigidFrame<double>& body) const {
        return (body.rotation * mesh.positions()).colwise() + body.origin;
    }
};

}  // namespace

TEST_CASE("what is held feels the same, seen from the body or from the world", "[moving]") {
    Membrane inside, outside;
    StepReport<double> inner, outer;
    const Index v = 7;
    // A place in the world, fixed beside the vertex as it will be in the end.
    const Vector3<double> place = 1.15 * body_at(ticks).point_out(point(inside.mesh.positions(), v));
    for (int tick = 1; tick <= ticks; ++tick) {
        const auto body = body_at(tick);
        inner = inside.solver.step(inside.x, dt, inside.network, inside.backing, pull(v, body.point_in(place)));
        const Points<double> anchors = outside.anchors_on(body), previous = outside.anchors_on(body_at(tick - 1));
        if (tick <= ticks_of_motion + 1) outside.solver.wake_all();
        outer =
            outside.solver.step(outside.x, dt, outside.network, outside.backing.at(anchors, previous), pull(v, place));
    }
    REQUIRE(inner.residual < 1e-13);
    REQUIRE(outer.residual < 1e-13);
    const auto body = body_at(ticks);
    const Vector3<double> force = body.direction_out(inner.reactions[0]);
    CHECK(norm(force) > 1e-3);
    CHECK(norm<double>(force - outer.reactions[0]) <= 1e-9 * norm(force));
    const Points<double> carried_out = (body.rotation * inside.x).colwise() + body.origin;
    CHECK((carried_out - outside.x).cwiseAbs().maxCoeff() <= 1e-9 * radius);
}

TEST_CASE("a tool that presses feels the same, seen from the body or from the world", "[moving]") {
    Membrane inside, outside;
    StepReport<double> inner, outer;
    Contact<double> inner_contact, outer_contact;
    const Vector3<double> top = body_at(ticks).point_out({0, 0, 0});
    for (int tick = 1; tick <= ticks; ++tick) {
        const auto body = body_at(tick);
        // Down onto the sphere in the world, at the velocity that takes.
        const bool moves = tick < 2 * ticks_of_motion;
        const double height = radius + 0.003 - 0.003 * std::min(1.0, tick / (2.0 * ticks_of_motion));
        const Vector3<double> direction = Vector3<double>(0.2, 0.3, 1).normalized();
        const Tool<double> tool{.position = top + height * direction,
                                .radius = 0.0015,
                                .velocity = moves ? Vector3<double>(-0.003 / (2 * ticks_of_motion * dt) * direction)
                                                  : Vector3<double>(0, 0, 0)};
        const auto seen = carried_in(tool, body);
        inner_contact = inside.tracker.update(inside.tree, inside.x, seen);
        inner = inside.solver.step(inside.x, dt, inside.network, inside.backing, press(seen, inner_contact));
        inside.tree.refit(inside.x, inner.moved);

        const Points<double> anchors = outside.anchors_on(body), previous = outside.anchors_on(body_at(tick - 1));
        outer_contact = outside.tracker.update(outside.tree, outside.x, tool, anchors);
        if (tick <= ticks_of_motion + 1) outside.solver.wake_all();
        outer = outside.solver.step(outside.x, dt, outside.network, outside.backing.at(anchors, previous),
                                    press(tool, outer_contact));
        outside.tree.refit(outside.x, outer.moved);
    }
    REQUIRE(inner_contact.touching());
    REQUIRE(outer_contact.touching());
    REQUIRE(inner.residual < 1e-12);
    REQUIRE(outer.residual < 1e-12);
    const auto body = body_at(ticks);
    const Vector3<double> force = body.direction_out(inner.reactions[0]);
    CHECK(norm(force) > 1e-3);
    CHECK(norm<double>(force - outer.reactions[0]) <= 1e-9 * norm(force));
    CHECK(std::abs(inner_contact.depth - outer_contact.depth) <= 1e-9 * radius);
    CHECK(norm<double>(body.direction_out(inner_contact.normal) - outer_contact.normal) <= 1e-7);
    const Points<double> carried_out = (body.rotation * inside.x).colwise() + body.origin;
    CHECK((carried_out - outside.x).cwiseAbs().maxCoeff() <= 1e-9 * radius);
}

TEST_CASE("a membrane follows the body it lies on, and its own frame costs nothing", "[moving]") {
    Membrane inside, outside;
    for (int tick = 1; tick <= ticks; ++tick) {
        const Points<double> anchors = outside.anchors_on(body_at(tick)),
                             previous = outside.anchors_on(body_at(tick - 1));
        if (tick <= ticks_of_motion + 1) outside.solver.wake_all();
        const auto report = outside.solver.step(outside.x, dt, outside.network, outside.backing.at(anchors, previous));
        REQUIRE(report.status == StepStatus::advanced);
        REQUIRE(inside.solver.step(inside.x, dt, inside.network, inside.backing).visits == 0);
    }
    CHECK((outside.x - outside.anchors_on(body_at(ticks))).cwiseAbs().maxCoeff() <= 1e-9 * radius);
    CHECK(outside.network.energy(outside.x) < 1e-20);
}
