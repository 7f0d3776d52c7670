// SPDX-License-Identifier: MIT
#include <membrane/solve/step_state.hpp>

#include <array>
#include <cstdint>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

struct OnePinned {
    Index pinned_vertex = 3;
    bool pinned(Index v) const { return v == pinned_vertex; }
};

ContactPoint<double> point_at_corner(Index triangle, int feature, Index corner) {
    const Vector3<double> none = Vector3<double>::Zero();
    return {triangle, feature, {corner, corner + 1, corner + 2}, {1, 0, 0}, {0, 0, 1}, none};
}

}  // namespace

TEMPLATE_TEST_CASE("a vertex is loaded once in a step, with its pin", "[state]", TEST_SCALARS) {
    using S = TestType;
    Points<S> x = Points<S>::Random(3, 8);
    const Points<S> before = x;
    StepState<S> state(8, 4);
    state.begin_step();
    for (const Index v : {3, 5}) state.load(v, x, OnePinned{});
    x.setZero();
    state.load(5, x, OnePinned{});
    CHECK(state.loaded.count() == 2);
    CHECK(point(state.positions(), 5) == point(before, 5));
    CHECK(state.is_fixed(3));
    CHECK_FALSE(state.is_fixed(5));

    state.begin_step();
    CHECK(state.loaded.empty());
    state.load(5, x, OnePinned{5});
    CHECK(point(state.positions(), 5) == Vector3<S>::Zero());
    CHECK(state.is_fixed(5));
}

TEST_CASE("positions are set without the number beside them, and restored but where they are prescribed", "[state]") {
    const Points<double> x = Points<double>::Random(3, 8);
    StepState<double> state(8, 4);
    state.begin_step();
    for (Index v = 0; v < 8; ++v) state.load(v, x, OnePinned{});
    state.set_compliance(2, {1, 2, 3, 4, 5, 6}, 0.5);
    state.set_internal(2, 7, 8);
    state.set_position(2, {1, 1, 1});
    state.set_position(4, {2, 2, 2});
    state.prescribed.insert(4);
    CHECK(state.compliance(2) == 0.5);
    const auto block = state.compliance_block(2);
    CHECK(block.xx == 1);
    CHECK(block.yy == 2);
    CHECK(block.zz == 3);
    CHECK(block.xy == 4);
    CHECK(block.xz == 5);
    CHECK(block.yz == 6);
    CHECK(state.row(state.response, 5).point().z() == 7);
    CHECK(state.row(state.response, 5).extra() == 8);
    state.restore(x);
    CHECK(point(state.positions(), 2) == point(x, 2));
    CHECK(point(state.positions(), 4) == Vector3<double>(2, 2, 2));
    state.clear_response(2);
    CHECK(state.compliance_block(2).trace() == 0);
    CHECK(state.compliance(2) == 0);
    CHECK(point(state.positions(), 2) == point(x, 2));
}

TEST_CASE("a step begins without forces, and keeps the stiffness of supports", "[state]") {
    StepState<double> state(8, 4);
    state.begin_step();
    state.forced.insert(1);
    state.row(state.force, 1).set({1, 2, 3}, 4);
    state.pressed_supports.insert(2);
    state.row(state.support, 2).set({1, 2, 3}, 4);
    state.begin_step();
    CHECK(state.row(state.force, 1).number == std::array<double, 4>{});
    CHECK(state.support_force(2) == Vector3<double>::Zero());
    CHECK(state.support_stiffness(2) == 4);
    state.reset();
    CHECK(state.support_stiffness(2) == 0);
}

TEST_CASE("previous points are found by their first corner, those of the last step alone", "[state]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Index vertices = 12;
        StepState<double> state(vertices, 30);
        for (int step = 0; step < 4; ++step) {
            state.begin_step();
            std::vector<int> expected(static_cast<std::size_t>(vertices), 0);
            const Index count = random.index(31);
            for (Index i = 0; i < count; ++i) {
                const Index corner = random.index(vertices);
                REQUIRE(state.points.try_push_back(point_at_corner(i, 0, corner)));
                ++expected[static_cast<std::size_t>(corner)];
            }
            if (random.chance(0.3)) {
                state.reset_points();
                for (Index v = 0; v < vertices; ++v) REQUIRE(state.previous_at(v) == no_index);
            }
            state.end_step();
            REQUIRE(state.previous_points.size() == static_cast<std::size_t>(count));
            for (Index v = 0; v < vertices; ++v) {
                int found = 0;
                for (Index i = state.previous_at(v); i != no_index; i = state.next_previous(i)) {
                    REQUIRE(state.previous_points[static_cast<std::size_t>(i)].corners[0] == v);
                    ++found;
                }
                REQUIRE(found == expected[static_cast<std::size_t>(v)]);
            }
        }
    }
}

TEST_CASE("a point at no vertex is kept, and no vertex finds it", "[state]") {
    StepState<double> state(3, 4);
    state.begin_step();
    for (const Index corner : {no_index, 3, 1, 100}) REQUIRE(state.points.try_push_back(point_at_corner(0, 0, corner)));
    state.end_step();
    CHECK(state.previous_points.size() == 4);
    CHECK(state.previous_at(1) == 2);
    CHECK(state.next_previous(2) == no_index);
    for (const Index v : {no_index, 0, 2, 3, 100}) CHECK(state.previous_at(v) == no_index);
    state.reset_points();
    CHECK(state.previous_at(1) == no_index);
}

TEST_CASE("what is kept turns with the body", "[state]") {
    StepState<double> state(4, 4);
    const Points<double> x = Points<double>::Random(3, 4);
    state.begin_step();
    state.load(1, x, OnePinned{});
    state.set_compliance(1, {1, 2, 3, 0, 0, 0}, 0.5);
    auto point = point_at_corner(0, 0, 1);
    point.force = {1, 0, 0};
    REQUIRE(state.points.try_push_back(point));
    state.end_step();
    Eigen::Matrix3d quarter;  // about z: x to y
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    state.rotate(quarter);
    CHECK(norm<double>(state.previous_points[0].force - Vector3<double>(0, 1, 0)) < 1e-15);
    CHECK(norm<double>(state.previous_points[0].normal - Vector3<double>(0, 0, 1)) < 1e-15);
    CHECK(state.compliance_block(1).xx == Approx(2));
    CHECK(state.compliance_block(1).yy == Approx(1));
    CHECK(state.compliance_block(1).zz == Approx(3));
    CHECK(state.compliance(1) == 0.5);
}
