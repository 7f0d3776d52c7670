// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <membrane/solve/step.hpp>
#include <membrane/solve/step_state.hpp>
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
    /// `network.pinned(v)` says which vertices never move. All three must outlive this.
    template <class Network>
    ConstraintContext(const ConstPointsRef<Scalar>& x, StepState<Scalar>& state, const Network& network) noexcept
        : x_(x),
          state_(state),
          network_(&network),
          is_pinned_([](const void* of, Index v) noexcept { return static_cast<const Network*>(of)->pinned(v); }) {}

    /// Whether `v` is a vertex; if not, the step is refused.
    bool validate(Index v) noexcept;

    /// Compares the splits of a tear that a part has followed with the solver's: the step is refused with `missed`, or
    /// names the solver, if one has followed fewer.
    void compare_splits(Index splits, StepStatus missed) noexcept {
        if (splits != state_.splits) state_.missed = splits < state_.splits ? missed : StepStatus::solver_missed_split;
    }

    /// Puts `v` into layer 0 of the queue: a force enters here.
    void seed(Index v) noexcept {
        load(v);
        state_.seeds.insert(v);
        if (state_.is_fixed(v)) state_.clear_response(v);
    }

    ///@{
    /// Position of `v` now, and at the start of the step [m].
    [[nodiscard]] Vector3<Scalar> position(Index v) const noexcept {
        return state_.loaded.contains(v) ? state_.position_of(v) : start(v);
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
    [[nodiscard]] bool prescribed(Index v) const noexcept { return state_.prescribed.contains(v); }

    /// Whether `v` is pinned or prescribed: in this step only `prescribe` moves it.
    [[nodiscard]] bool fixed(Index v) const noexcept {
        return state_.loaded.contains(v) ? state_.is_fixed(v) : is_pinned_(network_, v);
    }

    /// Moves `v` by a displacement [m].
    void move(Index v, const Vector3<Scalar>& by) noexcept { set_position(v, position(v) + by); }

    /// Adds to the external force on `v` for this step [N]. Only active vertices move by it: `seed` makes one active in
    /// `begin`.
    void add_force(Index v, const Vector3<Scalar>& force) noexcept {
        add_constraint_force(v, force);
        state_.external_force[static_cast<std::size_t>(v)] += norm(force);
        state_.has_external_forces = true;
    }

    /// Adds to the stiffness of `v` in all directions for this step [N/m]: for a force that changes as `v` moves.
    void add_stiffness(Index v, Scalar by) noexcept {
        state_.forced.insert(v);
        state_.added_stiffness[static_cast<std::size_t>(v)] += by;
    }

    /// Response of a vertex of layer 0 to `force` by its last update [m]; zero if it is fixed.
    [[nodiscard]] Vector3<Scalar> response(Index v, const Vector3<Scalar>& force) const noexcept {
        return fixed(v) ? Vector3<Scalar>(Vector3<Scalar>::Zero()) : state_.response_of(v).compliance * force;
    }

    /// Lower bound of the compliance of `v` by its last update [m/N]; zero if it is fixed.
    [[nodiscard]] Scalar compliance(Index v) const noexcept { return fixed(v) ? Scalar(0) : state_.compliance(v); }

    /// At the end of the step: the sum of all forces on `v` [N]. @pre `v` is a seed, prescribed, or active
    [[nodiscard]] Vector3<Scalar> residual_force(Index v) const noexcept { return state_.residual_force(v); }

    /// A negligible change of force [N].
    [[nodiscard]] Scalar force_tolerance() const noexcept { return state_.force_tolerance; }

    /// The contact point of this constraint with this triangle and feature in the last step, or null; `corner` is its
    /// first corner. Cost: linear in the points with that first corner.
    [[nodiscard]] const ContactPoint<Scalar>* cached_point(Index triangle, int feature, Index corner) const noexcept;

    /// Adds a point of this constraint, and keeps it for the next step; beyond the capacity the step is refused.
    void add_point(const ContactPoint<Scalar>& point) noexcept;

    ///@{
    /// The points of this constraint, in this step and in the last one.
    [[nodiscard]] std::span<ContactPoint<Scalar>> points() noexcept {
        return state_.point_ranges[constraint_].of(state_.points.items());
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> points() const noexcept {
        return const_cast<ConstraintContext&>(*this).points();
    }
    [[nodiscard]] std::span<const ContactPoint<Scalar>> previous_points() const noexcept {
        return state_.previous_ranges[constraint_].of(
            std::span<const ContactPoint<Scalar>>(state_.previous_points.items()));
    }
    ///@}

    // For the solver and its own constraints.

    /// As `add_force`, for a force that a constraint finds: at a point of `add_point`, or friction.
    void add_constraint_force(Index v, const Vector3<Scalar>& force) noexcept {
        state_.forced.insert(v);
        auto& number = state_.row(state_.force, v).number;
        for (std::size_t k = 0; k < 3; ++k) number[k] += force[static_cast<Eigen::Index>(k)];
    }

    ///@{
    /// The state of the solver's step.
    [[nodiscard]] StepState<Scalar>& state() noexcept { return state_; }
    [[nodiscard]] const StepState<Scalar>& state() const noexcept { return state_; }
    ///@}

    ///@{
    /// Number of the constraint whose points `points` and `add_point` refer to.
    void select_constraint(std::size_t constraint) noexcept { constraint_ = constraint; }
    [[nodiscard]] std::size_t constraint() const noexcept { return constraint_; }
    ///@}

    /// Begins the points of the selected constraint.
    void begin_points() noexcept { state_.point_ranges[constraint_] = {state_.points.size(), state_.points.size()}; }

    /// Loads the position of `v`, unless it has been loaded in this step.
    void load(Index v) noexcept {
        if (!state_.loaded.contains(v)) state_.load(v, x_, Pins{*this});
    }

    /// Moves `v` to `target` [m].
    void set_position(Index v, const Vector3<Scalar>& target) noexcept {
        load(v);
        state_.set_position(v, target);
    }

    ///@{
    /// The position to which `go_back` moves `v`: that at the call of `keep`, or at the start of the step.
    void keep(Index v) noexcept {
        load(v);
        state_.kept.insert(v);
        state_.row(state_.anchor, v) = state_.row(state_.position, v);
    }
    void keep_start(Index v) noexcept {
        load(v);
        if (state_.kept.insert(v)) state_.row(state_.anchor, v).set(start(v));
    }
    [[nodiscard]] Vector3<Scalar> kept(Index v) const noexcept {
        return state_.kept.contains(v) ? state_.row(state_.anchor, v).point() : start(v);
    }
    ///@}

    /// Moves all free vertices back towards their kept positions, by `part` of the distance, 0 to 1.
    void go_back(Scalar part) noexcept {
        for (const Index v : state_.loaded.items()) {
            const Vector3<Scalar> now = position(v), before = kept(v);
            if (now != before && !state_.is_fixed(v)) state_.set_position(v, (1 - part) * now + part * before);
        }
    }

    /// The part of this constraint's force on `v` that is opposed, 0 to 1, see `rigid_support.hpp`.
    [[nodiscard]] Scalar opposed_part(Index v) const noexcept {
        if (fixed(v)) return 1;
        const Vector3<Scalar> own = state_.support_force(v), others = state_.opposing_force(v);
        const Scalar size = norm(own);
        const Scalar opposing = size > 0 ? (std::max)(-dot(own, others) / size, Scalar(0)) : norm(others);
        return opposing > 0 ? opposing / (size + opposing) : Scalar(0);
    }

    /// Displacement of a fixed or shared vertex under this constraint: the opposed part of its force over the support
    /// stiffness [m]; zero for other vertices.
    [[nodiscard]] Vector3<Scalar> support_displacement(Index v) const noexcept {
        const Scalar stiffness = state_.support_stiffness(v);
        if (!state_.pressed_supports.contains(v) || !(stiffness > 0)) return Vector3<Scalar>::Zero();
        return opposed_part(v) * state_.support_force(v) / stiffness;
    }

    /// Derivative of this displacement by the force [m/N]; zero for other vertices.
    [[nodiscard]] Scalar support_compliance(Index v) const noexcept {
        const Scalar stiffness = state_.support_stiffness(v);
        const bool held = fixed(v) || state_.pressed_supports.contains(v);
        return held && stiffness > 0 ? opposed_part(v) * opposed_part(v) / stiffness : Scalar(0);
    }

    /// Vertices shared with this constraint, or beside fixed ones, may move by `distance` in this step [m]: the motion
    /// of a tool or a target since the last one, and the violation.
    void allow_motion(Scalar distance) noexcept { state_.largest_motion = (std::max)(state_.largest_motion, distance); }

    /// Moves those of `vertices` that have moved farther than that in this step back to there: a triangle that rocks
    /// between two tools may turn over in few passes.
    void limit_motion(std::span<const Index> vertices) noexcept {
        for (const Index v : vertices) {
            const Vector3<Scalar> by = position(v) - start(v);
            const Scalar distance = norm(by);
            if (distance > state_.largest_motion && !fixed(v))
                set_position(v, start(v) + (state_.largest_motion / distance) * by);
        }
    }

    /// Sums the forces at the points on fixed or shared vertices: of this constraint, and of the others. The points of
    /// the first `begun` constraints are those of this step, the others those of the last. Cost: linear in the points.
    void sum_support_forces(std::size_t begun = StepState<Scalar>::max_constraints) noexcept;

    /// Adds to the force of the tools on `v` [N], if it is fixed.
    void add_support_force(Index v, const Vector3<Scalar>& force) noexcept {
        if (!fixed(v)) return;
        state_.pressed_supports.insert(v);
        auto& number = state_.row(state_.support, v).number;
        for (std::size_t k = 0; k < 3; ++k) number[k] += force[static_cast<Eigen::Index>(k)];
    }

  private:
    struct Pins {
        const ConstraintContext& context;
        [[nodiscard]] bool pinned(Index v) const noexcept { return context.is_pinned_(context.network_, v); }
    };

    const ConstPointsRef<Scalar>& x_;  // when the step began
    StepState<Scalar>& state_;
    const void* network_;  // its type is known to `is_pinned_`
    bool (*is_pinned_)(const void*, Index) noexcept;
    std::size_t constraint_ = 0;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
bool ConstraintContext<Scalar>::validate(Index v) noexcept {
    const bool valid = v >= 0 && v < state_.vertex_count();
    if (!valid && !std::exchange(state_.invalid, true)) state_.invalid_constraint = static_cast<Index>(constraint_);
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
    if (!state_.prescribed.insert(v)) return;
    state_.set_position(v, start(v));
    state_.fixed[static_cast<std::size_t>(v)] = 1;
    state_.clear_response(v);
}

template <Real Scalar>
void ConstraintContext<Scalar>::sum_support_forces(std::size_t begun) noexcept {
    for (const Index v : state_.pressed_supports.items()) {
        state_.row(state_.support, v).set(Vector3<Scalar>::Zero(), state_.support_stiffness(v));
        state_.row(state_.opposing, v) = {};
    }
    for (std::size_t c = 0; c < StepState<Scalar>::max_constraints; ++c) {
        const auto points = c < begun ? state_.point_ranges[c].of(state_.points.items())
                                      : state_.previous_ranges[c].of(state_.previous_points.items());
        auto& rows = c == constraint_ ? state_.support : state_.opposing;
        for (const auto& point : points) {
            for (std::size_t k = 0; k < 3 && point.on_fixed; ++k) {
                const Index v = point.corners[k];
                state_.pressed_supports.insert(v);
                auto& number = state_.row(rows, v).number;
                for (std::size_t i = 0; i < 3; ++i) {
                    number[i] +=
                        point.weights[static_cast<Eigen::Index>(k)] * point.force[static_cast<Eigen::Index>(i)];
                }
            }
        }
    }
}

template <Real Scalar>
const ContactPoint<Scalar>* ConstraintContext<Scalar>::cached_point(Index triangle, int feature,
                                                                    Index corner) const noexcept {
    const auto range = state_.previous_ranges[constraint_];
    for (Index i = state_.previous_at(corner); i != no_index; i = state_.next_previous(i)) {
        const auto at = static_cast<std::size_t>(i);
        const auto& point = state_.previous_points[at];
        if (at >= range.begin && at < range.end && point.triangle == triangle && point.feature == feature)
            return &point;
    }
    return nullptr;
}

template <Real Scalar>
void ConstraintContext<Scalar>::add_point(const ContactPoint<Scalar>& point) noexcept {
    if (!state_.points.try_push_back(point)) state_.full = true;
    state_.point_ranges[constraint_].end = state_.points.size();
}

}  // namespace membrane
