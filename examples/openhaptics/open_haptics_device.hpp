// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include <membrane/collision/tool.hpp>

namespace examples {

struct OpenHapticsOptions {
    std::string name = {};  ///< Of the device, as the vendor's set-up knows it; empty for the default one.
    double scale = 1;       ///< Metres of the scene for each metre the hand moves.
    double radius = 0;      ///< Of the tool [m].
    double shaft = 0;       ///< Of the tool, along the stylus [m]; zero for a sphere.
};

/// What became of the ticks since the last start.
struct ServoReport {
    long ticks = 0;
    long late = 0;                ///< That came more than 2 ms after the one before.
    double longest_interval = 0;  ///< From one to the next [s].
    double longest_tick = 0;      ///< That one took [s].
    double hottest_motor = 0;     ///< 0 is cold, 1 too hot.
    long limited = 0;             ///< Whose force was more than the device can bear, and was cut to that.
    long refused = 0;             ///< Without a force, for tool or force was not finite.
};

/// A device of the OpenHaptics family (Touch, Omni, Desktop, Premium). Its own thread calls back, a thousand times a
/// second, with the tool in metres, and gets the force in newtons:
///
///     OpenHapticsDevice<VendorHd> device({.scale = 0.1, .radius = 1e-3});
///     device.start([&](const membrane::Tool<double>& tool) { ...; return force; });    // the body of a loop
///     while (device.running()) { draw(); }
///     device.stop();
///     if (!device.trouble().empty()) { ... }                                           // may be started again
///
/// Axes are the device's: x to the right, y up, z towards the user; `carried_in` turns tools into another frame. The
/// force is never more than the device's nominal peak, and zero once the device is stopped, is destroyed, has reported
/// an error of any kind or the callback has thrown. One device for each program: the vendor's scheduler has no more.
///
/// `Hd` is `VendorHd`, or what stands in for it. Only start and stop call it outside the device's own thread.
template <class Hd>
class OpenHapticsDevice {
  public:
    using Force = membrane::Vector3<double>;
    using Tick = std::function<Force(const membrane::Tool<double>&)>;

    explicit OpenHapticsDevice(OpenHapticsOptions options = {}) : options_(std::move(options)) {}
    ~OpenHapticsDevice() { stop(); }
    OpenHapticsDevice(const OpenHapticsDevice&) = delete;
    OpenHapticsDevice& operator=(const OpenHapticsDevice&) = delete;

    /// Opens the device and calls `tick` from now on.
    /// @throws std::runtime_error that says which step failed, and why; everything is closed again
    void start(Tick tick);

    /// Zero force, then scheduler, callback and device, in this order. Not from within a tick, which ends by throwing.
    void stop() noexcept;

    /// Whether it was started and is neither stopped nor in trouble. From any thread.
    [[nodiscard]] bool running() const noexcept { return started_ && !failed_; }

    /// Both between `stop` and the next start: what the device said or the callback threw, empty if all was well.
    [[nodiscard]] std::string trouble() const;
    [[nodiscard]] const ServoReport& report() const noexcept { return report_; }

    /// One tick, called by the scheduler: false when it was the last.
    bool servo() noexcept;

  private:
    void need(bool well, const char* step);
    [[nodiscard]] membrane::Tool<double> read(double now) noexcept;
    [[nodiscard]] Force answer(const membrane::Tool<double>& tool) noexcept;
    void look_for_errors() noexcept;
    void clock_in(double now) noexcept;
    void release() noexcept;
    void close() noexcept;

    OpenHapticsOptions options_;
    typename Hd::Device device_ = Hd::no_device;
    typename Hd::Schedule schedule_ = Hd::not_scheduled;
    bool scheduling_ = false;
    double most_force_ = 0;

    std::atomic<bool> started_{false};
    std::atomic<bool> failed_{false};    // an error or an exception: the next force is zero and the last
    std::atomic<bool> stopping_{false};  // the same, on request
    std::atomic<bool> ended_{false};     // that zero has been written

    Tick tick_;  // from here on the device's own thread's, while there is one
    ServoReport report_;
    double first_ = 0, last_ = 0;  // [s]
    unsigned error_ = 0;
    const char* error_text_ = "";
    std::exception_ptr exception_;
};

namespace detail {

inline constexpr int most_errors = 100;  // on a stack; more are not worth waiting for
inline constexpr int patience = 100;     // ticks that `stop` waits for the last one

}  // namespace detail

template <class Hd>
void OpenHapticsDevice<Hd>::start(Tick tick) {
    if (device_ != Hd::no_device) throw std::runtime_error("OpenHapticsDevice: must be stopped to be started");
    for (int i = 0; i < detail::most_errors && Hd::take_error() != 0; ++i) {  // what others have left behind
    }
    tick_ = std::move(tick);
    report_ = {};
    error_ = 0;
    exception_ = nullptr;
    failed_ = stopping_ = ended_ = false;

    device_ = Hd::open(options_.name.empty() ? nullptr : options_.name.c_str());
    need(device_ != Hd::no_device, "open the device");
    Hd::select(device_);
    need(true, "select the device");
    need(Hd::calibrated(), "go on: the device must be calibrated (the vendor's set-up does that)");
    most_force_ = Hd::most_force();
    need(most_force_ > 0, "learn the device's largest force");
    Hd::enable_force();
    need(true, "enable forces");
    schedule_ = Hd::template schedule<OpenHapticsDevice>(this);
    need(schedule_ != Hd::not_scheduled, "schedule the callback");
    scheduling_ = true;
    Hd::start_scheduler();
    need(true, "start the scheduler");
    started_ = true;
}

/// The step before was well, and left no error.
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
    if (scheduling_ && !ended_) release();  // the device's own thread is gone and has not done so
    if (schedule_ != Hd::not_scheduled) Hd::unschedule(schedule_);
    if (device_ != Hd::no_device) Hd::close(device_);
    for (int i = 0; i < detail::most_errors && Hd::take_error() != 0; ++i) {  // nobody is left to tell
    }
    scheduling_ = false;
    schedule_ = Hd::not_scheduled;
    device_ = Hd::no_device;
}

template <class Hd>
void OpenHapticsDevice<Hd>::release() noexcept {
    Hd::begin_frame(device_);
    Hd::set_force({0, 0, 0});
    Hd::end_frame(device_);
}

template <class Hd>
bool OpenHapticsDevice<Hd>::servo() noexcept {
    const double now = Hd::seconds();
    clock_in(now);
    Hd::begin_frame(device_);
    const auto tool = read(now - first_);
    look_for_errors();
    const Force force = failed_ || stopping_ ? Force::Zero() : answer(tool);
    const bool over = failed_ || stopping_;
    if (over) {
        Hd::set_force({0, 0, 0});
    } else {
        Hd::set_force({force.x(), force.y(), force.z()});
    }
    Hd::end_frame(device_);
    look_for_errors();  // of the force: the next tick writes zero
    report_.longest_tick = std::max(report_.longest_tick, Hd::seconds() - now);
    if (over) ended_ = true;
    return !over;
}

template <class Hd>
membrane::Tool<double> OpenHapticsDevice<Hd>::read(double now) noexcept {
    const auto metres = [&](const std::array<double, 3>& mm) {
        return membrane::Vector3<double>(options_.scale * 1e-3 * membrane::Vector3<double>(mm[0], mm[1], mm[2]));
    };
    membrane::Tool<double> tool{.position = metres(Hd::position()),
                                .radius = options_.radius,
                                .velocity = metres(Hd::velocity()),
                                .time = now,
                                .grasping = Hd::button()};
    if (options_.shaft > 0) {
        const auto columns = Hd::transform();  // the third is the stylus's own z, from the tip to the hand
        tool.axis = options_.shaft * membrane::Vector3<double>(columns[8], columns[9], columns[10]);
    }
    report_.hottest_motor = std::max(report_.hottest_motor, Hd::temperature());
    return tool;
}

template <class Hd>
typename OpenHapticsDevice<Hd>::Force OpenHapticsDevice<Hd>::answer(const membrane::Tool<double>& tool) noexcept {
    Force force = Force::Zero();
    const bool sound = is_sound(tool);
    try {
        if (sound) force = tick_(tool);
    } catch (...) {
        exception_ = std::current_exception();
        failed_ = true;
    }
    if (!sound || !membrane::is_finite(force)) {
        ++report_.refused;
        return Force::Zero();
    }
    const double largest = force.cwiseAbs().maxCoeff();
    if (!(largest > 0)) return force;
    const double size = largest * (force / largest).norm();  // of any finite force, without overflow
    if (!(size > most_force_)) return force;
    ++report_.limited;
    return force / largest * (most_force_ / (force / largest).norm());
}

template <class Hd>
void OpenHapticsDevice<Hd>::look_for_errors() noexcept {
    for (int i = 0; i < detail::most_errors; ++i) {
        const unsigned error = Hd::take_error();
        if (error == 0) return;
        if (error_ == 0) {
            error_ = error;
            error_text_ = Hd::text_of(error);
        }
        failed_ = true;
    }
}

template <class Hd>
void OpenHapticsDevice<Hd>::clock_in(double now) noexcept {
    if (report_.ticks++ == 0) {
        first_ = now;
    } else {
        report_.longest_interval = std::max(report_.longest_interval, now - last_);
        report_.late += now - last_ > 2e-3;
    }
    last_ = now;
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
