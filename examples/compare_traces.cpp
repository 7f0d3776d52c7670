// SPDX-License-Identifier: MIT
//
// Compares two recordings tick by tick and draws displacement and force of the hand in both. Without arguments, records
// a press, replays it, and keeps both.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/replay/recording.hpp>

#include "support/recordings.hpp"
#include "support/specimen.hpp"

using Recording = membrane::Recording<double>;

template <class Device>
Recording recorded(const examples::Specimen& body, Device device) {
    const auto mesh = membrane::TriangleMesh(body.surface.points, body.surface.triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    const membrane::ReactionForce feel{.scale = 20};
    auto x = mesh.positions();
    membrane::Recorder<double> recorder(1000, mesh.vertex_count());
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        const Eigen::Vector3d force = feel({tool, contact, report});
        device.write(force);
        recorder.add(tool, force);
    }
    return recorder.recording();
}

void compare(const Recording& a, const Recording& b, const std::filesystem::path& out) {
    const std::size_t ticks = std::min(a.ticks.size(), b.ticks.size());
    std::size_t same = 0, first_other = ticks;
    double largest = 0;  // [N]
    for (std::size_t i = 0; i < ticks; ++i) {
        const bool identical = membrane::identical(a.ticks[i], b.ticks[i]);
        same += identical;
        if (!identical) first_other = std::min(first_other, i);
        largest = std::max(largest, (b.ticks[i].force - a.ticks[i].force).norm());
    }
    std::printf("ticks: %zu and %zu, %zu the same to the bit\n", a.ticks.size(), b.ticks.size(), same);
    if (first_other < ticks) std::printf("the first that is not: %zu\n", first_other);
    std::printf("largest difference of forces: %g N\n", largest);
    std::puts(examples::plot(out / "compare_traces", examples::curves_of(a, b), "compare_traces").c_str());
}

int main(int argc, char** argv) {
    std::vector<std::string> files;
    auto out = std::filesystem::path(argv[0]).parent_path() / "pictures";
    examples::CommandLine command("Compares two recordings, or a press and its replay.");
    command.add_two_files("recordings", files, "two files");
    command.add("--out", out, "folder for what is written");
    examples::MeshOptions mesh;
    mesh.add_to(command);
    return command.run(argc, argv, [&] {
        std::filesystem::create_directories(out);
        if (!files.empty()) return compare(examples::read(files[0]), examples::read(files[1]), out);
        const auto body = mesh.specimen(examples::stock_sphere());
        const membrane::ScriptedDevice<double> hand(
            {{0, body.above(0.3)}, {0.4, body.above(0)}, {0.8, body.above(0.3)}}, {.radius = body.tool_radius()});
        const auto first = recorded(body, hand);
        const auto second = recorded(body, membrane::ReplayDevice<double>(first));
        examples::save(out / "press.rec", first);
        examples::save(out / "replay.rec", second);
        compare(first, second, out);
    });
}
