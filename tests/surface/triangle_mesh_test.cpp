// SPDX-License-Identifier: MIT
#include <membrane/surface/triangle_mesh.hpp>

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/cgal.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using test::Surface;

namespace {

template <class S>
constexpr S infinity = std::numeric_limits<S>::infinity();
template <class S>
constexpr S not_a_number = std::numeric_limits<S>::quiet_NaN();

/// How messages show a number.
template <class S>
std::string text(S number) {
    std::string result;
    detail::append(result, number);
    return result;
}

template <class S>
std::string refusal_of(const Surface<S>& surface) {
    return test::refusal([&] { (void)surface.mesh(); });
}

template <class S>
bool accepted_unchanged(const Surface<S>& surface) {
    const TriangleMesh<S> mesh = surface.mesh();
    return mesh.positions() == surface.x && mesh.triangles() == surface.triangles &&
           mesh.vertex_count() == surface.vertex_count() && mesh.triangle_count() == surface.triangle_count();
}

/// The three vertices of a triangle, ascending, as the message for equal triangles lists them.
template <class S>
std::string vertices_of(const Surface<S>& surface, Index f) {
    std::array<Index, 3> v{surface.triangles(0, f), surface.triangles(1, f), surface.triangles(2, f)};
    std::sort(v.begin(), v.end());
    return text(v[0]) + ", " + text(v[1]) + " and " + text(v[2]);
}

}  // namespace

TEMPLATE_TEST_CASE("a mesh holds what it was given", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        REQUIRE(accepted_unchanged(test::random_surface<S>(random)));
        REQUIRE(accepted_unchanged(test::with_holes(test::random_surface<S>(random), random)));
    }
}

TEMPLATE_TEST_CASE("a mesh takes every layout of positions", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    const Surface<S> given = test::tetrahedron<S>();
    const auto same = [&](const TriangleMesh<S>& mesh) {
        return mesh.positions() == given.x && mesh.triangles() == given.triangles;
    };
    const Triangles& t = given.triangles;

    const Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> dynamic = given.x;
    CHECK(same(TriangleMesh(dynamic, t)));
    const Eigen::Matrix<S, 3, Eigen::Dynamic, Eigen::RowMajor> row_major = given.x;
    CHECK(same(TriangleMesh(row_major, t)));
    const Eigen::Matrix<S, 3, 4> fixed = given.x;
    CHECK(same(TriangleMesh(fixed, t)));
    const Eigen::Matrix<S, Eigen::Dynamic, 3, Eigen::RowMajor> point_a_row = given.x.transpose();
    CHECK(same(TriangleMesh(point_a_row.transpose(), t)));
    CHECK(same(TriangleMesh<S>(given.x.template cast<double>().template cast<S>() * S(1), t)));

    std::vector<S> interleaved(8 * 4, not_a_number<S>);
    for (std::size_t v = 0; v < 4; ++v) {
        for (std::size_t k = 0; k < 3; ++k) {
            interleaved[8 * v + k] = given.x(static_cast<Index>(k), static_cast<Index>(v));
        }
    }
    using Stride = Eigen::OuterStride<>;
    const Eigen::Map<const Points<S>, 0, Stride> strided(interleaved.data(), 3, 4, Stride(8));
    CHECK(same(TriangleMesh(strided, t)));
    const ConstPointsRef<S> reference(strided);
    CHECK(same(TriangleMesh(reference, t)));

    Points<S> wide(3, 10);
    wide.setConstant(not_a_number<S>);
    wide.middleCols(5, 4) = given.x;
    CHECK(same(TriangleMesh(wide.middleCols(5, 4), t)));
}

TEMPLATE_TEST_CASE("a mesh takes every integer type of triangles", "[mesh]", std::int8_t, std::uint8_t, std::int16_t,
                   std::uint16_t, std::int32_t, std::uint32_t, std::int64_t, std::uint64_t) {
    using I = TestType;
    const Surface<double> given = test::tetrahedron<double>();
    const Eigen::Matrix<I, 3, Eigen::Dynamic> t = given.triangles.cast<I>();
    CHECK(TriangleMesh(given.x, t).triangles() == given.triangles);
    const Eigen::Matrix<I, Eigen::Dynamic, 3, Eigen::RowMajor> triangle_a_row = t.transpose();
    CHECK(TriangleMesh(given.x, triangle_a_row.transpose()).triangles() == given.triangles);

    const std::vector<double> xyz(given.x.data(), given.x.data() + 12);
    const std::vector<I> corners(t.data(), t.data() + 12);
    CHECK(TriangleMesh(std::span(xyz), std::span(corners)).triangles() == given.triangles);
    CHECK(TriangleMesh<double>(xyz, std::span(corners)).positions() == given.x);
    std::array<double, 12> array_xyz{};
    std::array<I, 12> array_corners{};
    std::copy(xyz.begin(), xyz.end(), array_xyz.begin());
    std::copy(corners.begin(), corners.end(), array_corners.begin());
    const TriangleMesh from_arrays{std::span(array_xyz), std::span(array_corners)};
    CHECK(from_arrays.positions() == given.x);
    CHECK(from_arrays.triangles() == given.triangles);
}

TEST_CASE("a mesh can be copied and moved", "[mesh]") {
    Random random(1);
    const auto surface = test::random_surface<double>(random);
    auto first = std::make_unique<TriangleMesh<double>>(surface.mesh());
    const TriangleMesh<double> copy = *first;
    const TriangleMesh<double> moved = std::move(*first);
    first.reset();
    CHECK(copy.positions() == surface.x);
    CHECK(moved.positions() == surface.x);
    CHECK(copy.triangles() == moved.triangles());
}

TEMPLATE_TEST_CASE("missing and misshapen matrices are refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const Surface<S> t = test::tetrahedron<S>();
    using Any = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
    const auto refused = [](const auto& x, const auto& triangles) {
        return test::refusal([&] { TriangleMesh<S> mesh(x, triangles); });
    };
    const std::string positions = "TriangleMesh: positions must be 3 x V, one point a column, got ";
    const std::string triangles = "TriangleMesh: triangles must be 3 x F, one triangle a column, got ";
    CHECK(refused(Points<S>(3, 0), Triangles(3, 0)) == positions + "none");
    CHECK(refused(Any(), t.triangles) == positions + "none");
    CHECK(refused(Points<S>(3, 0), t.triangles) == positions + "none");
    CHECK(refused(t.x, Triangles(3, 0)) == triangles + "none");
    CHECK(refused(Points<S>(t.x.leftCols(1)), Triangles(3, 0)) == triangles + "none");
    for (const Index rows : {1, 2, 4, 5, 642}) {
        CHECK(refused(Any(Any::Ones(rows, 7)), t.triangles) == positions + text(rows) + " x 7");
        CHECK(refused(Any(Any::Ones(rows, 3)), t.triangles) == positions + text(rows) + " x 3; pass the transpose");
        const Eigen::MatrixXi wrong = Eigen::MatrixXi::Zero(rows, 9);
        CHECK(refused(t.x, wrong) == triangles + text(rows) + " x 9");
        const Eigen::MatrixXi rowwise = Eigen::MatrixXi::Zero(rows, 3);
        CHECK(refused(t.x, rowwise) == triangles + text(rows) + " x 3; pass the transpose");
    }
    const Eigen::Matrix<S, Eigen::Dynamic, 3> point_a_row = t.x.transpose();
    CHECK(refused(point_a_row, t.triangles) == positions + "4 x 3; pass the transpose");

    const std::vector<S> xyz(10, S(1));
    const std::vector<int> corners(12, 0);
    CHECK(test::refusal([&] { (void)TriangleMesh(std::span(xyz), std::span(corners)); }) ==
          "TriangleMesh: positions must be a multiple of 3 numbers, got 10");
    CHECK(test::refusal([&] { (void)TriangleMesh(std::span(xyz).first(9), std::span(corners).first(11)); }) ==
          "TriangleMesh: triangles must be a multiple of 3 numbers, got 11");
    CHECK(test::refusal([&] { (void)TriangleMesh(std::span(xyz).first(0), std::span(corners)); }) ==
          positions + "none");
    CHECK(test::refusal([&] { (void)TriangleMesh(std::span(xyz).first(9), std::span(corners).first(0)); }) ==
          triangles + "none");
}

TEST_CASE("more vertices or triangles than can be numbered are refused before anything is stored", "[mesh][bad]") {
    const Surface<double> t = test::tetrahedron<double>();
    const Eigen::Index too_many = Eigen::Index{1} << 31;
    CHECK(test::refusal([&] { TriangleMesh<double> mesh(Points<double>::Zero(3, too_many), t.triangles); }) ==
          "TriangleMesh: at most 2147483647 positions can be numbered, got 2147483648");
    CHECK(test::refusal([&] { TriangleMesh<double> mesh(t.x, Triangles::Zero(3, too_many / 3 + 1)); }) ==
          "TriangleMesh: at most 715827882 triangles can be numbered, got 715827883");
}

TEMPLATE_TEST_CASE("an index that is not a vertex is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> surface = test::random_surface<S>(random);
        const Index f = random.index(surface.triangle_count()), k = random.index(3);
        const auto refused = [&](auto corner) {
            Eigen::Matrix<decltype(corner), 3, Eigen::Dynamic> t = surface.triangles.template cast<decltype(corner)>();
            t(k, f) = corner;
            CHECK(test::refusal([&] { TriangleMesh<S> mesh(surface.x, t); }) ==
                  "TriangleMesh: triangle " + text(f) + " names vertex " + text(corner) + ", expected 0 to " +
                      text(surface.vertex_count() - 1));
        };
        refused(surface.vertex_count());
        refused(static_cast<std::uint16_t>(surface.vertex_count()));
        refused(Index{-1});
        refused(std::int16_t{-1});
        refused(std::numeric_limits<Index>::min());
        refused(std::numeric_limits<Index>::max());
        refused(std::uint32_t{0xFFFFFFFF});
        refused(std::int64_t{0xFFFFFFFF});
        refused((std::int64_t{1} << 32) + k);  // a vertex, if cut to 32 bits
        refused((std::uint64_t{1} << 32) + static_cast<std::uint64_t>(k));
        refused(std::numeric_limits<std::int64_t>::min());
        refused(std::numeric_limits<std::uint64_t>::max());
    }
}

TEMPLATE_TEST_CASE("a vertex named twice by a triangle is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const Index f = random.index(surface.triangle_count()), k = random.index(3), v = surface.triangles(k, f);
        surface.triangles((k + 1 + random.index(2)) % 3, f) = v;
        const std::string message =
            "TriangleMesh: triangle " + text(f) + " names vertex " + text(v) + " twice, expected three vertices";
        CHECK(refusal_of(surface) == message);
        surface.triangles.col(f).setConstant(v);
        CHECK(refusal_of(surface) == message);
    }
}

TEMPLATE_TEST_CASE("coordinates that numbers cannot carry are refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const S most = std::sqrt(std::sqrt(std::numeric_limits<S>::max())) / 4;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> surface = test::random_surface<S>(random);
        const Index v = random.index(surface.vertex_count()), k = random.index(3);
        const std::string where = std::string("TriangleMesh: ") + "xyz"[k] + " of vertex " + text(v);
        const auto refused = [&](S coordinate) {
            Surface<S> bad = surface;
            bad.x(k, v) = coordinate;
            return refusal_of(bad);
        };
        CHECK(refused(not_a_number<S>) == where + " must be finite [m], got nan");
        CHECK(refused(infinity<S>) == where + " must be finite [m], got inf");
        CHECK(refused(-infinity<S>) == where + " must be finite [m], got -inf");
        for (const S large : {std::numeric_limits<S>::max(), std::sqrt(std::numeric_limits<S>::max()), 2 * most}) {
            const std::string message =
                where + " must be within " + text(most) + " [m] of 0, or squares of areas overflow, got ";
            CHECK(refused(large) == message + text(large));
            CHECK(refused(-large) == message + text(-large));
        }
    }
}

TEMPLATE_TEST_CASE("a mesh that is too small or too far away for its numbers is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const double least = 4 * std::sqrt(std::sqrt(static_cast<double>(std::numeric_limits<S>::min())));
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> surface = test::random_surface<S>(random);
        for (const S scale :
             {std::numeric_limits<S>::denorm_min(), std::numeric_limits<S>::min() * 16, static_cast<S>(least / 100)}) {
            Surface<S> tiny = surface;
            tiny.x *= scale;
            const std::string message = refusal_of(tiny);
            if (message == "TriangleMesh: all vertices of each triangle are at one point, expected a surface") continue;
            CHECK_THAT(message, ContainsSubstring("TriangleMesh: the mean edge must be at least " + text(least) +
                                                  " [m], or squares of areas vanish, got "));
        }
        Surface<S> far = surface;
        const S size = (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();
        far.x.colwise() += S(0.1) * size / std::numeric_limits<S>::epsilon() * random.unit_vector<S>().eigen();
        const std::string message = refusal_of(far);
        CHECK_THAT(message,
                   ContainsSubstring("a thousand times the spacing of numbers at the largest coordinate, got "));
        CHECK_THAT(message, ContainsSubstring("; move the mesh to the origin, or use double"));
    }
}

TEMPLATE_TEST_CASE("the spacing of numbers may be a thousandth of the mean edge and not more", "[mesh][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon();
    for (const S edge : {S(1e-3), S(1), S(1e3)}) {
        for (const int exponent : {-3, 0, 2}) {
            CAPTURE(edge, exponent);
            const S size = edge * static_cast<S>(std::pow(2, exponent));
            const S limit = size / (1000 * epsilon);
            for (const S factor : {S(0.5), S(0.95), S(1.05), S(2)}) {
                Surface<S> triangle;  // equilateral: the mean edge is `size`, up to the coarse coordinate
                triangle.add(Vector3<S>(factor * limit, 0, 0));
                triangle.add(Vector3<S>(factor * limit, size, 0));
                triangle.add(Vector3<S>(factor * limit, size / 2, size * std::sqrt(S(0.75))));
                triangle.add(0, 1, 2);
                CHECK(refusal_of(triangle).empty() == (factor < 1));
            }
        }
    }
}

TEMPLATE_TEST_CASE("meshes of a micrometre to a thousand kilometres are accepted", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    for (const double size : {1e-6, 1e-3, 1.0, 1e3, 1e6}) {
        CAPTURE(size);
        const auto mesh = icosphere<S>({.radius = size, .subdivisions = 3});
        CHECK(mesh.vertex_count() == 642);
        Points<S> x = mesh.positions();
        x.colwise() += Vector3<S>(static_cast<S>(1e6 * size), 0, 0).eigen();
        const bool accepted = test::refusal([&] { TriangleMesh<S> moved(x, mesh.triangles()); }).empty();
        CHECK(accepted == (std::is_same_v<S, double>));
    }
}

TEMPLATE_TEST_CASE("a mesh without any area is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const Vector3<S> start = random.vector<S>(), along = random.unit_vector<S>();
        for (Index v = 0; v < surface.vertex_count(); ++v) {
            surface.x.col(v) = start + random.number<S>(-1, 1) * along;
        }
        CHECK(refusal_of(surface) == "TriangleMesh: all vertices of each triangle are on one line, expected a surface");
        surface.x = start.eigen().replicate(1, surface.vertex_count());
        CHECK(refusal_of(surface) ==
              "TriangleMesh: all vertices of each triangle are at one point, expected a surface");
        surface.x.setZero();
        CHECK(refusal_of(surface) ==
              "TriangleMesh: all vertices of each triangle are at one point, expected a surface");
    }
}

TEMPLATE_TEST_CASE("two triangles with the same vertices are refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const Index f = random.index(surface.triangle_count()), k = random.index(3);
        const auto corner = [&](Index i) { return surface.triangles((k + i) % 3, f); };
        const Index g = surface.add(corner(0), corner(1), corner(2));
        const std::string message = "TriangleMesh: triangles " + text(f) + " and " + text(g) +
                                    " name the same vertices " + vertices_of(surface, f) + ", expected one of them";
        CHECK(refusal_of(surface) == message);
        surface.turn(g);
        CHECK(refusal_of(surface) == message);
    }
    Surface<S> leaf;  // both sides of one triangle
    for (const auto& x : {Vector3<S>(0, 0, 0), Vector3<S>(1, 0, 0), Vector3<S>(0, 1, 0)}) leaf.add(x);
    leaf.add(0, 1, 2);
    leaf.add(0, 2, 1);
    CHECK(refusal_of(leaf) ==
          "TriangleMesh: triangles 0 and 1 name the same vertices 0, 1 and 2, expected one of them");
}

TEMPLATE_TEST_CASE("an edge with more than two triangles is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const auto [f, g, k] = test::inner_side(surface, random);
        const Index from = surface.triangles(k, f), to = surface.triangles((k + 1) % 3, f);
        const std::string edge = "TriangleMesh: edge " + text(std::min(from, to)) + "-" + text(std::max(from, to));
        const Index apex = surface.add(Vector3<S>(surface.x.col(from) + random.vector<S>()));
        const Index added = surface.add(from, to, apex);
        const std::string message = refusal_of(surface);
        CHECK_THAT(message, Catch::Matchers::StartsWith(edge + " belongs to 3 triangles ("));
        CHECK_THAT(message, Catch::Matchers::EndsWith(" " + text(added) + "), expected 1 or 2"));
        for (const Index h : {f, g}) CHECK_THAT(message, ContainsSubstring(text(h)));

        surface.add(to, from, surface.add(Vector3<S>(surface.x.col(to) + random.vector<S>())));
        CHECK_THAT(refusal_of(surface), Catch::Matchers::StartsWith(edge + " belongs to 4 triangles ("));
        CHECK_THAT(refusal_of(surface), Catch::Matchers::EndsWith(", ...), expected 1 or 2"));
    }
}

TEMPLATE_TEST_CASE("a triangle that is turned against its neighbours is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const Index f = test::inner_side(surface, random)[0];
        surface.turn(f);
        const std::string message = refusal_of(surface);
        CHECK_THAT(message,
                   Catch::Matchers::Matches("TriangleMesh: triangles (" + text(f) + " and \\d+|\\d+ and " + text(f) +
                                            ") run along edge \\d+-\\d+ in the same direction, expected "
                                            "opposite ones; turn one of them"));
    }
}

TEMPLATE_TEST_CASE("a one-sided surface is refused as such", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    const std::string message = "TriangleMesh: the surface is one-sided (a Moebius strip), expected two sides";
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto refused = [&](Surface<S> surface) {
            for (Index f = 0; f < surface.triangle_count(); ++f) {
                if (random.chance(0.3)) surface.turn(f);
            }
            if (random.chance(0.5)) surface.add(test::random_surface<S>(random));
            return refusal_of(test::shuffled(surface, random));
        };
        CHECK(refused(test::moebius_strip<S>(3 + random.index(20))) == message);
        CHECK(refused(test::klein_bottle<S>(3 + random.index(8), 3 + random.index(8))) == message);
    }
    CHECK(accepted_unchanged(test::klein_bottle<S>(8, 5, false)));
}

TEMPLATE_TEST_CASE("a vertex that joins surfaces without an edge is refused", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        const Surface<S> other = test::random_surface<S>(random);
        const Index v = random.index(surface.vertex_count());
        const Index w = surface.vertex_count() + random.index(other.vertex_count());
        const Index first_other = surface.triangle_count();
        surface.add(other);
        Index f = no_index, g = no_index;
        for (Index h = surface.triangle_count() - 1; h >= 0; --h) {
            for (Index k = 0; k < 3; ++k) {
                if (surface.triangles(k, h) == w) surface.triangles(k, h) = v;
                if (surface.triangles(k, h) == v) (h < first_other ? f : g) = h;
            }
        }
        CHECK(refusal_of(surface) == "TriangleMesh: vertex " + text(v) + " joins triangles " + text(f) + " and " +
                                         text(g) + ", which no edges connect around it, expected one fan of triangles");
    }
    Surface<S> bow_tie;
    for (const auto& x : {Vector3<S>(0, 0, 0), Vector3<S>(1, 1, 0), Vector3<S>(1, -1, 0), Vector3<S>(-1, 1, 0),
                          Vector3<S>(-1, -1, 0)}) {
        bow_tie.add(x);
    }
    bow_tie.add(0, 2, 1);
    bow_tie.add(0, 3, 4);
    CHECK(refusal_of(bow_tie) ==
          "TriangleMesh: vertex 0 joins triangles 0 and 1, which no edges connect around it, expected one fan of "
          "triangles");
}

TEST_CASE("what is accepted is what CGAL takes for a mesh", "[mesh][cgal]") {
    // Random triangles thrown in and out of a mesh; CGAL takes two sides of one triangle for a surface, we do not.
    std::array<int, 2> counts{};
    for (int seed = 1; seed <= cases(4000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> surface =
            random.chance(0.5) ? test::tetrahedron<double>() : test::random_open_surface<double>(random);
        for (Index change = random.index(5); change > 0; --change) {
            const Index kind = random.index(4), f = random.index(surface.triangle_count());
            const auto order = test::random_order(surface.vertex_count(), random);
            if (kind == 0 && surface.triangle_count() > 1) surface.remove_triangle(f);
            if (kind == 1) surface.add(order[0], order[1], order[2]);
            if (kind == 2) surface.turn(f);
            if (kind == 3) {
                const Index k = random.index(3), apex = surface.add(random.vector());
                surface.add(surface.triangles(k, f), apex, surface.triangles((k + 1) % 3, f));
            }
        }
        std::set<std::set<Index>> different;
        for (const auto& corner : surface.triangles.colwise()) different.insert({corner[0], corner[1], corner[2]});
        const bool duplicates = static_cast<Index>(different.size()) < surface.triangle_count();
        const bool accepted = refusal_of(surface).empty();
        REQUIRE(accepted == (!duplicates && test::cgal_takes_for_mesh(surface.triangles)));
        ++counts[accepted ? 1 : 0];
    }
    CHECK(counts[0] > cases(500));
    CHECK(counts[1] > cases(500));
}

TEMPLATE_TEST_CASE("what is odd but valid is accepted as it is", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    Surface<S> one = test::tetrahedron<S>();
    one.triangles.conservativeResize(3, 1);
    CHECK(accepted_unchanged(one));  // one triangle, and an isolated vertex

    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> surface = test::random_surface<S>(random);
        const S size = (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();

        Surface<S> odd = surface;
        odd.triangles.row(0).swap(odd.triangles.row(1));
        CHECK(accepted_unchanged(odd));  // inward

        odd = surface;
        odd.add(test::random_surface<S>(random));
        CHECK(accepted_unchanged(odd));  // several components

        odd = surface;
        odd.add(surface);
        odd.x.rightCols(surface.x.cols()) *= S(0.5);
        CHECK(accepted_unchanged(odd));  // one inside the other

        odd = surface;
        for (Index i = 0; i < 3; ++i) odd.add(random.vector<S>());
        CHECK(accepted_unchanged(odd));  // isolated vertices

        odd = surface;
        odd.add(surface);
        CHECK(accepted_unchanged(odd));  // coincident vertices, all of them

        const Index f = random.index(surface.triangle_count());
        const Vector3<S> a = surface.x.col(surface.triangles(0, f)), b = surface.x.col(surface.triangles(1, f));
        odd = surface;
        odd.x.col(surface.triangles(1, f)) = a;
        CHECK(accepted_unchanged(odd));  // an edge of length 0
        odd.x.col(surface.triangles(1, f)) = a * (1 + std::numeric_limits<S>::epsilon());
        CHECK(accepted_unchanged(odd));  // nearly

        for (const S height : {S(0), S(1e-30), S(1e-12), S(1e-6)}) {  // no area, needle, cap
            odd = surface;
            odd.x.col(surface.triangles(2, f)) = (a + b) / 2 + size * height * random.unit_vector<S>();
            CHECK(accepted_unchanged(odd));
        }
        odd = surface;
        odd.x.row(2).setConstant(S(0.1) * size);
        CHECK(accepted_unchanged(odd));  // flat, closed or not
    }
}

TEMPLATE_TEST_CASE("a vertex may have a hundred thousand triangles", "[mesh]", TEST_SCALARS) {
    auto fan = test::fan<TestType>(100'000);
    CHECK(accepted_unchanged(fan));
    Random random(1);
    CHECK(accepted_unchanged(test::shuffled(fan, random)));

    fan.remove_triangle(5);
    CHECK(accepted_unchanged(fan));
    fan.remove_triangle(50'000);
    CHECK_THAT(refusal_of(fan), ContainsSubstring("TriangleMesh: vertex 0 joins triangles"));
}
