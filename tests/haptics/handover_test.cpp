// SPDX-License-Identifier: MIT
#include <membrane/haptics/handover.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <membrane/contact/tool.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/random_tear.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

/// Large enough for a copy to be caught in the middle: every word follows from the number.
struct Wide {
    std::array<std::uint64_t, 24> words{};

    static Wide of(std::uint64_t number) {
        Wide wide;
        for (std::size_t i = 0; i < wide.words.size(); ++i) wide.words[i] = number * (2 * i + 1);
        return wide;
    }
    bool operator==(const Wide&) const = default;
};

/// A writer's membrane: each tick moves some vertices, the same ones to the same places for everybody who counts along.
template <Real S>
struct Ticks {
    explicit Ticks(Index vertices) : x(Points<S>::Zero(3, vertices)) {}

    /// The next one.
    void operator()() {
        ++number;
        moved.clear();
        for (auto more = random.index(8); more > 0; --more) {
            moved.push_back(random.index(static_cast<Index>(x.cols())));
            x.col(moved.back()).setConstant(static_cast<S>(number));
        }
    }

    Points<S> x;
    std::vector<Index> moved;
    std::uint64_t number = 0;
    Random random{7};
};

/// `write(number)` for numbers up to `last` in one thread, `read(complete)` in another until it returns the last
/// number; `complete` is that of a write that was over before. Now and then the writer waits for a read: a loaded
/// machine might run the threads one after the other.
template <class Write, class Read>
void race(std::uint64_t last, Write write, Read read) {
    std::atomic<std::uint64_t> complete{0}, reads{0};
    std::thread writer([&] {
        for (std::uint64_t number = 1; number <= last; ++number) {
            write(number);
            complete.store(number, std::memory_order_release);
            if (number % 1024 != 0 || number == last) continue;
            for (const auto before = reads.load(); reads.load() == before;) std::this_thread::yield();
        }
    });
    while (read(complete.load(std::memory_order_acquire)) < last) ++reads;
    writer.join();
}

}  // namespace

TEST_CASE("the latest is read, whole, with its number and age", "[handover]") {
    Latest<Tool<double>> pose(Tool<double>{.radius = 1e-3});
    CHECK(pose.read().number == 0);
    CHECK(pose.read().value.radius == 1e-3);
    pose.publish({.position = {1, 2, 3}}, 5);
    pose.publish({.position = {4, 5, 6}}, 7);
    for (int again = 0; again < 2; ++again) {
        const Snapshot<Tool<double>>& read = pose.read();
        CHECK(read.number == 2);
        CHECK(read.age(7.5) == 0.5);
        CHECK(read.value.position == Vector3<double>(4, 5, 6));
    }
    STATIC_REQUIRE(noexcept(pose.read()));
    STATIC_REQUIRE(noexcept(pose.publish(std::declval<const Tool<double>&>(), 0.0)));
}

TEST_CASE("nothing is torn, goes back or is older than the last complete publish", "[handover]") {
    Latest<Wide> latest;
    const auto last = static_cast<std::uint64_t>(cases(300'000, 10'000'000));
    std::uint64_t torn = 0, backward = 0, stale = 0, before = 0, seen = 0;
    race(
        last, [&](std::uint64_t number) { latest.publish(Wide::of(number), static_cast<double>(number)); },
        [&](std::uint64_t complete) {
            const auto& read = latest.read();
            if (read.value != Wide::of(read.number) || read.time != static_cast<double>(read.number)) ++torn;
            if (read.number < before) ++backward;
            if (read.number < complete) ++stale;
            if (read.number > before) ++seen;
            return before = read.number;
        });
    INFO("of " << last << " the reader saw " << seen);
    CHECK(torn == 0);
    CHECK(backward == 0);
    CHECK(stale == 0);
    CHECK(seen > 1);
}

TEMPLATE_TEST_CASE("all that has moved since the last read is read, and hardly more", "[handover]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Ticks<S> ticks(1 + random.index(60));
        MovedPoints<S> moved(static_cast<Index>(ticks.x.cols()));
        Points<S> shown = ticks.x;
        std::set<Index> since, and_before;  // what has moved since the last snapshot read, and since the one before
        std::uint64_t last = 0;
        const double busy = random.number(0.05, 0.95);
        for (int i = 0; i < 300; ++i) {
            if (random.chance(busy)) {
                ticks();
                moved.publish(ticks.moved, ticks.x, static_cast<double>(ticks.number) / 2);
                since.insert(ticks.moved.begin(), ticks.moved.end());
                and_before.insert(ticks.moved.begin(), ticks.moved.end());
                continue;
            }
            const auto news = moved.read();
            REQUIRE(news.number == ticks.number);
            REQUIRE(news.age(static_cast<double>(ticks.number)) == static_cast<double>(ticks.number) / 2);
            for (const Index v : news.moved) shown.col(v) = news.x.col(v);
            REQUIRE(test::same_bits(shown, ticks.x));
            const std::set<Index> reported(news.moved.begin(), news.moved.end());
            REQUIRE(reported.size() == news.moved.size());
            REQUIRE(std::includes(reported.begin(), reported.end(), since.begin(), since.end()));
            REQUIRE(std::includes(and_before.begin(), and_before.end(), reported.begin(), reported.end()));
            if (std::exchange(last, news.number) < news.number) and_before = std::exchange(since, {});
            REQUIRE(moved.read().moved.empty());
        }
    }
}

TEMPLATE_TEST_CASE("what a tear changes is read as well: copies, moved vertices, corners of triangles", "[handover]",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = with_reserve(disc<S>({.radius = 1, .rings = 5}), 30);
    const TornSurface<S> whole(mesh);
    int splits = 0, resets = 0;
    for (int seed = 1; seed <= cases(50, 1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = whole;
        Points<S> x = mesh.positions(), shown = x;
        Triangles indices = mesh.triangles();
        MovedPoints<S> moved(mesh.vertex_count(), mesh.triangle_count());
        const double busy = random.number(0.05, 0.95);
        for (int i = 0; i < 200; ++i) {
            if (random.chance(busy)) {
                test::change_at_random(random, surface, x, true);
                for (const auto& event : surface.events()) follow(event, moved);
                splits += static_cast<int>(surface.events().size());
                const Index v = random.index(mesh.vertex_count());
                x.col(v) = random.template vector<S>();
                if (random.chance(0.02)) {
                    surface = whole;
                    x = mesh.positions();
                    REQUIRE(moved.publish_all(x, surface.triangles(), 0));
                    ++resets;
                }
                moved.publish({&v, 1}, x, 0);
                continue;
            }
            const auto news = moved.read();
            for (const Index v : news.moved) shown.col(v) = news.x.col(v);
            for (const Index f : news.triangles) indices.col(f) = news.corners.col(f);
            REQUIRE(test::same_bits(shown, x));
            REQUIRE(indices == surface.triangles());
            REQUIRE(moved.read().triangles.empty());
        }
    }
    CHECK(splits > 20);
    CHECK(resets > 0);
}

TEST_CASE("what moved long before does not pile up, at whatever rate it is read", "[handover]") {
    for (int every = 1; every <= 40; ++every) {
        CAPTURE(every);
        constexpr Index count = 10'000;
        MovedPoints<double> moved(count);
        const Points<double> x = Points<double>::Zero(3, count);
        std::size_t most = 0;
        for (Index tick = 0; tick < count; ++tick) {  // each vertex moves once
            moved.publish(std::array{tick}, x, 0);
            if (tick % every == 0) most = std::max(most, moved.read().moved.size());
        }
        CHECK(most == static_cast<std::size_t>(every == 1 ? 2 : every));
    }
}

TEST_CASE("two threads share a membrane, and each snapshot is that of its tick", "[handover]") {
    constexpr Index count = 64;
    MovedPoints<double> moved(count);
    Ticks<double> written(count), expected(count);
    Points<double> shown = expected.x;
    const auto last = static_cast<std::uint64_t>(cases(300'000, 10'000'000));
    std::uint64_t torn = 0, backward = 0, stale = 0, seen = 0;
    race(
        last,
        [&](std::uint64_t number) {
            written();
            moved.publish(written.moved, written.x, static_cast<double>(number));
        },
        [&](std::uint64_t complete) {
            const auto news = moved.read();
            if (news.number < expected.number) ++backward;
            if (news.number < complete) ++stale;
            if (news.number > expected.number) ++seen;
            while (expected.number < news.number) expected();
            for (const Index v : news.moved) shown.col(v) = news.x.col(v);
            if (!test::same_bits(shown, expected.x) || news.time != static_cast<double>(news.number)) ++torn;
            return news.number;
        });
    INFO("of " << last << " the reader saw " << seen);
    CHECK(torn == 0);
    CHECK(backward == 0);
    CHECK(stale == 0);
    CHECK(seen > 1);
}

TEST_CASE("a publish of everything hands over everything, of a membrane that tears or not", "[handover]") {
    const auto mesh = icosphere({.subdivisions = 1});
    const Triangles& triangles = mesh.triangles();
    MovedPoints<double> moved(mesh.vertex_count()), torn(mesh.vertex_count(), mesh.triangle_count());
    CHECK(moved.publish_all(mesh.positions(), 2));
    const auto news = moved.read();
    CHECK(news.moved.size() == 42);
    CHECK(news.x == mesh.positions());
    CHECK(news.time == 2);
    CHECK(torn.publish_all(mesh.positions(), triangles, 3));
    CHECK(torn.read().corners == triangles);
}

TEST_CASE("a publish of another number of points or triangles is refused, and the next one is right",
          "[handover][bad]") {
    const auto mesh = icosphere({.subdivisions = 1});
    const Points<double> x = mesh.positions(), fewer = x.leftCols(41);
    const Eigen::MatrixXd rows = x.transpose();
    MovedPoints<double> moved(mesh.vertex_count());
    CHECK_FALSE(moved.publish_all(x, mesh.triangles(), 0));  // no triangles were announced
    CHECK_FALSE(moved.publish_all(fewer, 0));
    CHECK_FALSE(moved.publish_all(rows, 0));
    CHECK_FALSE(moved.publish({}, fewer, 0));
    CHECK_FALSE(moved.publish({}, rows, 0));
    CHECK(moved.read().number == 0);
    CHECK(moved.publish(std::array<Index, 4>{-1, 42, 1'000'000'000, 7}, x, 0));
    const auto news = moved.read();
    REQUIRE(news.moved.size() == 1);
    CHECK(news.moved[0] == 7);
    CHECK(news.x.col(7) == x.col(7));
}

TEST_CASE("a membrane of no vertices is not published", "[handover][bad]") {
    const std::string text = "MovedPoints: there must be at least 1 vertex, got ";
    CHECK(test::refusal([] { MovedPoints<double> none(0); }) == text + "0");
    CHECK(test::refusal([] { MovedPoints<float> none(-3); }) == text + "-3");
    CHECK(test::refusal([] { MovedPoints<float> none(1, -2); }) ==
          "MovedPoints: there must be 0 triangles or more, got -2");
    STATIC_REQUIRE(noexcept(std::declval<MovedPoints<double>&>().read()));
    STATIC_REQUIRE(noexcept(std::declval<MovedPoints<double>&>().publish(
        std::declval<std::span<const Index>>(), std::declval<const ConstPointsRef<double>&>(), 0.0)));
}
