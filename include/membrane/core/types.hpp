// SPDX-License-Identifier: MIT
#pragma once

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

/// Points written in place: a matrix, a block of one, or a map of the caller's memory with any stride from one point to
/// the next. Binding never copies.
template <Real Scalar>
using PointsRef = Eigen::Ref<Points<Scalar>, 0, Eigen::OuterStride<>>;

/// Points that are only read. Binding copies (and allocates) only an expression without memory of its own.
template <Real Scalar>
using ConstPointsRef = Eigen::Ref<const Points<Scalar>, 0, Eigen::OuterStride<>>;

/// Point `v` of `x`, by value. Reads number by number: compilers generate better code than for a column.
template <class Positions>
[[nodiscard]] auto point(const Positions& x, Index v) noexcept {
    return Vector3<typename Positions::Scalar>(x(0, v), x(1, v), x(2, v));
}

/// Sets point `v` of `x`.
template <Real Scalar>
void set_point(PointsRef<Scalar>& x, Index v, const Vector3<Scalar>& p) noexcept {
    Scalar* number = x.data() + v * x.outerStride();
    number[0] = p.x(), number[1] = p.y(), number[2] = p.z();
}

}  // namespace membrane
