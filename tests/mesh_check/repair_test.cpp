// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>
#include <membrane/surface/shapes.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using test::Surface;

namespace {

template <class S>
RepairedMesh<S> repaired(const Surface<S>& surface, const RepairOptions& options) {
    return repair(surface.x, surface.triangles, options);
}

template <class S>
bool same(const RepairedMesh<S>& mesh, const Surface<S>& surface) {
    return test::same_bits(mesh.positions, surface.x) && mesh.triangles == surface.triangles;
}

template <class S>
Surface<S> unit_ball() {
    return test::surface_of(icosphere<S>({.radius = 1, .subdivisions = 1}));
}

/// Whether two triangles have the same vertices in the same order, whichever comes first.
bool same_turn(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
    for (Eigen::Index k = 0; k < 3; ++k) {
        if (a[0] == b[k]) return a[1] == b[(k + 1) % 3] && a[2] == b[(k + 2) % 3];
    }
    return false;
}

/// As random as its bits, or a mesh with all that can be wrong with one.
template <class S>
Surface<S> broken_surface(Random& random) {
    Surface<S> surface = test::random_surface<S>(random);
    for (Index change = random.index(8); change > 0; --change) {
        const Index f = random.index(surface.triangle_count());
        const auto order = test::random_order(surface.vertex_count(), random);
        switch (random.index(6)) {
            case 0: surface.turn(f); break;
            case 1: surface.add(order[0], order[1], order[2]); break;
            case 2: surface.triangles(random.index(3), f) = order[0]; break;
            case 3: surface.add(surface.triangles(1, f), surface.triangles(0, f), surface.triangles(2, f)); break;
            case 4: surface.x.col(order[0]) = surface.x.col(order[1]); break;
            default: surface.x(random.index(3), order[0]) = std::numeric_limits<S>::quiet_NaN();
        }
    }
    return surface;
}

}  // namespace

TEMPLATE_TEST_CASE("repair does nothing unasked", "[mesh]", TEST_SCALARS) {
    using S = TestType;
    const RepairOptions everything{.weld = 0.0,
                                   .drop_repeated = true,
                                   .drop_zero_area = true,
                                   .drop_duplicates = true,
                                   .orient = true,
                                   .split_vertices = true,
                                   .flip_inward = true,
                                   .drop_isolated = true};
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> broken = broken_surface<S>(random);
        REQUIRE(same(repaired(broken, {}), broken));
        REQUIRE(to_string(repaired(broken, {}).report) == "no changes");
        // Without a defect the repair changes nothing.
        const Surface<S> valid = test::random_surface<S>(random);
        const auto kept = repaired(valid, everything);
        REQUIRE(same(kept, valid));
        REQUIRE(to_string(kept.report) == "no changes");
        for (Index v = 0; v < valid.vertex_count(); ++v) REQUIRE(kept.vertices[static_cast<std::size_t>(v)] == v);
        for (Index f = 0; f < valid.triangle_count(); ++f) {
            REQUIRE(kept.source_triangles[static_cast<std::size_t>(f)] == f);
        }
    }
}

TEMPLATE_TEST_CASE("each kind that can be repaired is, and nothing else", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= cases(40) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> given = test::random_surface<S>(random);
        const Index f = random.index(given.triangle_count()), k = random.index(3);
        const Index a = given.triangles(k, f), b = given.triangles((k + 1) % 3, f), c = given.triangles((k + 2) % 3, f);

        Surface<S> bad = given;
        bad.add(a, b, a);
        bad.add(b, b, b);
        auto result = repaired(bad, {.drop_repeated = true});
        CHECK(same(result, given));
        CHECK(to_string(result.report) == "dropped 2 triangles with a repeated vertex");

        bad = given;
        bad.add(b, c, a);
        bad.add(c, b, a);
        result = repaired(bad, {.drop_duplicates = true});
        CHECK(same(result, given));
        CHECK(to_string(result.report) == "dropped 2 duplicate triangles");

        bad = given;
        bad.add(Vector3<S>(S(9) * random.vector<S>()));
        result = repaired(bad, {.drop_isolated = true});
        CHECK(same(result, given));
        CHECK(to_string(result.report) == "dropped 1 isolated vertices");

        bad = given;
        const Index d = bad.add(Vector3<S>(bad.x.col(a))), e = bad.add(Vector3<S>(bad.x.col(a)));
        bad.add(d, a, e);  // on one point
        result = repaired(bad, {.drop_zero_area = true, .drop_isolated = true});
        CHECK(same(result, given));
        CHECK(to_string(result.report) == "dropped 1 triangles without area, dropped 2 isolated vertices");

        // Every corner with a vertex of its own, as in files that know no indices.
        Surface<S> soup;
        for (Index g = 0; g < given.triangle_count(); ++g) {
            std::array<Index, 3> corner{};
            for (Index i = 0; i < 3; ++i) {
                corner[static_cast<std::size_t>(i)] = soup.add(Vector3<S>(given.x.col(given.triangles(i, g))));
            }
            soup.add(corner[0], corner[1], corner[2]);
        }
        const auto welded = repaired(soup, {.weld = 0.0});
        CHECK(welded.positions.cols() == given.vertex_count());
        CHECK(welded.report.welded == soup.vertex_count() - given.vertex_count());
        CHECK(validate(welded.positions, welded.triangles).empty());
        for (Index g = 0; g < given.triangle_count(); ++g) {
            for (Index i = 0; i < 3; ++i) {
                CHECK(welded.positions.col(welded.triangles(i, g)) == given.x.col(given.triangles(i, g)));
            }
        }
        const double tolerance = 1e-5 * static_cast<double>(given.x.cwiseAbs().maxCoeff());
        soup.x = test::jittered(soup.x, static_cast<S>(tolerance / 4), random);
        CHECK(repaired(soup, {.weld = 0.0}).report.welded < soup.vertex_count() - given.vertex_count());
        CHECK(repaired(soup, {.weld = tolerance}).positions.cols() == given.vertex_count());
        CHECK(repaired(soup, {.weld = 1e3}).positions.cols() == 1);

        bad = given;
        Index turned = 0;
        for (Index g = 0; g < given.triangle_count(); ++g) {
            if (2 * turned + 2 >= given.triangle_count() || !random.chance(0.3)) continue;
            bad.turn(g);
            ++turned;
        }
        result = repaired(bad, {.orient = true});
        CHECK(result.report.reversed == turned);
        CHECK(validate(result.positions, result.triangles).valid());
        CHECK(validate(result.positions, result.triangles).facts.volume ==
              Approx(validate(given.x, given.triangles).facts.volume));
    }
}

TEMPLATE_TEST_CASE("whole components are turned outward, and fans parted", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= cases(40) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> ball = test::random_closed_surface<S>(random);
        ball.triangles.row(0).swap(ball.triangles.row(1));
        auto result = repaired(ball, {.flip_inward = true});
        CHECK(result.report.flipped == ball.triangle_count());
        CHECK(validate(result.positions, result.triangles).empty());
        for (Index f = 0; f < ball.triangle_count(); ++f) CHECK(result.triangles(0, f) == ball.triangles(0, f));
        // An open surface has no inside, and stays.
        ball.remove_triangle(0);
        CHECK(repaired(ball, {.flip_inward = true}).report.flipped == 0);

        Surface<S> joined = test::random_surface<S>(random);
        const Surface<S> other = test::random_surface<S>(random);
        const Index v = random.index(joined.vertex_count());
        const Index w = joined.vertex_count() + random.index(other.vertex_count());
        joined.add(other);
        for (Index& corner : joined.triangles.reshaped()) corner = corner == w ? v : corner;
        CHECK(validate(joined.x, joined.triangles).count(non_manifold_vertex) == 1);
        result = repaired(joined, {.split_vertices = true});
        CHECK(result.report.split == 1);
        CHECK(result.vertices.back() == v);
        CHECK(test::same_bits(Points<S>(result.positions.leftCols(joined.vertex_count())), joined.x));
        CHECK(validate(result.positions, result.triangles).valid());
        for (Index i = 0; i < 3; ++i) {
            for (Index f = 0; f < joined.triangle_count(); ++f) {
                CHECK(result.vertices[static_cast<std::size_t>(result.triangles(i, f))] == joined.triangles(i, f));
            }
        }

        Surface<S> strip = test::moebius_strip<S>(3 + random.index(9));  // which no turning helps
        CHECK(same(repaired(strip, {.orient = true}), strip));
    }
}

TEMPLATE_TEST_CASE(
    "triangles of a closed component, or one with a small hole, are turned to face outward, however "
    "many are wrong",
    "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(60) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        // Some closed surfaces side by side, one inside the last of them, and one with a hole.
        Surface<S> good;
        const Index count = 1 + random.index(3);
        std::size_t parts = 0;
        std::vector<std::size_t> part_of;
        const auto add = [&](Surface<S> part, S size, S at) {
            for (Eigen::Index v = 0; v < part.x.cols(); ++v) {
                part.x.col(v) = size * part.x.col(v) + Vector3<S>(at, 0, 0);
            }
            part_of.insert(part_of.end(), static_cast<std::size_t>(part.triangle_count()), parts++);
            good.add(part);
        };
        for (Index i = 0; i < count; ++i) add(unit_ball<S>(), 1, static_cast<S>(4 * i));
        add(unit_ball<S>(), S(0.3), static_cast<S>(4 * count - 4));
        Surface<S> open = unit_ball<S>();
        if (random.chance(0.5)) {
            open.remove_triangle(3);
        } else {  // all around a vertex
            for (Index f = open.triangle_count() - 1; f >= 0; --f) {
                if ((open.triangles.col(f).array() == 7).any()) open.remove_triangle(f);
            }
        }
        add(open, 1, -4);
        REQUIRE(validate(good.x, good.triangles).facts.facing == Facing::outward);

        Surface<S> bad = good;
        Index turned = 0;
        std::vector<Index> turned_of(parts, 0), size_of(parts, 0);
        std::vector<double> chance;
        for (std::size_t i = 0; i < parts; ++i) chance.push_back(random.number(0.0, 1.1));
        for (Index f = 0; f < good.triangle_count(); ++f) {
            const auto part = part_of[static_cast<std::size_t>(f)];
            ++size_of[part];
            if (!random.chance(chance[part])) continue;
            bad.turn(f);
            ++turned_of[part];
        }
        const auto result = repaired(bad, {.orient = true});
        for (Index f = 0; f < good.triangle_count(); ++f) {
            const auto part = part_of[static_cast<std::size_t>(f)];
            // Those that agree as given, though inward, are another option's.
            const bool agrees = turned_of[part] == size_of[part];
            const auto& expected = agrees ? bad.triangles : good.triangles;
            REQUIRE(same_turn(result.triangles.col(f), expected.col(f)));
        }
        for (std::size_t i = 0; i < parts; ++i) turned += turned_of[i] == size_of[i] ? 0 : turned_of[i];
        CHECK(result.report.reversed == turned);
        const auto outward = repaired(bad, {.orient = true, .flip_inward = true});
        CHECK(validate(outward.positions, outward.triangles).facts.facing == Facing::outward);
        CHECK(validate(outward.positions, outward.triangles).count(MeshDefect::inward) == 0);
        CHECK(validate(outward.positions, outward.triangles).count(MeshDefect::nested_components) == 1);
    }
}

TEMPLATE_TEST_CASE("whatever is broken, repair comes back with what it says", "[mesh][bad]", TEST_SCALARS) {
    using S = TestType;
    using enum MeshDefect;
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Surface<S> broken = broken_surface<S>(random);
        const double distance = random.chance(0.5) ? 0.0 : 1e-3;
        const RepairOptions options{.weld = random.chance(0.5) ? std::optional<double>(distance) : std::nullopt,
                                    .drop_repeated = random.chance(0.5),
                                    .drop_zero_area = random.chance(0.5),
                                    .drop_duplicates = random.chance(0.5),
                                    .orient = random.chance(0.5),
                                    .split_vertices = random.chance(0.5),
                                    .flip_inward = random.chance(0.5),
                                    .drop_isolated = random.chance(0.5)};
        const auto result = repaired(broken, options);
        const MeshReport before = validate(broken.x, broken.triangles);
        const MeshReport after = validate(result.positions, result.triangles);
        INFO(to_string(before) << to_string(result.report) << "\n" << to_string(after));
        REQUIRE(result.vertices.size() == static_cast<std::size_t>(result.positions.cols()));
        REQUIRE(result.source_triangles.size() == static_cast<std::size_t>(result.triangles.cols()));
        REQUIRE(after.count(index_out_of_range) == 0);
        if (options.weld && result.report.split == 0) REQUIRE(after.count(coincident_vertices) == 0);
        if (options.drop_repeated) REQUIRE(after.count(repeated_vertex) == 0);
        if (options.drop_zero_area && !options.weld) REQUIRE(after.count(zero_area) == 0);
        if (options.drop_duplicates) REQUIRE(after.count(duplicate_triangle) + after.count(double_sided_triangle) == 0);
        if (options.orient && after.count(one_sided) == 0) REQUIRE(after.count(inconsistent_orientation) == 0);
        if (options.flip_inward) REQUIRE(after.count(inward) == 0);
        if (options.drop_isolated && options.drop_repeated) REQUIRE(after.count(isolated_vertex) == 0);
        for (std::size_t v = 0; v < result.vertices.size(); ++v) {
            const Points<S> from = broken.x.col(result.vertices[v]);
            REQUIRE(test::same_bits(Points<S>(result.positions.col(static_cast<Index>(v))), from));
        }
        // A second repair changes nothing, no bad coordinate is doubled, and no vertex is left without triangle.
        const auto again = repair(result.positions, result.triangles, options);
        REQUIRE(test::same_bits(again.positions, result.positions));
        REQUIRE(again.triangles == result.triangles);
        REQUIRE(after.count(coordinate_not_finite) <= before.count(coordinate_not_finite));
        const auto is_named = [](const auto& triangles, Index v) { return (triangles.array() == v).any(); };
        REQUIRE(result.new_vertices.size() == static_cast<std::size_t>(broken.vertex_count()));
        for (Index v = 0; v < broken.vertex_count(); ++v) {
            const Index now = result.new_vertices[static_cast<std::size_t>(v)];
            if (now == no_index) continue;
            const Index from = result.vertices[static_cast<std::size_t>(now)];
            REQUIRE((from == v || options.weld));
            if (from == v && is_named(broken.triangles, v)) REQUIRE(is_named(result.triangles, now));
            if (options.weld == 0.0)
                REQUIRE((!(broken.x.col(v).array() == broken.x.col(v).array()).all() ||
                         broken.x.col(from) == broken.x.col(v)));
        }
        for (Index v = 0; options.drop_isolated && v < result.positions.cols(); ++v) {
            REQUIRE(is_named(result.triangles, v));
        }
        const auto dropped = result.report.repeated + result.report.zero_area + result.report.duplicates;
        REQUIRE(result.triangles.cols() == broken.triangle_count() - dropped);
        REQUIRE(result.positions.cols() ==
                broken.vertex_count() - result.report.welded - result.report.isolated + result.report.split);
    }
}

TEST_CASE("what repair cannot work with is refused", "[mesh][bad]") {
    const Surface<double> t = test::tetrahedron<double>();
    Triangles wrong = t.triangles;
    wrong(1, 2) = 4;
    CHECK(test::refusal([&] { (void)repair(t.x, wrong, {}); }) == "repair: triangle 2 names vertex 4, expected 0 to 3");
    CHECK(test::refusal([&] { (void)repair(t.x, Eigen::MatrixXi(4, 5), {}); }) ==
          "repair: triangles must be 3 x F, one triangle a column, got 4 x 5");
    for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        CHECK_THAT(test::refusal([&] { (void)repair(t.x, t.triangles, {.weld = bad}); }),
                   ContainsSubstring("repair: weld must be finite and not negative [m], got "));
    }
    const auto nothing = repair(Points<double>(3, 0), Triangles(3, 0), {.weld = 1, .split_vertices = true});
    CHECK(nothing.positions.cols() == 0);
    CHECK(nothing.triangles.cols() == 0);
    const std::vector<double> xyz(t.x.data(), t.x.data() + 12);
    const std::vector<Index> corners(t.triangles.data(), t.triangles.data() + 12);
    CHECK(repair(std::span(xyz), std::span(corners), {.orient = true}).triangles == t.triangles);
}

TEST_CASE("a vertex that is split is where it was, and its body as large", "[mesh][bad]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> two = test::tetrahedron<double>(), other = two;
        other.x *= -1;  // mirrored
        for (Index f = 0; f < 4; ++f) other.turn(f);
        two.add(other);
        for (Index& v : two.triangles.reshaped()) v = v == 4 ? 0 : v;  // the corner at 0 is of both
        two.x.colwise() += (10 * random.vector()).eigen();
        const auto split = repaired(two, {.split_vertices = true, .flip_inward = true});
        CHECK(split.report.split == 1);
        CHECK(split.report.flipped == 0);
    }
}

TEST_CASE("two surfaces of thousands of vertices are welded completely", "[mesh]") {
    const auto one = test::surface_of(icosphere({.radius = 1, .subdivisions = 4}));
    const Index count = one.vertex_count();
    auto two = one;
    two.add(one);
    two.x.rightCols(count).array() += 1e-10;
    const auto welded = repair(two.x, two.triangles, {.weld = 1e-9});
    CHECK(welded.report.complete);
    CHECK(welded.report.welded == count);
}
