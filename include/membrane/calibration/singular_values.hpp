// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/core/types.hpp>

/// Singular values of a matrix with few columns.
///
///     const membrane::SingularValues parts(matrix);                            // rows x columns
///     parts.values[0];                                                         // a singular value
///     parts.directions.col(0);                                                 // its right singular vector
namespace membrane {

/// One-sided Jacobi method: rotates pairs of columns until all columns are orthogonal [Demmel92]. If columns differ
/// only in length, small values have the same relative accuracy as large ones. Values are not sorted. Offline. Cost:
/// about 5 rows columns^2.
struct SingularValues {
    Eigen::MatrixXd rotated;     ///< the matrix times `directions`: orthogonal columns
    Eigen::MatrixXd directions;  ///< orthogonal, columns x columns
    Eigen::VectorXd values;      ///< norms of the columns of `rotated`

    /// @pre all numbers are finite
    explicit SingularValues(const Eigen::MatrixXd& matrix);

  private:
    bool orthogonalise(Eigen::Index p, Eigen::Index q);
};

inline SingularValues::SingularValues(const Eigen::MatrixXd& matrix)
    : rotated(matrix), directions(Eigen::MatrixXd::Identity(matrix.cols(), matrix.cols())) {
    bool changed = true;
    for (int sweep = 0; changed && sweep < 40; ++sweep) {
        changed = false;
        for (Eigen::Index p = 0; p < matrix.cols(); ++p) {
            for (Eigen::Index q = p + 1; q < matrix.cols(); ++q) changed = orthogonalise(p, q) || changed;
        }
    }
    values = rotated.colwise().norm().transpose();
}

// Rotates two columns in their plane until they are orthogonal, the longer one first; false if they already were.
inline bool SingularValues::orthogonalise(Eigen::Index p, Eigen::Index q) {
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
