// SPDX-License-Identifier: MIT
#include <array>
#include <cstdio>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/tear/tearing.hpp>

// Cuts a sheet, draws a corner of the cut up until it tears, and says whether it did.
int main() {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 5e-3, .rings = 10}), 60);
    const auto springs = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = 20.0, .pinned = membrane::border(mesh)});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, springs));
    auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 1.0});
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = membrane::unlimited, .sweeps = 8});
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 20.0, .thickness = 1e-5});
    auto x = mesh.positions();
    std::vector<membrane::Index> path{0};
    while (path.size() < 5) path.push_back(tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
    for (const auto& event : tear.cut_along(path, x)) follow(event, tissue, foundation, solver);
    const membrane::Index held = path[2];
    for (int i = 1; i <= 400; ++i) {
        const membrane::Vector3<double> target(2e-3, 1e-5 * i, 1e-5 * i);
        const auto report = solver.step(x, 1e-3, tissue, foundation, membrane::pull(held, target), tear.ligaments());
        if (report.status != membrane::StepStatus::advanced) return 1;
        for (const auto& event : tear.update(x, 1e-3, tissue, foundation, std::array{held})) {
            follow(event, tissue, foundation, solver);
        }
    }
    std::printf("%g mm torn\n", 1e3 * tear.torn_length());
    return tear.torn_length() > 0 ? 0 : 1;
}
