// SPDX-License-Identifier: MIT
#include <membrane/haptics/virtual_coupling.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/certify/passivity.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<VirtualCoupling<double>, double> && ForcePolicy<VirtualCoupling<float>, float>);

namespace {

template <class S>
Vector3<S> wall(const Tool<S>& tool, S stiffness) {
    return {0, 0, stiffness * std::max(-tool.position.z(), S(0))};
}

}  // namespace

TEMPLATE_TEST_CASE("at rest two springs in a row are felt", "[coupling]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const S tissue = random.number<S>(1, 50), scale = random.number<S>(1, 60), between = random.number<S>(100, 500);
        const S firm = tissue * scale, dt = S(1e-3);
        const double damping = 1.5 * min_damping(firm, between, dt) + 0.01;
        VirtualCoupling<S> coupling({.stiffness = between, .damping = damping, .scale = scale});
        Tool<S> hand;
        Vector3<S> reaction = Vector3<S>::Zero();
        (void)coupling.update(hand, reaction, dt);
        hand.position.z() = S(-0.01);
        for (int tick = 0; tick < 3000; ++tick) reaction = wall(coupling.update(hand, reaction, dt), tissue);
        const S felt = coupling.force().z();
        REQUIRE(static_cast<double>(felt) ==
                Approx(static_cast<double>(S(0.01) * firm * between / (firm + between))).epsilon(1e-3));
        REQUIRE(static_cast<double>(scale * reaction.z()) == Approx(static_cast<double>(felt)).epsilon(1e-3));
    }
}

TEST_CASE("a coupling that restarts is as a new one", "[coupling]") {
    const CouplingOptions options{.stiffness = 300, .damping = 0.02, .scale = 30};
    VirtualCoupling<double> used(options), other(options);
    const auto follows = [&](VirtualCoupling<double>& coupling, std::uint64_t seed) {
        Random displacement(seed);
        std::vector<double> numbers{coupling.force().x(), coupling.force().y(), coupling.force().z()};
        for (int i = 0; i < 20; ++i) {
            Tool<double> hand;
            hand.position = 0.01 * displacement.vector();
            const auto tool = coupling.update(hand, displacement.vector(), 1e-3);
            for (const auto& v : {tool.position, tool.velocity, coupling.force()}) {
                numbers.insert(numbers.end(), {v.x(), v.y(), v.z()});
            }
        }
        return numbers;
    };
    static_cast<void>(follows(used, 1));
    REQUIRE(norm(used.force()) > 0);
    used.reset();
    CHECK(follows(used, 2) == follows(other, 2));
}

TEST_CASE("in free air without damping the tool is where the hand is", "[coupling]") {
    VirtualCoupling<double> coupling({.stiffness = 300});
    Random random(1);
    for (int i = 0; i < 100; ++i) {
        Tool<double> hand;
        hand.position = random.vector();
        const auto tool = coupling.update(hand, {0, 0, 0}, 1e-3);
        CHECK(norm<double>(tool.position - hand.position) < 1e-12);
        CHECK(norm(coupling.force()) < 1e-9);
    }
}

TEST_CASE("however stiff the tissue, the coupling's stiffness decides whether the loop is passive", "[coupling]") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const double dt = 1e-3, between = random.number(100.0, 800.0), scale = random.number(1.0, 50.0);
        const double firm = random.number(0.1, 20.0) * between;
        VirtualCoupling<double> coupling(
            {.stiffness = between, .damping = min_damping(firm, between, dt), .scale = scale});
        PassivityObserver observer(between * dt / 2);  // what a spring of that stiffness asks for
        Tool<double> hand;
        hand.position = {0, 0, 0.001};
        Vector3<double> reaction = Vector3<double>::Zero(), speed = Vector3<double>::Zero();
        for (int tick = 0; tick < 300; ++tick) {
            reaction = wall(coupling.update(hand, reaction, dt), firm / scale);
            observer.update(hand.position, coupling.force(), dt);
            if (random.chance(0.3)) speed = random.vector(-0.3, 0.3);
            if (std::abs(hand.position.z()) > 0.005) speed.z() = hand.position.z() > 0 ? -0.3 : 0.3;
            hand.position += dt * speed;
        }
        if (observer.min_energy() < -1e-9 * observer.energy_in())
            FAIL("seed " << seed << ": " << observer.min_energy() << " J");
    }
    CHECK(min_damping(100, 300, 1e-3) == 0);
    CHECK(min_damping(500, 300, 1e-3) == Approx(0.1));
}

TEST_CASE("a coupling lets go of what is no number, and refuses what makes no sense", "[coupling][bad]") {
    VirtualCoupling<double> coupling({.stiffness = 300});
    Tool<double> hand;
    (void)coupling.update(hand, {0, 0, 0}, 1e-3);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(coupling.update(hand, {0, nan, 0}, 1e-3).position == hand.position);
    CHECK(coupling.force() == Vector3<double>(0, 0, 0));
    (void)coupling.update(hand, {0, 0, 0}, 1e-3);
    CHECK(coupling.update(hand, {0, 0, 1e308}, 1e-300).position == hand.position);
    CHECK(is_finite(coupling.force()));
    CHECK(is_finite(coupling.update(hand, {0, 0, 0}, 0).position));
    const auto refused = [](const CouplingOptions& options) {
        return test::refusal([&] { const VirtualCoupling<double> made(options); });
    };
    CHECK(refused({.stiffness = 0}) == "VirtualCoupling: stiffness must be finite and positive [N/m], got 0");
    CHECK(refused({.stiffness = 1, .damping = -1}) ==
          "VirtualCoupling: damping must be finite and not negative [N s/m], got -1");
    CHECK(refused({.stiffness = 1, .scale = -1}) ==
          "VirtualCoupling: scale must be finite and not negative [1], got -1");
}
