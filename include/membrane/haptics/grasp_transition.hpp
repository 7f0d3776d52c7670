// SPDX-License-Identifier: MIT
#pragma once

#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/haptics/force_policy.hpp>

/// From touching to grasping and back, without a jump.
///
///     auto feel = membrane::GraspTransition(membrane::SpringDamperForce{.stiffness = 100}, {.duration = 0.1});
///     device.write(feel({tool, contact, report, grasp}));                    // the tool with its time
namespace membrane {

struct TransitionOptions {
    double duration = 0.1;  ///< in which the force goes from the one law to the other [s]

    /// @throws InvalidInput for a duration that is not finite and positive
    void check() const { detail::check_option("GraspTransition", duration, "duration", "s", false); }
};

/// The force of another policy; when the tool takes hold or lets go, the force first stays what it was, and what the new
/// law differs by comes in evenly over `duration`. At all other times it is the policy's, bit for bit. Meanwhile it is
/// no force of a potential: it may give the hand up to that difference times the way in `duration`.
template <class Policy, Real Scalar = double>
    requires CheckedForcePolicy<Policy, Scalar>
class GraspTransition {
  public:
    /// @throws InvalidInput for an option out of its range
    explicit GraspTransition(Policy policy, const TransitionOptions& options = {})
        : policy_((options.check(), std::move(policy))), duration_(static_cast<Scalar>(options.duration)) {}

    [[nodiscard]] Vector3<Scalar> operator()(const HapticState<Scalar>& state) noexcept;

    /// Whether the force is still on its way from one law to the other.
    [[nodiscard]] bool in_transition() const noexcept { return in_transition_; }

  private:
    Policy policy_;
    Scalar duration_;
    bool held_ = false, in_transition_ = false;
    Scalar begin_ = 0;                                      // [s]
    Vector3<Scalar> difference_ = Vector3<Scalar>::Zero();  // of the old law to the new, at the beginning [N]
    Vector3<Scalar> last_ = Vector3<Scalar>::Zero();        // force [N]
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
    // A time that jumps back or is none ends it.
    in_transition_ = in_transition_ && past >= 0 && past < 1 && is_finite(past) && is_finite(difference_);
    last_ = in_transition_ ? Vector3<Scalar>(force + (1 - past) * difference_) : force;
    return last_;
}

}  // namespace membrane
