// SPDX-License-Identifier: MIT
#include <membrane/core/fixed_vector.hpp>

#include <string>
#include <utility>
#include <vector>

#include "support/catch.hpp"
#include "support/child_process.hpp"

using namespace membrane;

namespace {

template <class Item>
std::vector<Item> items_of(const FixedVector<Item>& list) {
    return {list.items().begin(), list.items().end()};
}

}  // namespace

TEST_CASE("a list takes as many items as its capacity, and says when it is full", "[core]") {
    FixedVector<int> list(3);
    CHECK(list.empty());
    for (int round = 0; round < 2; ++round) {
        CHECK(list.try_push_back(5));
        CHECK(list.try_push_back(7));
        CHECK(list.try_push_back(5));
        CHECK_FALSE(list.try_push_back(9));
        CHECK(list.size() == 3);
        CHECK(items_of(list) == std::vector<int>{5, 7, 5});
        CHECK(list[1] == 7);
        list.clear();
        CHECK(list.empty());
    }
    CHECK_FALSE(FixedVector<int>().try_push_back(1));
    CHECK_FALSE(FixedVector<int>(0).try_push_back(1));
}

TEST_CASE("a list is cut to its first items", "[core]") {
    FixedVector<int> list(3);
    for (const int item : {5, 7, 9}) list.try_push_back(item);
    list.truncate(3);
    CHECK(items_of(list) == std::vector<int>{5, 7, 9});
    list.truncate(1);
    CHECK(items_of(list) == std::vector<int>{5});
    list.try_push_back(8);
    CHECK(items_of(list) == std::vector<int>{5, 8});
    list.truncate(0);
    CHECK(list.empty());
}

TEST_CASE("items of a list can be changed in place", "[core]") {
    FixedVector<std::string> list(4);
    list.try_push_back("a");
    list.try_push_back("b");
    for (auto& item : list.items()) item += "!";
    CHECK(items_of(list) == std::vector<std::string>{"a!", "b!"});
}

TEST_CASE("a list never moves its items, and a copy keeps the capacity", "[core]") {
    FixedVector<int> list(100);
    list.try_push_back(0);
    const int* const first = list.items().data();
    for (int i = 1; i < 50; ++i) list.try_push_back(i);
    CHECK(list.items().data() == first);

    FixedVector<int> copy = list;
    for (int i = 50; i < 100; ++i) CHECK(copy.try_push_back(i));
    CHECK_FALSE(copy.try_push_back(100));
    CHECK(list.size() == 50);
    const int* const place = copy.items().data();
    const FixedVector<int> moved = std::move(copy);
    CHECK(moved.items().data() == place);
    CHECK(moved.size() == 100);
}

TEST_CASE("a list is never made longer by cutting it short", "[core][bad]") {
    FixedVector<int> list(4);
    list.try_push_back(1);
    list.truncate(2);
    CHECK(list.size() == 1);
    list.truncate(1);
    CHECK(list.size() == 1);
}

#ifndef NDEBUG
TEST_CASE("an item beyond the end of a list is a broken precondition", "[core][bad]") {
    FixedVector<int> list(4);
    list.try_push_back(1);
    CHECK(test::in_child([&] { (void)list[1]; }).signal == SIGABRT);
    CHECK(test::in_child([&] { (void)list[0]; }).signal == 0);
}
#endif
