// SPDX-License-Identifier: MIT
#include <cstdio>

#include <membrane/membrane.hpp>

int main() {
    const auto mesh = membrane::icosphere({.radius = 10e-3, .subdivisions = 3});  // [m], 642 vertices
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    const auto feel = membrane::ReactionForce{};                                    // the membrane's force on the tool

    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});  // or by choose_settings()
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    auto device = membrane::ScriptedDevice<double>({{0.0, {0, 0, 13e-3}}, {0.2, {0, 0, 11e-3}}}, {.radius = 2e-3});

    auto x = mesh.positions();  // 3 x V [m], yours
    const double dt = 1e-3;     // [s]
    while (device.running()) {
        const auto tool = device.read();  // position, velocity, time
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);  // for drawing
        device.write(feel({tool, contact, report}));
    }
    std::printf("The hand feels %.3f N.\n", device.force().norm());
}
