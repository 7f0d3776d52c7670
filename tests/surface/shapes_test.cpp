// SPDX-License-Identifier: MIT
#include <membrane/surface/shapes.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/triangle.hpp>

#include "support/catch.hpp"
#include "support/cgal.hpp"
#include "support/refusal.hpp"

using namespace membrane;

namespace {

template <class S>
struct EdgeLengths {
    S shortest = std::numeric_limits<S>::infinity(), longest = 0;

    explicit EdgeLengths(const TriangleMesh<S>& mesh) {
        const Adjacency adjacency(mesh);  // named: the edges are its own
        for (const auto& [first, second] : adjacency.edges()) {
            const S length = norm<S>(point(mesh.positions(), first) - point(mesh.positions(), second));
            shortest = std::min(shortest, length);
            longest = std::max(longest, length);
        }
    }
};

/// CGAL's opinion of a shape: valid, manifold, in one piece, without self-intersection, no vertex too many.
template <class S>
test::CgalFacts checked(const TriangleMesh<S>& mesh, int euler) {
    const test::CgalFacts cgal = test::cgal_facts(mesh);
    CHECK(cgal.faces == mesh.triangle_count());
    CHECK(cgal.valid);
    CHECK_FALSE(cgal.intersects_itself);
    CHECK(cgal.euler == euler);
    CHECK(cgal.isolated == 0);
    return cgal;
}

/// Whether every triangle of an open shape faces +z.
template <class S>
bool faces_up(const TriangleMesh<S>& mesh) {
    for (const auto& corner : mesh.triangles().colwise()) {
        const Vector3<S> a = point(mesh.positions(), corner[0]);
        if (!(cross<S>(point(mesh.positions(), corner[1]) - a, point(mesh.positions(), corner[2]) - a).z() > 0))
            return false;
    }
    return true;
}

}  // namespace

TEMPLATE_TEST_CASE("icospheres are closed, outward and on the sphere", "[shapes][cgal]", TEST_SCALARS) {
    using S = TestType;
    const double epsilon = std::numeric_limits<S>::epsilon();
    for (Index level = 0; level <= 4; ++level) {
        CAPTURE(level);
        const double radius = level % 2 == 0 ? 0.01 : 3.0;
        const auto mesh = icosphere<S>({.radius = radius, .subdivisions = level});
        const Index power = Index{1} << (2 * level);
        CHECK(mesh.vertex_count() == 10 * power + 2);
        CHECK(mesh.triangle_count() == 20 * power);
        const Adjacency adjacency(mesh);
        CHECK(adjacency.edges().size() == static_cast<std::size_t>(30 * power));
        CHECK(adjacency.closed());

        const auto cgal = checked(mesh, 2);
        CHECK(cgal.closed);
        CHECK(cgal.outward);
        CHECK(cgal.bounds_a_volume);
        CHECK(cgal.smallest_angle > 50);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Vector3<double> x = point(mesh.positions(), v).template cast<double>();
            REQUIRE(std::abs(norm(x) / radius - 1) < 2 * epsilon);
            REQUIRE(adjacency.neighbours(v).size() == (v < 12 ? 5 : 6));
        }
        // An inscribed surface loses area and volume in proportion to the square of its edges.
        const double edge = EdgeLengths(mesh).longest / radius, pi = std::numbers::pi;
        const double lost_area = 1 - cgal.area / (4 * pi * radius * radius);
        const double lost_volume = 1 - cgal.volume / (4 * pi / 3 * radius * radius * radius);
        CHECK(lost_area > 0);
        CHECK(lost_area < edge * edge / 4);
        CHECK(lost_volume > lost_area);
        CHECK(lost_volume < edge * edge / 2);
        CHECK(EdgeLengths(mesh).longest < S(1.25) * EdgeLengths(mesh).shortest);
    }
}

TEST_CASE("the icosahedron has its closed-form measures", "[shapes][cgal]") {
    const double radius = 2, edge = radius / std::sin(2 * std::numbers::pi / 5);
    const auto mesh = icosphere({.radius = radius, .subdivisions = 0});
    const auto cgal = test::cgal_facts(mesh);
    CHECK(EdgeLengths(mesh).shortest == Approx(edge).epsilon(1e-15));
    CHECK(EdgeLengths(mesh).longest == Approx(edge).epsilon(1e-15));
    CHECK(cgal.area == Approx(5 * std::sqrt(3.0) * edge * edge).epsilon(1e-14));
    CHECK(cgal.volume == Approx(5 * (3 + std::sqrt(5.0)) / 12 * edge * edge * edge).epsilon(1e-14));
}

TEST_CASE("the icosphere is the one that the reference equilibria were computed on", "[shapes]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 3});
    const Vector3<double> held = Vector3<double>(0, 1, std::numbers::phi) / std::hypot(1, std::numbers::phi);
    CHECK(norm<double>(point(mesh.positions(), 0) - held) < 1e-15);
    // Each level keeps the vertices of the one before, and puts the others half way.
    const auto coarse = icosphere({.radius = 1, .subdivisions = 2});
    CHECK(mesh.positions().leftCols(162) == coarse.positions());
    const Adjacency adjacency(coarse);
    const auto edges = adjacency.edges();
    for (std::size_t e = 0; e < edges.size(); ++e) {
        const Vector3<double> middle = point(coarse.positions(), edges[e][0]) + point(coarse.positions(), edges[e][1]);
        REQUIRE(norm<double>(point(mesh.positions(), 162 + static_cast<Index>(e)) - middle / norm(middle)) < 1e-15);
    }
}

TEMPLATE_TEST_CASE("sheets are flat, of their size, and face up", "[shapes][cgal]", TEST_SCALARS) {
    using S = TestType;
    for (const auto& [columns, rows] : {std::array{1, 1}, {1, 7}, {12, 5}, {20, 20}}) {
        CAPTURE(columns, rows);
        const auto mesh = sheet<S>({.width = 0.3, .height = 0.2, .columns = columns, .rows = rows});
        CHECK(mesh.vertex_count() == (columns + 1) * (rows + 1));
        CHECK(mesh.triangle_count() == 2 * columns * rows);
        const auto cgal = checked(mesh, 1);
        CHECK(faces_up(mesh));
        CHECK((mesh.positions().row(2).array() == 0).all());
        CHECK(cgal.area == Approx(0.3 * 0.2));
        for (const auto& [axis, size] : {std::pair{0, S(0.3)}, {1, S(0.2)}}) {
            CHECK(mesh.positions().row(axis).maxCoeff() == size / 2);
            CHECK(mesh.positions().row(axis).minCoeff() == -size / 2);
        }
        CHECK(border(mesh).size() == static_cast<std::size_t>(2 * (columns + rows)));
        const S across = S(0.3) / S(columns), up = S(0.2) / S(rows), diagonal = std::sqrt(across * across + up * up);
        CHECK(EdgeLengths(mesh).shortest == Approx(std::min(across, up)));
        CHECK(EdgeLengths(mesh).longest == Approx(diagonal));
    }
}

TEMPLATE_TEST_CASE("discs are flat, round, and face up", "[shapes][cgal]", TEST_SCALARS) {
    using S = TestType;
    const double radius = 0.05, pi = std::numbers::pi;
    for (const Index rings : {1, 2, 3, 8, 20}) {
        CAPTURE(rings);
        const auto mesh = disc<S>({.radius = radius, .rings = rings});
        CHECK(mesh.vertex_count() == 1 + 3 * rings * (rings + 1));
        CHECK(mesh.triangle_count() == 6 * rings * rings);
        const auto cgal = checked(mesh, 1);
        CHECK(faces_up(mesh));
        CHECK((mesh.positions().row(2).array() == 0).all());
        CHECK((mesh.positions().col(0).array() == 0).all());
        const int corners = 6 * rings;  // the rim is a regular polygon
        CHECK(cgal.area == Approx(corners / 2.0 * radius * radius * std::sin(2 * pi / corners)));
        CHECK(cgal.smallest_angle > 40);

        const Adjacency adjacency(mesh);
        CHECK(adjacency.border_vertices().size() == static_cast<std::size_t>(corners));
        for (const Index v : adjacency.border_vertices()) {
            REQUIRE(v >= mesh.vertex_count() - corners);
            REQUIRE(norm(point(mesh.positions(), v)) == Approx(radius));
        }
        CHECK(EdgeLengths(mesh).shortest > S(0.98 * radius / rings));
        CHECK(EdgeLengths(mesh).longest < S(1.5 * radius / rings));
    }
}

TEMPLATE_TEST_CASE("spherical caps lie on their sphere, with the rim asked for", "[shapes][cgal]", TEST_SCALARS) {
    using S = TestType;
    const double pi = std::numbers::pi;
    struct Case {
        double radius, diameter;
        Index rings;
    };
    for (const auto& [radius, diameter, rings] :
         {Case{7.8e-3, 11.7e-3, 12}, {7.8e-3, 11.7e-3, 1}, {1, 2, 10}, {1, 0.1, 4}, {0.02, 0.03, 24}}) {
        CAPTURE(radius, diameter, rings);
        const auto mesh = spherical_cap<S>({.radius = radius, .diameter = diameter, .rings = rings});
        CHECK(mesh.vertex_count() == 1 + 3 * rings * (rings + 1));
        CHECK(mesh.triangle_count() == 6 * rings * rings);
        const auto cgal = checked(mesh, 1);
        CHECK(faces_up(mesh));
        CHECK(cgal.smallest_angle > 30);
        const double rim_height = std::sqrt(std::max(0.0, radius * radius - diameter * diameter / 4));
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(norm(point(mesh.positions(), v)) == Approx(radius));
            REQUIRE(mesh.positions()(2, v) >= Approx(rim_height).margin(1e-7 * radius));
        }
        CHECK(point(mesh.positions(), 0) == Vector3<S>(0, 0, static_cast<S>(radius)));
        const Adjacency adjacency(mesh);
        CHECK(adjacency.border_vertices().size() == static_cast<std::size_t>(6 * rings));
        for (const Index v : adjacency.border_vertices()) {
            const Vector3<S> x = point(mesh.positions(), v);
            REQUIRE(x.z() == Approx(rim_height).margin(1e-7 * radius));
            REQUIRE(std::hypot(x.x(), x.y()) == Approx(diameter / 2));
        }
        const double cap_area = 2 * pi * radius * (radius - rim_height);
        CHECK(cgal.area < cap_area);
        const double edge = EdgeLengths(mesh).longest / radius;
        CHECK(cgal.area > cap_area * (1 - 0.2 / (rings * rings) - edge * edge / 4));
    }
}

TEST_CASE("shapes are of double unless asked otherwise, with defaults that work", "[shapes]") {
    CHECK(icosphere().vertex_count() == 642);
    CHECK(sheet().triangle_count() == 800);
    CHECK(disc().vertex_count() == 469);
    CHECK(spherical_cap().vertex_count() == 469);
    STATIC_REQUIRE(std::is_same_v<decltype(icosphere()), TriangleMesh<double>>);
    STATIC_REQUIRE(
        std::is_same_v<decltype(icosphere<float>({.radius = 0.01, .subdivisions = 3})), TriangleMesh<float>>);
    // The float shape is the double one, rounded once.
    CHECK(icosphere<float>().positions() == icosphere<double>().positions().cast<float>());
    CHECK(spherical_cap<float>().positions() == spherical_cap<double>().positions().cast<float>());
}

TEMPLATE_TEST_CASE("a refined mesh halves each edge and keeps the vertices", "[shapes]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = sheet<S>({.width = 0.1, .height = 0.06, .columns = 5, .rows = 4});
    const auto finer = refined(mesh);
    const Adjacency before(mesh), after(finer);
    CHECK(finer.triangle_count() == 4 * mesh.triangle_count());
    CHECK(finer.vertex_count() == mesh.vertex_count() + static_cast<Index>(before.edges().size()));
    CHECK(finer.positions().leftCols(mesh.vertex_count()) == mesh.positions());
    CHECK(after.border_vertices().size() == 2 * before.border_vertices().size());
    const EdgeLengths coarse(mesh), fine(finer);
    CHECK(fine.shortest == Approx(coarse.shortest / 2));
    CHECK(fine.longest == Approx(coarse.longest / 2));
    for (const auto& corners : finer.triangles().colwise()) {
        CHECK(area_vector(triangle_at(finer.positions(), corners)).z() == Approx(0.1 * 0.06 / 160));
    }
    // On a sphere, by a function of its own, it is the next icosphere.
    const auto sphere = icosphere<double>({.radius = 1, .subdivisions = 2});
    const auto on_sphere = [](const Vector3<double>& a, const Vector3<double>& b) {
        return Vector3<double>((a + b) / norm<double>(a + b));
    };
    const auto next = icosphere<double>({.radius = 1, .subdivisions = 3});
    CHECK((refined(sphere, on_sphere).positions() - next.positions()).norm() < 1e-12);
    CHECK(refined(sphere, on_sphere).triangles() == next.triangles());
    const auto nowhere = [](const auto&, const auto&) { return Vector3<double>(0, 0, std::nan("")); };
    CHECK_FALSE(test::refusal([&] { (void)refined(mesh, nowhere); }).empty());
}

TEMPLATE_TEST_CASE("options that make no shape are refused", "[shapes][bad]", TEST_SCALARS) {
    using S = TestType;
    using test::refusal;
    const double infinity = std::numeric_limits<double>::infinity(), not_a_number = std::nan("");
    for (const Index wrong : {-1, 10, 31, std::numeric_limits<Index>::min(), std::numeric_limits<Index>::max()}) {
        CHECK(refusal([&] { (void)icosphere<S>({.radius = 1, .subdivisions = wrong}); }) ==
              "icosphere: subdivisions must be 0 to 9, got " + std::to_string(wrong));
    }
    for (const Index wrong : {-1, 0, 1001, std::numeric_limits<Index>::min(), std::numeric_limits<Index>::max()}) {
        const std::string range = " must be 1 to 1000, got " + std::to_string(wrong);
        CHECK(refusal([&] { (void)sheet<S>({.columns = wrong}); }) == "sheet: columns" + range);
        CHECK(refusal([&] { (void)sheet<S>({.rows = wrong}); }) == "sheet: rows" + range);
        CHECK(refusal([&] { (void)disc<S>({.rings = wrong}); }) == "disc: rings" + range);
        CHECK(refusal([&] { (void)spherical_cap<S>({.rings = wrong}); }) == "spherical_cap: rings" + range);
    }
    const std::vector<std::pair<double, std::string>> not_positive{
        {0.0, "0"}, {-1.0, "-1"}, {infinity, "inf"}, {-infinity, "-inf"}, {not_a_number, "nan"}};
    for (const auto& pair : not_positive) {
        const double wrong = pair.first;
        const std::string range = " must be finite and positive [m], got " + pair.second;
        CHECK(refusal([&] { (void)icosphere<S>({.radius = wrong}); }) == "icosphere: radius" + range);
        CHECK(refusal([&] { (void)sheet<S>({.width = wrong}); }) == "sheet: width" + range);
        CHECK(refusal([&] { (void)sheet<S>({.height = wrong}); }) == "sheet: height" + range);
        CHECK(refusal([&] { (void)disc<S>({.radius = wrong}); }) == "disc: radius" + range);
        CHECK(refusal([&] { (void)spherical_cap<S>({.radius = wrong}); }) == "spherical_cap: radius" + range);
        CHECK(refusal([&] { (void)spherical_cap<S>({.diameter = wrong}); }) == "spherical_cap: diameter" + range);
    }
    CHECK(refusal([&] { (void)spherical_cap<S>({.radius = 1, .diameter = 2.001}); }) ==
          "spherical_cap: diameter must be at most 2 [m], twice the radius, got 2.001");
    CHECK_THAT(refusal([&] { (void)icosphere<S>({.radius = 1e300}); }), Catch::Matchers::StartsWith("TriangleMesh: "));
    CHECK_THAT(refusal([&] { (void)disc<S>({.radius = 1e-300}); }), Catch::Matchers::StartsWith("TriangleMesh: "));
}
