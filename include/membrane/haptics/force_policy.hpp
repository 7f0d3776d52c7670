// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <concepts>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/step.hpp>

/// Force laws: the force on the hand from the state of the loop.
///
///     const auto feel = membrane::SpringDamperForce{.stiffness = 100, .damping = 0.5};     // [N/m], [N s/m]
///     device.write(feel({tool, contact, report}));                                         // [N]
namespace membrane {

/// State of the loop at the end of a tick.
template <Real Scalar>
struct HapticState {
    Tool<Scalar> tool;          ///< of this tick, as the device returned it
    Contact<Scalar> contact;    ///< of this tick
    StepReport<Scalar> report;  ///< of the last step
    Grasp<Scalar> grasp = {};   ///< of this tick; no point is held if left out
};

/// The force on the hand [N]. Requirements that the compiler cannot check: it is finite for every finite state, and it
/// gives the hand no more energy than the hand put in. The stock policies return zero instead of a force that is not
/// finite. A policy may have a state (friction has): then call it once per tick, for one tool only.
/// A policy that is called with a braced list, as above, must name the scalar of its argument.
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

/// A `ForcePolicy`. If a requirement is missing, the compile error names it.
template <class Policy, class Scalar>
concept CheckedForcePolicy = detail::check_force_policy<Policy, Scalar>();

namespace detail {

/// Zero if the force is not finite: a device never gets a NaN.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> finite_or_zero(const Vector3<Scalar>& force) noexcept {
    return is_finite(force) ? force : Vector3<Scalar>(Vector3<Scalar>::Zero());
}

}  // namespace detail

/// The force of the paper, F = -k x - mu v, [Liu07] 2.4. In contact x is the depth, v the velocity along the contact
/// normal. The force is along the normal and never pulls the tool in. In a grasp x is the distance of the held point
/// from its position without the tool, v its velocity along that displacement; the force opposes the displacement. The
/// held point moves with the tool. On a moving body velocities are relative to the body.
///
/// In contact the force has no potential: the depth is that of the surface at rest, the normal that of the deformed
/// surface. A hand on a slow closed path gains some microjoules per turn, which only friction dissipates (see
/// `SampledLoop`). With the contact of a `RestContact` the force is that of a spring.
struct SpringDamperForce {
    double stiffness;    ///< k [N/m]
    double damping = 0;  ///< mu [N s/m]

    // For braced states of double or float. Templates, so that they cost no compile time unless called.
    ///@{
    /// The force on the hand [N], see `ForcePolicy`. Online.
    template <int = 0>
    [[nodiscard]] Vector3<double> operator()(const HapticState<double>& state) const noexcept {
        return force(state);
    }
    template <int = 0>
    [[nodiscard]] Vector3<float> operator()(const HapticState<float>& state) const noexcept {
        return force(state);
    }
    ///@}

  private:
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> force(const HapticState<Scalar>& state) const noexcept;
};

/// The reaction of the membrane as the solver computes it: the sum over all constraints of the step, scaled from the
/// tissue to the hand. For converged steps its potential is the energy of the membrane, so a hand on a slow closed path
/// gains no energy. If a step has loads, pins or the tool of a second hand, write a policy that sums the
/// `report.reactions` of one hand.
struct ReactionForce {
    double scale = 1;  ///< force at the hand over force at the tissue

    ///@{
    /// The force on the hand [N], see `ForcePolicy`. Online.
    template <int = 0>
    [[nodiscard]] Vector3<double> operator()(const HapticState<double>& state) const noexcept {
        return force(state);
    }
    template <int = 0>
    [[nodiscard]] Vector3<float> operator()(const HapticState<float>& state) const noexcept {
        return force(state);
    }
    ///@}

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
