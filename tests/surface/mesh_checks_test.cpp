// SPDX-License-Identifier: MIT
#include <membrane/surface/mesh_checks.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/surface/triangle.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using test::Surface;

// That each check refuses what it should, and nothing else, is tested with who uses them: TriangleMesh and validate.

namespace {

/// What was found, and goes on.
struct Collected {
    std::vector<MeshDefect> defects;
    std::vector<std::vector<Index>> triangles;
};

auto collect(Collected& all) {
    return [&all](MeshDefect defect, const std::vector<Index>&, const std::vector<Index>& triangles, const auto&...) {
        all.defects.push_back(defect);
        all.triangles.push_back(triangles);
    };
}

}  // namespace

TEST_CASE("checks go on after what they have found", "[mesh][bad]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> surface = test::random_surface<double>(random);
        const Index count = surface.triangle_count(), some = 1 + random.index(count);
        std::vector<Index> bad;
        for (const Index f : test::random_order(count, random)) {
            if (static_cast<Index>(bad.size()) < some) bad.push_back(f);
        }
        std::sort(bad.begin(), bad.end());
        for (const Index f : bad) surface.triangles(random.index(3), f) = surface.vertex_count() + random.index(9);
        Collected all;
        Index good = 0;
        for (Index f = 0; f < count; ++f) {
            if (detail::check_corners(surface.triangles, f, surface.vertex_count(), collect(all))) ++good;
        }
        REQUIRE(good == count - some);
        REQUIRE(all.defects == std::vector<MeshDefect>(bad.size(), MeshDefect::index_out_of_range));
        for (std::size_t i = 0; i < bad.size(); ++i) REQUIRE(all.triangles[i] == std::vector<Index>{bad[i]});
    }
}

TEMPLATE_TEST_CASE("the largest coordinates have finite squares of areas, larger ones are refused", "[mesh][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    const S most = std::sqrt(std::sqrt((std::numeric_limits<S>::max)())) / 4;
    for (const bool is_too_large : {false, true}) {
        const S size = is_too_large ? S(1.001) * most : most;
        Points<S> x(3, 3);
        x << size, -size, -size,  //
            -size, size, -size,   //
            -size, -size, size;
        Collected all;
        S largest = 0;
        for (Index v = 0; v < 3; ++v) CHECK(detail::check_point(x, v, largest, collect(all)) != is_too_large);
        CHECK(all.defects == std::vector(is_too_large ? 3 : 0, MeshDefect::coordinate_too_large));
        Triangles corners(3, 1);
        corners.col(0) << 0, 1, 2;
        if (!is_too_large) CHECK(is_finite(squared_norm(area_vector(triangle_at(x, corners.col(0))))));
    }
}

TEST_CASE("triangles are turned together as their edges ask for", "[mesh]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> surface = test::random_surface<double>(random);
        const auto count = static_cast<std::size_t>(surface.triangle_count());
        std::vector<bool> turned(count);
        for (std::size_t f = 0; f < count; ++f) {
            turned[f] = random.chance(0.5);
            if (turned[f]) surface.turn(static_cast<Index>(f));
        }
        const auto sides = half_edges(surface.triangles);
        DisjointSets sets = detail::turns(sides, count);
        for (std::size_t f = 0; f < count; ++f) {
            REQUIRE(sets.find(f) == sets.find(turned[f] == turned[0] ? 0 : count));
            REQUIRE(sets.find(f) != sets.find(f + count));
        }
        Collected all;
        detail::check_turns(sides, count, collect(all));
        std::size_t against = 0;
        for_each_edge(sides, [&](std::span<const HalfEdge> edge) { against += detail::against(edge) ? 1U : 0U; });
        REQUIRE(all.defects == std::vector<MeshDefect>(against, MeshDefect::inconsistent_orientation));
    }
}
