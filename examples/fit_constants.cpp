// SPDX-License-Identifier: MIT
//
// Constants from a measurement: fits springs and foundation of a lens to a table of forces and depths, prints their
// confidence intervals and whether the table identifies them, and draws both curves.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <membrane/calibration/fit.hpp>
#include <membrane/calibration/indentation.hpp>
#include <membrane/membrane.hpp>

#include "support/force_table.hpp"
#include "support/plot.hpp"
#include "support/specimen.hpp"

using Numbers = std::span<const double>;

examples::Curve curve(Numbers depths, Numbers forces) {
    examples::Curve result;
    for (std::size_t i = 0; i < depths.size(); ++i) result.push_back({1e3 * depths[i], 1e3 * forces[i]});  // mm, mN
    return result;
}

void run(const std::filesystem::path& data, const examples::Specimen& body, const std::filesystem::path& out) {
    std::filesystem::create_directories(out);
    std::ifstream text(data);
    if (!text) throw std::runtime_error("cannot read " + data.string());
    const auto table = examples::read_force_table(text);

    const membrane::TriangleMesh lens(body.surface.points, body.surface.triangles);
    const auto rim = body.rim();
    const auto build = [&](Numbers constants) {
        return std::pair(
            membrane::MassSpringNetwork(lens, membrane::LinearSpring{}, {.stiffness = constants[0], .pinned = rim}),
            membrane::VirtualVolumeSprings(lens, {.stiffness = constants[1]}));
    };
    const membrane::Tool<double> tip{.position = body.above(0) + 2e-3 * body.outward, .radius = 1e-3};
    const membrane::Indentation model(lens, tip, Eigen::Vector3d(-body.outward), build);
    const auto found = membrane::fit(table, {10, 10}, model);  // from a first guess [N/m]

    std::printf("constant          value    95 %% interval      identifiable\n");
    for (std::size_t k = 0; k < 2; ++k) {
        std::printf("%-8s [N/m] %8.2f   %6.2f to %6.2f    %s\n", k == 0 ? "springs" : "foundation", found.constants[k],
                    found.intervals[k].lower, found.intervals[k].upper, found.identifiable[k] ? "yes" : "no");
    }
    std::printf("misfit %.1f %% of the force, %d evaluations%s\n", 100 * found.misfit, found.evaluations,
                found.converged ? "" : ", not converged");

    std::vector<double> depths{0};
    const double deepest = *std::max_element(table.depth.begin(), table.depth.end());
    for (int i = 1; i <= 20; ++i) depths.push_back(deepest * i / 20);
    const auto fitted = curve(depths, model(found.constants, depths)), measured = curve(table.depth, table.force);
    std::puts(examples::plot(out / "fit_constants", {fitted, measured}, "fit_constants").c_str());
}

int main(int argc, char** argv) {
    std::string data = MEMBRANE_EXAMPLE_DATA "/lens_indentation.csv";
    auto out = std::filesystem::path(argv[0]).parent_path() / "pictures";
    examples::CommandLine command("Fits the constants of a lens to measured forces and depths.");
    examples::MeshOptions mesh;
    mesh.add_to(command);
    command.add_file("--data", data, "a CSV file: depth [m], force [N]");
    command.add("--out", out, "folder for the picture");
    return command.run(argc, argv, [&] {
        const auto lens = membrane::spherical_cap<double>({.radius = 0.01, .diameter = 9e-3, .rings = 6});  // [m]
        run(data, mesh.specimen(lens), out);
    });
}
