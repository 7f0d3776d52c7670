// SPDX-License-Identifier: MIT
#include <membrane/core/lane_points.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

TEMPLATE_TEST_CASE("points are gathered from where they are, and scattered to where they belong", "[lanes]", float,
                   double) {
    using S = TestType;
    constexpr std::size_t lanes = Lanes<S>::count;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<PaddedPoint<S>> from(40), to(40);
        for (auto& row : from) {
            row.set(random.vector<S>());
            row.number[3] = random.number<S>();
        }
        std::array<Index, lanes> begins, places;
        for (Index& begin : begins) begin = numbers_in_point * random.index(40);
        std::vector<Index> free(40);
        std::iota(free.begin(), free.end(), 0);
        for (Index& place : places) {
            const auto chosen = free.begin() + random.index(static_cast<Index>(free.size()));
            place = numbers_in_point * *chosen;
            free.erase(chosen);
        }
        for (auto& row : to) row.set({7, 8, 9});
        const auto points = gather(from.data(), begins.data());
        scatter(points, to.data(), places.data());
        for (std::size_t i = 0; i < lanes; ++i) {
            const auto there = from[static_cast<std::size_t>(begins[i] / numbers_in_point)].point();
            REQUIRE(there == Vector3<S>(points[0][i], points[1][i], points[2][i]));
            REQUIRE(to[static_cast<std::size_t>(places[i] / numbers_in_point)].point() == there);
        }
        const auto padded = gather_padded(from.data(), begins.data());
        for (std::size_t k = 0; k < 3; ++k) {
            const auto row = static_cast<Eigen::Index>(k);
            for (std::size_t i = 0; i < lanes; ++i) REQUIRE(padded.point[row][i] == points[row][i]);
        }
        for (std::size_t i = 0; i < lanes; ++i) {
            REQUIRE(padded.extra[i] == from[static_cast<std::size_t>(begins[i] / numbers_in_point)].extra());
            REQUIRE(to[static_cast<std::size_t>(places[i] / numbers_in_point)].extra() == 0);
        }
        scatter_padded(padded, to.data(), places.data());
        for (std::size_t i = 0; i < lanes; ++i) {
            REQUIRE(to[static_cast<std::size_t>(places[i] / numbers_in_point)].number ==
                    from[static_cast<std::size_t>(begins[i] / numbers_in_point)].number);
        }
        for (const Index i : free) REQUIRE(to[static_cast<std::size_t>(i)].point() == Vector3<S>(7, 8, 9));
    }
}

TEMPLATE_TEST_CASE("operators on a padded point act on each of its four numbers", "[lanes]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<S, 4> a, b;
        for (std::size_t k = 0; k < 4; ++k) a[k] = random.number<S>(-1, 1), b[k] = random.number<S>(-1, 1);
        const auto left = PaddedVector<S>::load(a.data()), right = PaddedVector<S>::load(b.data());
        const auto numbers = [](const PaddedVector<S>& vector) {
            std::array<S, 4> stored;
            vector.store(stored.data());
            return stored;
        };
        for (std::size_t k = 0; k < 4; ++k) {
            REQUIRE(numbers(left + right)[k] == a[k] + b[k]);
            REQUIRE(numbers(left - right)[k] == a[k] - b[k]);
            REQUIRE(numbers(left * right)[k] == a[k] * b[k]);
            REQUIRE(numbers(smaller(left, right))[k] == std::min(a[k], b[k]));
            REQUIRE(numbers(larger(left, right))[k] == std::max(a[k], b[k]));
            REQUIRE(numbers(PaddedVector<S>::load_point(a.data()))[k] == (k < 3 ? a[k] : 0));
        }
        REQUIRE(left.point() == Vector3<S>(a[0], a[1], a[2]));
        REQUIRE(left.turned().point() == Vector3<S>(a[1], a[2], a[0]));
        REQUIRE(left.sum() == (a[0] + a[1]) + (a[2] + a[3]));
    }
}
