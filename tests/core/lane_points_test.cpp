// SPDX-License-Identifier: MIT
#include <membrane/core/lane_points.hpp>

#include <array>
#include <cstdint>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

TEMPLATE_TEST_CASE("points are gathered from where they are, and scattered in a row", "[lanes]", float, double) {
    using S = TestType;
    constexpr std::size_t lanes = Lanes<S>::count;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<PaddedPoint<S>> rows(40);
        for (auto& row : rows) {
            row.set(random.vector<S>());
            row.number[3] = random.number<S>();
        }
        std::array<Index, lanes> begins;
        for (Index& begin : begins) begin = numbers_in_point * random.index(40);
        const auto points = gather(rows.data(), begins.data());
        std::vector<PaddedPoint<S>> in_a_row(lanes + 1);
        in_a_row[lanes].set({7, 8, 9});
        scatter(points, in_a_row.data());
        for (std::size_t i = 0; i < lanes; ++i) {
            const auto there = rows[static_cast<std::size_t>(begins[i] / numbers_in_point)].point();
            REQUIRE(there == Vector3<S>(points[0][i], points[1][i], points[2][i]));
            REQUIRE(in_a_row[i].point() == there);
        }
        REQUIRE(gather(in_a_row.data())[0][lanes - 1] == points[0][lanes - 1]);
        REQUIRE(gather(in_a_row.data())[2][0] == points[2][0]);
        REQUIRE(in_a_row[lanes].point() == Vector3<S>(7, 8, 9));
    }
}
