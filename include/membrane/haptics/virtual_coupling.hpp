// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <string_view>

#include <membrane/core/check.hpp>
#include <membrane/haptics/force_policy.hpp>

/// A spring between the hand and the tool in contact: the stiffness at the hand is at most that of the spring, however
/// stiff the tissue is.
///
///     auto coupling = membrane::VirtualCoupling<double>({.stiffness = 300, .scale = 40});
///     const auto tool    = coupling.update(device.read(), reaction, dt);     // the tool in contact
///     const auto contact = tracker.update(tree, x, tool);
///     const auto report  = solver.step(x, dt, network, foundation, press(tool, contact));
///     reaction = report.total_reaction();                                    // for the next tick
///     device.write(coupling.force());                                        // [N]
namespace membrane {

/// Options of a `VirtualCoupling`.
struct CouplingOptions {
    double stiffness;    ///< of the spring between hand and tool [N/m]
    double damping = 0;  ///< of the motion of the tool, see `min_damping` [N s/m]
    double scale = 1;    ///< force at the hand over force at the tissue

    /// @throws InvalidInput if a number is out of its range
    void validate() const;
};

/// The `damping` needed for a tissue whose stiffness, after the scale, is `tissue` [N/m]: 0 if the coupling is stiffer.
/// With less the tool oscillates about the hand, farther in each tick, as soon as it touches or holds that tissue. A
/// vertex in forceps is as stiff as its springs together. The hand feels the damping as drag in free air, too.
[[nodiscard]] inline double min_damping(double tissue, double coupling, double tick) noexcept {
    return (std::max)(tissue - coupling, 0.0) * tick / 2;
}

/// A massless tool between the coupling's spring and the membrane's reaction [Colgate95]. With `min_damping` it
/// generates no energy: for `passivity` only the stiffness of the coupling counts.
template <Real Scalar>
class VirtualCoupling {
  public:
    /// @throws InvalidInput if an option is out of its range
    explicit VirtualCoupling(const CouplingOptions& options)
        : stiffness_((options.validate(), static_cast<Scalar>(options.stiffness))),
          damping_(static_cast<Scalar>(options.damping)),
          scale_(static_cast<Scalar>(options.scale)) {}

    /// The tool at the equilibrium of spring, damping and the membrane's `reaction` on it, as of the last tick [N]. If
    /// a number is not finite, returns the hand's tool.
    Tool<Scalar> update(const Tool<Scalar>& hand, const Vector3<Scalar>& reaction, Scalar dt) noexcept;

    /// Force on the hand [N].
    [[nodiscard]] Vector3<Scalar> force() const noexcept { return force_; }
    /// `force()` as a force policy.
    [[nodiscard]] Vector3<Scalar> operator()(const HapticState<Scalar>& /*state*/) const noexcept { return force_; }

    /// As new.
    void reset() noexcept {
        began_ = false;
        force_.setZero();
    }

  private:
    Scalar stiffness_, damping_, scale_;
    bool began_ = false;
    Vector3<Scalar> position_ = Vector3<Scalar>::Zero(), force_ = Vector3<Scalar>::Zero();
};

inline void CouplingOptions::validate() const {
    constexpr std::string_view component = "VirtualCoupling";
    detail::check_option(component, stiffness, "stiffness", "N/m", false);
    detail::check_option(component, damping, "damping", "N s/m");
    detail::check_option(component, scale, "scale", "1");
}

template <Real Scalar>
Tool<Scalar> VirtualCoupling<Scalar>::update(const Tool<Scalar>& hand, const Vector3<Scalar>& reaction,
                                             Scalar dt) noexcept {
    Tool<Scalar> tool = hand;
    const bool valid = is_valid(hand) && is_finite(reaction) && is_finite(dt) && dt > 0;
    if (!valid || !began_) {
        began_ = valid;
        position_ = hand.position;
        force_.setZero();
        return tool;
    }
    const Vector3<Scalar> push = stiffness_ * (hand.position - position_) + scale_ * reaction;
    const Vector3<Scalar> displacement = push / (stiffness_ + damping_ / dt);
    position_ += displacement;
    tool.position = position_;
    tool.velocity = displacement / dt;
    force_ = stiffness_ * (position_ - hand.position);
    if (is_finite(force_) && is_finite(tool.velocity)) return tool;
    began_ = false;
    force_.setZero();
    return hand;
}

}  // namespace membrane
