// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include <membrane/accuracy/block_cholesky.hpp>

/// The linear problem of one Newton step under constraints.
///
///     membrane::NewtonSystem system(fixed);                        // fixed[v]: vertex v takes a prescribed step
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
/// multipliers come from the dual problem, whose size is the number of rows.
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
    /// free vertices is ignored. Cost: a factorisation of H, a solution with its factors, and for each row half a
    /// solution with a small part of them.
    [[nodiscard]] NewtonStep solve(double scale);

  private:
    struct Link {  // of two free vertices with a block of H
        Index first, second;
    };
    [[nodiscard]] Index at(Index v) const noexcept { return slots_[static_cast<std::size_t>(v)]; }
    [[nodiscard]] bool is_free(Index v) const noexcept { return at(v) >= 0; }
    void put(Index i, Index j, const Eigen::Matrix3d& block);
    void factorise(double scale);
    void add_multipliers(Eigen::VectorXd& step, Eigen::VectorXd& multipliers) const;

    std::vector<Index> slots_;  // of each free vertex, its number; -1 for the others
    std::vector<std::vector<std::pair<Index, std::size_t>>> links_of_;  // of each free vertex, to those before
    std::vector<Link> links_;
    std::vector<Eigen::Matrix3d> diagonal_, linked_;  // H
    Points<double> prescribed_, force_;
    std::vector<ConstraintRow> rows_;
    std::optional<BlockCholesky> factors_;  // for these links
    double shift_ = 0;                      // of the last step that needed one
};

/// Minimises y.Wy / 2 + q.y over y with y >= 0 except for `equality`; W is the `coupling`, positive semidefinite
/// [Lawson74].
[[nodiscard]] inline Eigen::VectorXd estimated_multipliers(const Eigen::MatrixXd& coupling, const Eigen::VectorXd& q,
                                                           const std::vector<unsigned char>& equality);

inline NewtonSystem::NewtonSystem(const std::vector<unsigned char>& fixed) {
    Index free = 0;
    for (const auto is_fixed : fixed) slots_.push_back(is_fixed != 0 ? -1 : free++);
    links_of_.resize(static_cast<std::size_t>(free));
    diagonal_.resize(links_of_.size());
}

inline void NewtonSystem::open(const Points<double>& prescribed) {
    prescribed_ = prescribed;
    std::fill(diagonal_.begin(), diagonal_.end(), Eigen::Matrix3d::Zero());
    std::fill(linked_.begin(), linked_.end(), Eigen::Matrix3d::Zero());
    rows_.clear();
    force_.setZero(3, static_cast<Eigen::Index>(diagonal_.size()));
}

inline void NewtonSystem::add(Index i, Index j, const Eigen::Matrix3d& block) {
    if (is_free(i) && is_free(j))
        return at(i) < at(j) ? put(at(j), at(i), block.transpose()) : put(at(i), at(j), block);
    if (is_free(i)) force_.col(at(i)) -= block * prescribed_.col(j);
    if (is_free(j)) force_.col(at(j)) -= block.transpose() * prescribed_.col(i);
}

// The lower triangle is enough.
inline void NewtonSystem::put(Index i, Index j, const Eigen::Matrix3d& block) {
    if (i == j) {
        diagonal_[static_cast<std::size_t>(i)] += block;
        return;
    }
    auto& known = links_of_[static_cast<std::size_t>(i)];
    auto link = std::find_if(known.begin(), known.end(), [&](const auto& other) { return other.first == j; });
    if (link == known.end()) {
        link = known.emplace(link, j, links_.size());
        links_.push_back({i, j});
        linked_.emplace_back(Eigen::Matrix3d::Zero());
        factors_.reset();
    }
    linked_[link->second] += block;
}

inline void NewtonSystem::add_force(Index v, const Vector3<double>& force) {
    if (is_free(v)) force_.col(at(v)) += force;
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
    if (!factors_) factors_.emplace(static_cast<Index>(diagonal_.size()), links_);
    factors_->open();
    for (std::size_t i = 0; i < diagonal_.size(); ++i) factors_->add(static_cast<Index>(i), diagonal_[i]);
    for (std::size_t i = 0; i < linked_.size(); ++i) factors_->subtract(i, -linked_[i]);
    if (factors_->factorise(0, 1e-12 * scale)) return;
    shift_ = (std::max)(shift_ / 16, 1e-9 * scale);
    while (!factors_->factorise(shift_, 1e-12 * scale) && shift_ < 1e12 * scale) shift_ *= 4;
}

inline NewtonStep NewtonSystem::solve(double scale) {
    NewtonStep result{prescribed_, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(rows_.size()))};
    if (diagonal_.empty()) return result;
    factorise(scale);
    Eigen::VectorXd step(force_.size());
    const auto row = [&](Index v) { return static_cast<Eigen::Index>(3 * factors_->rank(at(v))); };
    for (Index v = 0; v < static_cast<Index>(slots_.size()); ++v) {
        if (is_free(v)) step.segment<3>(row(v)) = force_.col(at(v));
    }
    factors_->solve_lower(step);
    if (!rows_.empty()) add_multipliers(step, result.multipliers);
    factors_->solve_upper(step);
    for (Index v = 0; v < static_cast<Index>(slots_.size()); ++v) {
        if (is_free(v)) result.step.col(v) = step.segment<3>(row(v));
    }
    return result;
}

// Computes the multipliers, and adds what they change to `step`, L^-1 F. With the gradients G and Y = L^-1 G^T, the
// matrix of the dual problem, G H^-1 G^T, is Y^T Y.
inline void NewtonSystem::add_multipliers(Eigen::VectorXd& step, Eigen::VectorXd& multipliers) const {
    std::vector<Index> vertices;
    for (const auto& row : rows_) {
        for (const Index v : row.vertices) {
            if (is_free(v)) vertices.push_back(at(v));
        }
    }
    const auto ranks = factors_->affected(vertices);
    const auto rows = static_cast<Eigen::Index>(3 * ranks.size());
    Eigen::MatrixXd responses = Eigen::MatrixXd::Zero(rows, multipliers.size());
    Eigen::VectorXd alone(rows), values(multipliers.size());
    for (std::size_t i = 0; i < ranks.size(); ++i) {
        alone.segment<3>(static_cast<Eigen::Index>(3 * i)) = step.segment<3>(static_cast<Eigen::Index>(3 * ranks[i]));
    }
    std::vector<unsigned char> equality;
    for (Eigen::Index r = 0; r < values.size(); ++r) {
        const auto& row = rows_[static_cast<std::size_t>(r)];
        for (std::size_t k = 0; k < 3; ++k) {
            if (!is_free(row.vertices[k])) continue;
            const auto place = std::lower_bound(ranks.begin(), ranks.end(), factors_->rank(at(row.vertices[k])));
            responses.col(r).segment<3>(3 * (place - ranks.begin())) += row.gradient[k];
        }
        values[r] = responses.col(r).isZero(0) ? 0 : row.value;
        equality.push_back(row.equality ? 1 : 0);
    }
    factors_->solve_lower(responses, ranks);
    multipliers =
        estimated_multipliers(responses.transpose() * responses, values + responses.transpose() * alone, equality);
    alone += responses * multipliers;
    for (std::size_t i = 0; i < ranks.size(); ++i) {
        step.segment<3>(static_cast<Eigen::Index>(3 * ranks[i])) = alone.segment<3>(static_cast<Eigen::Index>(3 * i));
    }
}

namespace detail {

/// Active rows and columns of a positive semidefinite matrix, with their Cholesky factor, which grows by a row.
class ActiveRows {
  public:
    explicit ActiveRows(const Eigen::MatrixXd& matrix) : matrix_(matrix), lower_(matrix.rows(), matrix.rows()) {}

    [[nodiscard]] const std::vector<Eigen::Index>& rows() const noexcept { return rows_; }

    /// False if the row depends on the active ones: it is not added.
    bool add(Eigen::Index i) {
        Eigen::VectorXd row = matrix_(rows_, i);
        factor().triangularView<Eigen::Lower>().solveInPlace(row);
        const double pivot = matrix_(i, i) - row.squaredNorm();
        if (!(pivot > 1e-14 * matrix_(i, i))) return false;
        const Eigen::Index count = row.size();
        lower_.row(count).head(count) = row.transpose();
        lower_(count, count) = std::sqrt(pivot);
        rows_.push_back(i);
        return true;
    }

    /// Removes the row at this place in `rows()`.
    void remove(Eigen::Index place) {
        auto kept = std::exchange(rows_, {});
        kept.erase(kept.begin() + place);
        for (const Eigen::Index i : kept) add(i);
    }

    /// Solves for the active rows.
    [[nodiscard]] Eigen::VectorXd solve(Eigen::VectorXd b) const {
        factor().triangularView<Eigen::Lower>().solveInPlace(b);
        factor().transpose().triangularView<Eigen::Upper>().solveInPlace(b);
        return b;
    }

  private:
    [[nodiscard]] Eigen::Block<const Eigen::MatrixXd> factor() const {
        return lower_.topLeftCorner(std::ssize(rows_), std::ssize(rows_));
    }

    const Eigen::MatrixXd& matrix_;
    Eigen::MatrixXd lower_;
    std::vector<Eigen::Index> rows_;
};

/// The smallest of the numbers that are below `limit`, without those with a nonzero entry of `skipped`; `no_index`:
/// there is none.
[[nodiscard]] inline Eigen::Index smallest_below(double limit, const Eigen::VectorXd& numbers,
                                                 const std::vector<unsigned char>& skipped) noexcept {
    Eigen::Index found = no_index;
    for (Eigen::Index i = 0; i < numbers.size(); ++i) {
        if (skipped[static_cast<std::size_t>(i)] != 0 || numbers[i] >= limit) continue;
        limit = numbers[i], found = i;
    }
    return found;
}

}  // namespace detail

// An active y may be nonzero.
inline Eigen::VectorXd estimated_multipliers(const Eigen::MatrixXd& coupling, const Eigen::VectorXd& q,
                                             const std::vector<unsigned char>& equality) {
    const double slack = 1e-15 * q.lpNorm<Eigen::Infinity>();
    const auto is_equality = [&](Eigen::Index i) { return equality[static_cast<std::size_t>(i)] != 0; };
    detail::ActiveRows active(coupling);
    for (Eigen::Index i = 0; i < q.size(); ++i) {
        if (is_equality(i)) active.add(i);
    }
    Eigen::VectorXd y = Eigen::VectorXd::Zero(q.size());
    std::vector<unsigned char> tried = equality;  // active, or of no use at this y
    for (Eigen::Index round = 0; round < 10 * (q.size() + 1); ++round) {
        const auto& rows = active.rows();
        const Eigen::VectorXd best = active.solve(-q(rows)), here = y(rows);
        double part = 1;
        Eigen::Index first = no_index;  // of the active ones, to become zero along the step
        for (Eigen::Index a = 0; a < best.size(); ++a) {
            if (is_equality(rows[static_cast<std::size_t>(a)]) || best[a] >= 0) continue;
            const double from = (std::max)(here[a], 0.0);
            if (from >= part * (from - best[a])) continue;
            part = from / (from - best[a]);
            first = a;
        }
        y(rows) = first == no_index ? best : Eigen::VectorXd(here + part * (best - here));
        if (y(rows) != here) {
            tried = equality;
            for (const Eigen::Index i : rows) tried[static_cast<std::size_t>(i)] = 1;
        }
        if (first != no_index) {
            y[rows[static_cast<std::size_t>(first)]] = 0;
            active.remove(first);
            continue;
        }
        const Eigen::VectorXd slope = coupling * y + q;
        for (bool added = false; !added;) {
            const Eigen::Index next = detail::smallest_below(-slack, slope, tried);
            if (next == no_index) return y;
            tried[static_cast<std::size_t>(next)] = 1;
            added = active.add(next);
        }
    }
    return y;
}

}  // namespace membrane
