// SPDX-License-Identifier: MIT
#include <membrane/haptics/grasp_transition.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<GraspTransition<SpringDamperForce>, double>);
static_assert(ForcePolicy<GraspTransition<SpringDamperForce, float>, float>);

TEMPLATE_TEST_CASE("taking hold and letting go, the force does not jump", "[transition]", double, float) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const SpringDamperForce law{.stiffness = 100};
        GraspTransition<SpringDamperForce, S> feel(law, {.duration = 0.05});
        HapticState<S> state{};
        state.contact.phase = ContactPhase::ongoing;
        state.contact.depth = S(0.01);
        state.contact.normal = random.unit_vector<S>();
        state.grasp.origin = random.vector<S>(S(-0.02), S(0.02));
        Vector3<S> last = Vector3<S>::Zero();
        int changed = -1000;
        S jump = 0;  // of the law alone
        for (int tick = 0; tick < 600; ++tick) {
            state.tool.time = S(1e-3) * static_cast<S>(tick);
            state.tool.position += random.vector<S>(S(-1e-5), S(1e-5));
            if (tick > 0 && random.chance(0.01)) {
                const auto before = law(state);
                state.grasp.triangle = state.grasp.holding() ? no_index : 7;
                changed = tick;
                jump = std::max(jump, norm<S>(law(state) - before));
            }
            const Vector3<S> force = feel(state);
            // The law itself changes by 2e-3 N in a tick; the difference of the laws, 7 N at the most, comes in over 50.
            if (tick > 0) REQUIRE(norm<S>(force - last) < S(0.15));
            if (tick > changed + 51) {
                REQUIRE(force == law(state));
                REQUIRE_FALSE(feel.under_way());
            }
            last = force;
        }
        if (changed > 0 && seed == 1) REQUIRE(jump > S(0.15));
    }
}

TEST_CASE("at the change the force is what it was, half way it is between", "[transition]") {
    GraspTransition feel(SpringDamperForce{.stiffness = 100}, {.duration = 0.1});
    HapticState<double> state{};
    state.contact.phase = ContactPhase::ongoing;
    state.contact.depth = 0.01;
    state.contact.normal = {0, 0, 1};
    CHECK(feel(state) == Vector3<double>(0, 0, 1));
    state.grasp.triangle = 3;
    state.grasp.origin = {0.03, 0, 0};  // held so that it pulls by 3 N along x
    CHECK(norm<double>(feel(state) - Vector3<double>(0, 0, 1)) < 1e-15);
    CHECK(feel.under_way());
    state.tool.time = 0.05;
    CHECK(norm<double>(feel(state) - Vector3<double>(1.5, 0, 0.5)) < 1e-12);
    state.tool.time = 0.1;
    CHECK(norm<double>(feel(state) - Vector3<double>(3, 0, 0)) < 1e-12);
    state.grasp = {};
    (void)feel(state);
    state.tool.time = std::numeric_limits<double>::quiet_NaN();
    CHECK(feel(state) == Vector3<double>(0, 0, 1));  // a clock that is none ends it
    CHECK_FALSE(feel.under_way());
    CHECK(test::refusal([] { const GraspTransition made(SpringDamperForce{.stiffness = 1}, {.duration = 0}); }) ==
          "GraspTransition: duration must be finite and positive [s], got 0");
}
