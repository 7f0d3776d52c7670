// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

#include <membrane/haptics/device_profile.hpp>

/// Last stage before the device: limits a policy's force to what hand and device can bear.
///
///     auto limit = membrane::ForceLimiter(membrane::devices::touch);
///     device.write(limit(feel({tool, contact, report}), tool.time, solves));   // [N], [s], number of solves
namespace membrane {

/// Slew limit, soft start, watchdog and thermal limit are on by default, and each can be disabled. The peak limit and
/// the check for faults are always on.
struct LimitOptions {
    double rise_time = 0.02;      ///< shortest time of a rise from zero to the peak force [s]; 0: no slew limit
    double soft_start = 0.1;      ///< from zero to the full force, after start, fault, old state [s]; 0: at once
    double max_state_age = 0.04;  ///< largest age of the solver's state [s]; infinity: no watchdog
    double fade_time = 0.05;      ///< time in which the force of an older state fades to zero [s]
    /// Longest tick in which the force may rise [s]. In a longer tick the force rises as in one of this length, but
    /// watchdog and motors count the whole tick. In a tick that is not positive the force does not rise; watchdog and
    /// motors count this length.
    double max_tick = 2e-3;
    bool thermal_limit = true;  ///< whether hot motors are limited to the continuous force

    /// @throws InvalidInput if an option is out of its range
    void validate() const;
};

/// Limits that reduced the force of this tick.
struct ActiveLimits {
    bool fault = false;  ///< force or time was not finite: the force is zero
    bool faded = false;  ///< old state, or soft start after an old state, a fault or the start
    bool peak = false;   ///< peak force of the device
    bool heat = false;   ///< thermal limit of its motors
    bool slew = false;   ///< rate of change of the force

    /// Whether at least one limit changed the force.
    [[nodiscard]] bool any() const noexcept { return fault || faded || peak || heat || slew; }
};

/// Factor on the force by the age of the solver's state: 1 up to `max_state_age`, then down to 0 in `fade_time`.
class Watchdog {
  public:
    /// Both in seconds.
    Watchdog(double max_state_age, double fade_time) noexcept : max_state_age_(max_state_age), fade_time_(fade_time) {}

    /// `state`: a number that changes with each solve; `dt` since the last call [s].
    double update(std::uint64_t state, double dt) noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.age_, self.state_);
    }

  private:
    double max_state_age_, fade_time_;
    double age_ = 0;
    std::uint64_t state_ = 0;
};

/// Factor on the force: falls to the allowed value at once and rises to it slowly.
class SoftStart {
  public:
    /// `time`: from 0 to 1 [s].
    explicit SoftStart(double time) noexcept : time_(time) {}

    /// The factor after `dt` [s], at most `allowed`.
    double update(double allowed, double dt) noexcept;

    /// The last factor, 0 to 1.
    [[nodiscard]] double gain() const noexcept { return gain_; }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.gain_);
    }

  private:
    double time_;
    double gain_ = 0;
};

/// Thermal load of a motor, relative to its final value under the continuous force. Heating is proportional to the
/// square of the force, cooling to the load. From 0.75 on the allowed force falls below the peak, from 1 on it is the
/// continuous force. So the load does not exceed 1 if ticks are short compared with `thermal_time` (for the stock
/// devices, up to 40 ms). In a longer gap the device holds a force that was chosen for a short tick: then the load can
/// rise up to the square of peak over continuous force.
class MotorThermalModel {
  public:
    /// Cold motors.
    explicit MotorThermalModel(const DeviceProfile& device) noexcept
        : peak_(device.peak_force), continuous_(device.continuous_force), time_(device.thermal_time) {}

    /// Adds a `force` [N] held for `dt` [s].
    void add(double force, double dt) noexcept;

    /// 0 cold, 1 the final value under the continuous force.
    [[nodiscard]] double thermal_load() const noexcept { return thermal_load_; }

    /// Largest force that the load allows [N]: the peak force up to a load of 0.75, from there falling linearly to the
    /// continuous force at a load of 1.
    [[nodiscard]] double max_force() const noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.thermal_load_);
    }

  private:
    double peak_, continuous_, time_;
    double thermal_load_ = 0;
};

/// Limits a force for a device, in a fixed order:
/// 1. fault: a force that is not finite becomes zero, since the later limits compute with it;
/// 2. watchdog and soft start: a factor on the requested force, as that force itself may be wrong;
/// 3. peak and heat: the limits of the device, on the scaled force;
/// 4. slew: the last force is first scaled down to the projection of the requested force on it, or to zero if the
///    request reverses it. This fall is not bounded. The force then moves towards the request. Its distance from the
///    last force stays within the bound, unless the fall alone exceeds it.
///
/// No limit increases the force, so no limit undoes an earlier one. The first three keep its direction. The slew limit
/// lags behind a force that turns too fast, but never opposes it: with input f and output g, g . f >= |g|^2. If no
/// limit acts, the force is returned bit for bit.
///
/// The result of `passivity` holds while no limit acts. The slew limit delays a fast rise, so a fast push may generate
/// energy: above a speed of peak force / rise time / rendered stiffness, 1.65 m/s for `devices::touch` at 100 N/m.
///
/// With default options the force is zero at most 90 ms and one tick after the solver has stopped. It is full again
/// 0.1 s after a fault has ended, if the motors are not hot and no tick is longer than `max_tick`.
///
/// Use the tool's time: a recording contains it, so a replay gives the same forces bit for bit, and a script that runs
/// faster than real time is limited in its own time. If no replay is needed, a steady clock is suitable too. The time
/// of a `Tool<float>` is accurate to 0.1 ms for 15 minutes; count from the start of the run.
///
/// If the time stands still or goes back, watchdog and motors count a tick of `max_tick`. With the slew limit on, the
/// force may then only fall: if the time never advances, it stays zero. A jump ahead counts as a gap in which the last
/// force was held: the motors count as heated by this force for the whole gap.
class ForceLimiter {
  public:
    /// @throws InvalidInput if a number of the profile or an option is out of its range
    explicit ForceLimiter(const DeviceProfile& device, const LimitOptions& options = {});

    /// The force to write [N]. `now`: the tool's time [s]; `state`: a number that changes with each solve, such as the
    /// number of solves. Call once per tick: watchdog and motors count the time between calls.
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> operator()(const Vector3<Scalar>& force, double now, std::uint64_t state) noexcept;

    /// Limits that reduced the last force.
    [[nodiscard]] ActiveLimits active_limits() const noexcept { return active_limits_; }
    /// Thermal load of the motors: 0 cold, 1 the final value under the continuous force; see `MotorThermalModel`.
    [[nodiscard]] double thermal_load() const noexcept { return heat_.thermal_load(); }
    /// Factor of watchdog and soft start on the force, 0 to 1.
    [[nodiscard]] double gain() const noexcept { return soft_start_.gain(); }

    /// The device whose limits apply.
    [[nodiscard]] const DeviceProfile& device() const& noexcept { return device_; }
    [[nodiscard]] DeviceProfile device() && noexcept { return device_; }

    /// As new, except for the thermal load. For a replay construct a new limiter.
    void reset() noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.watchdog_, self.soft_start_, self.heat_, self.active_limits_, self.began_, self.time_, self.force_);
    }

  private:
    double time_since_last(double now) noexcept;

    DeviceProfile device_;
    LimitOptions options_;
    double slew_;  // [N/s]
    Watchdog watchdog_;
    SoftStart soft_start_;
    MotorThermalModel heat_;
    ActiveLimits active_limits_;
    bool began_ = false;
    double time_ = 0;
    Vector3<double> force_ = Vector3<double>::Zero();  // last force [N]
};

namespace detail {

/// `force`, shortened to the length `max_length`. If it is not longer, returns it bit for bit.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> shortened(const Vector3<Scalar>& force, double max_length) noexcept {
    Vector3<double> exact = force.template cast<double>();
    const double largest = exact.cwiseAbs().maxCoeff();
    if (largest > max_length) exact *= max_length / largest;  // so that squares do not overflow
    const double length = norm(exact);
    if (largest <= max_length && length <= max_length) return force;
    // Rounding must not exceed the limit.
    constexpr double rounding = 4 * static_cast<double>(std::numeric_limits<Scalar>::epsilon());
    if (!(length > 0)) return Vector3<Scalar>::Zero();
    return (exact * (max_length * (1 - rounding) / length)).template cast<Scalar>();
}

/// The next force after `last` towards `wanted`, with a change of at most `max_length`. First `last` is scaled down to
/// the projection of `wanted` on it, or to zero if that is negative. The force then moves towards `wanted`. So the
/// result is either `last` scaled down, or at most `max_length` from it. It is not larger than `wanted` and never
/// opposes it.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> slewed(const Vector3<Scalar>& wanted, const Vector3<double>& last,
                                     double max_length) noexcept {
    const Vector3<double> goal = wanted.template cast<double>();
    const double square = squared_norm(last);
    const double kept = square > 0 ? std::clamp(dot(goal, last) / square, 0.0, 1.0) : 0;
    const Vector3<double> fallen = kept * last, fall = last - fallen, change = goal - fallen;
    const double length = norm(change);
    if (!(length > 0)) return wanted;
    // Rounding must not exceed the limit, nor turn a fall into a change of direction.
    const double rounding =
        4 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * (max_length + std::sqrt(square));
    const double max_change = (std::max)(max_length - 2 * rounding, 0.0);
    // Length along `change` within a sphere of this radius around `last`; 0 if the fall has left the sphere.
    const double back = kept > 0 ? 0 : dot(fall, change) / length;  // if kept > 0, fall is 0 or orthogonal to change
    const double left = (std::max)(max_change * max_change - squared_norm(fall), 0.0);
    const double step = (std::max)(back + std::sqrt(left + back * back), 0.0);
    if (length <= step + rounding) return wanted;
    return shortened<Scalar>((fallen + step / length * change).template cast<Scalar>(), norm(goal));
}

}  // namespace detail

inline void LimitOptions::validate() const {
    constexpr std::string_view component = "ForceLimiter";
    detail::check_option(component, rise_time, "rise_time", "s");
    detail::check_option(component, soft_start, "soft_start", "s");
    detail::check_option(component, fade_time, "fade_time", "s");
    detail::check_option(component, max_tick, "max_tick", "s", false);
    if (!(is_finite(max_state_age) ? max_state_age > 0 : max_state_age == std::numeric_limits<double>::infinity())) {
        refuse(component, "max_state_age must be positive [s], got ", max_state_age);
    }
}

inline double Watchdog::update(std::uint64_t state, double dt) noexcept {
    age_ = state == state_ ? age_ + dt : 0;
    state_ = state;
    if (age_ <= max_state_age_) return 1;
    return age_ < max_state_age_ + fade_time_ ? 1 - (age_ - max_state_age_) / fade_time_ : 0;
}

inline double SoftStart::update(double allowed, double dt) noexcept {
    const double risen = dt < time_ ? gain_ + dt / time_ : 1.0;
    gain_ = (std::min)({allowed, risen, 1.0});
    return gain_;
}

inline void MotorThermalModel::add(double force, double dt) noexcept {
    constexpr double long_enough = 1e3;  // ratio beyond which the past has no effect
    const double time = dt / long_enough < time_ ? dt / time_ : long_enough;
    const double left =
        1 / (1 + time * (1 + time * (0.5 + time / 6)));  // close to exp(-time), with the same bits on all machines
    const double relative = force / continuous_;
    thermal_load_ = left * thermal_load_ + (1 - left) * (relative * relative);  // a weighted mean for any time
}

inline double MotorThermalModel::max_force() const noexcept {
    constexpr double warm = 0.75;
    const double reserve = std::clamp((1 - thermal_load_) / (1 - warm), 0.0, 1.0);
    return continuous_ + reserve * (peak_ - continuous_);
}

inline ForceLimiter::ForceLimiter(const DeviceProfile& device, const LimitOptions& options)
    : device_((device.validate(), device)),
      options_((options.validate(), options)),
      slew_(options.rise_time > 0 ? device.peak_force / options.rise_time : 0),
      watchdog_(options.max_state_age, options.fade_time),
      soft_start_(options.soft_start),
      heat_(device) {}

inline double ForceLimiter::time_since_last(double now) noexcept {
    const double dt = began_ ? now - time_ : 0;
    time_ = now;
    began_ = true;
    return dt;
}

template <Real Scalar>
Vector3<Scalar> ForceLimiter::operator()(const Vector3<Scalar>& force, double now, std::uint64_t state) noexcept {
    active_limits_ = {};
    active_limits_.fault = !is_finite(force) || !is_finite(now);
    const double dt = is_finite(now) ? time_since_last(now) : 0;
    // If the time stands still or goes back, the watchdog still counts and no force grows.
    const double passed = dt > 0 && is_finite(dt) ? dt : options_.max_tick;
    const double growing = std::clamp(dt, 0.0, options_.max_tick);
    heat_.add(norm(force_), passed);

    const double fresh = watchdog_.update(state, passed);
    const double gain = soft_start_.update(active_limits_.fault ? 0.0 : fresh, growing);
    if (active_limits_.fault) {
        force_.setZero();
        return Vector3<Scalar>::Zero();
    }
    active_limits_.faded = gain < 1;
    Vector3<Scalar> felt = active_limits_.faded ? Vector3<Scalar>(static_cast<Scalar>(gain) * force) : force;

    const auto change_to = [&felt](const Vector3<Scalar>& limited) {
        const bool acts = limited != felt;
        felt = limited;
        return acts;
    };
    active_limits_.peak = change_to(detail::shortened(felt, device_.peak_force));
    active_limits_.heat = options_.thermal_limit && change_to(detail::shortened(felt, heat_.max_force()));
    active_limits_.slew = slew_ > 0 && change_to(detail::slewed(felt, force_, slew_ * growing));
    force_ = felt.template cast<double>();
    return felt;
}

inline void ForceLimiter::reset() noexcept {
    watchdog_ = Watchdog(options_.max_state_age, options_.fade_time);
    soft_start_ = SoftStart(options_.soft_start);
    active_limits_ = {};
    began_ = false;
    force_.setZero();
}

}  // namespace membrane
