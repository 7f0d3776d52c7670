// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/collision/grasper.hpp>
#include <membrane/collision/tool.hpp>
#include <membrane/solve/predictor.hpp>
#include <membrane/solve/surface_point.hpp>

/// What acts on the membrane from outside, as arguments of a step.
///
///     const auto report = solver.step(x, dt, network, backing, press(tool, contact), pull(tool, grasp));
///     report.reactions[0]                                          // force of the membrane on the pressing tool [N]
namespace membrane {

/// Something that acts on the membrane during one step. `begin` names all vertices where its force enters, and puts in
/// place what it holds; `enforce` is called after each update of layer 0, and once more at the end where vertices have
/// moved since; it restores what they broke and says whether there was anything to restore; `reaction` is the force of the membrane on it
/// [N]. One that something leads may say where that is, `lead(): Lead<Scalar>`: the next steps are predicted from it. One
/// that holds vertices may do so in `hold(context)`, which is called before any `begin`.
template <class C, class Scalar>
concept Constraint = Real<Scalar> &&
    requires(const C& constraint, ConstraintContext<Scalar>& context, const ConstraintContext<Scalar>& done) {
    { constraint.sound() }
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
            { constraint.sound() }
            noexcept->std::same_as<bool>;
        },
        "Constraint: sound() const noexcept must return bool");
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

/// A `Constraint`; where it is none, the error says what is missing.
template <class C, class Scalar>
concept CheckedConstraint = detail::check_constraint<C, Scalar>();

/// A constraint of any type, which must outlive this: what a step does depends on no type of constraint.
template <Real Scalar>
class ConstraintRef {
  public:
    template <Constraint<Scalar> C>
    explicit ConstraintRef(const C& constraint) noexcept : constraint_(&constraint), calls_(&calls_of<C>) {}

    [[nodiscard]] bool sound() const noexcept { return calls_->sound(constraint_); }
    [[nodiscard]] Lead<Scalar> lead() const noexcept { return calls_->lead(constraint_); }
    void hold(ConstraintContext<Scalar>& context) const noexcept { calls_->hold(constraint_, context); }
    void begin(ConstraintContext<Scalar>& context) const noexcept { calls_->begin(constraint_, context); }
    [[nodiscard]] bool enforce(ConstraintContext<Scalar>& context) const noexcept {
        return calls_->enforce(constraint_, context);
    }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& done) const noexcept {
        return calls_->reaction(constraint_, done);
    }

  private:
    struct Calls {
        bool (*sound)(const void*) noexcept;
        Lead<Scalar> (*lead)(const void*) noexcept;
        void (*hold)(const void*, ConstraintContext<Scalar>&) noexcept;
        void (*begin)(const void*, ConstraintContext<Scalar>&) noexcept;
        bool (*enforce)(const void*, ConstraintContext<Scalar>&) noexcept;
        Vector3<Scalar> (*reaction)(const void*, const ConstraintContext<Scalar>&) noexcept;
    };
    template <class C>
    [[nodiscard]] static const C& as(const void* constraint) noexcept {
        return *static_cast<const C*>(constraint);
    }
    template <class C>
    static constexpr Calls calls_of{
        .sound = [](const void* c) noexcept -> bool { return as<C>(c).sound(); },
        .lead = [](const void* c) noexcept -> Lead<Scalar> {
            if constexpr (requires { as<C>(c).lead(); }) return as<C>(c).lead();
            return {};
        },
        .hold =
            [](const void* c, ConstraintContext<Scalar>& context) noexcept {
                if constexpr (requires { as<C>(c).hold(context); }) as<C>(c).hold(context);
            },
        .begin = [](const void* c, ConstraintContext<Scalar>& context) noexcept { as<C>(c).begin(context); },
        .enforce = [](const void* c, ConstraintContext<Scalar>& context) noexcept -> bool {
            return as<C>(c).enforce(context);
        },
        .reaction = [](const void* c, const ConstraintContext<Scalar>& done) noexcept -> Vector3<Scalar> {
            return as<C>(c).reaction(done);
        },
    };

    const void* constraint_;
    const Calls* calls_;
};

/// All constraints of one step, in the order they were handed in.
template <Real Scalar>
class ConstraintList {
  public:
    ConstraintList(ConstraintContext<Scalar>& context, std::span<const ConstraintRef<Scalar>> constraints) noexcept
        : context_(context), constraints_(constraints) {}

    [[nodiscard]] bool sound() const noexcept {
        return std::all_of(constraints_.begin(), constraints_.end(), [](const auto& c) { return c.sound(); });
    }
    /// Where those that are led are led to.
    void collect_leads(std::span<Lead<Scalar>> leads) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) leads[i] = constraints_[i].lead();
    }
    /// Vertices that a constraint holds are fixed for all of them, in whatever order they were handed in.
    void begin() const noexcept {
        for_each([this](const auto& constraint, std::size_t) { constraint.hold(context_); });
        for_each([this](const auto& constraint, std::size_t) {
            context_.begin_points();
            constraint.begin(context_);
        });
    }
    [[nodiscard]] bool enforce() const noexcept {
        bool changed = false;
        for_each([&](const auto& constraint, std::size_t) { changed |= constraint.enforce(context_); });
        return changed;
    }
    /// The forces on those who act; false if any is not finite. Contact points have what was found of them from here on.
    [[nodiscard]] bool react(std::span<Vector3<Scalar>> reactions) const noexcept {
        auto& state = context_.state();
        state.packs.unpack(state.points.items());
        bool finite = true;
        for_each([&](const auto& constraint, std::size_t i) {
            reactions[i] = constraint.reaction(context_);
            finite &= is_finite(reactions[i]);
        });
        return finite;
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

/// Holds a point of a triangle at `target`; its corners are free otherwise.
template <Real Scalar>
struct HeldPoint {
    Index triangle = no_index;  ///< none: holds nothing
    std::array<Index, 3> corners{no_index, no_index, no_index};
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();
    Vector3<Scalar> target = Vector3<Scalar>::Zero();  ///< [m]

    [[nodiscard]] bool sound() const noexcept;
    [[nodiscard]] Lead<Scalar> lead() const noexcept {
        return triangle == no_index ? Lead<Scalar>() : LeadPoint<Scalar>{target};
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>& context) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept;
};

/// Holds a vertex at `target`.
template <Real Scalar>
struct HeldVertex {
    Index vertex;
    Vector3<Scalar> target;  ///< [m]

    [[nodiscard]] bool sound() const noexcept { return is_finite(target); }
    [[nodiscard]] Lead<Scalar> lead() const noexcept { return LeadPoint<Scalar>{target}; }
    void hold(ConstraintContext<Scalar>& context) const noexcept {
        if (context.check(vertex)) context.prescribe(vertex, target);
    }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept {
        return context.residual_force(vertex);
    }
};

/// Holds vertices where they are. No force enters there: they seed no queue. Their reactions add up.
struct Pinned {
    std::span<const Index> vertices;  ///< of the caller

    [[nodiscard]] bool sound() const noexcept { return true; }
    template <Real Scalar>
    void hold(ConstraintContext<Scalar>& context) const noexcept;
    template <Real Scalar>
    void begin(ConstraintContext<Scalar>& context) const noexcept {
        hold(context);
    }
    template <Real Scalar>
    bool enforce(ConstraintContext<Scalar>&) const noexcept {
        return false;
    }
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept;
};

/// An external force on a point of a triangle, F^ext of [Liu07] (1).
template <Real Scalar>
struct Load {
    std::array<Index, 3> corners;
    Vector3<Scalar> barycentric;
    Vector3<Scalar> force;  ///< [N]

    [[nodiscard]] bool sound() const noexcept;
    [[nodiscard]] Lead<Scalar> lead() const noexcept { return LeadPoint<Scalar>{.at = force, .is_force = true}; }
    void begin(ConstraintContext<Scalar>& context) const noexcept;
    bool enforce(ConstraintContext<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>&) const noexcept { return -force; }
};

/// What forceps hold follows the tool.
template <Real Scalar>
[[nodiscard]] HeldPoint<Scalar> pull(const Tool<Scalar>& tool, const Grasp<Scalar>& grasp) noexcept {
    return {grasp.triangle, grasp.corners, grasp.barycentric, tool.position + grasp.offset};
}

/// Vertex `v` is held at `target` [m].
template <class Target>
[[nodiscard]] HeldVertex<typename Target::Scalar> pull(Index v, const Target& target) noexcept {
    return {v, target};
}

/// `vertices` stay where they are; the span must outlive the step.
[[nodiscard]] inline Pinned pin(std::span<const Index> vertices) noexcept { return {vertices}; }

/// `force` [N] acts on the point `barycentric` of the triangle with the vertices `corners`.
template <Real Scalar>
[[nodiscard]] Load<Scalar> load(const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric,
                                const Vector3<Scalar>& force) noexcept {
    return {corners, barycentric, force};
}
template <class Force>
[[nodiscard]] Load<typename Force::Scalar> load(const std::array<Index, 3>& corners,
                                                const Vector3<typename Force::Scalar>& barycentric,
                                                const Eigen::MatrixBase<Force>& force) noexcept {
    return {corners, barycentric, force};
}

namespace detail {

template <Real Scalar>
[[nodiscard]] bool is_barycentric(const Vector3<Scalar>& weights) noexcept {
    const Scalar slack = 16 * std::numeric_limits<Scalar>::epsilon();
    return is_finite(weights) && weights.minCoeff() >= -slack && std::abs(weights.sum() - 1) <= 4 * slack;
}

}  // namespace detail

template <Real Scalar>
bool HeldPoint<Scalar>::sound() const noexcept {
    return triangle == no_index || (detail::is_barycentric(barycentric) && is_finite(target));
}

template <Real Scalar>
void HeldPoint<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (triangle == no_index || !seed_corners(context, corners)) return;
    const Vector3<Scalar> none = Vector3<Scalar>::Zero();
    ContactPoint<Scalar> point{triangle, 0, corners, barycentric, none, none};
    if (const auto* before = context.cached_point(triangle, 0, corners[0])) point.force = before->force;
    add_point_force(context, corners, barycentric, point.force);
    context.add_point(point);
    const Vector3<Scalar> now = point_at(triangle_of(context, corners), barycentric);
    move_point<Scalar>(context, corners, barycentric, target - now);
}

template <Real Scalar>
bool HeldPoint<Scalar>::enforce(ConstraintContext<Scalar>& context) const noexcept {
    bool changed = false;
    for (auto& point : context.points()) {
        const Vector3<Scalar> now = point_at(triangle_of(context, corners), barycentric);
        if (!(norm<Scalar>(target - now) > negligible_distance(context, point))) continue;
        const Vector3<Scalar> more = force_for<Scalar>(context, point, target - now);
        if (more.isZero(0)) continue;
        change_force(context, point, more);
        changed = true;
    }
    return changed;
}

template <Real Scalar>
Vector3<Scalar> HeldPoint<Scalar>::reaction(const ConstraintContext<Scalar>& context) const noexcept {
    return reaction_at_points(context);
}

template <Real Scalar>
void HeldVertex<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (!context.check(vertex)) return;
    context.seed(vertex);
    context.prescribe(vertex, target);
}

template <Real Scalar>
void Pinned::hold(ConstraintContext<Scalar>& context) const noexcept {
    for (const Index v : vertices) {
        if (!context.check(v)) return;
        context.prescribe(v);
    }
}

template <Real Scalar>
Vector3<Scalar> Pinned::reaction(const ConstraintContext<Scalar>& context) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index v : vertices) sum += context.residual_force(v);
    return sum;
}

template <Real Scalar>
bool Load<Scalar>::sound() const noexcept {
    return detail::is_barycentric(barycentric) && is_finite(force);
}

template <Real Scalar>
void Load<Scalar>::begin(ConstraintContext<Scalar>& context) const noexcept {
    if (seed_corners(context, corners)) add_point_force(context, corners, barycentric, force);
}

}  // namespace membrane
