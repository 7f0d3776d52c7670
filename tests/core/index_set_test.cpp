// SPDX-License-Identifier: MIT
#include <membrane/core/index_set.hpp>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

std::vector<Index> items_of(const IndexSet& set) { return {set.items().begin(), set.items().end()}; }

}  // namespace

TEST_CASE("a set of indices holds each once, in order of arrival", "[core]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index size = 1 + random.index(40);
        IndexSet set(size);
        std::vector<Index> expected;
        for (int n = 0; n < 300; ++n) {
            if (random.chance(0.03)) {
                set.clear();
                expected.clear();
            }
            const Index i = random.index(size);
            const bool is_new = std::find(expected.begin(), expected.end(), i) == expected.end();
            REQUIRE(set.contains(i) == !is_new);
            REQUIRE(set.insert(i) == is_new);
            if (is_new) expected.push_back(i);
            REQUIRE(set.contains(i));
            REQUIRE(set.count() == static_cast<Index>(expected.size()));
            REQUIRE(set.empty() == expected.empty());
        }
        REQUIRE(items_of(set) == expected);
    }
}

TEST_CASE("a set can be filled to the last index and used again", "[core]") {
    IndexSet set(5);
    for (int round = 0; round < 3; ++round) {
        for (const Index i : {4, 0, 3, 1, 2}) CHECK(set.insert(i));
        for (const Index i : {0, 1, 2, 3, 4}) CHECK_FALSE(set.insert(i));
        CHECK(items_of(set) == std::vector<Index>{4, 0, 3, 1, 2});
        set.clear();
        CHECK(set.empty());
        CHECK(set.items().empty());
    }
    CHECK(IndexSet().empty());
    CHECK(IndexSet(0).count() == 0);
}

TEST_CASE("sets are copied, moved and swapped with all they hold", "[core]") {
    IndexSet first(9), second(9);
    first.insert(7);
    first.insert(2);
    second.insert(8);
    IndexSet copy = first;
    copy.insert(5);
    CHECK(items_of(first) == std::vector<Index>{7, 2});
    CHECK(items_of(copy) == std::vector<Index>{7, 2, 5});
    first.clear();
    CHECK(copy.contains(7));
    IndexSet moved = std::move(copy);
    for (const Index i : {0, 1, 3, 4, 6, 8}) CHECK(moved.insert(i));  // the capacity is kept
    CHECK(moved.count() == 9);
    std::swap(first, second);
    CHECK(items_of(first) == std::vector<Index>{8});
    CHECK(second.empty());
}

TEST_CASE("what happens online to a set throws nothing", "[core]") {
    STATIC_REQUIRE(noexcept(std::declval<IndexSet&>().insert(0)));
    STATIC_REQUIRE(noexcept(std::declval<IndexSet&>().clear()));
    STATIC_REQUIRE(noexcept(std::declval<const IndexSet&>().contains(0)));
    STATIC_REQUIRE(noexcept(std::declval<const IndexSet&>().items()));
    STATIC_REQUIRE(std::is_nothrow_move_constructible_v<IndexSet>);
}

TEST_CASE("an index beyond the capacity of a set is not inserted, and asking for it a broken precondition",
          "[core][bad]") {
    IndexSet set(3);
    for (const Index wrong : {-1, 3, 1'000'000'000}) {
        CAPTURE(wrong);
        CHECK_FALSE(set.has(wrong));
        CHECK_FALSE(set.insert(wrong));
#ifndef NDEBUG
        CHECK(test::in_child([&] { (void)set.contains(wrong); }).signal == SIGABRT);
#endif
    }
    CHECK(set.empty());
    CHECK(set.has(2));
    CHECK(set.insert(2));
}
