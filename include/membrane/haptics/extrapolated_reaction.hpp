// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/core/symmetric3.hpp>
#include <membrane/haptics/force_policy.hpp>

/// A force for each tick from a solve for every tenth.
///
///     auto feel = membrane::ExtrapolatedReaction<double>({.scale = 40});
///     feel.solved(report.reactions[0], tangent.stiffness, tool.position);    // when a solve has ended
///     device.write(feel({tool, contact, report}));                           // each tick
namespace membrane {

struct ExtrapolationOptions {
    double scale = 1;  ///< from the tissue to the hand
};

/// The reaction of the last solve, and how it changes with the tool's way since then: scale (R - T d), T the tangent
/// stiffness (see `accuracy/tangent_stiffness.hpp`), d the way. A touch still pushes and never pulls. Right to second
/// order in d, where the reaction alone is to first.
/// What passivity has to reckon with is `scale` times the largest eigenvalue of T, with no delay for a good T, but with
/// the age of the solve for what T leaves out.
template <Real Scalar>
class ExtrapolatedReaction {
  public:
    explicit ExtrapolatedReaction(const ExtrapolationOptions& options = {}) noexcept
        : scale_(static_cast<Scalar>(options.scale)) {}

    /// `reaction` of the membrane on the tool at `position`, `stiffness` how it resists there [N], [N/m], [m].
    void solved(const Vector3<Scalar>& reaction, const Symmetric3<Scalar>& stiffness,
                const Vector3<Scalar>& position) noexcept {
        reaction_ = reaction;
        stiffness_ = stiffness;
        position_ = position;
    }

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
