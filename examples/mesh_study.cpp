// SPDX-License-Identifier: MIT
//
// The force of one press on three meshes of one sphere: with the constants of README's program, one for each spring and
// each vertex; with constants from a tissue; and with these where faces carry the contact on every mesh.
#include <cstdio>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/membrane.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

const double tool_radius = 2e-3, depth = 1e-3;  // [m]

/// The force at equilibrium [N].
double force(const membrane::TriangleMesh<double>& mesh, const membrane::Field<double>& springs,
             const membrane::Field<double>& foundation_springs, const membrane::TrackerOptions& options = {}) {
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = springs});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = foundation_springs});
    auto tracker = membrane::ContactTracker(mesh, options);
    const membrane::Tool<double> tool{.position = {0, 0, 10e-3 + tool_radius - depth}, .radius = tool_radius};
    const auto contact = tracker.update(membrane::AabbTree(mesh), mesh.positions(), tool);
    const auto found =
        membrane::equilibrium(mesh.positions(), mesh, network, foundation, {}, membrane::press(tool, contact));
    if (!found.converged) std::puts("The next force is not that of an equilibrium.");
    return found.reactions[0].norm();
}

int main() {
    // README's springs of 40 N/m and volume springs of 8 N/m on 642 vertices are those of this sheet and layer.
    const membrane::Material sheet{.young_modulus = 3.08e6, .poisson_ratio = 1 / 3.0, .thickness = 15e-6};
    const double layer = 4.1e6;  // [N/m^3]

    std::printf("A ball of %g mm, %g mm deep: force [mN]\n", 1e3 * tool_radius, 1e3 * depth);
    std::puts("vertices  radius [edges]  README's constants  a tissue's  by faces alone");
    for (const membrane::Index subdivisions : {2, 3, 4}) {
        const auto mesh = membrane::icosphere({.radius = 10e-3, .subdivisions = subdivisions});
        const auto springs = membrane::spring_stiffnesses(mesh, sheet);
        auto areas = membrane::vertex_areas(mesh);
        for (double& area : areas) area *= layer;
        std::printf("%8d  %14.1f  %18.1f  %10.1f  %14.1f\n", mesh.vertex_count(),
                    tool_radius / membrane::mean_edge(mesh), 1e3 * force(mesh, 40.0, 8.0),
                    1e3 * force(mesh, springs, areas), 1e3 * force(mesh, springs, areas, {.fine_triangles = 0}));
    }
}
