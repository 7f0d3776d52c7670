// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "openhaptics/open_haptics_device.hpp"
#include "openhaptics/vendor_hd.hpp"
#include "support/catch.hpp"
#include "support/hd_double.hpp"

/// The adapter for OpenHaptics on the test double: what it calls, when, and how it must leave the device.
namespace test {

/// The vendor's functions, on the double's clock.
struct DoubleHd : examples::VendorHd {
    static double seconds() noexcept {
        const auto& hd = HdDouble::current();
        return hd.real_clock() ? VendorHd::seconds() : hd.seconds();
    }
    static void wait() noexcept {
        auto& hd = HdDouble::current();
        if (hd.real_clock()) return VendorHd::wait();
        hd.run(1);
    }
};
using OpenHaptics = examples::OpenHapticsDevice<DoubleHd>;
using Force = membrane::Vector3<double>;

/// The same force always, of a solver that never stops; whole after so many ticks.
inline const Force pushed(0.25, -0.5, 0.125);
inline constexpr int start_up_ticks = 103;
struct Push {
    examples::Answer operator()(const membrane::Tool<double>&) { return {pushed, ++solves}; }
    std::uint64_t solves = 0;
};

/// What `start` throws.
inline std::string start_refused(OpenHaptics& device) {
    try {
        device.start(Push{});
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "";
}

using Names = std::vector<std::string_view>;

inline const Names opening{"hdInitDevice",           "hdMakeCurrentDevice", "hdCheckCalibration",
                           "hdGetDoublev",           "hdGetDoublev",        "hdEnable",
                           "hdScheduleAsynchronous", "hdStartScheduler"};
inline const Names in_tick{"hdBeginFrame", "hdGetDoublev", "hdGetDoublev", "hdGetIntegerv",
                           "hdGetDoublev", "hdSetDoublev", "hdEndFrame"};
inline const Names closing{"hdStopScheduler", "hdUnschedule", "hdDisableDevice"};
inline const Names releasing{"hdBeginFrame", "hdSetDoublev", "hdEndFrame"};
/// A tick in which the force itself met an error: zero is written after it.
inline const Names in_tick_withdrawn{"hdBeginFrame", "hdGetDoublev", "hdGetDoublev", "hdGetIntegerv",
                                     "hdGetDoublev", "hdSetDoublev", "hdSetDoublev", "hdEndFrame"};

/// The device gets over these, and not over those.
inline constexpr std::array<HDerror, 5> passing_errors{
    HD_WARM_MOTORS, HD_EXCEEDED_MAX_FORCE, HD_EXCEEDED_MAX_FORCE_IMPULSE, HD_EXCEEDED_MAX_VELOCITY, HD_FORCE_ERROR};
inline constexpr std::array<HDerror, 4> final_errors{HD_DEVICE_FAULT, HD_COMM_ERROR, HD_TIMER_ERROR, HD_FRAME_ERROR};

/// How many calls of the same name come before `call` in a list: what `HdDouble::fail` takes.
inline int calls_before(const Names& list, std::size_t call) {
    const auto end = list.begin() + static_cast<std::ptrdiff_t>(call);
    return static_cast<int>(std::count(list.begin(), end, list[call]));
}

/// Lists in this order, each as often as its number says.
inline Names in_turn(const std::vector<std::pair<Names, int>>& parts) {
    Names all;
    for (const auto& [part, times] : parts) {
        for (int i = 0; i < times; ++i) all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

inline Names names(const HdDouble& hd) {
    Names result;
    for (const auto& call : hd.calls()) result.push_back(call.name);
    return result;
}

/// Closed, at no force, by the rules, and with no call from outside of the device's own thread but to open and to
/// close: to take the force away, where that thread has not, only when it is at an end.
inline void check_closed(const HdDouble& hd) {
    CHECK(hd.violations() == std::vector<std::string>{});
    CHECK_FALSE(hd.open());
    CHECK(hd.force().isZero(0));
    CHECK(hd.errors_left() == 0);
    CHECK(hd.faults_left() == 0);
    std::string_view last;  // of those that open and close
    for (const auto& call : hd.calls()) {
        const auto is_in = [&](const Names& list) { return std::count(list.begin(), list.end(), call.name) > 0; };
        const bool opens_or_closes = is_in(closing) || (is_in(opening) && call.name != "hdGetDoublev");
        const bool reads_forces = call.name == "hdGetDoublev" && last == "hdCheckCalibration";
        if (opens_or_closes) last = call.name;
        const bool releases = is_in(releasing) && last == "hdStopScheduler";
        if (call.servo == (opens_or_closes || reads_forces || releases)) FAIL("from the wrong thread: " << call.name);
    }
}

}  // namespace test
