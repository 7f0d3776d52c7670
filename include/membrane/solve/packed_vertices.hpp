// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <limits>
#include <new>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/executor.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/solve/packed_elements.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/vertex_rows.hpp>

/// Updates of vertices in SIMD lanes, one vertex in each.
///
///     packed.assign(from_queue, queue.colour_ends(), network);               // if these have changed
///     packed.append(active.vertices(), active.from_queue(), active.colour_ends(), network);
///     packed.begin_step(scene);
///     for (std::size_t p = 0, end; p < packed.count(); p = end) {
///         end = packed.end_of_group(p, packed.count());
///         packed.update(p, end, scene, rule, membrane::Constrained::no, membrane::OneThread());
///     }
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// How constraints act on the vertices of an update.
enum class Constrained : unsigned char {
    no,          ///< no constraint has a force on them
    by_force,    ///< the forces of constraints are added
    in_contact,  ///< layer 0: as `by_force`, and the response of each vertex is stored, for constraints to use
};

/// The vertices of a queue, and then others, in packs of one vertex for each lane. A pack stores for each vertex its
/// springs, its volume spring and whether it is free. The vertices are in groups, colour classes: no spring joins two
/// vertices of a group, and all vertices of a pack are of one group. Positions are in `VertexRows`. From the first
/// vertex beyond the capacity on, vertices are left out. A law, rule, element or foundation that does not take `Lanes`
/// is asked for one vertex after the other: the results are equal to the bit.
template <Real Scalar>
class PackedVertices {
  public:
    using Wide = Lanes<Scalar>;  ///< a number for each vertex of a pack

    /// Allocates for `capacity` vertices; fewer may fit if more than half of the lanes stay unused.
    template <ElasticNetwork<Scalar> Network>
    explicit PackedVertices(const Network& network, Index capacity = unlimited);

    /// Replaces all vertices by these, in groups that end at `ends` or with the last of them. Online. Cost: their
    /// springs.
    template <class Network>
    void assign(std::span<const Index> vertices, std::span<const std::size_t> ends, const Network& network) noexcept;

    /// Appends `vertices[begin]` and all after it, in groups that end at `ends`, in place of what the last call
    /// appended. If the assigned vertices exceed the capacity, appends nothing. Online. Cost: their springs.
    template <class Network>
    void append(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                const Network& network) noexcept;

    /// Number of vertices that the last `assign` was given.
    [[nodiscard]] std::size_t assigned() const noexcept { return given_; }
    /// Number of vertices.
    [[nodiscard]] std::size_t size() const noexcept { return members_.size(); }
    /// Number of packs.
    [[nodiscard]] std::size_t count() const noexcept { return packs_.size(); }

    ///@{
    /// The vertices of pack `p`, and the position of the first in pack order.
    [[nodiscard]] std::span<const Index> vertices(std::size_t p) const noexcept {
        return members_.items().subspan(packs_[p].first, packs_[p].size);
    }
    [[nodiscard]] std::size_t first_of(std::size_t p) const noexcept { return packs_[p].first; }
    ///@}

    /// The first pack whose first vertex is at position `first` or later in pack order.
    [[nodiscard]] std::size_t pack_from(std::size_t first) const noexcept {
        const auto packs = packs_.items();
        const auto begins_before = [](const Pack& pack, std::size_t at) { return pack.first < at; };
        return static_cast<std::size_t>(std::lower_bound(packs.begin(), packs.end(), first, begins_before) -
                                        packs.begin());
    }

    /// The end of the group of pack `p`, at most `end`.
    [[nodiscard]] std::size_t end_of_group(std::size_t p, std::size_t end) const noexcept {
        while (p + 1 < end && packs_[p].next_is_of_group) ++p;
        return p + 1;
    }

    /// The packed vertices and their neighbours, each once.
    [[nodiscard]] std::span<const Index> needed() const noexcept { return needed_.items(); }

    /// As `append`, behind all. Online. Cost: their springs.
    template <class Network>
    void extend(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                const Network& network) noexcept {
        fits_ = fits_ && pack(vertices, begin, ends, network);
    }

    /// Copies the step's volume springs, masses and fixed vertices into the packs from number `first` on.
    /// @pre `VertexRows` has loaded the positions of `needed`
    template <class Scene>
    void begin_step(const Scene& scene, std::size_t first = 0) noexcept;

    /// Number of free vertices of pack `p`.
    [[nodiscard]] Index free_count(std::size_t p) const noexcept { return terms_[p].free_count; }

    /// What an update did to a pack.
    enum class Outcome : unsigned char {
        at_rest,   ///< no force was above the tolerance
        moved,     ///< at least one vertex moved
        unstable,  ///< updates of a vertex diverge: nothing moved
    };

    /// Updates the vertices of packs `begin` to `end`, the end excluded, all of one group, by `rule`. The packs are
    /// divided among threads.
    template <class Scene, class Rule, Executor E>
    void update(std::size_t begin, std::size_t end, const Scene& scene, const Rule& rule, Constrained constrained,
                const E& executor) noexcept {
        constexpr std::size_t packs_in_task = 32;
        parallel_for(executor, end - begin, packs_in_task, [&](std::size_t first, std::size_t last) {
            for (std::size_t p = begin + first; p < begin + last; ++p)
                outcomes_[p] = update_pack(p, scene, rule, constrained);
        });
    }
    /// Outcome of the last `update` for pack `p`.
    [[nodiscard]] Outcome outcome(std::size_t p) const noexcept { return outcomes_[p]; }

    /// Writes the forces on the vertices of pack `p` to the rows of residual forces.
    template <class Scene>
    void evaluate_residual(std::size_t p, const Scene& scene) const noexcept;

  private:
    static constexpr std::size_t lanes = Wide::count;
    using Begins = std::array<Index, lanes>;  // offset of each lane's row
    struct Pack {
        std::size_t first, size;  // of the members
        std::size_t slot, slot_count;
        Begins own;
        bool next_is_of_group = false;
    };
    // One spring of each vertex of a pack. The memory layout is the same for every instruction set.
    struct alignas(32) Slot {
        Wide stiffness, rest_length;
        Begins other;
    };
    struct alignas(32) Terms {
        std::array<std::byte, max_numbers_in_spring * sizeof(Wide)> spring;  // of the foundation, see `spring_of`
        Wide mass = 1;
        Wide free = 0;  // 1 for a free vertex
        Index free_count = 0;
        bool damps = false;
    };
    struct Extent {
        std::size_t members = 0, packs = 0, slot_count = 0, needed = 0;
    };

    template <class Scene>
    using VolumeOf = std::remove_cvref_t<decltype(std::declval<const Scene&>().volume)>;
    template <class Scene, class SomeTerms>
    [[nodiscard]] static auto& spring_of(SomeTerms& terms) noexcept {
        using Spring = InLanes<SpringOf<VolumeOf<Scene>, Scalar>>;
        using Here = std::conditional_t<std::is_const_v<SomeTerms>, const Spring, Spring>;
        return *std::launder(reinterpret_cast<Here*>(&terms.spring));
    }
    template <class Scene>
    using NetworkOf = std::remove_cvref_t<decltype(std::declval<const Scene&>().network)>;

    template <class Network>
    [[nodiscard]] bool pack(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                            const Network& network) noexcept;
    template <class Network>
    [[nodiscard]] bool append_pack(std::span<const Index> vertices, const Network& network) noexcept;
    template <class Network>
    void truncate(const Extent& extent) noexcept;
    void need(Index v) noexcept {
        unsigned char& marked = is_needed_[static_cast<std::size_t>(v)];
        if (marked == 0) needed_.try_push_back(v);
        marked = 1;
    }
    template <class Sum, class Scene>
    [[nodiscard]] Sum springs_on(std::size_t p, const Vector3<Wide>& here, const Scene& scene) const noexcept;
    // State of a pack before its update.
    struct PackState {
        Vector3<Wide> here;
        VertexState<Wide> vertex;
        VertexForce<Wide> others;
        bool has_walls = false;
    };
    // Of vertices with a wall: of 1 to 1.7 it leaves the least error of the force after few updates. Beside faces in
    // contact, whose passes move the same vertices, updates might not converge.
    static constexpr Scalar over_relaxation = Scalar(1.4);
    template <class Rule, class Scene>
    [[nodiscard]] PackState evaluate(std::size_t p, const Scene& scene, Constrained constrained) const noexcept;
    template <class Scene, class Rule>
    Outcome update_pack(std::size_t p, const Scene& scene, const Rule& rule, Constrained constrained) noexcept {
        return move(p, evaluate<Rule>(p, scene, constrained), scene, rule);
    }
    template <class Scene, class Rule>
    Outcome move(std::size_t p, PackState at, const Scene& scene, const Rule& rule) noexcept;
    template <class Rule, class Scene>
    [[nodiscard]] VertexState<Wide> spring_state(std::size_t p, const Vector3<Wide>& here,
                                                 const Scene& scene) const noexcept;
    template <class Rule, class Scene>
    [[nodiscard]] Vector3<Wide> backtracked(std::size_t p, const PackState& at, Vector3<Wide> displacement,
                                            const typename Wide::Mask& moves, const Scene& scene) const noexcept;
    template <class Scene>
    [[nodiscard]] EnergyChange<Wide> energy_change(std::size_t p, const Vector3<Wide>& here,
                                                   const Vector3<Wide>& displacement,
                                                   const Scene& scene) const noexcept;
    template <class Scene>
    [[nodiscard]] VertexForce<Wide> foundation_on(std::size_t p, const Vector3<Wide>& here,
                                                  const Scene& scene) const noexcept;

    [[nodiscard]] Wide added_stiffness(std::size_t p, const VertexRows<Scalar>& rows) const noexcept {
        return Wide::of(
            [&](std::size_t i) { return rows.added_stiffness[static_cast<std::size_t>(row_at(packs_[p].own[i]))]; });
    }
    template <class Move>
    void stop_at_walls(std::size_t p, PackState& at, const Symmetric3<Wide>& block, Scalar tolerance, Move& move,
                       VertexRows<Scalar>& rows) const noexcept;
    void keep_response(std::size_t p, const PackState& at, const Symmetric3<Wide>& block,
                       VertexRows<Scalar>& rows) const noexcept;

    // The capacity allows for packs that are half empty.
    [[nodiscard]] static std::size_t packs_for(std::size_t vertices) noexcept {
        return vertices == 0 ? 0 : 2 * vertices / lanes + 64;
    }

    Index unused_row_;  // begin of the row of unused lanes
    FixedVector<Index> members_;
    FixedVector<Pack> packs_;
    std::vector<Terms> terms_;
    std::vector<Outcome> outcomes_;
    std::size_t slot_count_ = 0;
    std::vector<Slot> slots_;
    PackedElements<Scalar> elements_;
    FixedVector<Index> needed_;
    std::vector<unsigned char> is_needed_;
    Extent assigned_;
    std::size_t given_ = 0;
    bool is_whole_ = true, fits_ = true;  // all assigned vertices fit; and all after them
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
template <ElasticNetwork<Scalar> Network>
PackedVertices<Scalar>::PackedVertices(const Network& network, Index capacity)
    : unused_row_(begin_of_row(network.vertex_count())),
      members_(static_cast<std::size_t>((std::min)(network.vertex_count(), capacity))),
      packs_(packs_for(members_.capacity())),
      terms_(packs_.capacity()),
      outcomes_(packs_.capacity()),
      elements_(network, members_.capacity(), packs_.capacity()),
      needed_(capacity > 0 ? static_cast<std::size_t>(network.vertex_count()) : 0),
      is_needed_(needed_.capacity(), 0) {
    std::size_t ends = 0, longest = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) {
        ends += network.neighbours(v).size();
        longest = (std::max)(longest, network.neighbours(v).size());
    }
    ends = (std::min)(ends, longest * members_.capacity());
    if (capacity > 0) slots_.resize(2 * ends / lanes + 64 * longest);
}

template <Real Scalar>
template <class Network>
void PackedVertices<Scalar>::assign(std::span<const Index> vertices, std::span<const std::size_t> ends,
                                    const Network& network) noexcept {
    truncate<Network>({});
    given_ = vertices.size();
    is_whole_ = fits_ = pack(vertices, 0, ends, network);
    assigned_ = {members_.size(), packs_.size(), slot_count_, needed_.size()};
}

template <Real Scalar>
template <class Network>
void PackedVertices<Scalar>::append(std::span<const Index> vertices, std::size_t begin,
                                    std::span<const std::size_t> ends, const Network& network) noexcept {
    truncate<Network>(assigned_);
    fits_ = is_whole_ && pack(vertices, begin, ends, network);
}

// False if vertices, packs or slots exceed the capacity.
template <Real Scalar>
template <class Network>
bool PackedVertices<Scalar>::pack(std::span<const Index> vertices, std::size_t begin, std::span<const std::size_t> ends,
                                  const Network& network) noexcept {
    for (const std::size_t group_end : ends) {
        const std::size_t end = (std::min)(group_end, vertices.size());
        while (begin < end) {
            const std::size_t size = (std::min)(lanes, end - begin);
            if (!append_pack(vertices.subspan(begin, size), network)) return false;
            begin += size;
            packs_.items().back().next_is_of_group = begin < end;
        }
    }
    return true;
}

template <Real Scalar>
template <class Network>
void PackedVertices<Scalar>::truncate(const Extent& extent) noexcept {
    for (const Index v : needed_.items().subspan(extent.needed)) is_needed_[static_cast<std::size_t>(v)] = 0;
    members_.truncate(extent.members);
    packs_.truncate(extent.packs);
    if constexpr (HasElements<Network>) elements_.truncate(extent.packs);
    slot_count_ = extent.slot_count;
    needed_.truncate(extent.needed);
}

// False if vertices, packs or slots exceed the capacity. Unused lanes and slots have a spring of stiffness zero from
// the vertex to itself; a law may divide by its rest length.
template <Real Scalar>
template <class Network>
bool PackedVertices<Scalar>::append_pack(std::span<const Index> vertices, const Network& network) noexcept {
    std::size_t springs = 0;
    for (const Index v : vertices) springs = (std::max)(springs, network.springs_of(v).size());
    if (members_.size() + vertices.size() > members_.capacity() || slot_count_ + springs > slots_.size()) return false;
    Pack pack{members_.size(), vertices.size(), slot_count_, springs, {}, false};
    pack.own.fill(unused_row_);
    for (std::size_t i = 0; i < vertices.size(); ++i) pack.own[i] = begin_of_row(vertices[i]);
    if constexpr (HasElements<Network>) {
        if (!elements_.append(vertices, pack.own, network)) return false;
    }
    if (!packs_.try_push_back(pack)) return false;
    const auto own_slots = std::span(slots_).subspan(slot_count_, springs);
    for (Slot& slot : own_slots) slot = {Scalar(0), Scalar(1), pack.own};
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        members_.try_push_back(vertices[i]);
        need(vertices[i]);
        Slot* slot = own_slots.data();
        for (const auto& spring : network.springs_of(vertices[i])) {
            slot->stiffness.set(i, spring.stiffness);
            slot->rest_length.set(i, spring.rest_length);
            slot->other[i] = begin_of_row(spring.other);
            ++slot;
        }
        for (const auto& neighbour : network.neighbours(vertices[i])) need(neighbour.other);
    }
    slot_count_ += springs;
    return true;
}

template <Real Scalar>
template <class Scene>
void PackedVertices<Scalar>::begin_step(const Scene& scene, std::size_t first) noexcept {
    for (std::size_t p = first; p < count(); ++p) {
        Terms& terms = terms_[p];
        terms.mass = 1, terms.free = 0, terms.free_count = 0, terms.damps = false;
        if constexpr (SpringsInLanes<VolumeOf<Scene>, Scalar>) {
            new (&terms.spring) InLanes<SpringOf<VolumeOf<Scene>, Scalar>>();
        }
        const auto members = vertices(p);
        for (std::size_t i = 0; i < members.size(); ++i) {
            const Index v = members[i];
            if (!scene.rows.is_fixed(v)) {
                terms.free.set(i, 1);
                ++terms.free_count;
            }
            if (scene.network.has_masses()) terms.mass.set(i, scene.network.mass(v));
            if constexpr (SpringsInLanes<VolumeOf<Scene>, Scalar>) {
                const auto spring = scene.volume.spring(v, point(scene.start, v), scene.dt);
                terms.damps = terms.damps || spring.damps();
                set_lane(spring_of<Scene>(terms), i, spring);
            }
        }
    }
}

template <Real Scalar>
template <class Sum, class Scene>
MEMBRANE_INLINE Sum PackedVertices<Scalar>::springs_on(std::size_t p, const Vector3<Wide>& here,
                                                       const Scene& scene) const noexcept {
    Sum sum{};
    const auto* rows = scene.rows.position.data();
    const auto own_slots = std::span(slots_).subspan(packs_[p].slot, packs_[p].slot_count);
    constexpr std::size_t grain_size = 6;
    std::array<SpringEdge<Wide>, grain_size> edges;
    for (std::size_t first = 0; first < own_slots.size(); first += grain_size) {
        const auto some = own_slots.subspan(first, (std::min)(grain_size, own_slots.size() - first));
        for (std::size_t i = 0; i < some.size(); ++i) {
            edges[i] = SpringEdge<Wide>(gather(rows, some[i].other.data()) - here);
        }
        for (std::size_t i = 0; i < some.size(); ++i) {
            add(sum, spring_force<Wide>(scene.network.law(), edges[i], some[i].stiffness, some[i].rest_length));
        }
    }
    return sum;
}

// The part of the vertices' state by their springs.
template <Real Scalar>
template <class Rule, class Scene>
MEMBRANE_INLINE auto PackedVertices<Scalar>::spring_state(std::size_t p, const Vector3<Wide>& here,
                                                          const Scene& scene) const noexcept -> VertexState<Wide> {
    VertexState<Wide> vertex;
    if constexpr (requires { requires Rule::needs_majoriser; }) {
        static_cast<EnergyMajoriser<Wide>&>(vertex) = springs_on<CurvedSum<Wide>>(p, here, scene).total();
    } else {
        const auto sum = springs_on<VertexForce<Wide>>(p, here, scene);
        vertex.force = sum.force;
        vertex.stiffness = sum.stiffness;
    }
    return vertex;
}

// The force of the foundation.
template <Real Scalar>
template <class Scene>
MEMBRANE_INLINE auto PackedVertices<Scalar>::foundation_on(std::size_t p, const Vector3<Wide>& here,
                                                           const Scene& scene) const noexcept -> VertexForce<Wide> {
    if constexpr (SpringsInLanes<VolumeOf<Scene>, Scalar>) {
        const auto& spring = spring_of<Scene>(terms_[p]);
        return terms_[p].damps ? spring.force_on(here) : spring.elastic_force(here);
    } else {
        VertexForce<Wide> all;
        for (std::size_t i = 0; i < packs_[p].size; ++i) {
            const Index v = vertices(p)[i];
            const auto at = lane_of<Vector3<Scalar>>(here, i);
            set_lane(all, i, VertexForce<Scalar>(scene.volume.force_on(v, at, point(scene.start, v), scene.dt)));
        }
        return all;
    }
}

// Writes compliance, internal force and internal stiffness; zero for fixed vertices.
template <Real Scalar>
MEMBRANE_INLINE void PackedVertices<Scalar>::keep_response(std::size_t p, const PackState& at,
                                                           const Symmetric3<Wide>& block,
                                                           VertexRows<Scalar>& rows) const noexcept {
    const auto may_move = terms_[p].free != 0;
    const auto kept = [&](const Wide& number) { return select<Wide>(may_move, number, 0); };
    const Vector3<Wide> constraint_force = gather(rows.force.data(), packs_[p].own.data());
    const Wide internal_force = norm<Wide>(at.vertex.force - constraint_force);
    const Wide internal_stiffness = at.vertex.stiffness - at.vertex.contact_stiffness - added_stiffness(p, rows);
    rows.set_responses(packs_[p].own, {{kept(block.xx), kept(block.yy), kept(block.zz), kept(block.xy), kept(block.xz),
                                        kept(block.yz)},
                                       kept(internal_force),
                                       kept(internal_stiffness)});
}

// Changes the multipliers of vertices with a wall so that their displacements, `block` times the force, end in front of
// it, or on it: Newton's step of the vertex under its constraint, over-relaxed. A vertex behind its wall moves even if
// its force is negligible.
template <Real Scalar>
template <class Move>
MEMBRANE_INLINE void PackedVertices<Scalar>::stop_at_walls(std::size_t p, PackState& at, const Symmetric3<Wide>& block,
                                                           Scalar tolerance, Move& move,
                                                           VertexRows<Scalar>& rows) const noexcept {
    const auto& own = packs_[p].own;
    const auto wall = gather_padded(rows.wall.data(), own.data());
    const Vector3<Wide>& normal = wall.point;
    const Wide compliance = dot<Wide>(normal, block * normal);
    const auto held = (compliance > 0) & (terms_[p].free != 0);
    const Wide factor = select<Wide>(held, at.vertex.over_relaxation, 1);
    const Wide before =
        Wide::of([&](std::size_t i) { return rows.multiplier[static_cast<std::size_t>(row_at(own[i]))]; });
    const Wide beyond = dot<Wide>(normal, at.here + factor * (block * at.vertex.force)) - wall.extra;
    const Wide needed = before + beyond / select<Wide>(held, factor * compliance, 1);
    const Wide multiplier = select<Wide>(held, larger<Wide>(needed, 0), before);
    const Vector3<Wide> change = (before - multiplier) * normal;
    at.vertex.force += change;
    at.others.force += change;
    auto of_constraints = gather_padded(rows.force.data(), own.data());
    of_constraints.point += change;
    scatter_padded(of_constraints, rows.force.data(), own.data());
    for (std::size_t i = 0; i < packs_[p].size; ++i) {
        rows.multiplier[static_cast<std::size_t>(row_at(own[i]))] = multiplier[i];
    }
    move.displacement = factor * (block * at.vertex.force);
    move.moves = (norm(at.vertex.force) > tolerance) |
                 (held & (dot<Wide>(normal, at.here) - wall.extra > tolerance * move.least));
}

// Evaluates the forces on the vertices of a pack.
template <Real Scalar>
template <class Rule, class Scene>
MEMBRANE_INLINE auto PackedVertices<Scalar>::evaluate(std::size_t p, const Scene& scene,
                                                      Constrained constrained) const noexcept -> PackState {
    VertexRows<Scalar>& rows = scene.rows;
    const auto& own = packs_[p].own;
    PackState at;
    at.here = gather(rows.position.data(), own.data());
    at.vertex = spring_state<Rule>(p, at.here, scene);
    if constexpr (HasElements<NetworkOf<Scene>>) {
        CornerForce<Wide> elements{{}, {}, {}};
        elements_.for_each(p, at.here, rows.position.data(), scene.network,
                           [&](const auto& element, const auto& x, std::size_t i)
                               MEMBRANE_INLINE_LAMBDA { elements += element.force_on(x, i); });
        add(static_cast<EnergyMajoriser<Wide>&>(at.vertex), elements);
    }
    if constexpr (!std::same_as<VolumeOf<Scene>, NoFoundation>) at.others = foundation_on(p, at.here, scene);
    if (constrained != Constrained::no) {
        const auto of_constraints = gather_padded(rows.force.data(), own.data());
        const Wide contact_stiffness = larger<Wide>(of_constraints.extra, 0);
        at.others.force += of_constraints.point;
        at.others.stiffness += contact_stiffness + added_stiffness(p, rows);
        if (constrained == Constrained::in_contact) {
            at.vertex.contact_stiffness = contact_stiffness;
            at.vertex.contact_normal = direction_or_zero<Wide>(of_constraints.point);
            at.has_walls = rows.has_walls && any(squared_norm(gather(rows.wall.data(), own.data())) > 0);
            if (at.has_walls && rows.only_walls && is_descent_rule<Rule>) at.vertex.over_relaxation = over_relaxation;
        }
    }
    at.vertex.force += at.others.force;
    at.vertex.stiffness += at.others.stiffness;
    at.vertex.mass = terms_[p].mass;
    at.vertex.dt = scene.dt;
    at.vertex.constrained = constrained == Constrained::in_contact;
    return at;
}

template <Real Scalar>
template <class Scene, class Rule>
MEMBRANE_INLINE auto PackedVertices<Scalar>::move(std::size_t p, PackState at, const Scene& scene,
                                                  const Rule& rule) noexcept -> Outcome {
    VertexRows<Scalar>& rows = scene.rows;
    const auto& own = packs_[p].own;
    const auto may_move = terms_[p].free != 0;
    const bool in_queue = p < assigned_.packs;
    const Scalar tolerance = in_queue ? rows.force_tolerance : rows.outside_tolerance();
    auto move = move_of(rule, at.vertex, tolerance);
    if constexpr (moves_along_force<Rule, Scalar> && !is_descent_rule<Rule>) {
        if (any(move.may_overshoot & may_move)) {
            const Wide suspect = select<Wide>(move.may_overshoot & may_move, 1, 0);
            for (std::size_t i = 0; i < packs_[p].size; ++i) {
                if (suspect[i] != 0 && diverges(scene, vertices(p)[i], move.compliance[i])) return Outcome::unstable;
            }
        }
    }
    if (at.vertex.constrained) {
        const auto block = as_block<Wide>(move.compliance);
        keep_response(p, at, block, rows);
        if (at.has_walls) stop_at_walls(p, at, block, tolerance, move, rows);
    }
    const auto moves = move.moves & may_move;
    Vector3<Wide> displacement = move.displacement;
    if constexpr (needs_line_search<Rule, NetworkOf<Scene>>) {
        displacement = backtracked<Rule>(p, at, displacement, moves, scene);
    }
    PaddedLanes<Scalar> there{at.here + displacement, select<Wide>(may_move, move.least, 0)};
    for (Eigen::Index k = 0; k < 3; ++k) there.point[k] = select(moves, there.point[k], at.here[k]);
    scatter_padded(there, rows.position.data(), own.data());
    return any(moves) ? Outcome::moved : Outcome::at_rest;
}

// Backtracking line search in the lanes of `moves`: halves the displacement until the energy does not rise, up to
// rounding.
template <Real Scalar>
template <class Rule, class Scene>
auto PackedVertices<Scalar>::backtracked(std::size_t p, const PackState& at, Vector3<Wide> displacement,
                                         const typename Wide::Mask& moves, const Scene& scene) const noexcept
    -> Vector3<Wide> {
    auto rises = moves;
    if constexpr (has_energy_bound<Rule, NetworkOf<Scene>>) {
        rises = rises & !surely_descends(at.vertex, displacement);
    }
    for (int i = 0; i < std::numeric_limits<Scalar>::digits && any(rises); ++i) {
        const Wide work =
            dot<Wide>(at.others.force, displacement) - at.others.stiffness * squared_norm(displacement) / 2;
        const auto energy = energy_change(p, at.here, displacement, scene);
        rises = rises & !(energy.change <= work + 16 * std::numeric_limits<Scalar>::epsilon() * energy.size);
        const Wide factor = select<Wide>(rises, Scalar(0.5), 1);
        displacement = factor * displacement;
    }
    for (Eigen::Index k = 0; k < 3; ++k) displacement[k] = select<Wide>(rises, 0, displacement[k]);  // if NaN, too
    return displacement;
}

template <Real Scalar>
template <class Scene>
auto PackedVertices<Scalar>::energy_change(std::size_t p, const Vector3<Wide>& here, const Vector3<Wide>& displacement,
                                           const Scene& scene) const noexcept -> EnergyChange<Wide> {
    const auto* rows = scene.rows.position.data();
    EnergyChange<Wide> sum;
    for (const Slot& slot : std::span(slots_).subspan(packs_[p].slot, packs_[p].slot_count)) {
        const auto& law = scene.network.law();
        const SpringElement<Wide, std::remove_cvref_t<decltype(law)>> spring{&law, slot.stiffness, slot.rest_length};
        sum += spring.template energy_change<Wide>({here, gather(rows, slot.other.data())}, 0, displacement);
    }
    if constexpr (HasElements<NetworkOf<Scene>>) {
        elements_.for_each(p, here, rows, scene.network, [&](const auto& element, const auto& x, std::size_t i) {
            sum += element.energy_change(x, i, displacement);
        });
    }
    return sum;
}

template <Real Scalar>
template <class Scene>
MEMBRANE_FLATTEN void PackedVertices<Scalar>::evaluate_residual(std::size_t p, const Scene& scene) const noexcept {
    VertexRows<Scalar>& rows = scene.rows;
    const auto& own = packs_[p].own;
    const Vector3<Wide> here = gather(rows.position.data(), own.data());
    auto springs = springs_on<VertexForce<Wide>>(p, here, scene);
    if constexpr (HasElements<NetworkOf<Scene>>) {
        elements_.for_each(p, here, rows.position.data(), scene.network,
                           [&](const auto& element, const auto& x, std::size_t i)
                               MEMBRANE_INLINE_LAMBDA { springs.force += element.force_on(x, i).force; });
    }
    VertexForce<Wide> others;
    if constexpr (!std::same_as<VolumeOf<Scene>, NoFoundation>) others = foundation_on(p, here, scene);
    const Vector3<Wide> force = springs.force + (others.force + gather(rows.force.data(), own.data()));
    Vector3<Wide> undamped = force;
    if constexpr (SpringsInLanes<VolumeOf<Scene>, Scalar>) {
        if (terms_[p].damps) undamped -= spring_of<Scene>(terms_[p]).damping_force(here);
    } else if constexpr (!std::same_as<VolumeOf<Scene>, NoFoundation>) {
        for (std::size_t i = 0; i < packs_[p].size; ++i) {
            const auto one = lane_of<Vector3<Scalar>>(force, i);
            set_lane(undamped, i, undamped_force(scene, vertices(p)[i], one));
        }
    }
    scatter_padded<Scalar>({force, norm(undamped)}, rows.residual.data(), own.data());
}

}  // namespace membrane
