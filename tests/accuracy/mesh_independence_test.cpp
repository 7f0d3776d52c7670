// SPDX-License-Identifier: MIT
// The force of the same tissue on the same tool, whatever the mesh.
#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <tuple>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"

using namespace membrane;

namespace {

using Point = Vector3<double>;

constexpr double R = 0.01;  // of the sphere [m]

/// A lens capsule; on a layer as stiff as makes the normal decay length 0.3 R.
const Material capsule = materials::lens_capsule().typical;
const FoundationLayer layer{.young_modulus = 6073.67, .poisson_ratio = 0.3, .thickness = 1e-3};

enum class Constants { calibrated, the_same_for_each };

enum class Over { vertex, edge, face };
constexpr std::array places{Over::vertex, Over::edge, Over::face};

struct Sphere {
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    FoundationSprings<double> foundation;
    double edge;
    double per_depth;  // of the foundation at a vertex [N/m]

    explicit Sphere(Index subdivisions, Constants constants = Constants::calibrated)
        : mesh(icosphere({.radius = R, .subdivisions = subdivisions})),
          network(mesh, LinearSpring{}, {.stiffness = springs(mesh, constants)}),
          foundation(mesh, {.normal = scaled(normal_stiffnesses(mesh, layer), constants),
                            .tangential = scaled(tangential_stiffnesses(mesh, layer), constants)}),
          edge(mean_edge(mesh)),
          per_depth(foundation.normal_stiffness(mesh.vertex_count() - 1)) {}

    /// Those of the sphere of 642 vertices, where they are not calibrated.
    static std::vector<double> springs(const TriangleMesh<double>& mesh, Constants constants) {
        auto result = spring_stiffnesses(mesh, capsule);
        if (constants == Constants::the_same_for_each)
            result.assign(result.size(), capsule.biaxial_stiffness() / std::sqrt(3.0));
        return result;
    }
    static std::vector<double> scaled(std::vector<double> stiffnesses, Constants constants) {
        const double factor = static_cast<double>(stiffnesses.size()) / 642;
        for (double& k : stiffnesses) k *= constants == Constants::calibrated ? 1 : factor;
        return stiffnesses;
    }

    /// Outward, near a place of no symmetry.
    Point direction(Over place) const {
        const auto& x = mesh.positions();
        const Point wanted = R * Point(0.3, 0.5, 0.81).normalized();
        Triangle<double> nearest = triangle_at(x, mesh.triangles().col(0));
        const auto off = [&](const Triangle<double>& t) { return ((t.a + t.b + t.c) / 3 - wanted).norm(); };
        for (const auto& corners : mesh.triangles().colwise()) {
            const auto t = triangle_at(x, corners);
            if (off(t) < off(nearest)) nearest = t;
        }
        Point sum = nearest.a;
        if (place != Over::vertex) sum += nearest.b;
        if (place == Over::face) sum += nearest.c;
        return sum.normalized();
    }

    /// That holds a ball pressed in to `depth` [N].
    double force(double radius, double depth, Over place, const TrackerOptions& options = {}) const {
        const Point out = direction(place);
        AabbTree tree(mesh);
        ContactTracker tracker(mesh, options);
        QuasiStaticSolver solver(network,
                                 {.layers = unlimited, .sweeps = 4, .force_tolerance = 1e-4 * per_depth * depth});
        Points<double> x = mesh.positions();
        StepReport<double> report;
        for (int i = 0; i <= 40 || (!report.converged && i < 10'000); ++i) {
            const double above = std::max(0.0, 1 - i / 40.0) * (depth + 0.05 * R);
            const Tool<double> tool{.position = (R + radius - depth + above) * out, .radius = radius};
            report = solver.step(x, 1.0, network, foundation, press(tool, tracker.update(tree, x, tool)));
            tree.refit(x, report.moved);
        }
        REQUIRE(report.converged);
        return norm(report.reactions[0]);
    }
};

/// The same of triangular springs, at rest by Newton's method.
struct Elastic {
    TriangleMesh<double> mesh;
    Tissue<MassSpringNetwork<double, LinearSpring>, Elements<double, TriangularSpring<double>>> tissue;
    FoundationSprings<double> foundation;

    explicit Elastic(const TriangleMesh<double>& surface)
        : mesh(surface),
          tissue(MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 0.0}), triangular_springs(mesh, capsule)),
          foundation(mesh,
                     {.normal = normal_stiffnesses(mesh, layer), .tangential = tangential_stiffnesses(mesh, layer)}) {}

    double force(double radius, double depth) const {
        const Point out = Point(0.3, 0.5, 0.81).normalized();
        AabbTree tree(mesh);
        ContactTracker tracker(mesh);
        auto x = mesh.positions();
        double held = 0;
        for (int i = 0; i <= 2; ++i) {
            const double above = (1 - i / 2.0) * (depth + 0.05 * R);
            const Tool<double> tool{.position = (R + radius - depth + above) * out, .radius = radius};
            const auto rest = equilibrium(x, mesh, tissue, foundation, {}, press(tool, tracker.update(tree, x, tool)));
            REQUIRE(rest.converged);
            x = rest.x;
            tree.refit(x);
            held = norm(rest.reactions[0]);
        }
        return held;
    }
};

}  // namespace

TEST_CASE("the force of a tissue does not depend on the mesh, nor on what of it the tool presses", "[tissue]") {
    const double radius = 0.3 * R, depth = 0.15 * R;
    const int finest = std::clamp(cases(4, 6), 3, 6);  // 2562 vertices, 40,962 in a long run, 642 where all is slow
    const double expected = Sphere(finest).force(radius, depth, Over::face);
    std::ostringstream found;
    found << "finest mesh " << expected << " N";
    for (int subdivisions = 3; subdivisions <= std::min(finest, 5); ++subdivisions) {
        const Sphere sphere(subdivisions);
        found << "; " << sphere.mesh.vertex_count() << " vertices";
        for (const Over place : places) {
            if (subdivisions == finest && place == Over::face) continue;
            const double force = sphere.force(radius, depth, place);
            found << " " << force;
            CHECK(force == Approx(expected).epsilon(subdivisions == 3 ? 0.03 : 0.01));
        }
        if (subdivisions == finest) continue;
        found << ", by faces " << sphere.force(radius, depth, Over::face, {.fine_triangles = 0});
        const Sphere same(subdivisions, Constants::the_same_for_each);
        found << ", same constants " << same.force(radius, depth, Over::face);
    }
    WARN(found.str());
}

TEST_CASE("constants that are the same for each spring and vertex give a force that grows with the mesh", "[tissue]") {
    const double radius = 0.3 * R, depth = 0.15 * R;
    const double coarse = Sphere(3, Constants::the_same_for_each).force(radius, depth, Over::face);
    CHECK(coarse == Approx(Sphere(3).force(radius, depth, Over::face)).epsilon(0.1));
    CHECK(Sphere(4, Constants::the_same_for_each).force(radius, depth, Over::face) > 3 * coarse);
}

// Here the finer meshes may be irregular: springs alone would be off by some per cent.
TEST_CASE("nor does it depend on the mesh with triangular springs, on meshes of DistMesh as well", "[tissue]") {
    const double radius = 0.3 * R, depth = 0.15 * R;
    const int finest = std::clamp(cases(4, 5), 3, 5);
    const Elastic fine(icosphere({.radius = R, .subdivisions = finest}));
    const double expected = fine.force(radius, depth);
    std::ostringstream found;
    found << "finest mesh " << expected << " N";
    for (int subdivisions = 3; subdivisions <= std::min(finest, 4); ++subdivisions) {
        const double edge = mean_edge(icosphere({.radius = R, .subdivisions = subdivisions}));
        for (const auto& mesh : {icosphere({.radius = R, .subdivisions = subdivisions}),
                                 distmesh(Ball{.radius = R}, {.edge_length = edge})}) {
            if (mesh.vertex_count() == fine.mesh.vertex_count()) continue;
            const double force = Elastic(mesh).force(radius, depth);
            found << "; " << mesh.vertex_count() << " vertices " << force;
            CHECK(force == Approx(expected).epsilon(subdivisions == 3 ? 0.03 : 0.01));
        }
    }
    WARN(found.str());
}

TEST_CASE("a mesh resolves tools as small as is said", "[tissue]") {
    const int finer = std::min(cases(1, 2), 2);  // subdivisions
    const Sphere coarse(3), fine(3 + finer);
    for (const double edges : {1.5, 2.5}) {
        const double radius = edges * coarse.edge, expected = fine.force(radius, radius / 2, Over::face);
        for (const Over place : places) {
            CHECK(coarse.force(radius, radius / 2, place) == Approx(expected).epsilon(edges < 2 ? 0.06 : 0.03));
        }
    }
}

TEST_CASE("a step that has come to rest holds a tissue with the force of its equilibrium", "[tissue]") {
    const Sphere sphere(3);
    const double radius = 0.3 * R, depth = 0.15 * R;
    AabbTree tree(sphere.mesh);
    ContactTracker tracker(sphere.mesh);
    const Tool<double> tool{.position = (R + radius - depth) * sphere.direction(Over::face), .radius = radius};
    Tool<double> above = tool;
    above.position *= 1.2;
    std::ignore = tracker.update(tree, sphere.mesh.positions(), above);
    const auto contact = tracker.update(tree, sphere.mesh.positions(), tool);
    const auto rest =
        equilibrium(sphere.mesh.positions(), sphere.mesh, sphere.network, sphere.foundation, {}, press(tool, contact));
    REQUIRE(rest.converged);
    CHECK(sphere.force(radius, depth, Over::face) == Approx(norm(rest.reactions[0])).epsilon(1e-3));
}
