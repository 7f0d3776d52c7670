// SPDX-License-Identifier: MIT
//
// The body under the membrane moves. An eye that turns is handled in its own frame, at no cost per vertex; a vessel
// that beats takes new anchors in every tick, from one `MovingBody` for all parts.
#include <cmath>
#include <cstdio>
#include <numbers>

#include <Eigen/Geometry>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>

#include "support/specimen.hpp"

constexpr double dt = 1e-3;  // [s]

/// All the parts of one membrane.
struct Membrane {
    explicit Membrane(const membrane::TriangleMesh<double>& mesh)
        : network(mesh, membrane::LinearSpring{}, {.stiffness = 40.0}),  // [N/m]
          foundation(mesh, {.stiffness = 8.0, .damping = 0.02}),         // [N/m], [N s/m]
          solver(network, {.layers = 6, .sweeps = 8}),
          tree(mesh),
          tracker(mesh),
          x(mesh.positions()) {}

    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<double> foundation;
    membrane::QuasiStaticSolver<double> solver;
    membrane::AabbTree<double> tree;
    membrane::ContactTracker<double> tracker;
    membrane::Points<double> x;  // [m]
};

/// An eye turns under a tool that stands still: the tool is transformed to the eye's frame, the force to the world.
void turning_eye(const examples::Specimen& specimen) {
    Membrane eye(membrane::TriangleMesh(specimen.surface.points, specimen.surface.triangles));
    const membrane::Tool<double> tool{.position = specimen.above(0.12), .radius = specimen.tool_radius()};
    const double rate = 0.5;  // [rad/s]
    std::printf("an eye turns under a tool\n  time [s]   angle [deg]   force in the world [mN]\n");
    for (int tick = 0; tick <= 400; ++tick) {
        const double angle = rate * dt * tick;
        membrane::RigidFrame<double> frame;
        frame.rotation << 1, 0, 0, 0, std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle);
        frame.angular_velocity = {rate, 0, 0};
        frame.origin = specimen.centre - frame.rotation * specimen.centre;  // the centre is fixed
        frame.velocity = frame.angular_velocity.cross(frame.origin - specimen.centre);
        const auto seen = to_body_frame(tool, frame);
        const auto contact = eye.tracker.update(eye.tree, eye.x, seen);
        const auto report = eye.solver.step(eye.x, dt, eye.network, eye.foundation, press(seen, contact));
        eye.tree.refit(eye.x, report.moved);
        const Eigen::Vector3d force = frame.vector_to_world(report.reactions[0]);
        if (tick == 0 || tick % 100 != 0) continue;
        std::printf("%10.1f %13.1f   (%5.1f, %5.1f, %5.1f)\n", dt * tick, angle * 180 / std::numbers::pi,
                    1e3 * force.x(), 1e3 * force.y(), 1e3 * force.z());
    }
}

/// A vessel beats under a tool that stands still: the anchors move with it, and the membrane follows.
void beating_vessel(const examples::Specimen& specimen) {
    const auto mesh = membrane::TriangleMesh(specimen.surface.points, specimen.surface.triangles);
    Membrane vessel(mesh);
    const membrane::Tool<double> tool{.position = specimen.above(0.2), .radius = specimen.tool_radius()};
    membrane::MovingBody body(mesh);
    std::printf("a vessel beats under a tool\n  time [s]   swollen by [mm]   depth [mm]   force [mN]\n");
    for (int tick = 0; tick <= 500; ++tick) {
        const double swollen = 0.05 * std::sin(2 * std::numbers::pi * dt * tick);  // of the radius, once a second
        const membrane::Points<double> anchors =
            ((1 + swollen) * mesh.positions()).colwise() - swollen * specimen.centre;
        if (!body.move_to(anchors, dt, vessel.x)) return;  // the membrane moves along
        vessel.tree.refit(vessel.x);
        const auto contact = vessel.tracker.update(vessel.tree, vessel.x, tool, body);
        const auto report =
            vessel.solver.step(vessel.x, dt, vessel.network, on(body, vessel.foundation), press(tool, contact));
        vessel.tree.refit(vessel.x, report.moved);
        if (tick % 50 != 0) continue;
        std::printf("%10.2f %17.2f %12.2f %12.1f\n", dt * tick, 1e3 * swollen * specimen.size, 1e3 * contact.depth,
                    1e3 * report.reactions[0].norm());
    }
}

int main(int argc, char** argv) {
    const auto specimen = examples::specimen("A membrane on a body that turns, and on one that beats.", argc, argv);
    turning_eye(specimen);
    beating_vessel(specimen);
}
