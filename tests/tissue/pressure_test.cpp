// SPDX-License-Identifier: MIT
#include <membrane/tissue/pressure.hpp>

#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
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

double volume_of(const Triangles& triangles, const Points<double>& x) {
    double sum = 0;
    for (const auto& f : triangles.colwise()) sum += x.col(f[0]).dot(x.col(f[1]).cross(x.col(f[2]))) / 6;
    return sum;
}

template <class Kind>
double energy_of(const Kind& elements, const Points<double>& x) {
    double sum = 0;
    for (const auto& placed : elements.all()) sum += placed.element.energy(elements.where(placed, x));
    return sum;
}

template <class Kind>
Eigen::Vector3d force_of(const Kind& elements, Index v, const Points<double>& x) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    elements.for_each(v, x, [&](const auto& placed, const auto& corners, std::size_t i) {
        sum += placed.element.force_on(corners, i).force;
    });
    return sum;
}

}  // namespace

TEST_CASE("pressure on a closed surface is the derivative of pressure times volume", "[pressure]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_closed_surface<double>(random).mesh();
        const Points<double> x = mesh.positions();
        const double size = (x.colwise() - x.rowwise().mean().eval()).colwise().norm().maxCoeff();
        const double p = random.number(-2000.0, 2000.0), scale = std::abs(p) * size * size;
        const auto pressed = pressure(mesh, p);
        REQUIRE(energy_of(pressed, x) == Approx(-p * volume_of(mesh.triangles(), x)));
        const Index v = random.index(mesh.vertex_count());
        const Eigen::Vector3d force = force_of(pressed, v, x);
        for (Eigen::Index k = 0; k < 3; ++k) {
            Points<double> before = x, after = x;
            before(k, v) -= 1e-5 * size;
            after(k, v) += 1e-5 * size;
            const double slope = p * (volume_of(mesh.triangles(), after) - volume_of(mesh.triangles(), before));
            REQUIRE(std::abs(slope / (2e-5 * size) - force[k]) < 1e-7 * scale);
        }
        double change = 0;
        const Vector3<double> displacement = random.number(0.0, 0.5) * size * random.unit_vector();
        pressed.for_each(v, x, [&](const auto& placed, const auto& corners, std::size_t i) {
            change += placed.element.energy_change(corners, i, displacement).change;
        });
        Points<double> there = x;
        there.col(v) += displacement;
        REQUIRE(std::abs(change - (energy_of(pressed, there) - energy_of(pressed, x))) < 1e-10 * scale * size);
    }
}

TEST_CASE("the second derivative of pressure, all triangles together", "[pressure]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::surface_of(icosphere({.radius = 1, .subdivisions = 0})).mesh();
        const Points<double> x = test::jittered(mesh.positions(), 0.2, random);
        const auto pressed = pressure(mesh, 3.0);
        Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(3 * x.cols(), 3 * x.cols()), differences = whole;
        for (const auto& placed : pressed.all()) {
            const auto corners = pressed.where(placed, x);
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t j = 0; j < 3; ++j) {
                    const Eigen::Matrix3d block = placed.element.hessian_block(corners, i, j);
                    REQUIRE((block + block.transpose()).isZero(0));  // as of a product with another corner
                    whole.block<3, 3>(3 * placed.corners[i], 3 * placed.corners[j]) += block;
                }
            }
        }
        for (Index w = 0; w < x.cols(); ++w) {
            for (Eigen::Index k = 0; k < 3; ++k) {
                Points<double> before = x, after = x;
                before(k, w) -= 1e-4;
                after(k, w) += 1e-4;
                for (Index v = 0; v < x.cols(); ++v) {
                    differences.block<3, 1>(3 * v, 3 * w + k) =
                        (force_of(pressed, v, before) - force_of(pressed, v, after)) / 2e-4;
                }
            }
        }
        REQUIRE((whole - differences).cwiseAbs().maxCoeff() < 1e-9);
    }
}

TEST_CASE("a pressed sphere of stretched tissue is as large as Laplace says", "[pressure]") {
    // Force on each vertex of a regular mesh: pressure outward, tension 2 T / r inward, to the second order of h.
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.47, .thickness = 1e-5};
    double coarse = 0;
    for (const Index subdivisions : {2, 3, 4}) {
        const auto mesh = icosphere({.radius = 0.01, .subdivisions = subdivisions});
        const auto stretched = triangular_springs(mesh, material, 1.05);
        const auto& first = stretched.all()[0];
        const double tension = first.element.mean_tension(stretched.where(first, mesh.positions()));
        const auto pressed = pressure(mesh, 2 * tension / 0.01);
        double out = 0, in = 0;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Eigen::Vector3d outward = mesh.positions().col(v) / 0.01;
            out += force_of(pressed, v, mesh.positions()).dot(outward);
            in -= force_of(stretched, v, mesh.positions()).dot(outward);
        }
        const double error = std::abs(out / in - 1);
        CAPTURE(subdivisions, error);
        CHECK(error < 0.02);
        if (coarse > 0) CHECK(error < coarse / 3);
        coarse = error;
    }
}

TEST_CASE("with balancing loads the mesh is the shape at rest, to the bit", "[pressure]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto check = [&](auto scalar) {
            using S = decltype(scalar);
            const auto mesh = test::random_surface<S>(random).mesh();
            const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(3), .rest_length = S(0)});
            const auto stretched = triangular_springs(
                mesh, {.young_modulus = 1e5, .poisson_ratio = random.number(0.0, 0.5), .thickness = 1e-4}, 1.1);
            const auto loads = balancing_loads(mesh, Tissue(springs, stretched));
            const auto still = Tissue(springs, stretched, loads);
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                REQUIRE(still.force_on(v, mesh.positions()).force == Vector3<S>::Zero());
            }
            const DeadLoad<double> load{random.vector()};
            test::check_element(load, Corners<double, 1>{random.vector()}, 1, 1, random);
            REQUIRE(test::check_remainder(load, Corners<double, 1>{random.vector()}, 1, 1, random) == 1);
        };
        check(0.0);
        check(0.0F);
    }
}

TEST_CASE("a pressure that is none, and a network of another mesh, are refused", "[pressure][bad]") {
    const auto mesh = icosphere({.subdivisions = 1});
    CHECK(refusal([&] { (void)pressure(mesh, std::numeric_limits<double>::infinity()); }) ==
          "pressure: value must be finite [Pa], got inf");
    const auto other = MassSpringNetwork(icosphere({.subdivisions = 0}), LinearSpring{}, {.stiffness = 1.0});
    CHECK(refusal([&] { (void)balancing_loads(mesh, other); }) ==
          "balancing_loads: the network must have as many vertices as the mesh, 42, got 12");
}

TEST_CASE("pressed triangles and loads side by side do what each does alone, to the bit", "[pressure]") {
    using Wide = Lanes<double>;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<PressureLoad<double>, Wide::count> triangles;
        std::array<DeadLoad<double>, Wide::count> loads;
        std::array<Corners<double, 3>, Wide::count> x;
        std::array<Corners<double, 1>, Wide::count> vertices;
        for (std::size_t l = 0; l < Wide::count; ++l) {
            triangles[l] = {random.number(-2.0, 2.0)};
            loads[l] = {random.vector()};
            for (auto& corner : x[l]) corner = random.vector();
            vertices[l] = {x[l][0]};
        }
        test::check_lanes(triangles, x, random.vector(), [](const auto& all) {
            return PressureLoad<Wide>{Wide::of([&](std::size_t l) { return all[l].pressure; })};
        });
        test::check_lanes(loads, vertices, random.vector(), [](const auto& all) {
            const auto along = [&](int k) { return Wide::of([&](std::size_t l) { return all[l].force[k]; }); };
            return DeadLoad<Wide>{{along(0), along(1), along(2)}};
        });
    }
}
