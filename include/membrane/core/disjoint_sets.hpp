// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace membrane {

/// Disjoint sets of the numbers from 0 to `count` - 1, with union and find.
///
///     membrane::DisjointSets parts(mesh.triangle_count());
///     parts.unite(f, g);
///     parts.find(f) == parts.find(g);
class DisjointSets {
  public:
    /// Each number below `count` starts in a set of its own.
    explicit DisjointSets(std::size_t count) : parent_(count) {
        std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    }

    /// The lowest number of the set that contains `i`. O(log count), amortised.
    std::size_t find(std::size_t i) noexcept {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }

    /// Merges the sets of `i` and `j`. O(log count), amortised.
    void unite(std::size_t i, std::size_t j) noexcept {
        const auto [first, second] = std::minmax({find(i), find(j)});
        parent_[second] = first;
    }

  private:
    std::vector<std::size_t> parent_;
};

}  // namespace membrane
