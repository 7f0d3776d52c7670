// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <thread>

#include <HD/hd.h>

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

    /// No name: the default device.
    static Device open(const char* name) noexcept { return hdInitDevice(name); }
    static void close(Device device) noexcept { hdDisableDevice(device); }
    static void select(Device device) noexcept { hdMakeCurrentDevice(device); }
    static bool calibrated() noexcept { return hdCheckCalibration() == HD_CALIBRATION_OK; }
    static void enable_force() noexcept { hdEnable(HD_FORCE_OUTPUT); }

    /// Peak [N].
    static double most_force() noexcept { return number(HD_NOMINAL_MAX_FORCE); }

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
    static std::array<double, 3> position() noexcept { return numbers<3>(HD_CURRENT_POSITION); }  // [mm]
    static std::array<double, 3> velocity() noexcept { return numbers<3>(HD_CURRENT_VELOCITY); }  // [mm/s]
    static std::array<double, 16> transform() noexcept {
        return numbers<16>(HD_CURRENT_TRANSFORM);
    }  // by columns, [mm]
    static bool button() noexcept {
        HDint buttons = 0;
        hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
        return (buttons & HD_DEVICE_BUTTON_1) != 0;
    }
    /// Of the hottest motor: 0 is cold, 1 too hot.
    static double temperature() noexcept {
        const auto motors = numbers<6>(HD_MOTOR_TEMPERATURE);  // devices have three or six
        return *std::max_element(motors.begin(), motors.end());
    }
    static void set_force(const std::array<double, 3>& newtons) noexcept {
        hdSetDoublev(HD_CURRENT_FORCE, newtons.data());
    }

    static double seconds() noexcept {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    }
    /// For a tick.
    static void wait() noexcept { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

  private:
    template <std::size_t n>
    static std::array<double, n> numbers(HDenum what) noexcept {
        std::array<double, n> result{};
        hdGetDoublev(what, result.data());
        return result;
    }
    static double number(HDenum what) noexcept { return numbers<1>(what)[0]; }

    template <class Adapter>
    static HDCallbackCode HDCALLBACK call(void* adapter) {
        return static_cast<Adapter*>(adapter)->servo() ? HD_CALLBACK_CONTINUE : HD_CALLBACK_DONE;
    }
};

}  // namespace examples
