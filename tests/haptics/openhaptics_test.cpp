// SPDX-License-Identifier: MIT
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/openhaptics_on_double.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using namespace test;
using examples::Answer;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr LimitOptions only_peak{.rise_time = 0, .soft_start = 0, .max_state_age = infinity, .thermal_limit = false};

/// Pushes up whatever goes below zero.
struct Floor {
    Answer operator()(const Tool<double>& tool) {
        return {Force(0, 0, std::max(0.0, -stiffness * tool.position.z())), ++solves};
    }
    double stiffness;
    std::uint64_t solves = 0;
};

/// A hand that nothing moves.
HdHand firm_hand() { return {.damping = 20, .stiffness = 1e4}; }

}  // namespace

// Start and stop.

TEST_CASE("a device is opened, ticks and is closed in the right order, as often as one likes", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    CHECK_FALSE(device.running());
    device.stop();  // nothing to stop
    CHECK(hd.calls().empty());
    device.start(Push{});
    CHECK(device.running());
    hd.run(start_up_ticks);
    CHECK(hd.force() == pushed);
    device.stop();
    CHECK_FALSE(device.running());
    check_closed(hd);
    CHECK(names(hd) ==
          in_turn({{opening, 1}, {in_tick, start_up_ticks + 1}, {closing, 1}}));  // the last tick wrote zero
    CHECK(device.report().ticks == start_up_ticks + 1);
    CHECK(device.trouble().empty());
    hd.forget_calls();
    device.stop();
    CHECK(hd.calls().empty());

    device.start(Push{});
    CHECK_THAT(start_refused(device), ContainsSubstring("must be stopped to be started"));
    hd.run(start_up_ticks);
    CHECK(hd.force() == pushed);
    device.stop();
    check_closed(hd);
    CHECK(device.report().ticks == start_up_ticks + 1);
}

TEST_CASE("a device that is destroyed leaves no force behind", "[openhaptics]") {
    HdDouble hd;
    {
        OpenHaptics device;
        device.start(Push{});
        hd.run(start_up_ticks);
        CHECK(hd.force() == pushed);
    }
    check_closed(hd);
    CHECK(names(hd) == in_turn({{opening, 1}, {in_tick, start_up_ticks + 1}, {closing, 1}}));
}

TEST_CASE("a device is found by its name", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics known({.name = HdDouble::name}), unknown({.name = "none such"});
    CHECK(start_refused(unknown) == "OpenHapticsDevice: cannot open the device: a fault");
    CHECK(start_refused(known) == "");
    known.stop();
    check_closed(hd);
}

TEST_CASE("a device that is not calibrated is not started", "[openhaptics]") {
    HdDouble hd;
    hd.calibrated = false;
    OpenHaptics device;
    CHECK_THAT(start_refused(device), ContainsSubstring("must be calibrated"));
    check_closed(hd);
}

TEST_CASE("a device that falls silent is closed with no force", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    device.start(Push{});
    hd.fall_silent(start_up_ticks + 1);
    hd.run(start_up_ticks + 20);
    CHECK(hd.force() == pushed);  // the last one stays on, as on a real device
    device.stop();
    check_closed(hd);
    CHECK(names(hd) == in_turn({{opening, 1},
                                {in_tick, start_up_ticks},
                                {{"hdStopScheduler"}, 1},
                                {releasing, 1},
                                {{"hdUnschedule", "hdDisableDevice"}, 1}}));
}

TEST_CASE("options of an adapter that make no sense are refused by name", "[openhaptics][bad]") {
    const auto refused = [](const examples::OpenHapticsOptions& options) {
        return refusal([&] { const OpenHaptics device(options); });
    };
    CHECK(refused({}) == "");
    CHECK_THAT(refused({.scale = {.motion = 0}}), ContainsSubstring("DeviceScale: motion"));
    CHECK_THAT(refused({.radius = -1}), ContainsSubstring("OpenHapticsDevice: radius"));
    CHECK_THAT(refused({.shaft = nan_value}), ContainsSubstring("OpenHapticsDevice: shaft"));
    CHECK_THAT(refused({.limits = {.rise_time = -1}}), ContainsSubstring("ForceLimiter: rise_time"));
    auto profile = devices::touch;
    profile.peak_force = infinity;
    CHECK_THAT(refused({.profile = profile}), ContainsSubstring("DeviceProfile: peak_force"));
}

// Units.

TEST_CASE("a device's millimetres are the scene's metres", "[openhaptics]") {
    HdDouble hd;
    hd.hand.position = {12.5e-3, -3e-3, 40e-3};
    hd.hand.target = hd.hand.position;
    OpenHaptics device({.radius = 1e-3, .limits = only_peak});
    Tool<double> seen;
    device.start([&](const Tool<double>& tool) {
        seen = tool;
        return Answer{pushed, 0};
    });
    hd.run(1);
    CHECK((seen.position - Vector3<double>(0.0125, -0.003, 0.04)).norm() < 1e-12);
    CHECK(hd.force() == pushed);
    const Vector3<double> speed = hd.hand.velocity;  // of the push
    hd.run(1);
    CHECK((seen.velocity - hd.hand.velocity).norm() < 1e-12);
    CHECK(speed != hd.hand.velocity);
}

TEST_CASE("tools come in the scene, and forces go out of it", "[openhaptics]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        HdDouble hd;
        hd.hand.target = 0.1 * random.vector();
        hd.hand.position = 0.1 * random.vector();
        hd.hand.button = random.chance(0.5);
        hd.stylus = random.unit_vector();
        const double shaft = random.chance(0.5) ? 0.03 : 0;
        examples::DeviceScale scale{.force = random.number(10.0, 50.0), .motion = random.number(0.01, 2.0)};
        scale.device.rotation = random.rotation();
        scale.device.origin = random.vector();
        OpenHaptics device({.scale = scale, .radius = 1e-3, .shaft = shaft, .limits = only_peak});
        const auto turned = [&](const Vector3<double>& v) { return Vector3<double>(scale.device.rotation * v); };
        int ticks = 0;
        device.start([&](const Tool<double>& tool) {
            const Vector3<double> place = scale.device.origin + scale.motion * turned(hd.hand.position);
            REQUIRE((tool.position - place).norm() < 1e-12);
            REQUIRE((tool.velocity - scale.motion * turned(hd.hand.velocity)).norm() < 1e-12);
            REQUIRE((tool.axis - shaft * turned(hd.stylus)).norm() < 1e-12);
            REQUIRE(tool.time == Approx(1e-3 * ticks++).margin(1e-12));
            REQUIRE(tool.radius == 1e-3);
            REQUIRE(tool.grasping == hd.hand.button);
            return Answer{0.01 * tool.position.normalized(), 0};
        });
        for (int i = 1; i <= 20; ++i) {
            const Vector3<double> place = hd.hand.position;  // about
            hd.run(1);
            REQUIRE(ticks == i);
            REQUIRE(hd.force().norm() == Approx(0.01 * scale.force));
            const Vector3<double> outward = scale.device.origin + scale.motion * turned(place);
            REQUIRE(turned(hd.force()).normalized().dot(outward.normalized()) > 0.9);
        }
        device.stop();
        check_closed(hd);
    }
}

// Limits.

TEST_CASE("a force within the limits reaches the device bit for bit", "[openhaptics]") {
    HdDouble hd({.hand = firm_hand()});
    OpenHaptics device({.profile = devices::phantom_desktop});
    Random random(3);
    Force displacement(0, 0, 1);
    Answer result{Force::Zero(), 0};
    device.start([&](const Tool<double>&) { return result; });
    for (int i = 0; i < 2000; ++i) {
        displacement += random.vector(-0.1, 0.1);  // turns, by less than the slew limit has
        result.force = (0.6 + 0.3 * std::sin(0.01 * i)) * displacement.normalized();
        ++result.solves;
        hd.run(1);
        if (i > start_up_ticks) REQUIRE(same_bits(hd.force(), result.force.eigen()));
    }
    device.stop();
    check_closed(hd);
    const auto& report = device.report();
    CHECK(report.faded == Approx(100).margin(1));  // while it came in
    CHECK(report.errors + report.refused + report.peak + report.heat == 0);
    CHECK(report.max_force == Approx(0.9).epsilon(1e-3));
}

TEST_CASE("the device's own word narrows its profile, never widens it", "[openhaptics]") {
    const auto narrowed = [](double peak, double bearable, const DeviceProfile& profile) {
        HdDouble hd({.peak = peak, .bearable = bearable, .hand = firm_hand()});
        OpenHaptics device({.limits = only_peak, .profile = profile});
        device.start([](const Tool<double>&) { return Answer{Force(100, 0, 100), 0}; });
        hd.run(100);
        const double most = hd.force().norm();
        device.stop();
        check_closed(hd);
        CHECK(device.report().peak == 100);
        CHECK(most <= device.profile().peak_force);
        CHECK(most == Approx(device.profile().peak_force));
        return std::pair(device.profile().peak_force, device.profile().continuous_force);
    };
    CHECK(narrowed(22, 3, devices::touch) == std::pair(3.3, 0.88));
    CHECK(narrowed(3.3, 0.9, devices::phantom_desktop) == std::pair(3.3, 0.9));
    CHECK(narrowed(0.5, 2, devices::touch) == std::pair(0.5, 0.5));
    for (const double none : {0.0, -1.0, nan_value, infinity}) {
        HdDouble hd({.peak = none});
        OpenHaptics device;
        CHECK_THAT(start_refused(device), ContainsSubstring("cannot learn the forces"));
        check_closed(hd);
    }
}

TEST_CASE("what is too much, too fast, too old or not a number is held back and reported", "[openhaptics]") {
    HdDouble hd({.hand = firm_hand()});
    OpenHaptics device;
    Answer result{pushed, 0};
    bool frozen = false;
    device.start([&](const Tool<double>&) {
        if (!frozen) ++result.solves;
        return result;
    });
    const auto run = [&](const Force& force, int ticks) {
        result.force = force;
        hd.run(ticks);
        return hd.force().norm();
    };
    run(pushed, 150);
    CHECK(run({0, 0, 3}, 1) < pushed.norm() + 0.166);  // slew
    CHECK(run({0, 0, 3}, 30) == 3);
    CHECK(run({0, 1e6, 0}, 30) == Approx(3.3));
    CHECK(run({0, 3.3, 0}, 20'000) == Approx(0.88).epsilon(0.05));  // heat
    CHECK(run({0, infinity, 0}, 1) == 0);
    CHECK(run(pushed, 50) == Approx(0.5 * pushed.norm()).epsilon(0.05));  // softly
    CHECK(run(pushed, 100) == pushed.norm());
    frozen = true;
    CHECK(run(pushed, 38) == pushed.norm());
    CHECK(run(pushed, 62) == 0);  // 100 ms of the same solve
    frozen = false;
    CHECK(run(pushed, start_up_ticks) == pushed.norm());
    CHECK(device.running());
    device.stop();
    check_closed(hd);
    const auto& report = device.report();
    CHECK(report.refused == 1);
    CHECK(report.peak >= 30);
    CHECK(report.heat > 10'000);
    CHECK(report.slew >= 15);
    CHECK(report.faded > 300);
    CHECK(report.max_force == Approx(3.3));
    CHECK(device.trouble().empty());

    device.start([&](const Tool<double>&) { return Answer{Force(0, 0, 3.3), ++result.solves}; });
    hd.run(150);
    CHECK(hd.force().norm() < 1.5);  // motors have not cooled because of a new start
    device.stop();
    check_closed(hd);
}

TEST_CASE("each limit of an adapter can be taken off, but for the peak", "[openhaptics]") {
    HdDouble hd({.hand = firm_hand()});
    OpenHaptics device({.limits = only_peak});
    Force force;
    device.start([&](const Tool<double>&) { return Answer{force, 7}; });
    const auto applied = [&](double x, double y, double z) {
        force = {x, y, z};
        hd.run(1);
        return hd.force();
    };
    const double most = std::numeric_limits<double>::max(), least = std::numeric_limits<double>::denorm_min();
    CHECK(applied(3, 0, 1) == Force(3, 0, 1));
    CHECK(applied(0, -3.3, 0) == Force(0, -3.3, 0));
    CHECK(applied(least, 0, 0) == Force(least, 0, 0));
    CHECK(applied(0, 4, 0).isApprox(Force(0, 3.3, 0).eigen()));
    CHECK(applied(most, most, -most).isApprox((3.3 / std::sqrt(3.0) * Force(1, 1, -1)).eigen()));
    for (const double bad : {infinity, -infinity, nan_value}) CHECK(applied(1, bad, 0).isZero(0));
    device.stop();
    check_closed(hd);
    CHECK(device.report().peak == 2);
    CHECK(device.report().refused == 3);
}

TEST_CASE("a tool that is not a number is not passed on", "[openhaptics]") {
    HdDouble hd;
    OpenHaptics device;
    int ticks = 0;
    device.start([&](const Tool<double>& tool) {
        REQUIRE(is_valid(tool));
        return Answer{pushed, static_cast<std::uint64_t>(++ticks)};
    });
    hd.run(start_up_ticks);
    const auto hand = hd.hand;
    hd.hand.position.y() = nan_value;
    hd.run(1);
    CHECK(hd.force().isZero(0));
    hd.run(2);
    CHECK(ticks == start_up_ticks);
    hd.hand = hand;
    hd.run(start_up_ticks);
    CHECK(hd.force() == pushed);
    CHECK(ticks == 2 * start_up_ticks);
    device.stop();
    check_closed(hd);
    CHECK(device.report().refused == 3);
}

// Closed loops.

TEST_CASE("a hand on a floor comes to rest where forces balance, and feels none above", "[openhaptics]") {
    for (const double stiffness : {20.0, 100.0, 300.0}) {
        for (const std::size_t latency : {0U, 1U, 3U}) {
            CAPTURE(stiffness, latency);
            HdDouble hd({.latency = latency});
            hd.hand.position.z() = 0.01;
            hd.hand.target.z() = -0.015;
            OpenHaptics device;
            device.start(Floor{stiffness});
            hd.run(2000);
            const double depth = 50 * 0.015 / (50 + stiffness);  // stiffness depth = 50 (0.015 - depth)
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
    device.start(Floor{50});
    for (const long at : {50L, 300L, 301L}) hd.miss(at);    // intervals of 2 ms and 3 ms
    for (const long at : {100L, 200L}) hd.delay(at, 9e-4);  // 1.9 ms
    hd.delay(400, 0.0095);                                  // 10.5 ms
    hd.run(2000);
    CHECK(hd.hand.position.z() == Approx(-0.01).epsilon(1e-3));
    device.stop();
    check_closed(hd);
    CHECK(device.report().ticks == 1998);
    CHECK(device.report().max_interval == Approx(0.0105));
    CHECK(device.report().late >= 2);  // 2 ms is on the verge
    CHECK(device.report().late <= 3);
}

TEST_CASE("motors do not grow too warm, unless the limit is off, and then the device reports it", "[openhaptics]") {
    for (const bool heed : {true, false}) {
        HdDouble hd({.hand = firm_hand()});
        OpenHaptics device({.limits = {.thermal_limit = heed}});
        std::uint64_t solves = 0;
        bool pushing = true;
        device.start([&](const Tool<double>&) { return Answer{Force(0, 0, pushing ? 2.0 : 0), ++solves}; });
        hd.run(20'000);
        CHECK(device.running());
        CHECK(device.report().hottest_motor < 1.01);
        CHECK((device.report().errors == 0) == heed);
        CHECK((device.report().heat > 0) == heed);
        pushing = false;
        hd.run(5000);
        pushing = true;
        hd.run(200);
        CHECK(hd.force().z() > 0.9);  // cold again
        device.stop();
        check_closed(hd);
        CHECK(std::string(device.report().last_error) == (heed ? "none" : "warm motors"));
    }
}

TEST_CASE("a thread of a thousand ticks a second is the only one to call the device", "[openhaptics]") {
    HdDouble hd({.real_clock = true});
    std::thread::id servo;
    const auto run = [&](OpenHaptics& device, int most, bool throws) {
        std::atomic<int> ticks{0};
        device.start([&](const Tool<double>&) {
            servo = std::this_thread::get_id();
            if (throws && ticks == 20) throw std::runtime_error("enough");
            return Answer{pushed, static_cast<std::uint64_t>(++ticks)};
        });
        const auto begin = std::chrono::steady_clock::now();
        while (device.running() && ticks < most &&
               std::chrono::steady_clock::now() - begin < std::chrono::seconds(20)) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            (void)device.warning();
        }
        CHECK(device.running() == !throws);
        device.stop();
        CHECK(servo != std::this_thread::get_id());
        CHECK(device.trouble() == (throws ? "enough" : ""));
        CHECK(ticks >= (throws ? 20 : most));
    };
    OpenHaptics device;
    run(device, 100, false);
    run(device, 100, true);
    hd.fail("hdGetIntegerv", 0, HD_WARM_MOTORS, 30);
    run(device, 100, false);
    CHECK(device.report().errors == 1);
    {
        OpenHaptics forgotten;
        forgotten.start(Push{});
    }
    check_closed(hd);
}

TEST_CASE("a stop in the middle of a tick takes the force of that tick", "[openhaptics]") {
    HdDouble hd({.real_clock = true});
    OpenHaptics device({.limits = only_peak});
    std::atomic<bool> inside{false};
    device.start([&](const Tool<double>&) {
        inside = true;
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return Answer{pushed, 0};
    });
    while (!inside) std::this_thread::yield();
    device.stop();
    check_closed(hd);
    CHECK(device.report().max_force == 0);
}
