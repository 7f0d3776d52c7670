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
#include <membrane/solve/touch.hpp>

/// What acts on the membrane from outside, as arguments of a step.
///
///     const auto report = solver.step(x, dt, network, backing, press(tool, contact), pull(tool, grasp));
///     report.reactions[0]                                          // force of the membrane on the pressing tool [N]
namespace membrane {

/// Something that acts on the membrane during one step. `begin` names all vertices where its force enters, and puts in
/// place what it holds; `enforce` is called in every sweep once layer 0 has moved, and once more at the end; it mends
/// what they broke and says whether there was anything to mend; `reaction` is the force of the membrane on whoever acts
/// [N]. One that something leads may say where that is, `lead(): Lead<Scalar>`: the next steps are predicted from it. One
/// that holds vertices may do so in `hold(region)`, which is called before any `begin`.
template <class C, class Scalar>
concept Constraint = Real<Scalar> && requires(const C& constraint, Region<Scalar>& region, const Region<Scalar>& done) {
    { constraint.sound() }
    noexcept->std::same_as<bool>;  // else the step is refused
    { constraint.begin(region) }
    noexcept;
    { constraint.enforce(region) }
    noexcept->std::same_as<bool>;
    { constraint.reaction(done) }
    noexcept->std::same_as<Vector3<Scalar>>;
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
        requires(const C& constraint, Region<Scalar>& region) {
            { constraint.begin(region) }
            noexcept;
        },
        "Constraint: there must be begin(Region<Scalar>&) const noexcept");
    static_assert(
        requires(const C& constraint, Region<Scalar>& region) {
            { constraint.enforce(region) }
            noexcept->std::same_as<bool>;
        },
        "Constraint: enforce(Region<Scalar>&) const noexcept must return bool");
    static_assert(
        requires(const C& constraint, const Region<Scalar>& done) {
            { constraint.reaction(done) }
            noexcept->std::same_as<Vector3<Scalar>>;
        },
        "Constraint: reaction(const Region<Scalar>&) const noexcept must return Vector3<Scalar>");
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
    void hold(Region<Scalar>& region) const noexcept { calls_->hold(constraint_, region); }
    void begin(Region<Scalar>& region) const noexcept { calls_->begin(constraint_, region); }
    [[nodiscard]] bool enforce(Region<Scalar>& region) const noexcept { return calls_->enforce(constraint_, region); }
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>& done) const noexcept {
        return calls_->reaction(constraint_, done);
    }

  private:
    struct Calls {
        bool (*sound)(const void*) noexcept;
        Lead<Scalar> (*lead)(const void*) noexcept;
        void (*hold)(const void*, Region<Scalar>&) noexcept;
        void (*begin)(const void*, Region<Scalar>&) noexcept;
        bool (*enforce)(const void*, Region<Scalar>&) noexcept;
        Vector3<Scalar> (*reaction)(const void*, const Region<Scalar>&) noexcept;
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
            [](const void* c, Region<Scalar>& region) noexcept {
                if constexpr (requires { as<C>(c).hold(region); }) as<C>(c).hold(region);
            },
        .begin = [](const void* c, Region<Scalar>& region) noexcept { as<C>(c).begin(region); },
        .enforce = [](const void* c, Region<Scalar>& region) noexcept -> bool { return as<C>(c).enforce(region); },
        .reaction = [](const void* c, const Region<Scalar>& done) noexcept -> Vector3<Scalar> {
            return as<C>(c).reaction(done);
        },
    };

    const void* constraint_;
    const Calls* calls_;
};

/// All constraints of one step, in the order they were handed in.
template <Real Scalar>
class ConstraintSet {
  public:
    ConstraintSet(Region<Scalar>& region, std::span<const ConstraintRef<Scalar>> constraints) noexcept
        : region_(region), constraints_(constraints) {}

    [[nodiscard]] bool sound() const noexcept {
        return std::all_of(constraints_.begin(), constraints_.end(), [](const auto& c) { return c.sound(); });
    }
    /// Where those that are led are led to.
    void tell(std::span<Lead<Scalar>> leads) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) leads[i] = constraints_[i].lead();
    }
    /// Vertices that a constraint holds are fixed for all of them, in whatever order they were handed in.
    void begin() const noexcept {
        for_each([this](const auto& constraint, std::size_t) { constraint.hold(region_); });
        for_each([this](const auto& constraint, std::size_t) {
            region_.open();
            constraint.begin(region_);
        });
    }
    [[nodiscard]] bool enforce() const noexcept {
        bool mended = false;
        for_each([&](const auto& constraint, std::size_t) { mended |= constraint.enforce(region_); });
        return mended;
    }
    /// The forces on those who act; false if any is not finite.
    [[nodiscard]] bool react(std::span<Vector3<Scalar>> reactions) const noexcept {
        bool finite = true;
        for_each([&](const auto& constraint, std::size_t i) {
            reactions[i] = constraint.reaction(region_);
            finite &= is_finite(reactions[i]);
        });
        return finite;
    }

  private:
    void for_each(auto act) const noexcept {
        for (std::size_t i = 0; i < constraints_.size(); ++i) {
            region_.turn_to(i);
            act(constraints_[i], i);
        }
    }

    Region<Scalar>& region_;
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
    void begin(Region<Scalar>& region) const noexcept;
    bool enforce(Region<Scalar>& region) const noexcept;
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>& region) const noexcept;
};

/// Holds a vertex at `target`.
template <Real Scalar>
struct HeldVertex {
    Index vertex;
    Vector3<Scalar> target;  ///< [m]

    [[nodiscard]] bool sound() const noexcept { return is_finite(target); }
    [[nodiscard]] Lead<Scalar> lead() const noexcept { return LeadPoint<Scalar>{target}; }
    void hold(Region<Scalar>& region) const noexcept {
        if (region.check(vertex)) region.hold(vertex, target);
    }
    void begin(Region<Scalar>& region) const noexcept;
    bool enforce(Region<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>& region) const noexcept {
        return region.unbalanced(vertex);
    }
};

/// Holds vertices where they are. No force enters there: they seed no queue. Their reactions add up.
struct Pinned {
    std::span<const Index> vertices;  ///< of the caller

    [[nodiscard]] bool sound() const noexcept { return true; }
    template <Real Scalar>
    void hold(Region<Scalar>& region) const noexcept;
    template <Real Scalar>
    void begin(Region<Scalar>& region) const noexcept {
        hold(region);
    }
    template <Real Scalar>
    bool enforce(Region<Scalar>&) const noexcept {
        return false;
    }
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>& region) const noexcept;
};

/// An external force on a point of a triangle, F^ext of [Liu07] (1).
template <Real Scalar>
struct Load {
    std::array<Index, 3> corners;
    Vector3<Scalar> barycentric;
    Vector3<Scalar> force;  ///< [N]

    [[nodiscard]] bool sound() const noexcept;
    [[nodiscard]] Lead<Scalar> lead() const noexcept { return LeadPoint<Scalar>{.at = force, .is_force = true}; }
    void begin(Region<Scalar>& region) const noexcept;
    bool enforce(Region<Scalar>&) const noexcept { return false; }
    [[nodiscard]] Vector3<Scalar> reaction(const Region<Scalar>&) const noexcept { return -force; }
};

/// What forceps hold follows the tool.
template <Real Scalar>
[[nodiscard]] HeldPoint<Scalar> pull(const Tool<Scalar>& tool, const Grasp<Scalar>& grasp) noexcept {
    return {grasp.triangle, grasp.corners, grasp.barycentric, tool.position + grasp.offset};
}

/// Vertex `v` is held at `target` [m].
template <class Target>
[[nodiscard]] HeldVertex<typename Target::Scalar> pull(Index v, const Eigen::MatrixBase<Target>& target) noexcept {
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
void HeldPoint<Scalar>::begin(Region<Scalar>& region) const noexcept {
    if (triangle == no_index || !seed_corners(region, corners)) return;
    const Vector3<Scalar> none = Vector3<Scalar>::Zero();
    Touch<Scalar> touch{triangle, 0, corners, barycentric, none, none, none};
    if (const auto* before = region.recall(triangle, 0)) touch.force = before->force;
    push_point(region, corners, barycentric, touch.force);
    region.remember(touch);
    const Vector3<Scalar> now = point_at(triangle_of(region, corners), barycentric);
    shift_point<Scalar>(region, corners, barycentric, target - now);
}

template <Real Scalar>
bool HeldPoint<Scalar>::enforce(Region<Scalar>& region) const noexcept {
    bool changed = false;
    for (auto& touch : region.touches()) {
        const Vector3<Scalar> now = point_at(triangle_of(region, corners), barycentric);
        if (!(norm<Scalar>(target - now) > negligible_shift(region, touch))) continue;
        const Vector3<Scalar> more = force_for<Scalar>(region, touch, target - now);
        if (more.isZero(0)) continue;
        change_force(region, touch, more);
        changed = true;
    }
    return changed;
}

template <Real Scalar>
Vector3<Scalar> HeldPoint<Scalar>::reaction(const Region<Scalar>& region) const noexcept {
    return reaction_of_touches(region);
}

template <Real Scalar>
void HeldVertex<Scalar>::begin(Region<Scalar>& region) const noexcept {
    if (!region.check(vertex)) return;
    region.seed(vertex);
    region.hold(vertex, target);
}

template <Real Scalar>
void Pinned::hold(Region<Scalar>& region) const noexcept {
    for (const Index v : vertices) {
        if (!region.check(v)) return;
        region.hold(v);
    }
}

template <Real Scalar>
Vector3<Scalar> Pinned::reaction(const Region<Scalar>& region) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index v : vertices) sum += region.unbalanced(v);
    return sum;
}

template <Real Scalar>
bool Load<Scalar>::sound() const noexcept {
    return detail::is_barycentric(barycentric) && is_finite(force);
}

template <Real Scalar>
void Load<Scalar>::begin(Region<Scalar>& region) const noexcept {
    if (seed_corners(region, corners)) push_point(region, corners, barycentric, force);
}

}  // namespace membrane
