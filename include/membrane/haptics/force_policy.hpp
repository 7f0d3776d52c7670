// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <concepts>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/step.hpp>

/// What the hand should feel.
///
///     const auto feel = membrane::SpringDamperForce{.stiffness = 100, .damping = 0.5};     // [N/m], [N s/m]
///     device.write(feel({tool, contact, report}));                                         // [N]
namespace membrane {

/// All that is known at the end of a tick.
template <Real Scalar>
struct HapticState {
    Tool<Scalar> tool;
    Contact<Scalar> contact;
    StepReport<Scalar> report;
    Grasp<Scalar> grasp = {};
};

/// The force on the hand [N]. What the compiler cannot see: finite for every finite state, and no energy given that the hand did
/// not bring. The stock policies give zero for what is not finite. A policy may remember (friction does): then it is called
/// once in each tick, and belongs to one tool.
/// A policy that is to be called with a list in braces, as above, names the scalar of its argument.
template <class Policy, class Scalar>
concept ForcePolicy = Real<Scalar> && requires(Policy& policy, const HapticState<Scalar>& state) {
    { policy(state) }
    noexcept->std::convertible_to<Vector3<Scalar>>;
};

namespace detail {

template <class Policy, class Scalar>
consteval bool check_force_policy() noexcept {
    static_assert(ForcePolicy<Policy, Scalar>,
                  "ForcePolicy: policy(const HapticState<Scalar>&) noexcept must return Vector3<Scalar>");
    return ForcePolicy<Policy, Scalar>;
}

}  // namespace detail

/// A `ForcePolicy`; where it is none, the error says what is missing.
template <class Policy, class Scalar>
concept CheckedForcePolicy = detail::check_force_policy<Policy, Scalar>();

namespace detail {

/// A device never gets what is not a number.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> finite_or_zero(const Vector3<Scalar>& force) noexcept {
    return is_finite(force) ? force : Vector3<Scalar>(Vector3<Scalar>::Zero());
}

}  // namespace detail

/// The force of the paper, F = -k x - mu v, [Liu07] 2.4. Touching: x is the depth and v the velocity along the contact
/// normal, and so is the force; it never pulls the tool in. Pulling: x is how far the held point is from where it would be
/// without the tool, v its velocity along that, and the force runs against it. The held point moves with the tool. On a
/// body that moves velocities are relative to it.
///
/// Touching, it has no potential as it stands: the depth is of the surface at rest, the normal of the deformed one. A hand
/// that goes round slowly is given some microjoules on each turn, which only friction takes (see `SampledLoop`). With the
/// contact of a `RestContact` it is that of a spring.
struct SpringDamperForce {
    double stiffness;    ///< k [N/m]
    double damping = 0;  ///< mu [N s/m]

    // For a state of doubles in braces or of floats; templates, so that an include costs no more for them.
    template <int = 0>
    [[nodiscard]] Vector3<double> operator()(const HapticState<double>& state) const noexcept {
        return force(state);
    }
    template <int = 0>
    [[nodiscard]] Vector3<float> operator()(const HapticState<float>& state) const noexcept {
        return force(state);
    }

  private:
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> force(const HapticState<Scalar>& state) const noexcept;
};

/// The membrane's own reaction, what the solver found: the sum over all constraints of the step, scaled from the tissue
/// to what a hand can feel. As far as steps converge its potential is the energy of the membrane, so that a hand that goes
/// round slowly is given nothing. Where a step has loads, pins or a second hand's tool, a policy of one's own takes the
/// `report.reactions` that are this hand's.
struct ReactionForce {
    double scale = 1;

    template <int = 0>
    [[nodiscard]] Vector3<double> operator()(const HapticState<double>& state) const noexcept {
        return force(state);
    }
    template <int = 0>
    [[nodiscard]] Vector3<float> operator()(const HapticState<float>& state) const noexcept {
        return force(state);
    }

  private:
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> force(const HapticState<Scalar>& state) const noexcept {
        return detail::finite_or_zero<Scalar>(static_cast<Scalar>(scale) * state.report.total_reaction());
    }
};

template <Real Scalar>
Vector3<Scalar> SpringDamperForce::force(const HapticState<Scalar>& state) const noexcept {
    const auto k = static_cast<Scalar>(stiffness), mu = static_cast<Scalar>(damping);
    const auto& [tool, contact, report, grasp] = state;
    if (grasp.holding()) {
        const Vector3<Scalar> displacement = grasp.displacement(tool);
        const Scalar length = norm(displacement);
        if (!(length > 0)) return Vector3<Scalar>::Zero();
        const Vector3<Scalar> along = displacement / length;
        return detail::finite_or_zero<Scalar>(
            -(k * length + mu * dot<Scalar>(tool.velocity - grasp.body_velocity, along)) * along);
    }
    if (!contact.touching()) return Vector3<Scalar>::Zero();
    const Scalar push = k * contact.depth - mu * dot<Scalar>(tool.velocity - contact.body_velocity, contact.normal);
    return detail::finite_or_zero<Scalar>((std::max)(push, Scalar(0)) * contact.normal);
}

}  // namespace membrane
