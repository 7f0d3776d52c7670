// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/core/symmetric3.hpp>
#include <membrane/haptics/force_policy.hpp>

/// A force for each tick if only every tenth tick has a solve.
///
///     auto feel = membrane::ExtrapolatedReaction<double>({.scale = 40});
///     feel.solved(report.reactions[0], tangent.stiffness, tool.position);    // when a solve has ended
///     device.write(feel({tool, contact, report}));                           // each tick
namespace membrane {

/// Options of an `ExtrapolatedReaction`.
struct ExtrapolationOptions {
    double scale = 1;  ///< force at the hand over force at the tissue
};

/// The reaction of the last solve, extrapolated by the tool's displacement d since then: scale (R - T d), with T the
/// tangent stiffness (see `accuracy/tangent_stiffness.hpp`). In contact the force pushes and never pulls. Its error is
/// of order d^2; that of the reaction alone is of order d.
/// For `passivity` the stiffness is `scale` times the largest eigenvalue of T. An exact T adds no delay; the stiffness
/// that T omits has the age of the solve as its delay.
template <Real Scalar>
class ExtrapolatedReaction {
  public:
    /// Before the first solve the force is zero.
    explicit ExtrapolatedReaction(const ExtrapolationOptions& options = {}) noexcept
        : scale_(static_cast<Scalar>(options.scale)) {}

    /// Of one solve: `reaction` of the membrane on the tool [N], tangent `stiffness` [N/m], `position` of the tool [m].
    void solved(const Vector3<Scalar>& reaction, const Symmetric3<Scalar>& stiffness,
                const Vector3<Scalar>& position) noexcept {
        reaction_ = reaction;
        stiffness_ = stiffness;
        position_ = position;
    }

    /// The force on the hand [N], see `ForcePolicy`. Online.
    [[nodiscard]] Vector3<Scalar> operator()(const HapticState<Scalar>& state) const noexcept;

  private:
    Scalar scale_;
    Vector3<Scalar> reaction_ = Vector3<Scalar>::Zero(), position_ = Vector3<Scalar>::Zero();
    Symmetric3<Scalar> stiffness_;
};

template <Real Scalar>
Vector3<Scalar> ExtrapolatedReaction<Scalar>::operator()(const HapticState<Scalar>& state) const noexcept {
    const bool holding = state.grasp.holding();
    if (!holding && !state.contact.touching()) return Vector3<Scalar>::Zero();
    const Vector3<Scalar> displacement = state.tool.position - position_;
    Vector3<Scalar> force = scale_ * (reaction_ - stiffness_ * displacement);
    if (!holding) {
        const Vector3<Scalar>& normal = state.contact.normal;
        force -= (std::min)(dot(force, normal), Scalar(0)) * normal;
    }
    return detail::finite_or_zero<Scalar>(force);
}

}  // namespace membrane
