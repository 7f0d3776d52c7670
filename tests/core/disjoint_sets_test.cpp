// SPDX-License-Identifier: MIT
#include <membrane/core/disjoint_sets.hpp>

#include <algorithm>
#include <vector>

#include <membrane/core/types.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("sets that grow together are those of labels painted over", "[core]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto count = static_cast<std::size_t>(1 + random.index(60));
        const auto any = [&] { return static_cast<std::size_t>(random.index(static_cast<Index>(count))); };
        DisjointSets sets(count);
        std::vector<std::size_t> label(count);  // the lowest of the set
        for (std::size_t i = 0; i < count; ++i) label[i] = i;
        for (Index step = random.index(80); step > 0; --step) {
            const std::size_t i = any(), j = any();
            sets.unite(i, j);
            const std::size_t high = std::max(label[i], label[j]), low = std::min(label[i], label[j]);
            for (std::size_t& each : label) each = each == high ? low : each;
        }
        for (std::size_t i = 0; i < count; ++i) REQUIRE(sets.find(i) == label[i]);
    }
}
