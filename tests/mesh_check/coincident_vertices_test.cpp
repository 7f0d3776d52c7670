// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/coincident_vertices.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <set>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("near vertices are those of a search through all pairs", "[mesh]") {
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index count = 1 + random.index(40), grid = 1 + random.index(4);
        Points<double> x(3, count);
        for (double& coordinate : x.reshaped()) {
            coordinate = random.chance(0.5) ? random.index(grid) - 1 : random.number(-1.0, 1.0);
            if (coordinate == 0 && random.chance(0.5)) coordinate = -0.0;
        }
        for (Index v = 1; v < count; ++v) {
            if (random.chance(0.3)) x.col(v) = x.col(random.index(v));
        }
        std::vector<Index> some;
        for (Index v = 0; v < count; ++v) {
            if (random.chance(0.9)) some.push_back(v);
        }
        std::vector<Index> lowest(static_cast<std::size_t>(count));
        std::iota(lowest.begin(), lowest.end(), 0);
        for (const Index v : some) {
            for (const Index w : some) {
                Index& mine = lowest[static_cast<std::size_t>(v)];
                if (x.col(v) == x.col(w)) mine = std::min(mine, w);
            }
        }
        const CoincidentVertices near(x, some);
        REQUIRE(near.representative() == lowest);

        const double distance = random.number(0.0, 1.0);
        std::set<std::array<Index, 2>> expected, found;
        for (const Index v : some) {
            for (const Index w : some) {
                const bool own = lowest[static_cast<std::size_t>(v)] == v && lowest[static_cast<std::size_t>(w)] == w;
                if (v < w && own && norm<double>(x.col(v) - x.col(w)) <= distance) expected.insert({v, w});
            }
        }
        std::int64_t effort = 10'000;
        REQUIRE(near.for_each_pair(distance, effort, [&](Index v, Index w) { REQUIRE(found.insert({v, w}).second); }));
        REQUIRE(found == expected);
        effort = static_cast<std::int64_t>(expected.size()) - 1;
        if (!expected.empty()) REQUIRE(!near.for_each_pair(distance, effort, [](Index, Index) {}));
    }
}
