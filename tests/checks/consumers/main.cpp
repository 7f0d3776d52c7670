// SPDX-License-Identifier: MIT
#include <cstdio>

#include <membrane/membrane.hpp>

// Presses a sphere for a tenth of a second and says whether that was felt.
int main() {
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0});
    const auto feel = membrane::SpringDamperForce{.stiffness = 100};
    auto solver = membrane::QuasiStaticSolver(network);
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    membrane::ScriptedDevice<double> device({{0.0, {0, 0, 0.013}}, {0.1, {0, 0, 0.010}}}, {.radius = 2e-3});
    auto x = mesh.positions();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report}));
    }
    std::printf("membrane %d.%d.%d: %.3f N\n", MEMBRANE_VERSION_MAJOR, MEMBRANE_VERSION_MINOR, MEMBRANE_VERSION_PATCH,
                device.force().z());
    return device.force().z() > 0.1 ? 0 : 1;
}
