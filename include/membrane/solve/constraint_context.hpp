// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <membrane/solve/contact_state.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/vertex_rows.hpp>
#include <membrane/surface/triangle.hpp>

/// The interface of a step to its constraints.
///
///     void begin(membrane::ConstraintContext<double>& context) const noexcept {      // of a constraint of one's own
///         if (!context.validate(v)) return;
///         context.seed(v);
///         context.add_force(v, pressure * area * outward);                           // [N]
///     }
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The vertices of a step, for its constraints: they seed the vertices where a force enters, prescribe positions, and
/// add forces. A vertex that is seeded or moved is loaded, at the cost of three numbers.
template <Real Scalar>
class ConstraintContext {
  public:
    /// `network.pinned(v)` says which vertices never move; `splits` of a tear until now. What is referred to must
    /// outlive this.
    template <class Network>
    ConstraintContext(const ConstPointsRef<Scalar>& x, VertexRows<Scalar>& rows, ContactState<Scalar>& contacts,
                      const Network& network, Index splits = 0) noexcept
        : x_(x),
          rows_(rows),
          contacts_(contacts),
          network_(&network),
          is_pinned_([](const void* of, Index v) noexcept { return static_cast<const Network*>(of)->pinned(v); }),
          splits_(splits) {}

    /// Whether `v` is a vertex; if not, the step is refused.
    bool validate(Index v) noexcept;

    /// Puts `v` into layer 0 of the queue: a force enters here.
    void seed(Index v) noexcept {
        load(v);
        rows_.seeds.insert(v);
        if (rows_.is_fixed(v)) rows_.clear_response(v);
    }

    ///@{
    /// Position of `v` now, and at the start of the step [m].
    [[nodiscard]] Vector3<Scalar> position(Index v) const noexcept {
        return rows_.loaded.contains(v) ? rows_.position_of(v) : start(v);
    }
    [[nodiscard]] Vector3<Scalar> start(Index v) const noexcept { return point(x_, v); }
    ///@}

    ///@{
    /// Prescribes `target` [m] for `v` until the step ends; without a target, its start position. A pinned vertex does
    /// not move; without a target a prescribed vertex does not move either.
    void prescribe(Index v, const Vector3<Scalar>& target) noexcept;
    void prescribe(Index v) noexcept;
    ///@}

    /// Whether a constraint prescribes the position of `v` in this step.
    [[nodiscard]] bool prescribed(Index v) const noexcept { return rows_.prescribed.contains(v); }

    /// Whether `v` is pinned or prescribed: in this step only `prescribe` moves it.
    [[nodiscard]] bool fixed(Index v) const noexcept {
        return rows_.loaded.contains(v) ? rows_.is_fixed(v) : is_pinned_(network_, v);
    }

    /// Moves `v` by a displacement [m].
    void move(Index v, const Vector3<Scalar>& by) noexcept { set_position(v, position(v) + by); }

    /// Adds to the external force on `v` for this step [N]. Only active vertices move by it: `seed` makes one active in
    /// `begin`.
    void add_force(Index v, const Vector3<Scalar>& force) noexcept {
        add_constraint_force(v, force);
        rows_.external_force[static_cast<std::size_t>(v)] += norm(force);
        rows_.has_external_forces = true;
    }

    /// Adds to the stiffness of `v` in all directions for this step [N/m]: for a force that changes as `v` moves.
    void add_stiffness(Index v, Scalar by) noexcept {
        rows_.forced.insert(v);
        rows_.added_stiffness[static_cast<std::size_t>(v)] += by;
    }

    /// Response of a vertex of layer 0 to `force` by its last update [m]; zero if it is fixed.
    [[nodiscard]] Vector3<Scalar> response(Index v, const Vector3<Scalar>& force) const noexcept {
        return fixed(v) ? Vector3<Scalar>(Vector3<Scalar>::Zero()) : rows_.response_of(v).compliance * force;
    }

    /// Lower bound of the compliance of `v` by its last update [m/N]; zero if it is fixed.
    [[nodiscard]] Scalar compliance(Index v) const noexcept { return fixed(v) ? Scalar(0) : rows_.compliance(v); }

    /// At the end of the step: the sum of all forces on `v` [N]. @pre `v` is a seed, prescribed, or active
    [[nodiscard]] Vector3<Scalar> residual_force(Index v) const noexcept { return rows_.residual_force(v); }

    /// A negligible change of force [N].
    [[nodiscard]] Scalar force_tolerance() const noexcept { return rows_.force_tolerance; }

    /// The contact point of this constraint with this triangle and feature in the last step, or null; `corner` is its
    /// first corner. Cost: linear in the points with that first corner.
    [[nodiscard]] const ContactPoint<Scalar>* cached_point(Index triangle, int feature, Index corner) const noexcept {
        return contacts_.previous_point(constraint_, triangle, feature, corner);
    }

    /// Adds a point of this constraint, and keeps it for the next step; beyond the capacity the step is refused.
    void add_point(const ContactPoint<Scalar>& point) noexcept;

    ///@{
    /// The points of this constraint, in this step and in the last one.
    [[nodiscard]] std::span<ContactPoint<Scalar>> points() noexcept {
        return contacts_.point_ranges[constraint_].of(contacts_.points.items());
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> points() const noexcept {
        return const_cast<ConstraintContext&>(*this).points();
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> previous_points() const noexcept {
        return contacts_.previous_ranges[constraint_].of(
            std::span<const ContactPoint<Scalar>>(contacts_.previous_points.items()));
    }
    ///@}

    // For the solver and its own constraints.

    /// As `add_force`, for a force that a constraint finds: at a point of `add_point`, or friction.
    void add_constraint_force(Index v, const Vector3<Scalar>& force) noexcept {
        rows_.forced.insert(v);
        rows_.add(rows_.force, v, force);
    }

    /// Loads the position of `v`, unless it has been loaded in this step.
    void load(Index v) noexcept {
        if (!rows_.loaded.contains(v)) rows_.load(v, x_, Pins{*this});
    }

    /// Moves `v` to `target` [m].
    void set_position(Index v, const Vector3<Scalar>& target) noexcept {
        load(v);
        rows_.set_position(v, target);
    }

    ///@{
    /// The vertices and the contacts of the solver's step.
    [[nodiscard]] VertexRows<Scalar>& rows() noexcept { return rows_; }
    [[nodiscard]] const VertexRows<Scalar>& rows() const noexcept { return rows_; }
    [[nodiscard]] ContactState<Scalar>& contacts() noexcept { return contacts_; }
    [[nodiscard]] const ContactState<Scalar>& contacts() const noexcept { return contacts_; }
    ///@}

    ///@{
    /// Number of the constraint that the functions of points are about.
    void select_constraint(std::size_t constraint) noexcept { constraint_ = constraint; }
    [[nodiscard]] std::size_t constraint() const noexcept { return constraint_; }
    ///@}

    /// Begins the points of the selected constraint.
    void begin_points() noexcept {
        contacts_.point_ranges[constraint_] = {contacts_.points.size(), contacts_.points.size()};
    }

    /// Compares the splits of a tear that a part has followed with the solver's: the step is refused with `missed`, or
    /// names the solver, if one has followed fewer.
    void compare_splits(Index splits, StepStatus missed) noexcept {
        if (splits != splits_) missed_ = splits < splits_ ? missed : StepStatus::solver_missed_split;
    }

    /// The step is refused: there are more contact points than it may have.
    void refuse_points() noexcept { too_many_points_ = true; }

    ///@{
    /// Why the step is refused; `advanced`: it is not. And the first constraint whose input was invalid.
    [[nodiscard]] StepStatus refusal() const noexcept {
        if (missed_ != StepStatus::advanced) return missed_;
        if (invalid_constraint_ != no_index) return StepStatus::invalid_input;
        return too_many_points_ ? StepStatus::too_many_contact_points : StepStatus::advanced;
    }
    [[nodiscard]] Index invalid_constraint() const noexcept { return invalid_constraint_; }
    ///@}

  private:
    struct Pins {
        const ConstraintContext& context;
        [[nodiscard]] bool pinned(Index v) const noexcept { return context.is_pinned_(context.network_, v); }
    };

    const ConstPointsRef<Scalar>& x_;  // when the step began
    VertexRows<Scalar>& rows_;
    ContactState<Scalar>& contacts_;
    const void* network_;  // its type is known to `is_pinned_`
    bool (*is_pinned_)(const void*, Index) noexcept;
    std::size_t constraint_ = 0;

    Index splits_;
    StepStatus missed_ = StepStatus::advanced;
    Index invalid_constraint_ = no_index;
    bool too_many_points_ = false;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
bool ConstraintContext<Scalar>::validate(Index v) noexcept {
    const bool valid = v >= 0 && v < rows_.vertex_count();
    if (!valid && invalid_constraint_ == no_index) invalid_constraint_ = static_cast<Index>(constraint_);
    return valid;
}

template <Real Scalar>
void ConstraintContext<Scalar>::prescribe(Index v, const Vector3<Scalar>& target) noexcept {
    prescribe(v);
    if (!is_pinned_(network_, v)) set_position(v, target);
}

template <Real Scalar>
void ConstraintContext<Scalar>::prescribe(Index v) noexcept {
    load(v);
    if (!rows_.prescribed.insert(v)) return;
    rows_.set_position(v, start(v));
    rows_.fixed[static_cast<std::size_t>(v)] = 1;
    rows_.clear_response(v);
}

template <Real Scalar>
void ConstraintContext<Scalar>::add_point(const ContactPoint<Scalar>& point) noexcept {
    if (!contacts_.points.try_push_back(point)) refuse_points();
    contacts_.point_ranges[constraint_].end = contacts_.points.size();
}

}  // namespace membrane
