// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/box_pairs.hpp>

#include <array>
#include <cstdint>
#include <set>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("boxes that overlap are those of a search through all pairs", "[mesh]") {
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        std::vector<Aabb<double>> boxes(static_cast<std::size_t>(random.index(80)));
        const double size = random.number(0.01, 0.5);
        for (Aabb<double>& box : boxes) {
            Vector3<double> middle = random.vector<double>();
            if (random.chance(0.3))
                middle = middle.eigen().array().round().matrix();  // many at one place, and touching
            box.include(middle);
            box.include(Vector3<double>(middle + (random.chance(0.2) ? 1.0 : size) * random.vector<double>(0, 1)));
        }
        std::set<std::array<Index, 2>> expected, found;
        for (std::size_t i = 0; i < boxes.size(); ++i) {
            for (std::size_t j = i + 1; j < boxes.size(); ++j) {
                if (at_most(boxes[i].low, boxes[j].high) && at_most(boxes[j].low, boxes[i].high)) {
                    expected.insert({static_cast<Index>(i), static_cast<Index>(j)});
                }
            }
        }
        std::int64_t effort = 100'000;
        REQUIRE(for_each_overlap(boxes, effort, [&](Index i, Index j) { REQUIRE(found.insert({i, j}).second); }));
        REQUIRE(found == expected);
        REQUIRE(100'000 - effort >= static_cast<std::int64_t>(expected.size()));
        std::int64_t too_little = (100'000 - effort) / 2;
        if (boxes.size() > 4) REQUIRE(!for_each_overlap(boxes, too_little, [](Index, Index) {}));
    }
}

TEST_CASE("the work for boxes side by side grows little faster than their number", "[mesh]") {
    std::int64_t used = 0;
    for (const Index side : {16, 64}) {
        std::vector<Aabb<double>> boxes;
        for (Index i = 0; i < side * side; ++i) {
            boxes.emplace_back().include(Vector3<double>(i % side, i / side, 0));
            boxes.back().include(Vector3<double>(i % side + 1, i / side + 1, 0));
        }
        std::int64_t effort = 1'000'000'000;
        CHECK(for_each_overlap(boxes, effort, [](Index, Index) {}));
        const std::int64_t now = 1'000'000'000 - effort;
        if (used > 0) CHECK(now < 32 * used);  // 16 times as many
        used = now;
    }
}
