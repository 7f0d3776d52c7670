// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/contact/tool.hpp>

/// Source of the tool's state and sink of the force.
///
///     membrane::ScriptedDevice<double> device({{.time = 0, .position = {0, 0, 0.012}},
///                                              {.time = 1, .position = {0, 0, 0.009}}},
///                                             {.tick = 1e-3, .radius = 1e-3});
///     while (device.running()) { const auto tool = device.read(); ...; device.write(force); }
namespace membrane {

/// A haptic device or a substitute. Each tick calls `read` once and `write` once.
template <class D, class Scalar>
concept Device = Real<Scalar> && requires(D& device, const D& idle, const Vector3<Scalar>& force) {
    { idle.running() }
    noexcept->std::same_as<bool>;
    { device.read() }
    noexcept->std::same_as<Tool<Scalar>>;
    { device.write(force) }
    noexcept->std::same_as<void>;
};

namespace detail {

template <class D, class Scalar>
consteval bool check_device() noexcept {
    static_assert(
        requires(const D& idle) {
            { idle.running() }
            noexcept->std::same_as<bool>;
        },
        "Device: running() const noexcept must return bool");
    static_assert(
        requires(D & device) {
            { device.read() }
            noexcept->std::same_as<Tool<Scalar>>;
        },
        "Device: read() noexcept must return Tool<Scalar>");
    static_assert(
        requires(D & device, const Vector3<Scalar>& force) {
            { device.write(force) }
            noexcept->std::same_as<void>;
        },
        "Device: write(const Vector3<Scalar>& force) noexcept must return void");
    return Device<D, Scalar>;
}

}  // namespace detail

/// A `Device`. If a requirement is missing, the compile error names it.
template <class D, class Scalar>
concept CheckedDevice = detail::check_device<D, Scalar>();

/// Position of a scripted tool at a time.
template <Real Scalar>
struct Waypoint {
    Scalar time = 0;                                     ///< [s]
    Vector3<Scalar> position = Vector3<Scalar>::Zero();  ///< [m]
    bool grasping = false;                               ///< from this waypoint to the next
};
// Without these, g++ 12 rejects this type's initialiser inside another type's.
static_assert(std::is_default_constructible_v<Waypoint<float>>);
static_assert(std::is_default_constructible_v<Waypoint<double>>);

/// Options of a `ScriptedDevice`.
struct ScriptedDeviceOptions {
    double tick = 1e-3;  ///< time from one `read` to the next [s]
    double radius = 0;   ///< of the tool [m]
};

/// Model of the hand that holds the tool of a `ScriptedDevice`. `reset_to` sets a position with zero velocity.
/// `set_target` sets the present target and its velocity. `advance` advances time under a force; then `position` and
/// `velocity` hold the new state.
template <class H, class Scalar>
concept Hand = Real<Scalar> && std::copyable<H> &&
    requires(H& hand, const H& idle, const Vector3<Scalar>& vector, Scalar dt) {
    { hand.reset_to(vector) }
    noexcept;
    { hand.set_target(vector, vector) }
    noexcept;
    { hand.advance(vector, dt) }
    noexcept;
    { idle.position() }
    noexcept->std::convertible_to<Vector3<Scalar>>;
    { idle.velocity() }
    noexcept->std::convertible_to<Vector3<Scalar>>;
};

namespace detail {

template <class H, class Scalar>
consteval bool check_hand() noexcept {
    static_assert(std::copyable<H>, "Hand: must be copyable");
    static_assert(
        requires(H & hand, const Vector3<Scalar>& vector) {
            { hand.reset_to(vector) }
            noexcept;
        },
        "Hand: there must be reset_to(const Vector3<Scalar>& position) noexcept");
    static_assert(
        requires(H & hand, const Vector3<Scalar>& vector) {
            { hand.set_target(vector, vector) }
            noexcept;
        },
        "Hand: there must be set_target(const Vector3<Scalar>& target, const Vector3<Scalar>& velocity) noexcept");
    static_assert(
        requires(H & hand, const Vector3<Scalar>& vector, Scalar dt) {
            { hand.advance(vector, dt) }
            noexcept;
        },
        "Hand: there must be advance(const Vector3<Scalar>& force, Scalar dt) noexcept");
    static_assert(
        requires(const H& idle) {
            { idle.position() }
            noexcept->std::convertible_to<Vector3<Scalar>>;
        },
        "Hand: position() const noexcept must give a Vector3<Scalar>");
    static_assert(
        requires(const H& idle) {
            { idle.velocity() }
            noexcept->std::convertible_to<Vector3<Scalar>>;
        },
        "Hand: velocity() const noexcept must give a Vector3<Scalar>");
    return Hand<H, Scalar>;
}

}  // namespace detail

/// A `Hand`. If a requirement is missing, the compile error names it.
template <class H, class Scalar>
concept CheckedHand = detail::check_hand<H, Scalar>();

/// Follows its target exactly, whatever the force. A compliant hand is a `SimulatedHand`.
template <Real Scalar>
class IdealHand {
  public:
    /// At `position` [m], at rest.
    void reset_to(const Vector3<Scalar>& position) noexcept { set_target(position, Vector3<Scalar>::Zero()); }

    /// Is at `target` [m] with `velocity` [m/s] from now on.
    void set_target(const Vector3<Scalar>& target, const Vector3<Scalar>& velocity) noexcept {
        position_ = target;
        velocity_ = velocity;
    }

    /// Does nothing: the force does not move this hand.
    void advance(const Vector3<Scalar>& /*force*/, Scalar /*dt*/) const noexcept {}

    ///@{
    /// Position [m] and velocity [m/s] of the last target.
    [[nodiscard]] Vector3<Scalar> position() const noexcept { return position_; }
    [[nodiscard]] Vector3<Scalar> velocity() const noexcept { return velocity_; }
    ///@}

  private:
    Vector3<Scalar> position_ = Vector3<Scalar>::Zero(), velocity_ = Vector3<Scalar>::Zero();
};

static_assert(Hand<IdealHand<float>, float> && Hand<IdealHand<double>, double>);

/// A simulated device. Its tool follows a script in straight lines from waypoint to waypoint, at constant velocity on
/// each line, and ignores the force. With a compliant hand the tool follows as that hand allows: it starts at rest at
/// the first waypoint and moves in each tick under the last written force.
template <Real Scalar, CheckedHand<Scalar> Holder = IdealHand<Scalar>>
class ScriptedDevice {
  public:
    /// @throws InvalidInput if the script is empty, not finite or not ascending in time, or if an option is out of its
    /// range
    explicit ScriptedDevice(std::vector<Waypoint<Scalar>> script, const ScriptedDeviceOptions& options = {},
                            const Holder& hand = Holder());

    /// Whether the script has not ended.
    [[nodiscard]] bool running() const noexcept { return time() < script_.back().time + tick_ / 2; }

    /// The tool now; advances time by one tick. After the script's end, returns the last position.
    [[nodiscard]] Tool<Scalar> read() noexcept;

    /// Keeps `force` [N] for `force()`.
    void write(const Vector3<Scalar>& force) noexcept { force_ = force; }

    /// The last written force [N].
    [[nodiscard]] Vector3<Scalar> force() const noexcept { return force_; }

    /// Time of the next `read` [s].
    [[nodiscard]] Scalar time() const noexcept { return script_.front().time + static_cast<Scalar>(ticks_) * tick_; }

    /// Returns to the start of the script.
    void reset() noexcept {
        ticks_ = 0;
        next_ = 0;
        force_.setZero();
        hand_.reset_to(script_.front().position);
    }

  private:
    [[nodiscard]] Tool<Scalar> scripted(Scalar now) noexcept;

    std::vector<Waypoint<Scalar>> script_;
    Scalar tick_, radius_;
    std::size_t ticks_ = 0;
    std::size_t next_ = 0;  // the first waypoint later than the last `read`
    Vector3<Scalar> force_ = Vector3<Scalar>::Zero();
    Holder hand_;
};

template <Real Scalar, CheckedHand<Scalar> Holder>
ScriptedDevice<Scalar, Holder>::ScriptedDevice(std::vector<Waypoint<Scalar>> script,
                                               const ScriptedDeviceOptions& options, const Holder& hand)
    : script_(std::move(script)),
      tick_(static_cast<Scalar>(options.tick)),
      radius_(static_cast<Scalar>(options.radius)),
      hand_(hand) {
    constexpr std::string_view component = "ScriptedDevice";
    detail::check_option(component, tick_, "tick", "s", false);
    detail::check_option(component, radius_, "radius", "m");
    if (script_.empty()) refuse(component, "the script must have a waypoint, got none");
    for (std::size_t i = 0; i < script_.size(); ++i) {
        const auto& waypoint = script_[i];
        if (!is_finite(waypoint.time) || !is_finite(waypoint.position)) {
            refuse(component, "waypoint ", i, " must be finite");
        }
        if (i > 0 && !(waypoint.time > script_[i - 1].time)) {
            refuse(component, "waypoint ", i, " must come after ", script_[i - 1].time, " s, got ", waypoint.time,
                   " s");
        }
    }
    hand_.reset_to(script_.front().position);
}

template <Real Scalar, CheckedHand<Scalar> Holder>
Tool<Scalar> ScriptedDevice<Scalar, Holder>::read() noexcept {
    Tool<Scalar> tool = scripted(time());
    if (ticks_ > 0) hand_.advance(force_, tick_);
    hand_.set_target(tool.position, tool.velocity);
    ++ticks_;
    tool.position = hand_.position();
    tool.velocity = hand_.velocity();
    return tool;
}

template <Real Scalar, CheckedHand<Scalar> Holder>
Tool<Scalar> ScriptedDevice<Scalar, Holder>::scripted(Scalar now) noexcept {
    while (next_ < script_.size() && script_[next_].time <= now) ++next_;
    Tool<Scalar> tool{.radius = radius_, .time = now};
    const auto& from = script_[next_ == 0 ? 0 : next_ - 1];
    tool.position = from.position;
    tool.grasping = from.grasping;
    if (next_ == 0 || next_ == script_.size()) return tool;
    const auto& to = script_[next_];
    tool.velocity = (to.position - from.position) / (to.time - from.time);
    tool.position += (now - from.time) * tool.velocity;
    return tool;
}

}  // namespace membrane
