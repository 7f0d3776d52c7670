// SPDX-License-Identifier: MIT
#include <membrane/haptics/grasp_transition.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

static_assert(ForcePolicy<GraspTransition<SpringDamperForce>, double>);
static_assert(ForcePolicy<GraspTransition<SpringDamperForce, float>, float>);

TEMPLATE_TEST_CASE("taking hold and letting go, the force does not jump", "[transition]", TEST_SCALARS) {
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
            // The law itself changes by 2e-3 N in a tick; the difference of the laws, 7 N at the most, comes in over
            // 50.
            if (tick > 0) REQUIRE(norm<S>(force - last) < S(0.15));
            if (tick > changed + 51) {
                REQUIRE(force == law(state));
                REQUIRE_FALSE(feel.in_transition());
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
    CHECK(feel.in_transition());
    state.tool.time = 0.05;
    CHECK(norm<double>(feel(state) - Vector3<double>(1.5, 0, 0.5)) < 1e-12);
    state.tool.time = 0.1;
    CHECK(norm<double>(feel(state) - Vector3<double>(3, 0, 0)) < 1e-12);
    state.grasp = {};
    (void)feel(state);
    state.tool.time = std::numeric_limits<double>::quiet_NaN();
    CHECK(feel(state) == Vector3<double>(0, 0, 1));  // a clock that is none ends it
    CHECK_FALSE(feel.in_transition());
    CHECK(test::refusal([] { const GraspTransition made(SpringDamperForce{.stiffness = 1}, {.duration = 0}); }) ==
          "GraspTransition: duration must be finite and positive [s], got 0");
}

namespace {

/// A tool that touches a ball, takes hold while it slides, pulls, and lets go, pressed in or pulled out, on a smooth
/// path; the seed says where, when, how far.
struct Handling {
    explicit Handling(std::uint64_t seed) {
        Random random(seed);
        out = random.unit_vector();
        aside = direction<double>(cross<double>(out, random.unit_vector()), {1, 0, 0});
        depth = random.number(0.2e-3, 0.8e-3);
        sway = random.number(0.5e-3, 2e-3);
        closes = random.number(0.15, 0.25);
        opens = closes + random.number(0.05, 0.3);
        turn = random.number(10.0, 20.0);
    }
    [[nodiscard]] Tool<double> tool(double time) const {
        const double in = time < 0.1 ? std::sin(5 * pi * time) : std::cos(turn * (time - 0.1));  // and there it stays
        const double along = time < 0.1 ? 0 : 1 - std::cos(turn * (time - 0.1) / 2);
        Tool<double> tool{.radius = 1e-3, .time = time, .grasping = time >= closes && time < opens};
        tool.position = (0.011 - depth * in) * out + sway * along * aside;
        return tool;
    }
    /// Its speed is no more than this [m/s].
    [[nodiscard]] double max_speed() const { return turn * (depth + sway / 2); }

    static constexpr double pi = 3.14159265358979323846, begin = 0.12, end = 0.7;  // [s]
    Vector3<double> out, aside;
    double depth, sway, closes, opens, turn;
};

struct Handled {
    double largest = 0;     // change of the force from tick to tick [N]
    double law_alone = 0;   // without the transition [N]
    double difference = 0;  // of the force and the new law, at the largest where that changes [N]
    int changes = 0;        // from touch to grasp, or back
};

template <class Law>
Handled handle(const Handling& displacement, const TriangleMesh<double>& mesh, const Law& law, double duration,
               double tick) {
    const auto network = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = QuasiStaticSolver(network, {.layers = 4, .sweeps = 2});
    auto tree = AabbTree(mesh);
    auto tracker = ContactTracker(mesh);
    auto grasper = Grasper(mesh);
    const auto smooth = SmoothContact(mesh);
    GraspTransition feel(law, {.duration = duration});
    auto bare = law;
    auto x = mesh.positions();
    Handled out;
    Vector3<double> last = Vector3<double>::Zero(), last_bare = last;
    bool held = false;
    for (int i = 0; tick * i < Handling::end; ++i) {
        const auto tool = displacement.tool(tick * i);
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, tick, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);
        const HapticState<double> state{tool, smooth(contact), report, grasp};
        const Vector3<double> force = feel(state), alone = bare(state);
        // A touch that begins or ends by itself, where the membrane comes slower than the tool goes, is not the
        // transition's.
        const bool by_itself = contact.phase == ContactPhase::began || contact.phase == ContactPhase::ended;
        if (tool.time > Handling::begin && (grasp.holding() || held || !by_itself)) {
            out.largest = std::max(out.largest, norm<double>(force - last));
            out.law_alone = std::max(out.law_alone, norm<double>(alone - last_bare));
        }
        if (grasp.holding() != held) {
            ++out.changes;
            out.difference = std::max(out.difference, norm<double>(alone - last));
        }
        held = grasp.holding();
        last = force;
        last_bare = alone;
    }
    return out;
}

}  // namespace

TEST_CASE("jaws close and open on a membrane that is touched, pulled and let go: the force does not jump",
          "[transition]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    int changes = 0;
    for (int seed = 1; seed <= cases(3, 40); ++seed) {
        const Handling displacement(static_cast<std::uint64_t>(seed));
        double before = 0;
        for (const double tick : {1e-3, 5e-4, 2.5e-4}) {
            CAPTURE(seed, tick);
            const SpringDamperForce law{.stiffness = 100};
            const double duration = 0.1;
            const auto found = handle(displacement, mesh, law, duration, tick);
            // The law goes with the tool, and what the laws differ by comes in over the duration.
            CHECK(found.largest <=
                  tick * (1.5 * law.stiffness * displacement.max_speed() + found.difference / duration));
            if (before > 0) {
                CHECK(found.largest > 0.4 * before);
                CHECK(found.largest < 0.6 * before);
            }
            before = found.largest;
            changes += found.changes;
            if (found.changes > 0 && found.difference > 0.05) CHECK(found.law_alone > 20 * found.largest);
        }
        // A reaction jumps by what it differs by, and goes on to converge in the ticks after that.
        const auto reaction = handle(displacement, mesh, ReactionForce{.scale = 5}, 0.1, 1e-3);
        CAPTURE(seed, reaction.largest, reaction.law_alone, reaction.difference);
        if (reaction.difference > 0.05) CHECK(reaction.law_alone > 8 * reaction.largest);
    }
    CHECK(changes > 0);
}
