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
///     NewtonSystem system(fixed);                                  // fixed[v]: vertex v takes a prescribed step
///     system.open(prescribed);
///     system.add(v, w, block);  system.add_force(v, force);  system.add({corners, gradients, gap, false});
///     const auto& [step, multipliers] = system.solve(stiffness);
namespace membrane {

/// A quantity that depends on three vertices. After the step it is, to first order, zero if an equality, else not
/// negative.
struct ConstraintRow {
    std::array<Index, 3> vertices;            ///< on which it depends
    std::array<Vector3<double>, 3> gradient;  ///< by the position of each vertex
    double value;                             ///< before the step
    bool equality;                            ///< whether it becomes zero, not only not negative
    double stiffening = 0;  ///< weight of half its square in the energy, if it is expected to become zero
};

/// A step, and the multiplier of each row.
struct NewtonStep {
    Points<double> step;          ///< 3 x V
    Eigen::VectorXd multipliers;  ///< not negative, except of equalities
};

/// Minimises s.Hs / 2 - F.s over the steps s of the free vertices, under the rows [Nocedal06] 16, 18. H is sparse; the
/// multipliers come from the dual problem, whose size is the number of active rows.
class NewtonSystem {
  public:
    /// A system in which the vertices with a nonzero entry of `fixed` are fixed.
    explicit NewtonSystem(const std::vector<unsigned char>& fixed);

    /// Begins a problem in which fixed vertices take the steps `prescribed` (3 x V).
    void open(const Points<double>& prescribed);

    /// Adds a block to H at rows `i` and columns `j`; if these differ, also its transpose at rows `j` and columns `i`.
    void add(Index i, Index j, const Eigen::Matrix3d& block);

    /// Adds to F.
    void add_force(Index v, const Vector3<double>& force);

    /// Adds a row to the problem.
    void add(const ConstraintRow& row);

    /// If H is not positive definite, it is shifted until it is; `scale` is a typical stiffness in H. A row without
    /// free vertices is ignored. Cost: a factorisation of H, and a solve for each active row.
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
                                                    const std::vector<std::size_t>& active) const;
    void extend(Eigen::MatrixXd& responses, const std::vector<std::size_t>& rows) const;
    [[nodiscard]] Eigen::VectorXd multipliers_of(const std::vector<std::size_t>& active,
                                                 const Eigen::MatrixXd& responses, const Eigen::VectorXd& alone) const;
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

/// Minimises y.Wy / 2 + q.y over y with y >= 0 except for `equality`; W is the `coupling`, positive semidefinite
/// [Lawson74].
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

inline void NewtonSystem::add_force(Index v, const Vector3<double>& force) {
    if (is_free(v)) force_.segment<3>(at(v)) += force;
}

inline void NewtonSystem::add(const ConstraintRow& row) {
    rows_.push_back(row);
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<double> stiff = row.stiffening * row.gradient[k];
        add_force(row.vertices[k], -row.value * stiff);
        for (std::size_t l = 0; l <= k; ++l) {
            add(row.vertices[k], row.vertices[l], stiff * row.gradient[l].transpose());
        }
        if (!is_free(row.vertices[k])) {
            rows_.back().value += dot<double>(row.gradient[k], prescribed_.col(row.vertices[k]));
        }
    }
}

// [Nocedal06] 3.4, algorithm 3.3. A barely positive pivot, as of a membrane free to rotate, counts as not positive.
inline void NewtonSystem::factorise(double scale) {
    Sparse matrix(size_, size_);
    matrix.setFromTriplets(triplets_.begin(), triplets_.end());
    const auto is_definite = [&] {
        const bool succeeded = factors_.info() == Eigen::ComputationInfo{};  // Eigen::Success, a macro in Xlib.h
        return succeeded && factors_.vectorD().minCoeff() > 1e-12 * scale;
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
    std::vector<std::size_t> active;      // rows
    Eigen::MatrixXd responses(size_, 0);  // of the step to each multiplier
    auto next = expected();
    if (next.empty()) next = violated(step, active);
    for (; !next.empty(); next = violated(step, active)) {
        active.insert(active.end(), next.begin(), next.end());
        extend(responses, next);
        multipliers = multipliers_of(active, responses, alone);
        step = alone + responses * multipliers;
    }
    for (std::size_t k = 0; k < active.size(); ++k) {
        result.multipliers[static_cast<Eigen::Index>(active[k])] = multipliers[static_cast<Eigen::Index>(k)];
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

/// The most violated inactive row, and those at least half as violated.
inline std::vector<std::size_t> NewtonSystem::violated(const Eigen::VectorXd& step,
                                                       const std::vector<std::size_t>& active) const {
    std::vector<double> after(rows_.size());
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        after[i] = can_change(rows_[i]) ? rows_[i].value + change(rows_[i], step) : 0;
    }
    for (const std::size_t i : active) after[i] = 0;
    double worst = 0;
    for (const double value : after) worst = (std::min)(worst, value);
    std::vector<std::size_t> found;
    if (!(worst < -1e-14 * step.lpNorm<Eigen::Infinity>())) return found;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (after[i] <= worst / 2) found.push_back(i);
    }
    return found;
}

inline void NewtonSystem::extend(Eigen::MatrixXd& responses, const std::vector<std::size_t>& rows) const {
    Eigen::MatrixXd gradients = Eigen::MatrixXd::Zero(size_, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto& row = rows_[rows[i]];
        for (std::size_t k = 0; k < 3; ++k) {
            if (!is_free(row.vertices[k])) continue;
            gradients.col(static_cast<Eigen::Index>(i)).segment<3>(at(row.vertices[k])) += row.gradient[k];
        }
    }
    const Eigen::Index before = responses.cols();
    responses.conservativeResize(Eigen::NoChange, before + gradients.cols());
    responses.rightCols(gradients.cols()) = factors_.solve(gradients);
}

inline Eigen::VectorXd NewtonSystem::multipliers_of(const std::vector<std::size_t>& active,
                                                    const Eigen::MatrixXd& responses,
                                                    const Eigen::VectorXd& alone) const {
    Eigen::MatrixXd coupling(responses.cols(), responses.cols());
    Eigen::VectorXd q(responses.cols());
    std::vector<unsigned char> equality;
    for (Eigen::Index i = 0; i < q.size(); ++i) {
        const auto& row = rows_[active[static_cast<std::size_t>(i)]];
        for (Eigen::Index j = 0; j < q.size(); ++j) coupling(i, j) = change(row, responses.col(j));
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

/// Minimises y.Wy / 2 + q.y over the y that are zero where `active` is 0.
[[nodiscard]] inline Eigen::VectorXd min_over_active(Eigen::MatrixXd coupling, Eigen::VectorXd q,
                                                     const Eigen::VectorXd& active) {
    for (Eigen::Index i = 0; i < q.size(); ++i) {
        if (active[i] != 0) continue;
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
    Eigen::VectorXd active(q.size());  // 1, or 0 where y stays zero
    for (Eigen::Index i = 0; i < q.size(); ++i) active[i] = equality[static_cast<std::size_t>(i)] != 0 ? 1 : 0;
    for (Eigen::Index round = 0; round < 10 * (q.size() + 1); ++round) {
        const Eigen::VectorXd best = detail::min_over_active(coupling, q, active);
        double part = 1;
        Eigen::Index first = no_index;  // to become zero along the step
        for (Eigen::Index i = 0; i < q.size(); ++i) {
            if (equality[static_cast<std::size_t>(i)] != 0 || best[i] >= 0 || y[i] >= part * (y[i] - best[i])) continue;
            part = y[i] / (y[i] - best[i]);
            first = i;
        }
        y += part * (best - y);
        if (first != no_index) {
            y[first] = 0;
            active[first] = 0;
            continue;
        }
        const Eigen::VectorXd slope = (coupling * y + q).array() * (1 - active.array());
        Eigen::Index next = 0;
        if (slope.minCoeff(&next) >= -slack) break;
        active[next] = 1;
    }
    return y;
}

}  // namespace membrane
