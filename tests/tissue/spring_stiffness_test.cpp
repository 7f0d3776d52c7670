// SPDX-License-Identifier: MIT
#include <membrane/tissue/spring_stiffness.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

using Tensor = Eigen::Matrix2d;

/// A parallelogram of equilateral triangles with edges of length 1, in the plane z = 0.
TriangleMesh<double> lattice(Index columns, Index rows) {
    Points<double> x(3, (columns + 1) * (rows + 1));
    Triangles triangles(3, 2 * columns * rows);
    const auto at = [&](Index i, Index j) { return j * (columns + 1) + i; };
    Eigen::Index f = 0;
    for (Index j = 0; j <= rows; ++j) {
        for (Index i = 0; i <= columns; ++i) {
            x.col(at(i, j)) << i + 0.5 * j, std::numbers::sqrt3 / 2 * j, 0;
            if (i == columns || j == rows) continue;
            triangles.col(f++) << at(i, j), at(i + 1, j), at(i, j + 1);
            triangles.col(f++) << at(i + 1, j), at(i + 1, j + 1), at(i, j + 1);
        }
    }
    return {x, triangles};
}

/// Tension per width of a thin sheet, by Hooke's law without stress across [N/m].
Tensor tension(const Material& m, const Tensor& strain) {
    const double shear = m.young_modulus / (2 * (1 + m.poisson_ratio));
    const double both = m.young_modulus * m.poisson_ratio / (1 - m.poisson_ratio * m.poisson_ratio);
    return m.thickness * (2 * shear * strain + both * strain.trace() * Tensor::Identity());
}

/// With which a sheet in the plane has to be held at its vertices, if it has that tension all over.
Points<double> holding_forces(const TriangleMesh<double>& mesh, const Tensor& per_width) {
    Points<double> force = Points<double>::Zero(3, mesh.vertex_count());
    for (const auto& corner : mesh.triangles().colwise()) {
        for (int k = 0; k < 3; ++k) {
            const Index v = corner[k], w = corner[(k + 1) % 3];
            const Vector3<double> side = point(mesh.positions(), w) - point(mesh.positions(), v);
            const Eigen::Vector2d half = per_width * Eigen::Vector2d(side.y(), -side.x()) / 2;
            force.topRows<2>().col(v) += half;  // sides within the sheet cancel out
            force.topRows<2>().col(w) += half;
        }
    }
    return force;
}

Points<double> strained(const TriangleMesh<double>& mesh, const Tensor& strain) {
    Points<double> x = mesh.positions();
    x.topRows<2>() += (strain * x.topRows<2>()).eval();
    return x;
}

MassSpringNetwork<double, LinearSpring> network_of(const TriangleMesh<double>& mesh, const Material& material) {
    return {mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material)}};
}

/// The largest difference between the forces of springs and of a continuum, in parts of the largest of these.
double patch_error(const TriangleMesh<double>& mesh, const Material& material, const Tensor& strain) {
    const auto network = network_of(mesh, material);
    const Points<double> x = strained(mesh, strain), expected = holding_forces(mesh, tension(material, strain));
    double worst = 0;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        worst = std::max(worst, norm<double>(network.force_on(v, x).force + point(expected, v)));
    }
    return worst / expected.colwise().norm().maxCoeff();
}

Tensor random_strain(Random& random, double size) {
    const double xx = random.number(-1.0, 1.0), yy = random.number(-1.0, 1.0), xy = random.number(-1.0, 1.0);
    return size * Tensor{{xx, xy}, {xy, yy}};
}

const Tensor shear{{0, 1}, {1, 0}};

double area_of(const TriangleMesh<double>& mesh) {
    double sum = 0;
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        sum += norm(area_vector(triangle_at(mesh.positions(), mesh.triangles().col(f))));
    }
    return sum;
}

}  // namespace

TEST_CASE("patch test: a regular sheet stretched and sheared pulls at every vertex as a continuum does",
          "[calibration]") {
    const Material material{.young_modulus = 3e5, .poisson_ratio = 1.0 / 3, .thickness = 2e-4};
    const auto mesh = lattice(7, 6);
    for (const Tensor& strain : {Tensor{{1, 0}, {0, 0}}, Tensor{{0, 0}, {0, 1}}, shear, Tensor{{1, 0}, {0, 1}}}) {
        CHECK(patch_error(mesh, material, 1e-7 * strain) < 1e-6);
    }
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        REQUIRE(patch_error(mesh, material, random_strain(random, 1e-7)) < 1e-6);
    }
}

TEST_CASE("at another Poisson ratio the tension of equal stretch is right, and shear off by what is said",
          "[calibration]") {
    const auto mesh = lattice(7, 6);
    for (const double nu : {0.0, 0.2, 0.4, 0.47, 0.49, 0.5}) {
        CAPTURE(nu);
        const Material material{.young_modulus = 3e6, .poisson_ratio = nu, .thickness = 13e-6};
        CHECK(patch_error(mesh, material, 1e-7 * Tensor::Identity()) < 1e-6);
        Material stiffer = material;  // in shear
        stiffer.young_modulus *= (1 + nu) / (2 * (1 - nu));
        const Points<double> x = strained(mesh, 1e-7 * shear);
        const Points<double> expected = holding_forces(mesh, tension(stiffer, 1e-7 * shear));
        const auto network = network_of(mesh, material);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(norm<double>(network.force_on(v, x).force + point(expected, v)) <
                    1e-6 * expected.colwise().norm().maxCoeff());
        }
    }
}

TEST_CASE("every flat mesh stores what a continuum does when stretched alike in all directions", "[calibration]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto regular = disc({.radius = 1, .rings = 6});
        Points<double> x = test::jittered(regular.positions(), 0.05, random);
        x.row(2).setZero();
        const TriangleMesh mesh(x, regular.triangles());
        const Material material{.young_modulus = 1e5, .poisson_ratio = random.number(0.0, 0.5), .thickness = 1e-3};
        const double strain = 1e-5, per_area = material.biaxial_stiffness() * strain * strain;
        REQUIRE(network_of(mesh, material).energy((1 + strain) * x) == Approx(per_area * area_of(mesh)).epsilon(1e-6));
    }
}

TEST_CASE("squares cut by a diagonal are a third too soft in shear, however small they are", "[calibration]") {
    const Material material{.young_modulus = 1e5, .poisson_ratio = 1.0 / 3, .thickness = 1e-3};
    for (const Index squares : {4, 16, 64}) {
        const auto mesh = sheet({.width = 1, .height = 1, .columns = squares, .rows = squares});
        const Tensor strain = 1e-6 * shear;
        const double expected = tension(material, strain).cwiseProduct(strain).sum() / 2;
        CHECK(network_of(mesh, material).energy(strained(mesh, strain)) == Approx(expected * 2 / 3).epsilon(1e-4));
    }
}

TEMPLATE_TEST_CASE("stiffnesses are those of the edges, areas and masses those of the vertices", "[calibration]",
                   TEST_SCALARS) {
    using S = TestType;
    Random random(1);
    const auto regular = spherical_cap<S>({.radius = 1, .diameter = 1.5, .rings = 5});
    Points<S> x(3, regular.vertex_count() + 1);  // the last one has no triangle
    x << test::jittered(regular.positions(), S(0.05), random), Vector3<S>(7, 8, 9);
    const TriangleMesh mesh(x, regular.triangles());
    const Material material{.young_modulus = 2e4, .poisson_ratio = 0.45, .thickness = 2e-4, .density = 1100};
    const FoundationLayer layer{.young_modulus = 2e3, .poisson_ratio = 0.4, .thickness = 1e-3};
    const double tolerance = 100 * static_cast<double>(std::numeric_limits<S>::epsilon());
    const auto area = [&](Index f) {
        return static_cast<double>(area_vector(triangle_at(x, mesh.triangles().col(f))).norm());
    };

    const Adjacency adjacency(mesh);
    const auto stiffnesses = spring_stiffnesses(mesh, material);
    REQUIRE(stiffnesses.size() == adjacency.edges().size());
    double sum = 0;
    for (std::size_t s = 0; s < stiffnesses.size(); ++s) {
        const auto [v, w] = adjacency.edges()[s];
        double around = 0;
        for (const Index f : adjacency.triangles_of(v)) {
            if ((mesh.triangles().col(f).array() == w).any()) around += area(f);
        }
        const double length = static_cast<double>((x.col(w) - x.col(v)).norm());
        const double expected = 2 * 2e4 / (3 * (1 - 0.45)) * 2e-4 * around / (length * length);
        REQUIRE(stiffnesses[s] == Approx(expected).epsilon(tolerance));
        sum += length;
    }
    CHECK(mean_edge(mesh) == Approx(sum / static_cast<double>(stiffnesses.size())).epsilon(tolerance));

    const auto areas = vertex_areas(mesh), masses = vertex_masses(mesh, material);
    const auto normal = normal_stiffnesses(mesh, layer), tangential = tangential_stiffnesses(mesh, layer);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        double expected = 0;
        for (const Index f : adjacency.triangles_of(v)) expected += area(f) / 3;
        const auto at = static_cast<std::size_t>(v);
        REQUIRE(areas[at] == Approx(expected).epsilon(tolerance));
        REQUIRE(masses[at] == Approx(expected * 1100 * 2e-4).epsilon(tolerance));
        REQUIRE(normal[at] == Approx(expected * layer.normal_stiffness()).epsilon(tolerance));
        REQUIRE(tangential[at] == Approx(expected * layer.tangential_stiffness()).epsilon(tolerance));
    }
    CHECK(areas.back() == 0);
}

TEST_CASE("the spring of an edge without length has no stiffness", "[calibration]") {
    Points<double> x(3, 4);
    x << 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0;
    Triangles triangles(3, 2);
    triangles << 0, 1, 1, 3, 2, 2;
    const Material material{.young_modulus = 1, .poisson_ratio = 1.0 / 3, .thickness = 1};
    const auto stiffnesses = spring_stiffnesses(TriangleMesh(x, triangles), material);
    CHECK(std::all_of(stiffnesses.begin(), stiffnesses.end(), [](double k) { return is_finite(k); }));
    CHECK(stiffnesses.back() == 0);  // vertices 2 and 3
}

TEST_CASE("constants that cannot be calibrated are refused by name", "[calibration][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    using test::refusal;
    CHECK(refusal([&] { std::ignore = spring_stiffnesses(mesh, Material{}); }) ==
          "Material: young_modulus must be finite and positive [Pa], got 0");
    CHECK(refusal([&] { std::ignore = vertex_masses(mesh, Material{}); }) ==
          "Material: young_modulus must be finite and positive [Pa], got 0");
    const FoundationLayer layer{.young_modulus = 1, .poisson_ratio = 0.495, .thickness = 1};
    CHECK(refusal([&] { std::ignore = normal_stiffnesses(mesh, layer); }) ==
          "Foundation: poisson_ratio must be 0 to 0.49, got 0.495");
    CHECK(refusal([&] { std::ignore = tangential_stiffnesses(mesh, layer); }) ==
          "Foundation: poisson_ratio must be 0 to 0.49, got 0.495");
}
