// SPDX-License-Identifier: MIT
#include <membrane/surface/half_edges.hpp>

#include <array>
#include <map>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;

TEST_CASE("half-edges are the sides of the triangles, sorted by edge, apex and triangle", "[mesh]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<double>(random);
        surface.add(0, 1, 2);  // an edge may have any number of triangles
        surface.add(0, 2, 1);
        const Triangles& triangles = surface.triangles;
        const std::vector<HalfEdge> sides = half_edges(triangles);
        REQUIRE(static_cast<Eigen::Index>(sides.size()) == triangles.size());
        std::map<std::pair<Index, Index>, int> seen;
        for (std::size_t i = 0; i < sides.size(); ++i) {
            const HalfEdge& side = sides[i];
            REQUIRE(side.first < side.second);
            REQUIRE(++seen[{side.triangle, side.side}] == 1);
            const std::array<Index, 2> ends{triangles(side.side, side.triangle),
                                            triangles((side.side + 1) % 3, side.triangle)};
            REQUIRE(ends[side.forward ? 0 : 1] == side.first);
            REQUIRE(ends[side.forward ? 1 : 0] == side.second);
            REQUIRE(triangles((side.side + 2) % 3, side.triangle) == side.apex);
            if (i == 0) continue;
            const auto key = [](const HalfEdge& h) { return std::array{h.first, h.second, h.apex, h.triangle}; };
            REQUIRE(key(sides[i - 1]) < key(side));
        }
    }
}

TEST_CASE("every edge is visited once, with all its sides", "[mesh]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto surface = test::random_surface<double>(random);
        std::map<std::array<Index, 2>, std::size_t> counts;
        for (const auto& corner : surface.triangles.colwise()) {
            for (const int k : {0, 1, 2}) {
                const Index a = corner[k], b = corner[(k + 1) % 3];
                ++counts[{std::min(a, b), std::max(a, b)}];
            }
        }
        auto expected = counts.begin();
        for_each_edge(half_edges(surface.triangles), [&](std::span<const HalfEdge> sides) {
            REQUIRE(expected != counts.end());
            REQUIRE(sides.size() == expected->second);
            for (const HalfEdge& side : sides) REQUIRE(std::array{side.first, side.second} == expected->first);
            ++expected;
        });
        REQUIRE(expected == counts.end());
    }
}

TEST_CASE("no triangles have no half-edges", "[mesh]") {
    CHECK(half_edges(Triangles(3, 0)).empty());
    int calls = 0;
    for_each_edge({}, [&](std::span<const HalfEdge>) { ++calls; });
    CHECK(calls == 0);
}
