// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "openhaptics/open_haptics_device.hpp"
#include "openhaptics/vendor_hd.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/hd_double.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::HdDouble;
using test::Random;
using Names = std::vector<std::string>;

namespace {

/// The vendor's functions, on the double's clock.
struct DoubleHd : examples::VendorHd {
    static double seconds() noexcept { return hd_double().real_clock() ? VendorHd::seconds() : hd_double().seconds(); }
    static void wait() noexcept {
        if (hd_double().real_clock()) return VendorHd::wait();
        hd_double().run(1);
    }
};
using OpenHaptics = examples::OpenHapticsDevice<DoubleHd>;

const Names opening{"hdInitDevice", "hdMakeCurrentDevice",    "hdCheckCalibration", "hdGetDoublev",
                    "hdEnable",     "hdScheduleAsynchronous", "hdStartScheduler"};
const Names tick{"hdBeginFrame", "hdGetDoublev", "hdGetDoublev", "hdGetIntegerv",
                 "hdGetDoublev", "hdSetDoublev", "hdEndFrame"};
const Names closing{"hdStopScheduler", "hdUnschedule", "hdDisableDevice"};
const Names release{"hdBeginFrame", "hdSetDoublev", "hdEndFrame"};
constexpr std::array<HDerror, 8> errors{HD_WARM_MOTORS,
                                        HD_EXCEEDED_MAX_FORCE,
                                        HD_EXCEEDED_MAX_FORCE_IMPULSE,
                                        HD_EXCEEDED_MAX_VELOCITY,
                                        HD_FORCE_ERROR,
                                        HD_DEVICE_FAULT,
                                        HD_COMM_ERROR,
                                        HD_TIMER_ERROR};

/// What was called, in this order: each list as often as its number says.
Names in_turn(const std::vector<std::pair<Names, int>>& parts) {
    Names all;
    for (const auto& [part, times] : parts) {
        for (int i = 0; i < times; ++i) all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

Names names(const HdDouble& hd) {
    Names result;
    for (const auto& call : hd.calls()) result.push_back(call.name);
    return result;
}

/// Closed, at no force, by the rules, and with all of a tick's calls in the device's own thread.
void check_closed(const HdDouble& hd) {
    CHECK(hd.violations() == Names{});
    CHECK_FALSE(hd.open());
    CHECK(hd.force().isZero(0));
    CHECK(hd.errors_left() == 0);
    for (const auto& call : hd.calls()) {
        const bool of_start_or_stop = std::count(opening.begin(), opening.end(), call.name) > 0 ||
                                      std::count(closing.begin(), closing.end(), call.name) > 0;
        REQUIRE((call.servo || of_start_or_stop));
    }
}

OpenHaptics::Force push(const Tool<double>&) { return {0.5, -1, 0.25}; }

/// What `start` throws.
std::string refusal(OpenHaptics& device) {
    try {
        device.start(push);
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "";
}

/// Above z = 0, nothing; below, a spring [N/m].
auto floor_of(double stiffness) {
    return [=](const Tool<double>& tool) {
        return OpenHaptics::Force(0, 0, std::max(0.0, -stiffness * tool.position.z()));
    };
}

}  // namespace

TEST_CASE("the double notices what the interface does not allow", "[openhaptics]") {
    using Violations = std::vector<std::string>;
    const auto noticed = [](auto misuse) {
        HdDouble hd;
        const HHD device = hdInitDevice(nullptr);
        misuse(hd, device);
        return hd.violations();
    };
    const double force[3]{0, 0, 1}, none[3]{0, 0, std::numeric_limits<double>::quiet_NaN()};
    const auto two_frames = [](void* device) -> HDCallbackCode {
        for (int i = 0; i < 2; ++i) {
            hdBeginFrame(*static_cast<HHD*>(device));
            hdEndFrame(*static_cast<HHD*>(device));
        }
        return HD_CALLBACK_CONTINUE;
    };
    const auto left_open = [](void* device) -> HDCallbackCode {
        hdBeginFrame(*static_cast<HHD*>(device));
        return HD_CALLBACK_DONE;
    };
    CHECK(noticed([](auto&, HHD device) {
              hdBeginFrame(device);
              hdEndFrame(device);
              hdDisableDevice(device);
          }) == Violations{});
    CHECK(noticed([](auto&, HHD device) {
              hdBeginFrame(device);
              hdBeginFrame(device);
          }) == Violations{"a frame begun in a frame in tick 0"});
    CHECK(noticed([](auto&, HHD device) { hdEndFrame(device); }).size() == 1);
    CHECK(noticed([&](auto&, HHD) { hdSetDoublev(HD_CURRENT_FORCE, force); }).size() == 1);
    CHECK(noticed([&](auto&, HHD device) {
              hdBeginFrame(device);
              hdSetDoublev(HD_CURRENT_FORCE, none);
          }).size() == 1);
    CHECK(noticed([](auto&, HHD device) { hdBeginFrame(device + 1); }).size() == 1);
    CHECK(noticed([](auto&, HHD device) {
              hdStartScheduler();
              hdBeginFrame(device);
          }) == Violations{"a frame beside the device's own thread in tick 0"});
    CHECK(noticed([](auto&, HHD device) {
              hdStartScheduler();
              hdDisableDevice(device);
          }).size() == 1);
    CHECK(noticed([&](auto& hd, HHD device) {
              hdScheduleAsynchronous(two_frames, &device, HD_DEFAULT_SCHEDULER_PRIORITY);
              hdStartScheduler();
              hd.run(1);
          }) == Violations{"two frames in a tick in tick 1"});
    CHECK(noticed([&](auto& hd, HHD device) {
              hdScheduleAsynchronous(left_open, &device, HD_DEFAULT_SCHEDULER_PRIORITY);
              hdStartScheduler();
              hd.run(2);
          }) == Violations{"a frame left open in tick 1"});
    CHECK(noticed([](auto&, HHD device) {
              const auto schedule = hdScheduleAsynchronous(nullptr, nullptr, HD_DEFAULT_SCHEDULER_PRIORITY);
              hdStartScheduler();
              hdUnschedule(schedule);
              hdDisableDevice(device);
          }).size() == 2);
}

TEST_CASE("a device is opened, asked in each tick and closed in order", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    CHECK_FALSE(device.running());
    device.stop();  // nothing to stop
    CHECK(hd.calls().empty());
    device.start(push);
    CHECK(device.running());
    hd.run(10);
    CHECK(hd.force() == OpenHaptics::Force(0.5, -1, 0.25));
    device.stop();
    CHECK_FALSE(device.running());
    check_closed(hd);
    CHECK(names(hd) == in_turn({{opening, 1}, {tick, 11}, {closing, 1}}));  // the last tick wrote zero
    CHECK(device.report().ticks == 11);
    CHECK(device.trouble().empty());
    device.stop();
    CHECK(names(hd).size() == 7 + 7 * 11 + 3);

    device.start(push);
    CHECK_THAT(refusal(device), ContainsSubstring("must be stopped to be started"));
    hd.run(5);
    CHECK(hd.force().norm() > 1);
    device.stop();
    check_closed(hd);
    CHECK(device.report().ticks == 6);
}

TEST_CASE("a device that is destroyed leaves no force behind", "[openhaptics]") {
    HdDouble hd;
    {
        OpenHaptics device;
        device.start(push);
        hd.run(3);
        CHECK(hd.force().norm() > 1);
    }
    check_closed(hd);
    CHECK(names(hd) == in_turn({{opening, 1}, {tick, 4}, {closing, 1}}));
}

TEST_CASE("tools come in metres, seconds and the axes of the device", "[openhaptics]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        HdDouble hd;
        hd.hand.target = 0.1 * random.vector();
        hd.hand.position = 0.1 * random.vector();
        hd.hand.button = random.chance(0.5);
        hd.stylus = random.unit_vector();
        const double scale = random.number(0.01, 2.0), shaft = random.chance(0.5) ? 0.03 : 0;
        OpenHaptics device({.name = "left", .scale = scale, .radius = 1e-3, .shaft = shaft});
        std::vector<Tool<double>> tools;
        std::vector<test::HdHand> hands;
        device.start([&](const Tool<double>& tool) {
            tools.push_back(tool);
            hands.push_back(hd.hand);
            return OpenHaptics::Force(0, 0, 0);
        });
        hd.run(20);
        device.stop();
        REQUIRE(tools.size() == 20);
        for (std::size_t i = 0; i < tools.size(); ++i) {
            REQUIRE(tools[i].position.isApprox(scale * hands[i].position, 1e-12));
            REQUIRE(tools[i].velocity.isApprox(scale * hands[i].velocity, 1e-12));
            REQUIRE(tools[i].time == Approx(1e-3 * static_cast<double>(i)).margin(1e-12));
            REQUIRE(tools[i].radius == 1e-3);
            REQUIRE(tools[i].grasping == hd.hand.button);
            REQUIRE((tools[i].axis - shaft * hd.stylus).norm() < 1e-12);
        }
        check_closed(hd);
    }
}

TEST_CASE("an error in any call of any tick ends in no force, and the device can be started again", "[openhaptics]") {
    for (const char* call : {"hdBeginFrame", "hdGetDoublev", "hdGetIntegerv", "hdSetDoublev", "hdEndFrame"}) {
        for (const HDerror error : errors) {
            for (const int at : {1, 2, 17}) {
                CAPTURE(call, error, at);
                HdDouble hd;
                OpenHaptics device;
                device.start(push);
                hd.run(at - 1);
                hd.fail(call, at, error);
                hd.run(1);
                CHECK_FALSE(device.running());
                // Errors of the read are known before the force is written; those of the force in the next tick.
                const bool late = std::string(call) == "hdSetDoublev" || std::string(call) == "hdEndFrame";
                CHECK(hd.force().isZero(0) == !late);
                hd.run(1);
                CHECK(hd.force().isZero(0));
                hd.run(3);
                device.stop();
                check_closed(hd);
                CHECK(names(hd) == in_turn({{opening, 1}, {tick, at + (late ? 1 : 0)}, {closing, 1}}));
                char code[8];
                std::snprintf(code, sizeof code, "0x%04x", error);
                CHECK(device.trouble() ==
                      std::string("HD error ") + code + (error == HD_WARM_MOTORS ? ": warm motors" : ": a fault"));

                device.start(push);
                CHECK(device.trouble().empty());
                hd.run(2);
                CHECK(device.running());
                CHECK(hd.force().norm() > 1);
                device.stop();
                check_closed(hd);
            }
        }
    }
}

TEST_CASE("of several errors the last is told, and none is left", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    device.start(push);
    for (const HDerror error : errors) hd.fail("hdBeginFrame", 3, error);
    hd.fail("hdGetIntegerv", 3, HD_COMM_ERROR);  // later in the tick: on top of the stack
    hd.run(5);
    device.stop();
    check_closed(hd);
    CHECK(device.trouble() == "HD error 0x0302: a fault");
}

TEST_CASE("a step of the start that fails is named, and those before it are undone", "[openhaptics]") {
    const std::vector<std::pair<std::string, std::string>> steps{{"hdInitDevice", "open the device"},
                                                                 {"hdMakeCurrentDevice", "select the device"},
                                                                 {"hdCheckCalibration", "go on: "},
                                                                 {"hdGetDoublev", "learn the device's largest force"},
                                                                 {"hdEnable", "enable forces"},
                                                                 {"hdScheduleAsynchronous", "schedule the callback"},
                                                                 {"hdStartScheduler", "start the scheduler"}};
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const auto& [call, step] = steps[i];
        CAPTURE(call);
        HdDouble hd;
        OpenHaptics device;
        hd.fail(call, 0, HD_COMM_ERROR);
        const std::string message = refusal(device);
        CHECK_THAT(message, ContainsSubstring("OpenHapticsDevice: cannot " + step));
        CHECK_THAT(message, ContainsSubstring(": a fault"));
        CHECK_FALSE(device.running());
        Names expected(opening.begin(), opening.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        Names undone;  // the scheduler may run, although it says that it does not
        if (call == "hdStartScheduler") {
            undone = in_turn({{{"hdStopScheduler"}, 1}, {release, 1}, {{"hdUnschedule"}, 1}});
        }
        expected.insert(expected.end(), undone.begin(), undone.end());
        if (i > 0) expected.push_back("hdDisableDevice");
        CHECK(names(hd) == expected);
        CHECK(hd.violations() == Names{});
        CHECK_FALSE(hd.open());
        CHECK(hd.errors_left() == 0);
        hd.run(3);
        CHECK(hd.force().isZero(0));

        CHECK(refusal(device) == "");  // the fault was one of the moment
        hd.run(2);
        CHECK(hd.force().norm() > 1);
        device.stop();
        CHECK(hd.violations() == Names{});
        CHECK(hd.force().isZero(0));
    }
}

TEST_CASE("a device that is not calibrated is not started", "[openhaptics]") {
    HdDouble hd;
    hd.calibrated = false;
    OpenHaptics device;
    CHECK_THAT(refusal(device), ContainsSubstring("must be calibrated"));
    CHECK_FALSE(hd.open());
}

TEST_CASE("a callback that throws ends in no force and is told", "[openhaptics]") {
    for (const int at : {1, 2, 30}) {
        for (const bool standard : {true, false}) {
            CAPTURE(at, standard);
            HdDouble hd;
            OpenHaptics device;
            int ticks = 0;
            device.start([&](const Tool<double>& tool) {
                if (++ticks < at) return push(tool);
                if (standard) throw std::runtime_error("no membrane");
                throw 17;
            });
            hd.run(at);
            CHECK_FALSE(device.running());
            CHECK(hd.force().isZero(0));
            hd.run(5);
            CHECK(ticks == at);
            device.stop();
            check_closed(hd);
            CHECK(names(hd) == in_turn({{opening, 1}, {tick, at}, {closing, 1}}));
            CHECK(device.trouble() == (standard ? "no membrane" : "the callback threw what is no std::exception"));
        }
    }
    HdDouble hd;
    OpenHaptics device;
    device.start(nullptr);  // a callback that is none
    hd.run(2);
    device.stop();
    check_closed(hd);
    CHECK_FALSE(device.trouble().empty());
}

TEST_CASE("a device that falls silent is closed with no force", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    device.start(push);
    hd.fall_silent(6);
    hd.run(20);
    CHECK(hd.force().norm() > 1);  // the last one stays on, as on a real device
    device.stop();
    CHECK(hd.violations() == Names{});
    CHECK_FALSE(hd.open());
    CHECK(hd.force().isZero(0));
    CHECK(names(hd) == in_turn({{opening, 1},
                                {tick, 5},
                                {{"hdStopScheduler"}, 1},
                                {release, 1},
                                {{"hdUnschedule", "hdDisableDevice"}, 1}}));
}

TEST_CASE("no force is more than the device bears, or not a number", "[openhaptics]") {
    HdDouble hd;
    hd.hand.stiffness = 1e4;  // the device is held fast
    hd.hand.damping = 20;
    OpenHaptics device;
    OpenHaptics::Force force;
    device.start([&](const Tool<double>&) { return force; });
    const auto applied = [&](double x, double y, double z) {
        force = {x, y, z};
        hd.run(1);
        return hd.force();
    };
    CHECK(applied(3, 0, 1) == OpenHaptics::Force(3, 0, 1));
    CHECK(applied(0, -3.3, 0) == OpenHaptics::Force(0, -3.3, 0));
    CHECK(applied(0, 0, 0) == OpenHaptics::Force(0, 0, 0));
    const double most = std::numeric_limits<double>::max(), least = std::numeric_limits<double>::denorm_min();
    CHECK(applied(least, 0, 0) == OpenHaptics::Force(least, 0, 0));
    CHECK(applied(0, 4, 0).isApprox(OpenHaptics::Force(0, 3.3, 0)));
    CHECK(applied(3, -3, 3).isApprox(3.3 / std::sqrt(3.0) * OpenHaptics::Force(1, -1, 1)));
    CHECK(applied(most, most, -most).isApprox(3.3 / std::sqrt(3.0) * OpenHaptics::Force(1, 1, -1)));
    const double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    for (const double bad : {infinity, -infinity, nan}) CHECK(applied(1, bad, 0).isZero(0));
    CHECK(device.running());
    device.stop();
    check_closed(hd);
    CHECK(device.report().limited == 3);
    CHECK(device.report().refused == 3);
    CHECK(device.trouble().empty());
}

TEST_CASE("a tool that is not a number is not passed on", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    int ticks = 0;
    device.start([&](const Tool<double>& tool) {
        ++ticks;
        REQUIRE(is_sound(tool));
        return push(tool);
    });
    hd.run(2);
    const auto hand = hd.hand;
    hd.hand.position.y() = std::numeric_limits<double>::quiet_NaN();
    hd.run(3);
    CHECK(ticks == 2);
    CHECK(hd.force().isZero(0));
    hd.hand = hand;
    hd.run(1);
    CHECK(ticks == 3);
    device.stop();
    check_closed(hd);
    CHECK(device.report().refused == 3);
}

TEST_CASE("a hand on a floor comes to rest where forces balance, and feels none above", "[openhaptics]") {
    for (const double stiffness : {20.0, 100.0, 300.0}) {
        for (const std::size_t latency : {0U, 1U, 3U}) {
            CAPTURE(stiffness, latency);
            HdDouble hd({.latency = latency});
            hd.hand.position.z() = 0.01;
            hd.hand.target.z() = -0.02;
            OpenHaptics device;
            device.start(floor_of(stiffness));
            hd.run(2000);
            // stiffness depth = 50 (0.02 - depth)
            const double depth = 50 * 0.02 / (50 + stiffness);
            CHECK(hd.hand.position.z() == Approx(-depth).epsilon(1e-3));
            CHECK(hd.force().z() == Approx(stiffness * depth).epsilon(1e-3));
            hd.hand.target.z() = 0.02;
            hd.run(2000);
            CHECK(hd.force().isZero(0));
            CHECK(hd.hand.position.z() == Approx(0.02).epsilon(1e-3));
            CHECK(device.running());
            device.stop();
            check_closed(hd);
        }
    }
}

TEST_CASE("ticks that come late or not at all are counted, and do no harm", "[openhaptics]") {
    HdDouble hd;
    hd.hand.target.z() = -0.02;
    OpenHaptics device;
    device.start(floor_of(50));
    for (const long at : {50L, 300L, 301L}) hd.miss(at);    // intervals of 2 ms and 3 ms
    for (const long at : {100L, 200L}) hd.delay(at, 9e-4);  // 1.9 ms
    hd.delay(400, 0.0095);                                  // 10.5 ms
    hd.run(2000);
    CHECK(hd.hand.position.z() == Approx(-0.01).epsilon(1e-3));
    device.stop();
    check_closed(hd);
    CHECK(device.report().ticks == 1998);
    CHECK(device.report().longest_interval == Approx(0.0105));
    CHECK(device.report().late >= 2);  // 2 ms is on the verge
    CHECK(device.report().late <= 3);
}

TEST_CASE("motors that are held too hard for too long end in no force", "[openhaptics]") {
    for (const bool hard : {false, true}) {
        HdDouble hd({.heating = 1});
        hd.hand.stiffness = 1e4;
        hd.hand.damping = 20;
        OpenHaptics device;
        device.start([&](const Tool<double>&) { return OpenHaptics::Force(0, 0, hard ? 2.0 : 0.9); });
        hd.run(5000);
        CHECK(device.running() == !hard);
        CHECK(hd.force().isZero(0) == hard);
        device.stop();
        check_closed(hd);
        CHECK(device.trouble() == (hard ? "HD error 0x0200: warm motors" : ""));
        CHECK(device.report().hottest_motor == Approx(hard ? 1.0 : 0.81).epsilon(0.01));
        CHECK((hard ? device.report().ticks < 400 : device.report().ticks == 5001));  // 2 N: 4 (1 - exp(-t)) = 1
    }
}

TEST_CASE("a thread of a thousand ticks a second is the only one to call the device", "[openhaptics]") {
    HdDouble hd({.real_clock = true});
    std::thread::id servo;
    int started = 0;
    for (const bool fails : {false, true, false}) {
        CAPTURE(fails);
        OpenHaptics device;
        std::atomic<int> ticks{0};
        device.start([&](const Tool<double>& tool) {
            servo = std::this_thread::get_id();
            if (fails && ticks == 20) throw std::runtime_error("enough");
            ++ticks;
            return push(tool);
        });
        ++started;
        const auto begin = std::chrono::steady_clock::now();
        while (device.running() && ticks < 100 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(20)) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        CHECK(device.running() == !fails);
        if (started < 3) device.stop();  // the third is stopped by its end
        if (fails) CHECK(device.trouble() == "enough");
        CHECK(ticks >= (fails ? 20 : 100));
    }
    CHECK(servo != std::this_thread::get_id());
    check_closed(hd);
    const auto frames =
        std::count_if(hd.calls().begin(), hd.calls().end(), [](auto& c) { return c.name == "hdBeginFrame"; });
    CHECK(frames >= 220);
}
