// SPDX-License-Identifier: MIT
#include <membrane/tissue/triangular_springs.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include <membrane/meshing/distmesh.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/tissue.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/element_check.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

Material random_material(Random& random) {
    return {.young_modulus = std::pow(10, random.number(3.0, 7.0)),
            .poisson_ratio = random.number(0.0, 0.5),
            .thickness = std::pow(10, random.number(-5.0, -3.0))};
}

Corners<double, 3> random_triangle(Random& random, double size) {
    for (;;) {
        const Corners<double, 3> x{size * random.vector(), size * random.vector(), size * random.vector()};
        if (norm<double>(cross<double>(x[1] - x[0], x[2] - x[0])) > 0.3 * size * size) return x;
    }
}

/// In the plane of a triangle: from its first corner to the other two.
Eigen::Matrix2d flat(const Corners<double, 3>& x) {
    const Eigen::Vector3d a = x[1] - x[0], b = x[2] - x[0], u = a.normalized();
    Eigen::Matrix2d result;
    result << a.norm(), u.dot(b), 0, (b - u.dot(b) * u).norm();
    return result;
}

/// Saint Venant's and Kirchhoff's sheet in plane stress: energy for each area at rest, of the deformation F [J/m^2].
double energy_density(const Material& material, const Eigen::Matrix2d& deformation) {
    const double nu = material.poisson_ratio, sheet = material.young_modulus * material.thickness;
    const Eigen::Matrix2d strain = (deformation.transpose() * deformation - Eigen::Matrix2d::Identity()) / 2;
    const double trace = strain.trace();
    return sheet / (2 * (1 - nu * nu)) * (nu * trace * trace + (1 - nu) * (strain * strain).trace());
}

template <class Each>
double energy_of(const Elements<double, Each>& elements, const Points<double>& x) {
    double sum = 0;
    for (const auto& placed : elements.all()) sum += placed.element.energy(elements.where(placed, x));
    return sum;
}

/// Stretched in both directions and sheared, a sheet in the plane z = 0 pulls at no vertex but those of its border,
/// with the stress of the continuum.
void check_patch(const TriangleMesh<double>& mesh, Random& random) {
    const Material material = random_material(random);
    const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 0.0});
    const auto tissue = Tissue(springs, triangular_springs(mesh, material));
    Eigen::Matrix2d strain = Eigen::Matrix2d::Zero();
    strain(0, 0) = random.number(-1e-7, 1e-7), strain(1, 1) = random.number(-1e-7, 1e-7);
    strain(0, 1) = strain(1, 0) = random.number(-1e-7, 1e-7);
    Points<double> x = mesh.positions();
    x.topRows<2>() += strain * mesh.positions().topRows<2>();
    const double nu = material.poisson_ratio, sheet = material.young_modulus * material.thickness;
    const Eigen::Matrix2d stress =
        sheet / (1 - nu * nu) * (nu * strain.trace() * Eigen::Matrix2d::Identity() + (1 - nu) * strain);
    double area = 0;
    for (const auto& corners : mesh.triangles().colwise()) {
        area += norm<double>(area_vector(triangle_at(mesh.positions(), corners)));
    }
    const auto rim = border(mesh);
    Eigen::Matrix2d found = Eigen::Matrix2d::Zero();  // by the virial
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const Eigen::Vector3d force = tissue.force_on(v, x).force, at = mesh.positions().col(v);
        found -= force.head<2>() * at.head<2>().transpose() / area;
        const bool inside = std::find(rim.begin(), rim.end(), v) == rim.end();
        if (inside) REQUIRE(force.norm() < 1e-6 * 1e-7 * sheet);
    }
    REQUIRE((found - stress).norm() < 1e-6 * 1e-7 * sheet);
}

}  // namespace

TEST_CASE("a triangular spring stores what a sheet of Saint Venant and Kirchhoff does", "[triangular_springs]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-4.0, 0.0));
        const Material material = random_material(random);
        const auto rest = random_triangle(random, size), now = random_triangle(random, size);
        Points<double> x(3, 3);
        x << rest[0].eigen(), rest[1].eigen(), rest[2].eigen();
        const double stretch = random.chance(0.5) ? 1.0 : random.number(0.9, 1.2);
        const auto springs =
            triangular_springs(TriangleMesh<double>(x, Triangles(Eigen::Vector3i(0, 1, 2))), material, stretch);
        const auto& element = springs.all()[0].element;
        const Eigen::Matrix2d reference = flat(rest) / stretch, deformation = flat(now) * reference.inverse();
        const double area = reference.determinant() / 2, energy = area * energy_density(material, deformation);
        REQUIRE(element.energy(now) == Approx(energy).epsilon(1e-9));

        // Mean tension, from the stress F S F^T / det F, S = dW/dE.
        const double nu = material.poisson_ratio, sheet = material.young_modulus * material.thickness;
        const Eigen::Matrix2d strain = (deformation.transpose() * deformation - Eigen::Matrix2d::Identity()) / 2;
        const Eigen::Matrix2d stress =
            sheet / (1 - nu * nu) * (nu * strain.trace() * Eigen::Matrix2d::Identity() + (1 - nu) * strain);
        const double mean = (deformation * stress * deformation.transpose()).trace() / deformation.determinant() / 2;
        REQUIRE(element.mean_tension(now) == Approx(mean).epsilon(1e-9).margin(1e-9 * sheet));

        test::check_element(element, now, size, energy + sheet * size * size, random);
        test::check_hessian(element, now, size, energy + sheet * size * size);
        REQUIRE(test::check_remainder(element, now, size, energy + sheet * size * size, random) == 3);
        for (std::size_t i = 0; i < 3; ++i) {  // seen from each corner the same
            const auto& order = TriangularSpring<double>::orders[i];
            const Corners<double, 3> ordered{now[order[0]], now[order[1]], now[order[2]]};
            REQUIRE(order[0] == i);
            REQUIRE(element.in_order(i).energy(ordered) == Approx(element.energy(now)).epsilon(1e-12));
        }
    }
}

TEST_CASE("a patch of any triangles has the stress of the continuum", "[triangular_springs]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        check_patch(test::irregular_sheet(2 + random.index(6), random), random);
    }
}

TEST_CASE("a patch of DistMesh's own triangles has the stress of the continuum", "[triangular_springs]") {
    Random random(1);
    for (const double length : {0.4, 0.2}) {
        CAPTURE(length);
        check_patch(distmesh(trimmed(HalfSpace{}, Ball{}), {.edge_length = length}), random);
    }
}

TEST_CASE("the error of a stretch that varies falls with the square of the triangles' size", "[triangular_springs]") {
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.47, .thickness = 1e-4};
    const auto displacement = [](double x, double y) -> Eigen::Vector2d {
        constexpr double pi = std::numbers::pi;
        return 1e-6 * Eigen::Vector2d(std::sin(pi * x) * std::cos(2 * y), std::sin(2 * x + pi * y));
    };
    double exact = 0;
    const int samples = 200;  // Midpoints: the integral to 1e-4 and better.
    for (int i = 0; i < samples; ++i) {
        for (int j = 0; j < samples; ++j) {
            const double a = (i + 0.5) / samples - 0.5, b = (j + 0.5) / samples - 0.5, h = 1e-5;
            Eigen::Matrix2d gradient;
            gradient.col(0) = (displacement(a + h, b) - displacement(a - h, b)) / (2 * h);
            gradient.col(1) = (displacement(a, b + h) - displacement(a, b - h)) / (2 * h);
            exact += energy_density(material, Eigen::Matrix2d::Identity() + gradient) / (samples * samples);
        }
    }
    double coarse = 0;
    Random random(1);
    for (const Index squares : {8, 16, 32}) {
        const auto mesh = test::irregular_sheet(squares, random);
        Points<double> x = mesh.positions();
        for (Index v = 0; v < mesh.vertex_count(); ++v) x.col(v).head<2>() += displacement(x(0, v), x(1, v));
        const double error = std::abs(energy_of(triangular_springs(mesh, material), x) / exact - 1);
        CAPTURE(squares, error);
        CHECK(error < 0.05);
        if (coarse > 0) CHECK(error < coarse / 3);
        coarse = error;
    }
}

TEST_CASE("triangular springs leave out what has no area and refuse what is no material", "[triangular_springs][bad]") {
    Points<double> x(3, 4);
    x << 0, 1, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0;
    Triangles triangles(3, 2);
    triangles << 0, 0, 1, 2, 2, 3;
    const TriangleMesh<double> mesh(x, triangles);
    const Material material{.young_modulus = 1, .poisson_ratio = 0.3, .thickness = 1};
    CHECK(triangular_springs(mesh, material).all().size() == 1);
    CHECK(refusal([&] {
              (void)triangular_springs(mesh, {.young_modulus = -1, .poisson_ratio = 0.3, .thickness = 1});
          }) == "Material: young_modulus must be finite and positive [Pa], got -1");
    CHECK(refusal([&] { (void)triangular_springs(mesh, material, 0); }) ==
          "triangular_springs: stretch must be finite and positive [1], got 0");
}

TEST_CASE("triangles side by side do what each does alone, to the bit", "[triangular_springs]") {
    using Wide = Lanes<double>;
    const Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
        const auto springs = triangular_springs(mesh, material, random.number(0.8, 1.2));
        std::array<TriangularSpring<double>, Wide::count> triangles;
        std::array<Corners<double, 3>, Wide::count> x;
        for (std::size_t l = 0; l < Wide::count; ++l) triangles[l] = springs.all()[l].element;
        for (auto& corners : x) {
            for (auto& corner : corners) corner = random.vector();
        }
        test::check_lanes(triangles, x, 0.1 * random.vector(), [](const auto& all) {
            const auto lanes = [&](const auto& number) {
                return Wide::of([&](std::size_t l) { return number(all[l]); });
            };
            return TriangularSpring<Wide>{
                {lanes([](const auto& t) { return t.stiffness.xx; }),
                 lanes([](const auto& t) { return t.stiffness.yy; }),
                 lanes([](const auto& t) { return t.stiffness.zz; }),
                 lanes([](const auto& t) { return t.stiffness.xy; }),
                 lanes([](const auto& t) { return t.stiffness.xz; }),
                 lanes([](const auto& t) { return t.stiffness.yz; })},
                {lanes([](const auto& t) { return t.rest[0]; }), lanes([](const auto& t) { return t.rest[1]; }),
                 lanes([](const auto& t) { return t.rest[2]; })}};
        });
    }
}
