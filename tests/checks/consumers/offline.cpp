// SPDX-License-Identifier: MIT
#include <cstdio>
#include <span>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/calibration/fit.hpp>
#include <membrane/membrane.hpp>
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>
#include <membrane/meshing/distmesh.hpp>

// One function of each group of headers that the loop does not need: a mesh, its checks, a press, a fit.
int main() {
    const auto raw = membrane::distmesh(membrane::Ball{.radius = 0.01}, {.edge_length = 0.003});
    const auto mesh = membrane::repair(raw.positions(), raw.triangles(), {.weld = 0.0, .orient = true});
    const auto report = membrane::validate(mesh.positions, mesh.triangles);
    const membrane::TriangleMesh<double> ball(mesh.positions, mesh.triangles);
    const auto foundation = membrane::VirtualVolumeSprings(ball, {.stiffness = 8.0});
    const auto model = [&](std::span<const double> constants, std::span<const double> depths) {
        const auto network = membrane::MassSpringNetwork(ball, membrane::LinearSpring{}, {.stiffness = constants[0]});
        std::vector<double> forces;
        for (const double depth : depths) {
            const membrane::Tool<double> tool{.position = {0, 0, 0.012 - depth}, .radius = 2e-3};
            auto contact = membrane::ContactTracker(ball).update(membrane::AabbTree(ball), ball.positions(), tool);
            const auto rest = equilibrium(ball.positions(), ball, network, foundation, {}, press(tool, contact));
            forces.push_back(rest.reactions[0].norm());
        }
        return forces;
    };
    const auto found = membrane::fit({.depth = {2e-4, 4e-4, 6e-4}, .force = {8e-3, 20e-3, 34e-3}}, {40.0}, model);
    std::printf("%g N/m\n", found.constants[0]);
    return report.valid() && found.constants[0] > 0 ? 0 : 1;
}
