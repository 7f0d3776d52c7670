// SPDX-License-Identifier: MIT
//
// Press a membrane with a device of the OpenHaptics family, such as the Touch, and feel it. Needs the vendor's SDK.
#include <chrono>
#include <cstdint>
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
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    const membrane::ReactionForce feel{.scale = 20};
    auto x = mesh.positions();
    std::uint64_t solves = 0;

    // 5 cm of the hand correspond to the membrane's size. The middle of the device's workspace is just above it, "up"
    // is outward.
    examples::DeviceScale scale{.motion = body.size / 0.05};
    scale.device.rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitY(), body.outward).toRotationMatrix();
    scale.device.origin = body.above(0.4);

    examples::OpenHapticsDevice<examples::VendorHd> device(
        {.name = name, .scale = scale, .radius = body.tool_radius()});
    device.start([&](const membrane::Tool<double>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        if (report.status == membrane::StepStatus::advanced) ++solves;
        return examples::Answer{feel({tool, contact, report}), solves};
    });
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (device.running() && std::chrono::steady_clock::now() < end) {  // drawing goes here
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    device.stop();
    const auto& report = device.report();
    std::printf("%ld ticks, %ld late, the longest of %.2f ms; at most %.3f N\n", report.ticks, report.late,
                1e3 * report.max_tick, report.max_force);
    std::printf("no force: %ld for errors (%s), %ld for what is not finite\n", report.errors, report.last_error,
                report.refused);
    std::printf("less force: %ld fading, %ld above the peak, %ld for heat, %ld too fast\n", report.faded, report.peak,
                report.heat, report.slew);
    if (!device.trouble().empty()) throw std::runtime_error(device.trouble());
}

int main(int argc, char** argv) {
    std::string name;
    double seconds = 60;
    examples::CommandLine command("Presses a membrane with a device of the OpenHaptics family.");
    command.add("--device", name, "its name in the vendor's set-up; the default one if none");
    command.add("--seconds", seconds, "how long [s]");
    examples::MeshOptions mesh;
    mesh.add_to(command);
    return command.run(argc, argv, [&] { press(mesh.specimen(examples::stock_sphere()), name, seconds); });
}
