// SPDX-License-Identifier: MIT
#include <membrane/tissue/neo_hookean.hpp>

#include <array>
#include <cmath>
#include <utility>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/element_check.hpp"
#include "support/large_strain.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

Material random_material(Random& random) {
    return {.young_modulus = std::pow(10, random.number(3.0, 7.0)),
            .poisson_ratio = 0.5,
            .thickness = std::pow(10, random.number(-5.0, -3.0))};
}

double shear_stiffness(const Material& material) { return material.young_modulus / 3 * material.thickness; }

}  // namespace

TEST_CASE("a neo-Hookean triangle stores what the continuum does", "[neo_hookean]") {
    int known = 0;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Material material = random_material(random);
        const double mu = shear_stiffness(material), stretch = random.chance(0.5) ? 1.0 : random.number(0.9, 1.2);
        const bool compressed = random.chance(0.3);
        const Eigen::Matrix2d f = test::random_deformation(random, compressed ? 0.1 : 0.5, compressed ? 0.6 : 2);
        const test::DeformedTriangle triangle(random, std::pow(10, random.number(-4.0, 0.0)), f);
        const auto element = neo_hookean(triangle.mesh(), material, stretch).all()[0].element;
        const Eigen::Matrix2d deformation = stretch * f;
        const double area = triangle.area / (stretch * stretch), ratio = std::abs(deformation.determinant());
        if (ratio > IncompressibleTriangle<double>::min_area_ratio) {
            const double energy = area * mu / 2 * test::invariant(deformation);
            REQUIRE(element.energy(triangle.now) == Approx(energy).epsilon(1e-9).margin(1e-12 * mu * area));
            const Eigen::Matrix2d stress = test::isotropic_stress(deformation, mu / 2) * deformation.transpose();
            REQUIRE(element.mean_tension(triangle.now) ==
                    Approx(stress.trace() / ratio / 2).epsilon(1e-9).margin(1e-9 * mu));
        }
        const double scale = element.energy(triangle.now) + 10 * mu * area;
        test::check_element(element, triangle.now, triangle.smallest, scale, random);
        test::check_hessian(element, triangle.now, triangle.smallest, scale);
        test::check_rigid_motion(element, triangle.now, triangle.smallest, scale, random);
        known += test::check_remainder(element, triangle.now, triangle.smallest, scale, random);
    }
    CHECK(known > cases(500));  // the others are compressed too far, or displaced beyond the range
}

TEST_CASE("a patch has the neo-Hookean stress of each kind of stretch", "[neo_hookean]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(6), random);
        const Material material = random_material(random);
        const double mu = shear_stiffness(material), s = random.number(0.7, 2.0), g = random.number(-1.0, 1.0);
        const auto elements = neo_hookean(mesh, material);
        const auto check = [&](const Eigen::Matrix2d& f, const Eigen::Matrix2d& stress) {
            test::check_patch(mesh, elements, f, stress, mu, random);
        };
        check(Eigen::Matrix2d{{s, 0}, {0, 1 / std::sqrt(s)}}, Eigen::Matrix2d{{mu * (s - 1 / (s * s)), 0}, {0, 0}});
        check(s * Eigen::Matrix2d::Identity(), mu * (s - std::pow(s, -5)) * Eigen::Matrix2d::Identity());
        check(Eigen::Matrix2d{{1, g}, {0, 1}}, Eigen::Matrix2d{{0, mu * g}, {mu * g, 0}});
        const Eigen::Matrix2d f = test::random_deformation(random, 0.6, 2);
        check(f, test::isotropic_stress(f, mu / 2));
    }
}

TEST_CASE("a loaded neo-Hookean strip is as long as the closed form says", "[neo_hookean]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(4), random);
        const Material material = random_material(random);
        const double mu = shear_stiffness(material), s = random.number(1.1, 1.8);
        test::check_equilibrium(mesh, Eigen::Matrix2d{{s, 0}, {0, 1 / std::sqrt(s)}},
                                Eigen::Matrix2d{{mu * (s - 1 / (s * s)), 0}, {0, 0}}, random,
                                neo_hookean(mesh, material));
    }
}

TEST_CASE("pressure blows up a neo-Hookean disc as a membrane of revolution", "[neo_hookean]") {
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.5, .thickness = 1e-4};
    for (const auto& [load, deflection] : {std::pair{0.04, 0.213}, {0.2, 0.407}, {0.3, 0.5}}) {
        CAPTURE(load);
        const double pressure = load * material.young_modulus * material.thickness, mu = shear_stiffness(material);
        const double expected = test::inflated_height([&](double) { return mu / 2; }, pressure);
        const double height = test::inflated_height_of(
            [&](const TriangleMesh<double>& mesh) { return neo_hookean(mesh, material); }, pressure, 16);
        CAPTURE(expected, height);
        CHECK(std::abs(height / expected - 1) < 0.005);
        CHECK(std::abs(deflection - expected) < 0.002);  // the folder's page
    }
}

TEMPLATE_TEST_CASE("a neo-Hookean triangle is finite wherever its corners are", "[neo_hookean]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto element = neo_hookean(icosphere<TestType>({.radius = 1, .subdivisions = 0}),
                                         {.young_modulus = 1e6, .poisson_ratio = 0.5, .thickness = 1e-4})
                                 .all()[0]
                                 .element;
        const auto far = static_cast<TestType>(sizeof(TestType) == 4 ? 5e7 : 5e69);
        const auto from = test::wild_corners<TestType>(random, far), to = test::wild_corners<TestType>(random, far);
        test::check_finite(element, from, to[0]);
    }
}

TEST_CASE("neo-Hookean triangles side by side do what each does alone, to the bit", "[neo_hookean]") {
    using Wide = Lanes<double>;
    const Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto sheet = neo_hookean(mesh, material, random.number(0.8, 1.2));
        std::array<NeoHookeanTriangle<double>, Wide::count> triangles;
        std::array<Corners<double, 3>, Wide::count> x;
        for (std::size_t l = 0; l < Wide::count; ++l) triangles[l] = sheet.all()[l].element;
        for (auto& corners : x) {
            for (auto& corner : corners) corner = random.vector();
        }
        test::check_lanes(triangles, x, 0.1 * random.vector(), [](const auto& all) {
            return NeoHookeanTriangle<Wide>{test::rest_shapes(all),
                                            test::side_by_side(all, [](const auto& t) { return t.stiffness; })};
        });
    }
}

TEST_CASE("a neo-Hookean triangle without constants does nothing", "[neo_hookean]") {
    Random random(1);
    test::check_nothing<NeoHookeanTriangle<double>>(random);
}

TEST_CASE("no update of a vertex of a neo-Hookean ball raises the energy", "[neo_hookean]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double stretch = random.number(1.0, 1.2);
        test::check_descent(
            [&](const TriangleMesh<double>& mesh) {
                return neo_hookean(mesh, {.young_modulus = 1e5, .poisson_ratio = 0.5, .thickness = 1e-4}, stretch);
            },
            random);
    }
}

TEST_CASE("neo-Hookean sheets leave out what has no area and refuse what is no material", "[neo_hookean][bad]") {
    Points<double> x(3, 4);
    x << 0, 1, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0;
    Triangles triangles(3, 2);
    triangles << 0, 0, 1, 2, 2, 3;
    const TriangleMesh<double> mesh(x, triangles);
    const Material material{.young_modulus = 1, .poisson_ratio = 0.3, .thickness = 1};
    CHECK(neo_hookean(mesh, material).all().size() == 1);
    CHECK(refusal([&] { (void)neo_hookean(mesh, {.young_modulus = -1, .poisson_ratio = 0.3, .thickness = 1}); }) ==
          "Material: young_modulus must be finite and positive [Pa], got -1");
    CHECK(refusal([&] { (void)neo_hookean(mesh, material, 0); }) ==
          "neo_hookean: stretch must be finite and positive [1], got 0");
}
