// SPDX-License-Identifier: MIT
#include <membrane/meshing/isosurface.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include <membrane/surface/adjacency.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using Point = Vector3<double>;

namespace {

template <class Body>
TriangleMesh<double> raw(const Body& body, const Bounds& bounds, double spacing) {
    return isosurface(LevelSurface(body, bounds), bounds, spacing);
}

double volume(const TriangleMesh<double>& mesh) {
    double sum = 0;
    for (const auto& corner : mesh.triangles().colwise()) {
        const auto& x = mesh.positions();
        sum += dot(point(x, corner[0]), cross(point(x, corner[1]), point(x, corner[2]))) / 6;
    }
    return sum;
}

int euler(const TriangleMesh<double>& mesh) {
    const Adjacency adjacency(mesh);
    return mesh.vertex_count() - static_cast<int>(adjacency.edges().size()) + mesh.triangle_count();
}

}  // namespace

TEST_CASE("random balls become closed surfaces of genus 0, outward, with their vertices on them", "[isosurface]") {
    for (int seed = 1; seed <= cases(15, 1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-4.0, 3.0));
        const Ball ball{size * random.vector(), size * random.number(0.5, 1.0)};
        const double spacing = ball.radius * random.number(0.1, 0.4);
        const auto mesh = raw(ball, ball.bounds(), spacing);
        REQUIRE(Adjacency(mesh).closed());
        REQUIRE(euler(mesh) == 2);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(std::abs(ball(point(mesh.positions(), v))) < 1e-9 * size);
        }
        const TriangleMesh<double> moved(mesh.positions().colwise() - ball.centre.eigen(), mesh.triangles());
        const double whole = 4 * std::numbers::pi / 3 * std::pow(ball.radius, 3);
        REQUIRE(volume(moved) < whole);
        REQUIRE(volume(moved) > whole * (1 - 0.8 * std::pow(spacing / ball.radius, 2)));
    }
}

TEST_CASE("a random cap's border lies on both surfaces, and all else within", "[isosurface]") {
    for (int seed = 1; seed <= cases(15, 1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Ball ball{random.vector(), 1};
        const Point normal = random.unit_vector();
        const HalfSpace half{ball.centre + random.number(-0.7, 0.7) * normal, normal};
        const auto mesh = raw(trimmed(ball, half), ball.bounds(), random.number(0.1, 0.3));
        const Adjacency adjacency(mesh);
        REQUIRE(euler(mesh) == 1);
        std::size_t on_border = 0;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Point p = point(mesh.positions(), v);
            REQUIRE(std::abs(ball(p)) < 1e-9);
            REQUIRE(half(p) < 1e-9);
            if (half(p) > -1e-9) ++on_border;
        }
        REQUIRE(on_border == adjacency.border_vertices().size());
        for (const Index v : adjacency.border_vertices()) REQUIRE(std::abs(half(point(mesh.positions(), v))) < 1e-9);
    }
}

TEST_CASE("parts and holes come out as many as there are", "[isosurface]") {
    const Bounds bounds{{-2, -2, -2}, {2, 2, 2}};
    const auto torus = [](const Point& p) { return std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()) - 0.4; };
    CHECK(euler(raw(torus, bounds, 0.15)) == 0);
    const Ball left{{-1, 0, 0}, 0.7}, right{{1, 0, 0}, 0.7};
    CHECK(euler(raw(united(left, right), bounds, 0.15)) == 4);
    CHECK(euler(raw(united(Ball{{-0.6, 0, 0}, 0.7}, Ball{{0.6, 0, 0}, 0.7}), bounds, 0.15)) == 2);
    CHECK(euler(raw(difference(Ball{}, Ball{.radius = 0.5}), bounds, 0.15)) == 4);
    CHECK(volume(raw(difference(Ball{}, Ball{.radius = 0.5}), bounds, 0.1)) ==
          Approx(4 * std::numbers::pi / 3 * 0.875).epsilon(0.02));
    const Capsule pipe{.start = {0, 0, -3}, .end = {0, 0, 3}, .radius = 0.5};
    CHECK(euler(raw(trimmed(pipe, Cuboid{.half_size = {1, 1, 1}}), bounds, 0.15)) == 0);
    const auto disc = raw(trimmed(HalfSpace{}, Ball{}), bounds, 0.15);
    CHECK(euler(disc) == 1);
    for (Index v = 0; v < disc.vertex_count(); ++v) REQUIRE(std::abs(disc.positions()(2, v)) < 1e-9);
}

TEST_CASE("a surface through the points of the grid comes out whole", "[isosurface]") {
    for (const double half : {0.5, 1.0, 1.5}) {  // the distance is zero at many points, whatever the grid's place
        const auto octahedron = [&](const Point& p) {
            const double d = p.cwiseAbs().sum() - half;
            return std::abs(d) < 0.1 ? 0 : d;
        };
        const Bounds bounds{{-2, -2, -2}, {2, 2, 2}};
        const auto mesh = isosurface(LevelSurface(octahedron, bounds), bounds, 0.125);
        CHECK(euler(mesh) == 2);
        CHECK(Adjacency(mesh).closed());
    }
}

TEST_CASE("surfaces that a grid cannot find are refused", "[isosurface][bad]") {
    using test::refusal;
    const Bounds bounds{{-2, -2, -2}, {2, 2, 2}};
    CHECK(
        refusal([&] {
            (void)raw(Ball{.centre = {9, 9, 9}}, bounds, 0.5);
        }) ==
        "isosurface: the distance must change its sign within the bounds, got none of cells of 0.5 [m] where it does");
    CHECK(
        refusal([&] { (void)raw(Ball{.radius = 0.01}, bounds, 0.5); }) ==
        "isosurface: the distance must change its sign within the bounds, got none of cells of 0.5 [m] where it does");
    CHECK_THAT(refusal([&] {
                   (void)raw(trimmed(Ball{}, Ball{.centre = {9, 9, 9}}), bounds, 0.5);
               }),
               ContainsSubstring("isosurface: the distance must change its sign"));
    CHECK_THAT(refusal([&] { (void)raw(Ball{.radius = 3}, bounds, 0.5); }),
               ContainsSubstring("isosurface: the surface must be within the bounds, got a point out of them near ("));
    CHECK_THAT(refusal([&] { (void)raw(HalfSpace{}, bounds, 0.5); }),
               ContainsSubstring("isosurface: the surface must be within the bounds"));
    CHECK_THAT(refusal([&] { (void)raw(trimmed(HalfSpace{}, Ball{.radius = 9}), bounds, 0.5); }),
               ContainsSubstring("isosurface: the surface must be within the bounds"));
    CHECK(refusal([&] { (void)raw(Ball{}, bounds, 1e-3); }) ==
          "isosurface: a grid of cells of 0.001 [m] over the bounds has more than 1.3e8 points, or 2e6 in a plane; use "
          "longer edges, a wider spacing or narrower bounds");
    const Cuboid plate{.half_size = {1, 5e-3, 1}};  // 2400 x 12 x 2400 cells, 5e7 vertices
    CHECK_THAT(refusal([&] { (void)raw(plate, plate.bounds(), 1e-2 / 12); }),
               ContainsSubstring("isosurface: a grid of cells of 0.000833333333 [m] over the bounds has more than"));
    const auto inside_out = [](const Point& p) { return 1 - norm(p); };
    CHECK(refusal([&] { (void)raw(inside_out, bounds, 0.5); }) ==
          "isosurface: the distance must be positive out of the bounds, got one that is negative: it must be negative "
          "inside the body, positive outside");
    for (const double wrong : {std::nan(""), std::numeric_limits<double>::infinity()}) {
        const auto body = [&](const Point& p) { return p.x() > 1 ? wrong : norm(p) - 1; };
        CHECK_THAT(refusal([&] { (void)raw(body, bounds, 0.5); }),
                   ContainsSubstring("must be finite [m], got " + std::string(std::isnan(wrong) ? "nan" : "inf")));
    }
    const auto flat = [](const Point& p) { return p.z(); };
    const auto nearly_the_same = [](const Point& p) { return p.z() + 1e-9 * p.x(); };
    CHECK_THAT(refusal([&] { (void)raw(trimmed(flat, intersection(nearly_the_same, Ball{})), bounds, 0.3); }),
               ContainsSubstring("isosurface: the border near ("));
}
