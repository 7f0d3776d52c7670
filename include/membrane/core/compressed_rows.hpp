// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>

namespace membrane {

/// Rows of different lengths, stored contiguously in one array.
///
///     const membrane::CompressedRows<membrane::Index> triangles_of(mesh.vertex_count(), [&](auto put) {
///         for (membrane::Index f = 0; f < triangles.cols(); ++f) {
///             for (const membrane::Index v : triangles.col(f)) put(v, f);
///         }
///     });
template <class Item>
class CompressedRows {
  public:
    CompressedRows() = default;  ///< No rows.

    /// `for_each_item(put)` calls `put(row, item)` for every item. It is called twice and must make the same calls both
    /// times. A row holds its items in the order of the calls. Linear in rows and items, of which there may be 2^32.
    template <class ForEachItem>
    CompressedRows(Index row_count, ForEachItem for_each_item);

    /// Number of rows, empty ones included.
    [[nodiscard]] Index row_count() const noexcept { return static_cast<Index>(rows_.size()); }

    ///@{
    /// The items of a row, valid as long as the rows. @pre 0 <= `row` < `row_count()` (asserted).
    [[nodiscard]] std::span<const Item> operator[](Index row) const noexcept {
        const Row& at = extent(row);
        return {items_.data() + at.begin, at.count};
    }
    [[nodiscard]] std::span<Item> operator[](Index row) noexcept {
        const Row& at = extent(row);
        return {items_.data() + at.begin, at.count};
    }
    ///@}

    /// All items, row by row, as they were put.
    [[nodiscard]] std::span<const Item> items() const& noexcept { return items_; }
    void items() && = delete;

    ///@{
    /// Online, for rows that change. Row `from` is divided: the items for which `goes(item)` become row `to`, which
    /// must be empty; both keep their order. Row `from` keeps the memory of its first `capacity` items, which may be
    /// more than it has.
    template <class Goes>
    void split(Index from, Index to, Goes goes, std::size_t capacity = 0) noexcept;
    /// Row `to` shows the items of row `from`.
    void share(Index from, Index to) noexcept { extent(to) = extent(from); }
    /// Removes the last items of a row but for `count`; their memory stays the row's.
    void truncate(Index row, std::size_t count) noexcept { extent(row).count = static_cast<std::uint32_t>(count); }
    /// Appends an item. @pre the row has had an item more
    void append(Index row, const Item& item) noexcept {
        Row& at = extent(row);
        items_[at.begin + at.count++] = item;
    }
    ///@}

    /// Visits rows and items, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.rows_, self.items_);
    }

  private:
    struct Row {
        std::uint32_t begin = 0, count = 0;
    };
    [[nodiscard]] const Row& extent(Index row) const noexcept {
        MEMBRANE_ASSERT(row >= 0 && row < row_count());
        return rows_[static_cast<std::size_t>(row)];
    }
    [[nodiscard]] Row& extent(Index row) noexcept { return const_cast<Row&>(std::as_const(*this).extent(row)); }

    std::vector<Row> rows_;
    std::vector<Item> items_;
};

template <class Item>
template <class ForEachItem>
CompressedRows<Item>::CompressedRows(Index row_count, ForEachItem for_each_item)
    : rows_(static_cast<std::size_t>(row_count)) {
    for_each_item([&](Index row, const Item&) { ++extent(row).count; });
    std::uint32_t end = 0;
    for (Row& row : rows_) {
        row.begin = end;
        end += std::exchange(row.count, 0);
    }
    items_.resize(end);
    for_each_item([&](Index row, const Item& item) { append(row, item); });
}

template <class Item>
template <class Goes>
void CompressedRows<Item>::split(Index from, Index to, Goes goes, std::size_t capacity) noexcept {
    const auto all = (*this)[from];
    std::size_t stays = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {  // rows are short
        if (goes(std::as_const(all[i]))) continue;
        std::rotate(all.begin() + static_cast<std::ptrdiff_t>(stays), all.begin() + static_cast<std::ptrdiff_t>(i),
                    all.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        ++stays;
    }
    MEMBRANE_ASSERT(capacity == 0 || capacity >= stays);
    Row& first = extent(from);
    const auto begin = static_cast<std::uint32_t>(first.begin + (std::max)(capacity, stays));
    const std::size_t count = all.size() - stays;
    std::move_backward(all.begin() + static_cast<std::ptrdiff_t>(stays), all.end(),
                       items_.begin() + static_cast<std::ptrdiff_t>(begin + count));
    first.count = static_cast<std::uint32_t>(stays);
    extent(to) = {begin, static_cast<std::uint32_t>(count)};
}

}  // namespace membrane
