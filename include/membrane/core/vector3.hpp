// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>

#include <Eigen/Core>

#include <membrane/core/instruction_set.hpp>
#include <membrane/core/number.hpp>

/// Three numbers: a point, a direction, a force.
///
///     const membrane::Vector3<double> a(1, 2, 3), b = x.col(v);       // from three numbers, from an Eigen column
///     const auto middle = (a + b) / 2;                                // a value, not an expression
///     x.col(v) += dot(a, b) * a;                                      // assigned to an Eigen column
///     const Eigen::Vector3d e = rotation * a;                         // or to an Eigen vector
///
/// Eigen's dot() and norm() add in an order that depends on the instruction set. Here the order is fixed: all compilers
/// and processors give the same bits unless they contract a * b + c. There are no expression templates: programs
/// compile faster, and run faster without optimisation.
namespace membrane {

template <Number N>
class Vector3;

namespace detail {

/// An Eigen expression with three rows and one column.
template <class Derived, class N>
concept Column =
    std::same_as<typename Derived::Scalar, N> && Derived::RowsAtCompileTime == 3 && Derived::ColsAtCompileTime == 1;

/// An Eigen expression that can multiply a vector.
template <class Derived, class N>
concept ThreeColumns = std::same_as<typename Derived::Scalar, N> && Derived::ColsAtCompileTime == 3;

/// Base class that makes a vector assignable to Eigen matrices by `=`, `+=` and `-=`.
template <class N>
struct ThreeByOne : Eigen::EigenBase<Vector3<N>> {
    using Scalar = N;
    enum { RowsAtCompileTime = 3, ColsAtCompileTime = 1, SizeAtCompileTime = 3 };  // NOLINT: Eigen's names

    [[nodiscard]] static constexpr Eigen::Index rows() noexcept { return 3; }
    [[nodiscard]] static constexpr Eigen::Index cols() noexcept { return 1; }
    template <class To>
    void evalTo(To& to) const {  // NOLINT(readability-identifier-naming): Eigen's
        for (Eigen::Index k = 0; k < 3; ++k) to.coeffRef(k, 0) = this->derived()[k];
    }
    template <class To>
    void addTo(To& to) const {  // NOLINT(readability-identifier-naming): Eigen's
        for (Eigen::Index k = 0; k < 3; ++k) to.coeffRef(k, 0) += this->derived()[k];
    }
    template <class To>
    void subTo(To& to) const {  // NOLINT(readability-identifier-naming): Eigen's
        for (Eigen::Index k = 0; k < 3; ++k) to.coeffRef(k, 0) -= this->derived()[k];
    }
};

}  // namespace detail

/// Three numbers; with `Lanes` several vectors. Members with capitals have the names of Eigen's.
template <Number N>
class Vector3 : public detail::ThreeByOne<N> {
  public:
    Vector3() = default;  ///< Not initialised.

    /// From its coordinates.
    MEMBRANE_INLINE constexpr Vector3(const N& x, const N& y, const N& z) noexcept : number_{x, y, z} {}

    /// From an Eigen expression of three rows and one column.
    template <detail::Column<N> Derived>
    Vector3(const Eigen::MatrixBase<Derived>& column) noexcept {  // NOLINT(google-explicit-constructor)
        const Eigen::Matrix<N, 3, 1> value = column;
        *this = Vector3(value.coeff(0), value.coeff(1), value.coeff(2));
    }

    /// The same three numbers as an Eigen vector.
    [[nodiscard]] Eigen::Matrix<N, 3, 1> eigen() const noexcept { return *this; }

    // NOLINTBEGIN(readability-identifier-naming): Eigen's names

    ///@{
    /// Vectors of equal numbers, and unit vectors along the axes.
    [[nodiscard]] static constexpr Vector3 Constant(const N& all) noexcept { return {all, all, all}; }
    [[nodiscard]] static constexpr Vector3 Zero() noexcept { return {0, 0, 0}; }
    [[nodiscard]] static constexpr Vector3 Ones() noexcept { return {1, 1, 1}; }
    [[nodiscard]] static constexpr Vector3 Unit(Eigen::Index k) noexcept {
        return {N(k == 0 ? 1 : 0), N(k == 1 ? 1 : 0), N(k == 2 ? 1 : 0)};
    }
    [[nodiscard]] static constexpr Vector3 UnitX() noexcept { return {1, 0, 0}; }
    [[nodiscard]] static constexpr Vector3 UnitY() noexcept { return {0, 1, 0}; }
    [[nodiscard]] static constexpr Vector3 UnitZ() noexcept { return {0, 0, 1}; }
    ///@}

    ///@{
    /// A coordinate.
    [[nodiscard]] MEMBRANE_INLINE constexpr N& x() noexcept { return number_[0]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr N& y() noexcept { return number_[1]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr N& z() noexcept { return number_[2]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N& x() const noexcept { return number_[0]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N& y() const noexcept { return number_[1]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N& z() const noexcept { return number_[2]; }
    ///@}

    ///@{
    /// Coordinate `k`, 0 to 2.
    [[nodiscard]] MEMBRANE_INLINE constexpr N& operator[](std::integral auto k) noexcept { return number_[k]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N& operator[](std::integral auto k) const noexcept {
        return number_[k];
    }
    ///@}

    ///@{
    /// The coordinates as three contiguous numbers.
    [[nodiscard]] MEMBRANE_INLINE constexpr N* data() noexcept { return number_; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N* data() const noexcept { return number_; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N* begin() const noexcept { return number_; }
    [[nodiscard]] MEMBRANE_INLINE constexpr const N* end() const noexcept { return number_ + 3; }
    ///@}

    ///@{
    /// Sums, multiples, and products with Eigen matrices, which are Eigen's.
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator+(const Vector3& a, const Vector3& b) noexcept {
        return {a.number_[0] + b.number_[0], a.number_[1] + b.number_[1], a.number_[2] + b.number_[2]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator-(const Vector3& a, const Vector3& b) noexcept {
        return {a.number_[0] - b.number_[0], a.number_[1] - b.number_[1], a.number_[2] - b.number_[2]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator-(const Vector3& a) noexcept {
        return {-a.number_[0], -a.number_[1], -a.number_[2]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator*(const N& s, const Vector3& a) noexcept {
        return {s * a.number_[0], s * a.number_[1], s * a.number_[2]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator*(const Vector3& a, const N& s) noexcept {
        return {a.number_[0] * s, a.number_[1] * s, a.number_[2] * s};
    }
    [[nodiscard]] MEMBRANE_INLINE friend constexpr Vector3 operator/(const Vector3& a, const N& s) noexcept {
        return {a.number_[0] / s, a.number_[1] / s, a.number_[2] / s};
    }
    template <detail::ThreeColumns<N> Derived>
    [[nodiscard]] friend auto operator*(const Eigen::MatrixBase<Derived>& matrix, const Vector3& a) noexcept {
        return (matrix * a.eigen()).eval();
    }
    [[nodiscard]] friend Eigen::Matrix<N, 3, 3> operator*(const Vector3& a,
                                                          const Eigen::Matrix<N, 1, 3>& row) noexcept {
        return a.eigen() * row;
    }
    ///@}

    ///@{
    /// For comma initialisers: `x << columns, a, b`.
    template <class Matrix>
    friend Eigen::CommaInitializer<Matrix>& operator,(Eigen::CommaInitializer<Matrix>& list, const Vector3& a) {
        return list, a.eigen();
    }
    template <class Matrix>
    friend Eigen::CommaInitializer<Matrix>& operator,(Eigen::CommaInitializer<Matrix>&& list, const Vector3& a) {
        return list, a.eigen();
    }
    ///@}

    ///@{
    /// In place.
    MEMBRANE_INLINE constexpr Vector3& operator+=(const Vector3& b) noexcept { return *this = *this + b; }
    MEMBRANE_INLINE constexpr Vector3& operator-=(const Vector3& b) noexcept { return *this = *this - b; }
    MEMBRANE_INLINE constexpr Vector3& operator*=(const N& s) noexcept { return *this = *this * s; }
    MEMBRANE_INLINE constexpr Vector3& operator/=(const N& s) noexcept { return *this = *this / s; }
    MEMBRANE_INLINE constexpr void setZero() noexcept { *this = Zero(); }
    ///@}

    /// Whether all three numbers are equal; -0 equals 0.
    [[nodiscard]] MEMBRANE_INLINE friend constexpr bool operator==(const Vector3& a, const Vector3& b) noexcept {
        return a.number_[0] == b.number_[0] && a.number_[1] == b.number_[1] && a.number_[2] == b.number_[2];
    }

    ///@{
    /// Products and lengths. Terms are added in the order (x + y) + z.
    [[nodiscard]] MEMBRANE_INLINE constexpr N dot(const Vector3& b) const noexcept {
        return (number_[0] * b.number_[0] + number_[1] * b.number_[1]) + number_[2] * b.number_[2];
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3 cross(const Vector3& b) const noexcept {
        return {number_[1] * b.number_[2] - number_[2] * b.number_[1],
                number_[2] * b.number_[0] - number_[0] * b.number_[2],
                number_[0] * b.number_[1] - number_[1] * b.number_[0]};
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr N squaredNorm() const noexcept { return dot(*this); }
    [[nodiscard]] MEMBRANE_INLINE N norm() const noexcept {
        using std::sqrt;
        return sqrt(squaredNorm());
    }
    ///@}

    /// At unit length. @pre not zero
    [[nodiscard]] MEMBRANE_INLINE Vector3 normalized() const noexcept { return *this / norm(); }

    ///@{
    /// Sum, least and greatest of the three numbers.
    [[nodiscard]] MEMBRANE_INLINE constexpr N sum() const noexcept { return (number_[0] + number_[1]) + number_[2]; }
    [[nodiscard]] MEMBRANE_INLINE constexpr N minCoeff() const noexcept {
        return (std::min)((std::min)(number_[0], number_[1]), number_[2]);
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr N maxCoeff() const noexcept {
        return (std::max)((std::max)(number_[0], number_[1]), number_[2]);
    }
    ///@}

    /// Whether no number exceeds `tolerance` in magnitude.
    [[nodiscard]] bool isZero(const N& tolerance) const noexcept {
        return std::abs(number_[0]) <= tolerance && std::abs(number_[1]) <= tolerance &&
               std::abs(number_[2]) <= tolerance;
    }

    ///@{
    /// Number by number.
    [[nodiscard]] MEMBRANE_INLINE Vector3 cwiseAbs() const noexcept {
        return {std::abs(number_[0]), std::abs(number_[1]), std::abs(number_[2])};
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3 cwiseMin(const Vector3& b) const noexcept {
        return {(std::min)(number_[0], b.number_[0]), (std::min)(number_[1], b.number_[1]),
                (std::min)(number_[2], b.number_[2])};
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3 cwiseMax(const Vector3& b) const noexcept {
        return {(std::max)(number_[0], b.number_[0]), (std::max)(number_[1], b.number_[1]),
                (std::max)(number_[2], b.number_[2])};
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3 cwiseProduct(const Vector3& b) const noexcept {
        return {number_[0] * b.number_[0], number_[1] * b.number_[1], number_[2] * b.number_[2]};
    }
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3 cwiseQuotient(const Vector3& b) const noexcept {
        return {number_[0] / b.number_[0], number_[1] / b.number_[1], number_[2] / b.number_[2]};
    }
    ///@}

    /// Each number converted to `To`, as by `static_cast`.
    template <Number To>
    [[nodiscard]] MEMBRANE_INLINE constexpr Vector3<To> cast() const noexcept {
        return {static_cast<To>(number_[0]), static_cast<To>(number_[1]), static_cast<To>(number_[2])};
    }
    /// An Eigen row: for `a * b.transpose()` and for printing.
    [[nodiscard]] Eigen::Matrix<N, 1, 3> transpose() const noexcept { return {number_[0], number_[1], number_[2]}; }
    // NOLINTEND(readability-identifier-naming)

  private:
    N number_[3];
};

///@{
/// Products and lengths, as the members of the same name. Terms are added in the order (x + y) + z.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE constexpr N dot(const Vector3<N>& a, const Vector3<N>& b) noexcept {
    return a.dot(b);
}

template <Number N>
[[nodiscard]] MEMBRANE_INLINE constexpr N squared_norm(const Vector3<N>& a) noexcept {
    return a.dot(a);
}

template <Number N>
[[nodiscard]] MEMBRANE_INLINE N norm(const Vector3<N>& a) noexcept {
    return a.norm();
}

template <Number N>
[[nodiscard]] MEMBRANE_INLINE constexpr Vector3<N> cross(const Vector3<N>& a, const Vector3<N>& b) noexcept {
    return a.cross(b);
}
///@}

/// Whether each number of `a` is at most that of `b`.
template <Real Scalar>
[[nodiscard]] MEMBRANE_INLINE constexpr bool at_most(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
    return a.x() <= b.x() && a.y() <= b.y() && a.z() <= b.z();
}

/// `a` at unit length, or `otherwise` if `a` is zero.
template <Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Vector3<Scalar> direction(const Vector3<Scalar>& a,
                                                        const Vector3<Scalar>& otherwise) noexcept {
    const Scalar length = norm(a);
    return length > 0 ? a / length : otherwise;
}

}  // namespace membrane

namespace Eigen::internal {

template <class N>
struct traits<membrane::Vector3<N>> : traits<Matrix<N, 3, 1>> {
    using StorageKind = membrane::Vector3<N>;
};
template <class N>
struct storage_kind_to_shape<membrane::Vector3<N>> {
    using Shape = membrane::Vector3<N>;
};

}  // namespace Eigen::internal
