// SPDX-License-Identifier: MIT
#include <membrane/core/vector3.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include <membrane/core/lanes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

TEMPLATE_TEST_CASE("a dot product adds x and y first, then z", "[core]", double, float) {
    using S = TestType;
    const S large = 2 / std::numeric_limits<S>::epsilon();  // + 1 is lost
    const Vector3<S> ones(1, 1, 1);
    CHECK(dot(Vector3<S>(large, 1, -large), ones) == 0);
    CHECK(dot(Vector3<S>(1, large, -large), ones) == 0);
    CHECK(dot(Vector3<S>(large, -large, 1), ones) == 1);
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> a = random.vector<S>(), b = random.vector<S>();
        volatile S x = a[0] * b[0], y = a[1] * b[1], z = a[2] * b[2];  // each rounded
        volatile S xy = x + y;
        REQUIRE(dot(a, b) == xy + z);
        REQUIRE(squared_norm(a) == dot(a, a));
        REQUIRE(norm(a) == std::sqrt(squared_norm(a)));
    }
}

TEMPLATE_TEST_CASE("a cross product is at right angles to both, by the right hand", "[core]", double, float) {
    using S = TestType;
    CHECK(cross(Vector3<S>(1, 0, 0), Vector3<S>(0, 1, 0)) == Vector3<S>(0, 0, 1));
    CHECK(cross(Vector3<S>(0, 1, 0), Vector3<S>(0, 0, 1)) == Vector3<S>(1, 0, 0));
    CHECK(cross(Vector3<S>(0, 0, 1), Vector3<S>(1, 0, 0)) == Vector3<S>(0, 1, 0));
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> a = random.vector<S>(), b = random.vector<S>(), c = cross(a, b);
        const S tolerance = 8 * std::numeric_limits<S>::epsilon();
        REQUIRE(std::abs(dot(a, c)) < tolerance);
        REQUIRE(std::abs(dot(b, c)) < tolerance);
        REQUIRE(c == Vector3<S>(-cross(b, a)));
        const S squared = squared_norm(a) * squared_norm(b) - dot(a, b) * dot(a, b);  // Lagrange's identity
        REQUIRE(std::abs(squared_norm(c) - squared) < 4 * tolerance);
    }
}

TEMPLATE_TEST_CASE("a direction has length 1, or is the other one", "[core]", double, float) {
    using S = TestType;
    const Vector3<S> other(0, 0, 1), zero(0, 0, 0);
    CHECK(direction(Vector3<S>(3, 0, 4), other) == Vector3<S>(S(3) / 5, 0, S(4) / 5));
    CHECK(direction(zero, other) == other);
    CHECK(direction(Vector3<S>(-zero), other) == other);
    CHECK(direction(Vector3<S>(std::numeric_limits<S>::quiet_NaN(), 0, 0), other) == other);
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> a = random.vector<S>() * static_cast<S>(std::pow(10, random.number(-8.0, 8.0)));
        REQUIRE(std::abs(norm(direction(a, other)) - 1) < 4 * std::numeric_limits<S>::epsilon());
    }
}

TEMPLATE_TEST_CASE("operators come to the bits of Eigen's", "[core]", double, float) {
    using S = TestType;
    using Dense = Eigen::Matrix<S, 3, 1>;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> a = random.vector<S>(), b = random.vector<S>();
        const Dense c = a, d = b;
        const S s = random.vector<S>()[0];
        const auto same = [](const Vector3<S>& ours, const Dense& theirs) { return same_bits(ours.eigen(), theirs); };
        REQUIRE(same(a + b, c + d));
        REQUIRE(same(a - b, c - d));
        REQUIRE(same(-a, -c));
        REQUIRE(same(s * a, s * c));
        REQUIRE(same(a * s, c * s));
        REQUIRE(same(a / s, c / s));
        REQUIRE(same(a.cwiseAbs(), c.cwiseAbs()));
        REQUIRE(same(a.cwiseMin(b), c.cwiseMin(d)));
        REQUIRE(same(a.cwiseMax(b), c.cwiseMax(d)));
        REQUIRE(same(a.cwiseProduct(b), c.cwiseProduct(d)));
        REQUIRE(same(a.cwiseQuotient(b), c.cwiseQuotient(d)));
        REQUIRE(a.minCoeff() == c.minCoeff());
        REQUIRE(a.maxCoeff() == c.maxCoeff());
        Vector3<S> e = a;
        e += b;
        REQUIRE(same(e, c + d));
        e -= b;
        REQUIRE(same(e, c + d - d));
        e = a, e *= s;
        REQUIRE(same(e, c * s));
        e = a, e /= s;
        REQUIRE(same(e, c / s));
        REQUIRE(same_bits(a.template cast<double>().eigen(), c.template cast<double>().eval()));
        REQUIRE(same_bits(a.template cast<float>().eigen(), c.template cast<float>().eval()));
    }
}

TEMPLATE_TEST_CASE("members are the free functions, by Eigen's names", "[core]", double, float) {
    using S = TestType;
    const Vector3<S> a(1, -2, 3), b(S(0.5), 7, -4);
    CHECK(a.dot(b) == dot(a, b));
    CHECK(a.cross(b) == cross(a, b));
    CHECK(a.squaredNorm() == squared_norm(a));
    CHECK(a.norm() == norm(a));
    CHECK(a.normalized() == direction(a, b));
    CHECK(a.sum() == 2);
    CHECK(a.isZero(3));
    CHECK_FALSE(a.isZero(2));
    for (int k = 0; k < 3; ++k) {
        Vector3<S> wild = Vector3<S>::Zero();
        CHECK(wild.isZero(0));
        wild[k] = std::numeric_limits<S>::quiet_NaN();
        CHECK_FALSE(wild.isZero(1));
        CHECK_FALSE(wild == wild);
    }
    Vector3<S> c = a;
    c.setZero();
    CHECK(c == Vector3<S>::Zero());
    CHECK(Vector3<S>::Constant(1) == Vector3<S>::Ones());
    CHECK(Vector3<S>::UnitX() == Vector3<S>::Unit(0));
    CHECK(Vector3<S>::UnitY() == Vector3<S>::Unit(1));
    CHECK(Vector3<S>::UnitZ() == Vector3<S>(0, 0, 1));
    CHECK((at_most(a, a) && at_most(a.cwiseMin(b), a)));
    CHECK_FALSE((at_most(a, b) || at_most(b, a)));
    CHECK_FALSE(at_most(a, Vector3<S>(1, std::numeric_limits<S>::quiet_NaN(), 3)));
    for (const std::size_t k : {0U, 1U, 2U}) CHECK(a[k] == a.data()[k]);
}

TEMPLATE_TEST_CASE("Eigen's columns become vectors, and take them", "[core]", double, float) {
    using S = TestType;
    using Matrix = Eigen::Matrix<S, 3, 3>;
    Eigen::Matrix<S, 3, Eigen::Dynamic> x(3, 4);
    x << 1, 2, 3, 4,  //
        5, 6, 7, 8,   //
        9, 10, 11, 12;
    const Vector3<S> a = x.col(2), b = x.col(0) + S(2) * x.col(1), c = x.template leftCols<3>() * Vector3<S>(1, 0, 1);
    CHECK(a == Vector3<S>(3, 7, 11));
    CHECK(b == Vector3<S>(5, 17, 29));
    CHECK(c == Vector3<S>(4, 12, 20));
    CHECK(x.col(2) == a);
    CHECK(x.col(0) - a == Vector3<S>(-2, -2, -2));
    CHECK(a - x.col(0) == Vector3<S>(2, 2, 2));
    x.col(3) = a;
    CHECK(x.col(3) == a);
    x.col(3) += a;
    CHECK(x.col(3) == 2 * a);
    x.col(3) -= 3 * a;
    CHECK(x.col(3) == -a);
    Eigen::Matrix<S, 3, Eigen::Dynamic> listed(3, 4);
    listed << x.template leftCols<2>(), a, b;
    CHECK(listed.col(2) == a);
    CHECK(listed.col(3) == b);
    const Eigen::Matrix<S, 3, 1> e = a, f(a);
    CHECK((e == f && e == a.eigen()));
    const Matrix turn{{S(0.6), S(-0.8), 0}, {S(0.8), S(0.6), 0}, {0, 0, 1}};
    CHECK(turn * a == (turn * e).eval());
    CHECK(a * b.transpose() == Matrix(e * b.eigen().transpose()));
    // Not from another scalar, nor from another shape.
    STATIC_REQUIRE_FALSE(std::is_convertible_v<Eigen::Matrix<S, 1, 3>, Vector3<S>>);
    STATIC_REQUIRE_FALSE(std::is_convertible_v<Eigen::Matrix<int, 3, 1>, Vector3<S>>);
}

TEST_CASE("a vector is three numbers, and nothing else", "[core]") {
    STATIC_REQUIRE(std::is_trivially_copyable_v<Vector3<float>>);
    STATIC_REQUIRE(std::is_trivially_copyable_v<Vector3<Lanes<double>>>);
    STATIC_REQUIRE(sizeof(Vector3<float>) == 3 * sizeof(float));
    STATIC_REQUIRE(sizeof(std::array<Vector3<double>, 2>) == 6 * sizeof(double));
    STATIC_REQUIRE(sizeof(Vector3<Lanes<float>>) == 3 * sizeof(Lanes<float>));
    constexpr Vector3<double> a(1, 2, 3), b = 2 * a - Vector3<double>::UnitX();
    STATIC_REQUIRE(b == Vector3<double>(1, 4, 6));
    STATIC_REQUIRE(dot(a, b) == 27);
    STATIC_REQUIRE(noexcept(dot(std::declval<Vector3<double>>(), std::declval<Vector3<double>>())));
    STATIC_REQUIRE(noexcept(a + b));
}

TEMPLATE_TEST_CASE("in lanes a vector comes to the bits of each", "[core]", double, float) {
    using S = TestType;
    using N = Lanes<S>;
    Random random(7);
    std::array<Vector3<S>, N::count> a, b;
    for (std::size_t i = 0; i < N::count; ++i) a[i] = random.vector<S>(), b[i] = random.vector<S>();
    const auto packed = [](const auto& some) {
        const auto lane = [&](int k) { return N::of([&](std::size_t i) { return some[i][k]; }); };
        return Vector3<N>(lane(0), lane(1), lane(2));
    };
    const Vector3<N> p = packed(a), q = packed(b), r = cross(p, q) / norm(p) + dot(p, q) * q - p * N(2);
    for (std::size_t i = 0; i < N::count; ++i) {
        const Vector3<S> expected = cross(a[i], b[i]) / norm(a[i]) + dot(a[i], b[i]) * b[i] - a[i] * S(2);
        CHECK(same_bits(Vector3<S>(r.x()[i], r.y()[i], r.z()[i]), expected));
    }
}
