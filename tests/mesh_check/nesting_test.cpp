// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/nesting.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Surface;

TEST_CASE("a closed surface goes once around what is inside", "[mesh]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto ball = icosphere({.radius = 1, .subdivisions = random.index(3)});
        std::vector<Index> all(static_cast<std::size_t>(ball.triangle_count()));
        std::iota(all.begin(), all.end(), 0);
        const Vector3<double> inside = random.number(0.0, 0.75) * random.unit_vector();  // of every such ball
        REQUIRE(winding_number(ball.positions(), ball.triangles(), all, inside) == Approx(1));
        const Vector3<double> outside = random.number(1.01, 9.0) * random.unit_vector();
        REQUIRE(winding_number(ball.positions(), ball.triangles(), all, outside) == Approx(0).margin(1e-9));
    }
}

TEST_CASE("balls are nested where their radii and centres say so", "[mesh]") {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Surface<double> balls;
        balls.x.resize(3, 0);
        balls.triangles.resize(3, 0);
        std::vector<std::pair<Vector3<double>, double>> known;
        while (known.size() < 6) {
            const Vector3<double> centre = random.vector();
            const double radius = random.number(0.05, 1.0);
            bool clear = true;  // of the surface of each other
            for (const auto& [other, size] : known) {
                const double distance = norm<double>(centre - other);
                clear = clear && (distance > radius + size ||
                                  distance < 0.75 * std::abs(radius - size) - 0.3 * std::min(radius, size));
            }
            if (!clear) {
                if (random.chance(0.001)) break;
                continue;
            }
            Surface<double> ball = test::surface_of(icosphere({.radius = radius, .subdivisions = 1}));
            ball.x.colwise() += centre.eigen();
            balls.add(ball);
            known.emplace_back(centre, radius);
        }
        std::set<std::pair<Index, Index>> expected, found;
        for (std::size_t i = 0; i < known.size(); ++i) {
            for (std::size_t j = 0; j < known.size(); ++j) {
                const bool holds = norm<double>(known[i].first - known[j].first) < known[i].second - known[j].second;
                if (holds) expected.insert({static_cast<Index>(i), static_cast<Index>(j)});
            }
        }
        const auto parts = surface_parts(balls.x, balls.triangles, half_edges(balls.triangles),
                                         std::vector<bool>(static_cast<std::size_t>(balls.triangle_count()), true));
        std::int64_t effort = 1'000'000;
        REQUIRE(for_each_nested(balls.x, balls.triangles, parts, effort, [&](Index i, Index j) {
            found.insert({i, j});
        }));
        REQUIRE(found == expected);
    }
}
