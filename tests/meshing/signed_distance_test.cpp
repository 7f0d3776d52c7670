// SPDX-License-Identifier: MIT
#include <membrane/meshing/signed_distance.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using Point = Vector3<double>;

namespace {

struct OwnBody {
    double operator()(const Point& p) const { return p.z(); }
};

/// A random body of each kind, to a check that takes any.
template <class Check>
void for_each_body(test::Random& random, Check check) {
    const Point centre = random.vector(),
                axes(random.number(0.1, 1.0), random.number(0.1, 1.0), random.number(0.1, 1.0));
    check(Ball{centre, axes.x()});
    check(Ellipsoid{centre, axes});
    check(Ellipsoid{centre, {axes.x(), axes.x(), axes.z()}});
    check(Cuboid{centre, axes});
    check(Capsule{centre, random.vector(), axes.x()});
    check(HalfSpace{centre, 3 * random.unit_vector()});
    check(offset(Cuboid{centre, axes}, 0.2));
    check(offset(Ellipsoid{centre, axes}, 0.1));
}

/// The nearest point of the ellipsoid by search over its parameters, finer and finer.
double searched_distance(const Ellipsoid& body, const Point& p) {
    const auto at = [&](double u, double v) {
        return Point(body.centre +
                     Point(std::cos(u) * std::cos(v), std::cos(u) * std::sin(v), std::sin(u)).cwiseProduct(body.radii));
    };
    double best = std::numeric_limits<double>::infinity(), best_u = 0, best_v = 0;
    double centre_u = 0, centre_v = 0, range_u = std::numbers::pi / 2, range_v = std::numbers::pi;
    for (int level = 0; level < 25; ++level) {
        for (int i = -12; i <= 12; ++i) {
            for (int j = -12; j <= 12; ++j) {
                const double u = centre_u + range_u * i / 12, v = centre_v + range_v * j / 12;
                const double distance = norm<double>(p - at(u, v));
                if (distance < best) best = distance, best_u = u, best_v = v;
            }
        }
        centre_u = best_u, centre_v = best_v;
        range_u /= 3, range_v /= 3;
    }
    return best;
}

}  // namespace

TEST_CASE("a ball, a cuboid, a capsule, a half space have the distances of closed forms", "[signed_distance]") {
    CHECK(Ball{.centre = {1, 0, 0}, .radius = 2}({4, 4, 0}) == 3);
    CHECK(Ball{.centre = {1, 0, 0}, .radius = 2}({1, 0, 0}) == -2);
    const Cuboid cuboid{.centre = {1, 1, 1}, .half_size = {1, 2, 3}};
    CHECK(cuboid({1, 1, 1}) == -1);
    CHECK(cuboid({1, 2.75, 1}) == -0.25);
    CHECK(cuboid({5, 1, 1}) == 3);
    CHECK(cuboid({5, 7, 1}) == 5);
    CHECK(cuboid({2 + 2, 3 + 3, 4 + 6}) == 7);
    const Capsule capsule{.start = {0, 0, 0}, .end = {0, 0, 2}, .radius = 1};
    CHECK(capsule({0, 3, 1}) == 2);
    CHECK(capsule({0, 3, 6}) == 4);
    CHECK(capsule({0, 3, -4}) == 4);
    CHECK(Capsule{.start = {1, 0, 0}, .end = {1, 0, 0}, .radius = 1}({1, 2, 0}) == 1);
    CHECK(HalfSpace{.point = {0, 0, 3}, .normal = {0, 0, -5}}({7, 8, 1}) == 2);
    CHECK(Ellipsoid{.radii = {3, 2, 1}}({0, 0, 0}) == -1);
    CHECK(Ellipsoid{.radii = {3, 2, 1}}({5, 0, 0}) == 2);
    CHECK(Ellipsoid{.radii = {3, 2, 1}}({0, -2.5, 0}) == 0.5);
}

TEST_CASE("combined bodies hold the points that their parts say", "[signed_distance]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Ball a{random.vector(), random.number(0.5, 1.5)};
        const Cuboid b{random.vector(), Point::Constant(random.number(0.5, 1.0))};
        for (int i = 0; i < 50; ++i) {
            const Point p = random.vector(-2.0, 2.0);
            const bool in_a = a(p) < 0, in_b = b(p) < 0;
            REQUIRE((united(a, b)(p) < 0) == (in_a || in_b));
            REQUIRE((intersection(a, b)(p) < 0) == (in_a && in_b));
            REQUIRE((difference(a, b)(p) < 0) == (in_a && !in_b));
            REQUIRE((offset(a, 0.1)(p) < 0) == (norm<double>(p - a.centre) < a.radius + 0.1));
        }
    }
}

TEST_CASE("stock distances are distances: of slope one, out along their gradients, to a point of the surface",
          "[signed_distance]") {
    for (int seed = 1; seed <= cases(500, 5000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        for_each_body(random, [&](const auto& body) {
            const Point p = random.vector(-2.0, 2.0), q = p + 0.1 * random.vector();
            REQUIRE(std::abs(body(p) - body(q)) <= norm<double>(p - q) * (1 + 1e-12));
            const Point out = gradient_at(body, p, 1e-5);
            if (body(p) > 1e-3) {  // inside, gradients jump where two points are nearest
                REQUIRE(norm(out) == Approx(1).epsilon(1e-6));
                REQUIRE(std::abs(body(p - body(p) * out)) < 1e-6);
                REQUIRE(body(p + 0.5 * out) == Approx(body(p) + 0.5).epsilon(1e-6));
            }
        });
    }
}

TEST_CASE("the given gradients are those of the distances", "[signed_distance]") {
    for (int seed = 1; seed <= cases(500, 5000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        for_each_body(random, [&](const auto& body) {
            if constexpr (GivesGradient<std::decay_t<decltype(body)>>) {
                const Point p = random.vector(-2.0, 2.0);
                if (body(p) < 1e-3) return;
                const auto only_distance = [&](const Point& x) { return body(x); };
                REQUIRE(norm<double>(gradient_at(body, p, 1e-5) - gradient_at(only_distance, p, 1e-5)) < 1e-5);
            }
        });
    }
    STATIC_REQUIRE(GivesGradient<Ball>);
    STATIC_REQUIRE(GivesGradient<Ellipsoid>);
    STATIC_REQUIRE(GivesGradient<HalfSpace>);
    STATIC_REQUIRE(!GivesGradient<OwnBody>);
    STATIC_REQUIRE(SignedDistance<OwnBody>);
    STATIC_REQUIRE(!SignedDistance<int>);
}

TEST_CASE("the distance to an ellipsoid is what a search finds, inside and outside", "[signed_distance]") {
    for (int seed = 1; seed <= cases(60, 600); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Ellipsoid body{random.vector(),
                             {random.number(0.2, 2.0), random.number(0.2, 2.0), random.number(0.2, 2.0)}};
        const Point p = body.centre + random.number(0.0, 1.5) * random.vector();
        const double found = body(p), expected = searched_distance(body, p);
        REQUIRE(std::abs(found) <= expected * (1 + 1e-9));
        // No nearer than the nearest, because there is a point of the surface so far away.
        const Point nearest = body.nearest(p);
        REQUIRE(norm<double>(p - nearest) == std::abs(found));
        REQUIRE(squared_norm<double>((nearest - body.centre).cwiseQuotient(body.radii)) == Approx(1).epsilon(1e-12));
        REQUIRE((found < 0) == (squared_norm<double>((p - body.centre).cwiseQuotient(body.radii)) < 1));
    }
}

TEST_CASE("the nearest point of an ellipsoid is on it from its axes and planes too", "[signed_distance]") {
    for (const Point& radii : {Point(3, 2, 1), Point(1, 1, 1), Point(2, 2, 1), Point(2, 1, 1), Point(1, 2, 1),
                               Point(1, 1e-3, 1), Point(1e3, 1, 1e-3)}) {
        const Ellipsoid body{.radii = radii};
        for (int code = 0; code < 125; ++code) {
            const std::array<double, 5> parts{-0.7, -1e-9, 0, 1e-300, 2};
            const auto part = [&](int digit) { return parts[static_cast<std::size_t>(digit % 5)]; };
            const Point p = Point(part(code), part(code / 5), part(code / 25)).cwiseProduct(radii);
            CAPTURE(radii.transpose(), p.transpose());
            const Point nearest = body.nearest(p);
            REQUIRE(squared_norm<double>(nearest.cwiseQuotient(radii)) == Approx(1).epsilon(1e-12));
            for (int k = 0; k < 3; ++k) {  // no vertex of the ellipsoid is nearer
                for (const double sign : {-1.0, 1.0}) {
                    const Point vertex = sign * radii[k] * Point::Unit(k);
                    REQUIRE(norm<double>(p - nearest) <= norm<double>(p - vertex) * (1 + 1e-9));
                }
            }
        }
    }
}

TEST_CASE("bounds hold the body, and no less than they must", "[signed_distance]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto check = [&](const auto& body) {
            const Bounds bounds = bounds_of(body);
            for (int i = 0; i < 20; ++i) {
                const Point p = random.vector(-3.0, 3.0);
                if (body(p) < 0) REQUIRE(((p - bounds.low).minCoeff() >= 0 && (bounds.high - p).minCoeff() >= 0));
            }
        };
        const Ball ball{random.vector(), 1};
        const Cuboid cuboid{random.vector(), {1, 0.5, 0.7}};
        for_each_body(random, [&](const auto& body) {
            check(body);
            check(united(body, ball));
            check(intersection(body, ball));
            check(difference(ball, body));
            check(offset(united(cuboid, body), -0.1));
        });
        const Bounds both = bounds_of(intersection(HalfSpace{}, ball));
        REQUIRE(both.low == ball.bounds().low);
        REQUIRE(both.high == ball.bounds().high);
        REQUIRE(!is_finite(bounds_of(OwnBody{}).low));
        REQUIRE(!is_finite(united(HalfSpace{}, ball).bounds().high));
    }
}
