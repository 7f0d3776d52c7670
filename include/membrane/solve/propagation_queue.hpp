// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/model/mass_spring_network.hpp>

/// The order in which a force spreads through the springs, in groups of vertices that may be updated at once.
///
///     membrane::PropagationQueue queue(network.vertex_count());
///     queue.build(network, seeds, 6);
///     for (const membrane::Index v : queue.vertices()) { ... }              // nearest to the contact first
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

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
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

/// Vertices in the order of a breadth-first search from the seeds, [Liu07] 2.2: the seeds are layer 0, layer k holds
/// the vertices at k springs or edges of elements from the nearest seed, until `group` merges layers. Within a layer
/// the order is breadth-first, or by groups.
class PropagationQueue {
  public:
    /// An empty queue. Cost: O(V) memory.
    explicit PropagationQueue(Index vertex_count)
        : reached_(vertex_count), layer_ends_(static_cast<std::size_t>(vertex_count)), colouring_(vertex_count) {}

    /// Rebuilds the queue, up to layer `layers` (0: the seeds alone; `unlimited`: all vertices connected to them). A
    /// pinned vertex transmits no force: it is never in the queue. Seeds may repeat.
    /// Online. Cost: the springs of the vertices in the queue.
    template <class Network>
    void build(const Network& network, std::span<const Index> seeds, Index layers) noexcept;

    /// Adds a layer; false if there is no vertex left to add. Online. Cost: the springs of the last layer.
    template <class Network>
    bool grow(const Network& network) noexcept;

    /// Orders every layer in groups; no spring joins two vertices of a group. If `together`, all layers beyond layer 0
    /// are merged into one, with fewer and larger groups. With `same_results` updates have the results of the
    /// breadth-first order, see `VertexColouring`.
    /// Online. Cost: the springs of the vertices in the queue.
    template <class Network>
    void group(const Network& network, bool together = false, bool same_results = false) noexcept;

    /// Ends of the groups in `vertices`; empty before `group` is called.
    [[nodiscard]] std::span<const std::size_t> colour_ends() const& noexcept { return colouring_.ends(); }
    void colour_ends() && = delete;

    /// All vertices of the queue, layer by layer.
    [[nodiscard]] std::span<const Index> vertices() const& noexcept { return reached_.items(); }
    void vertices() && = delete;

    /// Whether `v` is in the queue.
    [[nodiscard]] bool contains(Index v) const noexcept { return reached_.contains(v); }

    /// Number of layers: at most one more than `layers`, fewer if the mesh ends before.
    [[nodiscard]] Index layer_count() const noexcept { return static_cast<Index>(layer_ends_.size()); }

    /// The vertices of layer `k`; none beyond the last layer.
    [[nodiscard]] std::span<const Index> layer(Index k) const& noexcept {
        if (k < 0 || k >= layer_count()) return {};
        const auto at = static_cast<std::size_t>(k);
        const std::size_t begin = k == 0 ? 0 : layer_ends_[at - 1];
        return vertices().subspan(begin, layer_ends_[at] - begin);
    }
    void layer(Index) && = delete;

    /// Removes all vertices.
    void clear() noexcept {
        reached_.clear();
        layer_ends_.clear();
        colouring_.clear();
    }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.reached_, self.layer_ends_, self.colouring_);
    }

  private:
    IndexSet reached_;
    FixedVector<std::size_t> layer_ends_;
    VertexColouring colouring_;
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

namespace detail {

/// The vertices one layer from `v`: its neighbours, without those to which only an element couples it, and no edge.
template <class Network>
[[nodiscard]] auto joined_to(const Network& network, Index v) noexcept {
    if constexpr (requires { network.joined(v); }) {
        return network.joined(v);
    } else {
        return network.neighbours(v);
    }
}

}  // namespace detail

template <class Network>
void PropagationQueue::build(const Network& network, std::span<const Index> seeds, Index layers) noexcept {
    clear();
    for (const Index v : seeds) {
        if (!network.pinned(v)) reached_.insert(v);
    }
    if (vertices().empty()) return;
    layer_ends_.try_push_back(vertices().size());
    while (layer_count() <= layers && grow(network)) {
    }
}

template <class Network>
bool PropagationQueue::grow(const Network& network) noexcept {
    if (layer_count() == 0) return false;
    const std::size_t end = vertices().size();
    for (const Index v : layer(layer_count() - 1)) {
        for (const auto& joined : detail::joined_to(network, v)) {
            if (!network.pinned(joined.other)) reached_.insert(joined.other);
        }
    }
    if (vertices().size() == end) return false;
    layer_ends_.try_push_back(vertices().size());
    return true;
}

template <class Network>
void PropagationQueue::group(const Network& network, bool together, bool same_results) noexcept {
    colouring_.clear();
    if (together && layer_count() > 1) {
        layer_ends_.truncate(1);
        layer_ends_.try_push_back(vertices().size());
    }
    const auto ends = layer_ends_.items();
    for (std::size_t k = 0; k < ends.size(); ++k) {
        colouring_.add(network, reached_, k > 0 ? ends[k - 1] : 0, ends[k], same_results);
    }
}

}  // namespace membrane
