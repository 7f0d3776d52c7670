// SPDX-License-Identifier: MIT
#include <membrane/tissue/incompressible_triangle.hpp>

#include <cmath>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/large_strain.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double smallest_ratio = IncompressibleTriangle<double>::min_area_ratio;

}  // namespace

TEST_CASE("the invariant of a triangle is that of its deformation", "[incompressible]") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Eigen::Matrix2d f = test::random_deformation(random, 0.5, 3);
        const test::DeformedTriangle triangle(random, std::pow(10, random.number(-4.0, 0.0)), f);
        const auto rest = incompressible_triangle(triangle.rest);
        REQUIRE(rest.area() == Approx(triangle.area));
        REQUIRE(rest.invariant(triangle.now) == Approx(test::invariant(f)).epsilon(1e-9).margin(1e-12));
        REQUIRE(std::abs(rest.invariant(triangle.rest)) < 1e-14);
        const double s = 1e-5;  // by scaling
        auto larger = triangle.now, smaller = triangle.now;
        for (std::size_t i = 0; i < 3; ++i) larger[i] *= 1 + s, smaller[i] *= 1 - s;
        const double slope = (rest.invariant(larger) - rest.invariant(smaller)) / (2 * s);
        REQUIRE(2 * rest.invariant_dilation(triangle.now) == Approx(slope).epsilon(1e-7).margin(1e-7));
    }
}

// 1 / s, its first and its second derivative, on both sides of where the polynomial begins.
TEST_CASE("the invariant continues smoothly into a collapsed triangle", "[incompressible]") {
    const double start = smallest_ratio * smallest_ratio;
    for (const double s : {start * (1 + 1e-9), start * (1 - 1e-9)}) {
        const detail::InverseSquare<double> inverse(s);
        CHECK(inverse.value() == Approx(1 / s).epsilon(1e-12));
        CHECK(inverse.slope() == Approx(-1 / (s * s)).epsilon(1e-8));
        CHECK(inverse.curvature() == Approx(2 / (s * s * s)).epsilon(1e-8));
        CHECK(inverse.by_ratio() == Approx(3 / (s * s)).epsilon(1e-8));
    }
    const detail::InverseSquare<double> flat(0);
    CHECK(flat.value() == Approx(3 / start));
    CHECK(flat.slope() == Approx(-3 / (start * start)));
}

TEST_CASE("the change of the invariant is exact for displacements of any size", "[incompressible]") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const test::DeformedTriangle triangle(random, 1, test::random_deformation(random, 0.1, 2));
        const auto rest = incompressible_triangle(triangle.rest);
        const auto wide = [&](const Corners<double, 3>& x) {  // I1 - 3 in long double
            long double f[2][3], normal[3], sum = 0, square = 0;
            for (int k = 0; k < 3; ++k) {
                const long double first = static_cast<long double>(x[1][k]) - x[0][k];
                f[0][k] = rest.along * first;
                f[1][k] = rest.skew * first + rest.across * (static_cast<long double>(x[2][k]) - x[0][k]);
                sum += f[0][k] * f[0][k] + f[1][k] * f[1][k];
            }
            for (int k = 0; k < 3; ++k) {
                const int a = (k + 1) % 3, b = (k + 2) % 3;
                normal[k] = f[0][a] * f[1][b] - f[0][b] * f[1][a];
                square += normal[k] * normal[k];
            }
            const long double start = static_cast<long double>(smallest_ratio * smallest_ratio);
            const long double q = square / start - 1;
            return sum + (q > 0 ? 1 / square : (1 + q * (q - 1)) / start) - 3;
        };
        const auto i = static_cast<std::size_t>(random.index(3));
        for (const double size : {1e-9, 1e-6, 1e-3, 1.0}) {
            CAPTURE(size);
            auto x = triangle.now, there = triangle.now;
            for (auto& corner : x) {  // so that the displacement is exact
                for (int k = 0; k < 3; ++k) corner[k] = std::round(corner[k] * 0x1p30) * 0x1p-30;
            }
            Vector3<double> displacement = size * random.unit_vector();
            for (int k = 0; k < 3; ++k) displacement[k] = std::round(displacement[k] * 0x1p50) * 0x1p-50;
            there = x;
            there[i] += displacement;
            const auto change = rest.invariant_change(x, i, displacement);
            const auto expected = static_cast<double>(wide(there) - wide(x));
            REQUIRE(std::abs(change.change - expected) < 1e-14 * change.size + 1e-16);
            REQUIRE(change.size < 1e5 * size * (1 + size * size));
        }
    }
}

TEST_CASE("a rest shape is the same in each order of its corners", "[incompressible]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const test::DeformedTriangle triangle(random, 1, test::random_deformation(random, 0.1, 2));
        const auto rest = incompressible_triangle(triangle.rest);
        for (std::size_t i = 0; i < 3; ++i) {
            const auto& order = rest.orders[i];
            REQUIRE(order[0] == i);
            const auto ordered = rest.in_order(i);
            const auto& x = triangle.now;
            REQUIRE(ordered.invariant(Corners<double, 3>{x[order[0]], x[order[1]], x[order[2]]}) ==
                    Approx(rest.invariant(x)).epsilon(1e-12).margin(1e-12));
            REQUIRE(ordered.area() == Approx(rest.area()).epsilon(1e-12));
        }
    }
}

TEST_CASE("no eigenvalue of a corner's Hessian is below that of the invariant", "[incompressible]") {
    int exact = 0;
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const test::DeformedTriangle triangle(random, 1, test::random_deformation(random, 0.1, 2));
        const auto rest = incompressible_triangle(triangle.rest);
        for (std::size_t i = 0; i < 3; ++i) {
            const Eigen::Matrix3d bound = dense(rest.invariant_slope(triangle.now, i).hessian);
            const Eigen::Matrix3d block = rest.invariant_hessian(triangle.now, i, i);
            const double rounding = 1e-10 * (bound.norm() + block.norm());
            REQUIRE(test::eigenvalues_of(bound)[0] > -rounding);
            REQUIRE(test::eigenvalues_of(bound - block)[0] > -rounding);
            if (test::eigenvalues_of(block)[0] < 0) continue;
            REQUIRE((bound - block).norm() < rounding);
            ++exact;
        }
    }
    CHECK(exact > 0);
}
