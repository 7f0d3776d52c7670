// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/core/check.hpp>

/// A simulated hand that holds a device and yields to its force.
///
///     using Hand = membrane::SimulatedHand<double>;
///     membrane::ScriptedDevice<double, Hand> device({{0.0, above}, {1.0, below}}, {.radius = 1e-3},
///                                               Hand({.mass = 0.1, .damping = 2, .stiffness = 300}));
///     while (device.running()) { const auto tool = device.read(); ...; device.write(force); }     // a closed loop
namespace membrane {

/// Hand and device together. There are no default values: they depend on person, grip and device. A loop that is stable
/// with one hand need not be stable with another.
struct HandOptions {
    double mass = 0;       ///< m [kg]
    double damping = 0;    ///< b, of the velocity relative to the target's [N s/m]
    double stiffness = 0;  ///< k, to the target [N/m]
};

/// A mass on a spring and a damper to a target, m a = F - k (p - target) - b (v - target velocity). The target is the
/// intended position of the hand; it moves at its velocity until the next `set_target`. The force is held from one call
/// to the next, as by a device.
///
/// `advance` is the exact solution: any time step is stable, many small steps give the result of one large step, and
/// only the loop can generate energy. It uses `exp` and `sin`, whose last digits differ between mathematics libraries.
template <Real Scalar>
class SimulatedHand {
  public:
    /// @throws InvalidInput if mass or stiffness is not finite and positive, or damping not finite or negative
    explicit SimulatedHand(const HandOptions& options);

    /// Sets position and target, with zero velocity.
    void reset_to(const Vector3<Scalar>& position) noexcept {
        position_ = target_ = position;
        velocity_ = target_velocity_ = Vector3<Scalar>::Zero();
    }

    /// Sets the target [m] and its velocity [m/s].
    void set_target(const Vector3<Scalar>& target, const Vector3<Scalar>& velocity) noexcept {
        target_ = target;
        target_velocity_ = velocity;
    }

    /// Advances by `dt` [s] under a force [N]. If a number is not finite or `dt` is negative, returns false and changes
    /// nothing.
    bool advance(const Vector3<Scalar>& force, Scalar dt) noexcept;

    [[nodiscard]] Vector3<Scalar> position() const noexcept { return position_; }  ///< [m]
    [[nodiscard]] Vector3<Scalar> velocity() const noexcept { return velocity_; }  ///< [m/s]

  private:
    /// Free response after a time: to an initial displacement of 1 and to an initial velocity of 1.
    struct Response {
        Scalar position_by_position, position_by_velocity, velocity_by_position, velocity_by_velocity;
    };
    [[nodiscard]] Response response(double time) const noexcept;

    double rate_ = 0, square_ = 0;  // b / 2m [1/s], k / m [1/s^2]
    Scalar stiffness_ = 0;
    Vector3<Scalar> position_ = Vector3<Scalar>::Zero(), velocity_ = Vector3<Scalar>::Zero();
    Vector3<Scalar> target_ = Vector3<Scalar>::Zero(), target_velocity_ = Vector3<Scalar>::Zero();
};

template <Real Scalar>
SimulatedHand<Scalar>::SimulatedHand(const HandOptions& options) {
    const auto validate = [](const char* field, const char* unit, double value, bool allow_zero) {
        const auto number = static_cast<Scalar>(value);
        if (is_finite(number) && (number > 0 || (allow_zero && number == 0))) return;
        refuse("SimulatedHand", field, " must be finite and ", allow_zero ? "not negative" : "positive", " [", unit,
               "], got ", value);
    };
    validate("mass", "kg", options.mass, false);
    validate("damping", "N s/m", options.damping, true);
    validate("stiffness", "N/m", options.stiffness, false);
    rate_ = options.damping / options.mass / 2;
    square_ = options.stiffness / options.mass;
    stiffness_ = static_cast<Scalar>(options.stiffness);
}

template <Real Scalar>
bool SimulatedHand<Scalar>::advance(const Vector3<Scalar>& force, Scalar dt) noexcept {
    if (!(dt >= 0)) return false;
    const Response by = response(static_cast<double>(dt));
    // Relative to its equilibrium under the force, which moves with the target, the mass oscillates freely.
    const Vector3<Scalar> equilibrium = target_ + force / stiffness_, offset = position_ - equilibrium;
    const Vector3<Scalar> speed = velocity_ - target_velocity_, displacement = dt * target_velocity_;
    const Vector3<Scalar> position =
        equilibrium + displacement + (by.position_by_position * offset + by.position_by_velocity * speed);
    const Vector3<Scalar> velocity =
        target_velocity_ + (by.velocity_by_position * offset + by.velocity_by_velocity * speed);
    if (!is_finite(position) || !is_finite(velocity)) return false;
    position_ = position;
    velocity_ = velocity;
    target_ += displacement;
    return true;
}

template <Real Scalar>
auto SimulatedHand<Scalar>::response(double time) const noexcept -> Response {
    const double discriminant = rate_ * rate_ - square_;
    // The position by velocity is `sine`; the other responses combine `sine` and `other`.
    double sine, other, forward = rate_, back = rate_;
    if (discriminant < 0) {
        const double turn = std::sqrt(-discriminant), decay = std::exp(-rate_ * time);
        sine = decay * std::sin(turn * time) / turn;
        other = decay * std::cos(turn * time);
    } else {  // two decays; the slow rate from their product, since a difference would cancel
        const double half = std::sqrt(discriminant);
        forward = rate_ + half;
        back = square_ / forward;
        sine = std::exp(-back * time) * (half > 0 ? -std::expm1(-2 * half * time) / (2 * half) : time);
        other = std::exp(-forward * time);
    }
    return {static_cast<Scalar>(other + forward * sine), static_cast<Scalar>(sine),
            static_cast<Scalar>(-square_ * sine), static_cast<Scalar>(other - back * sine)};
}

}  // namespace membrane
