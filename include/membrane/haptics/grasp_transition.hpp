// SPDX-License-Identifier: MIT
#pragma once

#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/haptics/force_policy.hpp>

/// Continuous change of the force between contact and grasp.
///
///     auto feel = membrane::GraspTransition(membrane::SpringDamperForce{.stiffness = 100}, {.duration = 0.1});
///     device.write(feel({tool, contact, report, grasp}));                    // tool.time must be set
namespace membrane {

/// Options of a `GraspTransition`.
struct TransitionOptions {
    double duration = 0.1;  ///< of the change from one force law to the other [s]

    /// @throws InvalidInput if the duration is not finite and positive
    void validate() const { detail::check_option("GraspTransition", duration, "duration", "s", false); }
};

/// The force of another policy, continuous at grasp and release: the force first keeps its value, and the difference to
/// the new law is added linearly over `duration`. At all other times it is the policy's force, bit for bit. During the
/// transition the force has no potential: it may give the hand an energy of up to that difference times the
/// displacement in `duration`.
template <class Policy, Real Scalar = double>
    requires CheckedForcePolicy<Policy, Scalar>
class GraspTransition {
  public:
    /// @throws InvalidInput if an option is out of its range
    explicit GraspTransition(Policy policy, const TransitionOptions& options = {})
        : policy_((options.validate(), std::move(policy))), duration_(static_cast<Scalar>(options.duration)) {}

    /// Force of the policy, continuous where a grasp begins or ends [N]. Once a tick, online.
    [[nodiscard]] Vector3<Scalar> operator()(const HapticState<Scalar>& state) noexcept;

    /// Whether the force is between the two laws.
    [[nodiscard]] bool in_transition() const noexcept { return in_transition_; }

  private:
    Policy policy_;
    Scalar duration_;
    bool held_ = false, in_transition_ = false;
    Scalar begin_ = 0;                                      // [s]
    Vector3<Scalar> difference_ = Vector3<Scalar>::Zero();  // old law minus new law, at the beginning [N]
    Vector3<Scalar> last_ = Vector3<Scalar>::Zero();        // last force [N]
};

template <class Policy, Real Scalar>
requires CheckedForcePolicy<Policy, Scalar> Vector3<Scalar> GraspTransition<Policy, Scalar>::operator()(
    const HapticState<Scalar>& state) noexcept {
    const Vector3<Scalar> force = policy_(state);
    const bool holds = state.grasp.holding();
    if (holds != held_) {
        held_ = holds;
        begin_ = state.tool.time;
        difference_ = last_ - force;
        in_transition_ = true;
    }
    const Scalar past = (state.tool.time - begin_) / duration_;
    // A time that goes back or is not finite ends the transition.
    in_transition_ = in_transition_ && past >= 0 && past < 1 && is_finite(past) && is_finite(difference_);
    last_ = in_transition_ ? Vector3<Scalar>(force + (1 - past) * difference_) : force;
    return last_;
}

}  // namespace membrane
