// SPDX-License-Identifier: MIT
//
// A custom force policy: tissue is too soft for a hand to feel and a device has a force limit, so the membrane's
// reaction is magnified and limited.
#include <cstdio>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/replay/script.hpp>

#include "support/specimen.hpp"

/// The membrane's reaction times `scale`, in its own direction but never above `limit`.
struct LimitedReaction {
    double scale;
    double limit;  ///< [N]

    Eigen::Vector3d operator()(const membrane::HapticState<double>& state) const noexcept {
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
        for (const auto& reaction : state.report.reactions) force += scale * reaction;
        const double size = force.norm();
        return size > limit ? Eigen::Vector3d(limit / size * force) : force;
    }
};
static_assert(membrane::ForcePolicy<LimitedReaction, double>);

void play(const examples::Specimen& specimen, std::vector<membrane::Waypoint<double>> script,
          const LimitedReaction& feel) {
    const double dt = 1e-3;  // [s]
    const auto mesh = membrane::TriangleMesh(specimen.surface.points, specimen.surface.triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    membrane::ScriptedDevice<double> device(std::move(script), {.tick = dt, .radius = specimen.tool_radius()});
    auto x = mesh.positions();

    std::printf("time [s]   depth [mm]   reaction [mN]   hand feels [N]\n");
    for (int tick = 0; device.running(); ++tick) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        device.write(feel({tool, contact, report}));
        if (tick % 50 != 0) continue;
        const double reaction = report.reactions[0].norm();
        std::printf("%8.2f %12.2f %15.1f %16.2f%s\n", tool.time, 1e3 * contact.depth, 1e3 * reaction,
                    device.force().norm(), feel.scale * reaction > feel.limit ? "  at the limit" : "");
    }
}

int main(int argc, char** argv) {
    LimitedReaction feel{.scale = 20, .limit = 3.3};
    std::string file;
    examples::CommandLine command("Presses a sphere; the hand feels the membrane's reaction, magnified and limited.");
    command.add_file("--script", file, "the tool's trajectory, a CSV file: time [s], x, y, z [m]");
    command.add("--scale", feel.scale, "from tissue to hand");
    command.add("--limit", feel.limit, "force limit of the device [N]");
    examples::MeshOptions options;
    options.add_to(command);
    return command.run(argc, argv, [&] {
        const auto specimen = options.specimen(examples::stock_sphere());
        const Eigen::Vector3d away = specimen.above(0.3), deep = specimen.above(-0.1);
        if (file.empty()) return play(specimen, {{0, away}, {0.4, deep}, {0.8, away}}, feel);
        std::ifstream text(file);
        play(specimen, membrane::read_script<double>(text), feel);
    });
}
