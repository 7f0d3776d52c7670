// SPDX-License-Identifier: MIT
#include <membrane/contact/local_surface.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/tears.hpp"

using membrane::Index;
using membrane::LocalSurface;
using membrane::Vector3;

TEST_CASE("neighbours are the triangles with a side or a corner in common") {
    const auto mesh = membrane::disc<double>({.radius = 1, .rings = 4});
    const LocalSurface<double> surface(mesh);
    CHECK_FALSE(surface.closed());
    REQUIRE(surface.triangle_count() == mesh.triangle_count());
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        std::vector<Index> sides, corners;
        surface.across_sides(f, [&](Index g) { sides.push_back(g); });
        surface.around_corners(f, [&](Index g) { corners.push_back(g); });
        for (Index g = 0; g < mesh.triangle_count(); ++g) {
            int common = 0;
            for (const Index v : surface.corners(f)) {
                const auto others = surface.corners(g);
                common += static_cast<int>(std::count(others.begin(), others.end(), v));
            }
            CHECK((common == 2) == (std::find(sides.begin(), sides.end(), g) != sides.end()));
            CHECK((common >= 1) == (std::find(corners.begin(), corners.end(), g) != corners.end()));
        }
    }
}

TEST_CASE("the border is where a side has one triangle") {
    const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 4, .rows = 3});
    const LocalSurface<double> surface(mesh);
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index f = random.index(mesh.triangle_count());
        Vector3<double> barycentric = random.barycentric();
        const int kind = static_cast<int>(random.index(3));
        const Eigen::Index k = random.index(3);
        if (kind == 1) {
            barycentric[(k + 1) % 3] += barycentric[k];
            barycentric[k] = 0;
        } else if (kind == 2) {
            barycentric = Vector3<double>::Unit(k);
        }
        const Vector3<double> p = membrane::point_at(surface.triangle(mesh.positions(), f), barycentric);
        const bool on_outline = std::abs(std::abs(p.x()) - 0.5) < 1e-12 || std::abs(std::abs(p.y()) - 0.5) < 1e-12;
        CAPTURE(seed, f, barycentric.transpose());
        CHECK(surface.on_border(f, barycentric) == on_outline);
    }
}

TEST_CASE("downhill over a sphere leads to the nearest triangle, with the height over it") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const LocalSurface<double> surface(mesh);
    CHECK(surface.closed());
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> q = random.number(0.6, 1.5) * random.unit_vector();
        const Index f = surface.walk_to_closest(mesh.positions(), random.index(mesh.triangle_count()), q);
        double least = std::numeric_limits<double>::infinity();
        for (Index g = 0; g < mesh.triangle_count(); ++g) {
            const auto triangle = test::brute_triangle<double>(surface.triangle(mesh.positions(), g));
            least = std::min(least, test::squared_distance<double>(triangle, q));
        }
        CAPTURE(seed);
        const double height = surface.height(mesh.positions(), f, q);
        CHECK(std::abs(std::abs(height) - std::sqrt(least)) < 1e-12);
        if (q.norm() > 1) CHECK(height > 0);
        if (q.norm() < 0.97) CHECK(height < 0);
    }
}

TEST_CASE("the mean edge of a sheet is known") {
    const auto mesh = membrane::sheet<double>({.width = 3, .height = 2, .columns = 3, .rows = 2});
    // 3 x 3 sides along, 2 x 4 across, one diagonal in each of 6 cells.
    const double mean = (9 + 8 + 6 * std::sqrt(2.0)) / 23;
    CHECK(std::abs(LocalSurface<double>(mesh).mean_edge() - mean) < 1e-12);
}

TEST_CASE("nearest to a tool: a point for a sphere, along the axis for a capsule") {
    const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 1, .rows = 1});
    const LocalSurface<double> surface(mesh);
    const membrane::Tool<double> sphere{.position = {0.1, 0.2, 0.3}};
    const membrane::Tool<double> capsule{.position = {0.1, 0.2, 0.3}, .axis = {0.05, 0.05, -0.2}};
    double nearest_sphere = 1, nearest_capsule = 1;
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto a = closest_to_axis(surface.triangle(mesh.positions(), f), sphere),
                   b = closest_to_axis(surface.triangle(mesh.positions(), f), capsule);
        nearest_sphere = std::min(nearest_sphere, std::sqrt(a.on_triangle.squared_distance));
        nearest_capsule = std::min(nearest_capsule, std::sqrt(b.on_triangle.squared_distance));
    }
    CHECK(std::abs(nearest_sphere - 0.3) < 1e-12);
    CHECK(std::abs(nearest_capsule - 0.1) < 1e-12);
}

TEST_CASE("after random tears a surface equals one that is built anew", "[tear]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> torn(test::random_surface<double>(random), 4 + random.index(60));
        LocalSurface<double> surface(torn.mesh());
        const double edge = surface.mean_edge();
        while (torn.tear(random, [&](const membrane::VertexSplit& split) { surface.split(split); })) {
            const auto mesh = torn.mesh();
            const LocalSurface<double> fresh(mesh);
            REQUIRE(surface.closed() == fresh.closed());
            REQUIRE(surface.mean_edge() == edge);
            for (Index f = 0; f < mesh.triangle_count(); ++f) {
                REQUIRE(surface.corners(f) == fresh.corners(f));
                std::vector<Index> found, expected;
                surface.across_sides(f, [&](Index g) { found.push_back(g); });
                fresh.across_sides(f, [&](Index g) { expected.push_back(g); });
                surface.around_corners(f, [&](Index g) { found.push_back(g); });
                fresh.around_corners(f, [&](Index g) { expected.push_back(g); });
                REQUIRE(found == expected);
                Vector3<double> weights = random.barycentric();
                if (random.chance(0.6)) weights[random.index(3)] = 0;
                if (random.chance(0.3)) weights = Vector3<double>::Unit(random.index(3));
                REQUIRE(surface.on_border(f, weights) == fresh.on_border(f, weights));
                REQUIRE(surface.has_border_vertex(f) == fresh.has_border_vertex(f));
                REQUIRE(surface.outward(mesh.positions(), f, weights) == fresh.outward(mesh.positions(), f, weights));
            }
        }
    }
}
