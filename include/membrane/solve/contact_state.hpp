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
#include <membrane/core/rigid_frame.hpp>
#include <membrane/solve/contact_pack.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/vertex_rows.hpp>
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

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The contacts of a step, and what they keep for the next one: the points of all constraints; the forces on fixed and
/// shared vertices, see `rigid_support.hpp`; the positions to which vertices go back if the tool would tunnel.
template <Real Scalar>
struct ContactState {
    using Rows = typename VertexRows<Scalar>::Rows;  ///< a row for each vertex

    /// Allocates all memory. Cost: O(V + `max_contact_points`).
    ContactState(Index vertex_count, Index max_contact_points);

    /// Number of vertices V.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(owner_.size()); }

    void begin_step() noexcept;  ///< Without points and forces.
    /// Begins the points of constraint number `constraint`.
    void begin_points(std::size_t constraint) noexcept { point_ranges[constraint] = {points.size(), points.size()}; }
    void end_step() noexcept;      ///< Keeps the contact points of this step for the next one.
    void reset_points() noexcept;  ///< Drops the contact points of the last step.
    void reset() noexcept;         ///< As new.
    void rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept;  ///< Rotates the points with the body.

    /// A vertex becomes two: contact points on triangles that get the copy follow.
    void split(const VertexSplit& split) noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (Visit::restores) self.reset();
        visit(self.support, self.shared, self.pressed_supports, self.previous_points, self.previous_ranges);
        if constexpr (Visit::restores) self.index_previous_points();
    }

    ///@{
    /// The first of the previous points whose first corner is `v`, and the next one with this corner; or `no_index`.
    [[nodiscard]] Index previous_at(Index v) const noexcept {
        return v >= 0 && v < vertex_count() ? first_previous_[static_cast<std::size_t>(v)] : no_index;
    }
    [[nodiscard]] Index next_previous(Index point) const noexcept {
        return next_of_same_corner_[static_cast<std::size_t>(point)];
    }
    ///@}

    /// The previous point of constraint number `constraint` on this triangle and feature, or null; `corner` is its
    /// first corner. Cost: linear in the points with that first corner.
    [[nodiscard]] const ContactPoint<Scalar>* previous_point(std::size_t constraint, Index triangle, int feature,
                                                             Index corner) const noexcept;

    ///@{
    /// The force of a constraint on a fixed or shared vertex [N], that of the other constraints [N], and the vertex's
    /// stiffness against the part of the force that is opposed, 0 before a contact near it [N/m].
    [[nodiscard]] Vector3<Scalar> support_force(Index v) const noexcept { return row(support, v).point(); }
    [[nodiscard]] Vector3<Scalar> opposing_force(Index v) const noexcept { return row(opposing, v).point(); }
    [[nodiscard]] Scalar support_stiffness(Index v) const noexcept { return row(support, v).extra(); }
    void set_support_stiffness(Index v, Scalar stiffness) noexcept { row(support, v).number[3] = stiffness; }
    ///@}

    ///@{
    /// A position to which `v` can go back [m]. @pre for `kept_at`: `v` is among the kept
    void keep(Index v, const Vector3<Scalar>& position) noexcept {
        kept.insert(v);
        row(kept_position, v).set(position);
    }
    [[nodiscard]] Vector3<Scalar> kept_at(Index v) const noexcept { return row(kept_position, v).point(); }
    ///@}

    /// Sums the forces at the points on fixed or shared vertices: of constraint number `constraint`, and of the others.
    /// The points of the first `begun` constraints are those of this step, the others those of the last. Cost: linear
    /// in the points.
    void sum_support_forces(std::size_t constraint, std::size_t begun) noexcept;

    /// Finds the vertices shared by points of several constraints. Cost: linear in the points.
    void find_shared() noexcept;

    /// Places walls for the vertices that carry a contact, where no other constraint acts: from then on the vertex
    /// updates find their multipliers. After `find_shared`. Cost: linear in the packs.
    void place_walls(VertexRows<Scalar>& rows) noexcept;

    // One row more than vertices, for unused lanes. Three numbers, and the fourth:
    Rows support;        ///< of fixed and shared vertices: `support_force`, `support_stiffness`
    Rows opposing;       ///< of fixed and shared vertices: `opposing_force`
    Rows kept_position;  ///< to which `kept` vertices go back [m]

    IndexSet shared;            ///< vertices with points of several constraints, of the last step until found
    IndexSet pressed_supports;  ///< corners of points on a fixed or a shared vertex
    IndexSet kept;              ///< vertices with a `kept_position`
    IndexSet candidates;        ///< vertices that must not pass a tool: they are kept

    ///@{
    /// Contact points of all constraints, of this step and of the last one.
    FixedVector<ContactPoint<Scalar>> points, previous_points;
    ///@}
    ///@{
    /// Range of each constraint in `points` and in `previous_points`.
    std::array<ListRange, max_constraints> point_ranges{}, previous_ranges{};
    ///@}
    ContactPacks<Scalar> packs;                            ///< of `points`
    std::array<ListRange, max_constraints> pack_ranges{};  ///< range of each constraint in `packs`

    bool several_on_fixed = false;  ///< several constraints have points on fixed or shared vertices
    Scalar largest_motion = 0;      ///< how far shared vertices, and those beside fixed ones, may move [m]

  private:
    [[nodiscard]] static auto& row(auto& rows, Index v) noexcept { return VertexRows<Scalar>::row(rows, v); }
    void clear_supports() noexcept;
    void index_previous_points() noexcept;

    std::vector<Index> first_previous_;       // of each vertex, the last previous point of which it is the first corner
    std::vector<Index> next_of_same_corner_;  // of each previous point
    std::vector<unsigned char> owner_;        // scratch of `find_shared`
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
ContactState<Scalar>::ContactState(Index vertices, Index max_contact_points)
    : support(static_cast<std::size_t>(vertices) + 1),
      opposing(support),
      kept_position(support),
      shared(vertices),
      pressed_supports(vertices),
      kept(vertices),
      candidates(vertices),
      points(static_cast<std::size_t>(max_contact_points)),
      previous_points(points),
      packs(vertices, static_cast<std::size_t>(max_contact_points)),
      first_previous_(static_cast<std::size_t>(vertices), no_index),
      next_of_same_corner_(points.capacity(), no_index),
      owner_(static_cast<std::size_t>(vertices), 0) {}

template <Real Scalar>
void ContactState<Scalar>::begin_step() noexcept {
    clear_supports();
    for (IndexSet* set : {&pressed_supports, &kept, &candidates}) set->clear();
    points.clear();
    packs.clear();
    point_ranges = {};
    pack_ranges = {};
    largest_motion = 0;
    several_on_fixed = false;
}

template <Real Scalar>
void ContactState<Scalar>::clear_supports() noexcept {
    for (const Index v : pressed_supports.items()) {
        row(support, v).set(Vector3<Scalar>::Zero(), support_stiffness(v));
        row(opposing, v) = {};
    }
}

template <Real Scalar>
void ContactState<Scalar>::find_shared() noexcept {
    const auto owner_of = [this](Index v) -> unsigned char& { return owner_[static_cast<std::size_t>(v)]; };
    const auto is_vertex = [this](Index v) { return v >= 0 && v < vertex_count(); };
    shared.clear();
    for (std::size_t c = 0; c < max_constraints; ++c) {
        const auto number = static_cast<unsigned char>(c + 1);
        for (const auto& point : point_ranges[c].of(points.items())) {
            for (const Index v : point.vertices()) {
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
            for (const Index v : point.vertices()) {
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

/// Writes the walls of a pack as last located; none if a vertex is fixed or shared.
template <Real Scalar>
MEMBRANE_INLINE void place_wall(VertexRows<Scalar>& rows, ContactPack<Scalar>& pack) noexcept {
    pack.has_walls = !pack.on_fixed;
    pack.applied.normal = pack.load.normal;  // of the force that updates will apply
    rows.has_walls = rows.has_walls || pack.has_walls;
    const Lanes<Scalar> exists = pack.has_walls ? pack.used : Lanes<Scalar>(0);
    scatter_padded<Scalar>({exists * pack.load.normal, pack.wall}, rows.wall.data(), pack.corner[0].data());
    for (std::size_t i = 0; i < pack.size; ++i) {
        rows.multiplier[static_cast<std::size_t>(row_at(pack.corner[0][i]))] = pack.load.force[i];
    }
}

template <Real Scalar>
void ContactState<Scalar>::place_walls(VertexRows<Scalar>& rows) noexcept {
    rows.only_walls = true;
    for (auto& pack : packs.items()) {
        const bool is_wall = pack.kind == ContactKind::vertex && !pack.on_fixed;
        if (is_wall) place_wall(rows, pack);
        rows.only_walls = rows.only_walls && is_wall;
    }
}

template <Real Scalar>
void ContactState<Scalar>::sum_support_forces(std::size_t constraint, std::size_t begun) noexcept {
    clear_supports();
    for (std::size_t c = 0; c < max_constraints; ++c) {
        const auto of_constraint =
            c < begun ? point_ranges[c].of(points.items()) : previous_ranges[c].of(previous_points.items());
        auto& rows = c == constraint ? support : opposing;
        for (const auto& point : of_constraint) {
            for (std::size_t k = 0; k < point.vertices().size() && point.on_fixed; ++k) {
                const Index v = point.corners[k];
                pressed_supports.insert(v);
                VertexRows<Scalar>::add(rows, v, point.weights[static_cast<Eigen::Index>(k)] * point.force);
            }
        }
    }
}

template <Real Scalar>
const ContactPoint<Scalar>* ContactState<Scalar>::previous_point(std::size_t constraint, Index triangle, int feature,
                                                                 Index corner) const noexcept {
    const auto range = previous_ranges[constraint];
    for (Index i = previous_at(corner); i != no_index; i = next_previous(i)) {
        const auto at = static_cast<std::size_t>(i);
        const auto& point = previous_points[at];
        if (at >= range.begin && at < range.end && point.triangle == triangle && point.feature == feature)
            return &point;
    }
    return nullptr;
}

template <Real Scalar>
void ContactState<Scalar>::end_step() noexcept {
    reset_points();
    std::swap(points, previous_points);
    std::swap(point_ranges, previous_ranges);
    index_previous_points();
}

template <Real Scalar>
void ContactState<Scalar>::index_previous_points() noexcept {
    for (std::size_t i = 0; i < previous_points.size(); ++i) {
        const Index v = previous_points[i].corners[0];
        if (v < 0 || v >= vertex_count()) continue;
        next_of_same_corner_[i] = std::exchange(first_previous_[static_cast<std::size_t>(v)], static_cast<Index>(i));
    }
}

template <Real Scalar>
void ContactState<Scalar>::reset_points() noexcept {
    for (const auto& point : previous_points.items()) {
        const Index v = point.corners[0];
        if (v >= 0 && v < vertex_count()) first_previous_[static_cast<std::size_t>(v)] = no_index;
    }
    previous_points.clear();
    previous_ranges = {};
}

template <Real Scalar>
void ContactState<Scalar>::reset() noexcept {
    begin_step();
    reset_points();
    shared.clear();
    for (Rows* rows : {&support, &opposing}) std::fill(rows->begin(), rows->end(), PaddedPoint<Scalar>{});
}

template <Real Scalar>
void ContactState<Scalar>::split(const VertexSplit& split) noexcept {
    row(support, split.copy) = row(support, split.vertex);
    if (shared.contains(split.vertex)) shared.insert(split.copy);
    for (auto& point : previous_points.items()) {
        const Index first = point.corners[0];
        if (first >= 0 && first < vertex_count()) first_previous_[static_cast<std::size_t>(first)] = no_index;
        if (split.takes(point.triangle))
            std::replace(point.corners.begin(), point.corners.end(), split.vertex, split.copy);
    }
    index_previous_points();
}

template <Real Scalar>
void ContactState<Scalar>::rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    const RigidFrame<Scalar> turned{.rotation = rotation};
    for (auto& point : previous_points.items()) {
        point.normal = turned.vector_to_world(point.normal);
        point.force = turned.vector_to_world(point.force);
    }
}

}  // namespace membrane
