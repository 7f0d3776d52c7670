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
    state.set_response(2, {{1, 2, 3, 4, 5, 6}, 7, 8}, 0.5);
    state.set_position(2, {1, 1, 1});
    state.set_position(4, {2, 2, 2});
    state.prescribed.insert(4);
    CHECK(state.compliance(2) == 0.5);
    const auto response = state.response_of(2);
    const auto& block = response.compliance;
    CHECK(block.xx == 1);
    CHECK(block.yy == 2);
    CHECK(block.zz == 3);
    CHECK(block.xy == 4);
    CHECK(block.xz == 5);
    CHECK(block.yz == 6);
    CHECK(response.internal_force == 7);
    CHECK(response.internal_stiffness == 8);
    state.restore(x);
    CHECK(point(state.positions(), 2) == point(x, 2));
    CHECK(point(state.positions(), 4) == Vector3<double>(2, 2, 2));
    state.clear_response(2);
    CHECK(state.response_of(2).compliance.trace() == 0);
    CHECK(state.compliance(2) == 0);
    CHECK(point(state.positions(), 2) == point(x, 2));
}

TEST_CASE("responses in lanes are those of each vertex", "[state]") {
    constexpr std::size_t lanes = Lanes<double>::count;
    StepState<double> state(8, 4);
    const auto number = [](Index v, int k) { return 10 * v + k; };
    for (Index v = 0; v < 8; ++v) {
        const auto n = [&](int k) { return static_cast<double>(number(v, k)); };
        state.set_response(v, {{n(0), n(1), n(2), n(3), n(4), n(5)}, n(6), n(7)}, 0.5);
    }
    StepState<double>::Begins begins, reversed;
    for (std::size_t i = 0; i < lanes; ++i) {
        begins[i] = begin_of_row(static_cast<Index>((3 * i + 1) % 8));
        reversed[i] = begin_of_row(7 - row_at(begins[i]));
    }
    state.set_responses(reversed, state.responses(begins));
    for (std::size_t i = 0; i < lanes; ++i) {
        const auto found = state.response_of(row_at(reversed[i]));
        const Index from = row_at(begins[i]);
        CHECK(found.compliance.xy == number(from, 3));
        CHECK(found.compliance.yz == number(from, 5));
        CHECK(found.internal_force == number(from, 6));
        CHECK(found.internal_stiffness == number(from, 7));
    }
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
    state.set_response(1, {{1, 2, 3, 0, 0, 0}, 7, 8}, 0.5);
    auto point = point_at_corner(0, 0, 1);
    point.force = {1, 0, 0};
    REQUIRE(state.points.try_push_back(point));
    state.end_step();
    Eigen::Matrix3d quarter;  // about z: x to y
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    state.rotate(quarter);
    CHECK(norm<double>(state.previous_points[0].force - Vector3<double>(0, 1, 0)) < 1e-15);
    CHECK(norm<double>(state.previous_points[0].normal - Vector3<double>(0, 0, 1)) < 1e-15);
    const auto turned = state.response_of(1);
    CHECK(turned.compliance.xx == Approx(2));
    CHECK(turned.compliance.yy == Approx(1));
    CHECK(turned.compliance.zz == Approx(3));
    CHECK(turned.internal_force == 7);
    CHECK(turned.internal_stiffness == 8);
    CHECK(state.compliance(1) == 0.5);
}
