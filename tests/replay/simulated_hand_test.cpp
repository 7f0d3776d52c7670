// SPDX-License-Identifier: MIT
#include <membrane/replay/simulated_hand.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include <membrane/haptics/device.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using Vector = Vector3<double>;

static_assert(Hand<SimulatedHand<double>, double> && Hand<SimulatedHand<float>, float>);
static_assert(Device<ScriptedDevice<double, SimulatedHand<double>>, double>);

namespace {

/// Damping from none to several times the critical one, which is among them.
HandOptions random_options(Random& random) {
    HandOptions options{.mass = random.number(0.01, 1.0), .stiffness = random.number(1.0, 1000.0)};
    const double critical = 2 * std::sqrt(options.mass * options.stiffness);
    const auto kind = random.index(4);
    options.damping = kind == 0 ? 0 : kind == 1 ? critical : critical * random.number(0.01, 5.0);
    return options;
}

/// The same hand by the method of Runge and Kutta, in many small steps.
struct RungeKutta {
    HandOptions options;
    Vector position, velocity, target, target_velocity;

    void advance(const Vector& force, double time, int steps) {
        const double h = time / steps;
        const auto acceleration = [&](const Vector& p, const Vector& v, double later) -> Vector {
            const Vector goal = target + later * target_velocity;
            return (force - options.stiffness * (p - goal) - options.damping * (v - target_velocity)) / options.mass;
        };
        for (int i = 0; i < steps; ++i) {
            const Vector a1 = acceleration(position, velocity, 0), v2 = velocity + h / 2 * a1;
            const Vector a2 = acceleration(position + h / 2 * velocity, v2, h / 2), v3 = velocity + h / 2 * a2;
            const Vector a3 = acceleration(position + h / 2 * v2, v3, h / 2), v4 = velocity + h * a3;
            const Vector a4 = acceleration(position + h * v3, v4, h);
            position += h / 6 * (velocity + 2 * v2 + 2 * v3 + v4);
            velocity += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
            target += h * target_velocity;
        }
    }
};

}  // namespace

TEST_CASE("a hand moves as its equation says", "[hand]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const HandOptions options = random_options(random);
        SimulatedHand<double> hand(options);
        SimulatedHand<float> coarse(options);
        const Vector start = random.vector();
        hand.reset_to(start);
        coarse.reset_to(start.cast<float>());
        RungeKutta expected{options, start, Vector::Zero(), Vector::Zero(), Vector::Zero()};
        for (int i = 0; i < 5; ++i) {
            expected.target = random.vector();
            expected.target_velocity = random.vector();
            hand.set_target(expected.target, expected.target_velocity);
            coarse.set_target(expected.target.cast<float>(), expected.target_velocity.cast<float>());
            for (int j = 0; j < 2; ++j) {  // the target goes on in between
                const Vector force = options.stiffness * random.vector();
                const double time = random.number(1e-3, 0.02);
                REQUIRE(hand.advance(force, time));
                REQUIRE(coarse.advance(force.cast<float>(), static_cast<float>(time)));
                expected.advance(force, time, 1000);
            }
            REQUIRE(norm<double>(hand.position() - expected.position) < 1e-9);
            const double rate = std::sqrt(options.stiffness / options.mass);
            REQUIRE(norm<double>(hand.velocity() - expected.velocity) < 1e-9 * (1 + rate));
            REQUIRE(norm<double>(coarse.position().cast<double>() - expected.position) < 1e-4);
        }
    }
}

TEST_CASE("any time step is stable, and many small ones come to where one large one does", "[hand]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const HandOptions options = random_options(random);
        SimulatedHand<double> large(options), small(options);
        const Vector target = random.vector(), velocity = random.vector(), force = random.vector(-10.0, 10.0);
        for (auto* hand : {&large, &small}) hand->set_target(target, velocity);
        constexpr int steps = 1000;
        const double time = std::pow(10.0, random.number(-4.0, 1.0));
        REQUIRE(large.advance(force, time));
        for (int i = 0; i < steps; ++i) REQUIRE(small.advance(force, time / steps));
        const double scale = 1 + norm(force) / options.stiffness + time;
        REQUIRE(norm<double>(large.position() - small.position()) < 1e-10 * scale);
        const double rate = std::sqrt(options.stiffness / options.mass);
        REQUIRE(norm<double>(large.velocity() - small.velocity()) < 1e-10 * scale * (1 + rate));

        large.set_target(target, Vector::Zero());
        REQUIRE(large.advance(force, 1e7));  // after which a damped one is where the force holds it
        if (options.damping == 0) continue;
        REQUIRE(norm<double>(large.position() - target - force / options.stiffness) < 1e-12 * scale);
        REQUIRE(norm(large.velocity()) < 1e-12);
    }
}

TEST_CASE("an undamped hand swings for ever, in the time that mass and spring give it", "[hand]") {
    const HandOptions options{.mass = 0.2, .stiffness = 300};
    const double period = 2 * std::numbers::pi * std::sqrt(options.mass / options.stiffness);
    SimulatedHand<double> hand(options);
    hand.reset_to({0.01, 0, 0});
    hand.set_target({0, 0, 0}, {0, 0, 0});
    REQUIRE(hand.advance({0, 0, 0}, period / 4));
    CHECK(std::abs(hand.position().x()) < 1e-16);
    CHECK(hand.velocity().x() == Approx(-0.01 * std::sqrt(options.stiffness / options.mass)));
    for (int i = 0; i < cases(100'000); ++i) REQUIRE(hand.advance({0, 0, 0}, 1e-3));
    const double energy =
        options.mass * squared_norm(hand.velocity()) + options.stiffness * squared_norm(hand.position());
    CHECK(energy == Approx(options.stiffness * 1e-4).epsilon(1e-9));
}

TEST_CASE("a hand without a force follows its script, and one that is pushed yields", "[hand]") {
    const HandOptions options{.mass = 0.1, .damping = 2, .stiffness = 300};
    using Device = ScriptedDevice<double, SimulatedHand<double>>;
    Device device({{.time = 0, .position = {1, 0, 0}}, {.time = 4, .position = {1, 0, 0.04}, .grasping = true}},
                  {.radius = 2e-3}, SimulatedHand<double>(options));
    ScriptedDevice<double> firm({{.time = 0, .position = {1, 0, 0}}, {.time = 4, .position = {1, 0, 0.04}}});
    const auto first = device.read();
    CHECK(first.position == Vector(1, 0, 0));
    CHECK(first.velocity == Vector(0, 0, 0));
    CHECK(first.radius == 2e-3);
    RungeKutta expected{options, {1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {0, 0, 0.01}};
    (void)firm.read();
    for (int i = 1; i <= 4000; ++i) {
        const Vector force(0, 0, i < 2000 ? 0 : -3);
        device.write(force);
        expected.advance(force, 1e-3, 10);
        const auto tool = device.read(), script = firm.read();
        REQUIRE(norm<double>(tool.position - expected.position) < 1e-10);
        REQUIRE(norm<double>(tool.velocity - expected.velocity) < 1e-8);
        if (i == 1999) CHECK(norm<double>(tool.position - script.position) < 1e-9);
    }
    CHECK(norm<double>(expected.position - Vector(1, 0, 0.04 - 3.0 / 300)) < 1e-8);
    CHECK_FALSE(device.running());
    device.reset();
    CHECK(device.read().position == first.position);
    device.write({0, 0, 0});
    CHECK(norm<double>(device.read().position - first.position) < 1e-4);
}

TEST_CASE("a wall swings up at a desk where the theory of sampled loops says so", "[hand]") {
    int stable = 0, unstable = 0;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const HandOptions options{.mass = random.number(0.05, 0.3),
                                  .damping = random.number(0.5, 5.0),
                                  .stiffness = random.number(10.0, 300.0)};
        const double tick = 1e-3, wall = options.damping / tick * std::pow(10.0, random.number(-1.0, 1.0));
        // A tick as a matrix, from the solutions of the equation: columns by position, by velocity, by force.
        Eigen::Matrix<double, 2, 3> by;
        for (int k = 0; k < 3; ++k) {
            RungeKutta hand{options, Vector::Zero(), Vector::Zero(), Vector::Zero(), Vector::Zero()};
            if (k == 0) hand.position.x() = 1;
            if (k == 1) hand.velocity.x() = 1;
            hand.advance({k == 2 ? 1.0 : 0.0, 0, 0}, tick, 100);
            by.col(k) << hand.position.x(), hand.velocity.x();
        }
        Eigen::Matrix2d loop = by.leftCols<2>();
        loop.col(0) -= wall * by.col(2);
        const double growth = test::spectral_radius(loop);
        if (std::abs(growth - 1) < 0.01) continue;  // would take long to see

        ScriptedDevice<double, SimulatedHand<double>> device({{.time = 0}, {.time = 2}}, {.tick = tick},
                                                             SimulatedHand<double>(options));
        device.write({1, 0, 0});
        (void)device.read();
        double first = 0, last = 0;
        for (int i = 0; i < 2000; ++i) {
            const double x = device.read().position.x();
            if (i < 50) first = std::fmax(first, std::abs(x));
            if (i >= 1950) last = std::fmax(last, std::abs(x));
            device.write({-wall * x, 0, 0});
        }
        REQUIRE((last > first) == (growth > 1));
        if (wall < 2 * options.damping / tick) REQUIRE(growth < 1);  // b > K T / 2, which is enough
        ++(growth > 1 ? unstable : stable);
    }
    CHECK(stable + unstable > 0);
    if (stable + unstable > 50) CHECK((stable > 10 && unstable > 10));
}

TEST_CASE("what is not a number does not move a hand", "[hand][bad]") {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    SimulatedHand<double> hand({.mass = 0.1, .damping = 2, .stiffness = 300});
    hand.set_target({4, 5, 6}, {7, 8, 9});
    REQUIRE(hand.advance({1, 0, 0}, 1e-3));
    hand.reset_to({1, 2, 3});
    REQUIRE(hand.advance({0, 0, 0}, 1e-3));
    CHECK(hand.position() == Vector(1, 2, 3));  // at rest, whatever was before
    REQUIRE(hand.advance({1, 0, 0}, 1e-3));
    const Vector position = hand.position(), velocity = hand.velocity();
    const auto stays = [&](const Vector& force, double dt) {
        return !hand.advance(force, dt) && hand.position() == position && hand.velocity() == velocity;
    };
    for (const double bad : {nan, infinity, -infinity}) {
        CHECK(stays({0, bad, 0}, 1e-3));
        CHECK(stays({0, 0, 0}, bad));
    }
    CHECK(stays({0, 0, 0}, -1e-3));
    CHECK(hand.advance({0, 0, 0}, 0));
    CHECK(norm<double>(hand.position() - position) < 1e-15);
    hand.set_target({nan, 0, 0}, {0, 0, 0});
    CHECK(stays({0, 0, 0}, 1e-3));
    hand.set_target({1, 2, 3}, {0, 0, 0});
    CHECK(hand.advance({0, 0, 0}, 1e-3));  // and it goes on
}

TEST_CASE("hands that cannot be are refused by name", "[hand][bad]") {
    const auto refused = [](const HandOptions& options) {
        return test::refusal([&] { SimulatedHand<double> hand(options); });
    };
    const std::string name = "SimulatedHand: ";
    CHECK(refused({.mass = 1, .stiffness = 1}) == "");
    CHECK(refused({}) == name + "mass must be finite and positive [kg], got 0");
    CHECK(refused({.mass = 1}) == name + "stiffness must be finite and positive [N/m], got 0");
    for (const auto& [wrong, text] : {std::pair<double, std::string>{-1, "-1"},
                                      {std::numeric_limits<double>::infinity(), "inf"},
                                      {std::nan(""), "nan"}}) {
        CHECK(refused({.mass = wrong, .stiffness = 1}) == name + "mass must be finite and positive [kg], got " + text);
        CHECK(refused({.mass = 1, .stiffness = wrong}) ==
              name + "stiffness must be finite and positive [N/m], got " + text);
        CHECK(refused({.mass = 1, .damping = wrong, .stiffness = 1}) ==
              name + "damping must be finite and not negative [N s/m], got " + text);
    }
    STATIC_REQUIRE(noexcept(std::declval<SimulatedHand<double>&>().advance(std::declval<const Vector&>(), 1.0)));
}
