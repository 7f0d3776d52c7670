// SPDX-License-Identifier: MIT
//
// Forceps peel the inner limiting membrane off the retina, a strip and a circle: force, energies, tension, and the
// closed form of the force.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "support/peel.hpp"
#include "support/peeling.hpp"
#include "support/plot.hpp"
#include "support/specimen.hpp"

using namespace examples;

Peeled peel(const PeelScene& scene, const LoopOptions& options) {
    Peeling operation(scene, options);  // its loop: support/peeling.hpp
    membrane::ScriptedDevice<double> device(scene.script(), {.tick = options.tick, .radius = mean_edge(scene.mesh)});
    Peeled result;
    while (device.running()) {
        const auto start = std::chrono::steady_clock::now();
        const auto tool = device.read();
        const auto report = operation.step(pull(tool, operation.grasp(tool)));
        device.write(report.total_reaction());
        result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        result.add(scene, operation.x(), tool, report.total_reaction());
    }
    result.stored = operation.stored();
    result.dissipated = operation.dissipated();
    result.damped = operation.damped();
    result.area = operation.area();
    return result;
}

/// Prints what a peel took and writes its picture. Returns the force and its closed form over the displacement.
std::vector<Curve> show(const PeelScene& scene, const std::filesystem::path& folder, const LoopOptions& options) {
    const Peeled peeled = peel(scene, options);
    std::printf("%s, %d vertices: peak %.3g mN, mean %.3g mN", scene.name.c_str(), int{scene.mesh.vertex_count()},
                1e3 * peeled.peak, 1e3 * peeled.mean());
    if (scene.width) std::printf(", %.3f of the closed form", peeled.of_closed_form(peel_energy));
    std::printf(
        "; %.3g mm^2 have let go\n  the hand's work %.3g nJ = %.3g stored + %.3g dissipated + %.3g by the fluid + "
        "%.1f %% by the steps; %.0f us for a tick\n",
        1e6 * peeled.area, 1e9 * peeled.work, 1e9 * peeled.stored, 1e9 * peeled.dissipated, 1e9 * peeled.damped,
        100 * (1 - (peeled.stored + peeled.dissipated + peeled.damped) / peeled.work),
        1e6 * peeled.seconds / static_cast<double>(peeled.force.size()));
    save(folder / ("peel_" + scene.name + ".svg"), drawn(peel_figure(scene.name, ilm, peeled.states)));
    return {peeled.force, peeled.closed_form(peel_energy)};
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions mesh;
    LoopOptions options;  // a tick takes less than 1 ms
    CommandLine command("Peels a membrane off with forceps, and draws its tension.");
    mesh.add_to(command);
    command.add("--out", folder, "folder for pictures");
    options.add_to(command);
    return command.run(argc, argv, [&] {
        std::filesystem::create_directories(folder);
        if (!mesh.file.empty()) {
            (void)show(peel_scene(mesh.specimen(stock_sphere())), folder, options);
            return;
        }
        auto curves = show(strip_scene(), folder, options);
        for (Curve& curve : show(circle_scene(), folder, options)) curves.push_back(std::move(curve));
        std::puts(plot(folder / "peel_force", curves, "peel").c_str());
    });
}
