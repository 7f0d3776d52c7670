// SPDX-License-Identifier: MIT
#include <membrane/core/executor.hpp>

#include <algorithm>
#include <vector>

#include "support/catch.hpp"

using namespace membrane;

namespace {

struct Throws {
    void operator()(Index, int) const;
};
static_assert(!Executor<Throws>);
static_assert(Executor<decltype([](Index, const auto& task) { task(0); })>);

}  // namespace

TEST_CASE("one thread does every task once, in order", "[executor]") {
    for (const Index count : {0, 1, 7}) {
        std::vector<Index> done, expected;
        OneThread{}(count, [&](Index i) { done.push_back(i); });
        for (Index i = 0; i < count; ++i) expected.push_back(i);
        CHECK(done == expected);
    }
}

TEST_CASE("what is shared out is done once, so many in each task at the most", "[executor]") {
    for (const Index count : {0, 1, 2, 9, 10, 11, 100}) {
        for (const Index at_once : {1, 3, 10, 1000}) {
            CAPTURE(count, at_once);
            std::vector<int> done(static_cast<std::size_t>(count), 0);
            Index tasks = 0, largest = 0;
            const auto backwards = [&](Index all, const auto& task) {
                tasks = all;
                for (Index i = all; i-- > 0;) {
                    const auto before = std::count(done.begin(), done.end(), 1);
                    task(i);
                    largest = std::max(largest, static_cast<Index>(std::count(done.begin(), done.end(), 1) - before));
                }
            };
            share_out(backwards, static_cast<std::size_t>(count), static_cast<std::size_t>(at_once),
                      [&](std::size_t begin, std::size_t end) {
                          CHECK(begin < end);
                          for (; begin < end; ++begin) ++done[begin];
                      });
            CHECK(std::all_of(done.begin(), done.end(), [](int times) { return times == 1; }));
            CHECK(tasks == (count + at_once - 1) / at_once);
            CHECK(largest <= at_once);
        }
    }
}
