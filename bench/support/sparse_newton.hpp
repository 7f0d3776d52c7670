// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Sparse>
#include <membrane/solve/propagation_queue.hpp>

#include "scene.hpp"

namespace bench {

/// Newton's method with sparse factors for linear springs and volume springs: the vertices in `moving` are free, the
/// others fixed.
///
///     SparseNewton newton(network, volume, moving);
///     while (...) newton.step(x);
///
/// The Hessian omits the negative transverse stiffness of compressed springs, so that it is positive definite. The
/// sparsity pattern of the matrix and of its factors is fixed.
class SparseNewton {
  public:
    using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;
    using Volume = membrane::VirtualVolumeSprings<double>;

    SparseNewton(const Network& network, const Volume& volume, std::vector<Index> moving)
        : network_(network),
          volume_(volume),
          moving_(std::move(moving)),
          row_(static_cast<std::size_t>(network.vertex_count()), membrane::no_index),
          force_(3 * static_cast<Index>(moving_.size())),
          matrix_(force_.size(), force_.size()) {
        for (std::size_t i = 0; i < moving_.size(); ++i) row_of(moving_[i]) = 3 * static_cast<Index>(i);
        std::vector<Eigen::Triplet<double>> entries;
        const auto add_block = [&](Index row, Index column) {
            if (row < 0 || column < 0) return;
            for (int i = 0; i < 3; ++i) {
                for (int k = 0; k < 3; ++k) entries.emplace_back(row + i, column + k, 0.0);
            }
        };
        for (const Index v : moving_) add_block(row_of(v), row_of(v));
        for (const auto& spring : network.springs()) {
            add_block(row_of(spring.first), row_of(spring.second));
            add_block(row_of(spring.second), row_of(spring.first));
        }
        matrix_.setFromTriplets(entries.begin(), entries.end());
        for (const auto& spring : network.springs()) {
            const Index a = row_of(spring.first), b = row_of(spring.second);
            if (a >= 0 || b >= 0)
                springs_.push_back({spring, a, b, block(a, a), block(b, b), block(std::max(a, b), std::min(a, b))});
        }
        analyse();
    }

    /// Computes the order and the pattern of the factors.
    void analyse() { factors_.analyzePattern(matrix_); }

    /// One iteration.
    void step(Points& x) {
        assemble(x);
        factors_.factorize(matrix_);
        const Eigen::VectorXd displacement = factors_.solve(force_);
        for (std::size_t i = 0; i < moving_.size(); ++i)
            x.col(moving_[i]) += displacement.segment<3>(3 * static_cast<Index>(i));
    }

  private:
    using Block = Eigen::Map<Eigen::Matrix3d, 0, Eigen::OuterStride<>>;

    struct BlockLocation {
        Eigen::Index first = -1, stride = 0;
    };
    struct Joint {
        membrane::Spring<double> spring;
        Index row_a, row_b;  // -1: the vertex is fixed
        BlockLocation aa, bb, below;
    };

    [[nodiscard]] Index& row_of(Index v) { return row_[static_cast<std::size_t>(v)]; }

    /// Location of the 3 x 3 block that begins in this row and column.
    [[nodiscard]] BlockLocation block(Index row, Index column) {
        if (row < 0 || column < 0) return {};
        const auto* starts = matrix_.outerIndexPtr();
        return {&matrix_.coeffRef(row, column) - matrix_.valuePtr(), starts[column + 1] - starts[column]};
    }
    void add(const BlockLocation& at, const Eigen::Matrix3d& added) {
        if (at.first >= 0) Block(matrix_.valuePtr() + at.first, Eigen::OuterStride<>(at.stride)) += added;
    }

    void assemble(const Points& x) {
        std::fill_n(matrix_.valuePtr(), matrix_.nonZeros(), 0.0);
        for (const Index v : moving_) {
            const Index row = row_of(v);
            force_.segment<3>(row) = -volume_.stiffness(v) * (x.col(v) - volume_.anchors().col(v));
            for (Index k = 0; k < 3; ++k) matrix_.coeffRef(row + k, row + k) = volume_.stiffness(v);
        }
        for (const Joint& joint : springs_) {
            const auto& spring = joint.spring;
            const Vector3 edge = x.col(spring.second) - x.col(spring.first);
            const double length = edge.norm(), tension = spring.stiffness * (length - spring.rest_length);
            const Vector3 along = edge / length;
            const double across = std::max(tension / length, 0.0);
            const Eigen::Matrix3d hessian =
                (spring.stiffness - across) * along * along.transpose() + across * Eigen::Matrix3d::Identity();
            add(joint.aa, hessian);
            add(joint.bb, hessian);
            add(joint.below, -hessian);
            if (joint.row_a >= 0) force_.segment<3>(joint.row_a) += tension * along;
            if (joint.row_b >= 0) force_.segment<3>(joint.row_b) -= tension * along;
        }
    }

    const Network& network_;
    const Volume& volume_;
    std::vector<Index> moving_, row_;
    std::vector<Joint> springs_;
    Eigen::VectorXd force_;
    Eigen::SparseMatrix<double> matrix_;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace bench
