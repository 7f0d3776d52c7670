// SPDX-License-Identifier: MIT
#include "support/allocation_guard.hpp"

#include <algorithm>
#include <limits>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/force_change.hpp"
#include "support/haptic_loop.hpp"

// A day of a hand at 1 kHz, in full by `tests/campaign soak 100`: 86.4 million ticks, in one of 10,000 a fault.

using namespace membrane;

namespace {

/// A loop that is checked at every tick.
template <Real S>
struct Day {
    explicit Day(std::uint64_t seed) : loop(seed), random(seed) {
        // Damped enough for what is stiffest, a point that forceps hold: 250 N/m, five times at the hand.
        constexpr double stiffness = 200, scale = 5;
        const double damping = min_damping(scale * 250, stiffness, loop.dt);
        loop.coupling = VirtualCoupling<S>({.stiffness = stiffness, .damping = 1.2 * damping, .scale = scale});
    }

    /// Whether all is well after one more tick.
    [[nodiscard]] bool tick() {
        test::Fault fault;
        const Index kind = random.chance(1e-4) ? 1 + random.index(4) : 0;
        if (kind == 1) fault.tip[random.index(3)] = std::numeric_limits<double>::quiet_NaN();
        if (kind == 2) fault.tip = 0.05 * random.unit_vector();  // from 1 cm
        if (kind == 3) fault.force = 1e6 * random.unit_vector();
        faults += kind > 0;
        const test::AllocationCount count;
        loop.tick(fault);
        const bool refused = kind != 4 || names_no_vertex();
        allocated += count.so_far();

        const auto& device = loop.limit.device();
        const double slew = device.peak_force / LimitOptions().rise_time;
        const bool within = is_finite(loop.felt) && test::size_of(loop.felt) <= device.peak_force &&
                            test::within_slew(before, loop.felt, slew * (loop.now - last));
        before = loop.felt;
        last = loop.now;
        return within && refused && is_finite(loop.x);
    }

    /// A step with a constraint on a vertex that does not exist is refused, and changes nothing.
    [[nodiscard]] bool names_no_vertex() {
        const Index v = random.chance(0.5) ? -1 - random.index(1000) : loop.mesh.vertex_count() + random.index(1000);
        const Vector3<S> somewhere = point(loop.x, 0);
        const auto report = loop.solver.step(loop.x, S(1e-3), loop.network, loop.foundation, pull(v, somewhere));
        return report.status == StepStatus::invalid_input && report.moved.empty();
    }

    test::HapticLoop<S> loop;
    test::Random random;
    Vector3<S> before = Vector3<S>::Zero();
    double last = 0;
    long allocated = 0, faults = 0;
};

template <Real S>
void step(test::HapticLoop<S>& loop, const Tool<S>& tool, Vector3<S>& reactions) {
    const auto contact = loop.tracker.update(loop.tree, loop.x, tool);
    const auto report = loop.solver.step(loop.x, S(1e-3), loop.network, loop.foundation, press(tool, contact));
    loop.tree.refit(loop.x, report.moved);
    loop.normals.update(loop.x, report.moved);
    reactions += report.total_reaction();
}

/// How far from the mesh the membrane is when no tool has touched it for 3 s [m].
template <Real S>
double off_at_rest(test::HapticLoop<S>& loop) {
    Vector3<S> reactions = Vector3<S>::Zero();
    for (int i = 0; i < 3000; ++i) step(loop, {.position = {0, 0, S(0.05)}, .radius = S(1e-3)}, reactions);
    return static_cast<double>((loop.x - loop.mesh.positions()).colwise().norm().maxCoeff());
}

template <Real S>
struct Stroke {
    Points<S> x;
    Vector3<S> reactions;
    bool operator==(const Stroke& other) const {
        return test::same_bits(x, other.x) && test::same_bits(reactions, other.reactions);
    }
};

/// A tool that presses, slides and stays, over a membrane whose parts are reset.
template <Real S>
Stroke<S> stroke_after_reset(test::HapticLoop<S>& loop) {
    loop.x = loop.mesh.positions();
    loop.solver.reset();
    loop.tracker.reset();
    loop.grasper.reset();
    loop.tree.refit(loop.x);
    loop.normals.update(loop.x);
    Vector3<S> reactions = Vector3<S>::Zero();
    for (int i = 0; i < 400; ++i) {
        const S height = S(0.0115) - S(1e-5) * static_cast<S>((std::min)(i, 200)), aside = S(1e-5) * static_cast<S>(i);
        step(loop, {.position = {aside, S(0.5) * aside, height}, .radius = S(1e-3)}, reactions);
    }
    return {loop.x, reactions};
}

}  // namespace

TEMPLATE_TEST_CASE("a day of a hand leaves no trace: no memory, no drift, and each force within the profile", "[soak]",
                   TEST_SCALARS) {
    using S = TestType;
    const int ticks = cases(20'000, 432'000), hour = (std::max)(ticks / 24, 1);
    test::HapticLoop<S> new_loop(1);
    const Stroke<S> first_day = stroke_after_reset(new_loop);
    REQUIRE(norm(first_day.reactions) > 0);
    Day<S> day(12);
    double farthest = 0;
    for (int i = 1; i <= ticks; ++i) {
        if (!day.tick()) FAIL("tick " << i << ": " << day.before.transpose() << " N");
        if (i % hour != 0) continue;
        REQUIRE(day.allocated == 0);
        farthest = (std::max)(farthest, off_at_rest(day.loop));
        REQUIRE(farthest < 2e-6);  // the residual forces that the solver leaves, 1e-6 N, on springs of 8 N/m
        REQUIRE(stroke_after_reset(day.loop) == first_day);
    }
    CHECK(day.loop.touching > ticks / 10);
    CHECK(day.loop.solves > 0);
    if (ticks >= 432'000) WARN(ticks << " ticks, " << day.faults << " faults; at rest within " << farthest << " m");
}
