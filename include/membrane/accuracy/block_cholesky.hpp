// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/symmetric3.hpp>

/// Proves that a symmetric matrix of 3 x 3 blocks, one for each vertex and each spring, is positive definite.
///
///     membrane::BlockCholesky factors(vertex_count, springs);                // offline
///     factors.open();
///     factors.add(v, block);                                                // on the diagonal
///     factors.subtract(s, block);                                           // at spring s, off the diagonal
///     if (factors.definite_above(0.5)) ...                                  // proven: no eigenvalue is below 0.5
namespace membrane {

namespace detail {

[[nodiscard]] inline double size_of(const Symmetric3<double>& a) noexcept {
    return std::abs(a.xx) + std::abs(a.yy) + std::abs(a.zz) + std::abs(a.xy) + std::abs(a.xz) + std::abs(a.yz);
}

}  // namespace detail

/// Sparse Cholesky factorisation in minimum degree order [George89]. The constructor computes the order and allocates
/// all memory. One thread at a time for each instance.
class BlockCholesky {
  public:
    /// `links` (springs) have a `first` and a `second` vertex. Offline. Cost for a mesh: O(V log V) blocks.
    template <class Links>
    BlockCholesky(Index vertex_count, const Links& links);

    /// Sets the matrix to zero.
    void open() noexcept;

    /// Adds `block` to the diagonal block of vertex `v` [N/m].
    void add(Index v, const Symmetric3<double>& block) noexcept {
        diagonal_[rank_[at(v)]] += block;
        size_ += detail::size_of(block);
    }

    /// Subtracts `block` from both blocks of link number `link` [N/m].
    void subtract(std::size_t link, const Symmetric3<double>& block) noexcept {
        linked_[link] += -1.0 * block;
        size_ += 2 * detail::size_of(block);
    }

    /// True only if no eigenvalue is below `shift`: Cholesky's algorithm succeeds for A - (shift + c) I, where c, n
    /// epsilon times the sum of all magnitudes added to A, exceeds the rounding error [Rump06]. The matrix is not
    /// changed. Online. Cost for a mesh: O(V^1.5).
    [[nodiscard]] bool definite_above(double shift) noexcept;

  private:
    using Block = Eigen::Matrix3d;
    struct Entry {  // of a block below the diagonal: its column, and its index in `blocks_`
        std::size_t column, number;
    };
    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    template <class Links>
    [[nodiscard]] std::vector<std::vector<Index>> eliminate(const Links& links);
    void fill(double shift) noexcept;
    void subtract_previous_columns(std::size_t column) noexcept;
    [[nodiscard]] bool factorise_column(std::size_t column) noexcept;

    // Rows and columns are numbered in the order of elimination.
    std::vector<std::size_t> rank_;                      // of each vertex, its number
    std::vector<std::size_t> begin_{0}, row_;            // of each column, its blocks; of each block, its row
    CompressedRows<Entry> before_;                       // of each row, its blocks
    std::vector<std::size_t> number_;                    // of each link, its block
    std::vector<Symmetric3<double>> diagonal_, linked_;  // the matrix
    std::vector<Block> pivots_, blocks_;                 // the factors
    std::vector<std::size_t> block_of_row_;              // of each row, its block in the current column
    double size_ = 0;                                    // sum of the magnitudes added to the matrix
};

namespace detail {

/// Cholesky factor of a 3 x 3 matrix, read from and written to its lower triangle; false if it is not positive
/// definite.
inline bool factorise(Eigen::Matrix3d& a) noexcept {
    for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < j; ++k) a(j, j) -= a(j, k) * a(j, k);
        if (!(a(j, j) > 0)) return false;
        a(j, j) = std::sqrt(a(j, j));
        for (int i = j + 1; i < 3; ++i) {
            for (int k = 0; k < j; ++k) a(i, j) -= a(i, k) * a(j, k);
            a(i, j) /= a(j, j);
        }
    }
    return true;
}

/// b L^-T, L the lower triangle.
inline void divide(Eigen::Matrix3d& b, const Eigen::Matrix3d& lower) noexcept {
    for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < j; ++k) b.col(j) -= lower(j, k) * b.col(k);
        b.col(j) /= lower(j, j);
    }
}

}  // namespace detail

template <class Links>
BlockCholesky::BlockCholesky(Index vertex_count, const Links& links)
    : rank_(at(vertex_count)),
      diagonal_(rank_.size()),
      linked_(links.size()),
      pivots_(rank_.size(), Block::Zero()),
      block_of_row_(rank_.size()) {
    const auto columns = eliminate(links);
    for (const auto& column : columns) {
        for (const Index v : column) row_.push_back(rank_[at(v)]);
        std::sort(row_.begin() + static_cast<std::ptrdiff_t>(begin_.back()), row_.end());
        begin_.push_back(row_.size());
    }
    blocks_.assign(row_.size(), Block::Zero());
    before_ = CompressedRows<Entry>(vertex_count, [&](auto put) {
        for (std::size_t column = 0; column < columns.size(); ++column) {
            for (std::size_t b = begin_[column]; b < begin_[column + 1]; ++b) {
                put(static_cast<Index>(row_[b]), Entry{column, b});
            }
        }
    });
    for (const auto& link : links) {
        const auto [column, row] = std::minmax(rank_[at(link.first)], rank_[at(link.second)]);
        const auto first = row_.begin() + static_cast<std::ptrdiff_t>(begin_[column]);
        const auto last = row_.begin() + static_cast<std::ptrdiff_t>(begin_[column + 1]);
        number_.push_back(static_cast<std::size_t>(std::lower_bound(first, last, row) - row_.begin()));
    }
}

// Numbers the vertices: next is the vertex with the fewest neighbours. These become the rows of its column and are
// linked to one another.
template <class Links>
std::vector<std::vector<Index>> BlockCholesky::eliminate(const Links& links) {
    std::vector<std::set<Index>> neighbours(rank_.size());
    for (const auto& link : links) {
        neighbours[at(link.first)].insert(link.second);
        neighbours[at(link.second)].insert(link.first);
    }
    std::set<std::pair<std::size_t, Index>> queue;
    for (Index v = 0; at(v) < rank_.size(); ++v) queue.emplace(neighbours[at(v)].size(), v);
    std::vector<std::vector<Index>> columns;
    while (!queue.empty()) {
        const Index v = queue.begin()->second;
        queue.erase(queue.begin());
        rank_[at(v)] = columns.size();
        const auto& column = columns.emplace_back(neighbours[at(v)].begin(), neighbours[at(v)].end());
        for (const Index w : column) {
            auto& others = neighbours[at(w)];
            queue.erase({others.size(), w});
            others.insert(column.begin(), column.end());
            others.erase(v);
            others.erase(w);
            queue.emplace(others.size(), w);
        }
    }
    return columns;
}

inline void BlockCholesky::open() noexcept {
    size_ = 0;
    std::fill(diagonal_.begin(), diagonal_.end(), Symmetric3<double>{});
    std::fill(linked_.begin(), linked_.end(), Symmetric3<double>{});
}

inline bool BlockCholesky::definite_above(double shift) noexcept {
    fill(shift);
    for (std::size_t column = 0; column < pivots_.size(); ++column) {
        subtract_previous_columns(column);
        if (!factorise_column(column)) return false;
    }
    return true;
}

inline void BlockCholesky::fill(double shift) noexcept {
    const auto n = static_cast<double>(3 * pivots_.size());
    const double rounding = (n + 16) * std::numeric_limits<double>::epsilon() * (size_ + n * std::abs(shift));
    for (std::size_t i = 0; i < pivots_.size(); ++i) {
        pivots_[i] = dense(diagonal_[i]);
        pivots_[i].diagonal().array() -= shift + rounding;
    }
    std::fill(blocks_.begin(), blocks_.end(), Block::Zero());
    for (std::size_t l = 0; l < linked_.size(); ++l) blocks_[number_[l]] += dense(linked_[l]);
}

inline void BlockCholesky::subtract_previous_columns(std::size_t column) noexcept {
    for (std::size_t b = begin_[column]; b < begin_[column + 1]; ++b) block_of_row_[row_[b]] = b;
    for (const auto& entry : before_[static_cast<Index>(column)]) {
        const Block across = blocks_[entry.number].transpose();
        pivots_[column].noalias() -= blocks_[entry.number] * across;
        for (std::size_t b = entry.number + 1; b < begin_[entry.column + 1]; ++b) {
            blocks_[block_of_row_[row_[b]]].noalias() -= blocks_[b] * across;
        }
    }
}

inline bool BlockCholesky::factorise_column(std::size_t column) noexcept {
    if (!detail::factorise(pivots_[column])) return false;
    for (std::size_t b = begin_[column]; b < begin_[column + 1]; ++b) detail::divide(blocks_[b], pivots_[column]);
    return true;
}

}  // namespace membrane
