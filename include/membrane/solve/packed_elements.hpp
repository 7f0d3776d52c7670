// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/model/element.hpp>

/// Elements of vertices that are updated in SIMD lanes.
///
///     elements.append(vertices, own, tissue);                                         // a pack: a vertex in each lane
///     elements.for_each(p, here, rows, tissue, [&](const auto& element, const auto& x, std::size_t i) {
///         sum += element.force_on(x, i);
///     });
namespace membrane {

// Of tissue/elements.hpp, which comes with each network that has elements.
template <Real Scalar_, CheckedElement Each>
class Elements;

/// A network with elements beside its springs: `Tissue`.
template <class Network>
concept HasElements = requires(const Network& network) {
    network.for_each_kind([](const auto&) {});
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The elements at the vertices of each pack, an element of each vertex in a slot, by kind and place of the vertex. A
/// lane without an element has one whose constants are zero, with all corners at the vertex: its force is zero.
/// Elements of a kind that does not take `Lanes` stay in the network, and are evaluated one after the other.
template <Real Scalar>
class PackedElements {
  public:
    using Wide = Lanes<Scalar>;                     ///< a number for each vertex of a pack
    using Begins = std::array<Index, Wide::count>;  ///< offset of each lane's row

    /// Allocates for `capacity` vertices in at most `packs` packs. Nothing for a network without elements.
    template <class Network>
    PackedElements(const Network& network, std::size_t capacity, std::size_t packs);

    ///@{
    /// Number of packs; `truncate` removes those behind the first `count`.
    [[nodiscard]] std::size_t size() const noexcept { return begins_.size(); }
    void truncate(std::size_t count) noexcept {
        if (count >= begins_.size()) return;
        block_count_ = begins_[count];
        begins_.truncate(count);
    }
    ///@}

    /// Appends a pack of `vertices`, whose rows are `own`. False if it exceeds the capacity. Online.
    template <HasElements Network>
    [[nodiscard]] bool append(std::span<const Index> vertices, const Begins& own, const Network& network) noexcept;

    /// Calls `act(element, x, place)` for the elements of pack `p`: constants and corners are of one element in each
    /// lane, corner number `place` is the vertex, `here`.
    template <HasElements Network, class Act>
    void for_each(std::size_t p, const Vector3<Wide>& here, const PaddedPoint<Scalar>* rows, const Network& network,
                  const Act& act) const noexcept;

  private:
    struct alignas(32) Block {
        std::array<std::byte, 32> bytes;
    };
    template <class E>
    struct alignas(32) Slot {
        InLanes<E> element;
        std::array<Begins, E::corner_count - 1> others;  // the corners but for the vertex
    };
    template <class E>
        requires(!Elements<Scalar, E>::in_lanes)
    struct alignas(32) Slot<E> {
        Begins vertex;  // that has an element in this slot, or `no_index`
        std::array<Begins, E::corner_count - 1> others;
    };
    template <class E>
    static constexpr std::size_t blocks = sizeof(Slot<E>) / sizeof(Block);

    // Calls `act(elements, place, group)` for each kind and each place of a vertex in it; place and group are
    // constants.
    template <class Network, class Act>
    static void for_each_group(const Network& network, const Act& act) noexcept;
    template <class E>
    static void fill_lane(Slot<E>& slot, std::size_t lane, std::size_t place, const ElementInstance<E>& at) noexcept;
    // Number `n` of the elements at the vertex of each lane.
    template <class E>
    [[nodiscard]] static auto one_by_one(const Elements<Scalar, E>& elements, const Slot<E>& slot, std::size_t place,
                                         Index n) noexcept {
        typename Elements<Scalar, E>::OneByOne all;
        for (std::size_t lane = 0; lane < Wide::count; ++lane) {
            const Index v = slot.vertex[lane];
            if (v != no_index) all.of_lane[lane] = &elements.at(v, place)[static_cast<std::size_t>(n)].instance.element;
        }
        return all;
    }
    template <class E>
    [[nodiscard]] Slot<E>& slot_at(std::size_t block) noexcept {
        return *std::launder(reinterpret_cast<Slot<E>*>(&blocks_[block]));
    }
    template <class E>
    [[nodiscard]] const Slot<E>& slot_at(std::size_t block) const noexcept {
        return *std::launder(reinterpret_cast<const Slot<E>*>(&blocks_[block]));
    }

    std::size_t group_count_ = 0;
    std::vector<Index> counts_;        // slots of each pack and group
    FixedVector<std::size_t> begins_;  // first block of each pack
    std::size_t block_count_ = 0;
    std::vector<Block> blocks_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
template <class Network, class Act>
MEMBRANE_INLINE void PackedElements<Scalar>::for_each_group([[maybe_unused]] const Network& network,
                                                            [[maybe_unused]] const Act& act) noexcept {
    if constexpr (HasElements<Network>) {
        std::size_t group = 0;
        network.for_each_kind([&]<class E>(const Elements<Scalar, E>& elements) MEMBRANE_INLINE_LAMBDA {
            const auto if_used = [&](auto place) MEMBRANE_INLINE_LAMBDA {
                if constexpr (Elements<Scalar, E>::is_place(place)) act(elements, place, group++);
            };
            [&]<std::size_t... place>(std::index_sequence<place...>) MEMBRANE_INLINE_LAMBDA {
                (if_used(std::integral_constant<std::size_t, place>()), ...);
            }
            (std::make_index_sequence<E::corner_count>());
        });
    }
}

template <Real Scalar>
template <class Network>
PackedElements<Scalar>::PackedElements(const Network& network, std::size_t capacity, std::size_t packs) {
    if (!HasElements<Network> || capacity == 0) return;
    std::size_t needed = 0;
    for_each_group(network, [&]<class E>(const Elements<Scalar, E>& elements, auto place, std::size_t group) {
        std::size_t all = 0, longest = 0;
        for (Index v = 0; v < network.vertex_count(); ++v) {
            const std::size_t count = elements.at(v, place).size();
            all += count;
            longest = (std::max)(longest, count);
        }
        // As for the springs: for packs that are half empty.
        needed += blocks<E> * (2 * (std::min)(all, longest * capacity) / Wide::count + 64 * longest);
        group_count_ = group + 1;
    });
    blocks_.resize(needed);
    begins_ = FixedVector<std::size_t>(packs);
    counts_.resize(packs * group_count_);
}

template <Real Scalar>
template <HasElements Network>
bool PackedElements<Scalar>::append(std::span<const Index> vertices, const Begins& own,
                                    const Network& network) noexcept {
    const std::size_t pack = begins_.size();
    if (!begins_.try_push_back(block_count_)) return false;
    bool fits = true;
    for_each_group(network, [&]<class E>(const Elements<Scalar, E>& elements, auto place, std::size_t group) {
        std::array<std::span<const typename Elements<Scalar, E>::AtVertex>, Wide::count> in_lane;
        std::size_t count = 0;
        for (std::size_t lane = 0; lane < vertices.size(); ++lane) {
            in_lane[lane] = elements.at(vertices[lane], place);
            count = (std::max)(count, in_lane[lane].size());
        }
        const std::size_t first = block_count_;
        fits = fits && first + count * blocks<E> <= blocks_.size();
        if (!fits) return;
        for (; block_count_ < first + count * blocks<E>; block_count_ += blocks<E>) {
            auto* slot = new (&blocks_[block_count_]) Slot<E>();
            slot->others.fill(own);
            if constexpr (!Elements<Scalar, E>::in_lanes) slot->vertex.fill(no_index);
        }
        counts_[pack * group_count_ + group] = static_cast<Index>(count);
        for (std::size_t lane = 0; lane < vertices.size(); ++lane) {
            std::size_t block = first;
            for (const auto& at : in_lane[lane]) {
                fill_lane(slot_at<E>(block), lane, place, at.instance);
                block += blocks<E>;
            }
        }
    });
    if (!fits) truncate(pack);
    return fits;
}

template <Real Scalar>
template <class E>
MEMBRANE_INLINE void PackedElements<Scalar>::fill_lane(Slot<E>& slot, std::size_t lane, std::size_t place,
                                                       const ElementInstance<E>& at) noexcept {
    if constexpr (Elements<Scalar, E>::in_lanes) {
        set_lane(slot.element, lane, at.element);
    } else {
        slot.vertex[lane] = at.corners[place];
    }
    for (std::size_t k = 0; k < E::corner_count; ++k) {
        if (k != place) slot.others[k - (k > place)][lane] = begin_of_row(at.corners[k]);
    }
}

template <Real Scalar>
template <HasElements Network, class Act>
MEMBRANE_INLINE void PackedElements<Scalar>::for_each(std::size_t p, const Vector3<Wide>& here,
                                                      const PaddedPoint<Scalar>* rows, const Network& network,
                                                      const Act& act) const noexcept {
    std::size_t block = begins_[p];
    for_each_group(network, [&]<class E>(const Elements<Scalar, E>& elements, auto place,
                                         std::size_t group) MEMBRANE_INLINE_LAMBDA {
        for (Index n = 0; n < counts_[p * group_count_ + group]; ++n) {
            const Slot<E>& slot = slot_at<E>(block);
            Corners<Wide, E::corner_count> x;
            for (std::size_t k = 0; k < E::corner_count; ++k) {
                x[k] = k == place ? here : gather(rows, slot.others[k - (k > place)].data());
            }
            if constexpr (Elements<Scalar, E>::in_lanes) {
                act(slot.element, x, place);
            } else {
                act(one_by_one(elements, slot, place, n), x, place);
            }
            block += blocks<E>;
        }
    });
}

}  // namespace membrane
