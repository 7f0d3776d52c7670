// SPDX-License-Identifier: MIT
#include <membrane/contact/contact_vertices.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using membrane::Index;
using membrane::vertex_feature;
using Point = membrane::Vector3<double>;
using Mesh = membrane::TriangleMesh<double>;
using Tracker = membrane::ContactTracker<double>;

namespace {

/// The smallest sphere around three points, by trying those around two and around all three.
double squared_radius_around(const membrane::Triangle<double>& t) {
    const auto holds = [&](const Point& centre, double square) {
        return std::max({(t.a - centre).squaredNorm(), (t.b - centre).squaredNorm(), (t.c - centre).squaredNorm()}) <=
               square * (1 + 1e-9);
    };
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [p, q] : {std::pair(t.a, t.b), std::pair(t.b, t.c), std::pair(t.c, t.a)}) {
        const double square = (p - q).squaredNorm() / 4;
        if (holds((p + q) / 2, square)) least = std::min(least, square);
    }
    Eigen::Matrix3d rows;  // equally far from all, in their plane
    rows << 2 * (t.b - t.a).transpose(), 2 * (t.c - t.a).transpose(), (t.b - t.a).cross(t.c - t.a).transpose();
    const Eigen::Vector3d to(t.b.squaredNorm() - t.a.squaredNorm(), t.c.squaredNorm() - t.a.squaredNorm(),
                             (t.b - t.a).cross(t.c - t.a).dot(t.a));
    const Point centre = rows.fullPivLu().solve(to);
    return std::min(least, (t.a - centre).squaredNorm());
}

constexpr double disc_radius = 5e-3, stretch = 1.02;  // [m], 1
const membrane::Material film{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};

/// A ball or a capsule whose centre is at least `least` radii above a sphere of 5 mm.
membrane::Tool<double> random_tool(test::Random& random, double least) {
    const double radius = random.number(0.3e-3, 2e-3);
    const Point towards = random.unit_vector();
    membrane::Tool<double> tool{.position = (5e-3 + random.number(least, 1.01) * radius) * towards, .radius = radius};
    if (random.chance(0.3)) tool.axis = 4e-3 * (towards + 0.5 * random.unit_vector());
    return tool;
}

/// The error of the force of a ball that touches a flat disc under tension within `contact_radius` [m], by a closed
/// form: Green's function of the disc is ln(conformal radius / distance) near a point.
double error_of_force(const Mesh& mesh, double x, double y, double contact_radius, double fine_triangles) {
    const membrane::Tissue tissue(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                              {.stiffness = 0.0, .pinned = membrane::border(mesh)}),
                                  membrane::triangular_springs(mesh, film, stretch));
    const membrane::FoundationSprings<double> nothing{mesh, {.normal = 0.0, .tangential = 0.0}};
    const double tension = film.biaxial_stiffness() * (stretch * stretch - 1) / 2;  // St Venant-Kirchhoff [N/m]
    const double radius = 100 * contact_radius;                                     // small slopes
    const double conformal = disc_radius - (x * x + y * y) / disc_radius;
    const double bend = contact_radius * contact_radius / radius;
    const double depth = bend * (std::log(conformal / contact_radius) + 0.5);
    const membrane::Tool<double> ball{.position = {x, y, radius - depth}, .radius = radius};
    Tracker tracker(mesh, {.fine_triangles = fine_triangles});
    const auto contact = tracker.update(membrane::AabbTree<double>(mesh), mesh.positions(), ball);
    const auto rest = membrane::equilibrium(mesh.positions(), mesh, tissue, nothing, {}, press(ball, contact));
    REQUIRE(rest.converged);
    return membrane::norm(rest.reactions[0]) / (2 * std::numbers::pi * tension * bend) - 1;
}

}  // namespace

TEST_CASE("vertices carry a contact where all their triangles are small against the tool", "[contact]") {
    const Mesh mesh = test::graded_sphere(5e-3, 4, 3);
    const membrane::LocalSurface<double> surface(mesh);
    for (const double radius : {0.3e-3, 1e-3, 3e-3}) {
        const double fine = 0.4;
        const membrane::ContactVertices vertices(surface, membrane::ConstPointsRef<double>(mesh.positions()), fine);
        Index carrying = 0;
        Eigen::VectorXd round_of(mesh.vertex_count());
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            double largest = 0, sum = 0;
            const auto around = surface.triangles_of(v);
            for (const Index f : around) {
                const double square = squared_radius_around(surface.triangle(mesh.positions(), f));
                largest = std::max(largest, square);
                sum += square;
            }
            const double size = std::sqrt(largest) / (fine * radius), round = std::clamp(2 - size, 0.0, 1.0);
            const double mean = sum / static_cast<double>(around.size());
            round_of[v] = round;
            REQUIRE(vertices.carries(v, radius) == (size < 2));
            REQUIRE(vertices.lift(v, radius) == Approx(round * (std::sqrt(radius * radius + 0.2 * mean) - radius)));
            REQUIRE(vertices.lift(v, radius) <= vertices.largest_lift(radius));
            carrying += round == 1;
        }
        for (Index f = 0; f < mesh.triangle_count(); ++f) {
            const auto corners = surface.corners(f);
            const double least = std::min({round_of[corners[0]], round_of[corners[1]], round_of[corners[2]]});
            const double square = squared_radius_around(surface.triangle(mesh.positions(), f));
            const double lift = vertices.face_lift(corners, radius);
            REQUIRE(vertices.carry_alone(corners, radius) == (least == 1));
            if (least == 1) {
                REQUIRE(lift == -radius / 2);
            } else {
                REQUIRE(lift <= (1e-9 - 1) * least * std::min(square, fine * fine * radius * radius) / (2 * radius));
                REQUIRE(lift >= -least * fine * fine * radius / 2 * (1 + 1e-9));
            }
            for (const Index v : corners) REQUIRE(vertices.lift(v, radius) <= vertices.largest_lift(corners, radius));
        }
        CAPTURE(radius);
        CHECK(carrying > 0);
        CHECK((carrying < mesh.vertex_count()) == (radius < 3e-3));
    }
    const membrane::ContactVertices none(surface, membrane::ConstPointsRef<double>(mesh.positions()), 0.0);
    CHECK(!none.carries(0, 1.0));
    CHECK(none.largest_lift(1.0) == 0);
    CHECK(none.face_lift({0, 1, 2}, 1.0) == 0);
}

TEST_CASE("the tracker lists each vertex that carries the contact once, and the other faces", "[contact]") {
    const Mesh mesh = test::graded_sphere(5e-3, 4, 3);
    const membrane::AabbTree<double> tree(mesh);
    const membrane::LocalSurface<double> surface(mesh);
    const double fine = 0.4;
    const membrane::ContactVertices carriers(surface, membrane::ConstPointsRef<double>(mesh.positions()), fine);
    test::Random random(3);
    int by_vertices = 0, by_faces = 0, by_both = 0;
    for (int i = 0; i < cases(200); ++i) {
        CAPTURE(i);
        const auto tool = random_tool(random, 0.5);
        const double radius = tool.radius;
        Tracker tracker(mesh, {.fine_triangles = fine});
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        if (!contact.touching()) continue;
        std::set<Index> expected, listed;
        std::vector<Index> faces;
        for (const auto& near : contact.patch.triangles) {
            for (const Index v : near.corners) {
                if (carriers.carries(v, radius)) expected.insert(v);
            }
            const auto nearest = closest_to_axis(membrane::triangle_at(mesh.positions(), near.corners), tool);
            const double distance = std::sqrt(nearest.on_triangle.squared_distance);
            if (distance < 0.75 * radius || !carriers.carry_alone(near.corners, radius)) faces.push_back(near.triangle);
        }
        bool vertices = false, others = false;
        for (const auto& point : contact.patch.points) {
            others |= point.feature != vertex_feature;
            if (point.feature != vertex_feature) {
                REQUIRE(std::find(faces.begin(), faces.end(), point.triangle) != faces.end());
                REQUIRE(point.lift == carriers.face_lift(point.corners, radius));
                continue;
            }
            vertices = true;
            const Index v = point.corners[0];
            REQUIRE(listed.insert(v).second);
            REQUIRE(mesh.triangles().col(point.triangle).minCoeff() ==
                    *std::min_element(point.corners.begin(), point.corners.end()));
            REQUIRE(point.weights == Point(1, 0, 0));
            REQUIRE(point.vertices().size() == 1);
            REQUIRE(point.lift == carriers.lift(v, radius));
            const auto nearest = closest_to_axis(
                membrane::Triangle<double>{mesh.positions().col(v), mesh.positions().col(v), mesh.positions().col(v)},
                tool);
            REQUIRE(point.gap == Approx(std::sqrt(nearest.on_triangle.squared_distance) - radius).margin(1e-15));
        }
        REQUIRE(listed == expected);
        by_vertices += vertices && !others;
        by_faces += others && !vertices;
        by_both += vertices && others;
    }
    CHECK(by_vertices > 0);
    CHECK(by_faces > 0);
    CHECK(by_both > 0);
}

TEST_CASE("a tool in a triangle is in contact, and has none inside it if drawn with its drawn radius", "[contact]") {
    const Mesh mesh = test::graded_sphere(5e-3, 4, 3);
    const membrane::AabbTree<double> tree(mesh);
    test::Random random(5);
    int smaller = 0;
    for (int i = 0; i < cases(1600); ++i) {
        CAPTURE(i);
        const auto tool = random_tool(random, 0.7);
        const double radius = tool.radius;
        Tracker tracker(mesh);
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        double nearest = radius;
        for (const auto& corners : mesh.triangles().colwise()) {
            const auto distance = closest_to_axis(membrane::triangle_at(mesh.positions(), corners), tool).on_triangle;
            nearest = std::min(nearest, std::sqrt(distance.squared_distance));
        }
        const double drawn = drawn_radius(tool, contact, mesh.positions());
        REQUIRE(drawn == nearest);
        REQUIRE((contact.touching() || nearest == radius));
        smaller += drawn < radius;
    }
    CHECK(smaller > 0);
}

TEST_CASE("by default vertices carry the contact of a ball of ten edges", "[contact]") {
    const Mesh mesh = membrane::icosphere<double>({.radius = 5e-3, .subdivisions = 2});
    const Point vertex = membrane::point(mesh.positions(), 0), up = vertex / membrane::norm(vertex);
    const double radius = 10 * membrane::LocalSurface<double>(mesh).mean_edge();
    const membrane::Tool<double> ball{.position = vertex + 0.99 * radius * up, .radius = radius};
    Tracker tracker(mesh);
    const auto contact = tracker.update(membrane::AabbTree<double>(mesh), mesh.positions(), ball);
    REQUIRE(!contact.patch.points.empty());
    for (const auto& point : contact.patch.points) CHECK(point.feature == vertex_feature);
}

TEST_CASE("fine_triangles out of range is refused", "[contact]") {
    const auto mesh = membrane::icosphere<double>({});
    const auto of = [&](double fine) { return test::refusal([&] { Tracker(mesh, {.fine_triangles = fine}); }); };
    const std::string range = "ContactTracker: fine_triangles must be from 0 to 1 [tool radii], got ";
    CHECK(of(-0.1) == range + "-0.1");
    CHECK(of(1.5) == range + "1.5");
    CHECK(of(std::numeric_limits<double>::quiet_NaN()) == range + "nan");
    CHECK(of(1).empty());
}

TEST_CASE("under tension, contact by vertices is nearer to the continuum than by faces", "[contact]") {
    const Mesh mesh = membrane::disc<double>({.radius = disc_radius, .rings = 12});
    test::Random random(7);
    const int count = cases(2, 10);
    for (const double edges : {1.0, 4.0}) {
        CAPTURE(edges);
        double by_faces = 0, by_vertices = 0;
        for (int i = 0; i < count; ++i) {
            const double x = random.number(-1e-3, 1e-3), y = random.number(-1e-3, 1e-3);
            const double contact_radius = edges * disc_radius / 12;
            by_faces += error_of_force(mesh, x, y, contact_radius, 0) / count;
            by_vertices += std::abs(error_of_force(mesh, x, y, contact_radius, 0.5)) / count;
        }
        CAPTURE(by_faces, by_vertices);
        CHECK(by_faces > 0.01);  // faces hold it too far out
        CHECK(by_vertices < by_faces / 2);
    }
}
