// SPDX-License-Identifier: MIT
#include <membrane/tissue/fung.hpp>

#include <array>
#include <cmath>

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

/// A sheet and the derivative of its energy per area at rest.
struct Sheet {
    explicit Sheet(Random& random, double strongest = 20)
        : material{.young_modulus = std::pow(10, random.number(3.0, 7.0)),
                   .poisson_ratio = 0.5,
                   .thickness = std::pow(10, random.number(-5.0, -3.0))},
          mu(material.young_modulus / 3 * material.thickness) {
        options.stretch_limit = random.number(1.05, 2.0);
        options.stiffening = random.number(0.1, 1.0) * strongest / options.strain_limit();
    }

    double slope(double strain) const {
        const double z = std::min(strain, options.strain_limit());
        return mu / 2 * std::exp(options.stiffening * z) * (1 + options.stiffening * (strain - z));
    }

    Material material;
    double mu;
    FungOptions options;
};

}  // namespace

TEST_CASE("a Fung triangle stores what the continuum does", "[fung]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sheet sheet(random, 6);
        const double mu = sheet.mu, stretch = random.chance(0.5) ? 1.0 : random.number(0.9, 1.2);
        const bool within = random.chance(0.7);
        const double range = within ? std::sqrt(sheet.options.stretch_limit) : 2;
        const Eigen::Matrix2d f = test::random_deformation(random, 1 / range, range) / stretch;
        const test::DeformedTriangle triangle(random, std::pow(10, random.number(-4.0, 0.0)), f);
        const auto element = fung(triangle.mesh(), sheet.material, sheet.options, stretch).all()[0].element;
        const double area = triangle.area / (stretch * stretch);
        const Eigen::Matrix2d deformation = stretch * f;
        const double strain = test::invariant(deformation);
        if (strain < sheet.options.strain_limit()) {
            const double b = sheet.options.stiffening, energy = area * mu / (2 * b) * std::expm1(b * strain);
            REQUIRE(element.energy(triangle.now) == Approx(energy).epsilon(1e-9).margin(1e-12 * mu * area));
        }
        const Eigen::Matrix2d stress = test::isotropic_stress(deformation, sheet.slope(strain));
        const double mean = (stress * deformation.transpose()).trace() / deformation.determinant() / 2;
        REQUIRE(element.mean_tension(triangle.now) == Approx(mean).epsilon(1e-9).margin(1e-9 * mu));

        // Per displacement of the smallest height the strain changes by some units, its energy by that many slopes.
        const double scale = 1e3 * area * (sheet.slope(strain) + mu) * (1 + sheet.options.stiffening);
        test::check_element(element, triangle.now, triangle.smallest, scale, random);
        test::check_hessian(element, triangle.now, triangle.smallest, scale);
        test::check_rigid_motion(element, triangle.now, triangle.smallest, scale, random);
    }
}

TEST_CASE("the energy of a Fung triangle is smooth at its limit, and that of a neo-Hookean one near rest", "[fung]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sheet sheet(random);
        const double b = sheet.options.stiffening, z = sheet.options.strain_limit();
        const FungTriangle<double> element{{1, 0, 1}, 1, b, z};
        test::check_response(element, z);
        REQUIRE(element.response(1e-9 / b).energy == Approx(1e-9 / b).epsilon(1e-8));
    }
}

TEST_CASE("a patch has the exponential stress of each kind of stretch", "[fung]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(6), random);
        const Sheet sheet(random);
        const double range = sheet.options.stretch_limit, s = random.number(1.0, range), g = random.number(-0.5, 0.5);
        const auto elements = fung(mesh, sheet.material, sheet.options);
        const auto check = [&](const Eigen::Matrix2d& f, const Eigen::Matrix2d& stress) {
            test::check_patch(mesh, elements, f, stress, sheet.mu, random);
        };
        const double uniaxial = 2 * sheet.slope(s * s + 2 / s - 3) * (s - 1 / (s * s));
        const double equal = 2 * sheet.slope(2 * s * s + std::pow(s, -4) - 3) * (s - std::pow(s, -5));
        const double shear = 2 * sheet.slope(g * g) * g;
        check(Eigen::Matrix2d{{s, 0}, {0, 1 / std::sqrt(s)}}, Eigen::Matrix2d{{uniaxial, 0}, {0, 0}});
        check(s * Eigen::Matrix2d::Identity(), equal * Eigen::Matrix2d::Identity());
        check(Eigen::Matrix2d{{1, g}, {0, 1}}, Eigen::Matrix2d{{0, shear}, {shear, 0}});
        const Eigen::Matrix2d f = test::random_deformation(random, 0.8, 1.2);
        check(f, test::isotropic_stress(f, sheet.slope(test::invariant(f))));
    }
}

TEST_CASE("a loaded Fung strip is as long as the closed form says", "[fung]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(4), random);
        const Sheet sheet(random, 10);
        const double s = random.number(1.02, sheet.options.stretch_limit);
        const double stress = 2 * sheet.slope(s * s + 2 / s - 3) * (s - 1 / (s * s));
        test::check_equilibrium(mesh, Eigen::Matrix2d{{s, 0}, {0, 1 / std::sqrt(s)}},
                                Eigen::Matrix2d{{stress, 0}, {0, 0}}, random,
                                fung(mesh, sheet.material, sheet.options));
    }
}

TEST_CASE("pressure blows up a Fung disc as a membrane of revolution", "[fung]") {
    Random random(1);
    Sheet sheet(random);
    sheet.options = {};
    const double pressure = 0.5 * 3 * sheet.mu;
    const double expected = test::inflated_height([&](double strain) { return sheet.slope(strain); }, pressure);
    const double height = test::inflated_height_of(
        [&](const TriangleMesh<double>& mesh) { return fung(mesh, sheet.material, sheet.options); }, pressure, 16);
    CAPTURE(expected, height);
    CHECK(std::abs(height / expected - 1) < 0.005);
}

TEMPLATE_TEST_CASE("a Fung triangle is finite wherever its corners are", "[fung]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const FungOptions options{.stiffening = random.number(0.1, 20.0), .stretch_limit = random.number(1.01, 1.35)};
        const auto element = fung(icosphere<TestType>({.radius = 1, .subdivisions = 0}),
                                  {.young_modulus = 1e6, .poisson_ratio = 0.5, .thickness = 1e-4}, options)
                                 .all()[0]
                                 .element;
        const auto far = static_cast<TestType>(sizeof(TestType) == 4 ? 5e4 : 5e59);
        const auto from = test::wild_corners<TestType>(random, far), to = test::wild_corners<TestType>(random, far);
        test::check_finite(element, from, to[0]);
    }
}

TEST_CASE("Fung triangles side by side do what each does alone, to the bit", "[fung]") {
    using Wide = Lanes<double>;
    const Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto sheet = fung(mesh, material, {}, random.number(0.8, 1.2));
        std::array<FungTriangle<double>, Wide::count> triangles;
        std::array<Corners<double, 3>, Wide::count> x;
        for (std::size_t l = 0; l < Wide::count; ++l) {
            triangles[l] = sheet.all()[l].element;
            for (std::size_t i = 0; i < 3; ++i) {
                const Vector3<double> at = point(mesh.positions(), sheet.all()[l].corners[i]);
                x[l][i] = random.chance(0.5) ? at + 0.2 * random.vector() : random.vector();
            }
        }
        test::check_lanes(triangles, x, 0.1 * random.vector(), [](const auto& all) {
            return FungTriangle<Wide>{test::rest_shapes(all),
                                      test::side_by_side(all, [](const auto& t) { return t.stiffness; }),
                                      test::side_by_side(all, [](const auto& t) { return t.stiffening; }),
                                      test::side_by_side(all, [](const auto& t) { return t.limit; })};
        });
    }
}

TEST_CASE("a Fung triangle without constants does nothing", "[fung]") {
    Random random(1);
    test::check_nothing<FungTriangle<double>>(random);
}

TEST_CASE("no update of a vertex of a Fung ball raises the energy", "[fung]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double stretch = random.number(1.0, 1.1);
        test::check_descent(
            [&](const TriangleMesh<double>& mesh) {
                return fung(mesh, {.young_modulus = 1e5, .poisson_ratio = 0.5, .thickness = 1e-4}, {}, stretch);
            },
            random);
    }
}

TEST_CASE("Fung sheets refuse what is no material", "[fung][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const Material material{.young_modulus = 1, .poisson_ratio = 0.3, .thickness = 1};
    const auto refused = [&](const FungOptions& options, double stretch) {
        return refusal([&] { (void)fung(mesh, material, options, stretch); });
    };
    CHECK(refused({}, 1).empty());
    CHECK(refused({}, 0) == "fung: stretch must be finite and positive [1], got 0");
    CHECK(refused({.stiffening = 0}, 1) == "FungOptions: stiffening must be finite and positive [1], got 0");
    CHECK(refused({.stretch_limit = 1}, 1) == "FungOptions: stretch_limit must be finite and above 1, got 1");
    CHECK(refused({.stiffening = 10, .stretch_limit = 2}, 1) ==
          "FungOptions: stiffening times I1 - 3 at stretch_limit must be at most 20, got 50.625");
}
