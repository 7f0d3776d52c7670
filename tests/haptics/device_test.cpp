// SPDX-License-Identifier: MIT
#include <membrane/haptics/device.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(Device<ScriptedDevice<double>, double> && Device<ScriptedDevice<float>, float>);

namespace {

template <class S>
std::vector<Waypoint<S>> simple_script() {
    return {{.time = 1, .position = {0, 0, 2}},
            {.time = 2, .position = {0, 0, 1}, .grasping = true},
            {.time = 4, .position = {4, 0, 1}}};
}

}  // namespace

TEMPLATE_TEST_CASE("the tool follows its script in straight lines", "[device]", TEST_SCALARS) {
    using S = TestType;
    ScriptedDevice<S> device(simple_script<S>(), {.tick = 0.25, .radius = 0.125});
    const S tolerance = 8 * std::numeric_limits<S>::epsilon();
    int ticks = 0;
    for (; device.running(); ++ticks) {
        const S time = 1 + S(0.25) * static_cast<S>(ticks);
        CAPTURE(time);
        REQUIRE(device.time() == time);
        const auto tool = device.read();
        CHECK(tool.time == time);
        CHECK(tool.radius == S(0.125));
        CHECK(tool.axis == Vector3<S>(0, 0, 0));
        CHECK(tool.grasping == (time >= 2 && time < 4));
        const Vector3<S> position = time < 2 ? Vector3<S>(0, 0, 3 - time) : Vector3<S>(2 * (time - 2), 0, 1);
        CHECK(norm<S>(tool.position - position) <= tolerance);
        const Vector3<S> velocity =
            time < 2 ? Vector3<S>(0, 0, -1) : (time < 4 ? Vector3<S>(2, 0, 0) : Vector3<S>(0, 0, 0));
        CHECK(norm<S>(tool.velocity - velocity) <= tolerance);
    }
    CHECK(ticks == 13);            // both ends included
    for (int i = 0; i < 3; ++i) {  // beyond the end it stays
        const auto tool = device.read();
        CHECK(tool.position == Vector3<S>(4, 0, 1));
        CHECK(tool.velocity == Vector3<S>(0, 0, 0));
        CHECK_FALSE(tool.grasping);
        CHECK_FALSE(device.running());
    }
}

TEST_CASE("positions are those between the waypoints, on whatever script", "[device]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<Waypoint<double>> script(static_cast<std::size_t>(1 + random.index(8)));
        double time = random.number(-5.0, 5.0);
        for (auto& waypoint : script) {
            waypoint = {time, random.vector(), random.chance(0.5)};
            time += random.number(1e-3, 1.0);
        }
        const double tick = random.number(1e-3, 0.3);  // sometimes longer than from waypoint to waypoint
        ScriptedDevice<double> device(script, {.tick = tick});
        const double begin = script.front().time;
        for (int i = 0; device.running(); ++i) {
            const auto tool = device.read();
            const double now = begin + i * tick;
            REQUIRE(tool.time == Approx(now).margin(1e-12));
            std::size_t last = 0;
            while (last + 1 < script.size() && script[last + 1].time <= now) ++last;
            REQUIRE(tool.grasping == script[last].grasping);
            Vector3<double> expected = script[last].position;
            if (last + 1 < script.size()) {
                const double part = (now - script[last].time) / (script[last + 1].time - script[last].time);
                expected += part * (script[last + 1].position - expected);
            }
            REQUIRE(norm<double>(tool.position - expected) < 1e-11);
        }
        REQUIRE(device.read().position == script.back().position);
    }
}

TEST_CASE("time does not drift, however long the script", "[device]") {
    ScriptedDevice<double> device({{.time = 0, .position = {0, 0, 0}}, {.time = 1000, .position = {1, 0, 0}}},
                                  {.tick = 1e-3});
    int ticks = 0;
    Tool<double> last;
    for (; device.running(); ++ticks) last = device.read();
    CHECK(ticks == 1'000'001);
    CHECK(last.position == Vector3<double>(1, 0, 0));
    ScriptedDevice<float> coarse({{.time = 0, .position = {0, 0, 0}}, {.time = 10, .position = {1, 0, 0}}},
                                 {.tick = 1e-3});
    for (ticks = 0; coarse.running(); ++ticks) (void)coarse.read();
    CHECK(std::abs(ticks - 10'001) <= 1);
}

TEST_CASE("a script may be written where the device is made", "[device]") {
    ScriptedDevice<double> device({{.time = 0}, {.time = 1, .position = {1, 0, 0}}}, {.tick = 0.5});
    (void)device.read();
    CHECK(device.read().position == Vector3<double>(0.5, 0, 0));
}

TEST_CASE("a script of one waypoint lasts a tick", "[device]") {
    ScriptedDevice<double> device({{.time = 3, .position = {1, 2, 3}, .grasping = true}});
    CHECK(device.running());
    const auto tool = device.read();
    CHECK(tool.position == Vector3<double>(1, 2, 3));
    CHECK(tool.velocity == Vector3<double>(0, 0, 0));
    CHECK(tool.grasping);
    CHECK_FALSE(device.running());
}

TEMPLATE_TEST_CASE("the device keeps the last force, and restarts as it began", "[device]", TEST_SCALARS) {
    using S = TestType;
    ScriptedDevice<S> device(simple_script<S>(), {.tick = 0.25});
    CHECK(device.force() == Vector3<S>(0, 0, 0));
    const auto first = device.read();
    device.write({1, 2, 3});
    CHECK(device.force() == Vector3<S>(1, 2, 3));
    while (device.running()) (void)device.read();
    device.reset();
    CHECK(device.force() == Vector3<S>(0, 0, 0));
    CHECK(device.running());
    const auto again = device.read();
    CHECK(again.position == first.position);
    CHECK(again.velocity == first.velocity);
    CHECK(again.time == first.time);
}

TEST_CASE("a device is copied and moved in the middle of its script", "[device]") {
    ScriptedDevice<double> device(simple_script<double>(), {.tick = 0.25});
    for (int i = 0; i < 5; ++i) (void)device.read();
    ScriptedDevice<double> copy = device, moved = std::move(device);
    while (copy.running()) CHECK(copy.read().position == moved.read().position);
    CHECK_FALSE(moved.running());
    STATIC_REQUIRE(noexcept(copy.read()));
    STATIC_REQUIRE(noexcept(copy.write(std::declval<const Vector3<double>&>())));
    STATIC_REQUIRE(noexcept(copy.running()));
    STATIC_REQUIRE_FALSE(Device<int, double>);
    STATIC_REQUIRE_FALSE(Device<ScriptedDevice<float>, double>);
}

TEMPLATE_TEST_CASE("scripts and options that make no sense are refused by name", "[device][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const auto refused = [](const std::vector<Waypoint<S>>& script, const ScriptedDeviceOptions& options = {}) {
        return test::refusal([&] { ScriptedDevice<S> device(script, options); });
    };
    const std::string name = "ScriptedDevice: ";
    const auto good = simple_script<S>();
    CHECK(refused(good) == "");
    CHECK(refused({}) == name + "the script must have a waypoint, got none");
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        auto script = good;
        script[1].time = bad;
        CHECK(refused(script) == name + "waypoint 1 must be finite");
        script = good;
        script[2].position[1] = bad;
        CHECK(refused(script) == name + "waypoint 2 must be finite");
    }
    auto script = good;
    script[2].time = 2;
    CHECK(refused(script) == name + "waypoint 2 must come after 2 s, got 2 s");
    script[2].time = 1.5;
    CHECK(refused(script) == name + "waypoint 2 must come after 2 s, got 1.5 s");
    const double infinity = std::numeric_limits<double>::infinity();
    for (const auto& [wrong, text] :
         {std::pair<double, std::string>{0, "0"}, {-1, "-1"}, {infinity, "inf"}, {std::nan(""), "nan"}}) {
        CHECK(refused(good, {.tick = wrong}) == name + "tick must be finite and positive [s], got " + text);
    }
    for (const auto& [wrong, text] : {std::pair<double, std::string>{-1, "-1"}, {infinity, "inf"}}) {
        CHECK(refused(good, {.radius = wrong}) == name + "radius must be finite and not negative [m], got " + text);
    }
}
