// SPDX-License-Identifier: MIT
#include <membrane/core/types.hpp>

#include <type_traits>
#include <utility>
#include <vector>

#include "support/catch.hpp"

using namespace membrane;

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
    PointsRef<S> middle(x.middleCols(1, 2));
    set_point(middle, 1, Vector3<S>(13, 14, 15));
    CHECK(x.col(2) == Eigen::Matrix<S, 3, 1>(13, 14, 15));
    CHECK(x.sum() == 78 - (3 + 7 + 11) + (13 + 14 + 15));  // no other number
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

TEMPLATE_TEST_CASE("a matrix of any number of rows but three has no points", "[core][bad]", double, float) {
    using Matrix = Eigen::Matrix<TestType, Eigen::Dynamic, Eigen::Dynamic>;
    const auto columns = [](auto&& x) {
        const auto count = PointsRef<TestType>(x).cols();
        CHECK(ConstPointsRef<TestType>(x).cols() == count);
        return count;
    };
    Matrix right = Matrix::Random(3, 10), rows = Matrix::Random(10, 3), four = Matrix::Random(4, 10);
    CHECK(columns(right) == 10);
    CHECK(columns(rows) == 0);
    CHECK(columns(four) == 0);
    CHECK(columns(four.leftCols(5)) == 0);
    CHECK(columns(four.bottomRows(3)) == 10);
    CHECK(ConstPointsRef<TestType>(TestType(2) * right) == TestType(2) * right);
    CHECK(ConstPointsRef<TestType>(TestType(2) * rows).cols() == 0);
    const Eigen::Matrix<TestType, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> row_major = right;
    CHECK(ConstPointsRef<TestType>(row_major) == right);  // a copy
    STATIC_REQUIRE_FALSE(std::is_convertible_v<decltype(row_major), PointsRef<TestType>>);
}

TEST_CASE("an index has 32 bits", "[core]") {
    STATIC_REQUIRE(sizeof(Index) == 4);
    STATIC_REQUIRE(no_index < 0);
    STATIC_REQUIRE(unlimited == 2147483647);
    STATIC_REQUIRE(noexcept(point(std::declval<const Points<double>&>(), 0)));
}
