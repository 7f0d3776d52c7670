// SPDX-License-Identifier: MIT
//
// Two tissues of the eye from their constants: the lens capsule on the lens, and the cornea under the pressure in the
// eye, both meshed from a formula, pressed, and drawn with their tension as colour.
#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <string>

#include <membrane/membrane.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
// [tissue]
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>
// [/tissue]

#include "support/figure.hpp"
#include "support/specimen.hpp"
#include "support/tension.hpp"

using namespace examples;
using membrane::Material;

struct Scene {
    std::string name;
    Specimen body;
    Material material;
    double rigidity, stretch, pressure;    // [N m]; stretch in the undeformed mesh; in the eye [Pa]
    membrane::FoundationLayer foundation;  // under the tissue
    double radius, depth;                  // of the press [m]
};

Figure press(const Scene& scene) {
    const membrane::TriangleMesh mesh(scene.body.surface.points, scene.body.surface.triangles);
    // [tissue]
    const auto none = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                  {.stiffness = 0.0, .pinned = membrane::border(mesh)});  // no springs
    const auto sheet = membrane::triangular_springs(mesh, scene.material, scene.stretch);
    const auto bending = membrane::bending_springs(mesh, scene.rigidity);  // none for 0, at no cost
    const auto pressure = membrane::pressure(mesh, scene.pressure);
    const auto loads = membrane::balancing_loads(mesh, membrane::Tissue(none, sheet, pressure));
    const auto tissue = membrane::Tissue(none, sheet, bending, pressure, loads);
    // [/tissue]
    const auto foundation =
        membrane::FoundationSprings(mesh, {.normal = membrane::normal_stiffnesses(mesh, scene.foundation),
                                           .tangential = membrane::tangential_stiffnesses(mesh, scene.foundation),
                                           .recovery_time = 0.05});
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = membrane::unlimited, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto x = mesh.positions();
    const Eigen::Vector3d top = scene.body.above(0), displacement = scene.body.outward;
    membrane::ScriptedDevice<double> device({{0.0, top + 2 * scene.radius * displacement},
                                             {0.1, top + (scene.radius - scene.depth) * displacement},
                                             {0.25, top + (scene.radius - scene.depth) * displacement}},
                                            {.radius = scene.radius});
    membrane::Tool<double> tool;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    while (device.running()) {
        tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, tissue, foundation, membrane::press(tool, contact));
        tree.refit(x, report.moved);
        force = report.total_reaction();
        device.write(force);
        tool.radius = drawn_radius(tool, contact, x);  // for the picture
    }
    std::cout << scene.name << ", " << mesh.vertex_count() << " vertices: " << 1e3 * force.norm() << " mN" << std::endl;
    return tension_figure(scene.name, sheet, {.mesh = mesh, .points = x, .tool = tool, .force = force});
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions mesh;
    CommandLine command("Presses a lens capsule and a cornea, and draws their tension.");
    mesh.add_to(command);
    command.add("--out", folder, "folder for pictures");
    return command.run(argc, argv, [&] {
        std::cout << std::setprecision(3);
        using namespace membrane;
        const auto lens = distmesh(Ellipsoid{.radii = {4.5e-3, 4.5e-3, 2e-3}}, {.edge_length = 0.3e-3});
        const auto front = trimmed(Ball{.radius = 7.8e-3}, HalfSpace{.point = {0, 0, 5.2e-3}, .normal = {0, 0, -1}});
        const Material thin = materials::lens_capsule().typical, thick = materials::cornea().typical;
        const FoundationLayer fibres{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
        const FoundationLayer aqueous{
            .young_modulus = 10, .poisson_ratio = 0.3, .thickness = 1e-3};  // almost no stiffness
        const Specimen body = mesh.specimen(lens);
        std::filesystem::create_directories(folder);
        const auto show = [&](const Scene& s) { save(folder / ("tissue_" + s.name + ".svg"), drawn(press(s))); };
        std::cout << "pictures: " << folder.string() << std::endl;
        show({"lens_capsule", body, thin, 0, 1.01, 0, fibres, 1e-3, 0.5e-3});
        if (!mesh.file.empty()) return;
        const auto cap = specimen_of(distmesh(front, {.edge_length = 0.5e-3}));
        show({"cornea", cap, thick, flexural_rigidity(thick), 1.03, 2000, aqueous, 1e-3, 0.5e-3});
    });
}
