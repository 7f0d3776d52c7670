// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/explicit_euler.hpp>

#include "support/random.hpp"

/// Everything that a user's loop can hold, in a struct that can be copied, moved and run on.
///
///     test::WholeLoop<double> loop(seed);
///     for (int i = 0; i < 1'000'000; ++i) loop.tick();
namespace test {

/// A tool that presses, slides, lifts off, comes back, grasps, pulls and lets go, here and there on a sphere of 1 cm;
/// now and then it goes too fast, or to where it should not.
template <membrane::Real S>
std::vector<membrane::Waypoint<S>> busy_script(std::uint64_t seed, int rounds) {
    Random random(seed);
    std::vector<membrane::Waypoint<S>> script;
    const auto go = [&](const membrane::Vector3<double>& to, double seconds, bool grasping = false) {
        const double time = script.empty() ? 0 : static_cast<double>(script.back().time) + seconds;
        script.push_back({static_cast<S>(time), to.cast<S>(), grasping});
    };
    for (int i = 0; i < rounds; ++i) {
        const auto there = random.unit_vector();
        const membrane::Vector3<double> beside =
            membrane::direction<double>(there + 0.3 * random.vector<double>(), there);
        const double depth = random.number(0.0, 0.002), speed = random.chance(0.1) ? 0.002 : 0.05;
        go(0.013 * there, 0.05);
        go((0.0105 - depth) * there, speed);   // press
        go((0.0105 - depth) * beside, speed);  // slide
        go(0.013 * beside, speed);
        go(0.0102 * beside, speed);
        go(0.0102 * beside, 0.005, true);  // grasp
        go(0.012 * beside, speed, true);   // pull
        go(0.012 * there, speed);          // let go
        if (random.chance(0.05)) go(-0.015 * there, speed);
        go(0.014 * there, 0.3);
    }
    return script;
}

/// The loop of the README, with forceps.
template <membrane::Real S>
struct WholeLoop {
    explicit WholeLoop(std::uint64_t seed)
        : network(mesh, {}, {.stiffness = S(40)}),
          foundation(mesh, {.stiffness = S(8), .damping = S(0.005)}),
          solver(network, {.layers = 3, .sweeps = 1, .force_tolerance = S(1e-6)}),
          device(busy_script<S>(seed, 40), {.tick = 1e-3, .radius = 1e-3}) {}

    void tick() noexcept {
        if (!device.running()) device.reset();
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, S(1e-3), network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report, grasp}));
        touching += contact.touching();
        holding += grasp.holding();
    }

    membrane::TriangleMesh<S> mesh = membrane::icosphere<S>({.radius = 0.01, .subdivisions = 2});
    membrane::MassSpringNetwork<S, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<S> foundation;
    membrane::QuasiStaticSolver<S> solver;
    membrane::AabbTree<S> tree{mesh};
    membrane::ContactTracker<S> tracker{mesh};
    membrane::Grasper<S> grasper{mesh};
    membrane::VertexNormals<S> normals{mesh};
    membrane::SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    membrane::ScriptedDevice<S> device;
    membrane::Points<S> x = mesh.positions();
    int touching = 0, holding = 0;  // ticks
};

/// What the README's loop leaves out: shafts, two tools, loads, pins, a body that moves, springs that stiffen, the rule
/// as published, explicit Euler, and what goes wrong.
template <membrane::Real S>
struct OddLoop {
    explicit OddLoop(std::uint64_t seed)
        : network(mesh, {}, {.stiffness = S(40), .mass = S(1e-3), .viscosity = S(1e-3), .pinned = {7, 8}}),
          foundation(mesh, {.stiffness = S(8), .damping = S(0.02)}),
          solver(network, {.layers = 6, .adaptive_layers = true, .sweeps = 2, .max_vertex_updates = 300}),
          published(network, {}, membrane::MassStep{}),
          euler(network),
          grasper(mesh, {.snap_to_vertex = true}),
          device(busy_script<S>(seed, 40), {.tick = 1e-3, .radius = 5e-4}) {}

    void tick() noexcept {
        const int now = ticks++;
        if (!device.running()) device.reset();
        move_body(now);
        auto tool = to_body_frame(device.read(), eye);
        tool.axis = 2 * tool.position;
        auto other = tool;
        other.position = -tool.position;
        other.axis.setZero();
        if (now % 1000 < 3) tool.position.x() = std::numeric_limits<S>::quiet_NaN();

        const std::array<membrane::Contact<S>, 2> contacts{trackers[0].update(tree, x, tool, body),
                                                           trackers[1].update(tree, x, other, body)};
        const auto grasp = grasper.update(contacts[1], x, other, body);
        int reads = 0;
        const membrane::Deadline deadline([&reads] { return ++reads; }, now % 10);
        const auto report =
            solver.step_until(deadline, x, now % 1000 == 500 ? S(0) : S(1e-3), network, on(body, foundation),
                              press(tool, contacts[0]), press(other, contacts[1], grasp), pull(other, grasp),
                              membrane::load<S>({0, 1, 2}, {S(0.5), S(0.25), S(0.25)}, {0, 0, S(-1e-3)}),
                              membrane::pull(3, membrane::point(anchors, 3)), membrane::pin(pins));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        refused += report.status != membrane::StepStatus::advanced;
        device.write(eye.vector_to_world(feel({other, contacts[1], report, grasp})));
        if (now % 500 == 250) start_afresh(now);
        if (now % 100 == 0) recover();
    }

    void move_body(int now) noexcept {
        const S sway = S(1e-5) * static_cast<S>(now % 200 < 100 ? now % 100 : 100 - now % 100);
        eye.origin.x() = sway;
        anchors = mesh.positions();
        anchors.row(2) *= 1 + sway;
        refused += !(now % 10 == 5 ? body.move_to(eye, x) : body.move_to(anchors, S(1e-3), x));
        tree.refit(x);
        normals.update(x);
    }

    void start_afresh(int now) noexcept {
        solver.reset();
        solver.wake(pins);
        grasper.reset();
        trackers[static_cast<std::size_t>(now / 500 % 2)].reset();
        tree.refit(x);
        normals.update(x);
    }

    /// The published rule and explicit Euler bring the membrane back.
    void recover() noexcept {
        const auto report = published.step(x, S(1e-3), network, membrane::NoFoundation{});
        refused += report.status != membrane::StepStatus::advanced;
        refused += !euler.step(x, velocity, S(1e-4), network, foundation);
        refused += !euler.step(x, velocity, S(1e-4), network, foundation, external);
        tree.refit(x);
    }

    membrane::TriangleMesh<S> mesh = membrane::icosphere<S>({.radius = 0.01, .subdivisions = 2});
    membrane::MassSpringNetwork<S, membrane::ExponentialSpring> network;
    membrane::VirtualVolumeSprings<S> foundation;
    membrane::QuasiStaticSolver<S> solver;
    membrane::QuasiStaticSolver<S, membrane::MassStep> published;
    membrane::ExplicitEuler<S> euler;
    membrane::AabbTree<S> tree{mesh};
    std::array<membrane::ContactTracker<S>, 2> trackers{membrane::ContactTracker(mesh), membrane::ContactTracker(mesh)};
    membrane::Grasper<S> grasper;
    membrane::VertexNormals<S> normals{mesh};
    membrane::ReactionForce feel{.scale = 30};
    membrane::ScriptedDevice<S> device;
    membrane::RigidFrame<S> eye;
    std::vector<membrane::Index> pins{20, 30, 20};
    membrane::MovingBody<S> body{mesh};
    membrane::Points<S> anchors = mesh.positions(), x = anchors;
    membrane::Points<S> velocity = membrane::Points<S>::Zero(3, x.cols()), external = velocity;
    int ticks = 0, refused = 0;
};

}  // namespace test
