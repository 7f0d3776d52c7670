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
///     Eigen::Matrix3Xd x = mesh.positions();                                 // a matrix of one's own, or
///     Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> y(buffer, 3, V, {8});  // an engine's vertices, in place
namespace membrane {

/// Number of a vertex, a triangle or a spring.
using Index = std::int32_t;

/// In place of an index: there is none.
inline constexpr Index no_index = -1;

/// In place of a count: no limit.
inline constexpr Index unlimited = (std::numeric_limits<Index>::max)();

// How Eigen aligns, allocates and frees memory depends on the instruction set, but not for those that are not aligned.

/// One point a column, 3 x V.
template <Real Scalar>
using Points = Eigen::Matrix<Scalar, 3, Eigen::Dynamic, Eigen::DontAlign>;

/// Three vertices a column, 3 x F.
using Triangles = Eigen::Matrix<Index, 3, Eigen::Dynamic, Eigen::DontAlign>;

/// Points that a part writes in place: a matrix, a block of one, or a map of somebody's memory with any stride from
/// one point to the next. Binding never copies.
template <Real Scalar>
using PointsRef = Eigen::Ref<Points<Scalar>, 0, Eigen::OuterStride<>>;

/// Points that a part only reads. Binding copies (and allocates) only for an expression that has no memory of its own.
template <Real Scalar>
using ConstPointsRef = Eigen::Ref<const Points<Scalar>, 0, Eigen::OuterStride<>>;

/// Point `v` of `x`, by value; read number by number, which compilers make better code of than of a column.
template <class Positions>
[[nodiscard]] auto point(const Positions& x, Index v) noexcept {
    return Vector3<typename Positions::Scalar>(x(0, v), x(1, v), x(2, v));
}

}  // namespace membrane
