// SPDX-License-Identifier: MIT
#include <bit>
#include <cstdint>
#include <cstdio>

#include <membrane/membrane.hpp>

#if MEMBRANE_VERSION < 300
#error "membrane 0.3.0 or newer is needed"
#endif

// Presses a sphere for a tenth of a second. Prints the force and a number made of every bit of the positions, and says
// whether the sphere was felt.
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
    std::uint64_t bits = 0;
    for (const double coordinate : x.reshaped()) bits = 31 * bits + std::bit_cast<std::uint64_t>(coordinate);
    std::printf("membrane %d.%d.%d: %.3f N, bits %llx\n", MEMBRANE_VERSION_MAJOR, MEMBRANE_VERSION_MINOR,
                MEMBRANE_VERSION_PATCH, device.force().z(), static_cast<unsigned long long>(bits));
    return device.force().z() > 0.1 ? 0 : 1;
}
