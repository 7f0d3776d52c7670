// SPDX-License-Identifier: MIT
#include <membrane/surface/triangle.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/cgal.hpp"
#include "support/exact_crossing.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

using Long = long double;

template <class S>
constexpr S epsilon = std::numeric_limits<S>::epsilon();

template <class S>
test::Vector<Long> exact(const Vector3<S>& p) {
    return p.eigen().template cast<Long>();
}

/// How far from the origin corners and points lie, at most.
template <class S>
S extent(const Triangle<S>& t, std::initializer_list<Vector3<S>> points = {}) {
    S most = std::max({norm(t.a), norm(t.b), norm(t.c)});
    for (const auto& p : points) most = std::max(most, norm(p));
    return most;
}

enum class Shape { any, needle, cap, collinear, two_equal, all_equal };
constexpr std::array shapes{Shape::any,       Shape::needle,    Shape::cap,
                            Shape::collinear, Shape::two_equal, Shape::all_equal};

/// A triangle about 1 large, with its corners in any order.
template <class S>
Triangle<S> random_triangle(Shape shape, Random& random) {
    std::array<Vector3<S>, 3> p{random.vector<S>(), random.vector<S>(), random.vector<S>()};
    const auto height = static_cast<S>(std::pow(10, random.number(-30.0, -1.0)));
    switch (shape) {
        case Shape::any: break;
        case Shape::needle: p[2] = p[0] + height * random.vector<S>(); break;
        case Shape::cap: p[2] = p[0] + random.number<S>() * (p[1] - p[0]) + height * random.vector<S>(); break;
        case Shape::collinear: p[2] = p[0] + S(random.index(9) - 4) / 4 * (p[1] - p[0]); break;
        case Shape::two_equal: p[2] = p[0]; break;
        case Shape::all_equal: p[1] = p[2] = p[0]; break;
    }
    std::shuffle(p.begin(), p.end(), random.engine());
    return {p[0], p[1], p[2]};
}

/// A point anywhere, in the plane, on an edge, on a corner, or off by a rounding.
template <class S>
Vector3<S> random_point_near(const Triangle<S>& t, Random& random) {
    const auto on_edge = [&] { return Vector3<S>(t.b + random.number<S>() * (t.c - t.b)); };
    switch (random.index(6)) {
        case 0: return t.a + random.vector<S>(-3, 3);
        case 1: return point_at(t, random.vector<S>(-1, 2));
        case 2: return point_at(t, random.barycentric<S>());
        case 3: return on_edge();
        case 4: return on_edge() + epsilon<S> * random.vector<S>(-2, 2);
        default: return std::array{t.a, t.b, t.c}[static_cast<std::size_t>(random.index(3))];
    }
}

template <class S>
void check_weights(const TrianglePoint<S>& found, const Triangle<S>& t) {
    CHECK((found.barycentric.eigen().array() >= 0).all());
    CHECK(std::abs(found.barycentric.sum() - 1) <= 4 * epsilon<S>);
    const S scale = extent(t);
    CHECK(norm<S>(found.point - point_at(t, found.barycentric)) <= 8 * epsilon<S> * scale);
    for (int k = 0; k < 3; ++k) {
        if (found.barycentric[k] == 1 && (found.barycentric.eigen().array() == 0).count() == 2)
            CHECK(found.point == std::array{t.a, t.b, t.c}[static_cast<std::size_t>(k)]);
    }
}

}  // namespace

template <class S>
constexpr bool all_noexcept = [](const Triangle<S>* t, const Vector3<S>* p) {
    return noexcept(closest_point(*t, *p))&& noexcept(closest_to_segment(*t, *p, *p))&& noexcept(closest_to_segment(
        *t, 0, *p,
        *p))&& noexcept(first_hit(*t, *p,
                                  *p))&& noexcept(touches_box(*t, *p,
                                                              *p))&& noexcept(area_vector(*t))&& noexcept(point_at(*t,
                                                                                                                   *p));
}(nullptr, nullptr);
static_assert(all_noexcept<float> && all_noexcept<double>);

TEMPLATE_TEST_CASE("a triangle is read from positions and faces where its corners say", "[triangle]", float, double) {
    using S = TestType;
    Points<S> x(3, 4);
    x << 9, 1, 3, 1,  //
        9, 2, 2, 5,   //
        9, 4, 4, 4;
    Triangles triangles(3, 1);
    triangles << 1, 2, 3;
    const auto from_column = triangle_at(x, triangles.col(0));
    const auto from_array = triangle_at(ConstPointsRef<S>(x), std::array<Index, 3>{1, 2, 3});
    CHECK(from_column.a == Vector3<S>(1, 2, 4));
    CHECK(from_column.b == Vector3<S>(3, 2, 4));
    CHECK(from_column.c == Vector3<S>(1, 5, 4));
    CHECK(from_array.c == from_column.c);
    CHECK(area_vector(from_column) == Vector3<S>(0, 0, 3));
    CHECK(point_at(from_column, Vector3<S>(0, 1, 0)) == from_column.b);
    CHECK(point_at(from_column, Vector3<S>(S(0.5), S(0.25), S(0.25))) == Vector3<S>(S(1.5), S(2.75), 4));
}

TEMPLATE_TEST_CASE("the nearest point is on the corner, edge or face that it should be on", "[triangle]", float,
                   double) {
    using S = TestType;
    struct Case {
        Vector3<double> q, barycentric;
    };
    // a = (0, 0), b = (4, 0), c = (0, 4); each region from inside its borders and on them, above and in the plane.
    const std::vector<Case> expected{
        {{1, 1, 0}, {0.5, 0.25, 0.25}}, {{2, 1, 0}, {0.25, 0.5, 0.25}}, {{0, 0, 0}, {1, 0, 0}},
        {{-1, -1, 0}, {1, 0, 0}},       {{-3, 0, 0}, {1, 0, 0}},        {{0, -3, 0}, {1, 0, 0}},
        {{1, -1, 0}, {0.75, 0.25, 0}},  {{1, 0, 0}, {0.75, 0.25, 0}},   {{3, -9, 0}, {0.25, 0.75, 0}},
        {{4, -1, 0}, {0, 1, 0}},        {{5, -1, 0}, {0, 1, 0}},        {{5, 1, 0}, {0, 1, 0}},
        {{4, 0, 0}, {0, 1, 0}},         {{6, 0, 0}, {0, 1, 0}},         {{4, 2, 0}, {0, 0.75, 0.25}},
        {{2, 2, 0}, {0, 0.5, 0.5}},     {{9, 9, 0}, {0, 0.5, 0.5}},     {{3, 5, 0}, {0, 0.25, 0.75}},
        {{2, 6, 0}, {0, 0, 1}},         {{1, 5, 0}, {0, 0, 1}},         {{0, 4, 0}, {0, 0, 1}},
        {{0, 7, 0}, {0, 0, 1}},         {{-1, 5, 0}, {0, 0, 1}},        {{-2, 4, 0}, {0, 0, 1}},
        {{-2, 3, 0}, {0.25, 0, 0.75}},  {{0, 3, 0}, {0.25, 0, 0.75}},   {{-7, 1, 0}, {0.75, 0, 0.25}},
    };
    const Triangle<S> t{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
    for (const auto& [q, barycentric] : expected) {
        for (const double height : {0.0, 2.0, -0.5}) {
            CAPTURE(q.transpose(), height);
            const Vector3<S> at = (q + Vector3<double>(0, 0, height)).template cast<S>();
            const auto found = closest_point(t, at);
            CHECK(found.barycentric == barycentric.template cast<S>());
            CHECK(found.point == Vector3<S>(4 * found.barycentric[1], 4 * found.barycentric[2], 0));
            CHECK(found.squared_distance == squared_norm<S>(at - found.point));
        }
    }
}

TEMPLATE_TEST_CASE("no point of a triangle of any shape is nearer than the nearest", "[triangle]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto t = random_triangle<S>(shapes[static_cast<std::size_t>(seed) % shapes.size()], random);
        const auto q = random_point_near(t, random);
        const auto found = closest_point(t, q);
        check_weights(found, t);

        const S scale = extent<S>(t, {q});
        const auto distance = std::sqrt(static_cast<Long>(found.squared_distance));
        CHECK(std::abs(distance - (exact(q) - exact(found.point)).norm()) <= 16 * epsilon<S> * scale);
        const Long least = std::sqrt(test::squared_distance_by_search(test::brute_triangle<Long>(t), exact(q)));
        CHECK(distance >= least - 16 * epsilon<S> * scale);
        // A height is lost at most, and only where it is below sqrt(epsilon).
        CHECK(distance <= least + 2 * std::sqrt(epsilon<S>) * scale);
        if (seed % static_cast<int>(shapes.size()) == 0) CHECK(distance <= least + 64 * epsilon<S> * scale);
    }
}

/// A triangle of any shape and size, in one case of ten with a coordinate that is no number or too large a one.
template <class S>
Triangle<S> wild_triangle(Random& random) {
    using Limits = std::numeric_limits<S>;
    auto t = random_triangle<S>(shapes[static_cast<std::size_t>(random.index(6))], random);
    if (random.chance(0.3)) {
        const auto scale = static_cast<S>(std::pow(10, random.number(-35.0, 35.0)));
        for (auto* p : {&t.a, &t.b, &t.c}) *p *= scale;
    }
    if (random.chance(0.1)) {
        const std::array bad{Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max(), S(-0.0)};
        auto& p = *std::array{&t.a, &t.b, &t.c}[static_cast<std::size_t>(random.index(3))];
        p[random.index(3)] = bad[static_cast<std::size_t>(random.index(5))];
    }
    return t;
}

TEMPLATE_TEST_CASE("of several triangles at once the nearest points are, bit for bit, those of each", "[triangle][bad]",
                   float, double) {
    using S = TestType;
    constexpr std::size_t count = Lanes<S>::count;
    const auto same = [](S a, S b) { return std::isnan(a) ? std::isnan(b) : std::memcmp(&a, &b, sizeof a) == 0; };
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<Triangle<S>, count> triangles;
        for (auto& t : triangles) t = wild_triangle<S>(random);
        if (random.chance(0.1)) triangles.fill(triangles[0]);
        const Vector3<S> q = random_point_near(triangles[0], random);
        const auto lanes_of = [&](Vector3<S> Triangle<S>::*corner) {
            const auto along = [&](Eigen::Index k) {
                return Lanes<S>::of([&](std::size_t i) { return (triangles[i].*corner)[k]; });
            };
            return Vector3<Lanes<S>>(along(0), along(1), along(2));
        };
        const Triangle<Lanes<S>> all{lanes_of(&Triangle<S>::a), lanes_of(&Triangle<S>::b), lanes_of(&Triangle<S>::c)};
        const auto found = closest_point(all, Vector3<Lanes<S>>(q.x(), q.y(), q.z()));
        const auto squares = squared_distance(all, Vector3<Lanes<S>>(q.x(), q.y(), q.z()));
        for (std::size_t i = 0; i < count; ++i) {
            CAPTURE(i);
            const auto expected = closest_point(triangles[i], q);
            for (Eigen::Index k = 0; k < 3; ++k) {
                REQUIRE(same(found.barycentric[k][i], expected.barycentric[k]));
                REQUIRE(same(found.point[k][i], expected.point[k]));
            }
            REQUIRE(same(found.squared_distance[i], expected.squared_distance));
            REQUIRE(same(squares[i], expected.squared_distance));
            REQUIRE(same(squared_distance(triangles[i], q), expected.squared_distance));
        }
    }
}

TEMPLATE_TEST_CASE("only thin triangles lose accuracy, and no more than their height", "[triangle]", float, double) {
    using S = TestType;
    Random random(3);
    for (const double height : {1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-12, 1e-20, 0.0}) {
        CAPTURE(height);
        const Triangle<S> t{{0, 0, 0}, {1, 0, 0}, {S(0.3), static_cast<S>(height), 0}};
        for (int i = 0; i < cases(500); ++i) {
            Vector3<S> q = random.vector<S>(-1, 2);
            if (i % 2 == 0) q = point_at(t, random.barycentric<S>()) + Vector3<S>(0, 0, S(1e-3) * random.number<S>());
            CAPTURE(q.transpose());
            const Long least = std::sqrt(test::squared_distance_by_search(test::brute_triangle<Long>(t), exact(q)));
            const Long lost = std::sqrt(static_cast<Long>(closest_point(t, q).squared_distance)) - least;
            const double thin = height > 0 ? static_cast<double>(epsilon<S>) / height : 1;
            CHECK(std::abs(lost) <= 32 * epsilon<S> + std::min(height, 32 * thin));
        }
    }
}

TEMPLATE_TEST_CASE("where the origin is does not matter beyond the rounding of the corners", "[triangle]", float,
                   double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto grid = [&](S size) {  // so that what is moved far away is still the same triangle
            const S fine = 1024;
            const Vector3<S> p = size * random.vector<S>();
            return Vector3<S>(((p * fine).eigen().array().round() / fine).matrix());
        };
        const Triangle<S> t{grid(2), grid(2), grid(2)};
        const Vector3<S> q = grid(3), p = grid(3), away = Vector3<S>(4096, -2048, 1024);
        const Triangle<S> far{t.a + away, t.b + away, t.c + away};
        const auto here = closest_point(t, q), there = closest_point<S>(far, q + away);
        CHECK(here.barycentric == there.barycentric);
        CHECK(here.squared_distance == there.squared_distance);
        const auto pair = closest_to_segment(t, p, q), far_pair = closest_to_segment<S>(far, p + away, q + away);
        CHECK(pair.fraction == far_pair.fraction);
        CHECK(pair.on_triangle.squared_distance == far_pair.on_triangle.squared_distance);
        CHECK(first_hit(t, p, q).has_value() == first_hit<S>(far, p + away, q + away).has_value());
    }
}

TEMPLATE_TEST_CASE("segment and triangle come nearest where a search finds them", "[triangle]", float, double) {
    using S = TestType;
    int crossing = 0, inner = 0;
    for (int seed = 1; seed <= cases(6000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto t = random_triangle<S>(Shape::any, random);
        Vector3<S> p = random_point_near(t, random), q = random_point_near(t, random);
        if (seed % 5 == 0) q = p + random.number<S>(-2, 2) * (t.c - t.b);     // parallel
        if (seed % 7 == 0) q = p + t.b - t.a + S(1e-6) * random.vector<S>();  // nearly
        if (seed % 11 == 0) q = p;
        const auto found = closest_to_segment(t, p, q);
        check_weights(found.on_triangle, t);
        CHECK((found.fraction >= 0 && found.fraction <= 1));
        const S scale = extent<S>(t, {p, q});
        const test::Vector<Long> at = exact(p) + static_cast<Long>(found.fraction) * (exact(q) - exact(p));
        const auto distance = std::sqrt(static_cast<Long>(found.on_triangle.squared_distance));
        const Vector3<S> normal = area_vector(t);
        const Long sine = 2 * norm(normal) / (norm<S>(t.b - t.a) * norm<S>(t.c - t.a));
        const Long slack = 256 * epsilon<S> * scale / std::min<Long>(1, sine);
        const Long slope =
            distance > 0 || p == q ? 1 : std::abs(dot<S>(normal, q - p)) / (norm(normal) * norm<S>(q - p));
        const Long apart = (at - exact(found.on_triangle.point)).norm();
        CHECK(std::abs(distance - apart) * slope <= slack);  // where they cross at a small angle is badly defined
        const Long least =
            std::sqrt(test::squared_distance_by_search(test::brute_triangle<Long>(t), exact(p), exact(q)));
        CHECK(std::abs(distance - least) <= slack);
        if (distance == 0) ++crossing;
        if (distance > 0 && found.fraction > 0 && found.fraction < 1) ++inner;
    }
    CHECK(crossing > cases(600));
    CHECK(inner > cases(300));
}

TEMPLATE_TEST_CASE("a segment comes nearest to each edge of a triangle of any shape", "[triangle]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(6000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto t = random_triangle<S>(shapes[static_cast<std::size_t>(seed) % shapes.size()], random);
        const Vector3<S> p = random_point_near(t, random), q = seed % 5 == 0 ? p : random_point_near(t, random);
        const std::array corners{t.a, t.b, t.c, t.a};
        Long smallest_of_all = std::numeric_limits<Long>::infinity();
        const S scale = extent<S>(t, {p, q});
        for (std::size_t k = 0; k < 3; ++k) {
            const auto found = closest_to_segment(t, static_cast<int>(k), p, q);
            check_weights(found.on_triangle, t);
            CHECK(found.on_triangle.barycentric[static_cast<Eigen::Index>((k + 2) % 3)] == 0);
            const auto distance = std::sqrt(static_cast<Long>(found.on_triangle.squared_distance));
            const Long least = std::sqrt(test::least([&](Long along) {
                return test::squared_distance<Long>(exact(corners[k]), exact(corners[k + 1]),
                                                    exact(p) + along * (exact(q) - exact(p)));
            }));
            CHECK(std::abs(distance - least) <= 64 * epsilon<S> * scale);
            smallest_of_all = std::min(smallest_of_all, distance);
        }
        const auto whole = closest_to_segment(t, p, q).on_triangle.squared_distance;
        CHECK(std::sqrt(static_cast<Long>(whole)) <= smallest_of_all);
    }
}

TEMPLATE_TEST_CASE("on a grid, hits are exactly those of integer arithmetic", "[triangle]", float, double) {
    using S = TestType;
    using Whole = std::int64_t;
    int hits = 0, in_plane = 0;
    for (int seed = 1; seed <= cases(300'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto grid = [&] {
            const Whole u = random.index(5), v = random.index(5), w = random.index(seed % 4 == 0 ? 1 : 5);
            return test::Vector<Whole>(u, v, w);
        };
        const test::BruteTriangle<Whole> t{grid(), grid(), grid()};
        const test::Vector<Whole> from = grid(), to = grid();
        const Triangle<S> triangle{t.a.template cast<S>(), t.b.template cast<S>(), t.c.template cast<S>()};
        const auto hit = first_hit<S>(triangle, from.template cast<S>(), to.template cast<S>());
        const bool expected = test::meet(t, from, to);
        if (hit.has_value() != expected) FAIL_CHECK("seed " << seed << ": expected " << expected);
        constexpr int binary_places = std::is_same_v<S, double> ? 40 : 20;
        for (const S scale : {std::ldexp(S(1), -binary_places), std::ldexp(S(1), binary_places)}) {  // exact
            const Triangle<S> scaled{scale * triangle.a, scale * triangle.b, scale * triangle.c};
            const Vector3<S> start = scale * from.template cast<S>(), end = scale * to.template cast<S>();
            if (first_hit<S>(scaled, start, end).has_value() != expected) FAIL_CHECK("seed " << seed << ", " << scale);
        }
        if (!hit || !expected) continue;
        ++hits;
        const Vector3<S> at = from.template cast<S>() + hit->fraction * (to - from).template cast<S>();
        const auto where = point_at(triangle, hit->barycentric);
        const bool inside = (hit->barycentric.eigen().array() >= 0).all() && hit->fraction >= 0 && hit->fraction <= 1;
        if (!inside || norm<S>(at - where) > 2048 * epsilon<S>) FAIL_CHECK("seed " << seed << ": " << hit->fraction);
        if (test::volume(t.a, t.b, t.c, from) != 0 || test::volume(t.a, t.b, t.c, to) != 0) continue;
        ++in_plane;  // nothing of the segment before the hit belongs to the triangle
        const test::Vector<Long> earlier =
            from.template cast<Long>() + (hit->fraction - 1e-4L) * (to - from).template cast<Long>();
        const auto grown = test::brute_triangle<Long>(triangle);
        if (hit->fraction > 0 && test::squared_distance<Long>(grown, earlier) < 1e-12L) FAIL_CHECK("seed " << seed);
    }
    CHECK(hits > cases(30'000));
    CHECK(in_plane > cases(10'000));
}

TEMPLATE_TEST_CASE("hits in general position are those of signed volumes", "[triangle]", float, double) {
    using S = TestType;
    int hits = 0;
    for (int seed = 1; seed <= cases(100'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto size = static_cast<S>(std::pow(10, random.number(-4.0, 4.0)));
        auto t = random_triangle<S>(Shape::any, random);
        t = {size * t.a, size * t.b, size * t.c};
        const Vector3<S> from = size * random.vector<S>(-2, 2);
        const Vector3<S> to = from + S(2.5) * (point_at(t, random.vector<S>(-1, 2)) - from);
        const auto hit = first_hit(t, from, to);
        const bool expected = test::meet(test::brute_triangle<Long>(t), exact(from), exact(to));
        if (!hit) {
            if (expected) FAIL_CHECK("seed " << seed);
            continue;
        }
        ++hits;
        const Triangle<S> other_side{t.a, t.c, t.b};
        const auto turned = first_hit(other_side, from, to), back = first_hit(t, to, from);
        if (expected && !(turned && back)) FAIL_CHECK("seed " << seed << ": not from the other side");
        const bool good = test::ExactCrossing(t, from, to).may_hit_at(hit->fraction) &&
                          (!turned || test::ExactCrossing(other_side, from, to).may_hit_at(turned->fraction)) &&
                          (!back || test::ExactCrossing(t, to, from).may_hit_at(back->fraction));
        if (!good) FAIL_CHECK("seed " << seed);
    }
    CHECK(hits > cases(5000));
}

TEMPLATE_TEST_CASE("a segment in the plane of a long triangle hits it", "[triangle]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> a = random.vector<S>(), along = S(1e4) * random.unit_vector<S>();
        Triangle<S> triangle{a, a + along, a + random.unit_vector<S>()};
        if (random.chance(0.5)) std::swap(triangle.b, triangle.c);
        const Vector3<S> inside = random.barycentric<S>(), away(random.number(S(1), S(3)), -1, 0);
        const auto from = point_at<S>(triangle, inside + away), to = point_at<S>(triangle, inside - away);
        REQUIRE(first_hit<S>(triangle, from, to));
    }
}

TEMPLATE_TEST_CASE("no segment slips through a closed surface", "[triangle]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<S>({.radius = 1, .subdivisions = seed % 2});
        auto x = test::jittered(mesh.positions(), S(0.1), random);
        if (seed % 3 == 0) x.row(2) *= static_cast<S>(std::pow(10, random.number(-6.0, 0.0)));  // thin triangles
        x = (random.rotation<S>() * x).eval();
        x.colwise() += static_cast<S>(std::pow(10, random.number(-2.0, 2.0))) * random.vector<S>().eigen();
        const auto& triangles = mesh.triangles();
        const Vector3<S> centre = x.rowwise().mean();
        const Index f = random.index(mesh.triangle_count());
        const auto t = triangle_at(x, triangles.col(f));
        const S part = random.number<S>();
        const Vector3<S> aim = seed % 4 == 0 ? t.a : Vector3<S>(t.a + part * (t.b - t.a));  // on a corner, on an edge
        const Vector3<S> out = centre + random.number<S>(2, 30) * (aim - centre);
        const auto is_hit = [&](const Vector3<S>& from, const Vector3<S>& to) {
            for (Index g = 0; g < triangles.cols(); ++g) {
                if (first_hit(triangle_at(x, triangles.col(g)), from, to)) return true;
            }
            return false;
        };
        if (!is_hit(centre, out) || !is_hit(out, centre)) FAIL_CHECK("seed " << seed);
        // A stroke that pauses on the surface does not get through either.
        if (!is_hit(centre, aim) && !is_hit(aim, out)) FAIL_CHECK("seed " << seed << ", pausing");
    }
}

TEMPLATE_TEST_CASE("on a grid, a box touches exactly what CGAL says", "[triangle][cgal]", float, double) {
    using S = TestType;
    int touching = 0;
    for (int seed = 1; seed <= cases(40'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto grid = [&](Index least, Index most) {
            const auto number = [&] { return static_cast<S>(least + random.index(most - least + 1)); };
            const S u = number(), v = number(), w = number();
            return Vector3<S>(u, v, w);
        };
        const Triangle<S> t{grid(-4, 7), grid(-4, 7), grid(-4, 7)};
        const Vector3<S> low = grid(0, 2), high = low + grid(seed % 3 == 0 ? 0 : 1, 3);
        const auto in_double = [](const Vector3<S>& p) { return p.template cast<double>(); };
        const auto expected =
            test::cgal_touches_box({in_double(t.a), in_double(t.b), in_double(t.c)}, in_double(low), in_double(high));
        if (!expected) continue;  // degenerate
        touching += *expected ? 1 : 0;
        if (touches_box(t, low, high) != *expected) FAIL_CHECK("seed " << seed << ": expected " << *expected);
    }
    CHECK(touching > cases(10'000));
}

TEMPLATE_TEST_CASE("a box touches what its sides leave something of, whatever the shape", "[triangle]", float, double) {
    using S = TestType;
    int touching = 0;
    for (int seed = 1; seed <= cases(60'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto t = random_triangle<S>(shapes[static_cast<std::size_t>(seed) % shapes.size()], random);
        const Vector3<S> low = random.vector<S>(-1, 1), high = low + random.vector<S>(0, 1);
        const bool expected = test::meet_box(test::brute_triangle<Long>(t), exact(low), exact(high));
        touching += expected ? 1 : 0;
        if (touches_box(t, low, high) != expected) FAIL_CHECK("seed " << seed << ": expected " << expected);
    }
    CHECK(touching > cases(3000));
    const Triangle<S> point{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
    CHECK(touches_box<S>(point, {0, 0, 0}, {1, 1, 1}));
    CHECK(touches_box<S>(point, {1, 1, 1}, {1, 1, 1}));
    CHECK_FALSE(touches_box<S>(point, {0, 0, 0}, {1, 1, 1 - 20 * epsilon<S>}));
    for (int seed = 1; seed <= cases(20'000); ++seed) {  // with a corner on one of the triangle, whatever the roundings
        Random random(static_cast<std::uint64_t>(seed));
        const auto t = random_triangle<S>(shapes[static_cast<std::size_t>(seed) % shapes.size()], random);
        const Vector3<S> high = t.b + random.vector<S>(0, 1), low = t.b - random.vector<S>(0, 1);
        if (!touches_box(t, t.b, high) || !touches_box(t, low, t.b)) FAIL_CHECK("seed " << seed);
    }
}

TEMPLATE_TEST_CASE("a fraction of any two numbers is clamped to 0 and 1", "[triangle][bad]", float, double) {
    using S = TestType;
    using membrane::detail::fraction;
    constexpr S infinity = std::numeric_limits<S>::infinity(), nan = std::numeric_limits<S>::quiet_NaN();
    CHECK(fraction<S>(1, 4) == S(0.25));
    for (const S whole : {S(0), S(1), infinity, nan}) {
        CHECK(fraction<S>(infinity, whole) == 1);
        CHECK(fraction<S>(0, whole) == 0);
        CHECK(fraction<S>(-1, whole) == 0);
        CHECK(fraction<S>(nan, whole) == 0);
    }
    CHECK(fraction<S>(2, 1) == 1);
    CHECK(fraction<S>(1, infinity) == 0);
}

TEMPLATE_TEST_CASE("no finite number gives a NaN, and no number a crash", "[triangle][bad]", float, double) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const std::array<S, 9> finite{
        0, -S(0), 1, -1, Limits::max(), Limits::lowest(), Limits::min(), Limits::denorm_min(), epsilon<S>};
    const std::array<S, 3> others{Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN()};
    for (int seed = 1; seed <= cases(50'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const bool all_finite = seed % 2 == 0;
        const auto number = [&] {
            if (!all_finite && random.chance(0.1)) return others[static_cast<std::size_t>(random.index(3))];
            return finite[static_cast<std::size_t>(random.index(9))];
        };
        const auto vector = [&] {
            const S u = number(), v = number(), w = number();
            return Vector3<S>(u, v, w);
        };
        const Triangle<S> t{vector(), vector(), vector()};
        const Vector3<S> p = vector(), q = vector();
        const auto point = closest_point(t, p);
        const auto pair = closest_to_segment(t, p, q);
        const auto hit = first_hit(t, p, q);
        (void)touches_box(t, p, q);
        bool valid = (point.barycentric.eigen().array() >= 0).all() && !std::isnan(point.squared_distance);
        valid &=
            (pair.on_triangle.barycentric.eigen().array() >= 0).all() && !std::isnan(pair.on_triangle.squared_distance);
        valid &= pair.fraction >= 0 && pair.fraction <= 1;
        if (hit) valid &= (hit->barycentric.eigen().array() >= 0).all() && hit->fraction >= 0 && hit->fraction <= 1;
        valid &= std::isinf(point.squared_distance) || !point.point.eigen().hasNaN();
        if (all_finite) valid &= !point.point.eigen().hasNaN() && !pair.on_triangle.point.eigen().hasNaN();
        if (!valid) FAIL_CHECK("seed " << seed);
    }
}
