// SPDX-License-Identifier: MIT
#include <membrane/accuracy/mesh_error.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

using Point = Vector3<double>;
using Mesh = TriangleMesh<double>;

constexpr double disc_radius = 5e-3, patch_radius = 0.5e-3;  // [m]

/// A sheet of triangular springs with a fixed rim, under one load. What the load moves, or its force, is the quantity.
struct Sheet {
    Material material{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};
    double stretch = 1.02;
    double pressure = 0;                // [Pa]: the volume it adds [m^3]
    double foundation = 0;              // along the normal [Pa/m]
    double patch_depth = 0;             // [m]: the force on the glued patch
    std::vector<Tool<double>> balls{};  // the force on the first
    double fine_triangles = 0;          // of `TrackerOptions`

    double operator()(const Mesh& mesh, Points<double>* at = nullptr) const {
        Points<double> x = mesh.positions();
        std::vector<Index> pinned = border(mesh), patch;
        for (Index v = 0; v < mesh.vertex_count() && patch_depth > 0; ++v) {
            if (!(std::hypot(x(0, v), x(1, v)) < patch_radius * (1 + 1e-9))) continue;
            patch.push_back(v);
            x(2, v) -= patch_depth;
        }
        pinned.insert(pinned.end(), patch.begin(), patch.end());
        const MassSpringNetwork none(mesh, LinearSpring{}, {.stiffness = 0.0, .pinned = pinned});
        const Tissue tissue(none, triangular_springs(mesh, material, stretch), membrane::pressure(mesh, pressure));
        std::vector<double> normal = vertex_areas(mesh);
        for (double& area : normal) area *= foundation;
        const FoundationSprings springs(mesh, {.normal = normal, .tangential = 0.0});
        const auto found = solve(mesh, x, tissue, springs);
        REQUIRE(found.converged);
        if (at != nullptr) *at = found.x;
        if (!balls.empty()) return found.reactions[0].z();
        if (patch.empty()) return volume_under(mesh, found.x) - volume_under(mesh, mesh.positions());
        double force = 0;
        for (const Index v : patch) {
            const Point here = point(found.x, v);
            force += tissue.force_on(v, found.x).force.z() + springs.force_on(v, here, here, 1.0).force.z();
        }
        return force;
    }

  private:
    template <class Tissue, class Springs>
    Equilibrium solve(const Mesh& mesh, const Points<double>& x, const Tissue& tissue, const Springs& springs) const {
        std::vector<ContactTracker<double>> trackers(balls.size(),
                                                     ContactTracker(mesh, {.fine_triangles = fine_triangles}));
        const AabbTree<double> tree(mesh);
        const auto pressed = [&](std::size_t i) { return press(balls[i], trackers[i].update(tree, x, balls[i])); };
        const auto run = [&](Index increments, const auto&... constraints) {
            return equilibrium(x, mesh, tissue, springs, {.increments = increments}, constraints...);
        };
        const auto by = [&](Index increments) {
            if (balls.empty()) return run(increments);
            return balls.size() == 1 ? run(increments, pressed(0)) : run(increments, pressed(0), pressed(1));
        };
        auto found = by(1);
        return found.converged ? found : by(16);
    }

    /// Between the surface and the plane z = 0, its rim fixed [m^3].
    static double volume_under(const Mesh& mesh, const Points<double>& x) {
        double sum = 0;
        for (const auto& corners : mesh.triangles().colwise()) {
            const auto t = triangle_at(x, corners);
            sum += area_vector(t).z() * (t.a + t.b + t.c).z() / 3;
        }
        return sum;
    }
};

/// A disc of rings, narrower in the middle; one ring on the rim of the patch.
Mesh ring_disc(Index rings, double grading) {
    const auto inner = static_cast<Index>(std::ceil(patch_radius / disc_radius * static_cast<double>(rings)));
    const Mesh regular = disc<double>({.radius = 1, .rings = rings});
    Points<double> x = regular.positions();
    for (Index v = 1; v < x.cols(); ++v) {
        const double distance = std::hypot(x(0, v), x(1, v));
        const auto ring = static_cast<Index>(std::lround(distance * static_cast<double>(rings)));
        const double s = static_cast<double>(ring - inner) / static_cast<double>(rings - inner);
        const double radius = ring <= inner
                                  ? patch_radius * static_cast<double>(ring) / static_cast<double>(inner)
                                  : patch_radius + (disc_radius - patch_radius) * s * (grading + (1 - grading) * s);
        x.col(v) *= radius / distance;
    }
    return {x, regular.triangles()};
}

/// By DistMesh, with the vertices nearest to the rim of the patch moved onto it.
Mesh irregular_disc(Index rings) {
    const double r = 1.1 * disc_radius;
    const Mesh mesh = distmesh(
        trimmed(HalfSpace{}, Ball{.radius = disc_radius}),
        {.edge_length = disc_radius / static_cast<double>(rings), .bounds = Bounds{{-r, -r, -r / 8}, {r, r, r / 8}}});
    Points<double> x = mesh.positions();
    const auto outside = [&](Index v) {
        return std::hypot(mesh.positions()(0, v), mesh.positions()(1, v)) - patch_radius;
    };
    const Adjacency adjacency(mesh);
    for (const auto& [a, b] : adjacency.edges()) {
        if (outside(a) * outside(b) > 0) continue;
        const Index nearest = std::abs(outside(a)) < std::abs(outside(b)) ? a : b;
        x.col(nearest) = patch_radius / (outside(nearest) + patch_radius) * mesh.positions().col(nearest);
    }
    return {x, mesh.triangles()};
}

/// On the rims of disc and patch, if both ends are.
Point between_on_disc(const Point& a, const Point& b) {
    const Point middle = (a + b) / 2;
    for (const double radius : {disc_radius, patch_radius}) {
        const auto is_on = [&](const Point& p) { return std::abs(std::hypot(p.x(), p.y()) - radius) < 1e-9; };
        if (is_on(a) && is_on(b)) return radius / std::hypot(middle.x(), middle.y()) * middle;
    }
    return middle;
}

/// The part of an ellipsoid around the z axis above its rim.
struct Dome {
    double across, along, rim;  // radii [m]

    double rim_angle() const { return std::asin(rim / across); }
    Point at(const Point& flat) const {  // by its angle from the pole, as the distance from the origin
        const double angle = flat.norm(), sine = angle > 0 ? std::sin(angle) / angle : 1;
        return {across * sine * flat.x(), across * sine * flat.y(), along * std::cos(angle)};
    }
    Point flat(const Point& p) const {
        const double far = std::hypot(p.x(), p.y()), angle = std::atan2(far / across, p.z() / along);
        return far > 0 ? Point(angle / far * Point(p.x(), p.y(), 0)) : Point(0, 0, 0);
    }
    Point between(const Point& a, const Point& b) const {
        const Point middle = (flat(a) + flat(b)) / 2;
        const auto at_rim = [&](const Point& p) { return std::abs(flat(p).norm() - rim_angle()) < 1e-4; };
        return at(at_rim(a) && at_rim(b) ? Point(rim_angle() / middle.norm() * middle) : middle);
    }
    Mesh regular(Index rings) const {
        const Mesh mesh = disc<double>({.radius = rim_angle(), .rings = rings});
        Points<double> x = mesh.positions();
        for (Index v = 0; v < x.cols(); ++v) x.col(v) = at(point(mesh.positions(), v));
        return {x, mesh.triangles()};
    }
    Mesh irregular(Index rings) const {
        const double height = along * std::cos(rim_angle());
        const Ellipsoid body{.radii = {across, across, along}};
        return distmesh(trimmed(body, HalfSpace{.point = {0, 0, height}, .normal = {0, 0, -1}}),
                        {.edge_length = std::hypot(rim, along - height) / static_cast<double>(rings)});
    }
};

/// The gradient of the displacement in each triangle, and its mean over the triangles around each vertex.
struct Gradients {
    template <class Springs>
    Gradients(const Mesh& mesh, const Springs& springs, const Points<double>& x)
        : at_vertices(static_cast<std::size_t>(mesh.vertex_count()), Eigen::Matrix3d::Zero()) {
        const Points<double> moved = x - mesh.positions();
        std::vector<double> areas(at_vertices.size(), 0.0);
        for (const auto& spring : springs.all()) {
            const auto at = spring.where(mesh.positions());
            const Point normal = cross<double>(at[1] - at[0], at[2] - at[0]);
            Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
            for (std::size_t i = 0; i < 3; ++i) {
                const Point slope = cross<double>(normal, at[(i + 2) % 3] - at[(i + 1) % 3]) / squared_norm(normal);
                gradient += moved.col(spring.corners[i]) * slope.eigen().transpose();
            }
            in_triangles.push_back(gradient);
            for (const Index v : spring.corners) {
                at_vertices[static_cast<std::size_t>(v)] += norm(normal) * gradient;
                areas[static_cast<std::size_t>(v)] += norm(normal);
            }
        }
        for (std::size_t v = 0; v < areas.size(); ++v) at_vertices[v] /= areas[v];
    }

    std::vector<Eigen::Matrix3d> in_triangles, at_vertices;
};

/// By another method, recovery: the energy of the difference between the gradient in the triangles and the means at the
/// vertices, interpolated, over the energy stored.
double recovered_error(const Mesh& mesh, const Sheet& sheet, const Points<double>& x) {
    const auto springs = triangular_springs(mesh, sheet.material, sheet.stretch);
    const Gradients gradients(mesh, springs, x);
    double error = 0, stored = 0;
    auto gradient = gradients.in_triangles.begin();
    for (const auto& spring : springs.all()) {
        const auto at = spring.where(mesh.positions()), here = spring.where(x);
        const Point centre = (at[0] + at[1] + at[2]) / 3;
        const auto mean = [&](std::size_t i) {
            return gradients.at_vertices[static_cast<std::size_t>(spring.corners[i % 3])];
        };
        const double energy = spring.element.energy(here);
        stored += energy - spring.element.energy(at);
        for (std::size_t side = 0; side < 3; ++side) {  // the middles of the sides integrate squares
            const Eigen::Matrix3d change = (mean(side) + mean(side + 1)) / 2 - *gradient;
            auto there = here;
            double linear = 0;
            for (std::size_t i = 0; i < 3; ++i) {
                const Eigen::Vector3d by = change * (at[i] - centre).eigen();
                there[i] += Point(by.x(), by.y(), by.z());
                linear -= spring.element.force_on(here, i).force.eigen().dot(by);
            }
            error += (spring.element.energy(there) - energy - linear) / 3;
        }
        ++gradient;
    }
    return error / stored;
}

struct Scene {
    std::string name;
    Mesh mesh;
    Sheet sheet;
    std::function<Point(const Point&, const Point&)> between;
    std::function<Mesh(Index)> fine;  // a mesh of another kind, with this many rings
};

Index random_rings(Random& random) { return 5 + random.index(6); }

/// Balls of 0.5 to 2 mm, 0.02 to 0.5 radii deep, anywhere near the middle, or two.
Scene balls(Random& random, bool two) {
    const double radius = 1e-3 * std::pow(2, random.number(-1.0, 1.0)), depth = std::pow(10, random.number(-1.7, -0.3));
    const Point place =
        two ? Point(1.2 * radius + 2e-4, 0, 0) : Point(random.number(-3e-4, 3e-4), random.number(-3e-4, 3e-4), 0);
    Sheet sheet{.fine_triangles = random.chance(0.5) ? 0.0 : 0.5};
    for (const double side : {1.0, -1.0}) {
        sheet.balls.push_back({.position = {side * place.x(), place.y(), (1 - depth) * radius}, .radius = radius});
        if (!two) break;
    }
    const Index rings = random_rings(random);
    const auto fine = [=](Index count) {  // finest under the ball
        const Mesh mesh = ring_disc(count, two ? 1 : 0.4);
        Points<double> x = mesh.positions();
        for (auto p : x.colwise()) p += (two ? 0 : 1 - p.squaredNorm() / (disc_radius * disc_radius)) * place.eigen();
        return Mesh(x, mesh.triangles());
    };
    const double triangle = disc_radius / static_cast<double>(rings), touched = std::sqrt(2 * depth) * radius;
    return {std::string(two ? "two balls" : "ball") + (touched < triangle ? " smaller than a triangle" : ""),
            random.chance(0.4) ? irregular_disc(rings) : ring_disc(rings, 1), sheet, between_on_disc, fine};
}

Scene dome(Random& random, const std::string& name, const Dome& body, const Material& material) {
    const Sheet sheet{.material = material, .stretch = 1, .pressure = 250 * std::pow(16, random.number())};
    const Index rings = random_rings(random);
    return {name, random.chance(0.5) ? body.irregular(rings) : body.regular(rings), sheet,
            [=](const Point& a, const Point& b) { return body.between(a, b); },
            [=](Index count) { return body.regular(count); }};
}

Scene flat(Random& random, std::string name, const Sheet& sheet) {
    const Index rings = random_rings(random);
    return {std::move(name), random.chance(0.4) ? irregular_disc(rings) : ring_disc(rings, random.number(0.5, 1.0)),
            sheet, between_on_disc, [](Index count) { return ring_disc(count, 0.4); }};
}

constexpr int scene_count = 8;

Scene random_scene(int kind, Random& random) {
    switch (kind) {
        case 0: return flat(random, "pressure", {.pressure = 100 * std::pow(30, random.number())});
        case 1: return flat(random, "patch", {.patch_depth = 1e-4 * std::pow(15, random.number())});
        case 2:
            return flat(random, "foundation",
                        {.foundation = 2e7 * std::pow(10, random.number(-1.0, 0.0)),
                         .patch_depth = 2.5e-5 * std::pow(8, random.number())});
        case 3: return balls(random, true);
        case 4:
            return dome(random, "cornea", {.across = 7.8e-3, .along = 7.8e-3, .rim = 5.8e-3},
                        materials::cornea().typical);
        case 5:
            return dome(random, "capsule", {.across = 4.5e-3, .along = 2e-3, .rim = 3.4e-3},
                        materials::lens_capsule().typical);
        default: return balls(random, false);
    }
}

}  // namespace

TEST_CASE("the estimated error of a mesh is within a factor of 2 of the error against fine meshes") {
    const int count = cases(scene_count / 2, 12 * scene_count);
    int within = 0, judged = 0, small = 0, small_within = 0, recovered = 0;
    std::string others;
    for (int seed = 1; seed <= count; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Scene scene = random_scene(seed % scene_count, random);
        CAPTURE(scene.name);
        const auto estimate = estimated_mesh_error(scene.mesh, scene.sheet, scene.between);
        const double coarse = scene.sheet(scene.fine(20)), fine = scene.sheet(scene.fine(40));
        const double truth = estimate.value / (fine + (fine - coarse) / 3) - 1;
        const double ratio = estimate.error() / truth;
        Points<double> x;
        static_cast<void>(scene.sheet(scene.mesh, &x));
        const double other = recovered_error(scene.mesh, scene.sheet, x) / std::abs(truth);
        recovered += other > 0.5 && other < 2 ? 1 : 0;
        const bool good = ratio > 0.5 && ratio < 2, is_small = scene.name.find("smaller") != std::string::npos;
        ++(is_small ? small : judged);
        (is_small ? small_within : within) += good ? 1 : 0;
        if (good) continue;
        others += "\n" + std::to_string(seed) + " " + scene.name + ": " + std::to_string(estimate.error()) + " of " +
                  std::to_string(truth);
    }
    WARN(within << " of " << judged << " within a factor of 2; " << small_within << " of " << small
                << " of balls that touch less than a triangle; by recovery " << recovered
                << " of all; others:" << others);
    CHECK(within + small_within >= 0.9 * (judged + small) - 1);
}

TEST_CASE("on a mesh made as fine as the estimate says the error is the wanted one") {
    const Sheet sheet{.foundation = 5e6, .patch_depth = 1e-4};
    const auto estimate = estimated_mesh_error(ring_disc(10, 1), sheet, between_on_disc);
    const double coarse = sheet(ring_disc(30, 0.4)), fine = sheet(ring_disc(60, 0.4));
    const double truth = fine + (fine - coarse) / 3;
    for (const double times : {3, 4}) {  // as fine: a ring stays on the rim of the patch
        const double wanted = estimate.error() / (times * times);
        const auto rings = static_cast<Index>(std::lround(10 / estimate.edge_factor(wanted)));
        CHECK(rings == 10 * times);
        CHECK(sheet(ring_disc(rings, 1)) / truth - 1 == Approx(wanted).epsilon(0.3));
    }
}

TEST_CASE("the area of a polygon in place of a disc: its error in closed form") {
    const auto area = [](const Mesh& mesh) {
        double sum = 0;
        for (const auto& corners : mesh.triangles().colwise())
            sum += area_vector(triangle_at(mesh.positions(), corners)).norm();
        return sum;
    };
    for (const Index rings : {2, 5, 20}) {
        const auto estimate =
            estimated_mesh_error(disc<double>({.radius = disc_radius, .rings = rings}), area, between_on_disc);
        const double circle = std::numbers::pi * disc_radius * disc_radius, corners = 6.0 * rings;
        const double truth = std::sin(2 * std::numbers::pi / corners) * corners / (2 * std::numbers::pi) - 1;
        CHECK(estimate.value / circle - 1 == Approx(truth));
        CHECK(estimate.error() == Approx(truth).epsilon(0.01));
        CHECK(estimate.refined_error() == Approx(truth / 4).epsilon(0.02));
        CHECK(estimate.continuum() == Approx(circle).epsilon(0.01 * std::abs(truth)));
    }
}

TEST_CASE("a quantity with a power of the edge length has exactly the estimated error") {
    for (const double order : {0.5, 1.0, 2.0, 4.0}) {
        CAPTURE(order);
        const auto quantity = [&](const Mesh& mesh) {
            return 5 - std::pow(1 / static_cast<double>(mesh.triangle_count()), order / 2);
        };
        const Mesh mesh = sheet<double>({.columns = 4, .rows = 3});
        const auto estimate = estimated_mesh_error(mesh, quantity, Midpoint{}, order);
        CHECK(estimate.continuum() == Approx(5));
        CHECK(estimate.error() == Approx(quantity(mesh) / 5 - 1));
        CHECK(estimate.edge_factor(std::abs(estimate.error())) == Approx(1));
        CHECK(estimate.edge_factor(std::abs(estimate.error()) * std::pow(2, order)) == Approx(2));
    }
    const MeshError exact{.value = 3, .refined_value = 3};
    CHECK(exact.error() == 0);
    CHECK(exact.edge_factor(0.01) == std::numeric_limits<double>::infinity());
    CHECK(MeshError{}.error() == std::numeric_limits<double>::infinity());  // a tool that touches neither mesh
    CHECK(MeshError{}.edge_factor(0.01) == 0);
}

TEST_CASE("a mesh error that makes no sense is refused") {
    const auto refused = [](double value, double order) {
        return refusal([&] {
            (void)estimated_mesh_error(
                sheet<double>(), [&](const Mesh&) { return value; }, Midpoint{}, order);
        });
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK_THAT(refused(nan, 2), ContainsSubstring("estimated_mesh_error: the quantity must be finite, got"));
    CHECK(refused(1, 0) == "estimated_mesh_error: order must be finite and positive [1], got 0");
    CHECK_THAT(refused(1, nan), ContainsSubstring("order must be finite and positive"));
}
