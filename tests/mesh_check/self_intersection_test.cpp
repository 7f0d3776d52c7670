// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/self_intersection.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <set>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Surface;

// Against CGAL: validate_cgal_test.cpp.

namespace {

Index meetings(const Surface<double>& surface) {
    std::vector<Index> all(static_cast<std::size_t>(surface.triangle_count()));
    std::vector<Index> own(static_cast<std::size_t>(surface.vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    std::iota(own.begin(), own.end(), 0);
    std::int64_t effort = 1'000'000'000;
    Index count = 0;
    CHECK(for_each_self_intersection(surface.x, surface.triangles, all, own, effort, [&](Index f, Index g) {
        CHECK(f < g);
        ++count;
    }));
    return count;
}

}  // namespace

TEST_CASE("triangles meet where they cross, touch or lie on each other", "[mesh]") {
    Surface<double> two;
    for (const auto& p : {Vector3<double>(0, 0, 0), Vector3<double>(2, 0, 0), Vector3<double>(0, 2, 0)}) two.add(p);
    two.add(0, 1, 2);
    const auto with = [&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
        std::set<Index> counts;  // with their corners in any order
        for (std::array<Index, 3> first{0, 1, 2}; counts.empty() || first[0] != 0 || first[1] != 1;) {
            std::array<Index, 3> second{3, 4, 5};
            do {
                Surface<double> both = two;
                both.add(a), both.add(b), both.add(c);
                both.triangles.col(0) << first[0], first[1], first[2];
                both.add(second[0], second[1], second[2]);
                counts.insert(meetings(both));
            } while (std::next_permutation(second.begin(), second.end()));
            std::next_permutation(first.begin(), first.end());
        }
        REQUIRE(counts.size() == 1);
        return *counts.begin() == 1;
    };
    CHECK(with({0.5, 0.5, -1}, {0.5, 0.5, 1}, {3, 3, 0}));   // through it
    CHECK(with({0.5, 0.5, 0}, {0.5, 0.5, 1}, {1, 0.5, 1}));  // a corner in it
    CHECK(!with({0.5, 0.5, 1e-300}, {0.5, 0.5, 1}, {1, 0.5, 1}));
    CHECK(with({1, 0, 0}, {1, -1, 1}, {1, -1, -1}));  // a corner on its edge
    CHECK(!with({1, -1e-16, 0}, {1, -1, 1}, {1, -1, -1}));
    CHECK(with({0.1, 0.1, 0}, {0.2, 0.1, 0}, {0.1, 0.2, 0}));  // inside, in its plane
    CHECK(with({-9, -9, 0}, {9, -9, 0}, {0, 9, 0}));           // around it
    CHECK(with({2, 2, 0}, {2, 0.5, 0}, {0.5, 1.5, 0}));        // touching along an edge, from one side
    CHECK(!with({2, 2, 0}, {2, 0.5, 0}, {0.75, 1.75, 0}));
    CHECK(!with({0, 0, 1}, {2, 0, 1}, {0, 2, 1}));  // above it

    const auto folded = [&](const Vector3<double>& apex) {
        Surface<double> both = two;
        both.add(1, 0, both.add(apex));
        return meetings(both) == 1;
    };
    CHECK(!folded({0, -1, 0}));
    CHECK(folded({0, 1, 0}));
    CHECK(!folded({0, 1, 1e-300}));
    CHECK(!folded({5, -1e-300, 0}));
}

// Oracle: of convex polygons in a plane, the line of a side separates those that do not meet. Small whole numbers are
// exact.
TEST_CASE("triangles in one plane meet unless the line of a side separates them", "[mesh]") {
    int met = 0, apart = 0;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Surface<double> both;
        for (int i = 0; i < 6; ++i) {
            const double x = random.index(9), y = random.index(9);
            both.add({x, y, 0});
        }
        const auto area = [&](Index a, Index b, Index c) {
            const Eigen::Vector3d u = both.x.col(b) - both.x.col(a), v = both.x.col(c) - both.x.col(a);
            return u[0] * v[1] - u[1] * v[0];
        };
        if (area(0, 1, 2) == 0 || area(3, 4, 5) == 0) continue;
        both.add(0, 1, 2), both.add(3, 4, 5);
        const auto separates = [&](Index first, Index others) {
            for (Index i = 0; i < 3; ++i) {
                const Index from = first + i, to = first + (i + 1) % 3, inside = first + (i + 2) % 3;
                int beyond = 0;
                for (Index k = others; k < others + 3; ++k) beyond += area(from, to, k) * area(from, to, inside) < 0;
                if (beyond == 3) return true;
            }
            return false;
        };
        const bool expected = !separates(0, 3) && !separates(3, 0);
        REQUIRE((meetings(both) == 1) == expected);
        (expected ? met : apart) += 1;
    }
    CHECK(met > cases(200));
    CHECK(apart > cases(200));
}

// The exact predicates without the quick test before them.
TEST_CASE("triangles that share a corner meet where a side of one meets the other", "[mesh]") {
    int met = 0, apart = 0;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        std::array<Vector3<double>, 5> p;
        for (auto& each : p) {
            for (const int k : {0, 1, 2}) each[k] = random.index(5);
        }
        const Triangle<double> s{p[0], p[1], p[2]}, t{p[0], p[3], p[4]};
        if (area_vector(s) == Vector3<double>::Zero() || area_vector(t) == Vector3<double>::Zero()) continue;
        Surface<double> both;
        for (const auto& each : p) both.add(each);
        both.add(0, 1, 2), both.add(0, 3, 4);
        const bool expected = detail::meets(s, t.b, t.c) || detail::meets(t, s.b, s.c);
        REQUIRE((meetings(both) == 1) == expected);
        (expected ? met : apart) += 1;
    }
    CHECK(met > cases(1000));
    CHECK(apart > cases(1000));
}

TEST_CASE("surfaces as they should be meet nowhere, however they are turned", "[mesh]") {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        REQUIRE(meetings(test::random_surface<double>(random)) == 0);
        Surface<double> flat = test::surface_of(sheet({.width = 1, .height = 1, .columns = 12, .rows = 9}));
        if (seed % 2 == 0) flat.x = (random.rotation<double>() * flat.x).eval();
        REQUIRE(meetings(flat) == 0);
    }
}

TEST_CASE("a book all pages of which may lie on each other is not searched for ever", "[mesh]") {
    Surface<double> book;
    book.add(Vector3<double>(0, 0, 0));
    book.add(Vector3<double>(0, 0, 1));
    std::vector<Index> pages, own{0, 1};
    for (Index i = 0; i < 40; ++i) {
        own.push_back(book.add(Vector3<double>(std::cos(0.03 * i), std::sin(0.03 * i), 0.5)));
        pages.push_back(book.add(0, 1, own.back()));
    }
    const auto searched = [&](std::int64_t effort) {
        return for_each_self_intersection(book.x, book.triangles, pages, own, effort,
                                          [](Index, Index) { CHECK(false); });
    };
    CHECK(searched(1'000'000));
    CHECK_FALSE(searched(2000));
}
