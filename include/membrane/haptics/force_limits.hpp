// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include <membrane/haptics/device_profile.hpp>

/// The last thing before the device: whatever a policy asks for, the hand gets what it and the device bear.
///
///     auto limit = membrane::ForceLimiter(membrane::devices::touch);
///     device.write(limit(feel({tool, contact, report}), tool.time, solves));   // [N], [s], how many solves there were
namespace membrane {

/// All limits are on; each can be taken off.
struct LimitOptions {
    double rise_time = 0.02;  ///< for a change of the force by the peak force, at the quickest [s]; 0: no slew limit
    double soft_start = 0.1;  ///< from nothing to the whole force, at first and after a fault [s]; 0: at once
    double max_state_age = 0.04;  ///< a state of the solver may be this old [s]; infinity: no watchdog
    double fade_time = 0.05;      ///< and then the force fades to zero in this time [s]
    double max_tick = 2e-3;       ///< a force grows as if no tick had been longer [s]
    bool heating = true;          ///< whether motors that grow hot get no more than the continuous force

    /// @throws InvalidInput for an option out of its range
    void check() const;
};

/// Which limits have made the force of this tick smaller.
struct ActiveLimits {
    bool fault = false;  ///< force or clock was not finite: no force
    bool faded = false;  ///< the state is old, or the force still comes in after that, a fault or the start
    bool peak = false;   ///< of the device
    bool heat = false;   ///< of its motors
    bool slew = false;   ///< the force may not change that fast

    [[nodiscard]] bool any() const noexcept { return fault || faded || peak || heat || slew; }
};

/// How much of the force an old state of the solver is good for: 1 while it is fresh, then down to 0.
class Watchdog {
  public:
    Watchdog(double max_state_age, double fade_time) noexcept : fresh_for_(max_state_age), fade_time_(fade_time) {}

    /// `state`: a number that the solver changes with each solve; `dt` since the last call [s].
    double update(std::uint64_t state, double dt) noexcept;

  private:
    double fresh_for_, fade_time_;
    double age_ = 0;
    std::uint64_t state_ = 0;
};

/// What share of the force comes through: falls at once to what is allowed, and rises to it slowly.
class SoftStart {
  public:
    explicit SoftStart(double time) noexcept : time_(time) {}

    double update(double allowed, double dt) noexcept;
    [[nodiscard]] double share() const noexcept { return share_; }

  private:
    double time_;
    double share_ = 0;
};

/// Warmth of a motor: what it takes up goes with the square of the force, what it gives off with its warmth. In parts of
/// what the continuous force comes to in the end. From three quarters on less than the peak is allowed, from 1 on the
/// continuous force. So 1 is not passed where ticks are short beside `thermal_time` (for the stock devices, up to 40 ms).
/// In a longer gap the device goes on with a force that was chosen for a short tick: then it can be more, up to the
/// square of peak over continuous force.
class MotorThermalModel {
  public:
    explicit MotorThermalModel(const DeviceProfile& device) noexcept
        : peak_(device.peak_force), continuous_(device.continuous_force), time_(device.thermal_time) {}

    /// `force` was held for `dt` [N], [s].
    void add(double force, double dt) noexcept;
    [[nodiscard]] double thermal_load() const noexcept { return warmth_; }
    [[nodiscard]] double max_force() const noexcept;

  private:
    double peak_, continuous_, time_;
    double warmth_ = 0;
};

/// Makes a force fit for a device. The order is fixed:
/// 1. not a number, no force: everything after reckons with it;
/// 2. watchdog and soft start: a share of what is asked for, since they doubt the force itself;
/// 3. peak and heat: of that share, what the device bears;
/// 4. slew last: against what the device really got a tick ago. From there the force falls straight towards zero, at
///    once, as far as less of it is asked for; any other change is bounded, of its direction too: one that turns about
///    goes through zero.
/// None makes the force larger, so none undoes the one before. The first three do not turn it; the slew limit lets it come
/// after one that turns too fast, but never against it: with f for what is asked for and g for what comes out,
/// g . f >= |g|^2. A force that all of them let pass comes out with the same bits.
///
/// What `passivity` says of a force holds while no limit acts. The slew limit keeps back what comes in too fast, so that a
/// hand that jabs gets more back than it brought: above a speed of peak force / rise time / stiffness, 1.65 m/s for a
/// Touch that shows 100 N/m.
///
/// With the options as they are a force is at zero 90 ms and at most a tick after the solver has stopped, and whole again
/// 0.1 s after a fault is over (as far as motors are not hot).
///
/// The time is the tool's: a recording has it, so that a replay gets the same forces to the bit, and a script that runs
/// faster than a clock has the limits of its own time. A steady clock does as well where no replay is wanted. In `float`
/// a time is good to a tenth of a millisecond for a quarter of an hour; count from the start of the run.
///
/// A time that stands still or goes back counts as a tick of the longest length for watchdog and motors, and lets no
/// force change but towards zero: a device that gives no time gets no force. One that leaps ahead counts as a gap in which
/// the last force was held: after a wild reading motors are taken for as hot as that, until they have cooled down.
class ForceLimiter {
  public:
    /// @throws InvalidInput for a profile or an option out of its range
    explicit ForceLimiter(const DeviceProfile& device, const LimitOptions& options = {});

    /// The force to write [N]. `now`: the tool's time [s]; `state`: a number that the solver changes with each solve,
    /// such as how many there were. Call it in each tick: the time in between counts for watchdog and motors.
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> operator()(const Vector3<Scalar>& force, double now, std::uint64_t state) noexcept;

    /// What limited the last force.
    [[nodiscard]] const ActiveLimits& acted() const noexcept { return acted_; }
    /// Of the motors: 0 cold, 1 what the continuous force comes to; see `MotorThermalModel`.
    [[nodiscard]] double thermal_load() const noexcept { return heat_.thermal_load(); }
    /// Of the force that came through watchdog and soft start, 0 to 1.
    [[nodiscard]] double share() const noexcept { return soft_start_.share(); }
    [[nodiscard]] const DeviceProfile& device() const noexcept { return device_; }

    /// As new, but for the heat. For a replay take a new one.
    void reset() noexcept;

  private:
    double time_since_last(double now) noexcept;

    DeviceProfile device_;
    LimitOptions options_;
    double slew_;  // [N/s]
    Watchdog watchdog_;
    SoftStart soft_start_;
    MotorThermalModel heat_;
    ActiveLimits acted_;
    bool began_ = false;
    double time_ = 0;
    Vector3<double> force_ = Vector3<double>::Zero();  // the last one [N]
};

namespace detail {

/// `force`, no longer than `most`; with the same bits if it is not.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> shortened(const Vector3<Scalar>& force, double most) noexcept {
    Vector3<double> exact = force.template cast<double>();
    const double largest = exact.cwiseAbs().maxCoeff();
    if (largest > most) exact *= most / largest;  // the squares of what is left do not overflow
    const double length = norm(exact);
    if (largest <= most && length <= most) return force;
    // Rounding must not lead beyond it.
    constexpr double a_little = 4 * static_cast<double>(std::numeric_limits<Scalar>::epsilon());
    if (!(length > 0)) return Vector3<Scalar>::Zero();
    return (exact * (most * (1 - a_little) / length)).template cast<Scalar>();
}

/// The force after `last` for a hand that is to get `wanted`: `last`, fallen straight towards zero as far as `wanted` has
/// less of it, and from there towards `wanted` by what is then left of a change of `most`. So it is either `last`
/// shortened, or no farther from it than `most`. No larger than `wanted`, and never against it.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> slewed(const Vector3<Scalar>& wanted, const Vector3<double>& last, double most) noexcept {
    const Vector3<double> goal = wanted.template cast<double>();
    const double square = squared_norm(last);
    const double kept = square > 0 ? std::clamp(dot(goal, last) / square, 0.0, 1.0) : 0;
    const Vector3<double> fallen = kept * last, fall = last - fallen, change = goal - fallen;
    const double length = norm(change);
    if (!(length > 0)) return wanted;
    // Rounding must not lead beyond it, nor turn a fall into a change of direction.
    const double rounding =
        4 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * (most + std::sqrt(square));
    const double reach = (std::max)(most - 2 * rounding, 0.0);
    // How far along `change` a sphere of this radius about `last` reaches; nowhere if the fall has left it.
    const double back = kept > 0 ? 0 : dot(fall, change) / length;  // elsewhere at right angles, or no fall
    const double left = (std::max)(reach * reach - squared_norm(fall), 0.0);
    const double step = (std::max)(back + std::sqrt(left + back * back), 0.0);
    if (length <= step + rounding) return wanted;
    return shortened<Scalar>((fallen + step / length * change).template cast<Scalar>(), norm(goal));
}

}  // namespace detail

inline void LimitOptions::check() const {
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
    if (age_ <= fresh_for_) return 1;
    return age_ < fresh_for_ + fade_time_ ? 1 - (age_ - fresh_for_) / fade_time_ : 0;
}

inline double SoftStart::update(double allowed, double dt) noexcept {
    const double risen = dt < time_ ? share_ + dt / time_ : 1.0;
    share_ = (std::min)({allowed, risen, 1.0});
    return share_;
}

inline void MotorThermalModel::add(double force, double dt) noexcept {
    constexpr double long_enough = 1e3;  // to forget what was before
    const double time = dt / long_enough < time_ ? dt / time_ : long_enough;
    const double left = 1 / (1 + time * (1 + time * (0.5 + time / 6)));  // of exp(-time), the same on all machines
    const double relative = force / continuous_;
    warmth_ = left * warmth_ + (1 - left) * (relative * relative);  // between the two, however long the time
}

inline double MotorThermalModel::max_force() const noexcept {
    constexpr double warm = 0.75;
    const double reserve = std::clamp((1 - warmth_) / (1 - warm), 0.0, 1.0);
    return continuous_ + reserve * (peak_ - continuous_);
}

inline ForceLimiter::ForceLimiter(const DeviceProfile& device, const LimitOptions& options)
    : device_((device.check(), device)),
      options_((options.check(), options)),
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
    acted_ = {};
    acted_.fault = !is_finite(force) || !is_finite(now);
    const double dt = is_finite(now) ? time_since_last(now) : 0;
    // A clock that stands still or jumps back stops no watchdog, and lets no force grow.
    const double passed = dt > 0 && is_finite(dt) ? dt : options_.max_tick;
    const double growing = std::clamp(dt, 0.0, options_.max_tick);
    heat_.add(norm(force_), passed);

    const double fresh = watchdog_.update(state, passed);
    const double share = soft_start_.update(acted_.fault ? 0.0 : fresh, growing);
    if (acted_.fault) {
        force_.setZero();
        return Vector3<Scalar>::Zero();
    }
    acted_.faded = share < 1;
    Vector3<Scalar> felt = acted_.faded ? Vector3<Scalar>(static_cast<Scalar>(share) * force) : force;

    const auto change_to = [&felt](const Vector3<Scalar>& limited) {
        const bool acts = limited != felt;
        felt = limited;
        return acts;
    };
    acted_.peak = change_to(detail::shortened(felt, device_.peak_force));
    acted_.heat = options_.heating && change_to(detail::shortened(felt, heat_.max_force()));
    acted_.slew = slew_ > 0 && change_to(detail::slewed(felt, force_, slew_ * growing));
    force_ = felt.template cast<double>();
    return felt;
}

inline void ForceLimiter::reset() noexcept {
    watchdog_ = Watchdog(options_.max_state_age, options_.fade_time);
    soft_start_ = SoftStart(options_.soft_start);
    acted_ = {};
    began_ = false;
    force_.setZero();
}

}  // namespace membrane
