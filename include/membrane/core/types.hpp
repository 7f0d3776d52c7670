// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include <membrane/core/vector3.hpp>

/// Indices and shapes.
///
/// Units are SI everywhere: metres, newtons, seconds, kilograms, joules. Triangles run counter-clockwise seen from
/// outside. Points are the columns of a 3 x V matrix. Index letters: v a vertex, f a triangle, s a spring.
///
///     Eigen::Matrix3Xd x = mesh.positions();                                 // an own matrix, or
///     Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> y(buffer, 3, V, {8});  // an engine's vertices, in place
namespace membrane {

/// Index of a vertex, a triangle or a spring.
using Index = std::int32_t;

/// Stands for an index that does not exist.
inline constexpr Index no_index = -1;

/// Stands for a count without a limit.
inline constexpr Index unlimited = (std::numeric_limits<Index>::max)();

// How Eigen allocates and frees aligned matrices depends on the instruction set. So these are not aligned.

/// Points, one a column, 3 x V.
template <Real Scalar>
using Points = Eigen::Matrix<Scalar, 3, Eigen::Dynamic, Eigen::DontAlign>;

/// Triangles, three vertex indices a column, 3 x F.
using Triangles = Eigen::Matrix<Index, 3, Eigen::Dynamic, Eigen::DontAlign>;

namespace detail {

/// The columns of `x` as points of `Scalar`. A matrix whose number of rows is known at run time only, and is not 3, has
/// none.
template <class Scalar, class Matrix>
[[nodiscard]] decltype(auto) three_rows(Matrix& x) noexcept {
    constexpr auto rows = Matrix::RowsAtCompileTime;
    static_assert(std::same_as<typename Matrix::Scalar, Scalar>,
                  "points must be of the scalar of the part that takes them: float for a part of floats, double for a "
                  "part of doubles");
    static_assert(rows == 3 || (rows == Eigen::Dynamic && Matrix::ColsAtCompileTime != 3),
                  "points must be 3 x V, one a column: pass the transpose if yours are one a row");
    if constexpr (rows == 3) {
        return (x);
    } else {
        return x.template block<3, Eigen::Dynamic>(0, 0, 3, x.rows() == 3 ? x.cols() : 0);
    }
}

///@{
/// Eigen's `Ref` takes a `Matrix` that may be written to, or one that may only be read; or refuses it for its scalar
/// alone.
template <class Matrix, class Ref>
concept BoundBy = std::constructible_from<Ref, Matrix&> || !std::same_as<typename Matrix::Scalar, typename Ref::Scalar>;
template <class Matrix, class Ref>
concept ReadBy =
    std::constructible_from<Ref, const Matrix&> || !std::same_as<typename Matrix::Scalar, typename Ref::Scalar>;
///@}

}  // namespace detail

/// Points written in place: a matrix, a block of one, or a map of the caller's memory with any stride from one point to
/// the next. Binding never copies. A matrix that does not have three rows is an error of the compiler; if the number of
/// rows is known at run time only, it has no points, and is refused wherever a number of points is expected.
template <Real Scalar>
class PointsRef : public Eigen::Ref<Points<Scalar>, 0, Eigen::OuterStride<>> {
  public:
    using Base = Eigen::Ref<Points<Scalar>, 0, Eigen::OuterStride<>>;  ///< Eigen's.

    ///@{
    /// Binds to a matrix or a map; to a block.
    template <detail::BoundBy<Base> Matrix>
    PointsRef(Eigen::DenseBase<Matrix>& x)  // NOLINT(google-explicit-constructor)
        : Base(detail::three_rows<Scalar>(x.derived())) {}
    template <detail::ReadBy<Base> Matrix>
    PointsRef(const Eigen::DenseBase<Matrix>& x)  // NOLINT(google-explicit-constructor)
        : Base(detail::three_rows<Scalar>(x.derived())) {}
    ///@}

    using Base::operator=;
};

/// Points that are only read, as `PointsRef`. Binding copies (and allocates) only an expression without memory of its
/// own, and a row-major matrix.
template <Real Scalar>
class ConstPointsRef : public Eigen::Ref<const Points<Scalar>, 0, Eigen::OuterStride<>> {
  public:
    using Base = Eigen::Ref<const Points<Scalar>, 0, Eigen::OuterStride<>>;  ///< Eigen's.

    /// Binds to a matrix, a map or a block; copies any other expression.
    template <detail::ReadBy<Base> Matrix>
    ConstPointsRef(const Eigen::DenseBase<Matrix>& x)  // NOLINT(google-explicit-constructor)
        : Base(detail::three_rows<Scalar>(x.derived())) {}
};

/// Whether all three are of `count` vertices, 0 to `count` - 1.
[[nodiscard]] inline bool are_vertices(const std::array<Index, 3>& corners, Eigen::Index count) noexcept {
    return std::all_of(corners.begin(), corners.end(), [&](Index v) { return v >= 0 && v < count; });
}

/// Point `v` of `x`, by value. Reads number by number: compilers generate better code than for a column.
template <class Positions>
[[nodiscard]] MEMBRANE_INLINE auto point(const Positions& x, Index v) noexcept {
    return Vector3<typename Positions::Scalar>(x(0, v), x(1, v), x(2, v));
}

/// Sets point `v` of `x`.
template <Real Scalar>
void set_point(PointsRef<Scalar>& x, Index v, const Vector3<Scalar>& p) noexcept {
    Scalar* number = x.data() + v * x.outerStride();
    number[0] = p.x(), number[1] = p.y(), number[2] = p.z();
}

}  // namespace membrane
