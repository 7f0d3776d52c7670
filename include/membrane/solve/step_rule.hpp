// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

#include <membrane/core/check.hpp>

/// How far a vertex moves for the force on it.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6}, membrane::MassStep{});         // (4) as published
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6}, membrane::SafeStep{.omega = 1.5});
namespace membrane {

/// What a rule knows of the vertex it is asked about.
template <Real Scalar>
struct VertexState {
    Scalar
        stiffness;  ///< at least the curvature of the energy in every direction: springs, backing, damping / dt [N/m]
    Scalar mass;    ///< [kg], zero where the network has none
    Scalar dt;      ///< [s]
};

/// The distance that a vertex moves for each newton on it [m/N]. What the compiler cannot see: not negative, finite. A
/// rule that sets `needs_mass` is refused by the solver for a network without masses.
template <class Rule, class Scalar>
concept StepRule = Real<Scalar> && std::copyable<Rule> &&
    requires(const Rule& rule, const VertexState<Scalar>& vertex) {
    { rule.compliance(vertex) }
    noexcept->std::same_as<Scalar>;
};

/// The rule as published, [Liu07] (4): dx = F dt^2 / m. It converges while dt^2 / m stays below 2 over the largest
/// eigenvalue of the 3 x 3 block of every vertex; the solver refuses a step beyond that.
struct MassStep {
    static constexpr bool needs_mass = true;

    template <Real Scalar>
    [[nodiscard]] Scalar compliance(const VertexState<Scalar>& vertex) const noexcept {
        return vertex.dt * vertex.dt / vertex.mass;
    }
};
static_assert(StepRule<MassStep, float> && StepRule<MassStep, double>);

/// Rule (4) with the mass that is always stable: dx = omega F / stiffness. A vertex on linear springs moves to or short
/// of the lowest energy on its way for omega <= 1, and no step raises the energy for omega < 2: along the way s F the
/// energy is at most E - s F^2 + s^2 F^2 stiffness / 2, which is below E for 0 < s < 2 / stiffness.
struct SafeStep {
    double omega = 1;  ///< 0 to 2, both excluded; larger spreads a change faster, and beyond 1 may swing

    template <Real Scalar>
    [[nodiscard]] Scalar compliance(const VertexState<Scalar>& vertex) const noexcept {
        return vertex.stiffness > 0 ? static_cast<Scalar>(omega) / vertex.stiffness : Scalar(0);
    }

    /// @throws InvalidInput for an `omega` out of its range
    void check() const {
        if (!is_finite(omega) || !(omega > 0 && omega < 2)) {
            refuse("SafeStep", "omega must lie between 0 and 2, got ", omega);
        }
    }
};
static_assert(StepRule<SafeStep, float> && StepRule<SafeStep, double>);

}  // namespace membrane
