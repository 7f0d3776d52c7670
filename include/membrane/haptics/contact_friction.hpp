// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <string_view>
#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/haptics/force_policy.hpp>

/// Coulomb friction on the normal force of another policy.
///
///     auto feel = membrane::ContactFriction(membrane::SpringDamperForce{.stiffness = 100},
///                                           {.coefficient = 0.1, .stiffness = 100});
///     device.write(feel({tool, contact, report}));
namespace membrane {

/// Options of `ContactFriction`.
struct FrictionOptions {
    double coefficient;  ///< of Coulomb friction: largest ratio of tangential to normal force
    double stiffness;    ///< tangential stiffness while the tool sticks, at the device [N/m]

    /// @throws InvalidInput if a number is out of its range
    void validate() const;
};

/// The force of another policy plus Coulomb friction. At first contact the tool sticks: a spring along the surface
/// pulls it to that point. If the spring force would exceed `coefficient` times the normal force, the tool slips and
/// drags the sticking point along. The force is continuous between sticking and slipping. Friction dissipates energy
/// and returns only what its spring has stored. For `passivity` the stiffness is the larger of the policy's and
/// `stiffness`.
template <class Policy, Real Scalar = double>
    requires CheckedForcePolicy<Policy, Scalar>
class ContactFriction {
  public:
    /// @throws InvalidInput if an option is out of its range
    ContactFriction(Policy policy, const FrictionOptions& options)
        : policy_((options.validate(), std::move(policy))),
          coefficient_(static_cast<Scalar>(options.coefficient)),
          stiffness_(static_cast<Scalar>(options.stiffness)) {}

    /// Force of the policy plus friction [N]. Once a tick, online.
    [[nodiscard]] Vector3<Scalar> operator()(const HapticState<Scalar>& state) noexcept;

    /// Whether the tool slipped in the last tick.
    [[nodiscard]] bool slips() const noexcept { return slips_; }

  private:
    Policy policy_;
    Scalar coefficient_, stiffness_;
    bool sticks_ = false, slips_ = false;
    Vector3<Scalar> anchor_ = Vector3<Scalar>::Zero();  // where the tool sticks [m]
};

inline void FrictionOptions::validate() const {
    constexpr std::string_view component = "ContactFriction";
    detail::check_option(component, coefficient, "coefficient", "1");
    detail::check_option(component, stiffness, "stiffness", "N/m", false);
}

template <class Policy, Real Scalar>
requires CheckedForcePolicy<Policy, Scalar> Vector3<Scalar> ContactFriction<Policy, Scalar>::operator()(
    const HapticState<Scalar>& state) noexcept {
    const Vector3<Scalar> force = policy_(state);
    const auto& [tool, contact, report, grasp] = state;
    const bool contacts = contact.touching() && !grasp.holding();
    if (!contacts || !sticks_) anchor_ = tool.position;
    sticks_ = contacts && is_finite(tool.position) && is_finite(contact.normal) && is_finite(force);
    slips_ = false;
    if (!sticks_) return force;

    const Scalar load = (std::max)(dot(force, contact.normal), Scalar(0));
    const Scalar farthest = coefficient_ * load / stiffness_;
    Vector3<Scalar> displacement = tool.position - anchor_;
    displacement -= dot(displacement, contact.normal) * contact.normal;
    const Scalar length = norm(displacement);
    slips_ = length > farthest;
    if (slips_) displacement *= farthest / length;
    anchor_ = tool.position - displacement;
    const Vector3<Scalar> both = force - stiffness_ * displacement;
    sticks_ = is_finite(both) && is_finite(anchor_);
    return sticks_ ? both : force;
}

}  // namespace membrane
