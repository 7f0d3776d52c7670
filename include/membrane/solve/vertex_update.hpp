// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <type_traits>

#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/curvature.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/step_state.hpp>

/// One update: a vertex moves as the rule has it for the forces on it. The same code for one vertex and for several.
///
///     auto state = membrane::state_of<Rule>(scene, v);
///     const auto move = membrane::move_of(rule, state, scene.state.force_tolerance);
///     if (move.moves) x.col(v) += membrane::backtracked<Rule>(scene, v, move.displacement);
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The input of one step, and where the vertices are in it.
template <class Scalar, class Network, class Volume>
struct StepInput {
    const ConstPointsRef<Scalar>& start;
    const ConstPointsRef<Scalar>& x;  // now
    Scalar dt;
    const Network& network;
    const Volume& volume;
    StepState<Scalar>& state;
};

/// The unit vector along `a`, zero where that is.
template <Number N>
[[gnu::always_inline, nodiscard]] inline Vector3<N> direction_or_zero(const Vector3<N>& a) noexcept {
    const N size = norm(a);
    return (1 / select<N>(size > 0, size, 1)) * a;
}

/// What a rule makes of the forces on a vertex, or on several.
template <Number N, class Compliance>
struct VertexMove {
    using YesNo = decltype(N() < N());

    Compliance compliance;  ///< [m/N]
    N least;                ///< no force moves the vertex less, for each newton [m/N]
    Vector3<N> displacement;
    YesNo moves;          ///< whether the force is above the tolerance
    YesNo may_overshoot;  ///< whether the rule may move beyond what is stable, by the bound of the stiffness
};

/// The number as a block, for who needs it in all directions.
template <Number N>
[[nodiscard]] const Symmetric3<N>& as_block(const Symmetric3<N>& block) noexcept {
    return block;
}
template <Number N>
[[nodiscard]] Symmetric3<N> as_block(const N& number) noexcept {
    return diagonal3(number);
}

template <class Rule, Number N>
[[gnu::always_inline, nodiscard]] inline auto move_of(const Rule& rule, const VertexState<N>& vertex,
                                                      Each<N> force_tolerance) noexcept {
    const auto compliance = rule.compliance(vertex);
    VertexMove<N, std::remove_cvref_t<decltype(compliance)>> move;
    move.compliance = compliance;
    if constexpr (moves_along_force<Rule, N>) {
        move.least = compliance;
        move.may_overshoot = is_safe_rule<Rule> ? N(0) > N(0) : compliance * vertex.stiffness >= 2;
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

/// What pulls on vertex `v` beside its springs: foundation, damping and constraints.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Pull<Scalar> others_on(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto& state = scene.state;
    const Scalar stiffness = state.contact_stiffness(v) + state.added_stiffness[static_cast<std::size_t>(v)];
    if constexpr (std::is_same_v<Volume, NoVolumeSprings>) return {state.constraint_force(v), stiffness};
    const auto foundation = scene.volume.pull(v, point(scene.x, v), point(scene.start, v), scene.dt);
    return {foundation.force + state.constraint_force(v), foundation.stiffness + stiffness};
}

/// All that pulls on it.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Pull<Scalar> pull_on(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto springs = scene.network.pull(v, scene.x), others = others_on(scene, v);
    return {springs.force + others.force, springs.stiffness + others.stiffness};
}

/// The force `now` on vertex `v` without damping, which may hold in balance, for the length of a tick, what is not at rest.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> undamped_force(const StepInput<Scalar, Network, Volume>& scene, Index v,
                                             const Vector3<Scalar>& now) noexcept {
    const Vector3<Scalar> here = point(scene.x, v), start = point(scene.start, v);
    if constexpr (requires { scene.volume.spring(v, start, scene.dt); }) {
        const auto spring = scene.volume.spring(v, start, scene.dt);
        return spring.rate == 0 ? now : Vector3<Scalar>(now - spring.drag(here));
    } else {
        const Vector3<Scalar> still = scene.volume.pull(v, here, here, scene.dt).force;
        const Vector3<Scalar> moving = scene.volume.pull(v, here, start, scene.dt).force;
        return now + (still - moving);
    }
}

/// The input of `Rule`.
template <class Rule, class Scalar, class Network, class Volume>
[[nodiscard]] VertexState<Scalar> state_of(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    VertexState<Scalar> state;
    if constexpr (requires { requires Rule::needs_relief; }) {
        static_cast<CurvedPull<Scalar>&>(state) = scene.network.curved_pull(v, scene.x);
    } else {
        const auto springs = scene.network.pull(v, scene.x);
        state.force = springs.force;
        state.stiffness = springs.stiffness;
    }
    const auto others = others_on(scene, v);
    state.force += others.force;
    state.stiffness += others.stiffness;
    state.mass = scene.network.has_masses() ? scene.network.mass(v) : Scalar(0);
    state.dt = scene.dt;
    state.touched = scene.state.seeds.contains(v);
    if (state.touched) {
        state.contact_stiffness = scene.state.contact_stiffness(v);
        state.contact_normal = direction_or_zero(scene.state.constraint_force(v));
    }
    return state;
}

/// Whether a vertex that moves by `compliance` times the force on it overshoots by more each time.
template <class Scalar, class Network, class Volume>
[[nodiscard]] bool diverges(const StepInput<Scalar, Network, Volume>& scene, Index v, Scalar compliance) noexcept {
    const Scalar others = others_on(scene, v).stiffness;
    if (compliance * (curvature_bound(scene.network.curved_pull(v, scene.x)) + others) < 2) return false;
    return compliance * (largest_curvature<Scalar>(scene.network, v, scene.x) + others) >= 2;
}

/// Backtracking line search, where springs may stiffen and `Rule` guarantees descent: halves the displacement until the
/// energy does not rise, up to rounding.
template <class Rule, class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> backtracked(const StepInput<Scalar, Network, Volume>& scene, Index v,
                                          std::type_identity_t<Vector3<Scalar>> displacement) noexcept {
    if constexpr (!Network::never_stiffens && is_safe_rule<Rule>) {
        const auto others = others_on(scene, v);
        for (int i = 0; i < std::numeric_limits<Scalar>::digits; ++i, displacement /= 2) {
            const Scalar work = dot(others.force, displacement) - others.stiffness * squared_norm(displacement) / 2;
            const auto energy = scene.network.energy_change(v, displacement, scene.x);
            if (energy.change <= work + 16 * std::numeric_limits<Scalar>::epsilon() * energy.size) return displacement;
        }
        return Vector3<Scalar>::Zero();
    }
    return displacement;
}

}  // namespace membrane
