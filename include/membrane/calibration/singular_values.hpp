// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/core/types.hpp>

/// Singular values of a matrix of few columns.
///
///     const membrane::SingularValues parts(matrix);                            // rows x columns
///     parts.values[0];                                                         // length of what becomes of a unit vector
///     parts.directions.col(0);                                                 // this one
namespace membrane {

/// By Jacobi rotations of the columns, in turn, until all are at right angles [Demmel92]: small ones are right to as many
/// digits as large ones where columns differ in length only. In no order. Offline. Cost: some 5 times rows columns^2.
struct SingularValues {
    Eigen::MatrixXd rotated;     ///< the matrix times `directions`: columns at right angles
    Eigen::MatrixXd directions;  ///< orthogonal, columns x columns
    Eigen::VectorXd values;      ///< lengths of the columns of `rotated`

    /// @pre all numbers are finite
    explicit SingularValues(const Eigen::MatrixXd& matrix);

  private:
    bool turn(Eigen::Index p, Eigen::Index q);
};

inline SingularValues::SingularValues(const Eigen::MatrixXd& matrix)
    : rotated(matrix), directions(Eigen::MatrixXd::Identity(matrix.cols(), matrix.cols())) {
    bool turned = true;
    for (int sweep = 0; turned && sweep < 40; ++sweep) {
        turned = false;
        for (Eigen::Index p = 0; p < matrix.cols(); ++p) {
            for (Eigen::Index q = p + 1; q < matrix.cols(); ++q) turned = turn(p, q) || turned;
        }
    }
    values = rotated.colwise().norm().transpose();
}

// Turns two columns in their plane to a right angle, the longer one first; whether there was anything to turn.
inline bool SingularValues::turn(Eigen::Index p, Eigen::Index q) {
    const double product = rotated.col(p).dot(rotated.col(q));
    const double first = rotated.col(p).squaredNorm(), second = rotated.col(q).squaredNorm();
    if (std::abs(product) <= 1e-15 * std::sqrt(first) * std::sqrt(second)) return false;
    const double angle = std::atan2(2 * product, first - second) / 2;
    for (auto* columns : {&rotated, &directions}) {
        const Eigen::VectorXd before = columns->col(p);
        columns->col(p) = std::cos(angle) * before + std::sin(angle) * columns->col(q);
        columns->col(q) = std::cos(angle) * columns->col(q) - std::sin(angle) * before;
    }
    return true;
}

}  // namespace membrane
