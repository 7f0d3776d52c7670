// SPDX-License-Identifier: MIT
#include <membrane/solve/contact_state.hpp>

#include <cstdint>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

ContactPoint<double> point_at_corner(Index triangle, int feature, Index corner) {
    const Vector3<double> none = Vector3<double>::Zero();
    return {triangle, feature, {corner, corner + 1, corner + 2}, {1, 0, 0}, {0, 0, 1}, none};
}

}  // namespace

TEST_CASE("previous points are found by their first corner, those of the last step alone", "[contact_state]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Index vertices = 12;
        ContactState<double> state(vertices, 30);
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

TEST_CASE("a point at no vertex is kept, and no vertex finds it", "[contact_state]") {
    ContactState<double> state(3, 4);
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

TEST_CASE("the points of the last step turn with the body", "[contact_state]") {
    ContactState<double> state(4, 4);
    auto point = point_at_corner(0, 0, 1);
    point.force = {1, 0, 0};
    REQUIRE(state.points.try_push_back(point));
    state.end_step();
    Eigen::Matrix3d quarter;  // about z: x to y
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    state.rotate(quarter);
    CHECK(norm<double>(state.previous_points[0].force - Vector3<double>(0, 1, 0)) < 1e-15);
    CHECK(norm<double>(state.previous_points[0].normal - Vector3<double>(0, 0, 1)) < 1e-15);
}

TEST_CASE("the forces on a support are those at its points, of one constraint and of the others", "[contact_state]") {
    ContactState<double> state(8, 8);
    const auto add = [&](std::size_t constraint, Index corner, double force) {
        auto point = point_at_corner(static_cast<Index>(constraint), 0, corner);
        point.weights = {0.5, 0.25, 0.25};
        point.force = {0, 0, force};
        point.on_fixed = true;
        auto& range = state.point_ranges[constraint];
        if (range.begin == range.end) range = {state.points.size(), state.points.size()};
        REQUIRE(state.points.try_push_back(point));
        range.end = state.points.size();
    };
    state.set_support_stiffness(2, 7);
    add(0, 1, 4);
    add(0, 2, 8);
    add(1, 2, -2);
    state.sum_support_forces(0, max_constraints);
    CHECK(state.support_force(1) == Vector3<double>(0, 0, 2));
    CHECK(state.support_force(2) == Vector3<double>(0, 0, 1 + 4));
    CHECK(state.opposing_force(2) == Vector3<double>(0, 0, -1));
    CHECK(state.support_stiffness(2) == 7);
    state.sum_support_forces(1, max_constraints);
    CHECK(state.support_force(2) == Vector3<double>(0, 0, -1));
    CHECK(state.opposing_force(2) == Vector3<double>(0, 0, 1 + 4));
    state.sum_support_forces(1, 1);  // of the second constraint the points of the last step: none
    CHECK(state.support_force(2) == Vector3<double>(0, 0, 0));
    state.begin_step();
    CHECK(state.opposing_force(2) == Vector3<double>(0, 0, 0));
    CHECK(state.support_stiffness(2) == 7);
    state.reset();
    CHECK(state.support_stiffness(2) == 0);
}

TEST_CASE("a vertex goes back to where it was kept last, until the step ends", "[contact_state]") {
    ContactState<double> state(4, 4);
    state.keep(2, {1, 2, 3});
    state.keep(2, {4, 5, 6});
    CHECK(state.kept.contains(2));
    CHECK_FALSE(state.kept.contains(1));
    CHECK(state.kept_at(2) == Vector3<double>(4, 5, 6));
    state.begin_step();
    CHECK_FALSE(state.kept.contains(2));
}
