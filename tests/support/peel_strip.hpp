// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/meshes.hpp"

/// A strip that is peeled off a plane.
///
///     test::PeelStrip<double> strip(6e-6);
///     CHECK(strip.peel() == Approx(strip.energy).epsilon(0.02));
namespace test {

/// A strip that adheres to a plane but for its end, which stands upright on it and is drawn off at 90 degrees: forceps
/// hold it eight edges behind the front, and take hold anew as the front moves on.
template <membrane::Real S>
struct PeelStrip {
    static constexpr membrane::Index columns = 40, rows = 4, arm = 8;
    static constexpr double stretch_stiffness = 2.5, energy = 0.05, strength = 2e3;  // [N/m], [J/m^2], [Pa]

    /// Largest residual force, as a part of the strength on the area of a vertex.
    static constexpr double tolerance = std::is_same_v<S, float> ? 3e-3 : 3e-4;

    double edge;  // [m]
    double width = edge * rows * std::sqrt(3.0) / 2;
    membrane::TriangleMesh<S> mesh = triangle_strip<S>(columns, rows, edge);
    membrane::Material material{.young_modulus = stretch_stiffness / 5e-6, .poisson_ratio = 1.0 / 3, .thickness = 5e-6};
    membrane::MassSpringNetwork<S, membrane::LinearSpring> network{
        mesh, membrane::LinearSpring{}, {.stiffness = membrane::spring_stiffnesses(mesh, material)}};
    membrane::CohesiveSprings<S> adhesion{
        mesh,
        {.stiffness = S(strength * strength / (2 * energy * 0.05)), .strength = strengths(), .energy = S(energy)}};
    membrane::QuasiStaticSolver<S> solver{
        network,
        {.layers = membrane::unlimited, .sweeps = 20'000, .force_tolerance = S(strength * edge * edge * tolerance)}};
    membrane::Points<S> x = mesh.positions();
    double work = 0;                                                     // of the forceps [J]
    membrane::Vector3<double> pull = membrane::Vector3<double>::Zero();  // of the forceps [N]

    explicit PeelStrip(double edge_length) : edge(edge_length) {
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) < arm * edge) x.col(v) = membrane::Vector3<S>(S(arm * edge), x(1, v), S(arm * edge - at(v)));
        }
    }
    /// Along the strip at rest [m].
    [[nodiscard]] double at(membrane::Index v) const { return static_cast<double>(mesh.positions()(0, v)); }
    [[nodiscard]] std::vector<S> strengths() const {
        std::vector<S> each;
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v)
            each.push_back(at(v) < arm * edge ? S(0) : S(strength));
        return each;
    }
    /// Where the strip still adheres, from there on [m].
    [[nodiscard]] double front() const {
        double least = columns * edge;
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) >= arm * edge && adhesion.adheres(v)) least = std::min(least, at(v));
        }
        return least;
    }
    /// Displaces the forceps. False if the step does not find the equilibrium.
    [[nodiscard]] bool draw(const membrane::Vector3<double>& displacement) {
        std::vector<membrane::Index> held;
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) < front_ - (arm - 0.25) * edge) held.push_back(v);
        }
        for (const membrane::Index v : held) x.col(v) += displacement.template cast<S>();
        solver.wake_all();
        const auto report = solver.step(x, S(1e-3), network, adhesion, membrane::pin(held));
        adhesion.update(x, report.moved);
        front_ = front();
        const membrane::Vector3<double> now = -report.total_reaction().template cast<double>();
        work += dot<double>((pull + now) / 2, displacement);
        pull = now;
        return report.converged;
    }
    /// Stored in membrane and adhesion [J].
    [[nodiscard]] double stored() const {
        double sum = static_cast<double>(network.energy(x));
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v)
            sum += static_cast<double>(adhesion.energy(v, membrane::point(x, v)));
        return sum;
    }
    /// What the peel takes by the force and its angle [J/m^2]: F (1 - cos) per width does the work of peeling, and
    /// stretches what comes off by F / (E t), of which half the work is stored.
    [[nodiscard]] double energy_by_force() const {
        const double per_width = norm(pull) / width, cosine = -pull[0] / norm(pull);
        return per_width * (1 - cosine) + per_width * per_width / (2 * stretch_stiffness);
    }

    /// Peels off 16 rows. The mean of the energy by the force over the last 6; NaN if a step does not find the
    /// equilibrium, or if the front does not move on.
    [[nodiscard]] double peel() {
        const double step = edge / 4;
        double sum = 0;
        int count = 0;
        while (front() < (arm + 16) * edge) {
            // First straight up, until the front moves.
            const bool moves = front() > (arm + 0.75) * edge;
            const double up = step * (1 + energy / stretch_stiffness);
            if (!draw({moves ? step : 0, 0, up}) || pull[2] > 10 * energy * width) return std::nan("");
            if (front() < (arm + 10) * edge) continue;
            sum += energy_by_force();
            ++count;
        }
        return sum / count;
    }

  private:
    double front_ = arm * edge;
};

}  // namespace test
