// SPDX-License-Identifier: MIT
#include <membrane/haptics/force_policy.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<SpringDamperForce, double> && ForcePolicy<SpringDamperForce, float>);
static_assert(ForcePolicy<ReactionForce, double> && ForcePolicy<ReactionForce, float>);

namespace {

template <class S>
HapticState<S> touching(S depth, const Vector3<S>& normal, const Vector3<S>& velocity) {
    HapticState<S> state{};
    state.tool.velocity = velocity;
    state.contact.phase = ContactPhase::ongoing;
    state.contact.depth = depth;
    state.contact.normal = normal;
    return state;
}

template <class S>
HapticState<S> pulling(const Vector3<S>& displacement, const Vector3<S>& velocity) {
    HapticState<S> state{};
    state.grasp.triangle = 3;
    state.grasp.origin = Vector3<S>(1, 2, 3);
    state.grasp.offset = Vector3<S>(S(0.25), 0, S(-0.5));
    state.tool.position = state.grasp.origin + displacement - state.grasp.offset;
    state.tool.velocity = velocity;
    return state;
}

}  // namespace

TEMPLATE_TEST_CASE("touching, the force is depth and velocity along the normal", "[force]", TEST_SCALARS) {
    using S = TestType;
    const SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const S depth = random.number<S>(0, S(0.01));
        const Vector3<S> normal = random.unit_vector<S>(), velocity = random.vector<S>();
        auto state = touching(depth, normal, velocity);
        state.contact.body_velocity = random.vector<S>();
        const Vector3<S> force = feel(state);
        // F = -k x - mu v along the normal, x and v being inward: it pushes out, or not at all.
        const S inward = dot(state.contact.body_velocity, normal) - dot(velocity, normal);
        const S expected = std::max(S(0), 100 * depth + S(0.5) * inward);
        REQUIRE(norm<S>(force - expected * normal) <= 32 * std::numeric_limits<S>::epsilon());
        REQUIRE(dot(force, normal) >= 0);
    }
    const SpringDamperForce stiff{.stiffness = 200};
    CHECK(stiff(touching<S>(S(0.5), {0, 0, 1}, {5, 5, 5})) == Vector3<S>(0, 0, 100));
}

TEMPLATE_TEST_CASE("touching nothing and holding nothing there is no force", "[force]", TEST_SCALARS) {
    using S = TestType;
    const SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    for (const auto phase : {ContactPhase::none, ContactPhase::ended}) {
        auto state = touching<S>(S(0.1), {0, 0, 1}, {0, 0, -3});
        state.contact.phase = phase;
        CHECK(feel(state) == Vector3<S>(0, 0, 0));
    }
    auto state = touching<S>(S(0.1), {0, 0, 1}, {0, 0, 0});
    state.contact.phase = ContactPhase::began;
    CHECK(feel(state).z() == Approx(10));
}

TEMPLATE_TEST_CASE("pulling, the force opposes the displacement of the held point", "[force]", TEST_SCALARS) {
    using S = TestType;
    const SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> displacement = random.vector<S>(), velocity = random.vector<S>();
        auto state = pulling(displacement, velocity);
        const Vector3<S> along = displacement / norm(displacement);
        const Vector3<S> expected = -(100 * norm(displacement) + S(0.5) * dot(velocity, along)) * along;
        const S tolerance = 1000 * std::numeric_limits<S>::epsilon();
        REQUIRE(norm<S>(feel(state) - expected) <= tolerance);
        // What the tool touches meanwhile does not matter.
        state.contact = touching<S>(1, {0, 0, 1}, {0, 0, 0}).contact;
        REQUIRE(norm<S>(feel(state) - expected) <= tolerance);
    }
    CHECK(feel(pulling<S>({0, 0, 0}, {1, 1, 1})) == Vector3<S>(0, 0, 0));  // where it was at first: no direction
}

TEMPLATE_TEST_CASE("the reaction is fed back, all of it, scaled", "[force]", TEST_SCALARS) {
    using S = TestType;
    HapticState<S> state{};
    CHECK(ReactionForce{}(state) == Vector3<S>(0, 0, 0));
    const std::vector<Vector3<S>> reactions{{1, 2, 3}, {0, -1, 0}, {S(0.5), 0, 0}};
    state.report.reactions = reactions;
    CHECK(ReactionForce{}(state) == Vector3<S>(S(1.5), 1, 3));
    CHECK(ReactionForce{.scale = 40}(state) == Vector3<S>(60, 40, 120));
    CHECK(ReactionForce{.scale = 0}(state) == Vector3<S>(0, 0, 0));
}

TEMPLATE_TEST_CASE("no force is ever no number", "[force][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const std::vector<S> wild{0,
                              -S(0),
                              1,
                              -1,
                              Limits::denorm_min(),
                              Limits::min(),
                              Limits::max(),
                              Limits::lowest(),
                              std::sqrt(Limits::max()),
                              Limits::infinity(),
                              -Limits::infinity(),
                              Limits::quiet_NaN()};
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto number = [&] {
            return random.chance(0.3) ? wild[static_cast<std::size_t>(random.index(static_cast<Index>(wild.size())))]
                                      : random.number<S>(-1, 1);
        };
        const auto vector = [&] { return Vector3<S>(number(), number(), number()); };
        const bool holds = random.chance(0.5);
        auto state = holds ? pulling<S>(vector(), vector()) : touching<S>(number(), vector(), vector());
        if (holds) state.grasp.origin = vector(), state.grasp.offset = vector();
        const std::array<Vector3<S>, 3> reactions{vector(), vector(), vector()};
        state.report.reactions = reactions;
        const auto constant = [&] { return static_cast<double>(number()); };
        const SpringDamperForce feel{.stiffness = constant(), .damping = constant()};
        REQUIRE(is_finite(feel(state)));
        REQUIRE(is_finite(ReactionForce{.scale = constant()}(state)));
    }
}

TEST_CASE("policies take states of either scalar and throw nothing", "[force]") {
    STATIC_REQUIRE(ForcePolicy<SpringDamperForce, double>);
    STATIC_REQUIRE(ForcePolicy<ReactionForce, float>);
    STATIC_REQUIRE(noexcept(SpringDamperForce{.stiffness = 1}(std::declval<const HapticState<double>&>())));
    STATIC_REQUIRE(noexcept(ReactionForce{}(std::declval<const HapticState<float>&>())));
    // One of a user's own: what is felt is a fifth of both stock policies together.
    const auto own = [](const HapticState<double>& state) noexcept -> Vector3<double> {
        return 0.2 * (SpringDamperForce{.stiffness = 100}(state) + ReactionForce{.scale = 30}(state));
    };
    STATIC_REQUIRE(ForcePolicy<decltype(own), double>);
    STATIC_REQUIRE_FALSE(ForcePolicy<decltype(own), float>);
    STATIC_REQUIRE_FALSE(ForcePolicy<int, double>);
    CHECK(own(touching<double>(0.5, {0, 0, 1}, {0, 0, 0})) == Vector3<double>(0, 0, 10));
}
