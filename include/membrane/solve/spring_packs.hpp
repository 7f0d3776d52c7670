// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/bounded_list.hpp>
#include <membrane/core/executor.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/network/mass_spring_network.hpp>
#include <membrane/solve/propagation_queue.hpp>

/// Springs and positions of the vertices at work, side by side.
///
///     packs.follow(queue, network);                      // where the queue has changed
///     packs.load(x);
///     packs.for_each_spring(p, [&](const auto& there, const auto& stiffness, const auto& rest_length) { ... });
///     packs.store(x);
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The groups of a queue, and of what else is visited, cut up in packs of as many vertices as there are lanes. As many
/// groups as there is room for, from the first on.
template <Real Scalar>
class SpringPacks {
  public:
    using Several = Lanes<Scalar>;

    /// Has room for `most` vertices.
    template <ElasticNetwork<Scalar> Network>
    SpringPacks(const Network& network, Index most);

    /// Takes over the groups of `queue`, in place of all there were. Online. Cost: the springs of its vertices.
    template <class Network>
    void follow(const PropagationQueue& queue, const Network& network) noexcept;

    /// Appends, until the next call, the groups of `vertices` that end at `ends`, the first begins at `begin`; none if
    /// the queue itself has no room. Online. Cost: the springs of these vertices.
    template <class Network>
    void append(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                const Network& network) noexcept;

    /// How many vertices there are in all packs.
    [[nodiscard]] std::size_t size() const noexcept { return members_.size(); }
    [[nodiscard]] std::size_t count() const noexcept { return packs_.size(); }
    [[nodiscard]] std::size_t room() const noexcept { return packs_.room(); }

    /// The vertices of pack `p`, and the number of the first among all.
    [[nodiscard]] std::span<const Index> vertices(std::size_t p) const noexcept {
        return members_.items().subspan(packs_[p].first, packs_[p].size);
    }
    [[nodiscard]] std::size_t place_of(std::size_t p) const noexcept { return packs_[p].first; }

    /// The first pack that begins at vertex number `place` or later.
    [[nodiscard]] std::size_t pack_from(std::size_t place) const noexcept {
        const auto packs = packs_.items();
        const auto begins_before = [](const Pack& pack, std::size_t at) { return pack.first < at; };
        return static_cast<std::size_t>(std::lower_bound(packs.begin(), packs.end(), place, begins_before) -
                                        packs.begin());
    }

    /// Takes the positions of all packs and their neighbours from `x` (3 x V [m]), and gives those of the packs back.
    template <Executor Threads = OneThread>
    void load(const PointsRef<Scalar>& x, const Threads& executor = {}) noexcept;
    template <Executor Threads = OneThread>
    void store(PointsRef<Scalar>& x, const Threads& executor = {}) const noexcept;

    /// Where the vertices of pack `p` are, each in the lane of its number there [m].
    [[nodiscard]] Vector3<Several> positions(std::size_t p) const noexcept {
        return gather(rows_.data(), packs_[p].own.data());
    }
    void move(std::size_t p, const Vector3<Several>& positions) noexcept {
        scatter(positions, rows_.data(), packs_[p].own.data());
    }

    /// Calls `act(there, stiffness, rest_length)` for the springs of pack `p`, one of each vertex at a time: where its other
    /// end is [m], and its constants [N/m], [m].
    template <class Act>
    [[gnu::always_inline]] inline void for_each_spring(std::size_t p, Act act) const noexcept {
        for (const Slot& slot : std::span(slots_).subspan(packs_[p].slot, packs_[p].slot_count)) {
            act(gather(rows_.data(), slot.other.data()), slot.stiffness, slot.rest_length);
        }
    }

  private:
    static constexpr std::size_t lanes = Several::count;
    static constexpr std::size_t points_in_task = 2048;
    /// Of each lane, where the row of its point begins.
    using Begins = std::array<Index, lanes>;
    struct Pack {
        std::size_t first, size;  // of the members
        std::size_t slot, slot_count;
        Begins own;
    };
    /// One spring of each vertex of a pack. It lies in memory alike for every instruction set.
    struct alignas(32) Slot {
        Several stiffness, rest_length;
        Begins other;
    };
    struct Extent {
        std::size_t members = 0, packs = 0, slots = 0, rows = 0;
    };

    template <class Network>
    [[nodiscard]] bool pack_up(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                               const Network& network) noexcept;
    template <class Network>
    [[nodiscard]] bool append_pack(std::span<const Index> vertices, const Network& network) noexcept;
    void cut(const Extent& extent) noexcept;
    [[nodiscard]] Index row_of(Index v) noexcept;

    // Packs are half empty at the worst that is made room for.
    [[nodiscard]] static std::size_t packs_for(std::size_t vertices) noexcept {
        return vertices == 0 ? 0 : 2 * vertices / lanes + 64;
    }

    BoundedList<Index> members_;
    BoundedList<Pack> packs_;
    std::size_t slot_count_ = 0;
    Extent of_queue_;
    bool is_whole_ = false;  // the queue
    std::vector<Slot> slots_;
    std::vector<PaddedPoint<Scalar>> rows_;  // the first is nobody's
    BoundedList<Index> with_row_;            // who has the rows after it
    std::vector<Index> row_;                 // of every vertex that has one
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
template <ElasticNetwork<Scalar> Network>
SpringPacks<Scalar>::SpringPacks(const Network& network, Index most)
    : members_(static_cast<std::size_t>((std::min)(network.vertex_count(), most))),
      packs_(packs_for(members_.room())),
      with_row_(most > 0 ? static_cast<std::size_t>(network.vertex_count()) : 0),
      row_(with_row_.room(), no_index) {
    rows_.resize(with_row_.room() + 1);
    std::size_t ends = 0, longest = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) {
        ends += network.neighbours(v).size();
        longest = (std::max)(longest, network.neighbours(v).size());
    }
    ends = (std::min)(ends, longest * members_.room());
    if (most > 0) slots_.resize(2 * ends / lanes + 64 * longest);
}

template <Real Scalar>
template <class Network>
void SpringPacks<Scalar>::follow(const PropagationQueue& queue, const Network& network) noexcept {
    cut({});
    const std::size_t begin = queue.layer_count() > 0 ? queue.layer(0).size() : 0;
    is_whole_ = pack_up(queue.vertices(), begin, queue.group_ends(), network);
    of_queue_ = {members_.size(), packs_.size(), slot_count_, with_row_.size()};
}

template <Real Scalar>
template <class Network>
void SpringPacks<Scalar>::append(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                                 const Network& network) noexcept {
    cut(of_queue_);
    if (is_whole_) static_cast<void>(pack_up(vertices, begin, ends, network));
}

// False if there is no room for all.
template <Real Scalar>
template <class Network>
bool SpringPacks<Scalar>::pack_up(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                                  const Network& network) noexcept {
    for (const std::size_t end : ends) {
        while (begin < end) {
            const std::size_t size = (std::min)(lanes, end - begin);
            if (!append_pack(vertices.subspan(begin, size), network)) return false;
            begin += size;
        }
    }
    return true;
}

template <Real Scalar>
void SpringPacks<Scalar>::cut(const Extent& extent) noexcept {
    for (const Index v : with_row_.items().subspan(extent.rows)) row_[static_cast<std::size_t>(v)] = no_index;
    members_.cut(extent.members);
    packs_.cut(extent.packs);
    slot_count_ = extent.slots;
    with_row_.cut(extent.rows);
}

template <Real Scalar>
Index SpringPacks<Scalar>::row_of(Index v) noexcept {
    Index& row = row_[static_cast<std::size_t>(v)];
    if (row == no_index) {
        with_row_.push(v);
        row = static_cast<Index>(with_row_.size());
    }
    return row;
}

// False if there is no room. Lanes without a vertex, and those of vertices with fewer springs, have springs to themselves
// that never pull.
template <Real Scalar>
template <class Network>
bool SpringPacks<Scalar>::append_pack(std::span<const Index> vertices, const Network& network) noexcept {
    std::size_t springs = 0;
    for (const Index v : vertices) springs = (std::max)(springs, network.neighbours(v).size());
    if (members_.size() + vertices.size() > members_.room() || slot_count_ + springs > slots_.size()) return false;
    Pack pack{members_.size(), vertices.size(), slot_count_, springs, {}};
    for (std::size_t i = 0; i < vertices.size(); ++i) pack.own[i] = numbers_in_point * row_of(vertices[i]);
    if (!packs_.push(pack)) return false;
    const auto slots = std::span(slots_).subspan(slot_count_, springs);
    for (Slot& slot : slots) slot = {Scalar(0), Scalar(0), pack.own};
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        members_.push(vertices[i]);
        Slot* slot = slots.data();
        for (const auto& spring : network.springs_of(vertices[i])) {
            slot->stiffness.set(i, spring.stiffness);
            slot->rest_length.set(i, spring.rest_length);
            slot->other[i] = numbers_in_point * row_of(spring.other);
            ++slot;
        }
    }
    slot_count_ += springs;
    return true;
}

template <Real Scalar>
template <Executor Threads>
void SpringPacks<Scalar>::load(const PointsRef<Scalar>& x, const Threads& executor) noexcept {
    const auto vertices = with_row_.items();
    share_out(executor, vertices.size(), points_in_task, [&](std::size_t begin, std::size_t end) {
        auto* row = rows_.data() + begin;
        for (const Index v : vertices.subspan(begin, end - begin)) (++row)->set(point(x, v));
    });
}

template <Real Scalar>
template <Executor Threads>
void SpringPacks<Scalar>::store(PointsRef<Scalar>& x, const Threads& executor) const noexcept {
    share_out(executor, members_.size(), points_in_task, [&](std::size_t begin, std::size_t end) {
        for (const Index v : members_.items().subspan(begin, end - begin)) {
            x.col(v) = rows_[static_cast<std::size_t>(row_[static_cast<std::size_t>(v)])].point();
        }
    });
}

}  // namespace membrane
