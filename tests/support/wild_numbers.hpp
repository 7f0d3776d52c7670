// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/traps.hpp"

/// What no device and no caller should ever hand in.
///
///     for (int seed = 1; seed <= cases(1000); ++seed) test::hand_in_wild_number<double>(seed);
namespace test {

/// A number that is none, or at an end of the range; or, to be distinguished from those, an ordinary one.
template <membrane::Real S>
S wild_number(Random& random) {
    using Limits = std::numeric_limits<S>;
    const std::array<S, 12> numbers{Limits::quiet_NaN(),
                                    Limits::infinity(),
                                    -Limits::infinity(),
                                    (Limits::max)(),
                                    Limits::lowest(),
                                    std::sqrt((Limits::max)()),
                                    (Limits::min)(),
                                    Limits::denorm_min(),
                                    -Limits::denorm_min(),
                                    S(-0.0),
                                    S(0),
                                    S(0.5)};
    return numbers[static_cast<std::size_t>(random.index(12))];
}

/// All inputs of a tick.
template <membrane::Real S>
struct Tick {
    S dt = S(1e-3);
    membrane::Tool<S> tool;
    membrane::Points<S> x, anchors;
    membrane::RigidFrame<S> pose;
    membrane::Vector3<S> target, force;
    std::array<membrane::Vector3<S>, 2> weights;
    membrane::PointAttachment<S> held;
};

/// A loop of all parts runs a few ticks, one of them with one wild number in the input. Whatever that was, either all
/// comes out finite, or the step is refused by name with the positions bit for bit as they were; and after what was
/// refused the next ticks go on as if it had not been.
template <membrane::Real S>
void hand_in_wild_number(int seed) {
    using namespace membrane;
    Random random(static_cast<std::uint64_t>(seed));
    static const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
    static const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(1)});
    static const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(0.5), .damping = S(0.001)});
    QuasiStaticSolver<S> solver(network, {.layers = random.chance(0.5) ? 2 : unlimited});
    AabbTree<S> tree(mesh);
    ContactTracker<S> tracker(mesh);
    Grasper<S> grasper(mesh);
    VertexNormals<S> normals(mesh);
    MovingBody<S> body(mesh);

    const Index v = random.index(42), f = random.index(80), g = random.index(80);
    const auto corners = [&](Index i) {
        return std::array<Index, 3>{mesh.triangles()(0, i), mesh.triangles()(1, i), mesh.triangles()(2, i)};
    };
    Tick<S> usual;
    usual.x = usual.anchors = mesh.positions();
    const Vector3<S> from = random.unit_vector<S>();
    usual.tool.radius = S(0.2);
    if (random.chance(0.3)) usual.tool.axis = random.vector<S>();
    usual.target = S(1.1) * point(mesh.positions(), v);
    usual.force = S(0.1) * random.vector<S>();
    usual.weights = {random.barycentric<S>(), random.barycentric<S>()};
    const S part = random.number<S>(S(0.9), S(1.1));
    usual.held = {f, corners(f), usual.weights[0],
                  part * point_at<S>(triangle_at(mesh.positions(), corners(f)), usual.weights[0])};

    Points<S>& x = usual.x;
    bool tame = true;
    for (int tick = 0; tick < 10; ++tick) {
        usual.tool.position = (S(1.25) - S(0.05) * static_cast<S>((std::min)(tick, 4))) * from;
        usual.tool.grasping = tick > 2;
        Tick<S> now = usual;
        const int which = tick == 2 ? random.index(18) : -1;
        const S wild = wild_number<S>(random);
        const Index k = random.index(3), u = random.index(42);
        CAPTURE(tick, which, wild);
        switch (which) {
            case 0: now.dt = wild; break;
            case 1: now.tool.position[k] = wild; break;
            case 2: now.tool.axis[k] = wild; break;
            case 3: now.tool.radius = wild; break;
            case 4: now.tool.velocity[k] = wild; break;
            case 5: now.tool.time = wild; break;
            case 6: now.target[k] = wild; break;
            case 7: now.held.target[k] = wild; break;
            case 8: now.held.barycentric[k] = wild; break;
            case 9: now.force[k] = wild; break;
            case 10: now.weights[1][k] = wild; break;
            case 11: now.x(k, u) = wild; break;
            case 12: now.anchors(k, u) = wild; break;
            case 13: now.pose.origin[k] = wild; break;
            default: break;
        }
        Points<S> before = now.x;
        StepReport<S> report;
        bool touching = false, moved = false;
        {
#ifndef __NO_MATH_ERRNO__  // -ffast-math may divide by zero in a branch that is not taken
            // What is no number is evaluated before it is refused, and squares of what is too large overflow.
            const FloatingPointTraps traps(FloatingPointTraps::only_division);
#endif
            if (which == 11 && seed % 2 == 0) tree.refit(now.x);
            if (which == 12) moved = body.move_to(now.anchors, S(1e-3), now.x);
            if (which == 13) moved = body.move_to(now.pose, now.x);
            if (moved) tree.refit(now.x);
            if (!moved) REQUIRE(same_bits(now.x, before));
            before = now.x;
            auto contact = tracker.update(tree, now.x, now.tool, body);
            touching = contact.touching();
            switch (which) {
                case 14: contact.gap = wild; break;
                case 15: contact.normal[k] = wild; break;
                case 16: contact.patch.axis_point[k] = wild; break;
                case 17: contact.patch.previous_axis_point[k] = wild; break;
                default: break;
            }
            const auto grasp = grasper.update(contact, now.x, now.tool, body);
            report = solver.step(now.x, now.dt, network, on(body, foundation), press(now.tool, contact, grasp),
                                 membrane::pull(now.tool, grasp), membrane::pull(v, now.target), now.held,
                                 load(corners(g), now.weights[1], now.force));
            tree.refit(now.x, report.moved);
            normals.update(now.x, report.moved);
        }
        for (Index i = 0; i < 42; ++i) REQUIRE((is_finite(point(now.x, i)) || !is_finite(point(before, i))));
        REQUIRE(is_finite(normals.values()));
        REQUIRE(is_finite(report.total_reaction()));
        if (report.status != StepStatus::advanced) REQUIRE(same_bits(now.x, before));
        // What every step checks is refused by name.
        const bool is_checked = which >= 0 && (which <= 10 || (which >= 14 && touching));
        if (is_checked && !is_finite(wild)) {
            REQUIRE(report.status == (which == 0 ? StepStatus::bad_time_step : StepStatus::invalid_input));
        }
        // At the end, too, unless the membrane has been taken to where no mesh may be.
        const bool goes_on = tame || (tick == 9 && x.cwiseAbs().maxCoeff() < S(1e6));
        if (which < 0 && goes_on) REQUIRE(report.status == StepStatus::advanced);
        if (which == 11) {  // the caller, too, goes back to the positions that were
            if (report.status == StepStatus::advanced) solver.reset();
            tree.refit(x);
            normals.update(x);
        } else if (report.status == StepStatus::advanced || moved) {
            x = now.x;
            tame = tame && which < 0;  // what is wild and yet a number may be far off by now
        }
    }
}

}  // namespace test
