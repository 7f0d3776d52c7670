// SPDX-License-Identifier: MIT
#include <membrane/surface/aabb.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
Aabb<S> random_box(Random& random) {
    Aabb<S> box;
    box.include(random.vector<S>());
    box.include(random.vector<S>());
    if (random.chance(0.2)) box.high[0] = box.low[0];  // flat
    return box;
}

}  // namespace

TEMPLATE_TEST_CASE("a box is the smallest around what it includes", "[aabb]", TEST_SCALARS) {
    using S = TestType;
    Aabb<S> box;
    CHECK((box.low.eigen().array() > box.high.eigen().array()).all());
    box.include(Vector3<S>(1, 2, 3));
    CHECK(box.low == box.high);
    box.include(Vector3<S>(0, 5, 3));
    CHECK(box.low == Vector3<S>(0, 2, 3));
    CHECK(box.high == Vector3<S>(1, 5, 3));
    box.include(Aabb<S>{{0, 0, 0}, {1, 1, 9}});
    CHECK(box.low == Vector3<S>(0, 0, 0));
    CHECK(box.high == Vector3<S>(1, 5, 9));
    box.include(Aabb<S>{});  // nothing
    box.include(Vector3<S>::Constant(std::numeric_limits<S>::quiet_NaN()));
    CHECK(box.low == Vector3<S>(0, 0, 0));
    CHECK(box.high == Vector3<S>(1, 5, 9));

    const auto around = bounds(Triangle<S>{{1, 5, 0}, {2, 4, -1}, {0, 6, -2}});
    CHECK(around.low == Vector3<S>(0, 4, -2));
    CHECK(around.high == Vector3<S>(2, 6, 0));
}

TEST_CASE("the longest axis is the first of the longest", "[aabb]") {
    CHECK(major_axis(Aabb<double>{{0, 0, 0}, {1, 1, 1}}) == 0);
    CHECK(major_axis(Aabb<double>{{0, 0, 0}, {1, 2, 2}}) == 1);
    CHECK(major_axis(Aabb<double>{{0, 0, 0}, {2, 1, 2}}) == 0);
    CHECK(major_axis(Aabb<double>{{0, 0, -1}, {1, 1, 1}}) == 2);
}

TEST_CASE("boxes overlap when no axis separates them, borders included", "[aabb]") {
    const Aabb<double> box{{0, 0, 0}, {1, 2, 3}};
    CHECK(overlap(box, {{1, 2, 3}, {4, 4, 4}}));
    CHECK(overlap(box, {{0.5, 0.5, 0.5}, {0.6, 0.6, 0.6}}));
    CHECK(overlap(Aabb<double>{{-1, -1, -1}, {9, 9, 9}}, box));
    for (int k = 0; k < 3; ++k) {
        Aabb<double> beside = box;
        beside.low[k] += box.high[k] * 1.001;
        beside.high[k] += box.high[k] * 1.001;
        CHECK_FALSE(overlap(box, beside));
        CHECK_FALSE(overlap(beside, box));
    }
    CHECK_FALSE(overlap(box, Aabb<double>{}));
}

TEMPLATE_TEST_CASE("no point of a box is nearer than its distance, nor farther than its farthest corner", "[aabb]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto box = random_box<S>(random);
        const Vector3<S> q = random.vector<S>(-2, 2), nearest = q.cwiseMax(box.low).cwiseMin(box.high);
        CHECK(squared_distance(box, q) == squared_norm<S>(q - nearest));
        for (int i = 0; i < 20; ++i) {
            const Vector3<S> part = random.vector<S>(0, 1);
            const Vector3<S> p = box.low + part.cwiseProduct(box.high - box.low);
            CHECK(squared_norm<S>(q - p) >= squared_distance(box, q) * (1 - 8 * std::numeric_limits<S>::epsilon()));
            CHECK((q - p).cwiseAbs().maxCoeff() <=
                  max_axis_distance(box, q) * (1 + 2 * std::numeric_limits<S>::epsilon()));
        }
        if (squared_distance(box, q) > 0) continue;
        CHECK((at_most(box.low, q) && at_most(q, box.high)));
    }
    CHECK(squared_distance(Aabb<S>{}, Vector3<S>(0, 0, 0)) == std::numeric_limits<S>::infinity());
}

TEMPLATE_TEST_CASE("a capsule never misses a box that it touches", "[aabb]", TEST_SCALARS) {
    using S = TestType;
    int touching = 0, missing = 0;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto box = random_box<S>(random);
        const Vector3<S> inside = box.low + random.vector<S>(0, 1).cwiseProduct(box.high - box.low);
        Vector3<S> from = random.vector<S>(-2, 2), to = random.vector<S>(-2, 2);
        S radius = random.chance(0.3) ? S(0) : random.number<S>(0, S(0.2));
        if (seed % 4 == 0) to = from + random.number<S>(0, 2) * (inside - from);
        if (seed % 5 == 0) to[0] = from[0] = box.low[0];  // in a side
        if (seed % 7 == 0) to = from = inside;
        const CapsuleQuery<S> probe(from, to, radius, box);
        const S entry = probe.entry(box);
        CHECK(((entry >= 0 && entry <= 1) || entry == CapsuleQuery<S>::never));

        // From the left, the first point of the segment so near to the box: distances along it fall, then rise.
        const auto distance_at = [&](long double along) {
            const test::Vector<long double> p =
                from.eigen().template cast<long double>() + along * (to - from).eigen().template cast<long double>();
            const test::Vector<long double> nearest = p.cwiseMax(box.low.eigen().template cast<long double>())
                                                          .cwiseMin(box.high.eigen().template cast<long double>());
            return (p - nearest).norm();
        };
        if (test::least(distance_at) <= radius) {
            ++touching;
            REQUIRE(entry <= 1);
            if (entry > 0) CHECK(distance_at(entry) >= static_cast<long double>(radius) * (1 - 1e-4L) - 1e-4L);
            for (int i = 0; i <= 10; ++i) {
                const auto along = static_cast<S>(i) / 10;
                if (along < entry) CHECK(distance_at(along) > radius);
            }
        } else if (test::least(distance_at) > 2 * radius + S(1e-3)) {  // more than the corner of a cube of that size
            ++missing;
            CHECK(entry == CapsuleQuery<S>::never);
        }
    }
    CHECK(touching > cases(3000));
    CHECK(missing > cases(3000));
}

TEMPLATE_TEST_CASE("several boxes at once come to what each comes to", "[aabb][lanes]", TEST_SCALARS) {
    using S = TestType;
    using Wide = Lanes<S>;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<Triangle<S>, Wide::count> each;
        std::array<Aabb<S>, Wide::count> box;
        Triangle<Wide> triangles;
        Aabb<Wide> boxes;
        for (std::size_t i = 0; i < Wide::count; ++i) {
            each[i] = {random.vector<S>(), random.vector<S>(), random.vector<S>()};
            box[i] = random_box<S>(random);
            for (int k = 0; k < 3; ++k) {
                triangles.a[k].set(i, each[i].a[k]);
                triangles.b[k].set(i, each[i].b[k]);
                triangles.c[k].set(i, each[i].c[k]);
                boxes.low[k].set(i, box[i].low[k]);
                boxes.high[k].set(i, box[i].high[k]);
            }
        }
        Vector3<S> q = random.vector<S>(-2, 2), p = random.vector<S>(-2, 2);
        if (random.chance(0.2)) p[random.index(3)] = q[0];
        const Aabb<S> other = random_box<S>(random);
        const CapsuleQuery<S> probe(q, p, random.number<S>(0, S(0.2)), other);
        const auto around = bounds(triangles);
        for (std::size_t i = 0; i < Wide::count; ++i) {
            CAPTURE(i);
            CHECK(squared_distance(boxes, q)[i] == squared_distance(box[i], q));
            CHECK(probe.entry(boxes)[i] == probe.entry(box[i]));
            CHECK(((bits(overlap(boxes, other)) >> i) & 1) == (overlap(box[i], other) ? 1 : 0));
            for (int k = 0; k < 3; ++k) {
                CHECK(around.low[k][i] == bounds(each[i]).low[k]);
                CHECK(around.high[k][i] == bounds(each[i]).high[k]);
            }
        }
    }
}

TEST_CASE("boxes lie within others, overlap, or have a gap between them", "[aabb]") {
    const auto inside = [](const Aabb<double>& a, const Aabb<double>& b) {
        bool all = true;
        for (Index k = 0; k < 3; ++k) all &= a.low[k] <= b.low[k] && b.high[k] <= a.high[k];
        return all;
    };
    int within = 0, apart = 0;
    for (int seed = 1; seed <= cases(2'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Aabb<double> a, b;
        for (Aabb<double>* box : {&a, &b}) {
            for (int i = 0; i < 2 + random.index(6); ++i) box->include(random.vector<double>());
        }
        REQUIRE(contains(a, b) == inside(a, b));
        REQUIRE(contains(a, a.low));
        REQUIRE(contains(a, b.low) == (squared_distance(a, b.low) == 0));
        REQUIRE((gap_between(a, b) <= 0) == bool(overlap(a, b)));
        REQUIRE(gap_between(a, b) == gap_between(b, a));
        within += contains(a, b) ? 1 : 0;
        apart += gap_between(a, b) > 0 ? 1 : 0;
    }
    CHECK(within > 0);
    CHECK(apart > 0);
    CHECK(gap_between(Aabb<double>{{0, 0, 0}, {1, 1, 1}}, Aabb<double>{{0, 3, 1}, {1, 4, 2}}) == 2);
}
