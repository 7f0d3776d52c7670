// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include <membrane/accuracy/nested_dissection.hpp>
#include <membrane/core/symmetric3.hpp>

/// Sparse factors of a symmetric matrix of 3 x 3 blocks, one for each vertex and each pair of linked vertices.
///
///     membrane::BlockCholesky factors(network.vertex_count(), network.springs());   // offline
///     factors.open();
///     factors.add(v, block);                                                        // on the diagonal
///     factors.subtract(s, block);                                                   // at spring s, off the diagonal
///     if (factors.definite_above(0.5)) ...                                          // proven: no eigenvalue below 0.5
namespace membrane {

/// Sparse Cholesky factorisation in the order of `nested_dissection`. The columns of a part have blocks in the same
/// rows, and are stored as a dense panel. The constructor computes the order and allocates all memory. One thread at a
/// time for each instance.
class BlockCholesky {
  public:
    using Block = Eigen::Matrix3d;  ///< of the matrix

    /// `links` (springs) have a `first` and a `second` vertex. Offline. Cost for a mesh: O(V log V) blocks.
    template <class Links>
    BlockCholesky(Index vertex_count, const Links& links);

    /// Sets the matrix to zero.
    void open() noexcept;

    ///@{
    /// Adds `block`, which is symmetric, to the diagonal block of vertex `v` [N/m].
    void add(Index v, const Block& block) noexcept { add(block, entries_[at(v)]); }
    void add(Index v, const Symmetric3<double>& block) noexcept { add(v, dense(block)); }
    ///@}

    ///@{
    /// Subtracts `block` in the rows of the first and the columns of the second vertex of link number `link`, and its
    /// transpose vice versa [N/m].
    void subtract(std::size_t link, const Block& block) noexcept { add(-block, entries_[rank_.size() + link]); }
    void subtract(std::size_t link, const Symmetric3<double>& block) noexcept { subtract(link, dense(block)); }
    ///@}

    /// True only if no eigenvalue is below `shift`: Cholesky's algorithm succeeds for A - (shift + c) I, where c, n
    /// epsilon times the sum of all magnitudes added to A, exceeds the rounding error [Rump06]. The matrix A is not
    /// changed. Online. Cost for a mesh: O(V^1.5).
    [[nodiscard]] bool definite_above(double shift) noexcept;

    /// Computes the factor L of A + `shift` I = L L^T; false if the square of a number on its diagonal would not be
    /// above `min_pivot` [N/m]. Online. Cost: `multiplications()`.
    [[nodiscard]] bool factorise(double shift, double min_pivot) noexcept;

    /// Multiplications in a factorisation. For a mesh: O(V^1.5).
    [[nodiscard]] double multiplications() const noexcept;

    /// Numbers stored of L. For a mesh: O(V log V).
    [[nodiscard]] Eigen::Index size() const noexcept { return numbers_.size() - lanes; }

    /// The number of vertex `v` in the order of elimination.
    [[nodiscard]] std::size_t rank(Index v) const noexcept { return rank_[at(v)]; }

    /// The ranks, ascending, of all vertices at which L^-1 b may differ from zero if b differs from zero only at
    /// `vertices`. Offline. For a few vertices of a mesh: O(V^0.5).
    [[nodiscard]] std::vector<std::size_t> affected(std::span<const Index> vertices) const;

    ///@{
    /// Replaces b by L^-1 b, or by L^-T b. It has three rows for each vertex in the order of elimination, or for each
    /// of `ranks` if these are all that are `affected`. Offline.
    template <class Matrix>
    void solve_lower(Matrix& b, std::span<const std::size_t> ranks) const;
    void solve_lower(Eigen::VectorXd& b) const;
    void solve_upper(Eigen::VectorXd& b) const;
    ///@}

  private:
    static constexpr Eigen::Index lanes = 8;  // numbers that `multiply` adds at once
    template <int count>
    using Columns = Eigen::Matrix<double, Eigen::Dynamic, count, Eigen::DontAlign>;
    struct Entry {  // of the matrix, on or below the diagonal
        Block block;
        std::size_t panel;
        Eigen::Index row, column;  // of the panel's numbers
        bool transposed;
    };
    struct Panel {
        std::size_t first, count;     // of its columns, ranks
        std::size_t rows, row_count;  // of its blocks in each column, begin in `rows_`; the first ones are its columns
        Eigen::Index numbers;         // begin in `numbers_`
    };

    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    [[nodiscard]] static Eigen::Index three(std::size_t n) noexcept { return static_cast<Eigen::Index>(3 * n); }
    [[nodiscard]] std::span<const std::size_t> rows(const Panel& panel) const noexcept {
        return {rows_.data() + panel.rows, panel.row_count};
    }
    [[nodiscard]] auto numbers(const Panel& panel) noexcept;
    [[nodiscard]] auto numbers(const Panel& panel) const noexcept;
    [[nodiscard]] Entry entry(std::size_t row, std::size_t column, bool transposed) const;
    void add(const Block& block, Entry& entry) noexcept;
    void add_panels(const std::vector<std::vector<Index>>& parts, const CompressedRows<Index>& neighbours);
    void multiply(const Panel& panel, std::size_t row, std::size_t columns) noexcept;
    [[nodiscard]] bool factorise(const Panel& panel, double min_pivot) noexcept;
    void subtract_from_later(const Panel& panel) noexcept;

    std::vector<std::size_t> rank_;      // of each vertex
    std::vector<Entry> entries_;         // of each vertex, then of each link
    std::vector<Panel> panels_;          // in the order of elimination
    std::vector<std::size_t> panel_of_;  // of each rank
    std::vector<std::size_t> rows_;      // ranks, panel by panel
    Columns<1> numbers_;                 // L, panel by panel, and what `multiply` may read beyond it
    Columns<3> product_;                 // of `multiply`
    std::vector<std::size_t> row_in_;    // of each rank, its row in the panel that changes
    double size_ = 0;                    // sum of the magnitudes added to the matrix
};

namespace detail {

/// Cholesky factor of a 3 x 3 matrix, read from and written to its lower triangle; false if the square of a number on
/// its diagonal would not be above `min_pivot`.
[[nodiscard]] inline bool factorise(Eigen::Matrix3d& a, double min_pivot) noexcept {
    for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < j; ++k) a(j, j) -= a(j, k) * a(j, k);
        if (!(a(j, j) > min_pivot)) return false;
        a(j, j) = std::sqrt(a(j, j));
        for (int i = j + 1; i < 3; ++i) {
            for (int k = 0; k < j; ++k) a(i, j) -= a(i, k) * a(j, k);
            a(i, j) /= a(j, j);
        }
    }
    return true;
}

/// b L^-T, L the lower triangle.
template <class Matrix>
void divide(Matrix&& b, const Eigen::Matrix3d& lower) noexcept {
    for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < j; ++k) b.col(j) -= lower(j, k) * b.col(k);
        b.col(j) /= lower(j, j);
    }
}

}  // namespace detail

template <class Links>
BlockCholesky::BlockCholesky(Index vertex_count, const Links& links) : rank_(at(vertex_count)), row_in_(rank_.size()) {
    const CompressedRows<Index> neighbours(vertex_count, [&](auto put) {
        for (const auto& link : links) put(link.first, link.second), put(link.second, link.first);
    });
    add_panels(nested_dissection(neighbours), neighbours);
    for (const std::size_t v : rank_) entries_.push_back(entry(v, v, false));
    for (const auto& link : links) {
        const auto [column, row] = std::minmax(rank_[at(link.first)], rank_[at(link.second)]);
        entries_.push_back(entry(row, column, column == rank_[at(link.first)]));
    }
}

// The rows of a panel: its own vertices, and those that are linked to them, from the start or by elimination.
inline void BlockCholesky::add_panels(const std::vector<std::vector<Index>>& parts,
                                      const CompressedRows<Index>& neighbours) {
    for (std::size_t p = 0; p < parts.size(); ++p) {
        panels_.push_back({panel_of_.size(), parts[p].size(), 0, 0, 0});
        for (const Index v : parts[p]) {
            rank_[at(v)] = panel_of_.size();
            panel_of_.push_back(p);
        }
    }
    std::vector<std::vector<std::size_t>> found(parts.size());  // rows
    Eigen::Index size = 0;
    std::size_t most = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
        auto& panel = panels_[p];
        for (const Index v : parts[p]) {
            found[p].push_back(rank_[at(v)]);
            for (const Index w : neighbours[v]) found[p].push_back(rank_[at(w)]);
        }
        std::sort(found[p].begin(), found[p].end());
        const auto end = std::unique(found[p].begin(), found[p].end());
        panel.rows = rows_.size();
        std::copy_if(found[p].begin(), end, std::back_inserter(rows_),
                     [&](std::size_t row) { return row >= panel.first; });
        panel.row_count = rows_.size() - panel.rows;
        panel.numbers = size;
        size += three(panel.row_count) * three(panel.count);
        most = (std::max)(most, panel.row_count);
        const auto later = rows(panel).subspan(panel.count);
        if (later.empty()) continue;
        auto& next = found[panel_of_[later.front()]];
        next.insert(next.end(), later.begin(), later.end());
    }
    numbers_.setZero(size + lanes);
    product_.setZero(three(most) + lanes, 3);
}

inline auto BlockCholesky::numbers(const Panel& panel) noexcept {
    return Eigen::Map<Eigen::MatrixXd>(numbers_.data() + panel.numbers, three(panel.row_count), three(panel.count));
}

inline auto BlockCholesky::numbers(const Panel& panel) const noexcept {
    return Eigen::Map<const Eigen::MatrixXd>(numbers_.data() + panel.numbers, three(panel.row_count),
                                             three(panel.count));
}

inline auto BlockCholesky::entry(std::size_t row, std::size_t column, bool transposed) const -> Entry {
    const auto& panel = panels_[panel_of_[column]];
    const auto all = rows(panel);
    const auto place = static_cast<std::size_t>(std::lower_bound(all.begin(), all.end(), row) - all.begin());
    return {Block::Zero(), panel_of_[column], three(place), three(column - panel.first), transposed};
}

inline void BlockCholesky::open() noexcept {
    size_ = 0;
    for (auto& entry : entries_) entry.block.setZero();
}

inline void BlockCholesky::add(const Block& block, Entry& entry) noexcept {
    if (entry.transposed) {
        entry.block += block.transpose();
    } else {
        entry.block += block;
    }
    const double copies = entry.row == entry.column ? 1 : 2;
    for (const double number : block.reshaped()) size_ += copies * std::abs(number);
}

inline bool BlockCholesky::definite_above(double shift) noexcept {
    const auto n = static_cast<double>(3 * rank_.size());
    const double rounding = (n + 16) * std::numeric_limits<double>::epsilon() * (size_ + n * std::abs(shift));
    return factorise(-(shift + rounding), 0);
}

inline bool BlockCholesky::factorise(double shift, double min_pivot) noexcept {
    numbers_.setZero();
    for (const auto& entry : entries_) {
        numbers(panels_[entry.panel]).block<3, 3>(entry.row, entry.column) += entry.block;
    }
    for (const auto& panel : panels_) {
        numbers(panel).diagonal().array() += shift;
        if (!factorise(panel, min_pivot)) return false;
        subtract_from_later(panel);
    }
    return true;
}

// From the columns of each vertex, subtracts the product of the panel's columns before, and divides by the pivot's
// factor.
inline bool BlockCholesky::factorise(const Panel& panel, double min_pivot) noexcept {
    auto l = numbers(panel);
    for (std::size_t v = 0; v < panel.count; ++v) {
        const Eigen::Index at = three(v), below = l.rows() - at;
        multiply(panel, v, v);
        l.block(at, at, below, 3) -= product_.topRows(below);
        Block pivot = l.block<3, 3>(at, at);
        if (!detail::factorise(pivot, min_pivot)) return false;
        l.block<3, 3>(at, at) = pivot;
        detail::divide(l.block(at + 3, at, below - 3, 3), pivot);
    }
    return true;
}

// From the columns of the panel's later rows, subtracts the product of all its columns.
inline void BlockCholesky::subtract_from_later(const Panel& panel) noexcept {
    const auto all = rows(panel);
    const Panel* later = nullptr;
    for (std::size_t r = panel.count; r < all.size(); ++r) {
        if (const Panel* next = &panels_[panel_of_[all[r]]]; next != later) {
            later = next;
            for (std::size_t i = 0; i < later->row_count; ++i) row_in_[rows(*later)[i]] = i;
        }
        multiply(panel, r, panel.count);
        auto columns = numbers(*later).middleCols<3>(three(all[r] - later->first));
        for (std::size_t i = r; i < all.size(); ++i) {
            columns.middleRows<3>(three(row_in_[all[i]])) -= product_.middleRows<3>(three(i - r));
        }
    }
}

// `product_` becomes A B^T. A are the numbers of the panel from this row of blocks on, in the first `columns` of
// blocks, B is the first row of blocks of A. Each sum is in the order of the columns, for any number of lanes.
inline void BlockCholesky::multiply(const Panel& panel, std::size_t row, std::size_t columns) noexcept {
    using Lanes = Eigen::Array<double, lanes, 1>;
    const auto l = numbers(panel);
    const double* first = l.data() + three(row);
    for (Eigen::Index i = 0; i < l.rows() - three(row); i += lanes) {
        Lanes x = Lanes::Zero(), y = x, z = x;
        const double* column = first;
        for (Eigen::Index c = 0; c < three(columns); ++c, column += l.rows()) {
            const Lanes part = Eigen::Map<const Lanes>(column + i);
            x += column[0] * part;
            y += column[1] * part;
            z += column[2] * part;
        }
        product_.col(0).segment<lanes>(i) = x;
        product_.col(1).segment<lanes>(i) = y;
        product_.col(2).segment<lanes>(i) = z;
    }
}

inline double BlockCholesky::multiplications() const noexcept {
    double sum = 0;
    for (const auto& panel : panels_) {
        for (std::size_t c = 0; c < panel.count; ++c) {
            const auto height = static_cast<double>(3 * (panel.row_count - c));
            sum += 1.5 * height * height;
        }
    }
    return sum;
}

inline std::vector<std::size_t> BlockCholesky::affected(std::span<const Index> vertices) const {
    std::vector<unsigned char> reached(panels_.size(), 0);
    for (const Index v : vertices) reached[panel_of_[rank_[at(v)]]] = 1;
    std::vector<std::size_t> found;
    for (std::size_t p = 0; p < panels_.size(); ++p) {
        if (reached[p] == 0) continue;
        const auto& panel = panels_[p];
        for (std::size_t i = 0; i < panel.count; ++i) found.push_back(panel.first + i);
        if (panel.row_count > panel.count) reached[panel_of_[rows(panel)[panel.count]]] = 1;
    }
    return found;
}

template <class Matrix>
void BlockCholesky::solve_lower(Matrix& b, std::span<const std::size_t> ranks) const {
    std::vector<std::size_t> place(rank_.size());  // of each row in b
    for (std::size_t i = 0; i < ranks.size(); ++i) place[ranks[i]] = i;
    for (std::size_t i = 0; i < ranks.size();) {
        const auto& panel = panels_[panel_of_[ranks[i]]];
        const auto l = numbers(panel);
        auto own = b.middleRows(three(i), l.cols());
        l.topRows(l.cols()).template triangularView<Eigen::Lower>().solveInPlace(own);
        const auto change = (l.bottomRows(l.rows() - l.cols()) * own).eval();
        for (std::size_t r = panel.count; r < panel.row_count; ++r) {
            b.template middleRows<3>(three(place[rows(panel)[r]])) -=
                change.template middleRows<3>(three(r - panel.count));
        }
        i += panel.count;
    }
}

inline void BlockCholesky::solve_lower(Eigen::VectorXd& b) const {
    std::vector<std::size_t> all(rank_.size());
    std::iota(all.begin(), all.end(), std::size_t(0));
    solve_lower(b, all);
}

inline void BlockCholesky::solve_upper(Eigen::VectorXd& b) const {
    Eigen::VectorXd others(product_.rows());
    for (std::size_t p = panels_.size(); p-- > 0;) {
        const Panel& panel = panels_[p];
        const auto l = numbers(panel);
        const auto later = rows(panel).subspan(panel.count);
        for (std::size_t i = 0; i < later.size(); ++i) others.segment<3>(three(i)) = b.segment<3>(three(later[i]));
        auto own = b.segment(three(panel.first), l.cols());
        own -= l.bottomRows(three(later.size())).transpose() * others.head(three(later.size()));
        l.topRows(l.cols()).transpose().triangularView<Eigen::Upper>().solveInPlace(own);
    }
}

}  // namespace membrane
