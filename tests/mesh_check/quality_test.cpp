// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/quality.hpp>

#include <cmath>

#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"

using namespace membrane;

TEMPLATE_TEST_CASE("quality is that of closed forms on regular surfaces", "[quality]", TEST_SCALARS) {
    using S = TestType;
    const auto regular = quality_of(icosphere<S>({.radius = 2, .subdivisions = 0}));
    CHECK(regular.smallest_angle == Approx(60));
    CHECK(regular.mean_smallest_angle == Approx(60));
    CHECK(regular.mean_edge == Approx(2 / std::sin(2 * std::acos(-1.0) / 5)));
    CHECK(regular.even_edges == Approx(1));

    // One square of two triangles: four sides of 1, a diagonal of sqrt(2), which is 31 % longer than the mean.
    const auto square = quality_of(sheet<S>({.width = 1, .height = 1, .columns = 1, .rows = 1}));
    CHECK(square.smallest_angle == Approx(45));
    CHECK(square.mean_smallest_angle == Approx(45));
    CHECK(square.mean_edge == Approx((4 + std::sqrt(2)) / 5));
    CHECK(square.even_edges == Approx(0.8));
}

TEST_CASE("the worst triangle alone is the smallest angle", "[quality]") {
    Points<double> x(3, 4);
    x << 0, 1, 0.5, 0.5,  //
        0, 0, std::sqrt(0.75), -0.05, 0, 0, 0, 0;
    Triangles corners(3, 2);
    corners << 0, 0,  //
        1, 3, 2, 1;
    const auto quality = quality_of(TriangleMesh<double>(x, corners));
    const double flat = std::atan2(0.05, 0.5) * 180 / std::acos(-1.0);
    CHECK(quality.smallest_angle == Approx(flat));
    CHECK(quality.mean_smallest_angle == Approx((60 + flat) / 2));
}
