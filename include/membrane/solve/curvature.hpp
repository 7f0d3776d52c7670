// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include <membrane/network/mass_spring_network.hpp>

namespace membrane {

/// Largest eigenvalue of a symmetric 3 x 3 matrix, in closed form [Smith61].
template <Real Scalar>
[[nodiscard]] Scalar largest_eigenvalue(const Eigen::Matrix<Scalar, 3, 3>& a) noexcept;

/// Largest curvature that the springs of vertex `v` give the energy when it moves alone [N/m]: the largest eigenvalue
/// of the vertex's own 3 x 3 block. Moving vertices one by one converges while the step for each newton stays below 2
/// over this; the sum of stiffnesses in `Pull` is a bound of it that costs nothing.
template <Real Scalar, class Law>
[[nodiscard]] Scalar largest_curvature(const MassSpringNetwork<Scalar, Law>& network, Index v,
                                       const ConstPointsRef<Scalar>& x) noexcept;

template <Real Scalar>
Scalar largest_eigenvalue(const Eigen::Matrix<Scalar, 3, 3>& a) noexcept {
    const Scalar mean = (a(0, 0) + a(1, 1) + a(2, 2)) / 3;
    const Vector3<Scalar> diagonal(a(0, 0) - mean, a(1, 1) - mean, a(2, 2) - mean);
    const Vector3<Scalar> others(a(0, 1), a(0, 2), a(1, 2));
    const Scalar spread = std::sqrt((squared_norm(diagonal) + 2 * squared_norm(others)) / 6);
    if (!(spread > 0)) return mean;
    const Vector3<Scalar> d = diagonal / spread, o = others / spread;
    const Scalar determinant =
        d[0] * (d[1] * d[2] - o[2] * o[2]) - o[0] * (o[0] * d[2] - o[2] * o[1]) + o[1] * (o[0] * o[2] - d[1] * o[1]);
    const Scalar cosine = (std::min)((std::max)(determinant / 2, Scalar(-1)), Scalar(1));
    return mean + 2 * spread * std::cos(std::acos(cosine) / 3);
}

template <Real Scalar, class Law>
Scalar largest_curvature(const MassSpringNetwork<Scalar, Law>& network, Index v,
                         const ConstPointsRef<Scalar>& x) noexcept {
    Eigen::Matrix<Scalar, 3, 3> block = Eigen::Matrix<Scalar, 3, 3>::Zero();
    for (const auto& end : network.springs_of(v)) {
        const Vector3<Scalar> reach = point(x, end.other) - point(x, v);
        const Scalar length = norm(reach);
        if (length == 0) {
            block.diagonal().array() += end.stiffness;
            continue;
        }
        const auto answer = network.law()(SpringState<Scalar>{end.stiffness, end.rest_length, length});
        const Scalar across = answer.tension / length;
        const Vector3<Scalar> u = reach / length;
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j) block(i, j) += (answer.stiffness - across) * u[i] * u[j];
            block(i, i) += across;
        }
    }
    return largest_eigenvalue(block);
}

}  // namespace membrane
