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

#include <membrane/membrane.hpp>
#include <membrane/model/cohesive_springs.hpp>
#include <membrane/model/spring_stiffness.hpp>

#include "support/peel.hpp"
#include "support/plot.hpp"
#include "support/specimen.hpp"

using namespace examples;
using membrane::Index;

// Assumed, not measured: E is that of the lens capsule [Fisher69], which is a basement membrane too, and the Poisson
// ratio that of springs. Thickness and energy are plausible.
const membrane::Material ilm{.young_modulus = membrane::materials::lens_capsule().typical.young_modulus,
                             .poisson_ratio = 1.0 / 3,
                             .thickness = 2e-6};
constexpr double energy = 0.05;  // [J/m^2]
constexpr double tick = 1e-3;    // [s]

/// Adhesion but for the flap. The strength is the largest that the edges resolve.
membrane::CohesiveSprings<double> adhesion_of(const PeelScene& scene) {
    const double strength = energy / (3 * mean_edge(scene.mesh));
    std::vector<double> strengths;
    for (Index v = 0; v < scene.mesh.vertex_count(); ++v) strengths.push_back(scene.in_flap(v) ? 0 : strength);
    const double stiffness = 10 * strength * strength / energy;  // damage begins at a 20th of the failure opening
    return {scene.mesh, {.stiffness = stiffness, .strength = strengths, .energy = energy}};
}

Peeled peel(const PeelScene& scene, Index sweeps) {
    const auto& mesh = scene.mesh;
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = membrane::spring_stiffnesses(mesh, ilm)});
    auto adhesion = adhesion_of(scene);
    auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = sweeps});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto grasper = membrane::Grasper(mesh, {.snap_to_vertex = true});
    membrane::ScriptedDevice<double> device(scene.script(), {.tick = tick, .radius = mean_edge(mesh)});
    auto x = mesh.positions();
    Peeled result;
    while (device.running()) {
        const auto start = std::chrono::steady_clock::now();
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, tick, network, adhesion, pull(tool, grasp));
        adhesion.update(x, report.moved);
        tree.refit(x, report.moved);
        device.write(report.total_reaction());
        result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        result.add(scene, x, tool, report.total_reaction());
    }
    result.stored = network.energy(x);
    result.dissipated = adhesion.dissipated();
    const auto areas = membrane::vertex_areas(mesh);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        result.stored += adhesion.energy(v, x.col(v));
        if (!scene.in_flap(v) && !adhesion.adheres(v)) result.area += areas[static_cast<std::size_t>(v)];
    }
    return result;
}

/// Prints what a peel took and writes its picture. Returns the force and its closed form over the displacement.
std::vector<Curve> show(const PeelScene& scene, const std::filesystem::path& folder, Index sweeps) {
    const Peeled peeled = peel(scene, sweeps);
    std::printf("%s, %d vertices: peak %.3g mN, mean %.3g mN", scene.name.c_str(), int{scene.mesh.vertex_count()},
                1e3 * peeled.peak, 1e3 * peeled.mean());
    if (scene.width) std::printf(", %.3f of the closed form", peeled.of_closed_form(energy));
    std::printf(
        "; %.3g mm^2 have let go\n  the hand's work %.3g nJ = %.3g stored + %.3g dissipated, within %.1f %%; "
        "%.0f us for a tick\n",
        1e6 * peeled.area, 1e9 * peeled.work, 1e9 * peeled.stored, 1e9 * peeled.dissipated,
        100 * std::abs(1 - (peeled.stored + peeled.dissipated) / peeled.work),
        1e6 * peeled.seconds / static_cast<double>(peeled.force.size()));
    save(folder / ("peel_" + scene.name + ".svg"), drawn(peel_figure(scene.name, ilm, peeled.states)));
    return {peeled.force, peeled.closed_form(energy)};
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions mesh;
    Index sweeps = 8;  // a tick takes less than 1 ms
    CommandLine command("Peels a membrane off with forceps, and draws its tension.");
    mesh.add_to(command);
    command.add("--out", folder, "folder for pictures");
    command.add("--sweeps", sweeps, "passes over the vertices in each step");
    return command.run(argc, argv, [&] {
        std::filesystem::create_directories(folder);
        if (!mesh.file.empty()) {
            (void)show(peel_scene(mesh.specimen(stock_sphere())), folder, sweeps);
            return;
        }
        auto curves = show(strip_scene(), folder, sweeps);
        for (Curve& curve : show(circle_scene(), folder, sweeps)) curves.push_back(std::move(curve));
        std::puts(plot(folder / "peel_force", curves, "peel").c_str());
    });
}
