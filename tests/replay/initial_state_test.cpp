// SPDX-License-Identifier: MIT
#include <membrane/replay/initial_state.hpp>

#include <membrane/membrane.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"
#include "support/whole_loop.hpp"

using namespace membrane;

TEMPLATE_TEST_CASE("a loop that is reset to its initial state runs as at first, to the bit", "[snapshot]", double,
                   float) {
    using S = TestType;
    const test::WholeLoop<S> at_first(1);
    test::WholeLoop<S> loop = at_first;
    const InitialState initial(loop.solver, loop.tracker, loop.grasper, loop.x);
    const auto run = [&] {
        for (int i = 0; i < 200; ++i) loop.tick();
        return loop.x;
    };
    const Points<S> once = run();
    REQUIRE_FALSE(test::same_bits(once, at_first.x));
    const InitialState copy = initial;
    for (const auto* state : {&initial, &copy}) {
        REQUIRE(state->reset(loop.solver, loop.tracker, loop.grasper, loop.x));
        REQUIRE(test::same_bits(loop.x, at_first.x));
        loop.tree.refit(loop.x);
        loop.device = at_first.device;
        CHECK(test::same_bits(run(), once));
    }
}

TEST_CASE("other components are not reset, and nothing changes", "[snapshot]") {
    const auto sphere = icosphere<double>({.subdivisions = 2}), small = icosphere<double>({.subdivisions = 1});
    const MassSpringNetwork network(sphere, LinearSpring{}, {.stiffness = 40.0});
    QuasiStaticSolver solver(network);
    ContactTracker<double> tracker(sphere);
    Points<double> x = sphere.positions();
    const InitialState initial(solver, tracker, x);
    x *= 2;
    Points<double> other_x = small.positions();
    Points<float> single_x = sphere.positions().cast<float>();
    const Points<double> before = x, other_before = other_x;
    CHECK_FALSE(initial.reset(tracker, solver, x));
    CHECK_FALSE(initial.reset(solver, x));
    CHECK_FALSE(initial.reset(solver, tracker, other_x));
    CHECK_FALSE(initial.reset(solver, tracker, single_x));
    CHECK(x == before);
    CHECK(other_x == other_before);
    REQUIRE(initial.reset(solver, tracker, x));
    CHECK(x == sphere.positions());
}
