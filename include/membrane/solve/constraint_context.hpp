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

/// What the constraints of a step act on, and why the step is refused: for the solver and the library's constraints.
template <Real Scalar>
struct ConstrainedStep {
    const ConstPointsRef<Scalar>& start;  ///< positions when the step began [m]
    VertexRows<Scalar>& rows;             ///< of the vertices
    ContactState<Scalar>& contacts;       ///< of all constraints

    /// `network.pinned(v)` says which vertices never move; `splits` of a tear until now. What is referred to must
    /// outlive this.
    template <class Network>
    ConstrainedStep(const ConstPointsRef<Scalar>& x, VertexRows<Scalar>& vertex_rows,
                    ContactState<Scalar>& contact_state, const Network& network, Index splits = 0) noexcept
        : start(x),
          rows(vertex_rows),
          contacts(contact_state),
          network_(&network),
          is_pinned_([](const void* of, Index v) noexcept { return static_cast<const Network*>(of)->pinned(v); }),
          splits_(splits) {}

    /// Whether the network pins `v`.
    [[nodiscard]] bool pinned(Index v) const noexcept { return is_pinned_(network_, v); }

    /// Loads the position of `v`, unless it has been loaded in this step.
    void load(Index v) noexcept {
        if (!rows.loaded.contains(v)) rows.load(v, start, *this);
    }

    /// Adds a force that a constraint finds: at a contact point, or friction [N]. That of a load is external, see
    /// `ConstraintContext::add_force`.
    void add_force(Index v, const Vector3<Scalar>& force) noexcept {
        rows.forced.insert(v);
        rows.add(rows.force, v, force);
    }

    ///@{
    /// Refuses the step: for an input of constraint number `constraint`, the first one counts; for more contact points
    /// than there may be; for a tear, of which a part has followed fewer splits than the solver, or the solver fewer.
    void refuse_input(std::size_t constraint) noexcept {
        if (invalid_constraint_ == no_index) invalid_constraint_ = static_cast<Index>(constraint);
    }
    void refuse_points() noexcept { too_many_points_ = true; }
    void compare_splits(Index splits, StepStatus missed) noexcept {
        if (splits != splits_) missed_ = splits < splits_ ? missed : StepStatus::solver_missed_split;
    }
    ///@}

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
    const void* network_;  // its type is known to `is_pinned_`
    bool (*is_pinned_)(const void*, Index) noexcept;
    Index splits_;
    StepStatus missed_ = StepStatus::advanced;
    Index invalid_constraint_ = no_index;
    bool too_many_points_ = false;
};

/// The vertices of a step, for one of its constraints: it seeds the vertices where its force enters, prescribes
/// positions, and adds forces. A vertex that is seeded or moved is loaded, at the cost of three numbers.
template <Real Scalar>
class ConstraintContext {
  public:
    /// Of constraint number `constraint`; `step` must outlive this.
    explicit ConstraintContext(ConstrainedStep<Scalar>& step, std::size_t constraint = 0) noexcept
        : step_(step), constraint_(constraint) {}

    /// Whether `v` is a vertex; if not, the step is refused.
    bool validate(Index v) noexcept {
        const bool valid = v >= 0 && v < step_.rows.vertex_count();
        if (!valid) step_.refuse_input(constraint_);
        return valid;
    }

    /// Puts `v` into layer 0 of the queue: a force enters here.
    void seed(Index v) noexcept {
        if (!step_.rows.seeds.insert(v)) return;
        step_.load(v);
        if (step_.rows.is_fixed(v)) step_.rows.clear_response(v);
    }

    ///@{
    /// Position of `v` now, and at the start of the step [m].
    [[nodiscard]] Vector3<Scalar> position(Index v) const noexcept {
        return step_.rows.loaded.contains(v) ? step_.rows.position_of(v) : start(v);
    }
    [[nodiscard]] Vector3<Scalar> start(Index v) const noexcept { return point(step_.start, v); }
    ///@}

    ///@{
    /// Prescribes `target` [m] for `v` until the step ends; without a target, its start position. A pinned vertex does
    /// not move; without a target a prescribed vertex does not move either.
    void prescribe(Index v, const Vector3<Scalar>& target) noexcept {
        prescribe(v);
        if (!step_.pinned(v)) set_position(v, target);
    }
    void prescribe(Index v) noexcept;
    ///@}

    /// Whether a constraint prescribes the position of `v` in this step.
    [[nodiscard]] bool prescribed(Index v) const noexcept { return step_.rows.prescribed.contains(v); }

    /// Whether `v` is pinned or prescribed: in this step only `prescribe` moves it.
    [[nodiscard]] bool fixed(Index v) const noexcept {
        return step_.rows.loaded.contains(v) ? step_.rows.is_fixed(v) : step_.pinned(v);
    }

    ///@{
    /// Moves `v` by a displacement, or to a position [m].
    void move(Index v, const Vector3<Scalar>& by) noexcept { set_position(v, position(v) + by); }
    void set_position(Index v, const Vector3<Scalar>& target) noexcept {
        step_.load(v);
        step_.rows.set_position(v, target);
    }
    ///@}

    /// Adds to the external force on `v` for this step [N]. Only active vertices move by it: `seed` makes one active in
    /// `begin`.
    void add_force(Index v, const Vector3<Scalar>& force) noexcept {
        step_.add_force(v, force);
        step_.rows.external_force[static_cast<std::size_t>(v)] += norm(force);
        step_.rows.has_external_forces = true;
    }

    /// Adds to the stiffness of `v` in all directions for this step [N/m]: for a force that changes as `v` moves.
    void add_stiffness(Index v, Scalar by) noexcept {
        step_.rows.forced.insert(v);
        step_.rows.added_stiffness[static_cast<std::size_t>(v)] += by;
    }

    /// Response of a vertex of layer 0 to `force` by its last update [m]; zero if it is fixed.
    [[nodiscard]] Vector3<Scalar> response(Index v, const Vector3<Scalar>& force) const noexcept {
        return fixed(v) ? Vector3<Scalar>(Vector3<Scalar>::Zero()) : step_.rows.response_of(v).compliance * force;
    }

    /// Lower bound of the compliance of `v` by its last update [m/N]; zero if it is fixed.
    [[nodiscard]] Scalar compliance(Index v) const noexcept { return fixed(v) ? Scalar(0) : step_.rows.compliance(v); }

    /// At the end of the step: the sum of all forces on `v` [N]. @pre `v` is a seed, prescribed, or active
    [[nodiscard]] Vector3<Scalar> residual_force(Index v) const noexcept { return step_.rows.residual_force(v); }

    /// A negligible change of force [N].
    [[nodiscard]] Scalar force_tolerance() const noexcept { return step_.rows.force_tolerance; }

    /// The contact point of this constraint with this triangle and feature in the last step, or null; `corner` is its
    /// first corner. Cost: linear in the points with that first corner.
    [[nodiscard]] const ContactPoint<Scalar>* cached_point(Index triangle, int feature, Index corner) const noexcept {
        return step_.contacts.previous_point(constraint_, triangle, feature, corner);
    }

    /// Adds a point of this constraint, and keeps it for the next step; beyond the capacity the step is refused.
    void add_point(const ContactPoint<Scalar>& point) noexcept;

    ///@{
    /// The points of this constraint, in this step and in the last one.
    [[nodiscard]] std::span<ContactPoint<Scalar>> points() noexcept {
        return step_.contacts.point_ranges[constraint_].of(step_.contacts.points.items());
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> points() const noexcept {
        return step_.contacts.point_ranges[constraint_].of(
            std::span<const ContactPoint<Scalar>>(step_.contacts.points.items()));
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> previous_points() const noexcept {
        return step_.contacts.previous_ranges[constraint_].of(
            std::span<const ContactPoint<Scalar>>(step_.contacts.previous_points.items()));
    }
    ///@}

    ///@{
    /// For the library's constraints: the step, and which of its constraints this is.
    [[nodiscard]] ConstrainedStep<Scalar>& step() noexcept { return step_; }
    [[nodiscard]] const ConstrainedStep<Scalar>& step() const noexcept { return step_; }
    [[nodiscard]] std::size_t constraint() const noexcept { return constraint_; }
    ///@}

  private:
    ConstrainedStep<Scalar>& step_;
    std::size_t constraint_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
void ConstraintContext<Scalar>::prescribe(Index v) noexcept {
    step_.load(v);
    if (!step_.rows.prescribed.insert(v)) return;
    step_.rows.set_position(v, start(v));
    step_.rows.fixed[static_cast<std::size_t>(v)] = 1;
    step_.rows.clear_response(v);
}

template <Real Scalar>
void ConstraintContext<Scalar>::add_point(const ContactPoint<Scalar>& point) noexcept {
    auto& contacts = step_.contacts;
    if (!contacts.points.try_push_back(point)) step_.refuse_points();
    contacts.point_ranges[constraint_].end = contacts.points.size();
}

}  // namespace membrane
