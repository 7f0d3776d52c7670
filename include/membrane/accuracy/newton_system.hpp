// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>

#include <membrane/core/types.hpp>

/// The linear problem of one Newton step under constraints.
///
///     NewtonSystem system(fixed);                                  // fixed[v]: vertex v has no step of its own
///     system.open(prescribed);
///     system.add(v, w, block);  system.push(v, force);  system.add({corners, gradients, gap, false});
///     const auto& [step, multipliers] = system.solve(stiffness);
namespace membrane {

/// A quantity that depends on three vertices: after the step, to first order, it is zero, or at least not negative.
struct ConstraintRow {
    std::array<Index, 3> vertices;
    std::array<Vector3<double>, 3> gradient;
    double value;
    bool equality;
    double stiffening = 0;  ///< weight of half its square in the energy: it is expected to be zero after the step
};

/// A step, and for each row the force that sees to it.
struct NewtonStep {
    Points<double> step;          ///< 3 x V
    Eigen::VectorXd multipliers;  ///< not negative but for equalities
};

/// Least s.Hs / 2 - F.s over the steps s of the free vertices, under the rows [Nocedal06] 16, 18. H is sparse; the
/// multipliers come from the dual problem, which is as small as there are rows.
class NewtonSystem {
  public:
    explicit NewtonSystem(const std::vector<unsigned char>& fixed);

    /// Begins a problem in which fixed vertices take the steps `prescribed` (3 x V).
    void open(const Points<double>& prescribed);

    /// Adds to H a block of rows `i` and columns `j`, and its transpose the other way round if they are not the same.
    void add(Index i, Index j, const Eigen::Matrix3d& block);

    /// Adds to F.
    void push(Index v, const Vector3<double>& force);

    void add(const ConstraintRow& row);

    /// Where H is not positive definite, it is shifted until it is; `scale` is a stiffness as large as others in H. A
    /// row without free vertices is not heeded. Cost: factors of H, and a solution for each row.
    [[nodiscard]] NewtonStep solve(double scale);

  private:
    using Triplet = Eigen::Triplet<double>;
    using Sparse = Eigen::SparseMatrix<double>;

    [[nodiscard]] Eigen::Index at(Index v) const noexcept { return slots_[static_cast<std::size_t>(v)]; }
    [[nodiscard]] bool is_free(Index v) const noexcept { return at(v) >= 0; }
    void put(Index i, Index j, const Eigen::Matrix3d& block);
    void factorise(double scale);
    [[nodiscard]] std::vector<std::size_t> expected() const;
    [[nodiscard]] std::vector<std::size_t> violated(const Eigen::VectorXd& step,
                                                    const std::vector<std::size_t>& work) const;
    void extend(Eigen::MatrixXd& answers, const std::vector<std::size_t>& rows) const;
    [[nodiscard]] Eigen::VectorXd multipliers_of(const std::vector<std::size_t>& work, const Eigen::MatrixXd& answers,
                                                 const Eigen::VectorXd& alone) const;
    [[nodiscard]] double change(const ConstraintRow& row, const Eigen::Ref<const Eigen::VectorXd>& step) const;
    [[nodiscard]] bool can_change(const ConstraintRow& row) const noexcept;

    std::vector<Eigen::Index> slots_;  // of each free vertex, its first row; -1 for the others
    Eigen::Index size_ = 0;
    Points<double> prescribed_;
    std::vector<Triplet> triplets_;
    Eigen::VectorXd force_;
    std::vector<ConstraintRow> rows_;
    Eigen::SimplicialLDLT<Sparse> factors_;
    double shift_ = 0;  // of the last step that needed one
};

/// The y of least y.Wy / 2 + q.y with y >= 0 but for `equality`, W the `coupling`, positive semidefinite [Lawson74].
[[nodiscard]] inline Eigen::VectorXd estimated_multipliers(const Eigen::MatrixXd& coupling, const Eigen::VectorXd& q,
                                                           const std::vector<unsigned char>& equality);

inline NewtonSystem::NewtonSystem(const std::vector<unsigned char>& fixed) {
    for (const auto is_fixed : fixed) {
        slots_.push_back(is_fixed != 0 ? -1 : size_);
        if (is_fixed == 0) size_ += 3;
    }
}

inline void NewtonSystem::open(const Points<double>& prescribed) {
    prescribed_ = prescribed;
    triplets_.clear();
    rows_.clear();
    force_.setZero(size_);
}

inline void NewtonSystem::add(Index i, Index j, const Eigen::Matrix3d& block) {
    put(i, j, block);
    if (i != j) put(j, i, block.transpose());
}

inline void NewtonSystem::put(Index i, Index j, const Eigen::Matrix3d& block) {
    if (!is_free(i)) return;
    if (!is_free(j)) {
        force_.segment<3>(at(i)) -= block * prescribed_.col(j);
        return;
    }
    if (at(i) < at(j)) return;  // the lower triangle is enough
    for (Eigen::Index column = 0; column < 3; ++column) {
        for (Eigen::Index row = 0; row < 3; ++row) {
            triplets_.emplace_back(at(i) + row, at(j) + column, block(row, column));
        }
    }
}

inline void NewtonSystem::push(Index v, const Vector3<double>& force) {
    if (is_free(v)) force_.segment<3>(at(v)) += force;
}

inline void NewtonSystem::add(const ConstraintRow& row) {
    rows_.push_back(row);
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<double> stiff = row.stiffening * row.gradient[k];
        push(row.vertices[k], -row.value * stiff);
        for (std::size_t l = 0; l <= k; ++l) {
            add(row.vertices[k], row.vertices[l], stiff * row.gradient[l].transpose());
        }
        if (!is_free(row.vertices[k])) {
            rows_.back().value += dot<double>(row.gradient[k], prescribed_.col(row.vertices[k]));
        }
    }
}

// [Nocedal06] 3.4, algorithm 3.3; what is hardly positive, as of a membrane that is free to turn, is no better than zero.
inline void NewtonSystem::factorise(double scale) {
    Sparse matrix(size_, size_);
    matrix.setFromTriplets(triplets_.begin(), triplets_.end());
    const auto is_definite = [&] {
        return factors_.info() == Eigen::Success && factors_.vectorD().minCoeff() > 1e-12 * scale;
    };
    factors_.setShift(0);
    factors_.compute(matrix);
    if (is_definite()) return;
    shift_ = (std::max)(shift_ / 16, 1e-9 * scale);
    for (; shift_ < 1e12 * scale; shift_ *= 4) {
        factors_.setShift(shift_);
        factors_.factorize(matrix);
        if (is_definite()) return;
    }
}

inline NewtonStep NewtonSystem::solve(double scale) {
    NewtonStep result{prescribed_, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(rows_.size()))};
    if (size_ == 0) return result;
    factorise(scale);
    const Eigen::VectorXd alone = factors_.solve(force_);
    Eigen::VectorXd step = alone, multipliers;
    std::vector<std::size_t> work;      // rows
    Eigen::MatrixXd answers(size_, 0);  // of the step to each of them
    auto next = expected();
    if (next.empty()) next = violated(step, work);
    for (; !next.empty(); next = violated(step, work)) {
        work.insert(work.end(), next.begin(), next.end());
        extend(answers, next);
        multipliers = multipliers_of(work, answers, alone);
        step = alone + answers * multipliers;
    }
    for (std::size_t k = 0; k < work.size(); ++k) {
        result.multipliers[static_cast<Eigen::Index>(work[k])] = multipliers[static_cast<Eigen::Index>(k)];
    }
    for (Index v = 0; v < static_cast<Index>(slots_.size()); ++v) {
        if (is_free(v)) result.step.col(v) = step.segment<3>(at(v));
    }
    return result;
}

/// Rows that are likely to have a multiplier.
inline std::vector<std::size_t> NewtonSystem::expected() const {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i].equality || rows_[i].stiffening > 0) found.push_back(i);
    }
    return found;
}

/// The worst of the rows that are not at work, and those half as bad.
inline std::vector<std::size_t> NewtonSystem::violated(const Eigen::VectorXd& step,
                                                       const std::vector<std::size_t>& work) const {
    std::vector<double> after(rows_.size());
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        after[i] = can_change(rows_[i]) ? rows_[i].value + change(rows_[i], step) : 0;
    }
    for (const std::size_t i : work) after[i] = 0;
    double worst = 0;
    for (const double value : after) worst = (std::min)(worst, value);
    std::vector<std::size_t> found;
    if (!(worst < -1e-14 * step.lpNorm<Eigen::Infinity>())) return found;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (after[i] <= worst / 2) found.push_back(i);
    }
    return found;
}

inline void NewtonSystem::extend(Eigen::MatrixXd& answers, const std::vector<std::size_t>& rows) const {
    Eigen::MatrixXd gradients = Eigen::MatrixXd::Zero(size_, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto& row = rows_[rows[i]];
        for (std::size_t k = 0; k < 3; ++k) {
            if (!is_free(row.vertices[k])) continue;
            gradients.col(static_cast<Eigen::Index>(i)).segment<3>(at(row.vertices[k])) += row.gradient[k];
        }
    }
    const Eigen::Index before = answers.cols();
    answers.conservativeResize(Eigen::NoChange, before + gradients.cols());
    answers.rightCols(gradients.cols()) = factors_.solve(gradients);
}

inline Eigen::VectorXd NewtonSystem::multipliers_of(const std::vector<std::size_t>& work,
                                                    const Eigen::MatrixXd& answers,
                                                    const Eigen::VectorXd& alone) const {
    Eigen::MatrixXd coupling(answers.cols(), answers.cols());
    Eigen::VectorXd q(answers.cols());
    std::vector<unsigned char> equality;
    for (Eigen::Index i = 0; i < q.size(); ++i) {
        const auto& row = rows_[work[static_cast<std::size_t>(i)]];
        for (Eigen::Index j = 0; j < q.size(); ++j) coupling(i, j) = change(row, answers.col(j));
        q[i] = can_change(row) ? row.value + change(row, alone) : 0;
        equality.push_back(row.equality ? 1 : 0);
    }
    return estimated_multipliers((coupling + coupling.transpose()) / 2, q, equality);
}

inline double NewtonSystem::change(const ConstraintRow& row, const Eigen::Ref<const Eigen::VectorXd>& step) const {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        if (is_free(row.vertices[k])) sum += dot<double>(row.gradient[k], step.segment<3>(at(row.vertices[k])));
    }
    return sum;
}

inline bool NewtonSystem::can_change(const ConstraintRow& row) const noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        if (is_free(row.vertices[k]) && !row.gradient[k].isZero(0)) return true;
    }
    return false;
}

namespace detail {

/// Least y.Wy / 2 + q.y over the y that are zero where nothing is at `work`.
[[nodiscard]] inline Eigen::VectorXd min_awake(Eigen::MatrixXd coupling, Eigen::VectorXd q,
                                               const std::vector<unsigned char>& work) {
    for (Eigen::Index i = 0; i < q.size(); ++i) {
        if (work[static_cast<std::size_t>(i)] != 0) continue;
        coupling.row(i).setZero();
        coupling.col(i).setZero();
        coupling(i, i) = 1;
        q[i] = 0;
    }
    return -coupling.ldlt().solve(q);
}

}  // namespace detail

inline Eigen::VectorXd estimated_multipliers(const Eigen::MatrixXd& coupling, const Eigen::VectorXd& q,
                                             const std::vector<unsigned char>& equality) {
    const double slack = 1e-15 * q.lpNorm<Eigen::Infinity>();
    Eigen::VectorXd y = Eigen::VectorXd::Zero(q.size());
    std::vector<unsigned char> work = equality;
    for (Eigen::Index round = 0; round < 10 * (q.size() + 1); ++round) {
        const Eigen::VectorXd best = detail::min_awake(coupling, q, work);
        double part = 1;
        Eigen::Index first = no_index;  // to come to zero on the way there
        for (Eigen::Index i = 0; i < q.size(); ++i) {
            if (equality[static_cast<std::size_t>(i)] != 0 || best[i] >= 0 || y[i] >= part * (y[i] - best[i])) continue;
            part = y[i] / (y[i] - best[i]);
            first = i;
        }
        y += part * (best - y);
        if (first != no_index) {
            y[first] = 0;
            work[static_cast<std::size_t>(first)] = 0;
            continue;
        }
        Eigen::VectorXd slope = coupling * y + q;
        for (Eigen::Index i = 0; i < q.size(); ++i) slope[i] *= work[static_cast<std::size_t>(i)] != 0 ? 0 : 1;
        Eigen::Index next = 0;
        if (slope.minCoeff(&next) >= -slack) break;
        work[static_cast<std::size_t>(next)] = 1;
    }
    return y;
}

}  // namespace membrane
