// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <membrane/core/fixed_vector.hpp>

namespace membrane {

/// A set of vertex or triangle indices in order of insertion. `clear` is O(1), amortised.
///
///     membrane::IndexSet found(mesh.triangle_count());
///     if (found.insert(f)) { ... }         // f was not in it
///     for (const membrane::Index f : found.items()) { ... }
class IndexSet {
  public:
    IndexSet() = default;  ///< An empty set for no indices.

    /// An empty set for indices from 0 to `size` - 1; allocates all its memory.
    explicit IndexSet(Index size) : mark_(static_cast<std::size_t>(size), 0), items_(mark_.size()) {}

    /// Inserts `i`; returns whether it was new. Ignores an index outside 0 .. size - 1.
    bool insert(Index i) noexcept {
        if (!has(i) || contains(i)) return false;
        mark_[static_cast<std::size_t>(i)] = current_;
        items_.try_push_back(i);
        return true;
    }

    /// Whether `i` is an index that may be inserted.
    [[nodiscard]] bool has(Index i) const noexcept { return static_cast<std::size_t>(i) < mark_.size(); }

    /// Whether `i` is in the set. @pre 0 <= `i` < size (asserted)
    [[nodiscard]] bool contains(Index i) const noexcept {
        MEMBRANE_ASSERT(has(i));
        return mark_[static_cast<std::size_t>(i)] == current_;
    }

    /// Indices in order of insertion; valid until the next change.
    [[nodiscard]] std::span<const Index> items() const& noexcept { return items_.items(); }
    void items() && = delete;

    ///@{
    /// Number of items, and whether it is 0.
    [[nodiscard]] Index count() const noexcept { return static_cast<Index>(items_.size()); }
    [[nodiscard]] bool empty() const noexcept { return items_.empty(); }
    ///@}

    /// Number of indices that may be inserted.
    [[nodiscard]] std::size_t capacity() const noexcept { return mark_.size(); }

    /// Reorders the items from position `begin` on. @pre `order` holds the same items
    void reorder(std::size_t begin, std::span<const Index> order) noexcept {
        std::copy(order.begin(), order.end(), items_.items().begin() + static_cast<std::ptrdiff_t>(begin));
    }

    /// Removes all items. Cost: O(1), amortised.
    void clear() noexcept {
        items_.clear();
        if (++current_ == 0) {  // after 2^32 calls old marks would count again
            std::fill(mark_.begin(), mark_.end(), 0U);
            current_ = 1;
        }
    }

  private:
    std::vector<std::uint32_t> mark_;  // i is in the set if mark_[i] == current_
    FixedVector<Index> items_;
    std::uint32_t current_ = 1;
};

}  // namespace membrane
