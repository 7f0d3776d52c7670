// SPDX-License-Identifier: MIT
#include <membrane/core/thread_pool.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <set>
#include <thread>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

TEST_CASE("a pool does every task once, and has done all when it returns", "[executor]") {
    for (const int threads : {1, 2, 3, 8}) {
        const ThreadPool pool(threads);
        CHECK(pool.threads() == threads);
        Random random(static_cast<std::uint64_t>(threads));
        std::vector<int> done;
        for (int job = 0; job < cases(600, 3000); ++job) {
            CAPTURE(threads, job);
            done.assign(static_cast<std::size_t>(random.index(40)), 0);
            pool(static_cast<Index>(done.size()), [&](Index i) { ++done[static_cast<std::size_t>(i)]; });
            REQUIRE(std::all_of(done.begin(), done.end(), [](int times) { return times == 1; }));
        }
    }
}

TEST_CASE("tasks run in several threads, also after these have slept", "[executor]") {
    const ThreadPool pool(2);
    for (int round = 0; round < 3; ++round) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        std::atomic<int> arrived = 0;
        std::vector<std::thread::id> ids(2);
        pool.executor()(2, [&](Index i) {
            ids[static_cast<std::size_t>(i)] = std::this_thread::get_id();
            for (++arrived; arrived < 2;) std::this_thread::yield();  // each waits for the other
        });
        CHECK(ids[0] != ids[1]);
    }
}

TEST_CASE("a pool that never worked ends as well, and one of no threads is refused", "[executor]") {
    { const ThreadPool idle(4); }
    CHECK(ThreadPool().threads() >= 1);
    CHECK(test::refusal([] { const ThreadPool none(0); }) == "ThreadPool: there must be at least 1 thread, got 0");
}
