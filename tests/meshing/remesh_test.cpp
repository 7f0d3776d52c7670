// SPDX-License-Identifier: MIT
#include <membrane/meshing/remesh.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <membrane/mesh_check/quality.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using Point = Vector3<double>;

namespace {

const Bounds around{{-1.5, -1.5, -1.5}, {1.5, 1.5, 1.5}};

TriangleMesh<double> jittered_sphere(Index subdivisions, double amplitude, test::Random& random) {
    const auto mesh = icosphere({.radius = 1, .subdivisions = subdivisions});
    auto x = test::jittered(mesh.positions(), amplitude, random);
    for (Index v = 0; v < mesh.vertex_count(); ++v) x.col(v) /= norm(point(x, v));
    return {x, mesh.triangles()};
}

void require_even(const TriangleMesh<double>& mesh, double wanted) {
    const auto quality = quality_of(mesh);
    REQUIRE(quality.smallest_angle > 30);
    REQUIRE(quality.mean_smallest_angle > 50);
    REQUIRE(quality.even_edges > 0.95);
    REQUIRE(std::abs(quality.mean_edge / wanted - 1) < 0.2);
}

/// A surface that faces up everywhere, whose points lie where they are.
struct FacingUp {
    static constexpr bool has_border = false;
    std::optional<OnSurface> project(const Point& p) const { return OnSurface{p, {0, 0, 1}}; }
    std::optional<OnSurface> project_to_border(const Point& p) const { return project(p); }
};

/// Cosine of the angle between a triangle and the horizontal.
double facing_up(const Triangle<double>& triangle) { return area_vector(triangle).z() / norm(area_vector(triangle)); }

/// The largest sum of two angles across an edge [degrees].
double largest_sum_of_angles(const TriangleMesh<double>& mesh) {
    double largest = 0;
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        double sum = 0;
        for (const HalfEdge& side : sides) {
            const Point apex = point(mesh.positions(), side.apex);
            const Point p = point(mesh.positions(), side.first) - apex, q = point(mesh.positions(), side.second) - apex;
            sum += std::atan2(norm(cross(p, q)), dot(p, q)) * 180 / std::acos(-1.0);
        }
        if (sides.size() == 2) largest = std::max(largest, sum);
    });
    return largest;
}

}  // namespace

TEST_CASE("spheres too coarse, too fine and uneven become even ones of the length wanted", "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    for (int seed = 1; seed <= cases(6, 100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index subdivisions = 1 + random.index(3);
        const double wanted = random.number(0.2, 0.5), edge = 1.1 / static_cast<double>(1 << subdivisions);
        CAPTURE(subdivisions, wanted);
        const auto start = jittered_sphere(subdivisions, 0.25 * edge, random);
        const auto mesh = remesh(start, surface, wanted, 200);
        require_even(mesh, wanted);
        REQUIRE(Adjacency(mesh).closed());
        REQUIRE(largest_sum_of_angles(mesh) < 180.01);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(std::abs(norm(point(mesh.positions(), v)) - 1) < 1e-9);
        }
        double volume = 0;  // turned over nowhere
        for (const auto& corner : mesh.triangles().colwise()) {
            const auto triangle = triangle_at(mesh.positions(), corner);
            const double cone = dot(triangle.a, cross(triangle.b, triangle.c)) / 6;
            REQUIRE(cone > 0);
            volume += cone;
        }
        REQUIRE(volume < 4.19);
        REQUIRE(volume > 4.19 * (1 - wanted * wanted / 2));
    }
}

TEST_CASE("a vertex too near to others moves away from them, the first one too", "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    const auto even = icosphere({.radius = 1, .subdivisions = 1});
    test::Random random(1);
    for (Index v = 0; v < even.vertex_count(); ++v) {
        CAPTURE(v);
        Points<double> x = even.positions();
        x.col(v) = (x.col(v) + 0.1 * point(x, v).cross(random.unit_vector()).normalized().eigen()).normalized();
        const auto mesh = remesh(TriangleMesh<double>(x, even.triangles()), surface, 0.6, 1);
        REQUIRE(mesh.vertex_count() == even.vertex_count());
        CHECK((mesh.positions() - even.positions()).col(v).norm() < 0.9 * (x - even.positions()).col(v).norm());
    }
}

TEST_CASE("an edge is flipped if the worse of its triangles then faces the surface better, though not well",
          "[remesh]") {
    // Seen from above a quadrilateral, its diagonal from corner 0 to 1; corner 2 is near to that, and high above it.
    for (const double height : {0.3, 0.35, 0.4}) {
        CAPTURE(height);
        const Points<double> x{{0, 1, 0.5, 0.5}, {0, 0, 0.05, -0.1}, {0, 0, height, 0}};
        const TriangleMesh<double> mesh(x, Triangles{{0, 1}, {1, 0}, {2, 3}});
        const auto flipped = remesh(mesh, FacingUp{}, 1, 0);
        const auto facing = [&](const TriangleMesh<double>& of, Index f) {
            return facing_up(triangle_at(x, of.triangles().col(f)));
        };
        REQUIRE(flipped.positions() == x);
        REQUIRE(facing(mesh, 0) < 0.2);
        REQUIRE(facing(mesh, 1) == 1);
        for (Index f = 0; f < 2; ++f) {
            CHECK(facing(flipped, f) > 0.25);
            CHECK(facing(flipped, f) < 0.5);
        }
    }
}

TEST_CASE("a border stays on both surfaces and is as even as the rest", "[remesh]") {
    const HalfSpace half{.point = {0, 0, 0.4}, .normal = {0, 0, -1}};
    const LevelSurface surface(trimmed(Ball{}, half), around);
    const auto start = spherical_cap({.radius = 1, .diameter = 2 * std::sqrt(0.84), .rings = 3});
    const auto mesh = remesh(start, surface, 0.15, 200);
    require_even(mesh, 0.15);
    const Adjacency adjacency(mesh);
    for (const Index v : adjacency.border_vertices()) {
        REQUIRE(std::abs(norm(point(mesh.positions(), v)) - 1) < 1e-9);
        REQUIRE(std::abs(mesh.positions()(2, v) - 0.4) < 1e-9);
    }
    const double rim = 2 * std::acos(-1.0) * std::sqrt(0.84);
    CHECK(static_cast<double>(adjacency.border_vertices().size()) == Approx(rim / 0.15).epsilon(0.2));
}

TEST_CASE("edges follow a length that depends on the place", "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    const auto wanted = [](const Point& p) { return 0.1 + 0.1 * (1 + p.z()); };
    for (const Index subdivisions : {3, 4}) {  // of 4, more than half of the vertices go
        CAPTURE(subdivisions);
        const auto start = icosphere({.radius = 1, .subdivisions = subdivisions});
        const auto mesh = remesh(start, surface, EdgeLength(wanted), 200);
        const Adjacency adjacency(mesh);
        double sum = 0;
        for (const auto& [first, second] : adjacency.edges()) {
            const Point p = point(mesh.positions(), first), q = point(mesh.positions(), second);
            const double ratio = norm<double>(p - q) / wanted((p + q) / 2);
            REQUIRE(ratio > 0.5);
            REQUIRE(ratio < 1.7);
            sum += ratio;
        }
        CHECK(sum / static_cast<double>(adjacency.edges().size()) == Approx(1).epsilon(0.2));
        CHECK(quality_of(mesh).smallest_angle > 30);
    }
}

TEST_CASE("edges become short where they are to be within three iterations, though most other vertices are removed",
          "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    const auto start = icosphere({.radius = 1, .subdivisions = 4});
    for (const double slope : {0.3, 0.5}) {
        CAPTURE(slope);
        const auto wanted = [&](const Point& p) { return 0.01 + slope * (1 - p.z()); };
        const auto mesh = remesh(start, surface, EdgeLength(wanted), 3);
        const Adjacency adjacency(mesh);
        for (const auto& [first, second] : adjacency.edges()) {
            const Point p = point(mesh.positions(), first), q = point(mesh.positions(), second);
            const double ratio = norm<double>(p - q) / wanted((p + q) / 2);
            REQUIRE(ratio > 0.5);
            REQUIRE(ratio < 2);
        }
    }
}

TEST_CASE("the result for a scaled mesh and length is the scaled result", "[remesh]") {
    for (int seed = 1; seed <= cases(5, 100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto flat = sheet({.width = 1, .height = 1, .columns = 8, .rows = 8});
        Points<double> x = test::jittered(flat.positions(), 0.04, random);
        x.row(2).setZero();
        const auto mesh = remesh(TriangleMesh<double>(x, flat.triangles()), FacingUp{}, 0.1, 6);
        REQUIRE(mesh.triangles().cols() > flat.triangles().cols());
        for (const double scale : {0x1p-20, 0x1p20}) {  // products with powers of two are exact
            CAPTURE(scale);
            const auto scaled = remesh(TriangleMesh<double>(scale * x, flat.triangles()), FacingUp{}, 0.1 * scale, 6);
            REQUIRE(scaled.triangles() == mesh.triangles());
            REQUIRE(scaled.positions() == scale * mesh.positions());
        }
    }
}

TEST_CASE("progress is reported after each iteration, of as many vertices as there are", "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    std::vector<RemeshProgress> reported;
    const auto mesh = remesh(icosphere({.radius = 1, .subdivisions = 2}), surface, 0.3, 40,
                             [&](const RemeshProgress& now) { reported.push_back(now); });
    REQUIRE(reported.size() > 2 * 40 / 3);
    CHECK((reported.size() == 40 || reported.back().movement < 1e-3));
    for (std::size_t i = 0; i < reported.size(); ++i) {
        CHECK(reported[i].iteration == static_cast<Index>(i) + 1);
        CHECK(reported[i].iterations == 40);
        CHECK(reported[i].movement >= 0);
        CHECK(reported[i].movement <= 0.26);
    }
    CHECK(reported.back().vertices == mesh.vertex_count());
}

TEST_CASE("it ends early at rest, and leaves a valid mesh as it is in no iterations", "[remesh]") {
    const LevelSurface surface(Ball{}, around);
    const auto regular = icosphere({.radius = 1, .subdivisions = 0});
    Index last = 0;
    const auto same = remesh(regular, surface, quality_of(regular).mean_edge, 300,
                             [&](const RemeshProgress& now) { last = now.iteration; });
    CHECK(last == 201);  // the first that could be the last
    CHECK(same.triangles() == regular.triangles());
    CHECK((same.positions() - regular.positions()).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(remesh(regular, surface, 0.1, 0).triangles() == regular.triangles());
}

TEST_CASE("lengths that are none are refused", "[remesh][bad]") {
    const LevelSurface surface(Ball{}, around);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const std::vector<std::pair<double, std::string>> wrong{
        {0, "0"}, {-1, "-1"}, {std::numeric_limits<double>::infinity(), "inf"}, {std::nan(""), "nan"}};
    for (const auto& pair : wrong) {
        const double length = pair.first;
        CHECK(test::refusal([&] {
                  (void)EdgeLength(length)({1, 2, 3});
              }) == "EdgeLength: the length at (1, 2, 3) must be finite and positive [m], got " + pair.second);
        CHECK_THAT(test::refusal([&] { (void)remesh(mesh, surface, length, 10); }),
                   ContainsSubstring("EdgeLength: the length at ("));
    }
    CHECK(test::refusal([&] {
              (void)EdgeLength()({0, 0, 0});
          }) == "EdgeLength: the length at (0, 0, 0) must be finite and positive [m], got 0");
}
