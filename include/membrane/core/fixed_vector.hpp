// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/check.hpp>

namespace membrane {

/// A vector of fixed capacity: allocates only when constructed or copied. (A copied `std::vector` loses its reserved
/// capacity.)
///
///     membrane::FixedVector<membrane::ContactPoint<double>> points(4096);
///     if (!points.try_push_back(point)) return;  // full
template <class Item>
class FixedVector {
  public:
    FixedVector() = default;  ///< Of capacity 0.

    /// Empty. Allocates memory for `capacity` items and constructs them.
    explicit FixedVector(std::size_t capacity) : slots_(capacity) {}

    /// Appends `item`; returns false if the capacity is used up.
    bool try_push_back(const Item& item) noexcept {
        if (count_ == slots_.size()) return false;
        slots_[count_++] = item;
        return true;
    }

    /// Removes all items; the capacity stays.
    void clear() noexcept { count_ = 0; }

    /// Keeps the first `count` items, all if there are fewer.
    void truncate(std::size_t count) noexcept { count_ = (std::min)(count, count_); }

    ///@{
    /// Number of items: the largest possible, the present one, and whether that is 0.
    [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }
    [[nodiscard]] std::size_t size() const noexcept { return count_; }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
    ///@}

    ///@{
    /// All items. Valid until the vector is assigned to or destroyed.
    [[nodiscard]] std::span<Item> items() & noexcept { return {slots_.data(), count_}; }
    [[nodiscard]] std::span<const Item> items() const& noexcept { return {slots_.data(), count_}; }
    void items() && = delete;
    ///@}

    /// Item number `i`. @pre `i` < size() (asserted)
    [[nodiscard]] const Item& operator[](std::size_t i) const noexcept {
        MEMBRANE_ASSERT(i < count_);
        return slots_[i];
    }

  private:
    std::vector<Item> slots_;
    std::size_t count_ = 0;
};

}  // namespace membrane
