// SPDX-License-Identifier: MIT
#include <membrane/contact/tool.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
Triangle<S> random_triangle(Random& random) {
    return {random.vector<S>(), random.vector<S>(), random.vector<S>()};
}

template <class S>
Tool<S> random_capsule(Random& random) {
    return {.position = random.vector<S>(-2, 2), .axis = random.vector<S>(-2, 2), .radius = S(0.1)};
}

/// The least distance from the tool's axis to the triangle. Along a line it has no second minimum: a golden section.
template <class S>
long double distance_from_axis(const Triangle<S>& triangle, const Tool<S>& tool) {
    using Long = test::Vector<long double>;
    const auto brute = test::brute_triangle<long double>(triangle);
    const Long from = tool.position.eigen().template cast<long double>(),
               displacement = tool.axis.eigen().template cast<long double>();
    const auto at = [&](long double along) {
        return std::sqrt(test::squared_distance<long double>(brute, Long(from + along * displacement)));
    };
    const long double golden = (std::sqrt(5.0L) - 1) / 2;
    long double low = 0, high = 1;
    while (high - low > 1e-12L) {
        const long double a = high - golden * (high - low), b = low + golden * (high - low);
        (at(a) < at(b) ? high : low) = at(a) < at(b) ? b : a;
    }
    return std::min({at(0), at(1), at((low + high) / 2)});
}

}  // namespace

TEMPLATE_TEST_CASE("a tool is valid if all its numbers are and its radius is not negative", "[tool]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const Tool<S> good{.position = {1, 2, 3}, .axis = {0, 0, 1}, .radius = S(0.1), .velocity = {1, 0, 0}, .time = 5};
    CHECK(is_valid(good));
    CHECK(is_valid(Tool<S>{}));
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        for (int k = 0; k < 3; ++k) {
            for (auto member : {&Tool<S>::position, &Tool<S>::axis, &Tool<S>::velocity}) {
                Tool<S> tool = good;
                (tool.*member)[k] = bad;
                CHECK_FALSE(is_valid(tool));
            }
        }
        for (auto member : {&Tool<S>::radius, &Tool<S>::time}) {
            Tool<S> tool = good;
            tool.*member = bad;
            CHECK_FALSE(is_valid(tool));
        }
    }
    Tool<S> tool = good;
    tool.radius = -Limits::denorm_min();
    CHECK_FALSE(is_valid(tool));
    tool.radius = -S(0);
    CHECK(is_valid(tool));
    tool.time = -1;
    CHECK(is_valid(tool));
}

TEMPLATE_TEST_CASE("a tool is carried into a body's frame with all its parts", "[tool]", TEST_SCALARS) {
    using S = TestType;
    const S tolerance = 32 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const RigidFrame<S> body{random.rotation<S>(), random.vector<S>(), random.vector<S>(), random.vector<S>()};
        Tool<S> tool = random_capsule<S>(random);
        tool.velocity = random.vector<S>();
        tool.time = 7;
        tool.grasping = random.chance(0.5);
        const Tool<S> seen = to_body_frame(tool, body);
        REQUIRE(norm<S>(body.point_to_world(seen.position) - tool.position) <= tolerance);
        REQUIRE(norm<S>(body.point_to_world(seen.position + seen.axis) - (tool.position + tool.axis)) <= 2 * tolerance);
        REQUIRE(seen.velocity == body.velocity_in(tool.velocity, tool.position));
        REQUIRE(seen.radius == tool.radius);
        REQUIRE(seen.time == tool.time);
        REQUIRE(seen.grasping == tool.grasping);
    }
}

TEMPLATE_TEST_CASE("a sphere comes near a triangle in one way, a capsule in five", "[tool]", TEST_SCALARS) {
    using S = TestType;
    CHECK_FALSE(is_shaft(Tool<S>{.radius = 1}));
    CHECK(is_shaft(Tool<S>{.axis = {0, 0, std::numeric_limits<S>::denorm_min()}}));
    CHECK(feature_pairs(Tool<S>{}) == 1);
    CHECK(feature_pairs(Tool<S>{.radius = 1}) == 1);
    CHECK(feature_pairs(Tool<S>{.axis = {0, 0, std::numeric_limits<S>::denorm_min()}}) == 5);
}

TEMPLATE_TEST_CASE("the nearest of all pairs is the distance of tool and triangle", "[tool]", TEST_SCALARS) {
    using S = TestType;
    const S tolerance = sizeof(S) == 4 ? S(2e-6) : S(1e-11);
    int edges = 0, ends = 0, stuck = 0;
    for (int seed = 1; seed <= cases(4000, 4000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto triangle = random_triangle<S>(random);
        Tool<S> tool = random_capsule<S>(random);
        if (random.chance(0.3)) tool.axis.setZero();
        if (std::sqrt(squared_norm<S>(area_vector(triangle))) < S(0.05)) continue;
        S least = std::numeric_limits<S>::infinity();
        int nearest_pair = -1;
        for (int pair = 0; pair < feature_pairs(tool); ++pair) {
            const auto near = closest_points(triangle, tool, pair);
            REQUIRE((pair >= 2 || near));  // an end is always near something
            if (!near) continue;
            REQUIRE(near->barycentric.minCoeff() >= 0);
            REQUIRE(std::abs(near->barycentric.sum() - 1) <= 4 * std::numeric_limits<S>::epsilon());
            // `separation` runs from the point of the triangle to the axis; to the pair's own end of it.
            const Vector3<S> axis_point = point_at(triangle, near->barycentric) + near->separation;
            const Vector3<S> from_position = axis_point - tool.position;
            if (pair == 0) REQUIRE(norm(from_position) <= tolerance);
            if (pair == 1) REQUIRE(norm<S>(from_position - tool.axis) <= tolerance);
            if (pair >= 2) {
                REQUIRE(norm(cross(from_position, tool.axis)) <= tolerance * norm(tool.axis));
                REQUIRE(near->barycentric[(pair - 2 + 2) % 3] == 0);  // on its edge
            }
            if (!(norm(near->separation) < least)) continue;
            least = norm(near->separation);
            nearest_pair = pair;
        }
        const auto expected = static_cast<S>(distance_from_axis(triangle, tool));
        if (expected < tolerance) {  // the axis is stuck through the triangle: pairs are features, and have a distance
            ++stuck;
            continue;
        }
        (nearest_pair < 2 ? ends : edges) += 1;
        REQUIRE(std::abs(least - expected) <= tolerance);
    }
    if (cases(4000, 4000) == 4000) {
        CHECK(edges > 500);
        CHECK(ends > 500);
        CHECK(stuck > 5);
    }
}

TEMPLATE_TEST_CASE("a shaft along a triangle, by hand", "[tool]", TEST_SCALARS) {
    using S = TestType;
    const Triangle<S> triangle{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
    // Across the corner, one unit above: both ends are beyond the edges, the axis over two of them.
    const Tool<S> shaft{.position = {-1, 1, 1}, .axis = {6, 0, 0}, .radius = S(0.5)};
    CHECK(closest_points(triangle, shaft, 0)->separation == Vector3<S>(-1, 0, 1));
    CHECK(closest_points(triangle, shaft, 1)->separation == Vector3<S>(1, 1, 1));
    const auto over_hypotenuse = closest_points(triangle, shaft, 3);
    REQUIRE(over_hypotenuse);
    CHECK((over_hypotenuse->barycentric - Vector3<S>(0, S(0.75), S(0.25))).norm() < S(1e-6));
    CHECK((over_hypotenuse->separation - Vector3<S>(0, 0, 1)).norm() < S(1e-6));
    const auto over_side = closest_points(triangle, shaft, 4);
    REQUIRE(over_side);
    CHECK((over_side->separation - Vector3<S>(0, 0, 1)).norm() < S(1e-6));
    // A sphere over the inside.
    const Tool<S> sphere{.position = {1, 1, 2}, .radius = S(0.5)};
    CHECK(closest_points(triangle, sphere, 0)->separation == Vector3<S>(0, 0, 2));
    CHECK((closest_points(triangle, sphere, 0)->barycentric - Vector3<S>(S(0.5), S(0.25), S(0.25))).norm() < S(1e-6));
}
