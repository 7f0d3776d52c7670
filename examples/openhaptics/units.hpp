// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>
#include <utility>

#include <membrane/contact/tool.hpp>
#include <membrane/core/check.hpp>
#include <membrane/core/rigid_frame.hpp>

/// Conversion between a device in millimetres and a scene in metres; force scale between a tissue and a hand.
///
///     const examples::DeviceScale scale{.force = 40, .motion = 0.1};  // the tool moves a tenth of the hand's motion
///     membrane::Tool<double> tool = scale.to_scene(examples::Millimetres(position),
///                                                  examples::MillimetresPerSecond(velocity));
///     const auto felt = scale.to_device(examples::Newtons(reaction));  // device_force, scene_force, scale
///     write(felt.device_force.value());                         // [N]
namespace examples {

/// A number or vector with its unit: units do not mix, and no conversion to a plain number is implicit.
template <class Unit, class Value>
class In {
  public:
    /// `value`, a number in this unit.
    explicit In(Value value) noexcept : value_(std::move(value)) {}

    /// The number, without its unit.
    [[nodiscard]] Value value() const noexcept { return value_; }

    ///@{
    /// Sums, multiples and comparison of one unit.
    [[nodiscard]] friend In operator+(const In& a, const In& b) noexcept { return In(a.value_ + b.value_); }
    [[nodiscard]] friend In operator-(const In& a, const In& b) noexcept { return In(a.value_ - b.value_); }
    [[nodiscard]] friend In operator*(double times, const In& a) noexcept { return In(times * a.value_); }
    [[nodiscard]] friend bool operator==(const In& a, const In& b) noexcept { return a.value_ == b.value_; }
    ///@}

  private:
    Value value_;
};

/// Names of the units, for `In`.
namespace unit {
///@{
/// A unit.
struct Metre;
struct Millimetre;
struct MetrePerSecond;
struct MillimetrePerSecond;
struct Newton;
struct NewtonPerMetre;
struct NewtonPerMillimetre;
///@}
}  // namespace unit

///@{
/// Positions, velocities, forces and stiffnesses with their units.
using Metres = In<unit::Metre, membrane::Vector3<double>>;
using Millimetres = In<unit::Millimetre, membrane::Vector3<double>>;
using MetresPerSecond = In<unit::MetrePerSecond, membrane::Vector3<double>>;
using MillimetresPerSecond = In<unit::MillimetrePerSecond, membrane::Vector3<double>>;
using Newtons = In<unit::Newton, membrane::Vector3<double>>;
using NewtonsPerMetre = In<unit::NewtonPerMetre, double>;
using NewtonsPerMillimetre = In<unit::NewtonPerMillimetre, double>;
///@}

///@{
/// The same quantity in the other unit. Correctly rounded: 1000 is exact in floating point, 0.001 is not.
[[nodiscard]] inline Metres in_metres(const Millimetres& a) noexcept { return Metres(a.value() / 1000); }
[[nodiscard]] inline Millimetres in_millimetres(const Metres& a) noexcept { return Millimetres(a.value() * 1000); }
[[nodiscard]] inline MetresPerSecond in_metres(const MillimetresPerSecond& a) noexcept {
    return MetresPerSecond(a.value() / 1000);
}
[[nodiscard]] inline MillimetresPerSecond in_millimetres(const MetresPerSecond& a) noexcept {
    return MillimetresPerSecond(a.value() * 1000);
}
[[nodiscard]] inline NewtonsPerMetre in_metres(NewtonsPerMillimetre a) noexcept {
    return NewtonsPerMetre(a.value() * 1000);
}
[[nodiscard]] inline NewtonsPerMillimetre in_millimetres(NewtonsPerMetre a) noexcept {
    return NewtonsPerMillimetre(a.value() / 1000);
}
///@}

/// A force at the device and in the scene, and the scale between them, so that neither is taken for the other.
struct FeltForce {
    Newtons device_force;  ///< the force to write, in the device's frame
    Newtons scene_force;   ///< the force of the tissue on the tool, in the scene
    double scale;          ///< device force over scene force
};

/// Scales between hand and tool. A needle perforates the lens capsule of a pig at 15 to 35 mN [Perforation16]; a
/// `force` of 30 to 100 makes 0.5 to 3.5 N of it.
struct DeviceScale {
    double force = 1;                          ///< force at the hand over force at the tissue
    double motion = 1;                         ///< motion of the tool over motion of the hand
    membrane::RigidFrame<double> device = {};  ///< the fixed frame of the device in the scene; origin in its metres

    /// @throws `InvalidInput` if a scale is not finite and positive
    void validate() const;

    ///@{
    /// From the device to the scene: scaled by `motion`, then transformed by `device`.
    [[nodiscard]] Metres to_scene(const Millimetres& position) const noexcept {
        return Metres(device.point_to_world(motion * in_metres(position).value()));
    }
    [[nodiscard]] MetresPerSecond to_scene(const MillimetresPerSecond& velocity) const noexcept {
        return MetresPerSecond(device.vector_to_world(motion * in_metres(velocity).value()));
    }
    ///@}

    /// The tool of the scene; the caller sets radius, axis, time and grasping.
    [[nodiscard]] membrane::Tool<double> to_scene(const Millimetres& position,
                                                  const MillimetresPerSecond& velocity) const noexcept {
        membrane::Tool<double> tool;
        tool.position = to_scene(position).value();
        tool.velocity = to_scene(velocity).value();
        return tool;
    }

    /// From the scene to the device: scaled by `force`, then rotated into the frame of `device`.
    [[nodiscard]] FeltForce to_device(const Newtons& scene_force) const noexcept {
        return {Newtons(device.vector_to_body(force * scene_force.value())), scene_force, force};
    }

    /// The stiffness of a tissue at the device, for `passivity`.
    [[nodiscard]] NewtonsPerMetre at_device(NewtonsPerMetre tissue) const noexcept {
        return NewtonsPerMetre(force * motion * tissue.value());
    }
};

inline void DeviceScale::validate() const {
    const auto check_scale = [](double value, std::string_view field) {
        if (!membrane::is_finite(value) || !(value > 0)) {
            membrane::refuse("DeviceScale", field, " must be finite and positive, got ", value);
        }
    };
    check_scale(force, "force");
    check_scale(motion, "motion");
    if (!membrane::is_finite(device.rotation) || !membrane::is_finite(device.origin)) {
        membrane::refuse("DeviceScale", "device must be finite");
    }
}

}  // namespace examples
