// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <type_traits>

#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/curvature.hpp>
#include <membrane/solve/region.hpp>
#include <membrane/solve/step_rule.hpp>

/// What a step sees of one vertex when it visits it.
///
///     const auto state = membrane::state_of<Rule>(scene, v);
///     x.col(v) += membrane::held_back<Rule>(scene, v, rule.compliance(state) * state.force);
namespace membrane {

/// What is handed in for one step, and what it works with.
template <class Scalar, class Network, class Volume>
struct StepInput {
    PointsRef<Scalar>& x;
    Scalar dt;
    const Network& network;
    const Volume& volume;
    const Workspace<Scalar>& work;
};

/// What pulls on vertex `v` beside its springs: backing, damping and constraints.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Pull<Scalar> others_on(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const Scalar touches = (std::max)(scene.work.stiffness[static_cast<std::size_t>(v)], Scalar(0));
    if constexpr (std::is_same_v<Volume, NoVolumeSprings>) return {point(scene.work.external, v), touches};
    const auto backing = scene.volume.pull(v, point(scene.x, v), point(scene.work.start, v), scene.dt);
    return {backing.force + point(scene.work.external, v), backing.stiffness + touches};
}

/// All that pulls on it.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Pull<Scalar> pull_on(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto springs = scene.network.pull(v, scene.x), others = others_on(scene, v);
    return {springs.force + others.force, springs.stiffness + others.stiffness};
}

/// The same without damping, which may hold in balance, for the length of a tick, what is not at rest.
/// @pre `unbalanced` is up to date
template <class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> lasting_force(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const Vector3<Scalar> here = point(scene.x, v), start = point(scene.work.start, v);
    const Vector3<Scalar> now = point(scene.work.unbalanced, v);
    if constexpr (requires { scene.volume.spring(v, start, scene.dt); }) {
        const auto spring = scene.volume.spring(v, start, scene.dt);
        return spring.rate == 0 ? now : Vector3<Scalar>(now - spring.drag(here));
    } else {
        const Vector3<Scalar> still = scene.volume.pull(v, here, here, scene.dt).force;
        const Vector3<Scalar> moving = scene.volume.pull(v, here, start, scene.dt).force;
        return now + (still - moving);
    }
}

/// What `Rule` is told.
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
    state.touched = scene.work.seeds.contains(v);
    return state;
}

/// Whether a vertex that moves by `compliance` times the force on it swings further out each time.
template <class Scalar, class Network, class Volume>
[[nodiscard]] bool diverges(const StepInput<Scalar, Network, Volume>& scene, Index v, Scalar compliance) noexcept {
    const Scalar others = others_on(scene, v).stiffness;
    if (compliance * (curvature_bound(scene.network.curved_pull(v, scene.x)) + others) < 2) return false;
    return compliance * (largest_curvature<Scalar>(scene.network, v, scene.x) + others) >= 2;
}

/// The way that a vertex goes where `way` would take it and springs may stiffen on it, if `Rule` is safe: half of it, or
/// half of that, until the energy is no higher than before, as far as rounding lets one tell.
template <class Rule, class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> held_back(const StepInput<Scalar, Network, Volume>& scene, Index v,
                                        std::type_identity_t<Vector3<Scalar>> way) noexcept {
    if constexpr (!Network::never_stiffens && is_safe_rule<Rule>) {
        const auto others = others_on(scene, v);
        for (int i = 0; i < std::numeric_limits<Scalar>::digits; ++i, way /= 2) {
            const Scalar work = dot(others.force, way) - others.stiffness * squared_norm(way) / 2;
            const auto energy = scene.network.energy_change(v, way, scene.x);
            if (energy.change <= work + 16 * std::numeric_limits<Scalar>::epsilon() * energy.size) return way;
        }
        way.setZero();
    }
    return way;
}

}  // namespace membrane
