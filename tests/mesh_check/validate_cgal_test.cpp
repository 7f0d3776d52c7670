// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include <CGAL/Polygon_mesh_processing/border.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/manifoldness.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Polygon_mesh_processing/shape_predicates.h>
#include <CGAL/boost/graph/helpers.h>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/cgal_mesh.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using test::Surface;
using enum MeshDefect;
namespace PMP = CGAL::Polygon_mesh_processing;

namespace {

template <class S>
std::vector<test::CgalPoint> points_of(const Surface<S>& surface) {
    std::vector<test::CgalPoint> points;
    for (Index v = 0; v < surface.vertex_count(); ++v) points.push_back(test::cgal_point(point(surface.x, v)));
    return points;
}

template <class S>
MeshReport report_of(const Surface<S>& surface) {
    return validate(surface.x, surface.triangles, {.max_findings_per_kind = 1'000'000});
}

template <class S>
test::CgalMesh mesh_of(const Surface<S>& surface) {
    return test::cgal_mesh(surface.x, surface.triangles);
}

/// Triangles in two bodies of which one is pushed into the other, or a body that is crumpled.
template <class S>
Surface<S> random_crossing(Random& random) {
    Surface<S> surface = test::random_surface<S>(random);
    const S size = (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();
    if (random.chance(0.5)) {
        Surface<S> other = surface;
        other.x.colwise() += random.number<S>(0, S(1.5)) * size * random.unit_vector<S>().eigen();
        surface.add(other);
    } else {
        surface.x = test::jittered(surface.x, random.number<S>(0, S(0.4)) * size, random);
    }
    return surface;
}

}  // namespace

TEMPLATE_TEST_CASE("repeated, duplicate, isolated and coincident are those of CGAL", "[mesh][cgal][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_open_surface<S>(random);
        for (Index change = random.index(9); change > 0; --change) {
            const auto order = test::random_order(surface.vertex_count(), random);
            const Index f = random.index(surface.triangle_count());
            const std::array<Index, 3> t{surface.triangles(0, f), surface.triangles(1, f), surface.triangles(2, f)};
            switch (random.index(5)) {
                case 0: surface.add(t[1], t[2], t[0]); break;
                case 1: surface.add(t[1], t[0], t[2]); break;
                case 2: surface.remove_triangle(f); break;
                case 3: surface.x.col(order[0]) = surface.x.col(order[1]); break;
                default: surface.add(order[0], order[1], order[2]);
            }
            if (surface.triangle_count() == 0) surface.add(0, 1, 2);
        }
        const MeshReport report = report_of(surface);
        auto points = points_of(surface);
        auto soup = test::cgal_soup(surface.triangles);
        CHECK(PMP::merge_duplicate_points_in_polygon_soup(points, soup) == report.count(coincident_vertices));
        const auto welded = repair(surface.x, surface.triangles, {.weld = 0.0});
        CHECK(points.size() == static_cast<std::size_t>(welded.positions.cols()));
        soup = test::cgal_soup(surface.triangles);
        points = points_of(surface);
        CHECK(PMP::remove_isolated_points_in_polygon_soup(points, soup) == report.count(isolated_vertex));
        if (report.count(coincident_vertices) > 0) continue;  // CGAL distinguishes triangles by their points
        soup = test::cgal_soup(surface.triangles);
        points = points_of(surface);
        const auto duplicates = PMP::merge_duplicate_polygons_in_polygon_soup(points, soup);
        CHECK(duplicates == report.count(duplicate_triangle) + report.count(double_sided_triangle));
        CHECK(duplicates == static_cast<std::size_t>(
                                repair(surface.x, surface.triangles, {.drop_duplicates = true}).report.duplicates));
    }
}

TEMPLATE_TEST_CASE("a mesh of whole triangles is valid where CGAL takes it for one", "[mesh][cgal][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    std::array<int, 2> counts{};
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = random.chance(0.5) ? test::tetrahedron<S>() : test::random_open_surface<S>(random);
        for (Index change = random.index(5); change > 0; --change) {
            const auto order = test::random_order(surface.vertex_count(), random);
            const Index f = random.index(surface.triangle_count()), k = random.index(3);
            switch (random.index(4)) {
                case 0: surface.turn(f); break;
                case 1: surface.add(order[0], order[1], order[2]); break;
                case 2: surface.triangles(k, f) = order[0]; break;
                default:
                    const Index apex = surface.add(random.vector<S>());
                    surface.add(surface.triangles(k, f), apex, surface.triangles((k + 1) % 3, f));
            }
        }
        const MeshReport report = report_of(surface);
        const bool takes = PMP::is_polygon_soup_a_polygon_mesh(test::cgal_soup(surface.triangles));
        const bool alike = report.count(double_sided_triangle) == 0;  // two sides of a sheet CGAL takes for a body
        if (alike) REQUIRE(report.valid() == takes);
        ++counts[report.valid() ? 1 : 0];

        // What can be turned to agree, CGAL turns; what is one-sided it has to cut apart.
        if (report.count(repeated_vertex) + report.count(duplicate_triangle) + report.count(non_manifold_edge) > 0)
            continue;
        if (!alike) continue;
        auto points = points_of(surface);
        auto soup = test::cgal_soup(surface.triangles);
        const bool whole = PMP::orient_polygon_soup(points, soup);
        REQUIRE(whole == (report.count(one_sided) + report.count(non_manifold_vertex) == 0));
        const auto turned = repair(surface.x, surface.triangles, {.orient = true, .split_vertices = true});
        if (report.count(one_sided) == 0) {
            REQUIRE(validate(turned.positions, turned.triangles).valid());
            REQUIRE(PMP::is_polygon_soup_a_polygon_mesh(test::cgal_soup(turned.triangles)));
        }
    }
    CHECK(counts[0] > cases(100));
    CHECK(counts[1] > cases(50));
    for (const Index n : {3, 4, 7, 12}) {
        for (const Surface<S>& one_sided_surface : {test::moebius_strip<S>(n), test::klein_bottle<S>(n, n + 1)}) {
            CHECK(report_of(one_sided_surface).count(one_sided) == 1);
            auto points = points_of(one_sided_surface);
            auto soup = test::cgal_soup(one_sided_surface.triangles);
            CHECK(!PMP::orient_polygon_soup(points, soup));
        }
    }
}

TEST_CASE("vertices that join fans are those that CGAL calls non-manifold", "[mesh][cgal][bad]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> surface = seed % 2 == 0 ? test::tetrahedron<double>() : test::random_surface<double>(random);
        const Index own = surface.vertex_count();
        surface.add(seed % 2 == 0 ? test::tetrahedron<double>() : test::random_surface<double>(random));
        const Index v = random.index(own), w = own + random.index(surface.vertex_count() - own);
        test::CgalMesh mesh = mesh_of(surface);
        using Vertex = test::CgalMesh::Vertex_index;
        const auto handle = [](Index vertex) { return Vertex(static_cast<Vertex::size_type>(vertex)); };
        const auto around = CGAL::halfedges_around_target(handle(w), mesh);
        const std::vector<test::CgalMesh::Halfedge_index> into(around.begin(), around.end());
        for (const auto& edge : into) set_target(edge, handle(v), mesh);
        for (Index& corner : surface.triangles.reshaped()) corner = corner == w ? v : corner;
        std::vector<test::CgalMesh::Halfedge_index> at;
        PMP::non_manifold_vertices(mesh, std::back_inserter(at));
        const MeshReport report = report_of(surface);
        CHECK(report.count(non_manifold_vertex) == 1);
        REQUIRE(!at.empty());
        for (const auto& edge : at) CHECK(static_cast<Index>(target(edge, mesh)) == report.findings[0].vertices[0]);
        const auto split = repair(surface.x, surface.triangles, {.split_vertices = true});
        at.clear();
        PMP::non_manifold_vertices(test::cgal_mesh(split.positions, split.triangles), std::back_inserter(at));
        CHECK(at.empty());
    }
}

TEMPLATE_TEST_CASE("degenerate triangles, needles and caps are those of CGAL", "[mesh][cgal][bad]", TEST_SCALARS) {
    using S = TestType;
    std::array<int, 3> counts{};
    const double flattest = 179.999 * std::numbers::pi / 180;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        // Corners on a grid, which is scaled by up to a million along each axis.
        Surface<S> one;
        const Vector3<S> stretch(S(1), std::exp2(S(random.index(4) * -8)), std::exp2(S(random.index(4) * -8)));
        for (Index v = 0; v < 3; ++v) {
            one.add(Vector3<S>(
                stretch.cwiseProduct(Vector3<S>(S(random.index(5)), S(random.index(5)), S(random.index(3))))));
        }
        one.add(0, 1, 2);
        one.add(test::tetrahedron<S>());
        one.x.rightCols(4).array() += S(8);
        const MeshReport report = report_of(one);
        if (!report.valid()) continue;
        const test::CgalMesh mesh = mesh_of(one);
        const test::CgalMesh::Face_index face(0);
        const bool degenerate = PMP::is_degenerate_triangle_face(face, mesh);
        REQUIRE(report.count(zero_area) == (degenerate ? 1 : 0));
        counts[0] += degenerate ? 1 : 0;
        if (degenerate) continue;
        const auto none = test::CgalMesh::null_halfedge();
        // A hair to either side, for CGAL rounds in other places.
        const bool surely_needle = PMP::is_needle_triangle_face(face, mesh, 1.001e6) != none;
        const bool maybe_needle = PMP::is_needle_triangle_face(face, mesh, 0.999e6) != none;
        if (surely_needle == maybe_needle) REQUIRE(report.count(needle) == (surely_needle ? 1 : 0));
        const bool surely_cap = PMP::is_cap_triangle_face(face, mesh, std::cos(flattest) - 1e-11) != none;
        const bool maybe_cap = PMP::is_cap_triangle_face(face, mesh, std::cos(flattest) + 1e-11) != none;
        if (surely_cap == maybe_cap) REQUIRE(report.count(cap) == (surely_cap ? 1 : 0));
        counts[1] += surely_needle ? 1 : 0;
        counts[2] += surely_cap ? 1 : 0;
    }
    for (const int count : counts) CHECK(count >= cases(20));
}

TEMPLATE_TEST_CASE("triangles that meet are those that CGAL finds", "[mesh][cgal][bad]", TEST_SCALARS) {
    using S = TestType;
    std::array<int, 2> counts{};
    for (int seed = 1; seed <= cases(150) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = random_crossing<S>(random);
        // Often on a coarse grid, where corners touch and planes coincide.
        const S size = surface.x.cwiseAbs().maxCoeff();
        const bool coarse = random.chance(0.5);
        if (coarse) surface.x = (surface.x * (S(4) / size)).array().round() * (size / S(4));
        const MeshReport report = report_of(surface);
        if (report.count(zero_area) > 0 || report.count(coincident_vertices) > 0) continue;
        std::vector<std::pair<test::CgalMesh::Face_index, test::CgalMesh::Face_index>> pairs;
        PMP::self_intersections(mesh_of(surface), std::back_inserter(pairs));
        REQUIRE(report.complete);
        REQUIRE(report.count(self_intersection) == pairs.size());
        ++counts[pairs.empty() ? 0 : 1];
    }
    CHECK(counts[1] >= cases(20));
    CHECK(counts[0] >= cases(5));
}

TEST_CASE("triangles on a coarse grid meet as CGAL says", "[mesh][cgal][bad]") {
    std::array<int, 3> shared{};
    for (int seed = 1; seed <= cases(3000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> two;  // with up to two vertices in common
        const Index common = random.index(3), rows = 1 + random.index(3);
        for (Index v = 0; v < 6 - common; ++v) {
            const Vector3<double> place(random.index(4), random.index(4), random.index(rows));
            two.add(Vector3<double>(0.1 * place));
        }
        two.add(0, 1, 2);
        if (common == 0) two.add(3, 4, 5);
        if (common == 1) two.add(0, 3, 4);
        if (common == 2) two.add(1, 0, 3);
        const MeshReport report = report_of(two);
        if (report.count(coincident_vertices) + report.count(zero_area) > 0 || report.facts.triangles != 2) continue;
        if (report.count(all_on_one_line) + report.count(all_at_one_point) > 0) continue;
        test::CgalMesh mesh = mesh_of(two);
        REQUIRE((report.count(self_intersection) > 0) == PMP::does_self_intersect(mesh));
        shared[static_cast<std::size_t>(common)] += report.count(self_intersection) > 0 ? 1 : 0;
    }
    for (const int count : shared) CHECK(count > cases(20));
}

TEMPLATE_TEST_CASE("facts are those of CGAL", "[mesh][cgal]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<S> surface = test::random_surface<S>(random);
        if (random.chance(0.3)) surface = test::with_holes(surface, random);
        if (random.chance(0.2)) surface = test::klein_bottle<S>(3 + random.index(6), 3 + random.index(6), false);
        if (random.chance(0.3)) surface.add(test::random_surface<S>(random));
        if (random.chance(0.3)) surface.triangles.row(0).swap(surface.triangles.row(1));
        const MeshReport report = report_of(surface);
        test::CgalMesh mesh = mesh_of(surface);
        const SurfaceFacts& facts = report.facts;
        CHECK(facts.closed() == CGAL::is_closed(mesh));
        auto part = mesh.template add_property_map<test::CgalMesh::Face_index, std::size_t>("f:part", 0).first;
        const auto parts = static_cast<Index>(PMP::connected_components(mesh, part));
        CHECK(facts.components == parts);
        CHECK((report.count(several_components) > 0) == (parts > 1));
        std::vector<test::CgalMesh::Halfedge_index> borders;
        PMP::extract_boundary_cycles(mesh, std::back_inserter(borders));
        CHECK(static_cast<std::size_t>(facts.borders) == borders.size());
        CHECK(static_cast<std::size_t>(facts.edges) == mesh.number_of_edges());
        const auto named = static_cast<Index>(mesh.number_of_vertices() - report.count(isolated_vertex));
        CHECK(facts.vertices == named);
        const Index euler = named - facts.edges + facts.triangles;
        CHECK(2 * facts.components - 2 * facts.genus - facts.borders == euler);
        CHECK(facts.area == Approx(PMP::area(mesh)));
        if (!facts.closed()) continue;
        CHECK(facts.volume == Approx(PMP::volume(mesh)));
        if (parts > 1 || report.count(self_intersection) > 0) continue;
        CHECK((report.count(inward) == 0) == PMP::is_outward_oriented(mesh));
        CHECK(PMP::does_bound_a_volume(mesh));  // its own, or all the rest
    }
}

TEST_CASE("a ball in a ball bounds no volume, unless it is turned inward", "[mesh][cgal]") {
    for (int seed = 1; seed <= cases(40) + 8; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        Surface<double> surface = test::random_closed_surface<double>(random);
        Surface<double> other = surface;
        const Vector3<double> middle = surface.x.rowwise().mean();
        other.x = (0.4 * (surface.x.colwise() - middle.eigen())).colwise() + middle.eigen();
        surface.add(other);
        CHECK(report_of(surface).count(nested_components) == 1);
        CHECK(!PMP::does_bound_a_volume(mesh_of(surface)));
        const Index half = surface.triangle_count() / 2;
        for (Index f = half; f < 2 * half; ++f) surface.turn(f);
        CHECK(report_of(surface).count(nested_components) == 1);
        CHECK(report_of(surface).count(inward) == 1);
        CHECK(PMP::does_bound_a_volume(mesh_of(surface)));
    }
}
