// SPDX-License-Identifier: MIT
#include <membrane/haptics/extrapolated_reaction.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<ExtrapolatedReaction<double>, double> && ForcePolicy<ExtrapolatedReaction<float>, float>);

namespace {

template <class S>
HapticState<S> touching(const Vector3<S>& position, const Vector3<S>& normal) {
    HapticState<S> state{};
    state.tool.position = position;
    state.contact.phase = ContactPhase::ongoing;
    state.contact.normal = normal;
    return state;
}

}  // namespace

TEMPLATE_TEST_CASE("between solves the reaction goes on as the tangent says", "[extrapolated]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        ExtrapolatedReaction<S> feel({.scale = 40});
        const Vector3<S> reaction(0, 0, S(0.02)), at = random.vector<S>(S(-0.01), S(0.01));
        Symmetric3<S> stiffness = diagonal3(random.number<S>(1, 4));
        stiffness += outer(random.number<S>(0, 4), random.unit_vector<S>());
        feel.solved(reaction, stiffness, at);
        auto state = touching<S>(at, {0, 0, 1});
        REQUIRE(feel(state) == S(40) * reaction);
        const Vector3<S> displacement = random.vector<S>(S(-1e-3), S(1e-3));
        state.tool.position = at + displacement;
        const Vector3<S> expected = S(40) * (reaction - stiffness * displacement);
        REQUIRE(norm<S>(feel(state) - expected) <= S(40) * 16 * std::numeric_limits<S>::epsilon());
        state.tool.position = at + Vector3<S>(0, 0, 1);  // far out: it pushes no more, and does not pull
        REQUIRE(std::abs(feel(state).z()) <= S(400) * std::numeric_limits<S>::epsilon());
        state.grasp.triangle = 0;  // what holds does
        REQUIRE(feel(state).z() < -1);
    }
}

TEST_CASE("nothing touched, nothing felt, and never no number", "[extrapolated][bad]") {
    ExtrapolatedReaction<double> feel;
    auto state = touching<double>({0, 0, 0}, {0, 0, 1});
    CHECK(feel(state) == Vector3<double>(0, 0, 0));  // no solve yet
    feel.solved({0, 0, 1}, diagonal3(1.0), {0, 0, 0});
    CHECK(feel(state) == Vector3<double>(0, 0, 1));
    state.contact.phase = ContactPhase::ended;
    CHECK(feel(state) == Vector3<double>(0, 0, 0));
    state.contact.phase = ContactPhase::began;
    state.tool.position.x() = std::numeric_limits<double>::quiet_NaN();
    CHECK(feel(state) == Vector3<double>(0, 0, 0));
}

TEST_CASE("a solve in every tenth tick is felt to second order of the displacement", "[extrapolated]") {
    // A spring that stiffens; the tool goes in evenly.
    const auto force_at = [](double depth) { return 50 * depth + 2e4 * depth * depth; };
    ExtrapolatedReaction<double> feel;
    double worst = 0, held_worst = 0, held = 0;
    for (int tick = 0; tick < 200; ++tick) {
        const double depth = 1e-5 * tick;
        if (tick % 10 == 0) {
            held = force_at(depth);
            feel.solved({0, 0, held}, diagonal3(50 + 4e4 * depth), {0, 0, -depth});
        }
        const double felt = feel(touching<double>({0, 0, -depth}, {0, 0, 1})).z();
        worst = std::max(worst, std::abs(felt - force_at(depth)));
        held_worst = std::max(held_worst, std::abs(held - force_at(depth)));
    }
    CHECK(worst <= 2e4 * 9e-5 * 9e-5 * (1 + 1e-6));
    CHECK(held_worst > 50 * 9e-5);
}
