// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>

#include <membrane/core/index_set.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/solve/vertex_colouring.hpp>

/// The order in which a force spreads through the springs.
///
///     membrane::PropagationQueue queue(network.vertex_count());
///     queue.build(network, seeds, 6);
///     for (const membrane::Index v : queue.vertices()) { ... }              // nearest to the contact first
namespace membrane {

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

    /// Visits what is kept from tick to tick, see `core/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.reached_, self.layer_ends_, self.colouring_);
    }

  private:
    IndexSet reached_;
    FixedVector<std::size_t> layer_ends_;
    VertexColouring colouring_;
};

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
