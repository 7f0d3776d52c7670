// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Geometry>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/haptics/force_policy.hpp>
#include <membrane/haptics/rest_contact.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

constexpr double radius = 0.01, dt = 1e-3;

enum class Input { pose, anchors };

/// A membrane in the frame of its body, or in the world on a body that moves, and what one tick of it comes to.
struct Membrane {
    Membrane(const TriangleMesh<double>& shape, bool pins, Index layers = unlimited)
        : mesh(shape),
          network(mesh, LinearSpring{}, {.stiffness = 40.0, .pinned = pins ? border(mesh) : std::vector<Index>{}}),
          solver(network, {.layers = layers, .sweeps = 4, .force_tolerance = 1e-13}) {}

    void tick(const Tool<double>& tool) {
        contact = tracker.update(tree, x, tool);
        grasp = grasper.update(contact, x, tool);
        report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), membrane::pull(tool, grasp));
        end(tool, smooth(contact));
    }
    void tick_on_body(const Tool<double>& tool, const RigidFrame<double>& pose, Input input) {
        if (input == Input::pose) {
            REQUIRE(body.move_to(pose, x));
        } else {
            Points<double> anchors = mesh.positions();
            for (Index v = 0; v < anchors.cols(); ++v) anchors.col(v) = pose.point_to_world(point(mesh.positions(), v));
            REQUIRE(body.move_to(anchors, dt, x));
        }
        tree.refit(x);
        contact = tracker.update(tree, x, tool, body);
        grasp = grasper.update(contact, x, tool, body);
        report =
            solver.step(x, dt, network, on(body, foundation), press(tool, contact, grasp), membrane::pull(tool, grasp));
        end(tool, smooth(contact, body));
    }
    void end(const Tool<double>& tool, const Contact<double>& smooth_contact) {
        REQUIRE(report.status == StepStatus::advanced);
        tree.refit(x, report.moved);
        force = report.total_reaction();
        felt = SpringDamperForce{.stiffness = 100, .damping = 0.5}({tool, smooth_contact, report, grasp});
    }

    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation{mesh, VolumeSpringOptions<double>{.stiffness = 8, .damping = 0.02}};
    QuasiStaticSolver<double> solver;
    AabbTree<double> tree{mesh};
    ContactTracker<double> tracker{mesh};
    Grasper<double> grasper{mesh};
    SmoothContact<double> smooth{mesh};
    MovingBody<double> body{mesh};
    Points<double> x = mesh.positions();
    Contact<double> contact;
    Grasp<double> grasp;
    StepReport<double> report;
    Vector3<double> force = Vector3<double>::Zero(), felt = force;
};

Tool<double> in_world(Tool<double> tool, const RigidFrame<double>& pose) {
    tool.position = pose.point_to_world(tool.position);
    tool.velocity = pose.vector_to_world(tool.velocity) + pose.velocity_at(tool.position);
    return tool;
}

constexpr int phase_ticks = 150, active_ticks = 50;  // the rest of a phase is still

/// Comes down, slides, closes the forceps, goes up with what they hold, each followed by a rest; as seen from the body.
Tool<double> stroke_at(int tick) {
    const auto part = [](int phase, int now) {
        return std::clamp(static_cast<double>(now - phase * phase_ticks) / active_ticks, 0.0, 1.0);
    };
    const auto position = [&](int now) {
        const double down = part(0, now), along = part(1, now), up = part(3, now);
        return Vector3<double>(0.3e-3 + 1.1e-3 * along, 0.17e-3 + 0.4e-3 * along,
                               0.01117 - 0.8e-3 * down + 1.3e-3 * up);
    };
    Tool<double> tool{.position = position(tick), .radius = 1e-3, .time = tick * dt};
    tool.velocity = (position(tick) - position(tick - 1)) / dt;
    tool.grasping = tick >= 2 * phase_ticks;
    return tool;
}
const char* const phases[] = {"press", "slide", "grasp", "pull"};

/// How far a membrane on a body is from the same one in the body's frame; forces in parts of the latter's.
struct Difference {
    Difference(const Membrane& rest, const Membrane& moved, const RigidFrame<double>& pose) {
        const auto off = [&](const Vector3<double>& at_rest, const Vector3<double>& now) {
            return norm<double>(pose.vector_to_world(at_rest) - now) / (std::max)(norm(at_rest), 5e-3);
        };
        force = off(rest.force, moved.force);
        felt = off(rest.felt, moved.felt);
        depth = std::abs(rest.contact.depth - moved.contact.depth) / radius;
        for (Index v = 0; v < rest.x.cols(); ++v) {
            const double here = norm<double>(pose.point_to_world(point(rest.x, v)) - point(moved.x, v));
            positions = std::max(positions, here / radius);
        }
    }
    double force, felt, depth, positions = 0;
};

struct Scene {
    std::string name;
    TriangleMesh<double> mesh;
    bool pins;
};

const Scene scenes[] = {
    {"sphere", icosphere({.radius = radius, .subdivisions = 2}), false},
    {"cap, its border free", spherical_cap({.radius = radius, .diameter = 0.016, .rings = 8}), false},
    {"cap, its border pinned", spherical_cap({.radius = radius, .diameter = 0.016, .rings = 8}), true},
};

/// Turns by 20 degrees and shifts by some millimetres in half a second, smoothly.
RigidFrame<double> smooth_motion(double time) {
    const double s = std::min(time / 0.5, 1.0), u = s * s * (3 - 2 * s), rate = 6 * s * (1 - s) / 0.5;
    const Vector3<double> axis = Vector3<double>(1, 1, 0.3).normalized(), displacement(2e-3, 1e-3, -1e-3);
    const double angle = 20 * 3.14159265358979 / 180;
    return {Eigen::AngleAxisd(angle * u, axis.eigen()).toRotationMatrix(), u * displacement, rate * displacement,
            rate * angle * axis};
}

}  // namespace

// What touches a vertex or an edge touches several triangles alike, and rounding decides which of them a solver begins
// with: before the equilibrium a step may differ by what it leaves undone, about 1e-6; at rest it may not.
TEST_CASE("a body that jumps with the tool on it: all forces as at rest", "[moving]") {
    for (const auto& scene : scenes) {
        for (const Input input : {Input::pose, Input::anchors}) {
            INFO(scene.name << ", given by " << (input == Input::pose ? "pose" : "anchors"));
            test::Random random(7);
            Membrane rest(scene.mesh, scene.pins), moved(scene.mesh, scene.pins);
            RigidFrame<double> pose;
            for (int tick = 0; tick < 4 * phase_ticks; ++tick) {
                if (tick % 12 == 0) {  // more than ten poses in each phase
                    pose.rotation = random.rotation();
                    pose.origin = 5 * radius * random.vector();
                }
                const auto tool = stroke_at(tick);
                rest.tick(tool);
                moved.tick_on_body(in_world(tool, pose), pose, input);
                INFO(phases[tick / phase_ticks] << ", tick " << tick);
                const Difference difference(rest, moved, pose);
                const bool still = tick % phase_ticks == phase_ticks - 1;
                const double bound = still ? 1e-9 : 1e-4;
                REQUIRE(difference.force <= bound);
                REQUIRE(difference.depth <= 1e-9);
                REQUIRE(difference.positions <= bound);
                // A jump has no velocity, but for a body that is given by anchors.
                if (still || input == Input::pose) REQUIRE(difference.felt <= bound);
                REQUIRE(rest.contact.touching() == moved.contact.touching());
                REQUIRE(rest.grasp.holding() == moved.grasp.holding());
                if (still) REQUIRE(norm(rest.force) > 5e-3);
                if (still) REQUIRE(rest.grasp.holding() == (tick >= 2 * phase_ticks));
            }
            CHECK(moved.body.deformations() == 0);
        }
    }
}

TEST_CASE("a body that turns and shifts under forceps: all forces as at rest", "[moving]") {
    for (const auto& scene : scenes) {
        for (const Input input : {Input::pose, Input::anchors}) {
            INFO(scene.name << ", given by " << (input == Input::pose ? "pose" : "anchors"));
            Membrane rest(scene.mesh, scene.pins), moved(scene.mesh, scene.pins);
            for (int tick = 0; tick < 4 * phase_ticks; ++tick) {
                const auto pose = smooth_motion(tick * dt);
                const auto tool = stroke_at(tick);
                rest.tick(tool);
                moved.tick_on_body(in_world(tool, pose), pose, input);
                INFO(phases[tick / phase_ticks] << ", tick " << tick);
                const Difference difference(rest, moved, pose);
                const bool still = tick % phase_ticks == phase_ticks - 1;
                const double bound = still ? 1e-9 : 1e-4;
                REQUIRE(difference.force <= bound);
                REQUIRE(difference.positions <= bound);
                // Of anchors the velocity is the mean over the tick: half a tick times the acceleration off.
                REQUIRE(difference.felt <= (input == Input::pose ? bound : 1e-2));
            }
        }
    }
}

// Seen from the body, what is still there moves by rounding in the world.
TEST_CASE("beside a point held still on a moving body, a steady pull is extrapolated as at rest", "[moving]") {
    for (const Input input : {Input::pose, Input::anchors}) {
        INFO("given by " << (input == Input::pose ? "pose" : "anchors"));
        Membrane rest(scenes[0].mesh, false), moved(scenes[0].mesh, false);
        const auto& x = scenes[0].mesh.positions();
        for (int tick = 0; tick < 300; ++tick) {
            const auto pose = smooth_motion(tick * dt);
            Points<double> anchors = x;
            for (Index v = 0; v < anchors.cols(); ++v) anchors.col(v) = pose.point_to_world(point(x, v));
            REQUIRE(
                (input == Input::pose ? moved.body.move_to(pose, moved.x) : moved.body.move_to(anchors, dt, moved.x)));
            const Vector3<double> still = 1.1 * point(x, 3), steady = (1 + 1e-3 * tick) * point(x, 7);
            const auto at_rest = rest.solver.step(rest.x, dt, rest.network, rest.foundation, membrane::pull(3, still),
                                                  membrane::pull(7, steady));
            const auto on_body = moved.solver.step(moved.x, dt, moved.network, on(moved.body, moved.foundation),
                                                   membrane::pull(3, pose.point_to_world(still)),
                                                   membrane::pull(7, pose.point_to_world(steady)));
            CAPTURE(tick);
            REQUIRE(std::abs(on_body.residual - at_rest.residual) <= 1e-9);
            const Vector3<double> force = pose.vector_to_world(at_rest.reactions[1]);
            REQUIRE(norm<double>(on_body.reactions[1] - force) <= 1e-9 * norm(force));
        }
    }
}

TEST_CASE("a still tool on a body that moves feels the same, seen from the body or from the world", "[moving]") {
    const auto& scene = scenes[0];
    Membrane inside(scene.mesh, false), outside(scene.mesh, false);
    for (int tick = 0; tick <= 600; ++tick) {
        const auto pose = smooth_motion(tick * dt);
        const Tool<double> tool{.position = {0.3e-3, 0.5e-3, 0.0094}, .radius = 1e-3};
        inside.tick(to_body_frame(tool, pose));
        outside.tick_on_body(tool, pose, Input::pose);
        CAPTURE(tick);
        const Difference difference(inside, outside, pose);
        const double bound = tick == 600 ? 1e-9 : 1e-4;
        REQUIRE(difference.force <= bound);
        REQUIRE(difference.felt <= bound);
        REQUIRE(difference.positions <= bound);
    }
    CHECK(norm(outside.force) > 5e-3);
}

TEST_CASE("the contact with the surface at rest goes with its body", "[moving]") {
    const auto& mesh = scenes[0].mesh;
    const RestContact rest(mesh);
    const SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        AabbTree<double> tree(mesh);
        MovingBody body(mesh);
        Points<double> x = mesh.positions();
        const RigidFrame<double> pose{random.rotation(), radius * random.vector(), random.vector(), random.vector()};
        REQUIRE(body.move_to(pose, x));
        tree.refit(body.anchors());
        const Tool<double> tool{.position = radius * random.unit_vector(), .radius = 1e-3, .velocity = random.vector()};
        const auto there = rest({}, in_world(tool, pose), tree, body), here = rest({}, tool);
        const Vector3<double> felt = feel({in_world(tool, pose), there, {}});
        REQUIRE(std::abs(there.depth - here.depth) <= 1e-15);
        REQUIRE(norm<double>(felt - pose.vector_to_world(feel({tool, here, {}}))) <= 1e-12);
    }
}

TEST_CASE("a membrane goes with its body, pinned or not, at no visit where it is rigid", "[moving]") {
    for (const auto& scene : scenes) {
        INFO(scene.name);
        Membrane moved(scene.mesh, scene.pins, 6);
        const Tool<double> far{.position = {1, 1, 1}, .radius = 1e-3};
        for (int tick = 0; tick <= 100; ++tick) {
            moved.tick_on_body(far, smooth_motion(5 * tick * dt), tick % 2 == 0 ? Input::pose : Input::anchors);
            REQUIRE(moved.report.vertex_updates == 0);
            REQUIRE(moved.x == moved.body.anchors());
        }
    }
}

TEST_CASE("a body that swells: the membrane comes to the rest that it has on it", "[moving]") {
    for (const auto& scene : scenes) {
        INFO(scene.name);
        Membrane moved(scene.mesh, scene.pins);
        const auto move_to = [&](double swollen) {
            const Points<double> anchors = (1 + swollen) * scene.mesh.positions();
            REQUIRE(moved.body.move_to(anchors, dt, moved.x));
            moved.report = moved.solver.step(moved.x, dt, moved.network, on(moved.body, moved.foundation));
            REQUIRE(moved.report.status == StepStatus::advanced);
        };
        for (int tick = 0; tick <= 100; ++tick) move_to(1e-3 * tick);
        CHECK(moved.body.deformations() == 100);  // and not when nothing moved at first
        for (int tick = 0; tick < 1500 && !moved.report.converged; ++tick) move_to(0.1);
        REQUIRE(moved.report.converged);
        CHECK(moved.body.deformations() == 100);
        for (Index v = 0; v < moved.x.cols(); ++v) {
            const auto springs = moved.network.force_on(v, moved.x).force;
            const Vector3<double> foundation = -8 * (point(moved.x, v) - 1.1 * point(scene.mesh.positions(), v));
            if (moved.network.pinned(v)) {
                REQUIRE(norm<double>(point(moved.x, v) - 1.1 * point(scene.mesh.positions(), v)) <= 1e-15);
            } else {
                REQUIRE(norm<double>(springs + foundation) <= 1e-12);
            }
        }
        // What pins hold at the border pushes back with the sum of all other forces.
        if (!scene.pins) continue;
        const auto rim = border(scene.mesh);
        const auto report = moved.solver.step(moved.x, dt, moved.network, on(moved.body, moved.foundation), pin(rim));
        Vector3<double> sum = Vector3<double>::Zero();
        for (const Index v : rim) sum += moved.network.force_on(v, moved.x).force;
        CHECK(norm<double>(report.reactions[0] - sum) <= 1e-12);
        CHECK(norm(sum) > 1e-3);
    }
}

TEST_CASE("a refused step leaves the membrane where its body took it", "[moving]") {
    const auto& scene = scenes[2];
    Membrane rest(scene.mesh, true, 6), moved(scene.mesh, true, 6);
    test::Random random(3);
    for (int tick = 0; tick < phase_ticks; ++tick) {
        RigidFrame<double> pose{.rotation = random.rotation(), .origin = radius * random.vector()};
        rest.tick(stroke_at(tick));
        if (tick % 7 == 3) {
            REQUIRE(moved.body.move_to(pose, moved.x));
            const Points<double> before = moved.x;
            CHECK(moved.solver.step(moved.x, 0, moved.network, on(moved.body, moved.foundation)).status ==
                  StepStatus::bad_time_step);
            CHECK(moved.x == before);
        }
        pose.rotation = random.rotation();
        moved.tick_on_body(in_world(stroke_at(tick), pose), pose, Input::pose);
        if (tick < phase_ticks - 1) continue;  // what was refused has no prediction after it
        CHECK(Difference(rest, moved, pose).force <= 1e-9);
    }
}

TEST_CASE("after reset on a moved body a solver is as new", "[moving]") {
    const auto& scene = scenes[0];
    Membrane used(scene.mesh, false, 6);
    const Points<double> anchors = 1.02 * scene.mesh.positions();
    for (int tick = 0; tick < 30; ++tick) {
        const auto pose = smooth_motion(tick * dt);
        used.tick_on_body(in_world(stroke_at(tick), pose), pose, Input::pose);
    }
    REQUIRE(used.body.move_to(anchors, dt, used.x));
    QuasiStaticSolver<double> fresh(used.network, {.layers = 6, .sweeps = 4, .force_tolerance = 1e-13});
    used.solver.reset();
    Points<double> x = used.x;
    for (int tick = 0; tick < 5; ++tick) {
        const auto volume = on(used.body, used.foundation);
        const auto a =
            used.solver.step(used.x, dt, used.network, volume, membrane::pull(3, Vector3<double>(0, 0, 0.012)));
        const auto b = fresh.step(x, dt, used.network, volume, membrane::pull(3, Vector3<double>(0, 0, 0.012)));
        REQUIRE(used.x == x);
        REQUIRE(a.vertex_updates == b.vertex_updates);
        REQUIRE(a.reactions[0] == b.reactions[0]);
    }
}
