// SPDX-License-Identifier: MIT
//
// Press a membrane with a Touch or another device of the OpenHaptics family, and feel it. Needs the vendor's SDK.
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>

#include <Eigen/Geometry>
#include <membrane/membrane.hpp>

#include "openhaptics/open_haptics_device.hpp"
#include "openhaptics/vendor_hd.hpp"
#include "support/specimen.hpp"

void press(const examples::Specimen& body, const std::string& name, double seconds) {
    const auto mesh = membrane::TriangleMesh(body.surface.points, body.surface.triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto backing = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    const membrane::ReactionForce feel{.scale = 20};
    auto x = mesh.positions();

    // The middle of the device's workspace is just above the membrane, and its "up" is outward there.
    membrane::RigidFrame<double> scene;
    scene.rotation = Eigen::Quaterniond::FromTwoVectors(body.outward, Eigen::Vector3d::UnitY()).toRotationMatrix();
    scene.origin = -scene.direction_out(body.above(0.4));

    examples::OpenHapticsDevice<examples::VendorHd> device(
        {.name = name, .scale = body.size / 0.05, .radius = body.tool_radius()});  // 5 cm of the hand are its size
    device.start([&](const membrane::Tool<double>& hand) {
        const auto tool = carried_in(hand, scene);
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, backing, press(tool, contact));
        tree.refit(x, report.moved);
        return scene.direction_out(feel({tool, contact, report}));
    });
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (device.running() && std::chrono::steady_clock::now() < end) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    device.stop();
    if (!device.trouble().empty()) throw std::runtime_error(device.trouble());
    const auto& report = device.report();
    std::printf("%ld ticks, %ld late; the longest took %.2f ms; %ld forces cut to what the device bears\n",
                report.ticks, report.late, 1e3 * report.longest_tick, report.limited);
}

int main(int argc, char** argv) {
    std::string name;
    double seconds = 60;
    CLI::App app("Presses a membrane with a device of the OpenHaptics family.");
    app.add_option("--device", name, "its name in the vendor's set-up; the default one if none");
    app.add_option("--seconds", seconds, "how long [s]")->capture_default_str();
    examples::MeshOptions mesh;
    mesh.add_to(app);
    return examples::run(app, argc, argv, [&] { press(mesh.specimen(examples::stock_sphere()), name, seconds); });
}
