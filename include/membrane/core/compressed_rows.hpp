// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/check.hpp>

namespace membrane {

/// Rows of different lengths, stored contiguously in one array.
///
///     const CompressedRows<Index> triangles_of(vertex_count, [&](auto put) {
///         for (Index f = 0; f < triangles.cols(); ++f) {
///             for (const Index v : triangles.col(f)) put(v, f);
///         }
///     });
template <class Item>
class CompressedRows {
  public:
    CompressedRows() = default;  ///< No rows.

    /// `for_each_item(put)` calls `put(row, item)` for every item. It is called twice and must make the same calls both
    /// times. A row holds its items in the order of the calls. Linear in rows and items.
    template <class ForEachItem>
    CompressedRows(Index row_count, ForEachItem for_each_item);

    /// Number of rows, empty ones included.
    [[nodiscard]] Index row_count() const noexcept { return static_cast<Index>(begin_.size() - 1); }

    /// The items of a row, valid as long as the rows. @pre 0 <= `row` < `row_count()` (asserted).
    [[nodiscard]] std::span<const Item> operator[](Index row) const noexcept {
        MEMBRANE_ASSERT(row >= 0 && row < row_count());
        const auto r = static_cast<std::size_t>(row);
        return {items_.data() + begin_[r], items_.data() + begin_[r + 1]};
    }

    /// All items, row by row.
    [[nodiscard]] std::span<const Item> items() const noexcept { return items_; }

  private:
    std::vector<std::size_t> begin_{0};  // of each row, then the end of the last
    std::vector<Item> items_;
};

template <class Item>
template <class ForEachItem>
CompressedRows<Item>::CompressedRows(Index row_count, ForEachItem for_each_item)
    : begin_(static_cast<std::size_t>(row_count) + 1) {
    for_each_item([&](Index row, const Item&) { ++begin_[static_cast<std::size_t>(row) + 1]; });
    for (std::size_t r = 1; r < begin_.size(); ++r) begin_[r] += begin_[r - 1];
    items_.resize(begin_.back());
    std::vector<std::size_t> next = begin_;
    for_each_item([&](Index row, const Item& item) { items_[next[static_cast<std::size_t>(row)]++] = item; });
}

}  // namespace membrane
