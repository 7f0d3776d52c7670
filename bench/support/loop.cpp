// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include <membrane/membrane.hpp>

// The loop of README on 642 vertices, with a tool of 2 mm that slides at 50 mm/s, 1 mm deep: prints the median time of
// a tick [us]. bench/builds compiles it with several options.
int main() {
    using Clock = std::chrono::steady_clock;
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    const auto feel = membrane::SpringDamperForce{.stiffness = 100, .damping = 0.5};
    auto x = mesh.positions();
    membrane::ScriptedDevice<double> device({{0.0, {0, 0, 0.0125}}, {0.1, {0, 0, 0.011}}, {0.215, {0.0055, 0, 0.0095}}},
                                            {.radius = 2e-3});
    std::vector<double> times;
    while (device.running()) {
        const auto begin = Clock::now();
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report}));
        if (contact.touching())
            times.push_back(std::chrono::duration<double, std::micro>(Clock::now() - begin).count());
    }
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    std::printf("%.2f\n", *middle);
}
