// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <limits>
#include <thread>

#include <HD/hd.h>

#include "openhaptics/units.hpp"

/// The few functions of the vendor's HD interface that the adapter calls, each by what it is for.
namespace examples {

struct VendorHd {
    using Device = HHD;
    using Schedule = HDSchedulerHandle;
    static constexpr Device no_device = HD_INVALID_HANDLE;
    static constexpr Schedule not_scheduled = HD_INVALID_HANDLE;

    /// The last error, taken off the stack; 0 if there is none.
    static unsigned take_error() noexcept { return static_cast<unsigned>(hdGetError().errorCode); }
    static const char* text_of(unsigned error) noexcept { return hdGetErrorString(static_cast<HDerror>(error)); }
    /// Whether the device recovers from it by itself: force errors, in the vendor's terms.
    static bool passes(unsigned error) noexcept {
        return error == HD_WARM_MOTORS || error == HD_EXCEEDED_MAX_FORCE || error == HD_EXCEEDED_MAX_FORCE_IMPULSE ||
               error == HD_EXCEEDED_MAX_VELOCITY || error == HD_FORCE_ERROR;
    }

    /// If `name` is null, opens the default device.
    static Device open(const char* name) noexcept { return hdInitDevice(name); }
    static void close(Device device) noexcept { hdDisableDevice(device); }
    static void select(Device device) noexcept { hdMakeCurrentDevice(device); }
    static bool calibrated() noexcept { return hdCheckCalibration() == HD_CALIBRATION_OK; }
    static void enable_force() noexcept { hdEnable(HD_FORCE_OUTPUT); }

    static double peak_force() noexcept { return numbers<1>(HD_NOMINAL_MAX_FORCE)[0]; }                   // [N]
    static double continuous_force() noexcept { return numbers<1>(HD_NOMINAL_MAX_CONTINUOUS_FORCE)[0]; }  // [N]

    /// Calls `adapter->servo()` in every tick until that is false.
    template <class Adapter>
    static Schedule schedule(Adapter* adapter) noexcept {
        return hdScheduleAsynchronous(&call<Adapter>, adapter, HD_DEFAULT_SCHEDULER_PRIORITY);
    }
    static void unschedule(Schedule schedule) noexcept { hdUnschedule(schedule); }
    static void start_scheduler() noexcept { hdStartScheduler(); }
    static void stop_scheduler() noexcept { hdStopScheduler(); }

    static void begin_frame(Device device) noexcept { hdBeginFrame(device); }
    static void end_frame(Device device) noexcept { hdEndFrame(device); }

    // NaN if the device does not respond.
    static Millimetres position() noexcept { return Millimetres(vector(HD_CURRENT_POSITION)); }
    static MillimetresPerSecond velocity() noexcept { return MillimetresPerSecond(vector(HD_CURRENT_VELOCITY)); }
    /// Along the stylus, from the tip to the hand, of length 1.
    static membrane::Vector3<double> stylus() noexcept {
        const auto columns = numbers<16>(HD_CURRENT_TRANSFORM);
        return {columns[8], columns[9], columns[10]};
    }
    /// If the device does not respond, returns `before`.
    static bool button(bool before) noexcept {
        HDint buttons = before ? HD_DEVICE_BUTTON_1 : 0;
        hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
        return (buttons & HD_DEVICE_BUTTON_1) != 0;
    }
    /// Of the hottest motor: 0 is cold, 1 too hot.
    static double temperature() noexcept {
        const auto motors = numbers<6>(HD_MOTOR_TEMPERATURE, 0);  // devices have three or six
        return *std::max_element(motors.begin(), motors.end());
    }
    static void set_force(const Newtons& force) noexcept { hdSetDoublev(HD_CURRENT_FORCE, force.value().data()); }

    static double seconds() noexcept {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    }
    /// For a tick.
    static void wait() noexcept { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

  private:
    template <std::size_t n>
    static std::array<double, n> numbers(HDenum what,
                                         double unread = std::numeric_limits<double>::quiet_NaN()) noexcept {
        std::array<double, n> result{};
        result.fill(unread);
        hdGetDoublev(what, result.data());
        return result;
    }
    static membrane::Vector3<double> vector(HDenum what) noexcept {
        const auto xyz = numbers<3>(what);
        return {xyz[0], xyz[1], xyz[2]};
    }

    template <class Adapter>
    static HDCallbackCode HDCALLBACK call(void* adapter) {
        return static_cast<Adapter*>(adapter)->servo() ? HD_CALLBACK_CONTINUE : HD_CALLBACK_DONE;
    }
};

}  // namespace examples
