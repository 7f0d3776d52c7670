// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/validate.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using test::Surface;

namespace {

template <class S>
MeshReport report_of(const Surface<S>& surface) {
    const MeshReport report = validate(surface.x, surface.triangles);
    // The verdicts agree, and the sentence of the first error is that of the refusal.
    const std::string refused = test::refusal([&] { (void)surface.mesh(); });
    INFO(to_string(report));
    REQUIRE(report.valid() == refused.empty());
    for (const MeshFinding& finding : report.findings) {
        if (severity(finding.defect) == Severity::warning) continue;
        const bool named = std::any_of(report.findings.begin(), report.findings.end(), [&](const MeshFinding& error) {
            return refused == "TriangleMesh: " + error.text;
        });
        CHECK((named || report.count(finding.defect) > 100));
        break;
    }
    return report;
}

/// Whether a finding of this kind concerns the vertices, and the triangles.
bool concerns(const MeshReport& report, MeshDefect defect, const std::set<Index>& vertices,
              const std::set<Index>& triangles) {
    for (const MeshFinding& finding : report.findings) {
        if (finding.defect != defect) continue;
        if (std::set<Index>(finding.vertices.begin(), finding.vertices.end()) != vertices) continue;
        if (std::set<Index>(finding.triangles.begin(), finding.triangles.end()) == triangles) return true;
    }
    return false;
}

/// Whether these kinds are found, and no other.
bool finds_only(const MeshReport& report, const std::set<MeshDefect>& defects) {
    std::set<MeshDefect> found;
    for (const MeshFinding& finding : report.findings) found.insert(finding.defect);
    UNSCOPED_INFO(to_string(report));
    return found == defects;
}

template <class S>
S size_of(const Surface<S>& surface) {
    return (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();
}

/// The points on a grid so coarse that the middle of two is a point, exactly.
template <class S>
Surface<S> on_a_grid(Surface<S> surface) {
    const S step = std::exp2(std::ceil(std::log2(surface.x.cwiseAbs().maxCoeff())) - 14);
    surface.x = (surface.x / step).array().round() * step;
    return surface;
}

/// A triangle in a surface of its own, beside another.
template <class S>
Index add_triangle(Surface<S>& surface, const Vector3<S>& a, const Vector3<S>& b, const Vector3<S>& c) {
    const Index i = surface.add(a), j = surface.add(b), k = surface.add(c);
    return surface.add(i, j, k);
}

/// A surface two triangles of which are parted at the edge between them.
template <class S>
Surface<S> cut_open(const Surface<S>& surface, Random& random, std::vector<Index>& copies) {
    Surface<S> cut = surface;
    const Index f = random.index(surface.triangle_count());
    for (Index k = 0; k < 3; ++k) {
        const Index v = cut.triangles(k, f);
        copies.push_back(v);
        cut.triangles(k, f) = cut.add(Vector3<S>(cut.x.col(v)));
    }
    return cut;
}

const int variants = std::max(12, cases(12, 10));  // each kind must be seen often enough where cases are few, too

}  // namespace

TEMPLATE_TEST_CASE("what is missing or names no vertex is reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = test::random_surface<S>(random);
        const Index f = random.index(given.triangle_count()), k = random.index(3);
        const auto with = [&](const Points<S>& x, const Triangles& triangles) { return report_of<S>({x, triangles}); };
        CHECK(finds_only(with(Points<S>(3, 0), Triangles(3, 0)), {no_vertices, no_triangles}));  // row 1
        CHECK(finds_only(with(given.x, Triangles(3, 0)), {no_triangles}));                       // row 2
        CHECK(with(Points<S>(3, 0), given.triangles).count(no_vertices) == 1);                   // row 3
        CHECK(finds_only(with(given.x.leftCols(1), Triangles(3, 0)), {no_triangles}));           // row 5
        CHECK(finds_only(with(given.x.leftCols(2), Triangles(3, 0)), {no_triangles}));

        const auto naming = [&](auto corner) {
            Eigen::Matrix<decltype(corner), 3, Eigen::Dynamic> t = given.triangles.template cast<decltype(corner)>();
            t(k, f) = corner;
            const MeshReport report = validate(given.x, t);
            CHECK(report.count(index_out_of_range) == 1);
            CHECK(concerns(report, index_out_of_range, {}, {f}));
            CHECK(!report.valid());
            CHECK(report.findings[0].text == "triangle " + std::to_string(f) + " names vertex " +
                                                 std::to_string(corner) + ", expected 0 to " +
                                                 std::to_string(given.vertex_count() - 1));
        };
        naming(given.vertex_count());                         // row 6
        naming(Index{-1});                                    // row 7
        naming(std::uint32_t{0xFFFFFFFF});                    // row 7
        naming((std::int64_t{1} << 31) + random.index(100));  // row 8
        naming((std::int64_t{1} << 32) + k);                  // row 8: a vertex, if cut to 32 bits

        Surface<S> twice = given;  // row 9
        const Index v = given.triangles(k, f);
        twice.triangles((k + 1) % 3, f) = v;
        CHECK(concerns(report_of(twice), repeated_vertex, {v}, {f}));
        twice.triangles.col(f).setConstant(v);  // row 10
        CHECK(concerns(report_of(twice), repeated_vertex, {v}, {f}));
    }
}

TEMPLATE_TEST_CASE("shapes that are none are refused by validation as by the mesh", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const Surface<S> t = test::tetrahedron<S>();
    using Any = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
    for (Index seed = 1; seed <= variants; ++seed) {
        const Index rows = seed < 3 ? seed : seed + 1, columns = 3 + seed % 5;
        CAPTURE(rows, columns);
        const Eigen::MatrixXi wrong = Eigen::MatrixXi::Zero(rows, columns);  // row 45, 46: also 4 rows
        const std::string tail = std::to_string(rows) + " x " + std::to_string(columns);
        const std::string hint = columns == 3 ? "; pass the transpose" : "";
        CHECK(test::refusal([&] { (void)validate(t.x, wrong); }) ==
              "validate: triangles must be 3 x F, one triangle a column, got " + tail + hint);
        CHECK(test::refusal([&] { (void)validate(Any(Any::Ones(rows, columns)), t.triangles); }) ==
              "validate: positions must be 3 x V, one point a column, got " + tail + hint);
    }
    const std::vector<S> xyz(10, S(1));
    const std::vector<int> corners(12, 0);
    CHECK(test::refusal([&] { (void)validate(std::span(xyz), std::span(corners)); }) ==
          "validate: positions must be a multiple of 3 numbers, got 10");
    Random random(1);
    for (Eigen::Index i = 0; i < variants; ++i) {  // row 47: not one of them could be allocated
        const Eigen::Index too_many = (Eigen::Index{1} << (31 + 2 * (i % 10))) + (i == 0 ? 0 : random.index(1000));
        CHECK(test::refusal([&] { (void)validate(Points<S>::Zero(3, too_many), t.triangles); }) ==
              "validate: at most 2147483647 positions can be numbered, got " + std::to_string(too_many));
        const Eigen::Index triangles = too_many / 3 + 1;
        CHECK(test::refusal([&] { (void)validate(t.x, Triangles::Zero(3, triangles)); }) ==
              "validate: at most 715827882 triangles can be numbered, got " + std::to_string(triangles));
    }

    CHECK(test::refusal([&] { (void)validate(t.x, t.triangles, {.tolerance = -1.0}); }) ==
          "validate: tolerance must be finite and not negative [m], got -1");
    CHECK(test::refusal([&] { (void)validate(t.x, t.triangles, {.max_findings_per_kind = 0}); }) ==
          "validate: max_findings_per_kind must be at least 1, got 0");
    CHECK(test::refusal([&] { (void)validate(t.x, t.triangles, {.max_pairs_per_triangle = -2}); }) ==
          "validate: max_pairs_per_triangle must not be negative, got -2");
    const std::vector<S> flat(t.x.data(), t.x.data() + 12);
    const std::vector<Index> flat_corners(t.triangles.data(), t.triangles.data() + 12);
    CHECK(validate(std::span(flat), std::span(flat_corners)).empty());
    CHECK(validate(Eigen::Matrix<S, 3, 4>(t.x), t.triangles).empty());
}

TEMPLATE_TEST_CASE("what is odd about the numbers is reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    using Limits = std::numeric_limits<S>;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = test::random_surface<S>(random);
        const Index v = random.index(given.vertex_count()), k = random.index(3);
        const auto with = [&](S coordinate) {
            Surface<S> bad = given;
            bad.x(k, v) = coordinate;
            return report_of(bad);
        };
        CHECK(concerns(with(Limits::quiet_NaN()), coordinate_not_finite, {v}, {}));  // row 18
        CHECK(finds_only(with(Limits::quiet_NaN()), {coordinate_not_finite}));
        CHECK(concerns(with(Limits::infinity()), coordinate_not_finite, {v}, {}));  // row 19
        CHECK(concerns(with(-Limits::infinity()), coordinate_not_finite, {v}, {}));
        CHECK(concerns(with((Limits::max)()), coordinate_too_large, {v}, {}));  // row 20
        CHECK(concerns(with(-std::sqrt((Limits::max)())), coordinate_too_large, {v}, {}));

        Surface<S> bad = given;  // row 21
        bad.x *= (Limits::min)() * S(16);
        CHECK(report_of(bad).count(too_small) == 1);
        bad.x = given.x * Limits::denorm_min();
        CHECK((report_of(bad).count(too_small) + report_of(bad).count(all_at_one_point)) == 1);
        bad = given;
        bad.x.colwise() += S(0.1) * size_of(given) / Limits::epsilon() * random.unit_vector<S>().eigen();
        CHECK(finds_only(report_of(bad), {too_coarse}));

        const Vector3<S> start = random.vector<S>(), along = random.unit_vector<S>();
        bad.x = start.eigen().replicate(1, given.vertex_count());  // row 22
        CHECK(finds_only(report_of(bad), {all_at_one_point}));
        for (Index w = 0; w < given.vertex_count(); ++w) bad.x.col(w) = start + random.number<S>(-1, 1) * along;
        CHECK(finds_only(report_of(bad), {all_on_one_line}));  // row 23
    }
}

TEMPLATE_TEST_CASE("what is odd about edges and fans is reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = test::random_surface<S>(random);
        const auto [f, g, k] = test::inner_side(given, random);
        const Index a = given.triangles(k, f), b = given.triangles((k + 1) % 3, f), c = given.triangles((k + 2) % 3, f);

        Surface<S> bad = given;
        const Index again = bad.add(b, c, a);  // row 11
        CHECK(concerns(report_of(bad), duplicate_triangle, {a, b, c}, {f, again}));
        CHECK(report_of(bad).count(duplicate_triangle) == 1);
        bad.turn(again);  // row 12
        CHECK(concerns(report_of(bad), double_sided_triangle, {a, b, c}, {f, again}));
        CHECK(report_of(bad).count(duplicate_triangle) == 0);
        bad = given;  // row 12: a sheet of two sides
        bad.triangles.conservativeResize(3, 2 * given.triangle_count());
        bad.triangles.rightCols(given.triangle_count()) = given.triangles.colwise().reverse();
        CHECK(report_of(bad).count(double_sided_triangle) == static_cast<std::size_t>(given.triangle_count()));
        CHECK(report_of(bad).findings.size() <= 100 * 3);

        bad = given;  // row 25
        const Index third = bad.add(a, b, bad.add(Vector3<S>(bad.x.col(a) + size_of(given) * random.vector<S>())));
        CHECK(concerns(report_of(bad), non_manifold_edge, {a, b}, {f, g, third}));
        CHECK(report_of(bad).count(non_manifold_edge) == 1);
        CHECK(report_of(bad).facts.genus == no_index);

        const Surface<S> other = seed % 2 == 0 ? test::random_surface<S>(random) : test::tetrahedron<S>();
        bad = seed % 2 == 0 ? given : test::tetrahedron<S>();  // row 26, and 27: two tetrahedra
        const Index v = random.index(bad.vertex_count());
        const Index w = bad.vertex_count() + random.index(other.vertex_count());
        bad.add(other);
        bad.x.rightCols(other.vertex_count()).colwise() +=
            bad.x.col(v) - bad.x.col(w) + S(0.001) * size_of(given) * random.vector<S>().eigen();
        for (Index& corner : bad.triangles.reshaped()) corner = corner == w ? v : corner;
        const MeshReport joined = report_of(bad);
        CHECK(joined.count(non_manifold_vertex) == 1);
        CHECK(joined.count(isolated_vertex) == 1);
        CHECK(joined.findings[0].vertices == std::vector<Index>{v});

        bad = given;  // row 28
        bad.turn(f);
        const MeshReport turned = report_of(bad);
        CHECK(turned.count(inconsistent_orientation) >= 1);
        CHECK(turned.count(inconsistent_orientation) <= 3);
        CHECK((concerns(turned, inconsistent_orientation, {a, b}, {f, g})));

        Surface<S> strip = test::moebius_strip<S>(3 + random.index(20));  // row 30
        for (Index h = 0; h < strip.triangle_count(); ++h) {
            if (random.chance(0.3)) strip.turn(h);
        }
        CHECK(report_of(test::shuffled(strip, random)).count(one_sided) == 1);
        Surface<S> bottle = test::klein_bottle<S>(3 + random.index(8), 3 + random.index(8));  // row 31
        bottle.add(strip);
        CHECK(report_of(test::shuffled(bottle, random)).count(one_sided) == 2);
        bottle.add(bad);
        CHECK(report_of(bottle).count(one_sided) == 2);
        CHECK(report_of(bottle).count(inconsistent_orientation) == turned.count(inconsistent_orientation));
    }
}

TEMPLATE_TEST_CASE("vertices at one place, and nearly so, are reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = test::random_closed_surface<S>(random);
        std::vector<Index> copies;
        Surface<S> bad = cut_open(given, random, copies);  // row 13
        const MeshReport seam = report_of(bad);
        CHECK(seam.valid());
        CHECK(seam.count(coincident_vertices) == 3);
        CHECK(seam.count(self_intersection) == 0);  // what is meant to be one edge does not cross itself there
        for (Index k = 0; k < 3; ++k) {
            const Index v = copies[static_cast<std::size_t>(k)], w = given.vertex_count() + k;
            CHECK(concerns(seam, coincident_vertices, {v, w}, {}));
        }
        const S nearly = random.chance(0.5) ? std::numeric_limits<S>::epsilon() : S(4e-8);  // row 14
        for (Index k = 0; k < 3; ++k) {
            S& coordinate = bad.x(0, given.vertex_count() + k);
            coordinate = nearly < S(1e-8) ? std::nextafter(coordinate, S(100)) : coordinate + nearly * size_of(given);
        }
        const MeshReport near = report_of(bad);
        CHECK(near.valid());
        CHECK(near.count(coincident_vertices) + near.count(nearly_coincident_vertices) == 3);
        CHECK(validate(bad.x, bad.triangles, {.tolerance = 0.0}).count(nearly_coincident_vertices) == 0);
        CHECK(validate(given.x, given.triangles, {.tolerance = 10.0 * static_cast<double>(size_of(given))})
                  .count(nearly_coincident_vertices) ==
              static_cast<std::size_t>(given.vertex_count() * (given.vertex_count() - 1) / 2));
    }
}

TEMPLATE_TEST_CASE("triangles of a bad shape are reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = on_a_grid(test::random_surface<S>(random));
        const Index f = random.index(given.triangle_count());
        const Vector3<S> a = given.x.col(given.triangles(0, f)), b = given.x.col(given.triangles(1, f));
        const Vector3<S> c = given.x.col(given.triangles(2, f));
        const Vector3<S> away = 8 * size_of(given) * Vector3<S>(S(seed % 2), S(seed % 3 == 0), S(1));
        const auto beside = [&](const Vector3<S>& third) {
            Surface<S> bad = on_a_grid(given);
            const Index added = add_triangle<S>(bad, a + away, b + away, third + away);
            return std::pair(report_of(bad), added);
        };
        const Index n = given.vertex_count();
        const auto [flat, g] = beside((a + b) / 2);  // row 15
        CHECK(concerns(flat, zero_area, {n, n + 1, n + 2}, {g}));
        CHECK(flat.count(needle) + flat.count(cap) == 0);
        CHECK(flat.valid());
        CHECK(beside(b).first.count(zero_area) == 1);  // an edge of no length
        // Around 0, where numbers are fine enough for what is thin.
        const S length = norm<S>(b - a);
        Surface<S> thin = given;
        const Vector3<S> to_b = (b - a) / length;
        const Vector3<S> across = direction<S>(cross<S>(to_b, c - a), Vector3<S>::UnitX());
        const Index needle_triangle = add_triangle<S>(thin, Vector3<S>::Zero(), S(-4e-7) * length * across, b - a);
        const MeshReport needles = report_of(thin);  // row 16
        CHECK(needles.count(needle) == 1);
        CHECK(concerns(needles, needle, {n, n + 1, n + 2}, {needle_triangle}));
        CHECK(needles.valid());
        thin = given;
        const Index cap_triangle =
            add_triangle<S>(thin, S(-0.5) * (b - a), S(0.5) * (b - a), S(4e-6) * length * across);
        const MeshReport caps = report_of(thin);  // row 17
        CHECK(caps.count(cap) == 1);
        CHECK(concerns(caps, cap, {n, n + 1, n + 2}, {cap_triangle}));
        CHECK(caps.valid());
    }
}

TEMPLATE_TEST_CASE("what is odd about whole surfaces is reported", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> ball = test::random_closed_surface<S>(random), given = test::random_surface<S>(random);
        const S size = size_of(ball);
        const Vector3<S> middle = ball.x.rowwise().mean();

        Surface<S> bad = ball;  // row 24
        bad.x.row(random.index(3)).setConstant(S(0.1) * size);
        CHECK(report_of(bad).count(no_volume) == 1);
        CHECK(report_of(bad).valid());
        bad.x = (random.rotation<S>() * bad.x).eval();  // flat but for rounding
        CHECK(report_of(bad).count(no_volume) == 1);

        bad = ball;  // row 29
        bad.triangles.row(0).swap(bad.triangles.row(1));
        CHECK(finds_only(report_of(bad), {inward}));
        CHECK(report_of(bad).facts.facing == Facing::inward);
        CHECK(report_of(bad).facts.volume < 0);

        bad = ball;  // row 33
        const Index f = random.index(ball.triangle_count());
        const std::set<Index> corners{ball.triangles(0, f), ball.triangles(1, f), ball.triangles(2, f)};
        bad.remove_triangle(f);
        const MeshReport holed = report_of(bad);
        CHECK(finds_only(holed, {missing_triangle}));
        CHECK(std::set<Index>(holed.findings[0].vertices.begin(), holed.findings[0].vertices.end()) == corners);

        bad = given;  // row 34
        Surface<S> other = test::random_surface<S>(random);
        const S apart =
            4 * (size_of(given) + size_of(other)) + given.x.cwiseAbs().maxCoeff() + other.x.cwiseAbs().maxCoeff();
        other.x.colwise() += apart * random.unit_vector<S>().eigen();
        bad.add(other);
        CHECK(report_of(bad).count(several_components) == 1);
        CHECK(report_of(bad).count(nested_components) == 0);
        CHECK(report_of(bad).valid());
        CHECK(report_of(bad).facts.components == 2);

        bad = ball;  // row 35
        bad.add(ball);
        bad.x.rightCols(ball.vertex_count()) =
            (S(0.4) * (ball.x.colwise() - middle.eigen())).colwise() + middle.eigen();
        CHECK(finds_only(report_of(bad), {several_components, nested_components}));
        CHECK(concerns(report_of(bad), nested_components, {}, {0, ball.triangle_count()}));

        bad = ball;  // row 36: one vertex is pushed through to the other side
        const Index v = random.index(ball.vertex_count());
        bad.x.col(v) += S(2.2) * (middle - Vector3<S>(bad.x.col(v)));
        CHECK(report_of(bad).count(self_intersection) > 0);
        CHECK(report_of(bad).valid());
        bad = ball;  // two balls that cross
        bad.add(ball);
        bad.x.rightCols(ball.vertex_count()).colwise() += S(0.5) * size * random.unit_vector<S>().eigen();
        CHECK(report_of(bad).count(self_intersection) > 0);
        CHECK(report_of(bad).count(nested_components) == 0);

        bad = given;  // row 38
        const Index alone = bad.add(Vector3<S>(size_of(given) * random.vector<S>()));
        CHECK(concerns(report_of(bad), isolated_vertex, {alone}, {}));
        CHECK(report_of(bad).count(isolated_vertex) == 1);
        CHECK(report_of(bad).valid());

        bad = on_a_grid(ball);  // row 48: the triangle beside an edge is cut in two, and this one is not
        const auto [one, beside, k] = test::inner_side(bad, random);
        const Index a = bad.triangles(k, one), b = bad.triangles((k + 1) % 3, one), c = bad.triangles((k + 2) % 3, one);
        const Index half = bad.add(Vector3<S>((bad.x.col(a) + bad.x.col(b)) / 2));
        bad.triangles.col(one) << a, half, c;
        bad.add(half, b, c);
        CHECK(concerns(report_of(bad), t_junction, {half, a, b}, {beside}));
        CHECK(report_of(bad).valid());
        CHECK(!report_of(bad).facts.closed());
    }
}

TEMPLATE_TEST_CASE("what is odd but as it may be is not reported", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= variants; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> one;  // row 4
        add_triangle<S>(one, random.vector<S>(), random.vector<S>(), random.vector<S>());
        CHECK(finds_only(report_of(one), {}));
        CHECK(report_of(one).facts.borders == 1);
        const MeshReport open = report_of(test::random_open_surface<S>(random));  // row 32
        CHECK(finds_only(open, {}));
        CHECK(!open.facts.closed());
        Surface<S> torus = test::klein_bottle<S>(3 + random.index(8), 3 + random.index(8), false);  // row 39
        torus.x = (random.rotation<S>() * torus.x).eval();
        CHECK(finds_only(report_of(torus), {}));
        CHECK(report_of(torus).facts.genus == 1);
        Surface<S> four = test::tetrahedron<S>();  // row 41
        four.x = (random.rotation<S>() * four.x).eval();
        CHECK(finds_only(report_of(four), {}));
        CHECK(report_of(four).facts.closed());
    }
}

TEMPLATE_TEST_CASE("a thousand valid meshes give an empty report", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> surface = test::random_surface<S>(random);
        const MeshReport report = report_of(surface);
        REQUIRE(finds_only(report, {}));
        REQUIRE(report.complete);
        REQUIRE(report.facts.triangles == surface.triangle_count());
        REQUIRE(report.facts.genus == 0);
        REQUIRE(report.facts.components == 1);
    }
}

TEMPLATE_TEST_CASE("validation and the mesh agree on meshes changed at random", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    int refused = 0;
    for (int seed = 1; seed <= cases(1500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = random.chance(0.5) ? test::tetrahedron<S>() : test::random_open_surface<S>(random);
        for (Index change = random.index(6); change > 0; --change) {
            const Index kind = random.index(7), f = random.index(surface.triangle_count());
            const auto order = test::random_order(surface.vertex_count(), random);
            if (kind == 0 && surface.triangle_count() > 1) surface.remove_triangle(f);
            if (kind == 1) surface.add(order[0], order[1], order[2]);
            if (kind == 2) surface.turn(f);
            if (kind == 3) {
                const Index k = random.index(3), apex = surface.add(random.vector<S>());
                surface.add(surface.triangles(k, f), apex, surface.triangles((k + 1) % 3, f));
            }
            if (kind == 4) surface.triangles(random.index(3), f) = order[0];
            if (kind == 5) surface.x.col(order[0]) = surface.x.col(order[1]);
            if (kind == 6) surface.x.col(order[0]) *= std::pow(S(10), random.number<S>(-20, 20));
        }
        const MeshReport report = report_of(surface);  // which compares them
        refused += report.valid() ? 0 : 1;
    }
    CHECK(refused > cases(300));
    CHECK(refused < cases(1200));
}

TEMPLATE_TEST_CASE("garbage ends in a report", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(5000, 5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto bits = [&](auto number) {
            const std::uint64_t any = random.engine()();
            std::memcpy(&number, &any, sizeof number);
            return number;
        };
        Surface<S> garbage;
        garbage.x.resize(3, random.index(12));
        garbage.triangles.resize(3, random.index(16));
        // All bits at random; few of them; or a coarse grid, on which much meets.
        const Index tame = random.index(3);
        for (S& coordinate : garbage.x.reshaped()) {
            coordinate = tame == 0 || random.chance(0.02) ? bits(S(0)) : S(random.index(tame == 1 ? 1000 : 3) - 1);
        }
        for (Index& corner : garbage.triangles.reshaped()) {
            corner = tame == 0 || random.chance(0.02) ? bits(Index(0)) : random.index(garbage.vertex_count() + 1);
        }
        const MeshReport report = report_of(garbage);
        REQUIRE((!report.valid() || report.facts.genus != no_index));
        const SurfaceFacts& facts = report.facts;
        for (const double fact : {facts.shortest_edge, facts.mean_edge, facts.max_edge, facts.smallest_angle,
                                  facts.largest_angle, facts.area, facts.volume, facts.size[0]}) {
            REQUIRE(is_finite(fact));
        }
    }
}

TEMPLATE_TEST_CASE("a fan all pairs of which meet is tested in part, and taken", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(3, variants); ++seed) {  // row 40
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> fan = test::shuffled(test::fan<S>(100'000 + random.index(1000)), random);
        fan.x = (random.rotation<S>() * fan.x).eval();
        const MeshReport report = validate(fan.x, fan.triangles, {.max_pairs_per_triangle = 0});
        INFO(to_string(report));
        CHECK(report.empty());
        CHECK(!report.complete);
        CHECK(report.unfinished == std::vector{MeshDefect::self_intersection});
    }
}

TEST_CASE("the work of validation is bounded", "[mesh]") {
    Surface<double> heap;  // triangles all through each other, and all points nearly coincident
    Random random(1);
    for (Index i = 0; i < 800; ++i)  // enough that both searches stop
        add_triangle<double>(heap, random.vector(), random.vector(), random.vector());
    const MeshReport report = validate(heap.x, heap.triangles, {.tolerance = 10, .max_pairs_per_triangle = 10});
    CHECK(report.count(MeshDefect::self_intersection) == 100);
    CHECK(!report.complete);
    CHECK(report.unfinished.front() == MeshDefect::nearly_coincident_vertices);
    CHECK(report.unfinished.back() == MeshDefect::self_intersection);
    CHECK(validate(heap.x, heap.triangles, {.tolerance = 0.0, .max_findings_per_kind = 3}).findings.size() <= 6);
    const MeshReport one_of_a_kind = validate(heap.x, heap.triangles, {.tolerance = 0.0, .max_findings_per_kind = 1});
    CHECK(one_of_a_kind.findings.size() <= 2);
    CHECK_THAT(to_string(one_of_a_kind), ContainsSubstring("components, one with triangle 0, one with triangle 1\n"));
    const std::string summary = "several components: " + std::to_string(heap.triangle_count()) + "; repair with .weld";
    CHECK_THAT(to_string(one_of_a_kind), ContainsSubstring(summary));
}

TEST_CASE("along a seam that is a little open, the remedy is to weld", "[mesh][bad]") {
    const auto sphere = icosphere<double>({.radius = 10e-3, .subdivisions = 2});
    const double edge = validate(sphere.positions(), sphere.triangles()).facts.mean_edge;
    for (const double offset : {1e-9, 1e-6, 1e-5, 1e-4, 9e-4}) {
        CAPTURE(offset);
        Surface<double> halves = test::surface_of(sphere);
        std::vector<Index> copy(static_cast<std::size_t>(sphere.vertex_count()), no_index);
        for (Index f = 0; f < sphere.triangle_count(); ++f) {
            double y = 0;
            for (Index k = 0; k < 3; ++k) y += sphere.positions()(1, sphere.triangles()(k, f));
            for (Index k = 0; y > 0 && k < 3; ++k) {
                const Index v = sphere.triangles()(k, f);
                Index& other = copy[static_cast<std::size_t>(v)];
                const Vector3<double> beside = point(sphere.positions(), v) + offset * edge * Vector3<double>::UnitX();
                if (other == no_index) other = halves.add(beside);
                halves.triangles(k, f) = other;
            }
        }
        const MeshReport report = validate(halves.x, halves.triangles);
        CHECK(report.count(MeshDefect::nearly_coincident_vertices) > 0);
        CHECK_THAT(to_string(report), ContainsSubstring(".weld and a distance"));
    }
}

TEST_CASE("a vertex beside an edge is on it within the tolerance, to any side", "[mesh][bad]") {
    const auto junctions = [](const Vector3<double>& off) {
        Surface<double> two;
        for (const double y : {0.0, 1.0}) two.add(Vector3<double>(0, y, 0));
        two.add(0, 1, two.add(Vector3<double>(-1, 0.5, 0)));
        for (const double y : {0.0, 0.5, 1.0}) two.add(Vector3<double>(0, y, 0));  // its edge is halved here
        const Index far = two.add(Vector3<double>(1, 0.5, 0));
        two.add(4, 3, far);
        two.add(5, 4, far);
        two.x.rightCols(4).colwise() += off.eigen();
        return validate(two.x, two.triangles, {.tolerance = 0.01}).count(MeshDefect::t_junction);
    };
    for (const double sign : {-1.0, 1.0}) {
        for (const int axis : {0, 1, 2}) CHECK(junctions(0.005 * sign * Vector3<double>::Unit(axis)) == 1);
        CHECK(junctions(0.015 * sign * Vector3<double>::UnitZ()) == 0);
    }
}

TEMPLATE_TEST_CASE("what has an unusable corner has no edge for another's vertex", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const S far = std::sqrt(std::sqrt((std::numeric_limits<S>::max)()));
    for (const auto& [end, expected] : {std::pair(far, 0U), std::pair(S(20), 1U)}) {
        Surface<S> two;
        two.add(Vector3<S>(0, 0, 0)), two.add(Vector3<S>(0, -1, 0)), two.add(Vector3<S>(end, 0, 0));
        two.add(0, 1, 2);
        two.add(Vector3<S>(5, 0, 0)), two.add(Vector3<S>(6, 1, 0)), two.add(Vector3<S>(4, 1, 0));
        two.add(3, 4, 5);
        CHECK(report_of(two).count(MeshDefect::t_junction) == expected);
    }
}
