// SPDX-License-Identifier: MIT
#include <membrane/core/compressed_rows.hpp>

#include <algorithm>
#include <array>
#include <iterator>
#include <memory>
#include <utility>
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
    const CompressedRows<int> none;
    CHECK(none.items().empty());
    const CompressedRows<int> rows(3, [](auto) {});
    CHECK(rows.row_count() == 3);
    CHECK(rows[0].empty());
    CHECK(rows[2].empty());
}

TEST_CASE("a row that is divided keeps the order of its items, and other rows", "[core]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        constexpr Index old_rows = 4, row_count = 12;
        std::vector<std::vector<Index>> expected(row_count);
        for (Index r = 0; r < old_rows; ++r) {
            for (Index n = random.index(12); n > 0; --n)
                expected[static_cast<std::size_t>(r)].push_back(random.index(99));
        }
        CompressedRows<Index> rows(row_count, [&](auto put) {
            for (Index r = 0; r < row_count; ++r) {
                for (const Index item : expected[static_cast<std::size_t>(r)]) put(r, item);
            }
        });
        for (Index to = old_rows; to < row_count; ++to) {
            const Index from = random.index(to);
            const auto goes = [&](Index item) { return item % 3 == to % 3; };
            auto& left = expected[static_cast<std::size_t>(from)];
            auto& right = expected[static_cast<std::size_t>(to)];
            std::copy_if(left.begin(), left.end(), std::back_inserter(right), goes);
            std::erase_if(left, goes);
            rows.split(from, to, goes);
            for (Index r = 0; r < row_count; ++r) {
                const auto row = std::as_const(rows)[r];
                REQUIRE(std::vector(row.begin(), row.end()) == expected[static_cast<std::size_t>(r)]);
            }
        }
    }
}

TEST_CASE("a row that is divided may keep capacity for more items", "[core]") {
    CompressedRows<int> rows(3, [](auto put) {
        for (int i = 0; i < 8; ++i) put(0, i);
        put(1, 100);
    });
    rows.truncate(0, 5);  // 0 to 4, and capacity for 3
    rows.split(
        0, 2, [](int item) { return item == 1 || item == 3; }, 5);
    const auto row = [&](Index r) { return std::vector<int>(rows[r].begin(), rows[r].end()); };
    CHECK(row(0) == std::vector{0, 2, 4});
    CHECK(row(2) == std::vector{1, 3});
    rows.append(0, 7);
    rows.append(0, 8);
    rows.append(2, 9);
    CHECK(row(0) == std::vector{0, 2, 4, 7, 8});
    CHECK(row(2) == std::vector{1, 3, 9});
    CHECK(row(1) == std::vector{100});
    rows.share(2, 1);
    CHECK(row(1) == row(2));
}
