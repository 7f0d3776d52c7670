// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <type_traits>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/vertex_rows.hpp>

/// One vertex update: the displacement of a vertex by the rule for the forces on it. One code serves one vertex and
/// several.
///
///     const auto move = membrane::move_of(rule, vertex, rows.force_tolerance);
///     if (move.moves) position += move.displacement;
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The input of one step, and the current positions.
template <class Scalar, class Network, class Volume>
struct StepInput {
    const ConstPointsRef<Scalar>& start;  ///< positions when the step began, 3 x V [m]
    const ConstPointsRef<Scalar>& x;      ///< positions now, 3 x V [m]
    Scalar dt;                            ///< [s]
    const Network& network;               ///< springs and elements
    const Volume& volume;                 ///< the foundation
    VertexRows<Scalar>& rows;             ///< of the solver
};

/// The displacement of a vertex, or of several, by a rule.
template <Number N, class Compliance>
struct VertexMove {
    using YesNo = decltype(N() < N());  ///< a truth value for each vertex

    Compliance compliance;    ///< [m/N]
    N least;                  ///< lower bound of the compliance in any direction [m/N]
    Vector3<N> displacement;  ///< [m]
    YesNo moves;              ///< whether the force is above the tolerance
    YesNo may_overshoot;      ///< whether the displacement may be unstable, by the stiffness bound
};

///@{
/// A compliance as a 3 x 3 block.
template <Number N>
[[nodiscard]] const Symmetric3<N>& as_block(const Symmetric3<N>& block) noexcept {
    return block;
}
template <Number N>
[[nodiscard]] Symmetric3<N> as_block(const N& number) noexcept {
    return diagonal3(number);
}
///@}

/// The displacement of `vertex` by `rule`: compliance times force; zero if the force is at most `force_tolerance` [N].
template <class Rule, Number N>
[[nodiscard]] MEMBRANE_INLINE auto move_of(const Rule& rule, const VertexState<N>& vertex,
                                           Each<N> force_tolerance) noexcept {
    const auto compliance = compliance_of(rule, vertex);
    VertexMove<N, std::remove_cvref_t<decltype(compliance)>> move;
    move.compliance = compliance;
    if constexpr (moves_along_force<Rule, Each<N>>) {
        move.least = compliance;
        move.may_overshoot = is_descent_rule<Rule> ? N(0) > N(0) : compliance * vertex.stiffness >= 2;
    } else {
        const auto resists = vertex.stiffness > 0;
        move.least = select<N>(resists, 1 / select<N>(resists, vertex.stiffness, 1), 0);
        move.may_overshoot = N(0) > N(0);
    }
    move.displacement = compliance * vertex.force;
    move.moves = norm(vertex.force) > force_tolerance;
    return move;
}

}  // namespace MEMBRANE_INSTRUCTION_SET

/// Force and stiffness on vertex `v` by foundation, damping and constraints, without the network.
template <class Scalar, class Network, class Volume>
[[nodiscard]] VertexForce<Scalar> non_network_force(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto& rows = scene.rows;
    const Scalar stiffness = rows.contact_stiffness(v) + rows.added_stiffness[static_cast<std::size_t>(v)];
    if constexpr (std::is_same_v<Volume, NoFoundation>) return {rows.constraint_force(v), stiffness};
    const auto foundation = scene.volume.force_on(v, point(scene.x, v), point(scene.start, v), scene.dt);
    return {foundation.force + rows.constraint_force(v), foundation.stiffness + stiffness};
}

/// Sum of all forces on vertex `v`, and its stiffness.
template <class Scalar, class Network, class Volume>
[[nodiscard]] VertexForce<Scalar> total_force(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto springs = scene.network.force_on(v, scene.x), others = non_network_force(scene, v);
    return {springs.force + others.force, springs.stiffness + others.stiffness};
}

/// The force `now` on vertex `v`, without damping: damping may balance the forces for one tick out of equilibrium.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> undamped_force(const StepInput<Scalar, Network, Volume>& scene, Index v,
                                             const Vector3<Scalar>& now) noexcept {
    const Vector3<Scalar> here = point(scene.x, v), start = point(scene.start, v);
    if constexpr (HasSprings<Volume, Scalar>) {
        const auto spring = scene.volume.spring(v, start, scene.dt);
        return spring.damps() ? Vector3<Scalar>(now - spring.damping_force(here)) : now;
    } else {
        const Vector3<Scalar> still = scene.volume.force_on(v, here, here, scene.dt).force;
        const Vector3<Scalar> moving = scene.volume.force_on(v, here, start, scene.dt).force;
        return now + (still - moving);
    }
}

/// Whether updates of a vertex by `compliance` times its force diverge: each overshoots by more than the last.
template <class Scalar, class Network, class Volume>
[[nodiscard]] bool diverges(const StepInput<Scalar, Network, Volume>& scene, Index v, Scalar compliance) noexcept {
    const Scalar others = non_network_force(scene, v).stiffness;
    if (compliance * (scene.network.force_on(v, scene.x).stiffness + others) < 2) return false;
    return compliance * (largest_eigenvalue(scene.network.hessian(v, scene.x)) + others) >= 2;
}

/// Whether an update needs a line search: springs or elements may stiffen, and `Rule` guarantees descent.
template <class Rule, class Network>
inline constexpr bool needs_line_search = !Network::never_stiffens && is_descent_rule<Rule>;

/// Whether the majoriser bounds the energy of `Network`, and `Rule` evaluates it.
template <class Rule, class Network>
inline constexpr bool has_energy_bound = requires {
    requires Rule::needs_majoriser;
    requires Network::bounds_energy;
};

/// Whether the majoriser of `vertex` shows that a displacement does not raise the energy.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE auto surely_descends(const VertexState<N>& vertex,
                                                   const Vector3<N>& displacement) noexcept {
    const N square = squared_norm(displacement), part = 1 / (1 + root_of<N>(square) / vertex.size);
    const N reduction = part * dot<N>(displacement, vertex.stiffness_reduction * displacement);
    const N quadratic = larger<N>((vertex.stiffness * square - reduction) / 2, 0);
    return vertex.remainder.at(square, quadratic) <= dot<N>(vertex.force, displacement) - quadratic;
}

}  // namespace membrane
