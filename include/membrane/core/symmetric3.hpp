// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>

#include <membrane/core/types.hpp>

namespace membrane {

/// A symmetric 3 x 3 matrix, stored as six numbers.
///
///     membrane::Symmetric3<double> stiffness = membrane::diagonal3(8.0);            // [N/m]
///     stiffness += membrane::outer(40.0, u);                                        // 40 u u^T
///     const auto displacement = inverse(stiffness) * force;                          // [m]
template <Number Scalar>
struct Symmetric3 {
    ///@{
    /// The entries; each off the diagonal stands for two.
    Scalar xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
    ///@}

    ///@{
    /// Sum, multiple, and product with a vector.
    MEMBRANE_INLINE Symmetric3& operator+=(const Symmetric3& b) noexcept {
        xx += b.xx, yy += b.yy, zz += b.zz, xy += b.xy, xz += b.xz, yz += b.yz;
        return *this;
    }
    [[nodiscard]] MEMBRANE_INLINE friend Symmetric3 operator*(Scalar s, const Symmetric3& a) noexcept {
        return {s * a.xx, s * a.yy, s * a.zz, s * a.xy, s * a.xz, s * a.yz};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Vector3<Scalar> operator*(const Symmetric3& a,
                                                                   const Vector3<Scalar>& b) noexcept {
        return {(a.xx * b[0] + a.xy * b[1]) + a.xz * b[2], (a.xy * b[0] + a.yy * b[1]) + a.yz * b[2],
                (a.xz * b[0] + a.yz * b[1]) + a.zz * b[2]};
    }
    ///@}

    /// Sum of the diagonal, which is the sum of the eigenvalues.
    [[nodiscard]] MEMBRANE_INLINE Scalar trace() const noexcept { return (xx + yy) + zz; }
};

/// `s` times the identity.
template <Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Symmetric3<Scalar> diagonal3(Scalar s) noexcept {
    return {s, s, s, 0, 0, 0};
}

/// s u u^T.
template <Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Symmetric3<Scalar> outer(Scalar s, const Vector3<Scalar>& u) noexcept {
    const Scalar x = s * u[0], y = s * u[1], z = s * u[2];
    return {x * u[0], y * u[1], z * u[2], x * u[1], x * u[2], y * u[2]};
}

/// The full 3 x 3 matrix.
template <Real Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 3, 3> dense(const Symmetric3<Scalar>& a) noexcept {
    return Eigen::Matrix<Scalar, 3, 3>{{a.xx, a.xy, a.xz}, {a.xy, a.yy, a.yz}, {a.xz, a.yz, a.zz}};
}

/// `a` rotated by R = `rotation`: R a R^T.
template <Real Scalar>
[[nodiscard]] Symmetric3<Scalar> rotated(const Symmetric3<Scalar>& a,
                                         const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    const Vector3<Scalar> x = rotation.row(0).transpose(), y = rotation.row(1).transpose(),
                          z = rotation.row(2).transpose();
    const Vector3<Scalar> ax = a * x, ay = a * y, az = a * z;
    return {dot(x, ax), dot(y, ay), dot(z, az), dot(x, ay), dot(x, az), dot(y, az)};
}

/// `s` times the inverse. @pre positive definite. Cost: one division. Half the digits remain if the largest eigenvalue
/// is epsilon^(-1/3) times the smallest.
template <Number Scalar>
[[nodiscard]] MEMBRANE_INLINE Symmetric3<Scalar> inverse(const Symmetric3<Scalar>& a, Scalar s = 1) noexcept {
    const Scalar xx = a.yy * a.zz - a.yz * a.yz, xy = a.xz * a.yz - a.xy * a.zz, xz = a.xy * a.yz - a.xz * a.yy;
    const Scalar scale = s / ((a.xx * xx + a.xy * xy) + a.xz * xz);
    return scale * Symmetric3<Scalar>{xx, a.xx * a.zz - a.xz * a.xz, a.xx * a.yy - a.xy * a.xy, xy,
                                      xz, a.xy * a.xz - a.xx * a.yz};
}

/// Upper bound of the eigenvalues: the root of the sum of their squares.
template <Number Scalar>
[[nodiscard]] Scalar eigenvalue_bound(const Symmetric3<Scalar>& a) noexcept {
    using std::sqrt;
    return sqrt((a.xx * a.xx + a.yy * a.yy + a.zz * a.zz) + 2 * (a.xy * a.xy + a.xz * a.xz + a.yz * a.yz));
}

/// The largest eigenvalue, in closed form [Smith61].
template <Real Scalar>
[[nodiscard]] Scalar largest_eigenvalue(const Symmetric3<Scalar>& a) noexcept {
    const Scalar mean = a.trace() / 3;
    const Vector3<Scalar> diagonal(a.xx - mean, a.yy - mean, a.zz - mean), others(a.xy, a.xz, a.yz);
    const Scalar spread = std::sqrt((squared_norm(diagonal) + 2 * squared_norm(others)) / 6);
    if (!(spread > 0)) return mean;
    const Vector3<Scalar> d = diagonal / spread, o = others / spread;
    const Scalar determinant =
        d[0] * (d[1] * d[2] - o[2] * o[2]) - o[0] * (o[0] * d[2] - o[2] * o[1]) + o[1] * (o[0] * o[2] - d[1] * o[1]);
    const Scalar cosine = (std::min)((std::max)(determinant / 2, Scalar(-1)), Scalar(1));
    return mean + 2 * spread * std::cos(std::acos(cosine) / 3);
}

}  // namespace membrane
