// SPDX-License-Identifier: MIT
//
// A custom constraint: a suction cup draws the membrane to itself, by equal forces on all vertices below its mouth.
#include <algorithm>
#include <cstdio>
#include <span>
#include <vector>

#include <membrane/membrane.hpp>

#include "support/specimen.hpp"

// [suction]
/// A pressure on some vertices, along the axis of the cup.
struct Suction {
    std::span<const membrane::Index> vertices;  ///< below the mouth; the caller owns them
    Eigen::Vector3d force;                      ///< on each [N]

    using Context = membrane::ConstraintContext<double>;

    bool valid() const noexcept { return membrane::is_finite(force); }
    void begin(Context& context) const noexcept {
        for (const membrane::Index v : vertices) {
            if (!context.validate(v)) return;
            context.seed(v);  // the force spreads from here
            context.add_force(v, force);
        }
    }
    bool enforce(Context&) const noexcept { return false; }  // a given force needs no correction
    Eigen::Vector3d reaction(const Context&) const noexcept { return -static_cast<double>(vertices.size()) * force; }
};
static_assert(membrane::Constraint<Suction, double>);
// [/suction]

int main(int argc, char** argv) {
    const auto specimen = examples::specimen("Draws a membrane out by a suction cup.", argc, argv);
    const double dt = 1e-3, mouth = 0.3 * specimen.size, pressure = 500;  // [s], [m], [Pa]
    const auto mesh = membrane::TriangleMesh(specimen.surface.points, specimen.surface.triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});  // [N/m]
    const auto foundation =
        membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});  // [N/m], [N s/m]
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto x = mesh.positions();

    std::vector<membrane::Index> below;
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        if ((x.col(v) - specimen.above(0)).norm() < mouth) below.push_back(v);
    }
    const double area = 3.14159 * mouth * mouth;
    std::printf("time [s]   pressure [Pa]   height [mm]   force on the cup [mN]\n");
    for (int tick = 1; tick <= 400; ++tick) {
        const double now = pressure * std::min(tick / 200.0, 1.0);
        const Eigen::Vector3d force = now * area / static_cast<double>(below.size()) * specimen.outward;
        const auto report = solver.step(x, dt, network, foundation, Suction{below, force});
        if (tick % 50 != 0) continue;
        const double height = (x.col(specimen.vertex) - specimen.above(0)).dot(specimen.outward);
        std::printf("%8.2f %15.0f %13.3f %23.2f\n", tick * dt, now, 1e3 * height, 1e3 * report.reactions[0].norm());
    }
    return 0;
}
