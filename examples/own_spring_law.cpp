// SPDX-License-Identifier: MIT
//
// A custom spring law: collagen fibres are wavy at rest, soft at first, and stiffen when they are straight.
#include <algorithm>
#include <cstdio>

#include <membrane/membrane.hpp>

#include "support/specimen.hpp"

// [law]
/// Soft until stretched by `slack`, ten times as stiff from there on.
struct Collagen {
    double slack = 0.04;  ///< Strain at which the fibres are straight.

    template <membrane::Real Scalar>
    membrane::SpringResponse<Scalar> operator()(const membrane::SpringState<Scalar>& s) const noexcept {
        const Scalar stretch = s.length - s.rest_length;
        const Scalar taut = std::max(Scalar(0), stretch - Scalar(slack) * s.rest_length), k = s.stiffness;
        return {.tension = k * (stretch + 9 * taut),
                .stiffness = taut > 0 ? 10 * k : k,
                .energy = k / 2 * (stretch * stretch + 9 * taut * taut)};
    }
};
static_assert(membrane::SpringLaw<Collagen, double>);
// [/law]

/// Force [N] that holds the middle of a membrane `height` [m] above its rest position, with a clamped rim.
template <class Law>
double holding_force(const examples::Specimen& specimen, const Law& law, double height) {
    const auto mesh = membrane::TriangleMesh(specimen.surface.points, specimen.surface.triangles);
    const auto network =
        membrane::MassSpringNetwork(mesh, law, {.stiffness = 40.0, .pinned = specimen.rim()});  // [N/m]
    auto solver =
        membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 100, .force_tolerance = 1e-6});
    auto x = mesh.positions();
    for (int tick = 0; tick < 1000; ++tick) {
        const Eigen::Vector3d target = specimen.above(0) + height * specimen.outward;
        const auto report =
            solver.step(x, 1e-3, network, membrane::NoFoundation{}, membrane::pull(specimen.vertex, target));
        if (report.converged) return report.reactions[0].norm();
    }
    std::fprintf(stderr, "not at rest after 1000 ticks\n");
    return 0;
}

int main(int argc, char** argv) {
    examples::CommandLine command(
        "Pulls a clamped membrane by its middle, with linear springs and with a law of one's own.");
    examples::MeshOptions options;
    options.add_to(command);
    return command.run(argc, argv, [&] {
        const auto specimen = options.specimen(membrane::disc<double>({.radius = 0.01, .rings = 8}));
        std::printf("height [mm]   linear [mN]   collagen [mN]\n");
        for (const double part : {0.1, 0.2, 0.3, 0.4}) {
            const double height = part * specimen.size;
            std::printf("%11.1f %13.2f %15.2f\n", 1e3 * height,
                        1e3 * holding_force(specimen, membrane::LinearSpring{}, height),
                        1e3 * holding_force(specimen, Collagen{}, height));
        }
    });
}
