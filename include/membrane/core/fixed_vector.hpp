// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/check.hpp>

namespace membrane {

/// A list with room for a fixed number of items: it allocates when it is made or copied, and never else. (A copied
/// `std::vector` has lost what was reserved.)
///
///     FixedVector<Touch<double>> contacts(4096);
///     if (!contacts.push(touch)) { /* full */ }
template <class Item>
class FixedVector {
  public:
    FixedVector() = default;
    explicit FixedVector(std::size_t capacity) : slots_(capacity) {}

    /// Adds `item` at the end, or says that there is no room for it.
    bool push(const Item& item) noexcept {
        if (count_ == slots_.size()) return false;
        slots_[count_++] = item;
        return true;
    }
    void clear() noexcept { count_ = 0; }

    /// Keeps the first `count` items. @pre no more than there are (asserted)
    void cut(std::size_t count) noexcept {
        MEMBRANE_ASSERT(count <= count_);
        count_ = count;
    }

    [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }
    [[nodiscard]] std::size_t size() const noexcept { return count_; }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

    /// Valid until the list is assigned to or destroyed.
    [[nodiscard]] std::span<Item> items() noexcept { return {slots_.data(), count_}; }
    [[nodiscard]] std::span<const Item> items() const noexcept { return {slots_.data(), count_}; }

    /// @pre `i` < size() (asserted)
    [[nodiscard]] const Item& operator[](std::size_t i) const noexcept {
        MEMBRANE_ASSERT(i < count_);
        return slots_[i];
    }

  private:
    std::vector<Item> slots_;
    std::size_t count_ = 0;
};

}  // namespace membrane
