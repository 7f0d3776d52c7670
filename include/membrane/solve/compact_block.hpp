// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/bounded_list.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/curvature.hpp>
#include <membrane/solve/propagation_queue.hpp>
#include <membrane/solve/step_rule.hpp>

/// Visits of several vertices at once.
///
///     block.follow(queue, network);                      // where the queue has changed
///     block.open(scene, is_fixed);                       // once a step
///     block.load(x);
///     for (std::size_t g = 0; g < block.group_count(); ++g) static_cast<void>(block.visit(g, scene, rule));
///     block.store(x);
namespace membrane {

/// Whether the visits of a rule may be made in lanes: law and rule reckon with `Lanes`, the backing hands out its springs,
/// and no visit has to look at the energy.
template <class Scalar, class Rule, class Law, class Volume>
concept VisitsInLanes = (never_stiffens<Law>() || !requires { requires Rule::is_safe; }) &&
                        requires(const Rule& rule, const Law& law, const SpringState<Lanes<Scalar>>& spring,
                                 const VertexState<Lanes<Scalar>>& vertex) {
    law(spring);
    rule.compliance(vertex);
}
&&(std::same_as<Volume, NoVolumeSprings> || requires(const Volume& volume, const Vector3<Scalar>& start, Scalar dt) {
    { volume.spring(Index(0), start, dt) } -> std::same_as<VolumeSpring<Scalar>>;
});

/// The groups of a queue, with the springs of all their vertices side by side, and the positions of these and of their
/// neighbours at hand; as many groups as there is room for, from the first on.
template <Real Scalar>
class CompactBlock {
  public:
    using Several = Lanes<Scalar>;

    /// Vertices beyond so many are not worth the memory: a sweep over them takes longer than a tick.
    static constexpr Index most_vertices = 1 << 15;

    /// Has room for `most_vertices`, or so many.
    template <class Law>
    explicit CompactBlock(const MassSpringNetwork<Scalar, Law>& network, Index most = most_vertices);

    /// Takes over the groups of `queue`. Online. Cost: the springs of its vertices.
    template <class Network>
    void follow(const PropagationQueue& queue, const Network& network) noexcept;

    [[nodiscard]] std::size_t group_count() const noexcept { return groups_.size(); }

    /// The vertices of group `g`, how many there are in all groups, and the number of the group's first among them.
    [[nodiscard]] std::span<const Index> group(std::size_t g) const noexcept {
        return members_.items().subspan(groups_[g].first, groups_[g].size);
    }
    [[nodiscard]] std::size_t size() const noexcept { return members_.size(); }
    [[nodiscard]] std::size_t place_of(std::size_t g) const noexcept { return groups_[g].first; }

    /// How many of group `g` may move.
    [[nodiscard]] Index free_count(std::size_t g) const noexcept { return ties_[g].free_count; }

    /// The first group that begins at vertex number `place` or later.
    [[nodiscard]] std::size_t group_from(std::size_t place) const noexcept {
        const auto groups = groups_.items();
        const auto begins_before = [](const Group& group, std::size_t at) { return group.first < at; };
        return static_cast<std::size_t>(std::lower_bound(groups.begin(), groups.end(), place, begins_before) -
                                        groups.begin());
    }

    /// Begins a step: its volume springs, its masses, and who is fixed.
    template <class Scene, class IsFixed>
    void open(const Scene& scene, IsFixed is_fixed) noexcept;

    /// Takes the positions from `x` (3 x V [m]), and gives those of the groups back.
    void load(const PointsRef<Scalar>& x) noexcept;
    void store(PointsRef<Scalar>& x) const noexcept;

    enum class Visit { still, moved, too_far };

    /// Moves the vertices of group `g` as `rule` says. Where that may be beyond what is stable, it is `too_far`, and nothing
    /// moves, unless the move is `allowed`.
    template <class Scene, class Rule>
    Visit visit(std::size_t g, const Scene& scene, const Rule& rule, bool allowed = false) noexcept;

    /// The forces on the vertices of group `g`, each in the lane of its number there [N].
    template <class Scene>
    [[nodiscard]] Vector3<Several> forces(std::size_t g, const Scene& scene) const noexcept {
        return pull<Pull<Several>>(g, own(g), scene).force;
    }

    /// What they answered at their last visit, at least [m/N].
    [[nodiscard]] const Several& compliance(std::size_t g) const noexcept { return answers_[g]; }

  private:
    static constexpr std::size_t lanes = Several::count;
    struct Group {
        std::size_t first, size;  // of the members
        std::size_t slot, slot_count;
    };
    /// One spring of each vertex of a group, and where the row of its other end begins.
    struct Slot {
        Several stiffness, rest_length;
        std::array<Index, lanes> other;
    };
    /// What else a step knows of the vertices of a group.
    struct Ties {
        VolumeSpring<Several> spring;
        Several mass = 1;
        Several free = 0;  // 1 where it may move
        Index free_count = 0;
        bool damps = false;
    };

    template <class Sum, class Scene>
    [[gnu::always_inline, nodiscard]] inline Sum pull(std::size_t g, const Vector3<Several>& here,
                                                      const Scene& scene) const noexcept;
    [[nodiscard]] Vector3<Several> own(std::size_t g) const noexcept { return gather(rows_.data() + g * lanes); }
    template <class Network>
    [[nodiscard]] bool add_group(std::span<const Index> vertices, const Network& network) noexcept;
    template <class Network>
    void fill(std::size_t g, const Network& network) noexcept;
    void forget() noexcept {
        for (const BoundedList<Index>* known : {&members_, &others_}) {
            for (const Index v : known->items()) row_[static_cast<std::size_t>(v)] = no_index;
        }
        members_.clear();
        others_.clear();
        groups_.clear();
        slot_count_ = 0;
    }
    [[nodiscard]] Index row_of(Index v) noexcept {
        Index& row = row_[static_cast<std::size_t>(v)];
        if (row != no_index) return row;
        row = static_cast<Index>(groups_.size() * lanes + others_.size());
        others_.push(v);
        return row;
    }
    // Groups are half empty at the worst that is made room for.
    [[nodiscard]] static std::size_t groups_for(std::size_t vertices) noexcept {
        return vertices == 0 ? 0 : 2 * vertices / lanes + 64;
    }

    BoundedList<Index> members_;
    BoundedList<Index> others_;  // their neighbours that are in no group
    BoundedList<Group> groups_;
    std::size_t slot_count_ = 0;
    std::vector<Slot> slots_;
    std::vector<Ties> ties_;
    std::vector<Several> answers_;
    std::vector<PaddedPoint<Scalar>> rows_;  // of the groups, `lanes` each, then of the others
    std::vector<Index> row_;                 // of every vertex, if it is there
};

template <Real Scalar>
template <class Law>
CompactBlock<Scalar>::CompactBlock(const MassSpringNetwork<Scalar, Law>& network, Index most)
    : members_(static_cast<std::size_t>((std::min)(network.vertex_count(), most))),
      others_(most > 0 ? static_cast<std::size_t>(network.vertex_count()) : 0),
      groups_(groups_for(members_.room())),
      ties_(groups_for(members_.room())),
      answers_(ties_.size()),
      rows_(ties_.size() * lanes + others_.room()),
      row_(others_.room(), no_index) {
    std::size_t ends = 2 * network.springs().size(), longest = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) longest = (std::max)(longest, network.springs_of(v).size());
    ends = (std::min)(ends, longest * members_.room());
    if (most > 0) slots_.resize(2 * ends / lanes + 64 * longest);
}

template <Real Scalar>
template <class Network>
void CompactBlock<Scalar>::follow(const PropagationQueue& queue, const Network& network) noexcept {
    forget();
    std::size_t begin = queue.layer_count() > 0 ? queue.layer(0).size() : 0;
    for (const std::size_t end : queue.group_ends()) {
        if (!add_group(queue.vertices().subspan(begin, end - begin), network)) break;
        begin = end;
    }
    for (std::size_t g = 0; g < groups_.size(); ++g) fill(g, network);
}

// False if there is no room.
template <Real Scalar>
template <class Network>
bool CompactBlock<Scalar>::add_group(std::span<const Index> vertices, const Network& network) noexcept {
    std::size_t springs = 0;
    for (const Index v : vertices) springs = (std::max)(springs, network.springs_of(v).size());
    const Group group{members_.size(), vertices.size(), slot_count_, springs};
    if (members_.size() + vertices.size() > members_.room() || slot_count_ + springs > slots_.size()) return false;
    if (!groups_.push(group)) return false;
    slot_count_ += springs;
    auto row = static_cast<Index>((groups_.size() - 1) * lanes);
    for (const Index v : vertices) {
        members_.push(v);
        row_[static_cast<std::size_t>(v)] = row++;
    }
    return true;
}

// Lanes without a vertex, and those of vertices with fewer springs, have springs to themselves that never pull.
template <Real Scalar>
template <class Network>
void CompactBlock<Scalar>::fill(std::size_t g, const Network& network) noexcept {
    ties_[g] = {};
    answers_[g] = 0;
    const auto vertices = group(g);
    for (std::size_t i = 0; i < lanes; ++i) {
        const bool is_vertex = i < vertices.size();
        const auto springs = is_vertex ? network.springs_of(vertices[i]) : std::span<const SpringEnd<Scalar>>();
        const std::size_t own_row = g * lanes + i;
        if (!is_vertex) rows_[own_row] = {};
        for (std::size_t s = 0; s < groups_[g].slot_count; ++s) {
            const bool is_spring = s < springs.size();
            Slot& slot = slots_[groups_[g].slot + s];
            slot.stiffness.set(i, is_spring ? springs[s].stiffness : Scalar(0));
            slot.rest_length.set(i, is_spring ? springs[s].rest_length : Scalar(0));
            const Index row = is_spring ? row_of(springs[s].other) : static_cast<Index>(own_row);
            slot.other[i] = numbers_in_point * row;
        }
    }
}

template <Real Scalar>
template <class Scene, class IsFixed>
void CompactBlock<Scalar>::open(const Scene& scene, IsFixed is_fixed) noexcept {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        Ties& ties = ties_[g];
        ties.free_count = 0;
        ties.damps = false;
        const auto vertices = group(g);
        for (std::size_t i = 0; i < vertices.size(); ++i) {
            const Index v = vertices[i];
            const bool fixed = is_fixed(v);
            ties.free.set(i, fixed ? Scalar(0) : Scalar(1));
            if (!fixed) ++ties.free_count;
            if (scene.network.has_masses()) ties.mass.set(i, scene.network.mass(v));
            if constexpr (requires { scene.volume.spring(v, point(scene.work.start, v), scene.dt); }) {
                const auto spring = scene.volume.spring(v, point(scene.work.start, v), scene.dt);
                for (Eigen::Index k = 0; k < 3; ++k) ties.spring.anchor[k].set(i, spring.anchor[k]);
                ties.spring.stiffness.set(i, spring.stiffness);
                ties.spring.rate.set(i, spring.rate);
                ties.damps = ties.damps || spring.rate != 0;
                ties.spring.before.set(i, spring.before);
            }
        }
    }
}

template <Real Scalar>
void CompactBlock<Scalar>::load(const PointsRef<Scalar>& x) noexcept {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        auto* row = rows_.data() + g * lanes;
        for (const Index v : group(g)) (row++)->set(point(x, v));
    }
    auto* row = rows_.data() + groups_.size() * lanes;
    for (const Index v : std::as_const(others_).items()) (row++)->set(point(x, v));
}

template <Real Scalar>
void CompactBlock<Scalar>::store(PointsRef<Scalar>& x) const noexcept {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        const auto* row = rows_.data() + g * lanes;
        for (const Index v : group(g)) x.col(v) = (row++)->point();
    }
}

template <Real Scalar>
template <class Sum, class Scene>
Sum CompactBlock<Scalar>::pull(std::size_t g, const Vector3<Several>& here, const Scene& scene) const noexcept {
    Sum sum{};
    for (const Slot& slot : std::span(slots_).subspan(groups_[g].slot, groups_[g].slot_count)) {
        const Vector3<Several> reach = gather(rows_.data(), slot.other.data()) - here;
        add(sum, pull_of<Several>(scene.network.law(), reach, slot.stiffness, slot.rest_length));
    }
    if constexpr (!std::same_as<std::remove_cvref_t<decltype(scene.volume)>, NoVolumeSprings>) {
        const auto& spring = ties_[g].spring;
        const auto backing = ties_[g].damps ? spring.pull(here) : spring.elastic_pull(here);
        sum.force += backing.force;
        sum.stiffness += backing.stiffness;
    }
    return sum;
}

template <Real Scalar>
template <class Scene, class Rule>
auto CompactBlock<Scalar>::visit(std::size_t g, const Scene& scene, const Rule& rule, bool allowed) noexcept -> Visit {
    const Vector3<Several> here = own(g);
    VertexState<Several> state;
    if constexpr (requires { requires Rule::needs_relief; }) {
        static_cast<CurvedPull<Several>&>(state) = pull<CurvedPull<Several>>(g, here, scene);
    } else {
        const auto sum = pull<Pull<Several>>(g, here, scene);
        state.force = sum.force;
        state.stiffness = sum.stiffness;
    }
    state.mass = ties_[g].mass;
    state.dt = scene.dt;
    const auto may_move = ties_[g].free != 0;
    const auto compliance = rule.compliance(state);
    if constexpr (moves_along_force<Rule, Scalar>) {
        if (!allowed && any((compliance * state.stiffness >= 2) & may_move)) {
            const auto bound = curvature_bound(pull<CurvedPull<Several>>(g, here, scene));
            if (any((compliance * bound >= 2) & may_move)) return Visit::too_far;
        }
        answers_[g] = compliance;
    } else {
        const auto resists = state.stiffness > 0;
        answers_[g] = select(resists, 1 / select(resists, state.stiffness, Several(1)), Several(0));
    }
    const auto moves = (norm(state.force) > Several(scene.work.negligible_force)) & may_move;
    if (!any(moves)) return Visit::still;
    const Vector3<Several> there = here + compliance * state.force;
    Vector3<Several> now;
    for (Eigen::Index k = 0; k < 3; ++k) now[k] = select(moves, there[k], here[k]);
    scatter(now, rows_.data() + g * lanes);
    return Visit::moved;
}

}  // namespace membrane
