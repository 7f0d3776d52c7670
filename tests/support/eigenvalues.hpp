// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

/// What matrices are held against, by Eigen's decompositions, which are compiled here once.
namespace test {

/// Of a symmetric matrix, the least first.
Eigen::VectorXd eigenvalues_of(const Eigen::MatrixXd& symmetric);

struct Eigenpair {
    double value;
    Eigen::VectorXd vector;  // of norm 1
};

/// Of a symmetric matrix.
Eigenpair largest_eigenpair(const Eigen::MatrixXd& symmetric);

/// The largest absolute value of the eigenvalues, complex ones among them.
double spectral_radius(const Eigen::MatrixXd& a);

/// The X of A X = B, with A invertible.
Eigen::MatrixXd solve(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

}  // namespace test
