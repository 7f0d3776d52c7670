// SPDX-License-Identifier: MIT
#include "support/sparse_newton.hpp"

#include <cstddef>
#include <limits>
#include <vector>

namespace test {

membrane::Points<double> StillMembrane::forces(const membrane::Points<double>& x) const {
    membrane::Points<double> sum = load_;
    for (Eigen::Index v = 0; v < x.cols(); ++v) {
        sum.col(v) += foundation_[static_cast<std::size_t>(v)] * (anchors_.col(v) - x.col(v));
    }
    for (const auto& s : springs_) {
        const Eigen::Vector3d edge = x.col(s.second) - x.col(s.first);
        const Eigen::Vector3d pull = s.stiffness * (edge - s.rest_length * edge.normalized());
        sum.col(s.first) += pull;
        sum.col(s.second) -= pull;
    }
    return sum;
}

Eigen::SparseMatrix<double> StillMembrane::stiffness(const membrane::Points<double>& x) const {
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](Eigen::Index i, Eigen::Index j, const Eigen::Matrix3d& block) {
        const bool zero = is_fixed(i) || is_fixed(j);
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column) {
                entries.emplace_back(3 * i + row, 3 * j + column, zero ? 0 : block(row, column));
            }
        }
    };
    for (Eigen::Index v = 0; v < x.cols(); ++v) {
        for (int k = 0; k < 3; ++k) {
            const double own = foundation_[static_cast<std::size_t>(v)];
            entries.emplace_back(3 * v + k, 3 * v + k, is_fixed(v) ? 1 : own);
        }
    }
    for (const auto& s : springs_) {
        const Eigen::Vector3d edge = x.col(s.second) - x.col(s.first), u = edge.normalized();
        const double q = s.rest_length / edge.norm();
        const Eigen::Matrix3d block = s.stiffness * ((1 - q) * Eigen::Matrix3d::Identity() + q * u * u.transpose());
        add(s.first, s.first, block);
        add(s.second, s.second, block);
        add(s.first, s.second, -block);
        add(s.second, s.first, -block);
    }
    Eigen::SparseMatrix<double> result(x.size(), x.size());
    result.setFromTriplets(entries.begin(), entries.end());
    return result;
}

StillMembrane::Rest StillMembrane::equilibrium(membrane::Points<double> x) {
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 50; ++iteration) {
        membrane::Points<double> force = forces(x);
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            if (is_fixed(v)) force.col(v).setZero();
        }
        const double now = force.norm();
        if (!(now < before / 2)) break;
        before = now;
        const auto H = stiffness(x);
        if (!analysed_) factors_.analyzePattern(H);
        analysed_ = true;
        factors_.factorize(H);
        x += factors_.solve(force.reshaped().eval()).reshaped(3, x.cols());
    }
    return {x, analysed_ && factors_.info() == Eigen::Success && factors_.vectorD().minCoeff() > 0};
}

}  // namespace test
