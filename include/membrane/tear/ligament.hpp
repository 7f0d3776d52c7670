// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include <membrane/solve/constraints.hpp>

/// The force across an edge that is opening.
namespace membrane {

/// What still joins the two vertices into which a tear has parted one: a force against their separation, at first
/// nearly as large as the membrane's force through the vertex, so that nothing jumps [Camacho96]. It is released as the
/// edge opens [Malluck80]: in each tick so far that the tip's driving force stays near the resistance, but no sooner
/// than the edge has nearly taken its energy, unless an advance pays for two edges. If the separation decreases, the
/// force decreases in proportion.
template <Real Scalar>
struct Ligament {
    ///@{
    /// The vertices that it joins.
    Index vertex = no_index, copy = no_index;
    ///@}
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< on `vertex` when it begins; the opposite acts on `copy` [N]
    Scalar energy = 0;                                ///< resistance times length, nearly what the edge takes [J]
    Scalar strength = 0;                              ///< its largest force when it begins [N]
    Scalar tension = strength;                        ///< its largest force by now [N]
    Scalar least = 0;                                 ///< what that may decrease to in this tick [N]
    Scalar slope = 0;                                 ///< by which it decreases as the edge opens [N/m]
    Scalar opening = 0;                               ///< separation after the last tick [m]
    Scalar reached = 0;                               ///< largest separation so far [m]
    Scalar increment = 0;                             ///< growth of that in a tick, as in the last ones [m]
    Scalar dissipated = 0;                            ///< energy that it has taken and would not give back [J]

    /// Whether it holds hardly more, a tenth of its strength: the tip goes on.
    [[nodiscard]] bool failed() const noexcept { return !(tension > strength / 10); }

    /// The force at a separation [N].
    [[nodiscard]] Scalar force_at(Scalar separation) const noexcept {
        if (separation < reached) return tension * (separation / reached);
        return (std::max)(least, tension - slope * (separation - reached));
    }

    /// Energy that it would give back at a separation [J].
    [[nodiscard]] Scalar stored(Scalar separation) const noexcept { return force_at(separation) * separation / 2; }

    /// After a tick, at this separation.
    void open(Scalar separation) noexcept {
        opening = separation;
        const Scalar further = separation - reached;
        increment = further > 0 ? (std::max)(further, increment / 2) : 0;
        if (!(further > 0)) return;
        const Scalar before = stored(reached), end = force_at(separation);
        const Scalar softens = slope > 0 ? (std::min)(further, (tension - least) / slope) : further;
        const Scalar work = (tension + end) / 2 * softens + end * (further - softens);
        tension = end;
        reached = separation;
        dissipated += work - (stored(reached) - before);
    }

    /// Before a tick. `excess`: the tip's driving force over the resistance, less 1. The tension decreases by twice
    /// that part of the strength: this decreases the driving force by about the same part or a smaller one, so that it
    /// keeps up with a hand. It decreases over the opening that is usual in a tick, or at once if the edge does not
    /// open, and not below the strength times the part of the energy that the edge has not taken yet. If `excess` is
    /// that part or more, and a quarter or more, an advance pays for this edge and the next: then the tension may
    /// decrease to zero.
    void weaken(Scalar excess) noexcept {
        least = tension;
        slope = 0;
        if (!(excess > 0)) return;
        const Scalar taken = dissipated + stored(reached) + tension * increment;
        const Scalar left = (std::max)(Scalar(0), 1 - taken / energy);
        const Scalar kept = excess < (std::max)(left, Scalar(0.25)) ? left * strength : 0;
        least = (std::min)(tension, (std::max)(kept, tension - 2 * excess * strength));
        if (increment > 0) {
            slope = (tension - least) / increment;
        } else {
            const Scalar before = stored(opening);
            tension = least;
            dissipated += before - stored(opening);
        }
    }
};

/// The forces of all ligaments, as a constraint of a step: made by `Tearing::ligaments`.
template <Real Scalar>
struct LigamentForces {
    std::span<const Ligament<Scalar>> ligaments;  ///< must outlive the step
    Index splits = no_index;                      ///< of the tear until now, which all parts must have followed

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
    if (splits != no_index) context.step().compare_splits(splits, StepStatus::solver_missed_split);
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

// With the response S of the separation u, and c the larger of u and the largest separation so far, over the tension
// there, the force f on the vertex solves c f = -(u + S (f - f_0)).
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
        const Scalar opening = (std::max)(norm(apart), ligament.reached), tension = ligament.force_at(opening);
        const Scalar stiffness = 1 / x[0];  // scaled, for the range of a float
        const Symmetric3<Scalar> response = stiffness * Symmetric3<Scalar>{x[0], y[1], z[2], x[1], x[2], y[2]};
        Vector3<Scalar> force = Vector3<Scalar>::Zero();
        if (tension > 0) {
            Symmetric3<Scalar> sum = response;
            sum += diagonal3(stiffness * (opening / tension));
            force = inverse(sum) * (response * point.force - stiffness * apart);
        }
        const Scalar size = norm(force);
        if (size > ligament.tension) force *= ligament.tension / size;
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
