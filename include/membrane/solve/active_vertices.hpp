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
#include <membrane/solve/vertex_groups.hpp>

/// Which vertices a step visits.
///
///     active.arrange(network, seeds, options);
///     for (const membrane::Index v : active.vertices()) { ... }                    // visits, nearest to the contact first
///     const bool at_rest = active.finish(network, is_balanced, moved);
namespace membrane {

/// The vertices at work: the propagation queue, and outside it the restless ones, which a contact that has moved on or
/// ended has left out of balance. A vertex is restless until it is seen to be in balance; it becomes restless again
/// when a neighbour moves, unless it has never been part of what is going on: beyond the layers the membrane stands still.
///
/// With `layers_as_needed` the queue begins each step with layer 0, `grow` adds a layer, and nothing stands still: all
/// the others are restless until seen to be in balance.
class ActiveVertices {
  public:
    explicit ActiveVertices(Index vertex_count);

    /// Begins a step: builds the queue where the seeds are others than before, and lines up what is to be visited: the
    /// queue, then the restless, then what the queue has left behind, as many as `options` leaves room for, layer 0 and
    /// one more in any case. Vertices of the queue for which there is no room are visited in later steps. What the last
    /// call has arranged counts for nothing unless `finish` came after it. Online.
    template <class Network, class Options>
    void arrange(const Network& network, std::span<const Index> seeds, const Options& options) noexcept;

    /// This step's vertices in the order of their visits, and those of them that are layer 0.
    [[nodiscard]] std::span<const Index> vertices() const noexcept { return visited_.items(); }
    [[nodiscard]] std::span<const Index> touched() const noexcept { return vertices().first(layer_0().size()); }
    [[nodiscard]] std::span<const Index> beyond() const noexcept { return vertices().subspan(touched().size()); }
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return queue_; }

    /// How many of `vertices`, the first, are the queue's.
    [[nodiscard]] std::size_t from_queue() const noexcept { return from_queue_; }

    /// Where in `vertices` the groups end that those beyond the queue are in, if they are visited in groups.
    [[nodiscard]] std::span<const std::size_t> group_ends() const noexcept { return groups_.ends(); }

    /// Whether the queue is another one than at the last call of this.
    [[nodiscard]] bool take_new_queue() noexcept { return std::exchange(has_new_queue_, false); }

    /// The layer that is looked at, but not visited yet: the first beyond the queue, if it may `grow`.
    [[nodiscard]] std::span<const Index> frontier() const noexcept {
        return has_frontier_ ? queue_.layer(queue_.layer_count() - 1) : std::span<const Index>();
    }

    /// Whether some have to wait for a later step, for lack of room.
    [[nodiscard]] bool truncated() const noexcept { return truncated_; }

    /// Adds the frontier to what is visited, those of it that had not been so far at the end. Online.
    template <class Network, class Options>
    void grow(const Network& network, const Options& options) noexcept;

    /// Makes `v` restless from the next `arrange` on. @pre a vertex (asserted) that is not pinned
    void wake(Index v) noexcept {
        restless_.insert(v);
        stirred_.insert(v);
    }

    /// Ends a step: who of the visited and the frontier is not balanced, `is_balanced(v)`, and who was not visited, is
    /// restless now; so are the neighbours of those that `moved` far enough to be felt. Returns whether everyone is at rest.
    template <class Network, class IsBalanced>
    [[nodiscard]] bool finish(const Network& network, IsBalanced is_balanced, std::span<const Index> moved) noexcept;

    void clear() noexcept;

  private:
    template <class Network>
    void drop(const Network& network) noexcept;
    template <class IsBalanced>
    void settle(IsBalanced is_balanced) noexcept;
    template <class Network>
    void stir_neighbours(const Network& network, Index v) noexcept;
    [[nodiscard]] std::span<const Index> layer_0() const noexcept {
        return queue_.layer_count() > 0 ? queue_.layer(0) : std::span<const Index>();
    }
    template <class Network>
    void build_queue(const Network& network, std::span<const Index> seeds, Index layers) noexcept;
    template <class Options>
    [[nodiscard]] Index room_for(const Options& options) const noexcept;
    [[nodiscard]] Index room_of_others() const noexcept;
    void leave(std::span<const Index> vertices) noexcept;
    void line_up(std::span<const Index> vertices, Index most) noexcept;
    template <class Network, class Options>
    void extend(const Network& network, const Options& options) noexcept;

    PropagationQueue queue_;
    IndexSet seeds_, next_seeds_;
    IndexSet restless_, next_restless_;
    IndexSet left_;     // by the queue, which has gone elsewhere, or has no room
    IndexSet visited_;  // in this step
    IndexSet stirred_;  // visited since everyone was last at rest
    VertexGroups groups_;
    Index room_ = 0;  // of those visited
    std::size_t from_queue_ = 0;
    Index layers_ = 0, layers_before_ = 0;
    VisitOrder order_ = VisitOrder::arrival;
    bool as_needed_ = false, has_frontier_ = false;
    bool has_new_queue_ = false;
    bool queue_fits_ = true, truncated_ = false;
    bool queue_at_rest_ = true;
    bool is_open_ = false;  // something is arranged, and not finished
};

inline ActiveVertices::ActiveVertices(Index vertex_count)
    : queue_(vertex_count),
      seeds_(vertex_count),
      next_seeds_(seeds_),
      restless_(seeds_),
      next_restless_(seeds_),
      left_(seeds_),
      visited_(seeds_),
      stirred_(seeds_),
      groups_(vertex_count) {}

template <class Network, class Options>
void ActiveVertices::arrange(const Network& network, std::span<const Index> seeds, const Options& options) noexcept {
    if (std::exchange(is_open_, true)) drop(network);
    as_needed_ = options.layers_as_needed;
    order_ = as_needed_ ? VisitOrder::arrival : options.order;
    if (order_ == VisitOrder::colours && options.most_visits != unlimited)
        order_ = VisitOrder::groups;  // what is left out is to be the farthest
    layers_before_ = order_ == VisitOrder::colours ? std::exchange(layers_, options.layers) : queue_.layer_count() - 1;
    next_seeds_.clear();
    for (const Index v : seeds) next_seeds_.insert(v);
    left_.clear();
    const auto before = seeds_.items(), now = next_seeds_.items();
    const bool is_new = as_needed_ || !std::equal(now.begin(), now.end(), before.begin(), before.end());
    if (is_new) {
        // What a constraint has let go of, too: the force that was balanced there is another one now.
        leave(as_needed_ ? layer_0() : queue_.vertices());
        build_queue(network, seeds, as_needed_ ? 0 : options.layers);
    }
    room_ = room_for(options);
    const bool fits = static_cast<Index>(queue_.vertices().size()) <= room_ - room_of_others();
    if (!fits && (is_new || queue_fits_)) leave(queue_.vertices());  // what does not fit takes turns with the others
    queue_fits_ = fits;

    visited_.clear();
    truncated_ = false;
    line_up(queue_.vertices(), room_ - room_of_others());
    from_queue_ = static_cast<std::size_t>(visited_.count());
    line_up(restless_.items(), room_);
    line_up(left_.items(), room_);
    groups_.clear();
    if (order_ != VisitOrder::arrival) groups_.add(network, visited_, from_queue_, vertices().size());
    extend(network, options);
}

// How many vertices a step may visit: what layer 0 is visited more often is taken off the rest.
template <class Options>
Index ActiveVertices::room_for(const Options& options) const noexcept {
    if (options.most_visits == unlimited) return unlimited;
    const auto touched = static_cast<Index>(layer_0().size());
    const auto own = std::int64_t{touched} * (std::int64_t{options.sweeps} * options.contact_visits + 1);
    const auto passes = (std::int64_t{options.sweeps} + 1) * (as_needed_ ? 2 : 1);  // a look before a layer is added
    return touched + static_cast<Index>((std::max)((options.most_visits - own) / passes, std::int64_t{1}));
}

// The restless and what the queue has left behind have their turns under a lasting contact, too.
inline Index ActiveVertices::room_of_others() const noexcept {
    const auto touched = static_cast<Index>(layer_0().size());
    return (std::min)(restless_.count() + left_.count(), std::clamp(room_ / 4, Index(1), room_ - touched));
}

inline void ActiveVertices::leave(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) left_.insert(v);
}

inline void ActiveVertices::line_up(std::span<const Index> vertices, Index most) noexcept {
    for (const Index v : vertices) {
        if (visited_.count() >= most) {
            truncated_ = true;
            return;
        }
        visited_.insert(v);
    }
}

template <class Network>
void ActiveVertices::build_queue(const Network& network, std::span<const Index> seeds, Index layers) noexcept {
    queue_.build(network, seeds, layers);
    if (order_ != VisitOrder::arrival) queue_.group(network, order_ == VisitOrder::colours);
    has_new_queue_ = true;
}

template <class Network, class Options>
void ActiveVertices::grow(const Network& network, const Options& options) noexcept {
    for (const Index v : frontier()) visited_.insert(v);
    extend(network, options);
}

// A next layer, to be looked at. Of one that there is no room for those are restless whose neighbours move.
template <class Network, class Options>
void ActiveVertices::extend(const Network& network, const Options& options) noexcept {
    has_frontier_ = as_needed_ && queue_.layer_count() <= options.layers && queue_.grow(network);
    if (vertices().size() + frontier().size() <= static_cast<std::size_t>(room_)) return;
    has_frontier_ = false;
    truncated_ = true;
}

template <class Network, class IsBalanced>
bool ActiveVertices::finish(const Network& network, IsBalanced is_balanced, std::span<const Index> moved) noexcept {
    settle(is_balanced);
    for (const Index v : moved) stir_neighbours(network, v);
    std::swap(seeds_, next_seeds_);
    std::swap(restless_, next_restless_);
    if (restless_.empty() && seeds_.empty()) stirred_.clear();
    is_open_ = false;
    return queue_at_rest_ && restless_.empty();
}

template <class IsBalanced>
void ActiveVertices::settle(IsBalanced is_balanced) noexcept {
    next_restless_.clear();
    for (const auto others : {restless_.items(), left_.items()}) {
        for (const Index v : others) {
            if (!visited_.contains(v)) next_restless_.insert(v);
        }
    }
    queue_at_rest_ = true;
    const bool queue_returns = !as_needed_ && !truncated_;  // in the next step, whole
    const auto judge = [&](Index v) {
        stirred_.insert(v);
        if (is_balanced(v)) return;
        if (queue_.contains(v)) queue_at_rest_ = false;
        if (!queue_returns || !queue_.contains(v)) next_restless_.insert(v);
    };
    for (const Index v : vertices()) judge(v);
    for (const Index v : frontier()) {
        if (!visited_.contains(v)) judge(v);
    }
}

template <class Network>
void ActiveVertices::stir_neighbours(const Network& network, Index v) noexcept {
    const auto judged = [&](Index other) { return has_frontier_ && queue_.contains(other); };
    for (const auto& end : network.neighbours(v)) {
        const bool takes_part =
            as_needed_ ? !network.pinned(end.other) && !judged(end.other) : stirred_.contains(end.other);
        if (takes_part && !visited_.contains(end.other)) next_restless_.insert(end.other);
    }
}

// Back to what the last step that was finished has left.
template <class Network>
void ActiveVertices::drop(const Network& network) noexcept {
    build_queue(network, seeds_.items(), layers_before_);
    queue_fits_ = true;
    has_frontier_ = false;
}

inline void ActiveVertices::clear() noexcept {
    queue_.clear();
    has_new_queue_ = queue_fits_ = true;
    is_open_ = false;
    for (IndexSet* set : {&seeds_, &restless_, &left_, &visited_, &stirred_}) set->clear();
}

}  // namespace membrane
