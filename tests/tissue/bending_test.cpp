// SPDX-License-Identifier: MIT
#include <membrane/tissue/bending.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

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

/// Equilateral triangles with edges of length 1, turned by `angle`.
TriangleMesh<double> equilateral_sheet(Index rows, double angle) {
    test::Surface<double> surface;
    for (Index j = 0; j <= rows; ++j) {
        for (Index i = 0; i <= rows; ++i) {
            const double x = i + 0.5 * j - 0.75 * rows, y = std::sqrt(0.75) * (j - 0.5 * rows);
            surface.add({std::cos(angle) * x - std::sin(angle) * y, std::sin(angle) * x + std::cos(angle) * y, 0});
        }
    }
    for (Index j = 0; j < rows; ++j) {
        for (Index i = 0; i < rows; ++i) {
            const Index v = j * (rows + 1) + i;
            surface.add(v, v + 1, v + rows + 1);
            surface.add(v + 1, v + rows + 2, v + rows + 1);
        }
    }
    return surface.mesh();
}

/// What the hinges store near the middle vertex, where each direction has as many, and the area that they stand for: a
/// third of their triangles.
std::pair<double, double> energy_and_area(const Elements<double, Hinge<double>>& hinges, const Points<double>& x) {
    double energy = 0, area = 0;
    for (const auto& placed : hinges.all()) {
        const auto corners = hinges.where(placed, x);
        if ((corners[0] + corners[1]).eigen().head<2>().norm() / 2 > 3.1) continue;
        energy += placed.element.energy(corners);
        area += (norm<double>(cross<double>(corners[1] - corners[0], corners[2] - corners[0])) +
                 norm<double>(cross<double>(corners[1] - corners[0], corners[3] - corners[0]))) /
                6;
    }
    return {energy, area};
}

/// A hinge at rest at `angle`.
Hinge<double> hinge_of(double stiffness, double angle) {
    return {.stiffness = stiffness, .rest_sine = std::sin(angle), .rest_cosine = std::cos(angle)};
}

/// The fold angle.
double angle_of(const Corners<double, 4>& x) { return detail::Fold<double>(x).angle_from_rest(Hinge<double>{}); }

}  // namespace

TEST_CASE("a hinge pulls with the derivative of its energy, however far it is folded", "[bending]") {
    const int hinges = cases(500);
    int known = 0;
    for (int seed = 1; seed <= hinges; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-4.0, 0.0)), k = std::pow(10, random.number(-8.0, 0.0));
        const double angle = random.number(-2.8, 2.8);
        const auto apex = [&](double side, double lift) -> Eigen::Vector3d {
            const double away = random.number(0.4, 1.0);
            return size *
                   Eigen::Vector3d(random.number(-0.2, 1.2), side * away * std::cos(lift), away * std::sin(lift));
        };
        Corners<double, 4> x{Eigen::Vector3d::Zero(), size * Eigen::Vector3d::UnitX(), apex(1, 0), apex(-1, -angle)};
        const Hinge<double> flat{.stiffness = k};
        REQUIRE(flat.energy(x) == Approx(k * angle * angle / 2));
        REQUIRE(angle_of(x) == Approx(angle));
        const Eigen::Matrix3d turn = random.rotation();
        const Eigen::Vector3d shift = size * random.vector();
        for (auto& corner : x) corner = turn * corner + shift;
        const auto hinge = hinge_of(k, angle + random.number(-0.3, 0.3));
        test::check_element(hinge, x, 0.2 * size, k, random);
        const auto at_rest = hinge_of(k, angle_of(x));
        REQUIRE(at_rest.rest() == Approx(angle_of(x)));
        test::check_hessian(at_rest, x, 0.2 * size, k);
        known += test::check_remainder(hinge, x, 0.2 * size, k, random);
        for (std::size_t i = 0; i < 4; ++i) {  // seen from each corner the same
            const auto& order = Hinge<double>::orders[i];
            const Corners<double, 4> ordered{x[order[0]], x[order[1]], x[order[2]], x[order[3]]};
            REQUIRE(hinge.in_order(i).energy(ordered) == Approx(hinge.energy(x)));
        }
    }
    CHECK(known > hinges);  // of four corners
}

TEST_CASE("no hinge curves more than the heights over its lines say", "[bending]") {
    Random random(7);
    double most = 0;
    for (int i = 0; i < cases(2000); ++i) {
        Corners<double, 4> x;
        for (auto& corner : x) corner = std::exp(random.number(-1.0, 1.0)) * random.vector();
        const detail::Fold<double> fold(x);
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const double curvature = fold.curvature(corner), h = 1e-5 / std::sqrt(curvature);
            Eigen::Matrix3d second;
            for (Eigen::Index k = 0; k < 3; ++k) {
                auto before = x, after = x;
                before[corner][k] -= h, after[corner][k] += h;
                second.col(k) =
                    (detail::Fold<double>(after).descent(corner) - detail::Fold<double>(before).descent(corner))
                        .eigen() /
                    (2 * h);
            }
            const Eigen::Matrix3d symmetric = (second + second.transpose()) / 2;
            const double largest = test::eigenvalues_of(symmetric).cwiseAbs().maxCoeff();
            REQUIRE(largest <= (1 + 1e-4) * curvature);
            most = std::max(most, largest / curvature);
        }
    }
    CHECK(most > 0.9);
}

TEST_CASE("the less a hinge is folded, the less there is to round", "[bending]") {
    const Hinge<double> hinge{.stiffness = 3};
    double before = 100;
    for (const double lift : {1.0, 1e-2, 1e-4, 1e-6}) {
        const Corners<double, 4> x{Vector3<double>(0, 0, 0), Vector3<double>(0, 1, 0), Vector3<double>(1, 0.5, 0),
                                   Vector3<double>(-1, 0.5, 0)};
        const double size = hinge.energy_change(x, 2, Vector3<double>(0, 0, lift)).size;
        CHECK(size < before / 10);
        CHECK(size > 0);
        before = size;
    }
}

TEST_CASE("hinges of equilateral triangles store what a plate does", "[bending]") {
    const double rigidity = 3e-6, radius = 1e4;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = equilateral_sheet(10, random.number(0.0, std::numbers::pi));
        const auto hinges = bending_springs(mesh, rigidity);
        const auto bent = [&](auto height) {
            Points<double> x = mesh.positions();
            for (Index v = 0; v < mesh.vertex_count(); ++v) x(2, v) = height(x(0, v), x(1, v));
            const auto [energy, area] = energy_and_area(hinges, x);
            return energy / area;
        };
        REQUIRE(bent([](double, double) { return 0; }) == 0);
        const double cylinder = bent([&](double a, double) { return a * a / (2 * radius); });
        REQUIRE(cylinder * 2 * radius * radius / rigidity == Approx(1).epsilon(1e-4));
        // A plate of Poisson ratio nu stores 2 (1 + nu) times as much as a bowl, 2 (1 - nu) times as a saddle: nu is
        // -1/3.
        const double bowl = bent([&](double a, double b) { return (a * a + b * b) / (2 * radius); });
        const double saddle = bent([&](double a, double b) { return (a * a - b * b) / (2 * radius); });
        REQUIRE(bowl / cylinder == Approx(2 * (1 - 1.0 / 3)).epsilon(1e-4));
        REQUIRE(saddle / cylinder == Approx(2 * (1 + 1.0 / 3)).epsilon(1e-4));
    }
}

TEST_CASE("a mesh is at rest on its hinges, borders have none", "[bending]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto check = [&](auto scalar) {
            using S = decltype(scalar);
            const auto mesh = test::with_holes(test::random_surface<S>(random), random).mesh();
            const auto hinges = bending_springs(mesh, 1e-6);
            std::size_t inner = 0;
            for_each_edge(half_edges(mesh.triangles()),
                          [&](auto sides) { inner += static_cast<std::size_t>(sides.size() == 2); });
            REQUIRE(hinges.all().size() == inner);
            for (const auto& placed : hinges.all()) {
                const auto x = hinges.where(placed, mesh.positions());
                for (std::size_t i = 0; i < 4; ++i) {
                    const auto pull = placed.element.force_on(x, i);
                    const S size = norm<S>(x[1] - x[0]);
                    REQUIRE(norm(pull.force) <=
                            S(1e3) * std::numeric_limits<S>::epsilon() * (1 + norm(pull.hessian * x[i])));
                    REQUIRE(size > 0);
                }
            }
        };
        check(0.0);
        check(0.0F);
    }
}

TEST_CASE("rigidity of a plate, refused where there is none", "[bending][bad]") {
    const Material cornea{.young_modulus = 0.25e6, .poisson_ratio = 0.49, .thickness = 0.5e-3};
    CHECK(flexural_rigidity(cornea) == Approx(0.25e6 * 0.125e-9 / (12 * (1 - 0.2401))));
    const auto mesh = disc();
    const auto none = bending_springs(mesh, 0);
    CHECK(none.all().empty());
    CHECK(refusal([&] { (void)bending_springs(mesh, -1.0); }) ==
          "bending_springs: rigidity must be finite and not negative [N m], got -1");
    CHECK(refusal([&] { (void)bending_springs(mesh, std::numeric_limits<double>::quiet_NaN()); }) ==
          "bending_springs: rigidity must be finite and not negative [N m], got nan");
    CHECK(refusal([] { (void)flexural_rigidity({}); }) ==
          "Material: young_modulus must be finite and positive [Pa], got 0");
}

TEST_CASE("hinges side by side do what each does alone, to the bit", "[bending]") {
    using Wide = Lanes<double>;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<Hinge<double>, Wide::count> hinges;
        std::array<Corners<double, 4>, Wide::count> x;
        for (auto& hinge : hinges) hinge = hinge_of(random.number(0.1, 2.0), random.number(-3.0, 3.0));
        for (auto& corners : x) {
            for (auto& corner : corners) corner = random.vector();
        }
        if (random.chance(0.3)) x[1][2] = x[1][0];  // without an area
        test::check_lanes(hinges, x, 0.1 * random.vector(), [](const auto& all) {
            return Hinge<Wide>{Wide::of([&](std::size_t l) { return all[l].stiffness; }),
                               Wide::of([&](std::size_t l) { return all[l].rest_sine; }),
                               Wide::of([&](std::size_t l) { return all[l].rest_cosine; })};
        });
    }
}
