// SPDX-License-Identifier: MIT
#include "support/peel_strip.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/hand_work.hpp"

TEMPLATE_TEST_CASE("a 90 degree peel takes the adhesion energy per area, on three meshes", "[cohesion][peel]",
                   TEST_SCALARS) {
    for (const double edge : {12e-6, 8e-6, 6e-6}) {
        if (edge < (cases_are_slow ? 12e-6 : in_full() ? 6e-6 : 8e-6)) continue;
        CAPTURE(edge);
        test::PeelStrip<TestType> strip(edge);
        CHECK(strip.peel() == Approx(strip.energy).epsilon(0.02));
        const double balance = (strip.stored() + strip.adhesion.dissipated()) / strip.work;
        CHECK(balance == Approx(1).epsilon(std::is_same_v<TestType, float> ? 0.02 : 0.01));
    }
}

// The front is not straight: its vertices let go one by one, and the flap wrinkles. As in the example `peel`, the steps
// are too few for an equilibrium, and take some energy.
TEMPLATE_TEST_CASE("what peels a disc off is stored, or taken by what has let go and by the steps", "[cohesion][peel]",
                   TEST_SCALARS) {
    using S = TestType;
    using Vector = membrane::Vector3<S>;
    const membrane::Material material{.young_modulus = 3e6, .poisson_ratio = 1.0 / 3, .thickness = 2e-6};
    const auto mesh = membrane::disc<S>({.radius = S(1e-3), .rings = 8});
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{},
                                              {.stiffness = membrane::spring_stiffnesses(mesh, material)});
    const auto energy = S(0.05), strength = energy / S(0.4e-3);
    membrane::CohesiveSprings<S> adhesion(
        mesh, {.stiffness = 10 * strength * strength / energy, .strength = strength, .energy = energy});
    membrane::QuasiStaticSolver<S> solver(network, {.layers = membrane::unlimited, .sweeps = 8});
    const std::array<membrane::Index, 1> held{mesh.vertex_count() - 1};  // on the border
    const Vector up = membrane::direction<S>(Vector(S(-0.7), 0, 1), Vector(0, 0, 1));
    std::vector<membrane::Index> all;
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) all.push_back(v);

    membrane::Points<S> x = mesh.positions();
    const auto energy_of = [&](const membrane::CohesiveSprings<S>& springs) {
        double sum = static_cast<double>(network.energy(x));
        for (const membrane::Index v : all) sum += static_cast<double>(springs.energy(v, membrane::point(x, v)));
        return sum;
    };
    const auto taken_up = [&] {
        auto now = adhesion;
        now.update(x, all);
        return energy_of(now) + now.dissipated();
    };
    const auto force_alone = [&](const Vector& displacement) -> Vector {
        membrane::Points<S> moved = x;
        moved.col(held[0]) += Eigen::Matrix<S, 3, 1>(displacement);
        const Vector at = membrane::point(moved, held[0]);
        return -(network.force_on(held[0], moved).force + adhesion.force_on(held[0], at, at, S(1e-3)).force);
    };
    double work = 0, relaxed = 0;
    Vector force = Vector::Zero();
    const Vector displacement = S(1e-6) * up;
    for (int tick = 0; tick < 1200; ++tick) {
        const Vector before = force, halfway = force_alone(displacement / 2), alone = force_alone(displacement);
        x.col(held[0]) += Eigen::Matrix<S, 3, 1>(displacement);
        relaxed += taken_up();
        solver.wake_all();
        const auto report = solver.step(x, S(1e-3), network, adhesion, membrane::pin(held));
        REQUIRE(report.status == membrane::StepStatus::advanced);
        relaxed -= taken_up();
        adhesion.update(x, all);
        force = -report.reactions[0];
        const auto hand = test::hand_work<S>(displacement, before, halfway, alone, force);
        work += hand.smooth;
        relaxed -= hand.excess();
    }
    const auto loose = std::count_if(all.begin(), all.end(), [&](auto v) { return !adhesion.adheres(v); });
    const double stored = energy_of(adhesion), taken = adhesion.dissipated();
    CAPTURE(work, stored, taken, relaxed, loose);
    CHECK(loose > 10);
    // The forces on the held vertex are those of the energies.
    CHECK(std::abs(work - stored - taken - relaxed) < (std::is_same_v<S, double> ? 1e-4 : 1e-3) * work);
    // Bilinear law: at a part r of the failure displacement, beyond the onset, the energy taken is G (r - onset) / (1 -
    // onset), whatever the mode.
    const double onset = 1 / 20.0;  // S^2 / (2 G K)
    double expected = 0;
    const auto areas = membrane::vertex_areas(mesh);
    for (const membrane::Index v : all) {
        const double left = 1 - static_cast<double>(adhesion.damage(v)), at_onset = onset / (1 - onset);
        const double reached = at_onset / (left + at_onset);
        expected += static_cast<double>(energy * areas[static_cast<std::size_t>(v)]) * (reached - onset) / (1 - onset);
    }
    CHECK(taken == Approx(expected).epsilon(std::is_same_v<S, double> ? 1e-9 : 1e-3));
    CHECK(relaxed > 0.01 * work);
    CHECK(relaxed < 0.3 * work);
}
