// SPDX-License-Identifier: MIT
#pragma once

#include <limits>

#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/vertex_rows.hpp>

#include "support/vertex_energy.hpp"

/// The update of one vertex, without lanes: what a pack does to each of its vertices.
///
///     const auto state = test::state_of<Rule>(scene, v);
///     if (test::update(scene, v, rule, tolerance)) ...
namespace test {

/// The input of `Rule`.
template <class Rule, class Scene>
auto state_of(const Scene& scene, membrane::Index v) {
    using Scalar = std::remove_cvref_t<decltype(scene.dt)>;
    membrane::VertexState<Scalar> state;
    if constexpr (requires { requires Rule::needs_majoriser; }) {
        static_cast<membrane::EnergyMajoriser<Scalar>&>(state) = majoriser(scene.network, v, scene.x);
    } else {
        const auto springs = scene.network.force_on(v, scene.x);
        state.force = springs.force;
        state.stiffness = springs.stiffness;
    }
    const auto others = membrane::non_network_force(scene, v);
    state.force += others.force;
    state.stiffness += others.stiffness;
    state.mass = scene.network.has_masses() ? scene.network.mass(v) : Scalar(0);
    state.dt = scene.dt;
    state.constrained = scene.rows.seeds.contains(v);
    if (state.constrained) {
        state.contact_stiffness = scene.rows.contact_stiffness(v);
        state.contact_normal = membrane::direction_or_zero(scene.rows.constraint_force(v));
    }
    return state;
}

/// Moves a free vertex by `rule`, unless the force is at most `tolerance` [N]: halves the displacement until the energy
/// does not rise, where `Rule` guarantees that. Returns whether it moved.
template <class Rule, class Scene, class Scalar>
bool update(const Scene& scene, membrane::Index v, const Rule& rule, Scalar tolerance) {
    const auto state = state_of<Rule>(scene, v);
    if (scene.rows.is_fixed(v) || !(norm(state.force) > tolerance)) return false;
    membrane::Vector3<Scalar> by = rule.compliance(state) * state.force;
    const auto others = membrane::non_network_force(scene, v);
    const auto rises = [&] {
        const Scalar work = dot(others.force, by) - others.stiffness * squared_norm(by) / 2;
        const auto energy = energy_change(scene.network, v, by, scene.x);
        return !(energy.change <= work + 16 * std::numeric_limits<Scalar>::epsilon() * energy.size);
    };
    if (membrane::is_descent_rule<Rule> && !scene.network.never_stiffens) {
        int halvings = 0;
        if constexpr (requires { requires Rule::needs_majoriser && scene.network.bounds_energy; }) {
            if (membrane::surely_descends(state, by)) halvings = -1;
        }
        while (halvings >= 0 && halvings < std::numeric_limits<Scalar>::digits && rises()) by /= 2, ++halvings;
        if (halvings == std::numeric_limits<Scalar>::digits) by = membrane::Vector3<Scalar>::Zero();
    }
    scene.rows.set_position(v, point(scene.x, v) + by);
    return true;
}

}  // namespace test
