// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <membrane/core/types.hpp>

namespace examples {

/// Distance of `x` from the shape `rest`: the largest distance between corresponding points, after the rigid motion
/// that brings them together best in the least squares [Kabsch76]. Both 3 x V, in one unit, which is also the result's.
[[nodiscard]] inline double distance_from_shape(const membrane::Points<double>& x,
                                                const membrane::Points<double>& rest) {
    const Eigen::Vector3d x_middle = x.rowwise().mean(), rest_middle = rest.rowwise().mean();
    const membrane::Points<double> from = x.colwise() - x_middle, to = rest.colwise() - rest_middle;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(to * from.transpose(), Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
    const double mirrored = (u * v.transpose()).determinant() < 0 ? -1 : 1;
    const Eigen::Matrix3d rotation = u * Eigen::Vector3d(1, 1, mirrored).asDiagonal() * v.transpose();
    return (rotation * from - to).colwise().norm().maxCoeff();
}

}  // namespace examples
