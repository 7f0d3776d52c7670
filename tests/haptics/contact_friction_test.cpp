// SPDX-License-Identifier: MIT
#include <membrane/haptics/contact_friction.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <membrane/certify/passivity.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<ContactFriction<SpringDamperForce>, double>);
static_assert(ForcePolicy<ContactFriction<SpringDamperForce, float>, float>);

namespace {

template <class S>
HapticState<S> touching(const Vector3<S>& position, const Vector3<S>& normal, S depth) {
    HapticState<S> state{};
    state.tool.position = position;
    state.contact.phase = ContactPhase::ongoing;
    state.contact.depth = depth;
    state.contact.normal = normal;
    return state;
}

}  // namespace

TEMPLATE_TEST_CASE("a tool sticks up to the cone, slips on it, and sticks again", "[friction]", TEST_SCALARS) {
    using S = TestType;
    // 1 N along the normal, so 0.2 N along the surface at most: 2 mm of sticking.
    ContactFriction<SpringDamperForce, S> feel({.stiffness = 100}, {.coefficient = 0.2, .stiffness = 100});
    const auto along = [&](double x) {
        const auto force = feel(touching<S>({static_cast<S>(x), 0, 0}, {0, 0, 1}, S(0.01)));
        CHECK(static_cast<double>(force.z()) == Approx(1));
        CHECK(force.y() == 0);
        return static_cast<double>(force.x());
    };
    CHECK(along(0) == 0);
    for (int i = 1; i <= 19; ++i) {
        CHECK(along(1e-4 * i) == Approx(-1e-2 * i).epsilon(1e-4));
        CHECK_FALSE(feel.slips());
    }
    for (int i = 21; i <= 40; ++i) {
        CHECK(along(1e-4 * i) == Approx(-0.2).epsilon(1e-4));
        CHECK(feel.slips());
    }
    for (int i = 39; i >= 1; --i) {  // back: in the other sense from where it has slipped to, 2 mm
        CHECK(along(1e-4 * i) == Approx(-1e-2 * (i - 20)).margin(1e-4));
        CHECK_FALSE(feel.slips());
    }
}

TEST_CASE("friction keeps to the cone, acts along the surface, and gives no energy", "[friction]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const double dt = 1e-3, pressing = random.number(50.0, 500.0), sticking = random.number(50.0, 500.0);
        const double coefficient = random.number(0.0, 1.0);
        const auto normal = random.unit_vector();
        const SpringDamperForce press{.stiffness = pressing};
        ContactFriction feel(press, {.coefficient = coefficient, .stiffness = sticking});
        PassivityObserver observer(std::max(pressing, sticking) * dt / 2);
        Vector3<double> position = 0.001 * normal, speed = Vector3<double>::Zero();
        for (int tick = 0; tick < 300; ++tick) {
            const double depth = -dot(position, normal);
            auto state = touching<double>(position, normal, std::max(depth, 0.0));
            if (depth <= 0) state.contact.phase = ContactPhase::none;
            const auto without = press(state), force = feel(state);
            const Vector3<double> friction = force - without;
            if (std::abs(dot(friction, normal)) > 1e-12) FAIL("along the normal, seed " << seed);
            if (norm(friction) > coefficient * norm(without) + 1e-12) FAIL("beyond the cone, seed " << seed);
            if (depth <= 0 && norm(force) > 0) FAIL("off the surface, seed " << seed);
            observer.update(position, force, dt);
            if (random.chance(0.2)) speed = random.vector(-0.2, 0.2);
            if (std::abs(depth) > 0.004) speed = (depth > 0 ? 0.2 : -0.2) * normal;
            position += dt * speed;
        }
        if (observer.min_energy() < -1e-9 * observer.energy_in())
            FAIL("seed " << seed << ": " << observer.min_energy() << " J");
    }
}

TEST_CASE("what is held does not rub, and what is no number is forgotten", "[friction][bad]") {
    const SpringDamperForce press{.stiffness = 100};
    ContactFriction feel(press, {.coefficient = 0.5, .stiffness = 100});
    auto state = touching<double>({0, 0, 0}, {0, 0, 1}, 0.01);
    (void)feel(state);
    state.tool.position.x() = 0.001;
    CHECK(feel(state).x() == Approx(-0.1));
    state.grasp.triangle = 1;
    state.grasp.origin = state.tool.position;
    CHECK(feel(state) == press(state));
    state.grasp = {};
    CHECK(feel(state).x() == 0);  // a new place to stick to
    state.tool.position.x() = std::numeric_limits<double>::quiet_NaN();
    CHECK(is_finite(feel(state)));
    state.tool.position.x() = 0.5;
    CHECK(feel(state).x() == 0);
    for (int seed = 1; seed <= cases(2000); ++seed) {  // numbers of any size
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto any = [&] { return std::pow(10, random.number(-300.0, 300.0)); };
        ContactFriction wild(press, {.coefficient = any(), .stiffness = any()});
        const double depth = any();
        for (int tick = 0; tick < 3; ++tick) {
            REQUIRE(is_finite(wild(touching<double>({any(), any(), 0}, {0, 0, 1}, depth))));
        }
    }
    const auto refused = [&](const FrictionOptions& options) {
        return test::refusal([&] { const ContactFriction made(press, options); });
    };
    CHECK(refused({.coefficient = -1, .stiffness = 1}) ==
          "ContactFriction: coefficient must be finite and not negative [1], got -1");
    CHECK(refused({.coefficient = 1, .stiffness = 0}) ==
          "ContactFriction: stiffness must be finite and positive [N/m], got 0");
}
