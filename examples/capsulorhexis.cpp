// SPDX-License-Identifier: MIT
//
// Continuous curvilinear capsulorhexis: forceps guide a tear in the lens capsule round, until it meets its beginning. Force
// beside that of surgeons, energies, how round the opening is, tension.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>

#include <membrane/membrane.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/model/bending.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/plot.hpp"
#include "support/rhexis.hpp"
#include "support/rhexis_record.hpp"
#include "support/specimen.hpp"

using namespace examples;
using membrane::Index;

const membrane::Material capsule = membrane::materials::lens_capsule().typical;
constexpr double stiffer = 30;  // in bending than the capsule: else the flap crumples, as finely as its triangles
constexpr double tick = 1e-3;   // [s]

Opened open(const RhexisScene& scene, double toughness, double lift, Index sweeps) {
    const auto& mesh = scene.mesh;
    const auto none = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                  {.stiffness = 0.0, .pinned = scene.pinned});  // no springs
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, none),
                                   membrane::triangular_springs(mesh, capsule, scene.stretch),
                                   membrane::bending_springs(mesh, stiffer * membrane::flexural_rigidity(capsule)));
    auto body = scene.body();
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 12, .sweeps = sweeps});
    auto tear =
        membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = toughness, .thickness = capsule.thickness});
    auto x = mesh.positions();
    const auto run_to_equilibrium = [&] {
        solver.wake_all();
        for (int i = 0; i < 300 && !solver.step(x, tick, tissue, body).converged; ++i) solver.wake_all();
    };
    run_to_equilibrium();  // its tension presses it onto the body
    for (const auto& event : tear.cut_along(scene.cut(tear.surface()), x)) follow(event, tissue, body, solver);
    if (tear.tips().size() < 2) membrane::refuse("capsulorhexis", "the mesh must be fine enough for a cut");

    Forceps forceps(scene, lift);
    Opened result;
    while (result.ticks < 30'000 && !is_round(tear)) {
        const auto start = std::chrono::steady_clock::now();
        forceps.guide(tear, x, tick);
        const auto held = forceps.hold(tear);
        const auto report = solver.step(x, tick, tissue, body, held, tear.ligaments());
        for (const auto& event : tear.update(x, tick, tissue, body, held.corners)) follow(event, tissue, body, solver);
        result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        result.add(scene, tissue, body, tear, x, forceps, report.reactions[0]);
    }
    run_to_equilibrium();
    result.states.push_back(picture_of(scene, tissue, tear, x, forceps, Vector::Zero()));
    result.circularity = opening_of(scene, tear.surface()).circularity;
    return result;
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions other;
    double toughness = 1.4e3;  // of the amnion: that of the capsule is not known
    double lift = 12;          // [degrees]
    Index sweeps = 4;
    CommandLine command("Tears a round opening into the lens capsule, and draws its tension.");
    other.add_to(command);
    command.add("--out", folder, "folder for pictures");
    command.add("--toughness", toughness, "energy that the tear takes [J/m^2]");
    command.add_within("--lift", lift, 0, 80, "angle of the pull over the surface [degrees]");
    command.add("--sweeps", sweeps, "passes over the vertices in each step");
    return command.run(argc, argv, [&] {
        constexpr double ball = 10e-3, rim = 4e-3, edge = 0.3e-3;  // [m]
        const auto front = membrane::trimmed(
            membrane::Ball{.radius = ball},
            membrane::HalfSpace{.point = {0, 0, std::sqrt(ball * ball - rim * rim)}, .normal = {0, 0, -1}});
        const auto scene = other.file.empty() ? capsule_scene(membrane::distmesh(front, {.edge_length = edge}), ball)
                                              : rhexis_scene(other.specimen(stock_sphere()));
        std::filesystem::create_directories(folder);
        const Opened opened = open(scene, toughness, lift * std::numbers::pi / 180, sweeps);
        print(scene, opened, toughness * capsule.thickness);
        save(folder / "capsulorhexis.svg", drawn(rhexis_figure(scene, opened.states)));
        std::puts(plot(folder / "capsulorhexis_force", {opened.force}, "capsulorhexis").c_str());
    });
}
