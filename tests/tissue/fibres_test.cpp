// SPDX-License-Identifier: MIT
#include <membrane/tissue/fibres.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <membrane/tissue/neo_hookean.hpp>

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

/// Fibres at one angle, and the stress of their continuum.
struct Family {
    Family(Random& random, double strongest, bool dispersed)
        : angle(random.number(0.0, std::numbers::pi)), axis(std::cos(angle), std::sin(angle)) {
        material.stiffness = std::pow(10, random.number(3.0, 6.0));
        material.thickness = std::pow(10, random.number(-5.0, -3.0));
        material.stretch_limit = random.number(1.05, 1.6);
        material.stiffening = random.number(0.1, 1.0) * strongest / std::pow(material.strain_limit(), 2);
        if (dispersed) material.dispersion = random.number(0.0, 1.0 / 3);
    }

    template <class Mesh>
    std::vector<Points<double>> on(const Mesh& mesh) const {
        return {fibre_directions(mesh, [&](const auto&) { return Eigen::Vector3d(axis[0], axis[1], 0); })};
    }

    double strain(const Eigen::Matrix2d& f) const {
        const double kappa = material.dispersion;
        return kappa * test::invariant(f) + (1 - 3 * kappa) * ((f * axis).squaredNorm() - 1);
    }
    /// Per area at rest; its derivative by the strain.
    double energy(double strain) const {
        const double e = std::max(strain, 0.0), b = material.stiffening;
        return material.thickness * material.stiffness / (2 * b) * std::expm1(b * e * e);
    }
    double slope(double strain) const {
        const double e = std::clamp(strain, 0.0, material.strain_limit()), b = material.stiffening;
        const double beyond = std::max(strain - material.strain_limit(), 0.0);
        return material.thickness * material.stiffness * std::exp(b * e * e) * (e + (1 + 2 * b * e * e) * beyond);
    }
    Eigen::Matrix2d stress(const Eigen::Matrix2d& f) const {
        const double by_strain = slope(strain(f)), kappa = material.dispersion;
        return test::isotropic_stress(f, kappa * by_strain) +
               2 * (1 - 3 * kappa) * by_strain * (f * axis) * axis.transpose();
    }
    double modulus() const { return material.thickness * material.stiffness; }

    FibreMaterial material;
    double angle;
    Eigen::Vector2d axis;
};

}  // namespace

TEST_CASE("a triangle's fibres store what the continuum does", "[fibres]") {
    int slack = 0, beyond = 0;
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Family family(random, 6, random.chance(0.5));
        const double stretch = random.chance(0.5) ? 1.0 : random.number(0.9, 1.2), range = random.chance(0.7) ? 1.2 : 2;
        const Eigen::Matrix2d deformation = test::random_deformation(random, 1 / range, range);
        const test::DeformedTriangle triangle(random, std::pow(10, random.number(-4.0, 0.0)), deformation / stretch);
        const auto mesh = triangle.mesh();
        const auto element = fibres(mesh, family.material, family.on(mesh), stretch).all()[0].element;
        const double area = triangle.area / (stretch * stretch), strain = family.strain(deformation);
        REQUIRE(element.strain(triangle.now) == Approx(strain).epsilon(1e-9).margin(1e-12));
        if (strain < family.material.strain_limit()) {
            REQUIRE(element.energy(triangle.now) ==
                    Approx(area * family.energy(strain)).epsilon(1e-8).margin(1e-12 * area * family.modulus()));
        }
        const Eigen::Matrix2d stress = family.stress(deformation) * deformation.transpose();
        REQUIRE(element.mean_tension(triangle.now) ==
                Approx(stress.trace() / deformation.determinant() / 2).epsilon(1e-8).margin(1e-9 * family.modulus()));
        slack += strain < 0 ? 1 : 0, beyond += strain > family.material.strain_limit() ? 1 : 0;

        // Per displacement of the smallest height the strain changes by some units, its energy by that many slopes.
        const double stiffer = 1 + family.material.stiffening;
        const double scale = 1e3 * area * (family.slope(strain) + family.modulus()) * stiffer;
        test::check_element(element, triangle.now, triangle.smallest, scale, random);
        test::check_hessian(element, triangle.now, triangle.smallest, scale);
        test::check_rigid_motion(element, triangle.now, triangle.smallest, scale, random);
    }
    CHECK(slack > 0);
    CHECK(beyond > 0);
}

TEST_CASE("the energy of fibres is smooth at their limit, and continuous where they become slack", "[fibres]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Family family(random, 20, false);
        const double b = family.material.stiffening, most = family.material.strain_limit();
        const FibreTriangle<double> element{{1, 0, 1}, {1, 0}, 1, b, 0, most};
        test::check_response(element, most);
        const auto slack = element.response(-1e-9), taut = element.response(1e-9);
        REQUIRE((slack.energy == 0 && slack.slope == 0 && slack.curvature == 0));
        REQUIRE((taut.energy < 1e-17 && taut.slope < 1.1e-9 && taut.curvature == Approx(1)));
    }
}

TEST_CASE("fibres are the same in each order of their triangle's corners", "[fibres]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const test::DeformedTriangle triangle(random, 1, test::random_deformation(random, 0.8, 1.3));
        const double angle = random.number(0.0, 6.3);
        const FibreTriangle<double> element{incompressible_triangle(triangle.rest),
                                            {std::cos(angle), std::sin(angle)},
                                            1,
                                            10,
                                            random.number(0.0, 0.3),
                                            0.7};
        for (std::size_t i = 0; i < 3; ++i) {
            const auto& order = element.orders[i];
            const auto& x = triangle.now;
            REQUIRE(element.in_order(i).strain(Corners<double, 3>{x[order[0]], x[order[1]], x[order[2]]}) ==
                    Approx(element.strain(x)).epsilon(1e-12).margin(1e-12));
        }
    }
}

TEST_CASE("a patch has the stress of its fibres in each kind of stretch", "[fibres]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(6), random);
        Family family(random, 20, false);
        family.axis = Eigen::Vector2d(0, 1);
        const double s = random.number(1.0, family.material.stretch_limit), g = random.number(-0.5, 0.5);
        const auto check = [&](const Eigen::Matrix2d& f, const Eigen::Matrix2d& stress) {
            test::check_patch(mesh, fibres(mesh, family.material, family.on(mesh)), f, stress, family.modulus(),
                              random);
        };
        const double uniaxial = 2 * family.slope(s * s - 1) * s, sheared = 2 * family.slope(g * g);
        check(Eigen::Matrix2d{{1 / std::sqrt(s), 0}, {0, s}}, Eigen::Matrix2d{{0, 0}, {0, uniaxial}});
        check(Eigen::Matrix2d{{s, 0}, {0, 1 / s}}, Eigen::Matrix2d::Zero());  // slack
        check(s * Eigen::Matrix2d::Identity(), Eigen::Matrix2d{{0, 0}, {0, uniaxial}});
        check(Eigen::Matrix2d{{1, g}, {0, 1}}, Eigen::Matrix2d{{0, sheared * g}, {0, sheared}});
        // In all directions alike, a sheet that has the stress of an isotropic one.
        family.material.dispersion = 1.0 / 3;
        const double strain = (2 * s * s + std::pow(s, -4) - 3) / 3;
        check(s * Eigen::Matrix2d::Identity(),
              2.0 / 3 * family.slope(strain) * (s - std::pow(s, -5)) * Eigen::Matrix2d::Identity());
        family = Family(random, 20, true);
        const Eigen::Matrix2d f = test::random_deformation(random, 0.8, 1.2);
        check(f, family.stress(f));
    }
}

TEST_CASE("two families of fibres add up", "[fibres]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(4), random);
        const Family one(random, 10, true);
        Family other = one;
        other.angle += 1;
        other.axis = {std::cos(other.angle), std::sin(other.angle)};
        std::vector<Points<double>> families{one.on(mesh)[0], 0.25 * other.on(mesh)[0]};  // a quarter of the second
        const Eigen::Matrix2d f = test::random_deformation(random, 0.8, 1.3);
        test::check_patch(mesh, fibres(mesh, one.material, families), f, one.stress(f) + 0.25 * other.stress(f),
                          one.modulus(), random);
    }
}

TEST_CASE("a loaded strip with fibres along it is as long as the closed form says", "[fibres]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::irregular_sheet(2 + random.index(4), random);
        Family family(random, 10, false);
        family.axis = Eigen::Vector2d(1, 0);
        const Material matrix{.young_modulus = family.material.stiffness * random.number(0.5, 5.0),
                              .poisson_ratio = 0.5,
                              .thickness = family.material.thickness};
        const double mu = matrix.young_modulus / 3 * matrix.thickness;
        const double s = random.number(1.02, family.material.stretch_limit);
        const double stress = mu * (s - 1 / (s * s)) + 2 * family.slope(s * s - 1) * s;
        test::check_equilibrium(mesh, Eigen::Matrix2d{{s, 0}, {0, 1 / std::sqrt(s)}},
                                Eigen::Matrix2d{{stress, 0}, {0, 0}}, random, neo_hookean(mesh, matrix),
                                fibres(mesh, family.material, family.on(mesh)));
    }
}

TEMPLATE_TEST_CASE("fibres are finite wherever the corners of their triangle are", "[fibres]", TEST_SCALARS) {
    const auto mesh = icosphere<TestType>({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const FibreMaterial material{.stiffness = 1e6,
                                     .stiffening = random.number(0.1, 20.0),
                                     .dispersion = random.number(0.0, 1.0 / 3),
                                     .thickness = 1e-4,
                                     .stretch_limit = random.number(1.01, 1.4)};
        const Vector3<double> along = random.unit_vector();
        const auto directions = fibre_directions(mesh, [&](const auto&) { return along; });
        const auto element = fibres(mesh, material, {directions}).all()[0].element;
        const auto far = static_cast<TestType>(sizeof(TestType) == 4 ? 5e4 : 5e59);
        const auto from = test::wild_corners<TestType>(random, far), to = test::wild_corners<TestType>(random, far);
        test::check_finite(element, from, to[0]);
    }
}

TEST_CASE("fibres side by side do what each does alone, to the bit", "[fibres]") {
    using Wide = Lanes<double>;
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Family family(random, 20, true);
        const auto sheet = fibres(mesh, family.material, family.on(mesh), random.number(0.8, 1.2));
        std::array<FibreTriangle<double>, Wide::count> triangles;
        std::array<Corners<double, 3>, Wide::count> x;
        for (std::size_t l = 0; l < Wide::count; ++l) {
            triangles[l] = sheet.all()[l].element;
            for (std::size_t i = 0; i < 3; ++i) {
                const Vector3<double> at = point(mesh.positions(), sheet.all()[l].corners[i]);
                x[l][i] = random.chance(0.5) ? at + 0.2 * random.vector() : random.vector();
            }
        }
        test::check_lanes(triangles, x, 0.1 * random.vector(), [](const auto& all) {
            const auto lanes = [&](const auto& number) { return test::side_by_side(all, number); };
            return FibreTriangle<Wide>{test::rest_shapes(all),
                                       {lanes([](const auto& t) { return t.direction[0]; }),
                                        lanes([](const auto& t) { return t.direction[1]; })},
                                       lanes([](const auto& t) { return t.stiffness; }),
                                       lanes([](const auto& t) { return t.stiffening; }),
                                       lanes([](const auto& t) { return t.dispersion; }),
                                       lanes([](const auto& t) { return t.limit; })};
        });
    }
}

TEST_CASE("a triangle of fibres without constants does nothing", "[fibres]") {
    Random random(1);
    test::check_nothing<FibreTriangle<double>>(random);
}

TEST_CASE("no update of a vertex of a ball of fibres raises the energy", "[fibres]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double stretch = random.number(1.0, 1.1), dispersion = random.chance(0.5) ? 0 : random.number(0.0, 0.33);
        const FibreMaterial material{
            .stiffness = 3e4, .dispersion = dispersion, .thickness = 1e-4, .stretch_limit = 1.3};
        test::check_descent(
            [&](const TriangleMesh<double>& mesh) {
                const auto around = [](const Eigen::Vector3d& p) {
                    return Eigen::Vector3d::UnitZ().cross(p).normalized();
                };
                const auto upward = [](const auto&) { return Eigen::Vector3d::UnitZ(); };
                return fibres(mesh, material, {fibre_directions(mesh, around), fibre_directions(mesh, upward)},
                              stretch);
            },
            random);
    }
}

TEST_CASE("fibres of a cornea run along two axes in the middle and around the limbus", "[fibres]") {
    Random random(1);
    const Eigen::Matrix3d turn = random.rotation();
    const Eigen::Vector3d apex(1, 2, 3);
    auto surface = test::surface_of(disc({.radius = 7e-3, .rings = 20}));
    for (Index v = 0; v < surface.vertex_count(); ++v) {
        const Eigen::Vector3d p = surface.x.col(v);
        surface.x.col(v) = apex + turn * Eigen::Vector3d(p[0], p[1], -p.squaredNorm() / 0.016);  // a dome
    }
    const auto mesh = surface.mesh();
    const CorneaPose pose{.apex = apex, .axis = 5 * turn.col(2), .horizontal = 3 * turn.col(0)};
    const auto families = cornea_fibres(mesh, pose);
    REQUIRE(families.size() == 3);
    int middle = 0, limbus = 0, between = 0;
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
        for (const Index v : mesh.triangles().col(f)) centroid += mesh.positions().col(v) / 3;
        const Eigen::Vector3d p = turn.transpose() * (centroid - apex);
        const double radius = std::hypot(p[0], p[1]);
        const Eigen::Vector3d first = turn.transpose() * families[0].col(f),
                              second = turn.transpose() * families[1].col(f),
                              third = turn.transpose() * families[2].col(f);
        REQUIRE(first.norm() + third.norm() == Approx(1));
        REQUIRE(second.norm() == Approx(first.norm()).margin(1e-12));
        REQUIRE((first - first.norm() * Eigen::Vector3d::UnitX()).norm() < 1e-12);
        REQUIRE((second - second.norm() * Eigen::Vector3d::UnitY()).norm() < 1e-12);
        REQUIRE((third - third.norm() * Eigen::Vector3d(-p[1], p[0], 0) / radius).norm() < 1e-9);
        const bool inside = radius<4.8e-3, outside = radius> 5.8e-3, ring = radius > 5e-3 && radius < 5.6e-3;
        if (inside) REQUIRE(third.norm() == 0);
        if (outside) REQUIRE(first.norm() == 0);
        if (ring) REQUIRE((third.norm() > 0.15 && third.norm() < 0.85));
        middle += inside ? 1 : 0, limbus += outside ? 1 : 0, between += ring ? 1 : 0;
    }
    CHECK((middle > 0 && limbus > 0 && between > 0));
    // In the middle two elements a triangle, at the limbus one.
    const auto all = fibres(mesh, {.stiffness = 1e4, .thickness = 5e-4}, families);
    CHECK(all.all().size() ==
          static_cast<std::size_t>(2 * middle + limbus + 3 * (mesh.triangle_count() - middle - limbus)));
}

TEST_CASE("fibres refuse what is no material and no direction", "[fibres][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const FibreMaterial good{.stiffness = 1, .thickness = 1};
    const auto upward = fibre_directions(mesh, [](const auto&) { return Eigen::Vector3d::UnitZ(); });
    const auto refused = [&](const FibreMaterial& material, const std::vector<Points<double>>& families,
                             double stretch) {
        return refusal([&] { (void)fibres(mesh, material, families, stretch); });
    };
    const auto with = [&](double FibreMaterial::*member, double value) {
        auto material = good;
        material.*member = value;
        return refused(material, {upward}, 1);
    };
    CHECK(refused(good, {upward, upward}, 1).empty());
    CHECK(refused(good, {upward}, 0) == "fibres: stretch must be finite and positive [1], got 0");
    CHECK(refused(good, {upward, upward.leftCols(7)}, 1) ==
          "fibres: directions must be finite, one for each triangle (20), got 7");
    Points<double> infinite = upward;
    infinite(1, 3) = std::numeric_limits<double>::infinity();
    CHECK(refused(good, {infinite}, 1) == "fibres: directions must be finite, one for each triangle (20), got 20");
    CHECK(with(&FibreMaterial::stiffness, 0) == "FibreMaterial: stiffness must be finite and positive [Pa], got 0");
    CHECK(with(&FibreMaterial::stiffening, -1) == "FibreMaterial: stiffening must be finite and positive [1], got -1");
    CHECK(with(&FibreMaterial::thickness, 0) == "FibreMaterial: thickness must be finite and positive [m], got 0");
    CHECK(with(&FibreMaterial::dispersion, 0.4) == "FibreMaterial: dispersion must be 0 to 1/3, got 0.4");
    CHECK(with(&FibreMaterial::stretch_limit, 1) == "FibreMaterial: stretch_limit must be finite and above 1, got 1");
    CHECK(with(&FibreMaterial::stretch_limit, 2) ==
          "FibreMaterial: stiffening times the square of the strain at stretch_limit must be at most 20, got 90");
    Points<double> normals(3, mesh.triangle_count());
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto c = mesh.triangles().col(f);
        const Vector3<double> a = point(mesh.positions(), c[0]), b = point(mesh.positions(), c[1]);
        normals.col(f) = cross<double>(b - a, point(mesh.positions(), c[2]) - a);
    }
    CHECK(fibres(mesh, good, {normals}).all().empty());
    const auto posed = [&](const CorneaPose& pose) { return refusal([&] { (void)cornea_fibres(mesh, pose); }); };
    CHECK(posed({}).empty());
    CHECK(posed({.axis = {1, 0, 0}}) == "CorneaPose: axis and horizontal must not be parallel or zero");
    CHECK(posed({.limbus_radius = 0}) == "CorneaPose: limbus_radius must be finite and positive [m], got 0");
}
