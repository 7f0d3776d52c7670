// SPDX-License-Identifier: MIT
#include <cstdio>
#include <membrane/membrane.hpp>
#include "support/specimen.hpp"
int main(int argc, char** argv) {
    const auto body = examples::specimen("Presses a membrane and prints the force.", argc, argv);
    const auto& [points, triangles] = body.surface;
    membrane::ScriptedDevice<double> device({{0.0, body.above(0.3)}, {0.2, body.above(0)}},
                                            {.radius = body.tool_radius()});
    const double dt = 1e-3;                                                                                 // [s]
    const auto mesh = membrane::TriangleMesh(points, triangles);                                            // [m]
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    const auto feel = membrane::ReactionForce{};                                    // the membrane's force on the tool
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    auto x = mesh.positions();  // 3 x V [m], ours
    while (device.running()) {
        const auto tool = device.read();  // position, velocity, time
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report}));
    }
    std::printf("The hand feels %.3f N.\n", device.force().norm());
}
