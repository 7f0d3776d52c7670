// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include <membrane/core/index_set.hpp>
#include <membrane/solve/propagation_queue.hpp>
#include <membrane/solve/step.hpp>

/// The vertices that a step updates.
///
///     active.begin_step(network, seeds, options);
///     for (const membrane::Index v : active.vertices()) { ... }           // updates, nearest to the contact first
///     const bool balanced = active.end_step(network, is_balanced, moved);
namespace membrane {

/// The active vertices: the propagation queue, and outside it the vertices awake, whose forces do not balance after a
/// contact moved on or ended. A vertex stays awake until its forces balance. A moving neighbour wakes it again if it
/// was active since the last equilibrium; beyond the layers vertices stay asleep.
///
/// With `adaptive_layers` the queue begins each step with layer 0, `grow` adds a layer, and no vertex stays asleep
/// whose neighbours move.
class ActiveVertices {
  public:
    /// All asleep, without a queue. Cost: O(V) memory.
    explicit ActiveVertices(Index vertex_count);

    /// Begins a step: builds the queue if the seeds have changed, and lists the active vertices: the queue, then those
    /// awake, then those that the queue has dropped, up to the capacity by `options`, layer 0 and one more in any case.
    /// Vertices of the queue beyond the capacity are active in later steps. A last call without `end_step` is undone.
    /// Online.
    template <class Network, class Options>
    void begin_step(const Network& network, std::span<const Index> seeds, const Options& options) noexcept;

    ///@{
    /// This step's vertices in the order of their updates, and the first of them, which are layer 0.
    [[nodiscard]] std::span<const Index> vertices() const noexcept { return active_.items(); }
    [[nodiscard]] std::span<const Index> contact_layer() const noexcept { return vertices().first(layer_0().size()); }
    ///@}

    /// Whether this step updates `v`.
    [[nodiscard]] bool updates(Index v) const noexcept { return active_.contains(v); }

    /// This step's queue.
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return queue_; }

    /// Number of the first `vertices` that are in the queue.
    [[nodiscard]] std::size_t from_queue() const noexcept { return from_queue_; }

    /// Ends in `vertices` of the groups outside the queue, and of the layers that it has grown by.
    [[nodiscard]] std::span<const std::size_t> colour_ends() const noexcept { return colouring_.ends(); }

    /// Whether the queue has changed since the last call.
    [[nodiscard]] bool take_new_queue() noexcept { return std::exchange(has_new_queue_, false); }

    /// The layer whose forces are evaluated, but not updated yet: the first beyond the queue, if it may `grow`.
    [[nodiscard]] std::span<const Index> frontier() const noexcept {
        return has_frontier_ ? queue_.layer(queue_.layer_count() - 1) : std::span<const Index>();
    }

    /// Whether vertices wait for a later step for lack of capacity.
    [[nodiscard]] bool truncated() const noexcept { return truncated_; }

    /// Adds the frontier to the active vertices, at the end. Online.
    template <class Network, class Options>
    void grow(const Network& network, const Options& options) noexcept;

    /// `v` is awake from the next `begin_step` on. @pre a vertex (asserted) that is not pinned
    void wake(Index v) noexcept {
        awake_.insert(v);
        activated_.insert(v);
    }

    /// Ends a step: awake are now the active and frontier vertices for which `is_balanced(v)` is false (those of the
    /// queue only if the next step may leave them out), the vertices that had to wait, and the neighbours of those that
    /// `moved`; with `recheck`, because `is_balanced` has become stricter, also vertices that fell asleep. Returns
    /// whether the forces on all vertices balance.
    template <class Network, class IsBalanced>
    [[nodiscard]] bool end_step(const Network& network, IsBalanced is_balanced, std::span<const Index> moved,
                                bool recheck = false) noexcept;

    /// Other vertices are neighbours, or other forces join them: the next step builds the queue anew.
    void network_changed() noexcept { has_changed_ = true; }
    /// Whether that has been said since the queue was built.
    [[nodiscard]] bool has_changed() const noexcept { return has_changed_; }

    /// Makes all asleep, and the queue empty. The next step builds it anew.
    void clear() noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (Visit::restores) self.clear();
        visit(self.queue_, self.seeds_, self.awake_, self.dropped_, self.activated_, self.layers_, self.layers_before_,
              self.breadth_first_, self.together_, self.as_needed_, self.has_frontier_, self.queue_fits_, self.is_open_,
              self.has_changed_);
        if constexpr (Visit::restores) self.has_new_queue_ = true;  // what was packed is of another queue
    }

  private:
    template <class Network>
    void undo_step(const Network& network) noexcept;
    template <class IsBalanced>
    void find_awake(IsBalanced is_balanced) noexcept;
    template <class Network>
    void wake_neighbours(const Network& network, Index v) noexcept;
    [[nodiscard]] std::span<const Index> layer_0() const noexcept {
        return queue_.layer_count() > 0 ? queue_.layer(0) : std::span<const Index>();
    }
    template <class Network>
    void build_queue(const Network& network, std::span<const Index> seeds, Index layers) noexcept;
    template <class Options>
    [[nodiscard]] Index capacity_for(const Options& options) const noexcept;
    [[nodiscard]] Index capacity_of_others() const noexcept;
    void drop(std::span<const Index> vertices) noexcept;
    void activate(std::span<const Index> vertices, Index capacity) noexcept;
    template <class Network, class Options>
    void extend(const Network& network, const Options& options) noexcept;

    PropagationQueue queue_;
    IndexSet seeds_, next_seeds_;
    IndexSet awake_, next_awake_;
    IndexSet dropped_;    // by the queue, because it changed or lacks capacity
    IndexSet active_;     // in this step
    IndexSet activated_;  // active since the last equilibrium
    VertexColouring colouring_;
    Index capacity_ = 0;  // for active vertices
    std::size_t from_queue_ = 0;
    Index layers_ = 0, layers_before_ = 0;
    bool breadth_first_ = false, together_ = false;
    bool as_needed_ = false, has_frontier_ = false;
    bool has_new_queue_ = false;
    bool queue_fits_ = true, truncated_ = false;
    bool queue_balanced_ = true;
    bool is_open_ = false;      // between `begin_step` and `end_step`
    bool has_changed_ = false;  // the network, since the queue was built
};

inline ActiveVertices::ActiveVertices(Index vertex_count)
    : queue_(vertex_count),
      seeds_(vertex_count),
      next_seeds_(seeds_),
      awake_(seeds_),
      next_awake_(seeds_),
      dropped_(seeds_),
      active_(seeds_),
      activated_(seeds_),
      colouring_(vertex_count) {}

template <class Network, class Options>
void ActiveVertices::begin_step(const Network& network, std::span<const Index> seeds, const Options& options) noexcept {
    if (std::exchange(is_open_, true)) undo_step(network);
    as_needed_ = options.adaptive_layers;
    breadth_first_ = options.order == UpdateOrder::breadth_first;
    // Under a limit the layers stay apart, so that the farthest vertices are left out.
    together_ = options.order != UpdateOrder::colour_layers && options.max_vertex_updates == unlimited;
    layers_before_ = together_ ? std::exchange(layers_, options.layers) : queue_.layer_count() - 1;
    next_seeds_.clear();
    for (const Index v : seeds) next_seeds_.insert(v);
    dropped_.clear();
    const auto before = seeds_.items(), now = next_seeds_.items();
    const bool is_new = std::exchange(has_changed_, false) || as_needed_ ||
                        !std::equal(now.begin(), now.end(), before.begin(), before.end());
    if (is_new) {
        // Vertices that a constraint released, too: the forces on them have changed.
        drop(as_needed_ ? layer_0() : queue_.vertices());
        build_queue(network, seeds, as_needed_ ? 0 : options.layers);
    }
    capacity_ = capacity_for(options);
    const bool fits = static_cast<Index>(queue_.vertices().size()) <= capacity_ - capacity_of_others();
    if (!fits && (is_new || queue_fits_)) drop(queue_.vertices());  // vertices beyond the capacity take turns
    queue_fits_ = fits;

    active_.clear();
    truncated_ = false;
    activate(queue_.vertices(), capacity_ - capacity_of_others());
    from_queue_ = static_cast<std::size_t>(active_.count());
    activate(awake_.items(), capacity_);
    activate(dropped_.items(), capacity_);
    colouring_.clear();
    colouring_.add(network, active_, from_queue_, vertices().size(), breadth_first_);
    extend(network, options);
}

// Number of vertices that a step may update: the additional updates of layer 0 reduce those of the others.
template <class Options>
Index ActiveVertices::capacity_for(const Options& options) const noexcept {
    if (options.max_vertex_updates == unlimited) return unlimited;
    const auto contact_count = static_cast<Index>(layer_0().size());
    const auto own = std::int64_t{contact_count} * (std::int64_t{options.sweeps} * options.contact_iterations + 1);
    const auto passes =
        (std::int64_t{options.sweeps} + 1) * (as_needed_ ? 2 : 1);  // forces of a layer before it is added
    return contact_count + static_cast<Index>((std::max)((options.max_vertex_updates - own) / passes, std::int64_t{1}));
}

// Capacity reserved for vertices awake or dropped by the queue: they are updated under a lasting contact, too.
inline Index ActiveVertices::capacity_of_others() const noexcept {
    const auto contact_count = static_cast<Index>(layer_0().size());
    return (std::min)(awake_.count() + dropped_.count(),
                      std::clamp(capacity_ / 4, Index(1), capacity_ - contact_count));
}

inline void ActiveVertices::drop(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) dropped_.insert(v);
}

inline void ActiveVertices::activate(std::span<const Index> vertices, Index capacity) noexcept {
    for (const Index v : vertices) {
        if (active_.count() >= capacity) {
            truncated_ = true;
            return;
        }
        active_.insert(v);
    }
}

template <class Network>
void ActiveVertices::build_queue(const Network& network, std::span<const Index> seeds, Index layers) noexcept {
    queue_.build(network, seeds, layers);
    queue_.group(network, together_, breadth_first_);
    has_new_queue_ = true;
}

template <class Network, class Options>
void ActiveVertices::grow(const Network& network, const Options& options) noexcept {
    const std::size_t before = vertices().size();
    for (const Index v : frontier()) active_.insert(v);
    colouring_.add(network, active_, before, vertices().size(), breadth_first_);
    extend(network, options);
}

// Makes the next layer the frontier. If it exceeds the capacity, a vertex of it is awake only if a neighbour moves.
template <class Network, class Options>
void ActiveVertices::extend(const Network& network, const Options& options) noexcept {
    has_frontier_ = as_needed_ && queue_.layer_count() <= options.layers && queue_.grow(network);
    if (vertices().size() + frontier().size() <= static_cast<std::size_t>(capacity_)) return;
    has_frontier_ = false;
    truncated_ = true;
}

template <class Network, class IsBalanced>
bool ActiveVertices::end_step(const Network& network, IsBalanced is_balanced, std::span<const Index> moved,
                              bool recheck) noexcept {
    find_awake(is_balanced);
    for (const Index v : moved) wake_neighbours(network, v);
    for (const Index v : recheck ? activated_.items() : std::span<const Index>()) {
        if (!active_.contains(v) && !is_balanced(v)) next_awake_.insert(v);
    }
    std::swap(seeds_, next_seeds_);
    std::swap(awake_, next_awake_);
    if (awake_.empty() && seeds_.empty()) activated_.clear();
    is_open_ = false;
    return queue_balanced_ && awake_.empty();
}

template <class IsBalanced>
void ActiveVertices::find_awake(IsBalanced is_balanced) noexcept {
    next_awake_.clear();
    for (const auto others : {awake_.items(), dropped_.items()}) {
        for (const Index v : others) {
            if (!active_.contains(v)) next_awake_.insert(v);
        }
    }
    queue_balanced_ = true;
    const bool queue_returns = !as_needed_ && !truncated_;  // the next step updates the whole queue
    const auto inspect = [&](Index v) {
        activated_.insert(v);
        if (is_balanced(v)) return;
        if (queue_.contains(v)) queue_balanced_ = false;
        if (!queue_returns || !queue_.contains(v)) next_awake_.insert(v);
    };
    for (const Index v : vertices()) inspect(v);
    for (const Index v : frontier()) {
        if (!active_.contains(v)) inspect(v);
    }
}

template <class Network>
void ActiveVertices::wake_neighbours(const Network& network, Index v) noexcept {
    const auto checked = [&](Index other) { return has_frontier_ && queue_.contains(other); };
    for (const auto& end : network.neighbours(v)) {
        if (active_.contains(end.other)) continue;
        const bool may_wake =
            as_needed_ ? !network.pinned(end.other) && !checked(end.other) : activated_.contains(end.other);
        if (may_wake) next_awake_.insert(end.other);
    }
}

// Back to the state after the last step that was finished.
template <class Network>
void ActiveVertices::undo_step(const Network& network) noexcept {
    build_queue(network, seeds_.items(), layers_before_);
    queue_fits_ = true;
    has_frontier_ = false;
}

inline void ActiveVertices::clear() noexcept {
    queue_.clear();
    has_new_queue_ = queue_fits_ = true;
    is_open_ = has_changed_ = false;
    for (IndexSet* set : {&seeds_, &awake_, &dropped_, &active_, &activated_}) set->clear();
}

}  // namespace membrane
