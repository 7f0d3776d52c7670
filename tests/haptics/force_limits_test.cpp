// SPDX-License-Identifier: MIT
#include <membrane/haptics/force_limits.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <membrane/replay/snapshot.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/force_change.hpp"
#include "support/haptic_loop.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/traps.hpp"

using namespace membrane;
using test::Random;
using test::size_of;
using test::within_slew;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

/// Nothing but the device's peak.
constexpr LimitOptions only_peak{.rise_time = 0, .soft_start = 0, .max_state_age = infinity, .thermal_limit = false};

/// A limiter in its loop: a tick of 1 ms, a solve in each.
template <class S>
struct Loop {
    ForceLimiter limit;
    double now = 0;
    std::uint64_t solves = 0;

    Vector3<S> tick(const Vector3<S>& force, double dt = 1e-3) {
        now += dt;
        return limit(force, now, ++solves);
    }
};

/// A hand that taps and strokes, a solver that takes its time, and whatever can go wrong.
template <class S>
class FaultInjector {
  public:
    explicit FaultInjector(std::uint64_t seed) : random_(seed) {}

    void tick() {
        if (left_ == 0) {
            fault_ = fault_ == 0 && random_.chance(0.7) ? 1 + random_.index(7) : 0;
            left_ = fault_ == 0 ? 1 + random_.index(900) : 1 + random_.index(fault_ == 4 ? 300 : 20);
        }
        --left_;
        tip_ += 1e-3 * random_.number(1.0, 9.0);
        dt = fault_ == 5 ? 0.05 : 1e-3 * random_.number(0.5, 1.5);
        if (fault_ == 6) tip_ += random_.number(0.0, 100.0);  // teleported
        if (fault_ == 7) dt = -dt;
        now += dt;
        if (fault_ != 4 && random_.chance(0.2)) state += 1;
        force = size_ * Vector3<S>(static_cast<S>(std::sin(tip_)), static_cast<S>(std::cos(0.3 * tip_)), S(0.2));
        const auto wild = [&] {
            constexpr std::array<double, 4> numbers{nan_value, infinity, -infinity, nan_value};
            return static_cast<S>(numbers[static_cast<std::size_t>(random_.index(4))]);
        };
        if (fault_ == 1) force[random_.index(3)] = wild();
        if (fault_ == 2) force = static_cast<S>(1e6) * random_.unit_vector<S>();
        if (fault_ == 3) force = std::numeric_limits<S>::max() * random_.unit_vector<S>();
    }

    [[nodiscard]] bool faulty() const { return fault_ != 0; }

    double now = 0, dt = 0;
    std::uint64_t state = 1;
    Vector3<S> force = Vector3<S>::Zero();

  private:
    static constexpr S size_ = S(0.5);  // with all three numbers less than the Touch bears for ever
    Random random_;
    int fault_ = 0, left_ = 0;
    double tip_ = 0;
};

}  // namespace

TEMPLATE_TEST_CASE("whatever goes wrong, each tick keeps within device and slew", "[limits]", TEST_SCALARS) {
    using S = TestType;
    const auto device = devices::touch;
    const LimitOptions options;
    const double slew = device.peak_force / options.rise_time;
    ForceLimiter limit(device, options);
    FaultInjector<S> scene(7);
    Vector3<S> before = Vector3<S>::Zero();
    double clean_since = 0, last_solve = 0, last = 0, thermal_load = 0;
    std::uint64_t state = 0;
    long whole = 0, frozen = 0;
    const int ticks = cases(500'000);  // of each scalar
    for (int i = 0; i < ticks; ++i) {
        scene.tick();
        const Vector3<S> felt = limit(scene.force, scene.now, scene.state);
        const double size = size_of(felt);
        if (scene.state != state || scene.dt < 0) last_solve = scene.now;
        state = scene.state;
        if (scene.faulty() || scene.now - last_solve > options.max_state_age) clean_since = scene.now;
        const double relative = size_of(before) / device.continuous_force;
        thermal_load +=
            scene.dt > 0 ? (relative * relative - thermal_load) * (1 - std::exp(-scene.dt / device.thermal_time)) : 0;

        const double may_change = slew * std::clamp(scene.now - last, 0.0, options.max_tick);
        last = scene.now;
        const bool within = is_finite(felt) && size <= device.peak_force && within_slew(before, felt, may_change);
        if (!within) {
            CAPTURE(i, size, before, felt);
            REQUIRE(within);
        }
        if (scene.now - last_solve > 0.1) {
            ++frozen;
            if (size != 0) FAIL("frozen, and " << size << " N at tick " << i);
        }
        if (scene.now - clean_since > 0.2) {
            ++whole;
            if (felt != scene.force || limit.active_limits().any()) FAIL("not the policy's force at tick " << i);
        }
        before = felt;
    }
    CHECK(frozen > ticks / 200);  // the cases that the test is about did occur
    CHECK(whole > ticks / 20);
    CHECK(thermal_load < 1);
    CHECK(limit.thermal_load() < 1);
}

TEMPLATE_TEST_CASE("whatever goes wrong in a whole loop, the hand gets what the device bears", "[limits]",
                   TEST_SCALARS) {
    using S = TestType;
    const LimitOptions options;
    test::HapticLoop<S> loop(11);
    test::FaultInjector faults(5);
    const auto device = loop.limit.device();
    const double slew = device.peak_force / options.rise_time;
    Vector3<S> before = Vector3<S>::Zero(), asked_before = before;
    double last = 0, clean_since = 0, last_solve = 0;
    std::uint64_t solves = 0;
    long frozen = 0, whole = 0, pushed = 0;
    const int ticks = cases(8'000, 500'000);  // of each scalar
    for (int i = 0; i < ticks; ++i) {
        const auto fault = faults.next();
        loop.tick(fault);
        const double size = size_of(loop.felt), asked = size_of(loop.asked);
        const double may_change = slew * std::clamp(loop.now - last, 0.0, options.max_tick);
        if (!(is_finite(loop.felt) && size <= device.peak_force && within_slew(before, loop.felt, may_change))) {
            FAIL("tick " << i << ": " << loop.felt.transpose() << " N after " << before.transpose() << " N");
        }
        if (loop.solves != solves) last_solve = loop.now;
        if (loop.now - last_solve > 0.1) {
            ++frozen;
            if (size != 0) FAIL("frozen, and " << size << " N at tick " << i);
        }
        // A policy that asks for more than the device bears, or for it too suddenly, is no fault, but is limited.
        const bool bearable =
            asked <= device.continuous_force && within_slew(asked_before, loop.asked, slew * loop.dt * (1 - 1e-5));
        if (fault.any() || loop.solves == solves || !bearable) clean_since = loop.now;
        if (loop.now - clean_since > 0.2) {
            ++whole;
            pushed += asked > 0;
            if (loop.felt != loop.asked || loop.limit.active_limits().any())
                FAIL("not the policy's force at tick " << i);
        }
        before = loop.felt;
        asked_before = loop.asked;
        last = loop.now;
        solves = loop.solves;
    }
    CHECK(loop.x.allFinite());
    if (ticks < 8'000) return;
    CHECK(frozen > ticks / 200);  // the cases that the test is about did occur
    CHECK(whole > ticks / 5);
    CHECK(pushed > ticks / 20);
    CHECK(loop.refused > 0);
}

TEMPLATE_TEST_CASE("inside the limits a force passes with the same bits", "[limits]", TEST_SCALARS) {
    using S = TestType;
    const auto device = devices::phantom_desktop;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Loop<S> loop{ForceLimiter(device)};
        Vector3<S> force = Vector3<S>::Zero();
        for (int i = 0; i < 110; ++i) (void)loop.tick(force);
        for (int i = 0; i < 200; ++i) {
            Vector3<S> next = force + random.vector<S>(S(-0.1), S(0.1));
            if (random.chance(0.02)) next = S(0.1) * force;  // falls at once
            if (random.chance(0.02)) next = Vector3<S>::Zero();
            if (size_of(force) < 0.19) next = -force;  // across zero, by less than the 0.395 N of a tick
            if (size_of(next) > 1.7) next = S(0.5) * force;
            force = next;
            REQUIRE(loop.tick(force) == force);
            REQUIRE_FALSE(loop.limit.active_limits().any());
        }
    }
    Loop<double> loop{ForceLimiter(device)};
    for (int i = 0; i < 110; ++i) (void)loop.tick({0, 0, 0});
    CHECK(std::signbit(loop.tick({-0.0, 0, 0}).x()));
}

TEST_CASE("a force is shortened along itself, never beyond the limit", "[limits]") {
    const test::FloatingPointTraps traps;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const double most = std::pow(10, random.number(-3.0, 2.0));
        const Vector3<double> force = std::pow(10, random.number(-4.0, 300.0)) * random.unit_vector();
        const Vector3<double> felt = detail::shortened(force, most);
        const double size = force.eigen().stableNorm();
        const bool good = size <= most ? felt == force
                                       : norm(felt) <= most && norm(felt) >= most * (1 - 1e-14) &&
                                             (felt / most - force / size).norm() < 1e-14;
        if (!good) FAIL("seed " << seed);
        const Vector3<float> single = random.number<float>(0, 100) * random.unit_vector<float>();
        if (size_of(detail::shortened(single, most)) > most) FAIL("float, seed " << seed);
    }
    CHECK(detail::shortened<double>({3, 0, 4}, 0) == Vector3<double>(0, 0, 0));
}

TEST_CASE("a solver that stops is felt for 90 ms and at most a tick, at any rate", "[limits]") {
    for (const double rate : {300.0, 500.0, 700.0, 1000.0, 3000.0}) {
        CAPTURE(rate);
        Loop<double> loop{ForceLimiter(devices::touch)};
        const double tick = 1 / rate;
        for (int i = 0; i < rate; ++i) (void)loop.tick({0, 0, 0.5}, tick);
        int ticks = 0;
        do {
            ++ticks;
            loop.now += tick;
        } while (loop.limit(Vector3<double>(0, 0, 0.5), loop.now, loop.solves).z() > 0);
        CHECK(ticks * tick >= 0.09 - 1e-9);
        CHECK(ticks * tick < 0.09 + tick + 1e-9);
    }
}

TEST_CASE("a solver that stops at 1 kHz is felt no longer than 91 ms", "[limits]") {
    Loop<double> loop{ForceLimiter(devices::touch)};
    const Vector3<double> force(0, 0, 0.5);
    for (int i = 0; i < 150; ++i) (void)loop.tick(force);
    double before = 0.5;
    for (int i = 1; i <= 300; ++i) {
        loop.now += 1e-3;
        const double felt = loop.limit(force, loop.now, loop.solves).z();
        CAPTURE(i, felt);
        if (i <= 39) REQUIRE(felt == 0.5);
        if (i > 41) REQUIRE((felt < before || felt == 0));
        if (i >= 91) REQUIRE(felt == 0);
        REQUIRE(loop.limit.active_limits().faded == (felt < 0.5));
        before = felt;
    }
    int back = 0;
    while (loop.tick(force) != force) ++back;
    CHECK(back < 102);
    CHECK(back > 95);
}

TEST_CASE("after a fault the force is zero at once, and comes back slowly", "[limits]") {
    for (const Vector3<double>& bad : {Vector3<double>(nan_value, 0, 0), Vector3<double>(0, infinity, 0)}) {
        Loop<double> loop{ForceLimiter(devices::touch)};
        const Vector3<double> force(0.5, 0, 0);
        for (int i = 0; i < 150; ++i) (void)loop.tick(force);
        CHECK(loop.tick(bad) == Vector3<double>(0, 0, 0));
        CHECK(loop.limit.active_limits().fault);
        for (int i = 1; i <= 99; ++i) {
            const auto felt = loop.tick(force);
            REQUIRE(felt.x() == Approx(0.005 * i));
            REQUIRE(loop.limit.gain() == Approx(0.01 * i));
        }
        (void)loop.tick(force);
        (void)loop.tick(force);
        CHECK(loop.tick(force) == force);
        CHECK(loop.limit(force, nan_value, 1) == Vector3<double>(0, 0, 0));  // a clock that is none
        CHECK(loop.limit.active_limits().fault);
    }
}

TEST_CASE("a fall straight to zero is not slowed, all else is, also in a gap", "[limits]") {
    const LimitOptions options{.soft_start = 0};
    Loop<double> loop{ForceLimiter(devices::touch, options)};
    CHECK(loop.tick({3, 0, 0}) == Vector3<double>(0, 0, 0));  // no time has passed
    for (int i = 1; i <= 18; ++i) {
        REQUIRE(loop.tick({3, 0, 0}).x() == Approx(0.165 * i));
        REQUIRE(loop.limit.active_limits().slew);
    }
    CHECK(loop.tick({3, 0, 0}).x() == 3);
    CHECK(loop.tick({0.1, 0, 0}).x() == 0.1);
    CHECK(loop.tick({0, -0.1, 0}).y() == -0.1);
    const double across = std::sqrt(0.33 * 0.33 - 0.1 * 0.1);  // what is left beside the fall to zero
    CHECK(loop.tick({3, 0, 0}, 0.05).x() == Approx(across));   // 50 ms count for 2
    CHECK(loop.tick({3, 0, 0}, 0).x() == Approx(across));      // a clock that stands still
    CHECK(loop.tick({2, 2, 0}, 0).y() == 0);                   // holds what there is
    CHECK(loop.tick({3, 0, 0}, -5).x() == Approx(across));     // or jumps back
    CHECK(loop.tick({0.2, 0.2, 0}, 0).x() == Approx(0.2));     // and lets it fall
    CHECK(loop.tick({0, 0, 0}).x() == 0);
}

TEST_CASE("a force that turns about goes through zero", "[limits]") {
    Loop<double> loop{ForceLimiter(devices::touch)};
    for (int i = 0; i < 200; ++i) (void)loop.tick({0, 0, 1});
    for (int turn = 0; turn < 3; ++turn) {
        const double sign = turn % 2 == 0 ? -1 : 1;
        CHECK(loop.tick({0, 0, sign}) == Vector3<double>(0, 0, 0));
        CHECK(loop.limit.active_limits().slew);
        for (int i = 1; i <= 6; ++i) REQUIRE(loop.tick({0, 0, sign}).z() == Approx(sign * 0.165 * i));
        REQUIRE(loop.tick({0, 0, sign}).z() == sign);
    }
    // One that turns about in each tick is hardly felt.
    for (int i = 0; i < 100; ++i) REQUIRE(size_of(loop.tick({0, 0, i % 2 == 0 ? 1.0 : -1.0})) <= 0.165);
}

TEMPLATE_TEST_CASE("however a force jumps and turns, its change is bounded but for a fall to zero", "[limits]",
                   TEST_SCALARS) {
    using S = TestType;
    const double slew = devices::touch.peak_force / LimitOptions{}.rise_time;
    constexpr double rounding = 8 * static_cast<double>(std::numeric_limits<S>::epsilon());
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Loop<S> loop{ForceLimiter(devices::touch, {.soft_start = 0, .thermal_limit = false})};
        Vector3<S> before = loop.tick(Vector3<S>::Zero());
        Vector3<S> asked = Vector3<S>::Zero();
        Vector3<S> axis = random.unit_vector<S>();
        const auto rate = static_cast<S>(std::pow(10, random.number(-3.0, 0.5)));  // [rad] in a tick
        for (int i = 0; i < 300; ++i) {
            const Vector3<S> turned = std::cos(rate) * asked + std::sin(rate) * cross(axis, asked);
            switch (random.index(30)) {
                case 0: asked = static_cast<S>(random.number(0.0, 3.3)) * random.unit_vector<S>(); break;
                case 1: asked = -asked; break;
                case 2: asked *= static_cast<S>(random.number(0.0, 1.0)); break;
                case 3: asked = S(0.3) * asked + S(0.02) * random.unit_vector<S>(); break;
                case 4: asked.setZero(); break;
                case 5: axis = random.unit_vector<S>(); break;
                default: asked = turned;
            }
            const double dt = random.chance(0.05) ? 0 : 1e-3 * random.number(0.2, 3.0);
            const double time = loop.now;
            const Vector3<S> felt = loop.tick(asked, dt);
            const double change = slew * std::clamp(loop.now - time, 0.0, 2e-3);
            const Vector3<double> f = asked.template cast<double>(), g = felt.template cast<double>();
            CAPTURE(i, before, asked, felt, change);
            if (!within_slew(before, felt, change)) FAIL("changed by too much");
            if (!(norm(g) <= norm(f) * (1 + rounding))) FAIL("larger than asked for");
            if (!(dot(g, f) >= squared_norm(g) - rounding * norm(g) * norm(f))) FAIL("against what is asked for");
            if (within_slew(before, asked, change * (1 - 1e-5) - 1e-5) && size_of(asked) < 3.3 &&
                (felt - asked).norm() > S(rounding) * before.norm()) {
                FAIL("not passed");
            }
            before = felt;
        }
        // It comes to a steady force, straight, in no more ticks than that takes.
        asked = static_cast<S>(random.number(0.0, 3.2)) * random.unit_vector<S>();
        const double far = norm<double>((asked - before).template cast<double>());
        for (int i = 0; i <= static_cast<int>(far / (slew * 1e-3)) + 1; ++i) before = loop.tick(asked);
        REQUIRE(before == asked);
    }
}

TEST_CASE("a solver that stops while the force turns fades all the same", "[limits]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Loop<double> loop{ForceLimiter(devices::touch)};
        for (int i = 0; i < 200; ++i) (void)loop.tick(3 * random.unit_vector());
        for (int i = 1; i <= 200; ++i) {
            loop.now += 1e-3;
            const double most = i <= 40 ? 3 : std::max(3 * (90 - i) / 50.0, 0.0) + 1e-9;
            REQUIRE(norm(loop.limit(Vector3<double>(3 * random.unit_vector()), loop.now, loop.solves)) <= most);
            if (i >= 91) REQUIRE(loop.limit.gain() == 0);
        }
    }
}

TEST_CASE("a clock that stands still does not blind the watchdog", "[limits]") {
    ForceLimiter limit(devices::touch, {.rise_time = 0, .soft_start = 0});
    int ticks = 0;
    while (limit(Vector3<double>(0.5, 0, 0), 1.0, 1).x() > 0 && ticks < 1000) ++ticks;
    CHECK(ticks > 20);
    CHECK(ticks < 50);  // each counts as the longest tick
}

TEST_CASE("the watchdog fades from fresh to nothing, and forgives at once", "[limits]") {
    Watchdog dog(0.04, 0.05);
    CHECK(dog.update(1, 0.01) == 1);
    CHECK(dog.update(1, 0.04) == 1);
    CHECK(dog.update(1, 0.025) == Approx(0.5));
    CHECK(dog.update(1, 0.025) == Approx(0).margin(1e-12));
    CHECK(dog.update(1, 1) == 0);
    CHECK(dog.update(2, 1) == 1);
    Watchdog strict(0.04, 0);
    (void)strict.update(1, 0);
    CHECK(strict.update(1, 0.041) == 0);
    Watchdog patient(infinity, 0.05);
    CHECK(patient.update(0, 1e9) == 1);
}

TEST_CASE("a soft start rises evenly and falls at once", "[limits]") {
    SoftStart start(0.1);
    for (int i = 1; i <= 9; ++i) CHECK(start.update(1, 0.01) == Approx(0.1 * i));
    CHECK(start.update(0.3, 0.01) == 0.3);
    CHECK(start.update(1, 0.01) == Approx(0.4));
    CHECK(start.update(1, 1) == 1);
    CHECK(SoftStart(0).update(1, 0) == 1);
}

TEST_CASE("motors warm up as a first-order model does, and are not asked for more than they bear", "[limits]") {
    const auto device = devices::touch;
    MotorThermalModel heat(device);
    CHECK(heat.max_force() == device.peak_force);
    const double relative = 0.5;
    for (int i = 1; i <= 30'000; ++i) {
        heat.add(relative * device.continuous_force, 1e-3);
        if (i % 5000 == 0) {
            const double exact = relative * relative * (1 - std::exp(-1e-3 * i / device.thermal_time));
            REQUIRE(heat.thermal_load() == Approx(exact).epsilon(1e-3));
        }
    }
    for (const auto& strong : {devices::touch, devices::phantom_desktop, devices::premium_1_5, devices::premium_3_0}) {
        Loop<double> loop{ForceLimiter(strong)};
        double least = strong.peak_force, grain_size = 0;
        for (int i = 0; i < 60'000; ++i) {  // a minute of too much
            const double felt = loop.tick({0, 100, 0}).y();
            if (i > 110) {
                REQUIRE(felt >= strong.continuous_force * (1 - 1e-12));
                grain_size = std::max(grain_size, least - felt);
                least = std::min(least, felt);
            }
            REQUIRE(loop.limit.thermal_load() <= 1);
        }
        CHECK(least == Approx(strong.continuous_force).epsilon(0.02));
        CHECK(loop.limit.active_limits().heat);
        CHECK(grain_size < 0.03 * strong.peak_force);  // down in small steps
    }
}

TEST_CASE("a wild reading of the clock is got over", "[limits]") {
    const test::FloatingPointTraps traps;
    constexpr double most = std::numeric_limits<double>::max();
    for (const double wild : {most, 1.7e308, -1.7e308, 1e30, -1e30, 1e6, -1e6}) {
        for (const double thermal_time : {10.0, 0.5, 1e-300}) {
            for (const double rise_time : {0.02, 0.0}) {
                CAPTURE(wild, thermal_time, rise_time);
                auto device = devices::touch;
                device.thermal_time = thermal_time;
                Loop<double> loop{ForceLimiter(device, {.rise_time = rise_time})};
                for (int i = 0; i < 300; ++i) (void)loop.tick({0, 0, 3.3});
                (void)loop.limit(Vector3<double>(0, 0, 3.3), wild, ++loop.solves);
                for (int i = 0; i < 40'000; ++i) {
                    const double felt = loop.tick({0, 0, 0.5}).z();
                    REQUIRE((felt >= 0 && felt <= 0.5));
                }
                CHECK(loop.limit.thermal_load() >= 0);
                if (thermal_time < 0.1) continue;  // warm at once, whatever the clock
                CHECK(loop.limit.thermal_load() < 0.75);
                double felt = 0;
                for (int i = 0; i < 25; ++i) felt = std::max(felt, loop.tick({0, 0, 3.3}).z());
                CHECK(felt > 3.2);  // the peak is there again
            }
        }
    }
}

TEST_CASE("in a gap motors warm up as the force that is held has them do", "[limits]") {
    for (const auto& device : {devices::touch, devices::phantom_desktop, devices::premium_1_5, devices::premium_3_0}) {
        const double hottest = std::pow(device.peak_force / device.continuous_force, 2);
        for (const double gap : {0.04, 0.1, 0.2, 0.5, 2.0, 1e3}) {
            CAPTURE(device.name, gap);
            for (int rest_ticks = 110; rest_ticks < 6000; rest_ticks += 65) {
                Loop<double> loop{ForceLimiter(device)};
                for (int i = 0; i < rest_ticks; ++i) (void)loop.tick({0, 0, device.peak_force});
                const double before = loop.limit.thermal_load();
                const double held = loop.tick({0, 0, device.peak_force}).z() / device.continuous_force;
                (void)loop.tick({0, 0, device.peak_force}, gap);
                const double share = -std::expm1(-gap / device.thermal_time);
                const double exact = before + share * (held * held - before);
                REQUIRE(loop.limit.thermal_load() ==
                        Approx(exact).epsilon(0.005).margin(0.03 * hottest * share * share + 0.01));
                REQUIRE(loop.limit.thermal_load() <= (gap > 0.04 ? hottest : 1));
            }
        }
    }
}

TEST_CASE("each limit can be taken off", "[limits]") {
    Loop<double> loop{ForceLimiter(devices::touch, only_peak)};
    CHECK(loop.tick({3.2, 0, 0}).x() == 3.2);
    CHECK(loop.tick({0, -3.2, 0}).y() == -3.2);
    CHECK_FALSE(loop.limit.active_limits().any());
    CHECK(loop.tick({0, 0, 5}).z() == Approx(3.3));
    CHECK(loop.limit.active_limits().peak);
    for (int i = 0; i < 20'000; ++i) REQUIRE(loop.limit(Vector3<double>(0, 3.2, 0), 1e-3 * i, 1).y() == 3.2);
    CHECK(loop.limit.thermal_load() > 1);  // it still counts
}

TEST_CASE("a limiter that restarts begins softly, with motors as warm as they are", "[limits]") {
    Loop<double> loop{ForceLimiter(devices::touch)};
    for (int i = 0; i < 300; ++i) (void)loop.tick({0.8, 0, 0});
    const double thermal_load = loop.limit.thermal_load();
    loop.limit.reset();
    CHECK(loop.limit.thermal_load() == thermal_load);
    CHECK(loop.tick({0.8, 0, 0}).x() == 0);
    CHECK(loop.tick({0.8, 0, 0}).x() == Approx(0.008));
    STATIC_REQUIRE(noexcept(loop.limit(std::declval<const Vector3<float>&>(), 0.0, 0)));
}

TEST_CASE("a limiter restored from a snapshot goes on with the same bits", "[limits]") {
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Loop<double> loop{ForceLimiter(devices::touch)};
        for (Index i = random.index(200); i > 0; --i) loop.tick(5 * random.vector());
        std::vector<std::byte> saved(snapshot_capacity(loop.limit));
        REQUIRE(save_snapshot(saved, loop.limit) > 0);
        auto other = loop;
        for (Index i = random.index(200); i > 0; --i) other.tick(5 * random.vector(), 5e-3);
        REQUIRE(restore_snapshot(saved, other.limit));
        other.now = loop.now, other.solves = loop.solves;
        for (int tick = 0; tick < 50; ++tick) {
            const Vector3<double> force = 5 * random.vector();
            REQUIRE(other.tick(force) == loop.tick(force));
        }
    }
}

TEST_CASE("a watchdog restored from a snapshot fades on from where it was", "[limits]") {
    Watchdog watchdog(0.01, 0.1);
    for (int i = 0; i < 50; ++i) watchdog.update(7, 1e-3);
    std::vector<std::byte> saved(snapshot_capacity(watchdog));
    REQUIRE(save_snapshot(saved, watchdog) > 0);
    Watchdog other(0.01, 0.1);
    REQUIRE(restore_snapshot(saved, other));
    const double factor = watchdog.update(7, 1e-3);
    CHECK(factor == Approx(1 - (0.051 - 0.01) / 0.1).margin(0.011));
    CHECK(other.update(7, 1e-3) == factor);
}

TEST_CASE("limits that make no sense are refused by name", "[limits][bad]") {
    const auto refused = [](const LimitOptions& options) {
        return test::refusal([&] { const ForceLimiter limit(devices::touch, options); });
    };
    CHECK(refused({}) == "");
    CHECK(refused(only_peak) == "");
    CHECK(refused({.rise_time = -1}) == "ForceLimiter: rise_time must be finite and not negative [s], got -1");
    CHECK(refused({.soft_start = infinity}) == "ForceLimiter: soft_start must be finite and not negative [s], got inf");
    CHECK(refused({.fade_time = -2}) == "ForceLimiter: fade_time must be finite and not negative [s], got -2");
    CHECK(refused({.max_tick = 0}) == "ForceLimiter: max_tick must be finite and positive [s], got 0");
    CHECK(refused({.max_state_age = 0}) == "ForceLimiter: max_state_age must be positive [s], got 0");
    CHECK(refused({.max_state_age = -infinity}) == "ForceLimiter: max_state_age must be positive [s], got -inf");
    CHECK(refused({.max_state_age = nan_value}) != "");
    auto device = devices::touch;
    device.peak_force = -1;
    CHECK(test::refusal([&] { const ForceLimiter limit(device); }) ==
          "DeviceProfile: peak_force must be finite and positive [N], got -1");
}
