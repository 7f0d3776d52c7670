// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include <membrane/solve/constraints.hpp>

/// The force across an edge that is opening.
namespace membrane {

/// What still joins the two vertices into which a tear has parted one: a force against their separation that is
/// `strength` up to the separation `plateau` and decreases linearly to zero at `failure_opening`; the area below is
/// what the edge takes to open: a cohesive law that is rigid at first [Camacho96]. A tear so advances without a jump,
/// and takes that energy however coarse mesh and ticks are. If the separation decreases, the force decreases in
/// proportion.
template <Real Scalar>
struct Ligament {
    ///@{
    /// The vertices that it joins.
    Index vertex = no_index, copy = no_index;
    ///@}
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< on `vertex` when it begins; the opposite acts on `copy` [N]
    Scalar strength = 0;                              ///< when it begins [N]
    Scalar plateau = 0;                               ///< separation up to which it keeps its strength [m]
    Scalar failure_opening = 0;                       ///< separation at which it fails [m]
    Scalar reached = 0;                               ///< largest separation in earlier ticks [m]

    /// Whether it holds hardly more, a tenth of its strength: the tip goes on.
    [[nodiscard]] bool failed() const noexcept { return !(first_tension(reached) > strength / 10); }

    /// The force at a separation [N].
    [[nodiscard]] Scalar tension(Scalar opening) const noexcept {
        return opening < reached ? first_tension(reached) * (opening / reached) : first_tension(opening);
    }

    /// The largest force at any separation from now on [N].
    [[nodiscard]] Scalar largest_tension() const noexcept { return first_tension(reached); }

    /// That it takes until it fails [J].
    [[nodiscard]] Scalar energy() const noexcept { return work(failure_opening); }

    /// The part of it that opening has taken so far, 0 to 1.
    [[nodiscard]] Scalar part_taken() const noexcept { return work(reached) / energy(); }

    /// Energy that it would give back [J].
    [[nodiscard]] Scalar stored(Scalar opening) const noexcept { return tension(opening) * opening / 2; }

    /// That it would not give back of the work of opening it so far [J].
    [[nodiscard]] Scalar dissipated() const noexcept { return work(reached) - stored(reached); }

    /// After a tick, at a separation of `opening`.
    void open(Scalar opening) noexcept {
        if (opening > reached) reached = opening;
    }

  private:
    // The area below the law.
    [[nodiscard]] Scalar work(Scalar opening) const noexcept {
        const Scalar end = (std::min)(opening, failure_opening);
        if (end <= plateau) return strength * end;
        return strength * plateau + (strength + first_tension(end)) / 2 * (end - plateau);
    }
    // At a separation that increases.
    [[nodiscard]] Scalar first_tension(Scalar opening) const noexcept {
        if (opening >= failure_opening) return 0;
        return opening <= plateau ? strength : strength * (failure_opening - opening) / (failure_opening - plateau);
    }
};

/// The forces of all ligaments, as a constraint of a step: made by `Tearing::ligaments`.
template <Real Scalar>
struct LigamentForces {
    std::span<const Ligament<Scalar>> ligaments;  ///< must outlive the step

    ///@{
    /// As `Constraint` requires. The reaction is zero.
    [[nodiscard]] bool valid() const noexcept { return true; }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>& context) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept;
    ///@}
};

// A ligament is a point whose weights are 1 and -1: its position is the separation, its force that on the vertex.
template <Real Scalar>
void LigamentForces<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    for (const auto& ligament : ligaments) {
        const std::array<Index, 3> corners{ligament.vertex, ligament.copy, ligament.vertex};
        if (!seed_corners(context, corners)) return;
        ContactPoint<Scalar> point{no_index, static_cast<int>(ligament.copy), corners, {1, -1, 0}};
        const auto* before = context.cached_point(no_index, point.feature, ligament.vertex);
        point.force = before != nullptr ? before->force : ligament.force;
        add_point_force<Scalar>(context, corners, point.weights, point.force);
        context.add_point(point);
    }
}

// With the response S of the separation u, and c = u / tension, the force f on the vertex solves c f = -(u + S (f -
// f_0)).
template <Real Scalar>
bool LigamentForces<Scalar>::enforce(ConstraintContext<Scalar>& context) const noexcept {
    bool changed = false;
    const auto points = context.points();
    for (std::size_t i = 0; i < points.size(); ++i) {
        auto& point = points[i];
        const auto& ligament = ligaments[i];
        const Vector3<Scalar> x = response_of<Scalar>(context, point, Vector3<Scalar>::UnitX());
        const Vector3<Scalar> y = response_of<Scalar>(context, point, Vector3<Scalar>::UnitY());
        const Vector3<Scalar> z = response_of<Scalar>(context, point, Vector3<Scalar>::UnitZ());
        if (!(x[0] > 0)) continue;
        const Vector3<Scalar> apart = context.position(ligament.vertex) - context.position(ligament.copy);
        const Scalar opening = norm(apart), tension = ligament.tension(opening);
        const Scalar stiffness = 1 / x[0];  // scaled, for the range of a float
        const Symmetric3<Scalar> response = stiffness * Symmetric3<Scalar>{x[0], y[1], z[2], x[1], x[2], y[2]};
        Symmetric3<Scalar> sum = response;
        if (tension > 0) sum += diagonal3(stiffness * (opening / tension));
        Vector3<Scalar> force = Vector3<Scalar>::Zero();
        if (opening < ligament.failure_opening) force = inverse(sum) * (response * point.force - stiffness * apart);
        const Scalar size = norm(force);
        const Scalar largest = ligament.largest_tension();
        if (size > largest) force *= largest / size;
        const Vector3<Scalar> more = force - point.force;
        if (!(norm(more) > context.force_tolerance())) continue;
        change_force<Scalar>(context, point, more);
        changed = true;
    }
    return changed;
}

template <Real Scalar>
Vector3<Scalar> LigamentForces<Scalar>::reaction(const ConstraintContext<Scalar>& context) const noexcept {
    for (const auto& point : context.points()) {
        if (!is_finite(point.force)) return point.force;  // the step is refused
    }
    return Vector3<Scalar>::Zero();
}

static_assert(Constraint<LigamentForces<double>, double> && Constraint<LigamentForces<float>, float>);

}  // namespace membrane
