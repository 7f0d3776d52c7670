// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include <membrane/model/moving_foundation.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "slide.hpp"
#include "suction.hpp"

/// The loop with other tools, networks, rules and bodies, to measure a tick of each.
///
///     CapsuleTool scene(sphere(2562));
///     scene.aim(t);                                                        // sets the tool, not timed
///     scene.frame();                                                       // one tick
namespace bench {

using Mesh = membrane::TriangleMesh<double>;
using LinearNetwork = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

[[nodiscard]] inline LinearNetwork linear_network(const Mesh& mesh) { return {mesh, {}, {.stiffness = stiffness}}; }

/// All parts of one membrane and the usual tool. Other scenes replace `aim` or `frame`.
template <class Network = LinearNetwork, class Rule = membrane::BlockStep>
struct Membrane {
    Membrane(const Mesh& on, const Network& of, const Slide& path = {}) : slide(path), mesh(on), network(of) {}

    void aim(Index t) { tool = slide.at<double>(t); }

    void frame() {
        contact = tracker.update(tree, x, tool);
        finish(solver.step(x, tick, network, volume, press(tool, contact)));
    }

    /// Whether a reaction is not zero.
    [[nodiscard]] bool felt() const {
        return std::any_of(report.reactions.begin(), report.reactions.end(),
                           [](const Vector3& reaction) { return !reaction.isZero(0); });
    }

    /// The end of a tick: boxes and normals of the moved vertices, and the force.
    void finish(const membrane::StepReport<double>& done, const membrane::Grasp<double>& grasp = {}) {
        report = done;
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        force = feel({tool, contact, report, grasp});
    }

    Slide slide;
    Mesh mesh;
    Network network;
    membrane::VirtualVolumeSprings<double> volume{mesh, {.stiffness = foundation, .damping = 0.02}};
    membrane::QuasiStaticSolver<double, Rule> solver{network, {.layers = 6, .sweeps = 2}};
    membrane::AabbTree<double> tree{mesh};
    membrane::ContactTracker<double> tracker{mesh};
    membrane::VertexNormals<double> normals{mesh};
    membrane::SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    Points x = mesh.positions();

    membrane::Tool<double> tool;
    membrane::Contact<double> contact;
    membrane::StepReport<double> report;
    Vector3 force = Vector3::Zero();
};

/// The scene that the others are compared with.
struct SphereScene : Membrane<> {
    explicit SphereScene(const Mesh& on) : Membrane(on, linear_network(on)) {}
};

/// Faces alone carry the contact.
struct ByFaces : SphereScene {
    explicit ByFaces(const Mesh& on) : SphereScene(on) {
        tracker = membrane::ContactTracker<double>(mesh, {.fine_triangles = 0});
    }
};

/// A second tool presses and slides on the other side of the body.
struct TwoTools : SphereScene {
    using SphereScene::SphereScene;

    void aim(Index t) {
        SphereScene::aim(t);
        second = tool;
        second.position = -tool.position;
        second.velocity = -tool.velocity;
    }

    void frame() {
        contact = tracker.update(tree, x, tool);
        second_contact = second_tracker.update(tree, x, second);
        finish(solver.step(x, tick, network, volume, press(tool, contact), press(second, second_contact)));
        second_force = feel({second, second_contact, report});
    }

    [[nodiscard]] bool felt() const { return !report.reactions[0].isZero(0) && !report.reactions[1].isZero(0); }

    membrane::ContactTracker<double> second_tracker{mesh};
    membrane::Tool<double> second;
    membrane::Contact<double> second_contact;
    Vector3 second_force = Vector3::Zero();
};

/// A shaft of 5 mm that lies on the membrane and slides sideways.
struct CapsuleTool : Membrane<> {
    explicit CapsuleTool(const Mesh& on) : Membrane(on, linear_network(on), {.tool_radius = 5e-4, .shaft = 5e-3}) {}
};

struct PointTool : Membrane<> {
    explicit PointTool(const Mesh& on) : Membrane(on, linear_network(on), {.tool_radius = 0}) {}
};

/// Forceps grasp the membrane, draw it out by 1 mm, and move it to and fro by 1 mm, at 50 mm/s in the middle.
struct Forceps : SphereScene {
    using SphereScene::SphereScene;

    void aim(Index t) {
        constexpr double tip = 5e-4, out = 1e-3;  // [m]
        const double drawn = out * std::min(t, Slide::ticks_in) / Slide::ticks_in;
        const double turn = Slide::speed * tick * std::max(t - Slide::ticks_in, 0) / out;
        tool = {.position = (radius + tip / 2 + drawn) * Slide::start() + out * std::sin(turn) * Slide::along(),
                .radius = tip,
                .time = tick * t,
                .grasping = t > 0};
    }

    void frame() {
        contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        finish(solver.step(x, tick, network, volume, press(tool, contact, grasp), pull(tool, grasp)), grasp);
    }

    [[nodiscard]] bool felt() const { return !report.reactions[1].isZero(0); }

    membrane::Grasper<double> grasper{mesh};
};

/// All vertices below half the radius are pinned.
struct PinnedRim : Membrane<> {
    explicit PinnedRim(const Mesh& on) : Membrane(on, {on, {}, {.stiffness = stiffness, .pinned = low_vertices(on)}}) {}

    [[nodiscard]] static std::vector<Index> low_vertices(const Mesh& on) {
        std::vector<Index> low;
        for (Index v = 0; v < on.vertex_count(); ++v) {
            if (on.positions()(2, v) < -radius / 2) low.push_back(v);
        }
        return low;
    }
};

/// On a body that moves: the whole tree and all normals are updated with it.
struct OnMovingBody : SphereScene {
    using SphereScene::SphereScene;

    void press_on_body() {
        tree.refit(x);
        contact = tracker.update(tree, x, tool, body);
        report = solver.step(x, tick, network, on(body, volume), press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x);
        force = feel({tool, contact, report});
    }

    membrane::MovingBody<double> body{mesh};
    bool moved = true;
};

/// The body turns about its centre, across the tool's motion, and does not deform.
struct TurningBody : OnMovingBody {
    using OnMovingBody::OnMovingBody;

    void aim(Index t) {
        constexpr double rate = 1;  // [rad/s]
        OnMovingBody::aim(t);
        pose.rotation = Eigen::AngleAxisd(rate * tick * t, Slide::along().eigen()).toRotationMatrix();
        pose.angular_velocity = rate * Slide::along();
    }

    void frame() {
        moved = body.move_to(pose, x) && moved;
        press_on_body();
    }

    [[nodiscard]] bool felt() const { return moved && OnMovingBody::felt(); }

    membrane::RigidFrame<double> pose;
};

/// The body swells and shrinks by a hundredth, four times a second: every vertex is active in every tick.
struct BeatingBody : OnMovingBody {
    using OnMovingBody::OnMovingBody;

    void aim(Index t) {
        OnMovingBody::aim(t);
        anchors = (1 + 0.01 * std::sin(2 * std::numbers::pi * 4 * tick * t)) * mesh.positions();
    }

    void frame() {
        moved = body.move_to(anchors, tick, x) && moved;
        press_on_body();
    }

    [[nodiscard]] bool felt() const { return moved && OnMovingBody::felt(); }

    Points anchors;
};

struct StiffeningLaw : Membrane<membrane::MassSpringNetwork<double, membrane::ExponentialSpring>> {
    explicit StiffeningLaw(const Mesh& on) : Membrane(on, {on, {}, {.stiffness = stiffness}}) {}
};

/// (4), with a mass large enough to be stable.
struct Published : Membrane<LinearNetwork, membrane::MassStep> {
    explicit Published(const Mesh& on)
        : Membrane(on, {on, {}, {.stiffness = stiffness, .mass = tick * tick * stiffness / 0.1}}) {}
};

/// A suction cup of 1 mm radius and 5 kPa, in place of the tool.
struct Cup : SphereScene {
    using SphereScene::SphereScene;

    static constexpr double cup_radius = 1e-3;                                             // [m]
    static constexpr double max_force = 5e3 * std::numbers::pi * cup_radius * cup_radius;  // [N]

    void aim(Index t) {
        SphereScene::aim(t);
        axis = tool.position.normalized();
        tool.position = radius * axis;
        cup_force = max_force * std::min(t + 1, Slide::ticks_in) / Slide::ticks_in * axis;
    }

    void frame() {
        under.clear();
        tree.overlap_sphere(x, tool.position, cup_radius, [&](Index f) {
            for (const Index v : mesh.triangles().col(f)) under.insert(v);
        });
        finish(solver.step(x, tick, network, volume, Suction<double>{under.items(), tool.position, cup_force}));
        force = report.reactions[0];
    }

    membrane::IndexSet under{mesh.vertex_count()};
    Vector3 axis = Vector3::Zero(), cup_force = Vector3::Zero();
};

/// A deadline that truncates no step.
struct WithDeadline : SphereScene {
    using SphereScene::SphereScene;

    void frame() {
        using Clock = std::chrono::steady_clock;
        contact = tracker.update(tree, x, tool);
        const auto deadline = membrane::Deadline([] { return Clock::now(); }, Clock::now() + std::chrono::seconds(1));
        finish(solver.step_until(deadline, x, tick, network, volume, press(tool, contact)));
        in_time = in_time && !report.out_of_time;
    }

    [[nodiscard]] bool felt() const { return in_time && SphereScene::felt(); }

    bool in_time = true;
};

using BentSheet = membrane::Tissue<LinearNetwork, membrane::Elements<double, membrane::TriangularSpring<double>>,
                                   membrane::Elements<double, membrane::Hinge<double>>>;

/// Triangular springs, as stiff as a sheet of the linear springs that they replace, and bending.
struct BentTissue : Membrane<BentSheet> {
    explicit BentTissue(const Mesh& on) : Membrane(on, sheet(on)) {}

    [[nodiscard]] static BentSheet sheet(const Mesh& on) {
        constexpr double thickness = 1e-4;  // [m]
        const membrane::Material material{.young_modulus = 2 / std::numbers::sqrt3 * stiffness / thickness,
                                          .poisson_ratio = 1.0 / 3,
                                          .thickness = thickness};
        return BentSheet({on, {}, {.stiffness = 0.0}}, membrane::triangular_springs(on, material),
                         membrane::bending_springs(on, membrane::flexural_rigidity(material)));
    }
};

}  // namespace bench
