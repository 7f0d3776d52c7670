// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/solve/contact_pack.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/surface/vertex_split.hpp>

namespace membrane {

/// The range of one constraint in a list shared by all.
struct ListRange {
    ///@{
    /// First item, and one beyond the last.
    std::size_t begin = 0, end = 0;
    ///@}

    /// The items of this range.
    template <class Item>
    [[nodiscard]] std::span<Item> of(std::span<Item> items) const noexcept {
        return items.subspan(begin, end - begin);
    }
};

/// What the last update of a vertex in layer 0 found, or of several.
template <Number N>
struct VertexResponse {
    Symmetric3<N> compliance;  ///< [m/N]
    N internal_force = 0;      ///< size of the force without constraints [N]
    N internal_stiffness = 0;  ///< without contacts [N/m]
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The state of a step, and what it keeps for the next one: for each vertex a row of four numbers in each of several
/// arrays, read and written several rows at a time. The caller's positions are read when a vertex is loaded, and
/// written at the end of the step: until then they are the start positions.
///
/// A row is up to date if its vertex has been loaded in this step. `compliance` is that of the vertex's last update in
/// any step, `response_of` that of its last update in layer 0.
template <Real Scalar>
struct StepState {
    /// The largest number of constraints of one step.
    static constexpr std::size_t max_constraints = 16;

    using Rows = std::vector<PaddedPoint<Scalar>>;  ///< a row for each vertex

    /// Allocates all memory. Cost: O(V + `max_contact_points`).
    StepState(Index vertex_count, Index max_contact_points);

    /// Number of vertices V.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(fixed.size()); }

    /// The positions as a 3 x V matrix [m].
    [[nodiscard]] auto positions() const noexcept {
        using Map = Eigen::Map<const Points<Scalar>, 0, Eigen::OuterStride<>>;
        return Map(position.front().number.data(), 3, vertex_count(), Eigen::OuterStride<>(numbers_in_point));
    }

    void begin_step() noexcept;    ///< Unloads all vertices, clears all forces.
    void end_step() noexcept;      ///< Keeps the contact points of this step for the next one.
    void reset_points() noexcept;  ///< Drops the contact points of the last step.
    void reset() noexcept;         ///< As new.
    void rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept;  ///< Rotates the kept vectors with the body.

    /// A vertex becomes two: the copy gets its rows, and contact points on triangles that get the copy follow.
    void split(const VertexSplit& split) noexcept;

    /// Visits what is kept from tick to tick, see `core/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (Visit::restores) self.reset();
        visit(self.position, self.response, self.support, self.residual, self.loaded, self.shared,
              self.pressed_supports, self.previous_points, self.previous_ranges, self.queue_residual, self.asleep_below,
              self.splits);
        if constexpr (Visit::restores) self.index_previous_points();
    }

    ///@{
    /// The first of the previous points whose first corner is `v`, and the next one with this corner; or `no_index`.
    [[nodiscard]] Index previous_at(Index v) const noexcept {
        return v >= 0 && v < vertex_count() ? first_previous[static_cast<std::size_t>(v)] : no_index;
    }
    [[nodiscard]] Index next_previous(Index point) const noexcept {
        return next_of_same_corner[static_cast<std::size_t>(point)];
    }
    ///@}

    /// Loads the position of `v` from `x`, unless it has been loaded in this step.
    template <class Network>
    void load(Index v, const ConstPointsRef<Scalar>& x, const Network& network) noexcept {
        if (!loaded.insert(v)) return;
        set_position(v, point(x, v));
        fixed[static_cast<std::size_t>(v)] = network.pinned(v) ? 1 : 0;
    }
    /// Reloads all loaded positions from `x`, except prescribed ones, and clears the forces of constraints.
    void restore(const ConstPointsRef<Scalar>& x) noexcept {
        for (const Index v : loaded.items()) {
            if (!prescribed.contains(v)) set_position(v, point(x, v));
        }
        for (const Index v : forced.items()) row(force, v) = {};
    }

    /// Whether a loaded vertex is pinned or prescribed.
    [[nodiscard]] bool is_fixed(Index v) const noexcept { return fixed[static_cast<std::size_t>(v)] != 0; }

    /// Tolerance of vertices outside the queue [N]: a step does not solve the queue any better than its residual, so
    /// vertices that the contact has left wait while the forces on them are far below it.
    [[nodiscard]] Scalar outside_tolerance() const noexcept { return (std::max)(force_tolerance, queue_residual / 10); }

    ///@{
    /// The row of vertex `v`.
    [[nodiscard]] static PaddedPoint<Scalar>& row(Rows& rows, Index v) noexcept {
        return rows[static_cast<std::size_t>(v)];
    }
    [[nodiscard]] static const PaddedPoint<Scalar>& row(const Rows& rows, Index v) noexcept {
        return rows[static_cast<std::size_t>(v)];
    }
    ///@}

    ///@{
    /// Position of `v` [m].
    [[nodiscard]] Vector3<Scalar> position_of(Index v) const noexcept { return row(position, v).point(); }
    void set_position(Index v, const Vector3<Scalar>& p) noexcept {
        Scalar* number = row(position, v).number.data();
        number[0] = p.x(), number[1] = p.y(), number[2] = p.z();
    }
    ///@}

    ///@{
    /// The force of the constraints on `v` [N], and the stiffness that contact adds along it [N/m].
    [[nodiscard]] Vector3<Scalar> constraint_force(Index v) const noexcept { return row(force, v).point(); }
    [[nodiscard]] Scalar contact_stiffness(Index v) const noexcept {
        return (std::max)(row(force, v).extra(), Scalar(0));  // a sum of differences, which may be negative by rounding
    }
    ///@}

    ///@{
    /// The force of a constraint on a fixed or shared vertex [N], that of the other constraints [N], and the vertex's
    /// stiffness against the part of the force that is opposed, 0 before a contact near it [N/m].
    [[nodiscard]] Vector3<Scalar> support_force(Index v) const noexcept { return row(support, v).point(); }
    [[nodiscard]] Vector3<Scalar> opposing_force(Index v) const noexcept { return row(opposing, v).point(); }
    [[nodiscard]] Scalar support_stiffness(Index v) const noexcept { return row(support, v).extra(); }
    void set_support_stiffness(Index v, Scalar stiffness) noexcept { row(support, v).number[3] = stiffness; }
    ///@}

    ///@{
    /// The residual force on `v` at the end of the step, and its norm without damping [N].
    [[nodiscard]] Vector3<Scalar> residual_force(Index v) const noexcept { return row(residual, v).point(); }
    [[nodiscard]] Scalar unbalanced_force(Index v) const noexcept { return row(residual, v).extra(); }
    void set_residual(Index v, const Vector3<Scalar>& all, Scalar unbalanced) noexcept {
        row(residual, v).set(all, unbalanced);
    }
    ///@}

    /// Lower bound of the compliance of `v`, by its last update [m/N].
    [[nodiscard]] Scalar compliance(Index v) const noexcept { return row(position, v).extra(); }

    ///@{
    /// The response of `v`; zero if it is fixed. `compliance` is the lower bound by the same update.
    [[nodiscard]] VertexResponse<Scalar> response_of(Index v) const noexcept {
        const auto& a = row(response, 2 * v).number;
        const auto& b = row(response, 2 * v + 1).number;
        return {{a[0], a[1], a[2], a[3], b[0], b[1]}, b[2], b[3]};
    }
    void set_response(Index v, const VertexResponse<Scalar>& one, Scalar compliance) noexcept {
        const auto& block = one.compliance;
        row(response, 2 * v).number = {block.xx, block.yy, block.zz, block.xy};
        row(response, 2 * v + 1).number = {block.xz, block.yz, one.internal_force, one.internal_stiffness};
        row(position, v).number[3] = compliance;
    }
    void clear_response(Index v) noexcept { set_response(v, {}, 0); }
    ///@}

    using Begins = std::array<Index, Lanes<Scalar>::count>;  ///< in each lane, where the row of a vertex begins

    ///@{
    /// The responses of several vertices, one in each lane.
    [[nodiscard]] MEMBRANE_INLINE VertexResponse<Lanes<Scalar>> responses(const Begins& begins) const noexcept {
        const Begins at = response_begins(begins);
        const auto a = gather_padded(response.data(), at.data()), b = gather_padded(response.data() + 1, at.data());
        return {{a.point[0], a.point[1], a.point[2], a.extra, b.point[0], b.point[1]}, b.point[2], b.extra};
    }
    MEMBRANE_INLINE void set_responses(const Begins& begins, const VertexResponse<Lanes<Scalar>>& all) noexcept {
        const Begins at = response_begins(begins);
        const auto& block = all.compliance;
        scatter_padded<Scalar>({{block.xx, block.yy, block.zz}, block.xy}, response.data(), at.data());
        scatter_padded<Scalar>({{block.xz, block.yz, all.internal_force}, all.internal_stiffness}, response.data() + 1,
                               at.data());
    }
    ///@}

    /// Finds the vertices shared by points of several constraints. Cost: linear in the points.
    void find_shared() noexcept;

    /// Makes the previous points known to `previous_at`.
    void index_previous_points() noexcept;

    // One row more than vertices, for unused lanes. Three numbers, and the fourth:
    Rows position;                        ///< `position_of`, `compliance`
    Rows force;                           ///< `constraint_force`, `contact_stiffness`
    Rows response;                        ///< two rows for each vertex, of `response_of`
    Rows support;                         ///< of fixed and shared vertices: `support_force`, `support_stiffness`
    Rows opposing;                        ///< of fixed and shared vertices: `opposing_force`
    Rows residual;                        ///< `residual_force`, `unbalanced_force`
    Rows anchor;                          ///< positions to which `kept` vertices go back [m]
    std::vector<Scalar> added_stiffness;  ///< that constraints add in all directions [N/m]
    std::vector<Scalar> external_force;   ///< sum of the sizes of forces given in this step, as by `PointLoad` [N]
    bool has_external_forces = false;     ///< in this step

    ///@{
    /// Vertices whose positions are loaded, that are seeds, that constraints prescribe, or on which their forces act.
    IndexSet loaded, seeds, prescribed, forced;
    ///@}
    IndexSet shared;                   ///< vertices with points of several constraints, of the last step until found
    IndexSet pressed_supports;         ///< corners of points on a fixed or a shared vertex
    IndexSet kept;                     ///< vertices with an `anchor`
    std::vector<unsigned char> fixed;  ///< of loaded vertices: pinned or prescribed
    std::vector<unsigned char> owner;  ///< scratch of `find_shared`

    ///@{
    /// Contact points of all constraints, of this step and of the last one.
    FixedVector<ContactPoint<Scalar>> points, previous_points;
    ///@}
    std::vector<Index> first_previous;  ///< of each vertex, the last previous point of which it is the first corner
    std::vector<Index> next_of_same_corner;  ///< of each previous point
    ///@{
    /// Range of each constraint in `points` and in `previous_points`.
    std::array<ListRange, max_constraints> point_ranges{}, previous_ranges{};
    ///@}
    ContactPacks<Scalar> packs;                            ///< of `points`
    std::array<ListRange, max_constraints> pack_ranges{};  ///< range of each constraint in `packs`
    IndexSet candidates;                                   ///< vertices that must not pass a tool: they are kept

    Scalar force_tolerance = 0;  ///< a negligible change of force [N]
    Scalar queue_residual = 0;   ///< largest residual force in the queue after the last step [N]
    Scalar asleep_below = 0;     ///< no vertex that has moved is asleep under a larger force than this [N]
    Scalar largest_motion = 0;   ///< how far shared vertices, and those beside fixed ones, may move [m]
    ///@{
    /// A constraint found its input invalid; the contact points exceed the capacity; several constraints have points on
    /// fixed or shared vertices.
    bool invalid = false, full = false, several_on_fixed = false;
    Index invalid_constraint = no_index;       ///< number of the one that was invalid first
    Index splits = 0;                          ///< of a tear, until now
    StepStatus missed = StepStatus::advanced;  ///< a part has followed fewer
                                               ///@}

  private:
    [[nodiscard]] MEMBRANE_INLINE static Begins response_begins(Begins begins) noexcept {
        for (Index& begin : begins) begin *= 2;
        return begins;
    }
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
StepState<Scalar>::StepState(Index vertices, Index max_contact_points)
    : position(static_cast<std::size_t>(vertices) + 1),
      force(position),
      response(2 * position.size()),
      support(position),
      opposing(position),
      residual(position),
      anchor(position),
      added_stiffness(position.size(), 0),
      external_force(position.size(), 0),
      loaded(vertices),
      seeds(vertices),
      prescribed(vertices),
      forced(vertices),
      shared(vertices),
      pressed_supports(vertices),
      kept(vertices),
      fixed(static_cast<std::size_t>(vertices), 0),
      owner(fixed),
      points(static_cast<std::size_t>(max_contact_points)),
      previous_points(points),
      first_previous(static_cast<std::size_t>(vertices), no_index),
      next_of_same_corner(points.capacity(), no_index),
      packs(vertices, static_cast<std::size_t>(max_contact_points)),
      candidates(vertices) {}

template <Real Scalar>
void StepState<Scalar>::begin_step() noexcept {
    for (const Index v : forced.items()) {
        row(force, v) = {};
        added_stiffness[static_cast<std::size_t>(v)] = external_force[static_cast<std::size_t>(v)] = 0;
    }
    for (const Index v : pressed_supports.items()) {
        row(support, v).set(Vector3<Scalar>::Zero(), support_stiffness(v));
        row(opposing, v) = {};
    }
    for (IndexSet* set : {&loaded, &seeds, &prescribed, &forced, &pressed_supports, &kept, &candidates}) set->clear();
    points.clear();
    packs.clear();
    point_ranges = {};
    pack_ranges = {};
    largest_motion = 0;
    invalid = full = several_on_fixed = has_external_forces = false;
    invalid_constraint = no_index;
    missed = StepStatus::advanced;
}

template <Real Scalar>
void StepState<Scalar>::find_shared() noexcept {
    const auto owner_of = [this](Index v) -> unsigned char& { return owner[static_cast<std::size_t>(v)]; };
    const auto is_vertex = [this](Index v) { return v >= 0 && v < vertex_count(); };
    shared.clear();
    for (std::size_t c = 0; c < max_constraints; ++c) {
        const auto number = static_cast<unsigned char>(c + 1);
        for (const auto& point : point_ranges[c].of(points.items())) {
            for (const Index v : point.corners) {
                if (!is_vertex(v)) continue;
                const auto before = std::exchange(owner_of(v), number);
                if (before != 0 && before != number) shared.insert(v);
            }
        }
    }
    int constraints_on_fixed = 0;
    for (const auto& range : point_ranges) {
        bool on_fixed = false;
        for (auto& point : range.of(points.items())) {
            for (const Index v : point.corners) {
                if (!is_vertex(v)) continue;
                owner_of(v) = 0;
                point.on_fixed = point.on_fixed || shared.contains(v);
            }
            on_fixed = on_fixed || point.on_fixed;
        }
        constraints_on_fixed += on_fixed ? 1 : 0;
    }
    several_on_fixed = constraints_on_fixed > 1;
    packs.set_on_fixed(points.items());
}

template <Real Scalar>
void StepState<Scalar>::end_step() noexcept {
    reset_points();
    std::swap(points, previous_points);
    std::swap(point_ranges, previous_ranges);
    index_previous_points();
}

template <Real Scalar>
void StepState<Scalar>::index_previous_points() noexcept {
    for (std::size_t i = 0; i < previous_points.size(); ++i) {
        const Index v = previous_points[i].corners[0];
        if (v < 0 || v >= vertex_count()) continue;
        next_of_same_corner[i] = std::exchange(first_previous[static_cast<std::size_t>(v)], static_cast<Index>(i));
    }
}

template <Real Scalar>
void StepState<Scalar>::reset_points() noexcept {
    for (const auto& point : previous_points.items()) {
        const Index v = point.corners[0];
        if (v >= 0 && v < vertex_count()) first_previous[static_cast<std::size_t>(v)] = no_index;
    }
    previous_points.clear();
    previous_ranges = {};
}

template <Real Scalar>
void StepState<Scalar>::reset() noexcept {
    begin_step();
    reset_points();
    shared.clear();
    queue_residual = asleep_below = 0;
    for (Rows* rows : {&position, &response, &support, &opposing, &residual})
        std::fill(rows->begin(), rows->end(), PaddedPoint<Scalar>{});
}

template <Real Scalar>
void StepState<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits;
    for (Rows* rows : {&position, &support, &residual}) row(*rows, split.copy) = row(*rows, split.vertex);
    for (const Index i : {0, 1}) row(response, 2 * split.copy + i) = row(response, 2 * split.vertex + i);
    for (IndexSet* set : {&loaded, &shared}) {
        if (set->contains(split.vertex)) set->insert(split.copy);
    }
    for (auto& point : previous_points.items()) {
        const Index first = point.corners[0];
        if (first >= 0 && first < vertex_count()) first_previous[static_cast<std::size_t>(first)] = no_index;
        if (split.takes(point.triangle))
            std::replace(point.corners.begin(), point.corners.end(), split.vertex, split.copy);
    }
    index_previous_points();
}

template <Real Scalar>
void StepState<Scalar>::rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    const RigidFrame<Scalar> turned{.rotation = rotation};
    for (auto& point : previous_points.items()) {
        point.normal = turned.vector_to_world(point.normal);
        point.force = turned.vector_to_world(point.force);
    }
    for (const Index v : loaded.items()) {  // in the last step
        auto kept = response_of(v);
        kept.compliance = rotated(kept.compliance, rotation);
        set_response(v, kept, compliance(v));
    }
}

}  // namespace membrane
