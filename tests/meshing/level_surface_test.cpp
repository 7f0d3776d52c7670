// SPDX-License-Identifier: MIT
#include <membrane/meshing/level_surface.hpp>

#include <cmath>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using Point = Vector3<double>;

TEST_CASE("a point is projected onto a ball along its radius", "[level_surface]") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-6.0, 6.0));
        const Ball ball{size * random.vector(), size * random.number(0.1, 1.0)};
        const LevelSurface surface(ball, ball.bounds());
        const Point out = random.unit_vector();
        const auto found = surface.project(ball.centre + ball.radius * random.number(0.1, 3.0) * out);
        REQUIRE(found);
        REQUIRE(norm<double>(found->point - (ball.centre + ball.radius * out)) < 1e-9 * size);
        REQUIRE(norm<double>(found->normal - out) < 1e-9);
    }
}

TEST_CASE("a level set that is no distance is projected onto all the same, by differences", "[level_surface]") {
    const Ellipsoid body{.radii = {2, 1, 0.5}};
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double steepness = std::pow(10, random.number(-5.0, 5.0));
        const auto level = [&](const Point& p) {
            return steepness * (squared_norm<double>(p.cwiseQuotient(body.radii)) - 1);
        };
        const LevelSurface surface(level, body.bounds());
        const Point on = body.nearest(3 * random.unit_vector()), out = body.gradient(on);
        const auto found = surface.project(on + random.number(-0.1, 0.1) * out);
        REQUIRE(found);
        REQUIRE(std::abs(body(found->point)) < 1e-9);
        REQUIRE(norm<double>(found->point - on) < 0.1);
        REQUIRE(norm<double>(found->normal - body.gradient(found->point)) < 1e-6);
    }
}

TEST_CASE("a border is where two balls meet: in the plane of their circle, at its radius", "[level_surface]") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Point axis = random.unit_vector(), across = cross(axis, random.unit_vector()).normalized();
        const double half = random.number(0.3, 0.7), radius = std::sqrt(1 - half * half);
        const Ball left{-half * axis, 1}, right{half * axis, 1};
        const double steepness = std::pow(10, random.number(-5.0, 5.0));
        const auto flat_right = [&](const Point& p) { return steepness * right(p); };
        const LevelSurface surface(trimmed(left, flat_right), left.bounds());
        STATIC_REQUIRE(surface.has_border);
        const auto found = surface.project_to_border(radius * across + 0.2 * random.vector());
        REQUIRE(found);
        REQUIRE(std::abs(dot(found->point, axis)) < 1e-9);
        REQUIRE(std::abs(norm(found->point) - radius) < 1e-9);
        REQUIRE(norm<double>(found->normal - left.gradient(found->point)) < 1e-9);
        const auto steep_left = [&](const Point& p) { return steepness * left(p); };
        const auto steep = LevelSurface(trimmed(steep_left, right), left.bounds()).project_to_border(found->point);
        REQUIRE(steep);
        REQUIRE(norm<double>(steep->normal - found->normal) < 1e-6);
        REQUIRE(surface.distance(left.centre) == -1);
        REQUIRE(surface.beyond_border(right.centre + 3 * axis) == Approx(2 * steepness));
    }
}

TEST_CASE("where no path to the surface exists, none is found", "[level_surface]") {
    const Bounds bounds{{-1, -1, -1}, {1, 1, 1}};
    const auto flat = [](const Point&) { return 1.0; };
    CHECK(!LevelSurface(flat, bounds).project({0, 0, 0}));
    const auto wild = [](const Point& p) { return std::log(p.x()); };
    CHECK(!LevelSurface(wild, bounds).project({-1, 0, 0}));
    const auto above = [](const Point& p) { return 1 + p.z() * p.z(); };
    CHECK(!LevelSurface(above, bounds).project({0, 0, 0.5}));
    const Ball ball{}, touching{.centre = {0, 0, 2}};
    CHECK(!LevelSurface(trimmed(ball, touching), bounds).project_to_border({0, 0, 0.9}));
    CHECK(!LevelSurface(trimmed(ball, Ball{.centre = {0, 0, 5}}), bounds).project_to_border({0.1, 0, 1}));
}

TEST_CASE("a trimmed surface has the bounds of both bodies", "[level_surface]") {
    const Bounds bounds = trimmed(Ball{}, Cuboid{.centre = {0, 0, 1}, .half_size = {2, 2, 0.5}}).bounds();
    CHECK(bounds.low == Point(-1, -1, 0.5));
    CHECK(bounds.high == Point(1, 1, 1));
    STATIC_REQUIRE(!LevelSurface<Ball>::has_border);
    CHECK(LevelSurface(Ball{}, bounds).beyond_border({9, 9, 9}) < 0);
}
