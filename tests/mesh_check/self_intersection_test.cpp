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
