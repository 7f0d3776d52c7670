// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <membrane/contact/tool.hpp>
#include <membrane/haptics/device_profile.hpp>
#include <membrane/haptics/force_limits.hpp>

#include "openhaptics/servo_report.hpp"
#include "openhaptics/units.hpp"

namespace examples {

struct OpenHapticsOptions {
    std::string name = {};               ///< Of the device in the vendor's set-up; if empty, the default device.
    DeviceScale scale = {};              ///< How hand and scene correspond.
    double radius = 0;                   ///< Of the tool [m].
    double shaft = 0;                    ///< Of the tool, from the tip along the stylus [m]; zero for a sphere.
    membrane::LimitOptions limits = {};  ///< All are on; each can be taken off.
    membrane::DeviceProfile profile =
        membrane::devices::touch;  ///< Default: the one with the lowest forces of the family.
};

/// Result of the body of the loop.
struct Answer {
    membrane::Vector3<double> force;  ///< On the tool, in the scene [N].
    std::uint64_t solves;             ///< A number that changes with each solve; if it stops changing, the force fades.
};

/// A device of the OpenHaptics family (Touch, Omni, Desktop, Premium). Its own thread calls back, a thousand times a
/// second, with the tool of the scene, in metres, and gets the force on it, in newtons:
///
///     OpenHapticsDevice<VendorHd> device({.scale = {.motion = 0.1}, .radius = 1e-3});
///     device.start([&](const membrane::Tool<double>& tool) { ...; return Answer{force, solves}; });  // a loop's body
///     while (device.running()) { draw(); }
///     device.stop();
///     if (!device.trouble().empty()) { ... }                                            // may be started again
///
/// Written forces have passed the library's limits, with the profile narrowed to the forces that the device reports. By
/// the vendor's kinds of errors:
///   - motors too warm, too much force or speed: the device recovers by itself. The force is zero at once and while the
///     error lasts; then it rises in 0.1 s.
///   - any other, such as a lost connection, or an exception of the callback: the run ends, without force, and
///     `trouble` describes the error.
/// The device's own frame is x to the right, y up, z towards the user. One device for each program: the vendor's
/// scheduler supports no more. Until the callback returns the device holds its force: it must return within 1 ms.
///
/// `Hd` is `VendorHd` or a test double. Only start and stop call it outside the device's own thread.
template <class Hd>
class OpenHapticsDevice {
  public:
    using Tool = membrane::Tool<double>;
    using Tick = std::function<Answer(const Tool&)>;

    /// @throws InvalidInput for an option out of its range
    explicit OpenHapticsDevice(OpenHapticsOptions options = {});
    ~OpenHapticsDevice() { stop(); }
    OpenHapticsDevice(const OpenHapticsDevice&) = delete;
    OpenHapticsDevice& operator=(const OpenHapticsDevice&) = delete;

    /// Opens the device and calls `tick` from now on. A second start keeps the thermal load of the motors.
    /// @throws std::runtime_error that names the failed step and its error; everything is closed again
    void start(Tick tick);

    /// Zero force, then scheduler, callback and device, in this order. Not from within a tick, which ends by throwing.
    void stop() noexcept;

    /// Whether it was started and is neither stopped nor in trouble. From any thread.
    [[nodiscard]] bool running() const noexcept { return started_ && !failed_; }
    /// The error that suspends the force at present; null if there is none. From any thread.
    [[nodiscard]] const char* warning() const noexcept { return warning_; }

    /// Between `stop` and the next start: the error of the device or of the callback, empty if there was none.
    [[nodiscard]] std::string trouble() const;
    /// Between `stop` and the next start: the report of the ticks.
    [[nodiscard]] const ServoReport& report() const noexcept { return report_; }
    /// The profile, narrowed to the device after the first start.
    [[nodiscard]] const membrane::DeviceProfile& profile() const noexcept { return limiter_.device(); }

    /// One tick, called by the scheduler; returns false after the last.
    bool servo() noexcept;

  private:
    using Force = membrane::Vector3<double>;

    void need(bool well, const char* step);
    void narrow(double peak, double continuous);
    [[nodiscard]] Tool read(double now) noexcept;
    [[nodiscard]] Force compute_force(const Tool& tool) noexcept;
    void write(const Force& force) noexcept;
    bool take_errors() noexcept;
    static void forget_errors() noexcept;
    void release() noexcept;
    void close() noexcept;

    OpenHapticsOptions options_;
    typename Hd::Device device_ = Hd::no_device;
    typename Hd::Schedule schedule_ = Hd::not_scheduled;
    bool scheduling_ = false;

    std::atomic<bool> started_{false};
    std::atomic<bool> failed_{false};    // an error or an exception: the next force is zero and the last
    std::atomic<bool> stopping_{false};  // on request: the next force is zero and the last
    std::atomic<bool> ended_{false};     // the last zero force has been written
    std::atomic<const char*> warning_{nullptr};

    Tick tick_;  // this and all below: of the device's own thread, while it runs
    membrane::ForceLimiter limiter_;
    ServoReport report_;
    std::uint64_t solves_ = 0;
    double first_ = 0, last_ = 0;  // [s]
    bool grasping_ = false;
    bool held_ = false;  // a temporary error occurred since the last force
    unsigned error_ = 0;
    const char* error_text_ = "";
    std::exception_ptr exception_;
};

namespace detail {

inline constexpr int max_errors = 100;  // taken from the stack at most
inline constexpr int patience = 100;    // ticks that `stop` waits for the last one

}  // namespace detail

template <class Hd>
OpenHapticsDevice<Hd>::OpenHapticsDevice(OpenHapticsOptions options)
    : options_(std::move(options)), limiter_(options_.profile, options_.limits) {
    options_.scale.validate();
    membrane::detail::check_option("OpenHapticsDevice", options_.radius, "radius", "m");
    membrane::detail::check_option("OpenHapticsDevice", options_.shaft, "shaft", "m");
}

template <class Hd>
void OpenHapticsDevice<Hd>::start(Tick tick) {
    if (device_ != Hd::no_device) throw std::runtime_error("OpenHapticsDevice: must be stopped to be started");
    forget_errors();  // of earlier calls
    tick_ = std::move(tick);
    report_ = {};
    error_ = 0;
    exception_ = nullptr;
    grasping_ = held_ = failed_ = stopping_ = ended_ = false;

    device_ = Hd::open(options_.name.empty() ? nullptr : options_.name.c_str());
    need(device_ != Hd::no_device, "open the device");
    Hd::select(device_);
    need(true, "select the device");
    need(Hd::calibrated(), "go on: the device must be calibrated (the vendor's set-up does that)");
    const double peak = Hd::peak_force(), continuous = Hd::continuous_force();
    const auto is_force = [](double force) { return membrane::is_finite(force) && force > 0; };
    need(is_force(peak) && is_force(continuous), "learn the forces that the device bears");
    narrow(peak, continuous);
    Hd::enable_force();
    need(true, "enable forces");
    schedule_ = Hd::template schedule<OpenHapticsDevice>(this);
    need(schedule_ != Hd::not_scheduled, "schedule the callback");
    scheduling_ = true;
    Hd::start_scheduler();
    need(true, "start the scheduler");
    started_ = true;
}

/// If the last step failed or left an error, closes the device and throws.
template <class Hd>
void OpenHapticsDevice<Hd>::need(bool well, const char* step) {
    const unsigned error = Hd::take_error();
    if (well && error == 0) return;
    std::string message = std::string("OpenHapticsDevice: cannot ") + step;
    if (error != 0) message += std::string(": ") + Hd::text_of(error);
    stopping_ = true;
    close();
    throw std::runtime_error(message);
}

template <class Hd>
void OpenHapticsDevice<Hd>::narrow(double peak, double continuous) {
    auto profile = options_.profile;
    profile.peak_force = std::min(profile.peak_force, peak);
    profile.continuous_force = std::min({profile.continuous_force, continuous, profile.peak_force});
    const auto& known = limiter_.device();
    if (profile.peak_force == known.peak_force && profile.continuous_force == known.continuous_force) {
        limiter_.reset();
    } else {
        limiter_ = membrane::ForceLimiter(profile, options_.limits);
    }
}

template <class Hd>
void OpenHapticsDevice<Hd>::stop() noexcept {
    if (device_ == Hd::no_device) return;
    stopping_ = true;
    for (int i = 0; i < detail::patience && !ended_; ++i) Hd::wait();
    close();
}

template <class Hd>
void OpenHapticsDevice<Hd>::close() noexcept {
    started_ = false;
    if (scheduling_) Hd::stop_scheduler();
    if (scheduling_ && !ended_) release();  // the device's own thread ended without it
    if (schedule_ != Hd::not_scheduled) Hd::unschedule(schedule_);
    if (device_ != Hd::no_device) Hd::close(device_);
    forget_errors();
    scheduling_ = false;
    schedule_ = Hd::not_scheduled;
    device_ = Hd::no_device;
    warning_ = nullptr;
}

template <class Hd>
void OpenHapticsDevice<Hd>::release() noexcept {
    Hd::begin_frame(device_);
    write(Force::Zero());
    Hd::end_frame(device_);
}

template <class Hd>
bool OpenHapticsDevice<Hd>::servo() noexcept {
    const double now = Hd::seconds();
    if (report_.ticks == 0) first_ = last_ = now;
    report_.begin_tick(now - last_);
    last_ = now;
    Hd::begin_frame(device_);
    const Tool tool = read(now - first_);
    take_errors();
    Force force = Force::Zero();
    if (!failed_ && !stopping_) force = compute_force(tool);
    const bool over = failed_ || stopping_;
    write(over ? Force::Zero() : force);
    Hd::end_frame(device_);
    take_errors();  // these act on the force of the next tick
    report_.max_tick = std::max(report_.max_tick, Hd::seconds() - now);
    if (over) ended_ = true;
    return !over;
}

template <class Hd>
membrane::Tool<double> OpenHapticsDevice<Hd>::read(double now) noexcept {
    Tool tool = options_.scale.to_scene(Hd::position(), Hd::velocity());
    if (options_.shaft > 0) tool.axis = options_.scale.device.vector_to_world(options_.shaft * Hd::stylus());
    tool.radius = options_.radius;
    tool.time = now;
    tool.grasping = grasping_ = Hd::button(grasping_);
    report_.hottest_motor = std::max(report_.hottest_motor, Hd::temperature());
    return tool;
}

template <class Hd>
typename OpenHapticsDevice<Hd>::Force OpenHapticsDevice<Hd>::compute_force(const Tool& tool) noexcept {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();  // after a NaN the limiter ramps up
    Force force(none, none, none);
    if (is_valid(tool)) {
        try {
            const Answer result = tick_(tool);
            force = options_.scale.to_device(Newtons(result.force)).device_force.value();
            solves_ = result.solves;
        } catch (...) {
            exception_ = std::current_exception();
            failed_ = true;
        }
    }
    const bool held = std::exchange(held_, false);
    if (held) force = Force::Constant(none);
    if (!held) warning_ = nullptr;
    force = limiter_(force, tool.time, solves_);
    report_.count(limiter_.active_limits(), held);
    return force;
}

template <class Hd>
void OpenHapticsDevice<Hd>::write(const Force& force) noexcept {
    Hd::set_force(Newtons(force));
    if (take_errors()) {
        Hd::set_force(Newtons(Force::Zero()));
    } else {
        report_.max_force = std::max(report_.max_force, membrane::norm<double>(force));
    }
}

/// Takes all errors off the stack; returns whether there were any.
template <class Hd>
bool OpenHapticsDevice<Hd>::take_errors() noexcept {
    int found = 0;
    for (; found < detail::max_errors; ++found) {
        const unsigned error = Hd::take_error();
        if (error == 0) break;
        if (Hd::passes(error)) {
            held_ = true;
            warning_ = report_.last_error = Hd::text_of(error);
        } else {
            if (error_ == 0) error_text_ = Hd::text_of(error_ = error);
            failed_ = true;
        }
    }
    return found > 0;
}

template <class Hd>
void OpenHapticsDevice<Hd>::forget_errors() noexcept {
    int left = detail::max_errors;
    while (left > 0 && Hd::take_error() != 0) --left;
}

template <class Hd>
std::string OpenHapticsDevice<Hd>::trouble() const {
    if (exception_) {
        try {
            std::rethrow_exception(exception_);
        } catch (const std::exception& thrown) {
            return thrown.what();
        } catch (...) {
            return "the callback threw what is no std::exception";
        }
    }
    if (error_ == 0) return "";
    char code[16];
    std::snprintf(code, sizeof code, "0x%04x", error_);
    return std::string("HD error ") + code + ": " + error_text_;
}

}  // namespace examples
