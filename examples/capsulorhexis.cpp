// SPDX-License-Identifier: MIT
//
// Continuous curvilinear capsulorhexis: forceps guide a tear in the lens capsule round, until it meets its beginning.
// Force beside that of surgeons, energies, how round the opening is, tension.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <numbers>

#include "support/capsulorhexis.hpp"
#include "support/plot.hpp"
#include "support/rhexis_record.hpp"
#include "support/specimen.hpp"

using namespace examples;

Opened open(const RhexisScene& scene, double toughness, double lift, const LoopOptions& options) {
    Capsulorhexis operation(scene, toughness, options);  // its loop: support/capsulorhexis.hpp
    const auto& tear = operation.tear();
    if (tear.tips().size() < 2) membrane::refuse("capsulorhexis", "the mesh must be fine enough for a cut");

    Forceps forceps(scene, lift);
    Opened result;
    Vector felt = Vector::Zero();
    while (result.ticks * options.tick < 30 && !is_round(tear)) {
        const auto start = std::chrono::steady_clock::now();
        forceps.guide(tear, operation.x(), options.tick, felt.norm());
        const auto report = operation.step(forceps.hold(tear));
        felt = report.reactions[0];
        result.converged += report.converged ? 1 : 0;
        forceps.slip(tear, operation.x());
        result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        result.add(scene, operation, forceps, felt);
    }
    operation.run_to_equilibrium();
    result.states.push_back(picture_of(scene, operation, forceps, Vector::Zero()));
    result.circularity = opening_of(scene, tear.surface()).circularity;
    return result;
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    MeshOptions other;
    double toughness = capsule_toughness;
    double lift = capsule_lift;
    LoopOptions options = capsule_loop;
    CommandLine command("Tears a round opening into the lens capsule, and draws its tension.");
    other.add_to(command);
    command.add("--out", folder, "folder for pictures");
    command.add("--toughness", toughness, "energy that the tear takes [J/m^2]");
    command.add_within("--lift", lift, 0, 80, "angle of the pull over the surface [degrees]");
    options.add_to(command);
    return command.run(argc, argv, [&] {
        const auto scene = other.file.empty() ? lens_front() : rhexis_scene(other.specimen(stock_sphere()));
        std::filesystem::create_directories(folder);
        const Opened opened = open(scene, toughness, lift * std::numbers::pi / 180, options);
        print(scene, opened, toughness * capsule.thickness);
        save(folder / "capsulorhexis.svg", drawn(rhexis_figure(scene, opened.states)));
        std::puts(plot(folder / "capsulorhexis_force", {opened.force}, "capsulorhexis").c_str());
    });
}
