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
    ConstraintList(ConstrainedStep<Scalar>& step, std::span<const ConstraintRef<Scalar>> constraints) noexcept
        : step_(step), constraints_(constraints) {}

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
        for_each([](const auto& constraint, auto& context) { constraint.prescribe(context); });
        for_each([this](const auto& constraint, auto& context) {
            step_.contacts.begin_points(context.constraint());
            constraint.begin(context);
        });
        step_.contacts.find_shared();
        step_.contacts.place_walls(step_.rows);
    }
    /// Enforces all constraints, in several rounds if they may oppose one another; returns whether one was violated.
    [[nodiscard]] bool enforce() const noexcept {
        constexpr int max_rounds = 8;
        const int rounds = step_.contacts.several_on_fixed ? max_rounds : 1;
        ConstraintContext<Scalar> context(step_);
        bool changed = false;
        bool again = true;
        for (int i = 0; again && i < rounds; ++i) {
            again = false;
            for_each([&](const auto& constraint, auto& of_this) { again |= constraint.enforce(of_this); });
            limit_motion<Scalar>(context, step_.contacts.shared.items());
            changed |= again;
        }
        return changed;
    }
    /// Computes the reactions; returns false if one is not finite. Updates the contact points, stale since `begin`,
    /// from their packs: before `find_violation` and `end`.
    [[nodiscard]] bool react(std::span<Vector3<Scalar>> reactions) const noexcept {
        step_.contacts.packs.unpack(step_.contacts.points.items());
        bool finite = true;
        for_each([&](const auto& constraint, const auto& context) {
            auto& reaction = reactions[context.constraint()] = constraint.reaction(context);
            finite &= is_finite(reaction);
        });
        return finite;
    }
    /// Finds the largest violation, after `react`.
    void find_violation(StepReport<Scalar>& report) const noexcept {
        for_each([&](const auto&, auto& context) {
            if (step_.contacts.several_on_fixed) sum_support_forces(context);
            for (const auto& point : std::as_const(context).points()) {
                if (!point.on_fixed) continue;
                const Scalar violation = (std::max)(norm(support_displacement(context, point)),
                                                    norm(point.force) * support_compliance(context, point));
                if (!(violation > report.violation)) continue;
                report.violation = violation;
                report.violated = static_cast<Index>(context.constraint());
            }
        });
    }
    /// Ends a step that has advanced.
    void end() const noexcept {
        for_each([](const auto& constraint, const auto& context) { constraint.end(context); });
    }

  private:
    void for_each(auto act) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) {
            ConstraintContext<Scalar> context(step_, i);
            act(constraints_[i], context);
        }
    }

    ConstrainedStep<Scalar>& step_;
    std::span<const ConstraintRef<Scalar>> constraints_;
};

}  // namespace membrane
