// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

#include <membrane/core/index_set.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/vertex_split.hpp>

namespace membrane {

/// What the last update of a vertex in layer 0 found, or of several.
template <Number N>
struct VertexResponse {
    Symmetric3<N> compliance;  ///< [m/N]
    N internal_force = 0;      ///< size of the force without constraints [N]
    N internal_stiffness = 0;  ///< without contacts [N/m]
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The vertices of a step: for each a row of four numbers in each of several arrays, read and written several rows at a
/// time. The caller's positions are read when a vertex is loaded, and written at the end of the step: until then they
/// are the start positions.
///
/// A row is up to date if its vertex has been loaded in this step. `compliance` is that of the vertex's last update in
/// any step, `response_of` that of its last update in layer 0.
template <Real Scalar>
struct VertexRows {
    using Rows = std::vector<PaddedPoint<Scalar>>;  ///< a row for each vertex

    /// Allocates all memory. Cost: O(V).
    explicit VertexRows(Index vertex_count);

    /// Number of vertices V.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(fixed.size()); }

    /// The positions as a 3 x V matrix [m].
    [[nodiscard]] auto positions() const noexcept {
        using Map = Eigen::Map<const Points<Scalar>, 0, Eigen::OuterStride<>>;
        return Map(position.front().number.data(), 3, vertex_count(), Eigen::OuterStride<>(numbers_in_point));
    }

    void begin_step() noexcept;                                         ///< Unloads all vertices, clears all forces.
    void reset() noexcept;                                              ///< As new.
    void rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept;  ///< Rotates the responses with the body.
    void split(const VertexSplit& split) noexcept;  ///< A vertex becomes two: the copy gets its rows.

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (Visit::restores) self.reset();
        visit(self.position, self.response, self.residual, self.loaded, self.queue_residual);
    }

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

    /// Adds to the first three numbers of the row of vertex `v`.
    static void add(Rows& rows, Index v, const Vector3<Scalar>& by) noexcept {
        auto& number = row(rows, v).number;
        for (std::size_t k = 0; k < 3; ++k) number[k] += by[static_cast<Eigen::Index>(k)];
    }

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

    // One row more than vertices, for unused lanes. Three numbers, and the fourth:
    Rows position;                        ///< `position_of`, `compliance`
    Rows force;                           ///< `constraint_force`, `contact_stiffness`
    Rows response;                        ///< two rows for each vertex, of `response_of`
    Rows residual;                        ///< `residual_force`, `unbalanced_force`
    Rows wall;                            ///< of vertices that carry a contact: they stay behind a plane. Its normal,
                                          ///< zero without a wall, and how far along it the vertex may go [m]
    std::vector<Scalar> multiplier;       ///< of vertices with a wall: the force on them against its normal [N]
    std::vector<Scalar> added_stiffness;  ///< that constraints add in all directions [N/m]
    std::vector<Scalar> external_force;   ///< sum of the sizes of forces given in this step, as by `PointLoad` [N]
    bool has_external_forces = false;     ///< in this step
    bool has_walls = false;               ///< in this step
    bool only_walls = false;              ///< in this step: no contact has forces that its updates do not find

    ///@{
    /// Vertices whose positions are loaded, that are seeds, that constraints prescribe, or on which their forces act.
    IndexSet loaded, seeds, prescribed, forced;
    ///@}
    std::vector<unsigned char> fixed;  ///< of loaded vertices: pinned or prescribed

    Scalar force_tolerance = 0;  ///< a negligible change of force [N]
    Scalar queue_residual = 0;   ///< largest residual force in the queue after the last step [N]

  private:
    [[nodiscard]] MEMBRANE_INLINE static Begins response_begins(Begins begins) noexcept {
        for (Index& begin : begins) begin *= 2;
        return begins;
    }
};

/// The input of one step, and the current positions.
template <class Scalar, class Network, class Volume>
struct StepInput {
    const ConstPointsRef<Scalar>& start;  ///< positions when the step began, 3 x V [m]
    const ConstPointsRef<Scalar>& x;      ///< positions now, 3 x V [m]
    Scalar dt;                            ///< [s]
    const Network& network;               ///< springs and elements
    const Volume& volume;                 ///< the foundation
    VertexRows<Scalar>& rows;             ///< of the solver
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
VertexRows<Scalar>::VertexRows(Index vertices)
    : position(static_cast<std::size_t>(vertices) + 1),
      force(position),
      response(2 * position.size()),
      residual(position),
      wall(position),
      multiplier(position.size(), 0),
      added_stiffness(position.size(), 0),
      external_force(position.size(), 0),
      loaded(vertices),
      seeds(vertices),
      prescribed(vertices),
      forced(vertices),
      fixed(static_cast<std::size_t>(vertices), 0) {}

template <Real Scalar>
void VertexRows<Scalar>::begin_step() noexcept {
    for (const Index v : forced.items()) {
        row(force, v) = {};
        if (has_walls) row(wall, v) = {};
        added_stiffness[static_cast<std::size_t>(v)] = external_force[static_cast<std::size_t>(v)] = 0;
    }
    for (IndexSet* set : {&loaded, &seeds, &prescribed, &forced}) set->clear();
    has_external_forces = has_walls = false;
}

template <Real Scalar>
void VertexRows<Scalar>::reset() noexcept {
    begin_step();
    queue_residual = 0;
    for (Rows* rows : {&position, &response, &residual}) std::fill(rows->begin(), rows->end(), PaddedPoint<Scalar>{});
}

template <Real Scalar>
void VertexRows<Scalar>::split(const VertexSplit& split) noexcept {
    for (Rows* rows : {&position, &residual}) row(*rows, split.copy) = row(*rows, split.vertex);
    for (const Index i : {0, 1}) row(response, 2 * split.copy + i) = row(response, 2 * split.vertex + i);
    if (loaded.contains(split.vertex)) loaded.insert(split.copy);
}

template <Real Scalar>
void VertexRows<Scalar>::rotate(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    for (const Index v : loaded.items()) {  // in the last step
        auto kept = response_of(v);
        kept.compliance = rotated(kept.compliance, rotation);
        set_response(v, kept, compliance(v));
    }
}

/// Force and stiffness on vertex `v` by foundation, damping and constraints, without the network.
template <class Scalar, class Network, class Volume>
[[nodiscard]] VertexForce<Scalar> non_network_force(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto& rows = scene.rows;
    const Scalar stiffness = rows.contact_stiffness(v) + rows.added_stiffness[static_cast<std::size_t>(v)];
    if constexpr (std::is_same_v<Volume, NoFoundation>) return {rows.constraint_force(v), stiffness};
    const auto foundation = scene.volume.force_on(v, point(scene.x, v), point(scene.start, v), scene.dt);
    return {foundation.force + rows.constraint_force(v), foundation.stiffness + stiffness};
}

/// Sum of all forces on vertex `v`, and its stiffness.
template <class Scalar, class Network, class Volume>
[[nodiscard]] VertexForce<Scalar> total_force(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const auto springs = scene.network.force_on(v, scene.x), others = non_network_force(scene, v);
    return {springs.force + others.force, springs.stiffness + others.stiffness};
}

/// The force `now` on vertex `v`, without damping: damping may balance the forces for one tick out of equilibrium.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Vector3<Scalar> undamped_force(const StepInput<Scalar, Network, Volume>& scene, Index v,
                                             const Vector3<Scalar>& now) noexcept {
    const Vector3<Scalar> here = point(scene.x, v), start = point(scene.start, v);
    if constexpr (HasSprings<Volume, Scalar>) {
        const auto spring = scene.volume.spring(v, start, scene.dt);
        return spring.damps() ? Vector3<Scalar>(now - spring.damping_force(here)) : now;
    } else {
        const Vector3<Scalar> still = scene.volume.force_on(v, here, here, scene.dt).force;
        const Vector3<Scalar> moving = scene.volume.force_on(v, here, start, scene.dt).force;
        return now + (still - moving);
    }
}

/// Whether updates of a vertex by `compliance` times its force diverge: each overshoots by more than the last.
template <class Scalar, class Network, class Volume>
[[nodiscard]] bool diverges(const StepInput<Scalar, Network, Volume>& scene, Index v, Scalar compliance) noexcept {
    const Scalar others = non_network_force(scene, v).stiffness;
    if (compliance * (scene.network.force_on(v, scene.x).stiffness + others) < 2) return false;
    return compliance * (largest_eigenvalue(scene.network.hessian(v, scene.x)) + others) >= 2;
}

}  // namespace membrane
