// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

#include <membrane/contact/grasper.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/predictor.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/surface_point.hpp>

/// Constraints: arguments of a step that act on the membrane from outside.
///
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact), pull(tool, grasp));
///     report.reactions[0];                                         // force of the membrane on the pressing tool [N]
namespace membrane {

/// A constraint on the membrane for one step. `begin` seeds all vertices where its force enters, applies the forces of
/// the last step, and moves attached points to their targets. `enforce` restores the constraint, and returns whether it
/// was violated. It is called after each update of layer 0, several times in turns where constraints may oppose one
/// another. If there is time, it is also called at the end of the step, unless nothing has changed since a call that
/// found no violation. `reaction` is the force of the membrane on the constraint [N]. Optional members:
/// `driving_input(): DrivingInput<Scalar>`, from which the next steps are extrapolated; `prescribe(context)`, which
/// prescribes vertices and is called before any `begin`; `end(context)`, called after all reactions of a step that
/// advanced, and not of one that is refused: for what a constraint keeps from step to step.
template <class C, class Scalar>
concept Constraint = Real<Scalar> &&
    requires(const C& constraint, ConstraintContext<Scalar>& context, const ConstraintContext<Scalar>& done) {
    { constraint.valid() }
    noexcept->std::same_as<bool>;  // else the step is refused
    { constraint.begin(context) }
    noexcept;
    { constraint.enforce(context) }
    noexcept->std::same_as<bool>;
    { constraint.reaction(done) }
    noexcept->std::convertible_to<Vector3<Scalar>>;
};

namespace detail {

template <class C, class Scalar>
consteval bool check_constraint() noexcept {
    static_assert(
        requires(const C& constraint) {
            { constraint.valid() }
            noexcept->std::same_as<bool>;
        },
        "Constraint: valid() const noexcept must return bool");
    static_assert(
        requires(const C& constraint, ConstraintContext<Scalar>& context) {
            { constraint.begin(context) }
            noexcept;
        },
        "Constraint: there must be begin(ConstraintContext<Scalar>&) const noexcept");
    static_assert(
        requires(const C& constraint, ConstraintContext<Scalar>& context) {
            { constraint.enforce(context) }
            noexcept->std::same_as<bool>;
        },
        "Constraint: enforce(ConstraintContext<Scalar>&) const noexcept must return bool");
    static_assert(
        requires(const C& constraint, const ConstraintContext<Scalar>& done) {
            { constraint.reaction(done) }
            noexcept->std::convertible_to<Vector3<Scalar>>;
        },
        "Constraint: reaction(const ConstraintContext<Scalar>&) const noexcept must return Vector3<Scalar>");
    return Constraint<C, Scalar>;
}

}  // namespace detail

/// A `Constraint`: if a type does not satisfy it, the error names the missing requirement.
template <class C, class Scalar>
concept CheckedConstraint = detail::check_constraint<C, Scalar>();

/// A reference to a constraint of any type, which must outlive it: the code of a step depends on no type of constraint.
template <Real Scalar>
class ConstraintRef {
  public:
    /// Keeps a reference to `constraint`.
    template <Constraint<Scalar> C>
    explicit ConstraintRef(const C& constraint) noexcept : constraint_(&constraint), calls_(&calls_of<C>) {}

    ///@{
    /// As `Constraint` requires. Where the constraint has no `driving_input`, `prescribe` or `end`, returns none, does
    /// nothing.
    [[nodiscard]] bool valid() const noexcept { return calls_->valid(constraint_); }
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept { return calls_->driving_input(constraint_); }
    void prescribe(ConstraintContext<Scalar>& context) const noexcept { calls_->prescribe(constraint_, context); }
    void begin(ConstraintContext<Scalar>& context) const noexcept { calls_->begin(constraint_, context); }
    [[nodiscard]] bool enforce(ConstraintContext<Scalar>& context) const noexcept {
        return calls_->enforce(constraint_, context);
    }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& done) const noexcept {
        return calls_->reaction(constraint_, done);
    }
    void end(const ConstraintContext<Scalar>& done) const noexcept { calls_->end(constraint_, done); }
    ///@}

  private:
    struct Calls {
        bool (*valid)(const void*) noexcept;
        DrivingInput<Scalar> (*driving_input)(const void*) noexcept;
        void (*prescribe)(const void*, ConstraintContext<Scalar>&) noexcept;
        void (*begin)(const void*, ConstraintContext<Scalar>&) noexcept;
        bool (*enforce)(const void*, ConstraintContext<Scalar>&) noexcept;
        Vector3<Scalar> (*reaction)(const void*, const ConstraintContext<Scalar>&) noexcept;
        void (*end)(const void*, const ConstraintContext<Scalar>&) noexcept;
    };
    template <class C>
    [[nodiscard]] static const C& as(const void* constraint) noexcept {
        return *static_cast<const C*>(constraint);
    }
    template <class C>
    static constexpr Calls calls_of{
        .valid = [](const void* c) noexcept -> bool { return as<C>(c).valid(); },
        .driving_input = [](const void* c) noexcept -> DrivingInput<Scalar> {
            if constexpr (requires { as<C>(c).driving_input(); }) return as<C>(c).driving_input();
            return {};
        },
        .prescribe =
            [](const void* c, ConstraintContext<Scalar>& context) noexcept {
                if constexpr (requires { as<C>(c).prescribe(context); }) as<C>(c).prescribe(context);
            },
        .begin = [](const void* c, ConstraintContext<Scalar>& context) noexcept { as<C>(c).begin(context); },
        .enforce = [](const void* c, ConstraintContext<Scalar>& context) noexcept -> bool {
            return as<C>(c).enforce(context);
        },
        .reaction = [](const void* c, const ConstraintContext<Scalar>& done) noexcept -> Vector3<Scalar> {
            return as<C>(c).reaction(done);
        },
        .end =
            [](const void* c, const ConstraintContext<Scalar>& done) noexcept {
                if constexpr (requires { as<C>(c).end(done); }) as<C>(c).end(done);
            },
    };

    const void* constraint_;
    const Calls* calls_;
};

/// All constraints of one step, in the order of its arguments.
template <Real Scalar>
class ConstraintList {
  public:
    /// Keeps references to both.
    ConstraintList(ConstraintContext<Scalar>& context, std::span<const ConstraintRef<Scalar>> constraints) noexcept
        : context_(context), constraints_(constraints) {}

    /// Number of the first constraint that is not valid; `no_index`: all are.
    [[nodiscard]] Index first_invalid() const noexcept {
        const auto found =
            std::find_if(constraints_.begin(), constraints_.end(), [](const auto& c) { return !c.valid(); });
        return found == constraints_.end() ? no_index : static_cast<Index>(found - constraints_.begin());
    }
    /// Collects the inputs that drive the constraints.
    void collect_inputs(std::span<DrivingInput<Scalar>> inputs) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) inputs[i] = constraints_[i].driving_input();
    }
    /// Begins all constraints. A vertex that one prescribes is fixed for all, in any order of the arguments.
    void begin() const noexcept {
        for_each([this](const auto& constraint, std::size_t) { constraint.prescribe(context_); });
        for_each([this](const auto& constraint, std::size_t) {
            context_.begin_points();
            constraint.begin(context_);
        });
        context_.contacts().find_shared();
    }
    /// Enforces all constraints, in several rounds if they may oppose one another; returns whether one was violated.
    [[nodiscard]] bool enforce() const noexcept {
        constexpr int max_rounds = 8;
        const int rounds = context_.contacts().several_on_fixed ? max_rounds : 1;
        bool changed = false;
        bool again = true;
        for (int i = 0; again && i < rounds; ++i) {
            again = false;
            for_each([&](const auto& constraint, std::size_t) { again |= constraint.enforce(context_); });
            limit_motion<Scalar>(context_, context_.contacts().shared.items());
            changed |= again;
        }
        return changed;
    }
    /// Computes the reactions; returns false if one is not finite. Updates the contact points, stale since `begin`,
    /// from their packs: before `find_violation` and `end`.
    [[nodiscard]] bool react(std::span<Vector3<Scalar>> reactions) const noexcept {
        auto& contacts = context_.contacts();
        contacts.packs.unpack(contacts.points.items());
        bool finite = true;
        for_each([&](const auto& constraint, std::size_t i) {
            reactions[i] = constraint.reaction(context_);
            finite &= is_finite(reactions[i]);
        });
        return finite;
    }
    /// Finds the largest violation, after `react`.
    void find_violation(StepReport<Scalar>& report) const noexcept {
        for_each([&](const auto&, std::size_t i) {
            if (context_.contacts().several_on_fixed) sum_support_forces(context_);
            for (const auto& point : std::as_const(context_).points()) {
                if (!point.on_fixed) continue;
                const Scalar violation = (std::max)(norm(support_displacement(context_, point)),
                                                    norm(point.force) * support_compliance(context_, point));
                if (!(violation > report.violation)) continue;
                report.violation = violation;
                report.violated = static_cast<Index>(i);
            }
        });
    }
    /// Ends a step that has advanced.
    void end() const noexcept {
        for_each([this](const auto& constraint, std::size_t) { constraint.end(context_); });
    }

  private:
    void for_each(auto act) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) {
            context_.select_constraint(i);
            act(constraints_[i], i);
        }
    }

    ConstraintContext<Scalar>& context_;
    std::span<const ConstraintRef<Scalar>> constraints_;
};

/// Attaches a point of a triangle to `target`, by at most `max_force`; the corners are otherwise free. A point on fixed
/// corners, or that other constraints hold, stays off the target by force over stiffness, see `rigid_support.hpp`.
template <Real Scalar>
struct PointAttachment {
    Index triangle = no_index;                                   ///< `no_index`: no attachment
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< vertices of the triangle
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();       ///< of the point
    Vector3<Scalar> target = Vector3<Scalar>::Zero();            ///< [m]
    Scalar max_force = std::numeric_limits<Scalar>::infinity();  ///< [N]

    ///@{
    /// As `Constraint` requires.
    [[nodiscard]] bool valid() const noexcept;
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept {
        return triangle == no_index ? DrivingInput<Scalar>() : InputSample<Scalar>{target};
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>& context) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept;
    ///@}

  private:
    // From the point to the target [m].
    [[nodiscard]] Vector3<Scalar> offset(const ConstraintContext<Scalar>& context,
                                         const ContactPoint<Scalar>& point) const noexcept {
        return target - point_at(triangle_of(context, corners), barycentric) - support_displacement(context, point);
    }
};

/// Attaches a vertex to `target`.
template <Real Scalar>
struct VertexAttachment {
    Index vertex;            ///< that is attached
    Vector3<Scalar> target;  ///< [m]

    ///@{
    /// As `Constraint` requires.
    [[nodiscard]] bool valid() const noexcept { return is_finite(target); }
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept { return InputSample<Scalar>{target}; }
    void prescribe(ConstraintContext<Scalar>& context) const noexcept {
        if (context.validate(vertex)) context.prescribe(vertex, target);
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept {
        return context.residual_force(vertex);
    }
    ///@}
};

/// Fixes vertices at their positions, which are the caller's to move: a force enters the membrane beside those that
/// have moved since the last step. Otherwise they seed no queue. The reaction is the sum over the vertices.
struct PinnedVertices {
    std::span<const Index> vertices;  ///< owned by the caller

    ///@{
    /// As `Constraint` requires.
    [[nodiscard]] bool valid() const noexcept { return true; }
    template <Real Scalar>
    void prescribe(ConstraintContext<Scalar>& context) const noexcept;
    template <Real Scalar>
    void begin(ConstraintContext<Scalar>& context) const noexcept {
        prescribe(context);
    }
    template <Real Scalar>
    bool enforce(ConstraintContext<Scalar>&) const noexcept {
        return false;
    }
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept;
    ///@}
};

/// An external force on a point of a triangle, F^ext of [Liu07] (1).
template <Real Scalar>
struct PointLoad {
    std::array<Index, 3> corners;  ///< vertices of the triangle
    Vector3<Scalar> barycentric;   ///< of the point
    Vector3<Scalar> force;         ///< [N]

    ///@{
    /// As `Constraint` requires.
    [[nodiscard]] bool valid() const noexcept;
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept {
        return InputSample<Scalar>{.at = force, .is_force = true};
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>&) const noexcept { return -force; }
    ///@}
};

/// The point that forceps hold follows the tool, by at most the force with which they hold it.
template <Real Scalar>
[[nodiscard]] PointAttachment<Scalar> pull(const Tool<Scalar>& tool, const Grasp<Scalar>& grasp) noexcept {
    return {grasp.triangle, grasp.corners, grasp.barycentric, tool.position + grasp.offset, grasp.holding_force};
}

/// Vertex `v` is attached to `target` [m].
template <class Target>
[[nodiscard]] VertexAttachment<typename Target::Scalar> pull(Index v, const Target& target) noexcept {
    return {v, target};
}

/// `vertices` keep their positions; the span must outlive the step.
[[nodiscard]] inline PinnedVertices pin(std::span<const Index> vertices) noexcept { return {vertices}; }

///@{
/// `force` [N] acts on the point `barycentric` of the triangle with the vertices `corners`.
template <Real Scalar>
[[nodiscard]] PointLoad<Scalar> load(const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric,
                                     const Vector3<Scalar>& force) noexcept {
    return {corners, barycentric, force};
}
template <class Force>
[[nodiscard]] PointLoad<typename Force::Scalar> load(const std::array<Index, 3>& corners,
                                                     const Vector3<typename Force::Scalar>& barycentric,
                                                     const Eigen::MatrixBase<Force>& force) noexcept {
    return {corners, barycentric, force};
}
///@}

namespace detail {

template <Real Scalar>
[[nodiscard]] bool is_barycentric(const Vector3<Scalar>& weights) noexcept {
    const Scalar slack = 16 * std::numeric_limits<Scalar>::epsilon();
    return is_finite(weights) && weights.minCoeff() >= -slack && std::abs(weights.sum() - 1) <= 4 * slack;
}

}  // namespace detail

template <Real Scalar>
bool PointAttachment<Scalar>::valid() const noexcept {
    return triangle == no_index || (detail::is_barycentric(barycentric) && is_finite(target) && max_force >= 0);
}

template <Real Scalar>
void PointAttachment<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (triangle == no_index || !seed_corners(context, corners)) return;
    const Vector3<Scalar> none = Vector3<Scalar>::Zero();
    ContactPoint<Scalar> point{triangle, 0, corners, barycentric, none, none};
    if (const auto* before = context.cached_point(triangle, 0, corners[0])) point.force = before->force;
    point.on_fixed = is_on_fixed(context, corners);
    const Scalar size = norm(point.force);
    if (size > max_force) point.force *= max_force / size;
    add_point_force(context, corners, barycentric, point.force);
    context.add_point(point);
    if (size >= max_force) return;  // it slips: the target is not where the point will be
    allow_motion(context, norm<Scalar>(target - point_at(triangle_of(context, corners), barycentric)));
    sum_support_forces(context, context.constraint() + 1);
    press_in<Scalar>(context, corners, barycentric, offset(context, point));
}

template <Real Scalar>
bool PointAttachment<Scalar>::enforce(ConstraintContext<Scalar>& context) const noexcept {
    bool changed = false;
    for (auto& point : context.points()) {
        if (point.on_fixed) sum_support_forces(context);
        const Vector3<Scalar> by = offset(context, point);
        if (!(norm(by) > negligible_distance(context, point))) continue;
        Vector3<Scalar> more = force_for<Scalar>(context, point, by);
        const Scalar size = norm<Scalar>(point.force + more);
        if (size > max_force) {
            more = (max_force / size) * (point.force + more) - point.force;
            if (!(norm(more) > context.force_tolerance())) continue;
        }
        if (more.isZero(0)) continue;
        change_force<Scalar>(context, point, more);
        changed = true;
    }
    return changed;
}

template <Real Scalar>
Vector3<Scalar> PointAttachment<Scalar>::reaction(const ConstraintContext<Scalar>& context) const noexcept {
    return reaction_at_points(context);
}

template <Real Scalar>
void VertexAttachment<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (!context.validate(vertex)) return;
    context.seed(vertex);
    context.prescribe(vertex, target);
}

template <Real Scalar>
void PinnedVertices::prescribe(ConstraintContext<Scalar>& context) const noexcept {
    for (const Index v : vertices) {
        if (!context.validate(v)) return;
        context.prescribe(v);
    }
}

template <Real Scalar>
Vector3<Scalar> PinnedVertices::reaction(const ConstraintContext<Scalar>& context) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index v : vertices) sum += context.residual_force(v);
    return sum;
}

template <Real Scalar>
bool PointLoad<Scalar>::valid() const noexcept {
    return detail::is_barycentric(barycentric) && is_finite(force);
}

template <Real Scalar>
void PointLoad<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (!seed_corners(context, corners)) return;
    for (std::size_t k = 0; k < 3; ++k)
        context.add_force(corners[k], barycentric[static_cast<Eigen::Index>(k)] * force);
}

}  // namespace membrane
