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
static_assert(Executor<AnyExecutor>);
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

TEST_CASE("what is distributed is done once, so many in each task at the most", "[executor]") {
    for (const Index count : {0, 1, 2, 9, 10, 11, 100}) {
        for (const Index grain_size : {1, 3, 10, 1000}) {
            CAPTURE(count, grain_size);
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
            parallel_for(backwards, static_cast<std::size_t>(count), static_cast<std::size_t>(grain_size),
                         [&](std::size_t begin, std::size_t end) {
                             CHECK(begin < end);
                             for (; begin < end; ++begin) ++done[begin];
                         });
            CHECK(std::all_of(done.begin(), done.end(), [](int times) { return times == 1; }));
            CHECK(tasks == (count + grain_size - 1) / grain_size);
            CHECK(largest <= grain_size);
        }
    }
}

TEST_CASE("an executor of any type does what the one does that it was made of, and outlives that", "[executor]") {
    std::vector<Index> order;
    const auto note = [&](Index i) { order.push_back(i); };
    AnyExecutor serial, also_serial = OneThread{}, other;
    {
        const auto backwards = [shift = std::vector<Index>{10}](Index count, const auto& task) {
            for (Index i = count; i-- > 0;) task(shift[0] + i);
        };
        other = backwards;
    }
    CHECK(serial.is_serial());
    CHECK(also_serial.is_serial());
    CHECK_FALSE(other.is_serial());
    serial(3, note);
    const AnyExecutor copy = other;
    other = serial;
    copy(3, note);
    AnyExecutor{copy}(2, note);
    serial(0, note);
    copy(0, note);
    CHECK(order == std::vector<Index>{0, 1, 2, 12, 11, 10, 11, 10});
}
