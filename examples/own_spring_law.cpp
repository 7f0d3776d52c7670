// SPDX-License-Identifier: MIT
//
// A spring law of one's own: collagen is wavy at rest, gives way at first and stiffens once its fibres are straight.
#include <algorithm>
#include <cstdio>

#include <membrane/membrane.hpp>

#include "support/command_line.hpp"

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

/// Force that holds the middle of a disc `height` above its clamped rim [N].
template <class Law>
double holding_force(const Law& law, double height) {
    const auto disc = membrane::disc<double>({.radius = 0.01, .rings = 8});
    const membrane::Adjacency adjacency(disc);
    const auto rim = adjacency.border_vertices();
    const auto network =
        membrane::MassSpringNetwork(disc, law, {.stiffness = 40.0, .pinned = {rim.begin(), rim.end()}});  // [N/m]
    auto solver =
        membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 100, .negligible_force = 1e-6});
    auto x = disc.positions();
    for (int tick = 0; tick < 1000; ++tick) {
        const Eigen::Vector3d target(0, 0, height);
        const auto report = solver.step(x, 1e-3, network, membrane::NoVolumeSprings{}, membrane::pull(0, target));
        if (report.converged) return report.reactions[0].norm();
    }
    std::fprintf(stderr, "not at rest after 1000 ticks\n");
    return 0;
}

int main(int argc, char** argv) {
    examples::no_options("Pulls a clamped disc by its middle, with linear springs and with a law of one's own.", argc,
                         argv);
    std::printf("height [mm]   linear [mN]   collagen [mN]\n");
    for (const double height : {1e-3, 2e-3, 3e-3, 4e-3}) {
        std::printf("%11.1f %13.2f %15.2f\n", 1e3 * height, 1e3 * holding_force(membrane::LinearSpring{}, height),
                    1e3 * holding_force(Collagen{}, height));
    }
}
