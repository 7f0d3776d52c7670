// SPDX-License-Identifier: MIT
#include <membrane/core/compressed_rows.hpp>

#include <array>
#include <memory>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

TEST_CASE("rows hold their items in the order they were put", "[core]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index row_count = 1 + random.index(20);
        std::vector<std::vector<std::array<Index, 2>>> expected(static_cast<std::size_t>(row_count));
        std::vector<std::pair<Index, std::array<Index, 2>>> puts;
        for (Index n = random.index(60); n > 0; --n) {
            const Index row = random.index(row_count);
            puts.push_back({row, {n, random.index(9)}});
            expected[static_cast<std::size_t>(row)].push_back(puts.back().second);
        }
        auto first = std::make_unique<CompressedRows<std::array<Index, 2>>>(row_count, [&](auto put) {
            for (const auto& [row, item] : puts) put(row, item);
        });
        const auto rows = *first;
        first.reset();
        REQUIRE(rows.row_count() == row_count);
        REQUIRE(rows.items().size() == puts.size());
        std::size_t before = 0;
        for (Index r = 0; r < row_count; ++r) {
            REQUIRE(std::vector(rows[r].begin(), rows[r].end()) == expected[static_cast<std::size_t>(r)]);
            REQUIRE(rows[r].data() == rows.items().data() + before);
            before += rows[r].size();
        }
    }
}

TEST_CASE("there may be no rows, and rows without items", "[core]") {
    CHECK(CompressedRows<int>().row_count() == 0);
    CHECK(CompressedRows<int>().items().empty());
    const CompressedRows<int> rows(3, [](auto) {});
    CHECK(rows.row_count() == 3);
    CHECK(rows[0].empty());
    CHECK(rows[2].empty());
}
