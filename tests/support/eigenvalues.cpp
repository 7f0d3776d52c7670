// SPDX-License-Identifier: MIT
#include "support/eigenvalues.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace test {

namespace {

using Symmetric = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

}  // namespace

Eigen::VectorXd eigenvalues_of(const Eigen::MatrixXd& symmetric) {
    return Symmetric(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigenpair largest_eigenpair(const Eigen::MatrixXd& symmetric) {
    const Symmetric solver(symmetric);
    return {solver.eigenvalues().tail<1>()[0], solver.eigenvectors().rightCols<1>()};
}

double spectral_radius(const Eigen::MatrixXd& a) { return a.eigenvalues().cwiseAbs().maxCoeff(); }

Eigen::MatrixXd solve(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return a.partialPivLu().solve(b); }

}  // namespace test
