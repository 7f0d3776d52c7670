// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include <membrane/model/cohesive_springs.hpp>
#include <membrane/model/material.hpp>
#include <membrane/model/spring_stiffness.hpp>
#include <membrane/solve/quasi_static.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;

namespace {

/// A strip that adheres to a plane but for its end, which stands upright on it and is drawn off at 90 degrees: forceps
/// hold it eight edges behind the front, and take hold anew as the front moves on.
template <Real S>
struct Peel {
    static constexpr Index columns = 40, rows = 4, arm = 8;
    static constexpr double stretch_stiffness = 2.5, energy = 0.05, strength = 2e3;  // [N/m], [J/m^2], [Pa]

    /// Largest residual force, as a part of the strength on the area of a vertex.
    static constexpr double tolerance = std::is_same_v<S, float> ? 3e-3 : 3e-4;

    double edge;  // [m]
    double width = edge * rows * std::sqrt(3.0) / 2;
    TriangleMesh<S> mesh = test::triangle_strip<S>(columns, rows, edge);
    Material material{.young_modulus = stretch_stiffness / 5e-6, .poisson_ratio = 1.0 / 3, .thickness = 5e-6};
    MassSpringNetwork<S, LinearSpring> network{mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material)}};
    CohesiveSprings<S> adhesion{
        mesh,
        {.stiffness = S(strength * strength / (2 * energy * 0.05)), .strength = strengths(), .energy = S(energy)}};
    QuasiStaticSolver<S> solver{
        network, {.layers = unlimited, .sweeps = 20'000, .force_tolerance = S(strength * edge * edge * tolerance)}};
    Points<S> x = mesh.positions();
    double work = 0;                                 // of the forceps [J]
    Vector3<double> pull = Vector3<double>::Zero();  // of the forceps [N]

    explicit Peel(double edge_length) : edge(edge_length) {
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) < arm * edge) x.col(v) = Vector3<S>(S(arm * edge), x(1, v), S(arm * edge - at(v)));
        }
    }
    /// Along the strip at rest [m].
    [[nodiscard]] double at(Index v) const { return static_cast<double>(mesh.positions()(0, v)); }
    [[nodiscard]] std::vector<S> strengths() const {
        std::vector<S> each;
        for (Index v = 0; v < mesh.vertex_count(); ++v) each.push_back(at(v) < arm * edge ? S(0) : S(strength));
        return each;
    }
    /// Where the strip still adheres, from there on [m].
    [[nodiscard]] double front() const {
        double least = columns * edge;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) >= arm * edge && adhesion.adheres(v)) least = std::min(least, at(v));
        }
        return least;
    }
    /// Displaces the forceps. False if the step does not find the equilibrium.
    [[nodiscard]] bool draw(const Vector3<double>& displacement) {
        std::vector<Index> held;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (at(v) < front_ - (arm - 0.25) * edge) held.push_back(v);
        }
        for (const Index v : held) x.col(v) += displacement.template cast<S>();
        solver.wake_all();
        const auto report = solver.step(x, S(1e-3), network, adhesion, pin(held));
        adhesion.update(x, report.moved);
        front_ = front();
        const Vector3<double> now = -report.total_reaction().template cast<double>();
        work += dot<double>((pull + now) / 2, displacement);
        pull = now;
        return report.converged;
    }
    /// Stored in membrane and adhesion [J].
    [[nodiscard]] double stored() const {
        double sum = static_cast<double>(network.energy(x));
        for (Index v = 0; v < mesh.vertex_count(); ++v) sum += static_cast<double>(adhesion.energy(v, point(x, v)));
        return sum;
    }
    /// What the peel takes by the force and its angle [J/m^2]: F (1 - cos) per width does the work of peeling, and
    /// stretches what comes off by F / (E t), of which half the work is stored.
    [[nodiscard]] double energy_by_force() const {
        const double per_width = norm(pull) / width, cosine = -pull[0] / norm(pull);
        return per_width * (1 - cosine) + per_width * per_width / (2 * stretch_stiffness);
    }

  private:
    double front_ = arm * edge;
};

/// Peels off 16 rows. Returns the mean of the energy by the force over the last 6.
template <Real S>
double peel(Peel<S>& strip) {
    const double step = strip.edge / 4;
    double sum = 0;
    int count = 0;
    while (strip.front() < (strip.arm + 16) * strip.edge) {
        // First straight up, until the front moves.
        const bool moves = strip.front() > (strip.arm + 0.75) * strip.edge;
        const double up = step * (1 + strip.energy / strip.stretch_stiffness);
        REQUIRE(strip.draw({moves ? step : 0, 0, up}));
        REQUIRE(strip.pull[2] < 10 * strip.energy * strip.width);
        if (strip.front() < (strip.arm + 10) * strip.edge) continue;
        sum += strip.energy_by_force();
        ++count;
    }
    return sum / count;
}

}  // namespace

TEMPLATE_TEST_CASE("a 90 degree peel takes the adhesion energy per area, on three meshes", "[cohesion][peel]", double,
                   float) {
    for (const double edge : {12e-6, 8e-6, 6e-6}) {
        if (cases_are_slow && edge < 12e-6) continue;
        CAPTURE(edge);
        Peel<TestType> strip(edge);
        CHECK(peel(strip) == Approx(strip.energy).epsilon(0.02));
        const double balance = (strip.stored() + strip.adhesion.dissipated()) / strip.work;
        CHECK(balance == Approx(1).epsilon(std::is_same_v<TestType, float> ? 0.02 : 0.01));
    }
}
