// SPDX-License-Identifier: MIT
#include <membrane/contact/contact_point.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

// The distance of the axis from the triangle, by points of the axis.
template <class S>
S sampled_distance(const Triangle<S>& triangle, const Tool<S>& tool) {
    constexpr int samples = 2000;
    S least = std::numeric_limits<S>::infinity();
    for (int i = 0; i <= samples; ++i) {
        const Vector3<S> q = tool.position + (S(i) / samples) * tool.axis;
        least = std::min(least, closest_point(triangle, q).squared_distance);
    }
    return std::sqrt(least);
}

}  // namespace

TEMPLATE_TEST_CASE("a contact point is where its feature is nearest, and the least gap is that of the tool",
                   "[contact_point]", TEST_SCALARS) {
    using S = TestType;
    constexpr std::array<Index, 3> corners{3, 1, 4};
    int none = 0;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto somewhere = [&] { return random.vector<S>(); };
        const Triangle<S> triangle{somewhere(), somewhere(), somewhere()};
        Tool<S> tool{.position = somewhere(), .radius = S(0.1)};
        if (seed % 2 == 0) tool.axis = somewhere();
        const Vector3<S> other_end = tool.position + tool.axis;
        if (first_hit(triangle, tool.position, other_end))
            continue;  // nearest is no feature, but where it goes through
        S least = std::numeric_limits<S>::infinity();
        for (int feature = 0; feature < feature_pairs(tool); ++feature) {
            const auto point = contact_point(7, corners, triangle, tool, feature, tool.radius);
            if (!point) {
                ++none;
                continue;
            }
            CHECK(point->triangle == 7);
            CHECK(point->feature == feature);
            CHECK(point->corners == corners);
            CHECK(point->force == Vector3<S>(0, 0, 0));
            const Vector3<S> separation = (point->gap + tool.radius) * point->normal;
            const Vector3<S> axis_point = point_at(triangle, point->weights) + separation;
            const Vector3<S> from_end = axis_point - tool.position;
            CHECK(norm(cross(from_end, tool.axis)) < S(1e-5));  // on the axis, between its ends
            CHECK(dot(from_end, tool.axis) > S(-1e-5));
            CHECK(dot(from_end, tool.axis) < squared_norm(tool.axis) + S(1e-5));
            least = std::min(least, point->gap);
        }
        CHECK(std::abs(least + tool.radius - sampled_distance(triangle, tool)) < S(2e-3));
    }
    CHECK(none > 0);
}

TEST_CASE("a point on the axis has no normal, and the tool is inside by its radius", "[contact_point]") {
    const Triangle<double> triangle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    const Tool<double> tool{.position = {0.25, 0.25, 0}, .radius = 0.5};
    const auto point = contact_point(0, {0, 1, 2}, triangle, tool, 0, 0.75);
    REQUIRE(point);
    CHECK(point->normal == Vector3<double>(0, 0, 0));
    CHECK(point->gap == -0.75);
}
