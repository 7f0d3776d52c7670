// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/index_set.hpp>

namespace membrane {

/// An order of vertices in groups whose vertices no spring joins, so that those of a group may be updated at once. By
/// greedy colouring each vertex is in the first group without a neighbour of it. Or each is in the group after that of
/// the last neighbour before it: then updates have the same results as one by one in the given order.
///
///     membrane::VertexColouring groups(network.vertex_count());
///     groups.add(network, vertices, 0, 100);           // now in another order
///     for (const std::size_t end : groups.ends()) { ... }
class VertexColouring {
  public:
    /// No groups. Cost: O(V) memory.
    explicit VertexColouring(Index vertex_count)
        : ends_(static_cast<std::size_t>(vertex_count)),
          group_of_(static_cast<std::size_t>(vertex_count), no_index),
          barred_(group_of_),
          fill_(group_of_),
          order_(group_of_) {}

    /// Orders the vertices number `begin` to `end` of a set: by colouring, or with `same_results`. Online. Cost: their
    /// springs.
    template <class Network>
    void add(const Network& network, IndexSet& set, std::size_t begin, std::size_t end,
             bool same_results = false) noexcept;

    /// End of each group in the set, where the next one begins.
    [[nodiscard]] std::span<const std::size_t> ends() const& noexcept { return ends_.items(); }
    void ends() && = delete;

    /// Removes all groups.
    void clear() noexcept { ends_.clear(); }

    /// Visits what is kept from tick to tick, see `core/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.ends_);
    }

  private:
    FixedVector<std::size_t> ends_;
    std::vector<Index> group_of_;  // of each vertex that is being ordered
    std::vector<Index> barred_;    // of each group, the last vertex that has a neighbour there
    std::vector<Index> fill_;      // of each group, its size; then, the position of its next vertex
    std::vector<Index> order_;
};

template <class Network>
void VertexColouring::add(const Network& network, IndexSet& set, std::size_t begin, std::size_t end,
                          bool same_results) noexcept {
    const auto at = [](Index i) { return static_cast<std::size_t>(i); };
    const auto vertices = set.items().subspan(begin, end - begin);
    Index groups = 0;
    for (const Index v : vertices) {
        Index group = 0;
        for (const auto& spring : network.neighbours(v)) {
            const Index other = group_of_[at(spring.other)];
            if (other == no_index) continue;
            barred_[at(other)] = v;
            if (same_results) group = (std::max)(group, other + 1);
        }
        while (group < groups && barred_[at(group)] == v) ++group;
        if (group == groups) {
            barred_[at(group)] = no_index;
            fill_[at(groups++)] = 0;
        }
        ++fill_[at(group)];
        group_of_[at(v)] = group;
    }
    Index group_end = 0;
    for (Index group = 0; group < groups; ++group) {
        const Index first = group_end;
        group_end += std::exchange(fill_[at(group)], first);
        ends_.try_push_back(begin + at(group_end));
    }
    for (const Index v : vertices) order_[at(fill_[at(std::exchange(group_of_[at(v)], no_index))]++)] = v;
    set.reorder(begin, std::span(order_).first(vertices.size()));
}

}  // namespace membrane
