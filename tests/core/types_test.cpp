// SPDX-License-Identifier: MIT
#include <membrane/core/types.hpp>

#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

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

TEMPLATE_TEST_CASE("a point is a column, from any kind of positions", "[core]", double, float) {
    using S = TestType;
    Points<S> x(3, 4);
    x << 1, 2, 3, 4,  //
        5, 6, 7, 8,   //
        9, 10, 11, 12;
    CHECK(point(x, 2) == Vector3<S>(3, 7, 11));
    CHECK(point(PointsRef<S>(x), 2) == Vector3<S>(3, 7, 11));
    CHECK(point(ConstPointsRef<S>(x), 0) == Vector3<S>(1, 5, 9));
    STATIC_REQUIRE(std::is_same_v<decltype(point(x, 0)), Vector3<S>>);
}

TEMPLATE_TEST_CASE("references to positions bind to memory of any stride without a copy", "[core]", double, float) {
    using S = TestType;
    Points<S> x(3, 10);
    x.setZero();
    const auto in_place = [](const S* memory, auto&& positions) {
        return PointsRef<S>(positions).data() == memory && ConstPointsRef<S>(positions).data() == memory;
    };
    CHECK(in_place(x.data(), x));
    CHECK(in_place(x.data() + 12, x.middleCols(4, 3)));
    Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> tall(5, 10);
    CHECK(in_place(tall.data() + 1, tall.middleRows(1, 3)));
    std::vector<S> buffer(80, S(0));
    Eigen::Map<Points<S>, 0, Eigen::OuterStride<>> strided(buffer.data() + 2, 3, 10, Eigen::OuterStride<>(8));
    CHECK(in_place(buffer.data() + 2, strided));
    PointsRef<S>(strided).col(3).setOnes();
    CHECK(buffer[2 + 3 * 8] == 1);
    CHECK(buffer[2 + 3 * 8 + 3] == 0);
    // What has no memory, or is constant, or has gaps inside a point, cannot be written to.
    STATIC_REQUIRE_FALSE(std::is_constructible_v<PointsRef<S>, const Points<S>&>);
    STATIC_REQUIRE_FALSE(std::is_constructible_v<PointsRef<S>, decltype(x + x)>);
    STATIC_REQUIRE_FALSE(std::is_convertible_v<Eigen::Matrix<S, 3, Eigen::Dynamic, Eigen::RowMajor>&, PointsRef<S>>);
    STATIC_REQUIRE(std::is_constructible_v<ConstPointsRef<S>, decltype(x + x)>);
}

TEST_CASE("float and double are scalars, nothing else is", "[core]") {
    STATIC_REQUIRE(Real<float>);
    STATIC_REQUIRE(Real<double>);
    STATIC_REQUIRE_FALSE(Real<long double>);
    STATIC_REQUIRE_FALSE(Real<int>);
    STATIC_REQUIRE_FALSE(Real<const double>);
    STATIC_REQUIRE(sizeof(Index) == 4);
    STATIC_REQUIRE(no_index < 0);
    STATIC_REQUIRE(unlimited == 2147483647);
    STATIC_REQUIRE(noexcept(dot(std::declval<Vector3<double>>(), std::declval<Vector3<double>>())));
    STATIC_REQUIRE(noexcept(point(std::declval<const Points<double>&>(), 0)));
}
