// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

/// Scalars, indices, shapes and the few sums whose order matters.
///
/// Units are SI everywhere: metres, newtons, seconds, kilograms, joules. Triangles run counter-clockwise seen from
/// outside. Points are the columns of a 3 x V matrix. Index letters: v a vertex, f a triangle, s a spring.
///
///     Eigen::Matrix3Xd x = mesh.positions();                                 // a matrix of one's own, or
///     Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> y(buffer, 3, V, {8});  // an engine's vertices, in place
namespace membrane {

/// `float` or `double`: the type of every length, force and time of one scene.
template <class T>
concept Real = std::same_as<T, float> || std::same_as<T, double>;

/// A `Real`, or several of them side by side: `Lanes`.
template <class N>
concept Number = Real<N> || requires {
    requires Real<typename N::Each>;
};

namespace detail {

template <class N>
struct EachOf {
    using Type = typename N::Each;
};
template <Real N>
struct EachOf<N> {
    using Type = N;
};

}  // namespace detail

/// The `Real` that a number is made of.
template <Number N>
using Each = typename detail::EachOf<N>::Type;

/// Number of a vertex, a triangle or a spring.
using Index = std::int32_t;

/// In place of an index: there is none.
inline constexpr Index no_index = -1;

/// In place of a count: no limit.
inline constexpr Index unlimited = (std::numeric_limits<Index>::max)();

template <Number Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

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

// Eigen's own dot() and norm() add in an order that depends on the instruction set. These do not, so that every
// compiler and processor comes to the same bits as long as it does not contract a * b + c.

template <Number Scalar>
[[nodiscard]] constexpr Scalar dot(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
    return (a.x() * b.x() + a.y() * b.y()) + a.z() * b.z();
}

template <Number Scalar>
[[nodiscard]] constexpr Scalar squared_norm(const Vector3<Scalar>& a) noexcept {
    return dot(a, a);
}

template <Number Scalar>
[[nodiscard]] Scalar norm(const Vector3<Scalar>& a) noexcept {
    using std::sqrt;
    return sqrt(squared_norm(a));
}

template <Number Scalar>
[[nodiscard]] Vector3<Scalar> cross(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
    return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x()};
}

/// `a` at unit length, or `otherwise` where `a` has no direction.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> direction(const Vector3<Scalar>& a, const Vector3<Scalar>& otherwise) noexcept {
    const Scalar length = norm(a);
    return length > 0 ? Vector3<Scalar>(a / length) : otherwise;
}

/// Point `v` of `x`, by value; read number by number, which compilers make better code of than of a column.
template <class Positions>
[[nodiscard]] auto point(const Positions& x, Index v) noexcept {
    return Vector3<typename Positions::Scalar>(x(0, v), x(1, v), x(2, v));
}

}  // namespace membrane
