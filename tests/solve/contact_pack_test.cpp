// SPDX-License-Identifier: MIT
#include <membrane/solve/contact_pack.hpp>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
ContactPoint<S> random_point(Random& random, Index triangle, Index vertices, Index hub = no_index) {
    ContactPoint<S> point{
        triangle, static_cast<int>(random.index(6)) - 1, {}, random.barycentric<S>(), random.unit_vector<S>(), {}};
    point.corners[0] = hub == no_index ? random.index(vertices) : hub;
    do point.corners[1] = random.index(vertices);
    while (point.corners[1] == point.corners[0]);
    do point.corners[2] = random.index(vertices);
    while (point.corners[2] == point.corners[0] || point.corners[2] == point.corners[1]);
    point.force = -random.number(S(0), S(1)) * point.normal;
    return point;
}

/// Every point is in one lane, with all that belongs to it, and no pack holds two points with a corner in common.
template <class S>
void check_packs(const ContactPacks<S>& packs, const std::vector<ContactPoint<S>>& points, std::size_t first) {
    std::vector<int> seen(points.size(), 0);
    for (const auto& pack : packs.items()) {
        REQUIRE(pack.size >= 1);
        std::vector<Index> corners;
        for (std::size_t i = 0; i < ContactPack<S>::lanes; ++i) {
            REQUIRE(pack.listed[i] == (i < pack.size ? 1 : 0));
            if (i >= pack.size) {
                REQUIRE(pack.point[i] == no_index);
                continue;
            }
            const std::size_t number = static_cast<std::size_t>(pack.point[i]) - first;
            REQUIRE(number < points.size());
            const auto& point = points[number];
            ++seen[number];
            REQUIRE(pack.kind == kind_of(point));
            REQUIRE(pack.load.force[i] == norm(point.force));
            REQUIRE(pack.end[i] == (point.feature == 1 ? 1 : 0));
            for (std::size_t k = 0; k < 3; ++k) {
                const std::size_t corner = (k + pack.turn[i]) % 3;
                const auto row = static_cast<Eigen::Index>(k);
                REQUIRE(pack.corner[k][i] == numbers_in_point * point.corners[corner]);
                REQUIRE(pack.load.weights[row][i] == point.weights[static_cast<Eigen::Index>(corner)]);
                REQUIRE(pack.load.normal[row][i] == point.normal[row]);
                REQUIRE(pack.free[row][i] == (point.corners[corner] % 5 == 0 ? 0 : 1));
                corners.push_back(point.corners[corner]);
            }
            if (pack.kind == ContactKind::edge)
                REQUIRE(pack.corner[0][i] / 4 == point.corners[std::size_t(point.feature - 2)]);
        }
        std::sort(corners.begin(), corners.end());
        REQUIRE(std::adjacent_find(corners.begin(), corners.end()) == corners.end());
    }
    REQUIRE(std::all_of(seen.begin(), seen.end(), [](int count) { return count == 1; }));
}

}  // namespace

TEMPLATE_TEST_CASE("packs hold every point once, and never two at one vertex", "[contact]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Index vertices = 4 + random.index(60), count = random.index(200);
        ContactPacks<S> packs(vertices, 200);
        for (int again = 0; again < 2; ++again) {
            packs.clear();
            const bool is_fan = random.chance(0.3);  // more points at one vertex than there are colours
            std::vector<ContactPoint<S>> points;
            for (Index i = 0; i < count; ++i)
                points.push_back(random_point<S>(random, i, vertices, is_fan ? 1 : no_index));
            packs.append(std::span<const ContactPoint<S>>(points), 7, [](Index v) { return v % 5 == 0; });
            REQUIRE(packs.size() <= points.size());
            check_packs(packs, points, 7);
        }
    }
}
