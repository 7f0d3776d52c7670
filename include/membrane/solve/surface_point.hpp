// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include <membrane/solve/constraint_context.hpp>
#include <membrane/surface/triangle.hpp>

/// Operations of constraints on a point of a triangle: forces and displacements are distributed to the triangle's
/// corners in proportion to their barycentric weights.
namespace membrane {

/// Sums the forces at the points on fixed or shared vertices, see `ContactState`.
template <Real Scalar>
void sum_support_forces(ConstraintContext<Scalar>& context, std::size_t begun = max_constraints) noexcept {
    context.step().contacts.sum_support_forces(context.constraint(), begun);
}

/// The part of the constraint's force on `v` that is opposed, 0 to 1, see `rigid_support.hpp`.
template <Real Scalar>
[[nodiscard]] Scalar opposed_part(const ConstraintContext<Scalar>& context, Index v) noexcept {
    if (context.fixed(v)) return 1;
    const auto& contacts = context.step().contacts;
    const Vector3<Scalar> own = contacts.support_force(v), others = contacts.opposing_force(v);
    const Scalar size = norm(own);
    const Scalar opposing = size > 0 ? (std::max)(-dot(own, others) / size, Scalar(0)) : norm(others);
    return opposing > 0 ? opposing / (size + opposing) : Scalar(0);
}

/// Displacement of a fixed or shared vertex under the constraint: the opposed part of its force over the support
/// stiffness [m]; zero for other vertices.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> support_displacement(const ConstraintContext<Scalar>& context, Index v) noexcept {
    const auto& contacts = context.step().contacts;
    const Scalar stiffness = contacts.support_stiffness(v);
    if (!contacts.pressed_supports.contains(v) || !(stiffness > 0)) return Vector3<Scalar>::Zero();
    return opposed_part(context, v) * contacts.support_force(v) / stiffness;
}

/// Derivative of this displacement by the force [m/N]; zero for other vertices.
template <Real Scalar>
[[nodiscard]] Scalar support_compliance(const ConstraintContext<Scalar>& context, Index v) noexcept {
    const auto& contacts = context.step().contacts;
    const Scalar stiffness = contacts.support_stiffness(v);
    const bool held = context.fixed(v) || contacts.pressed_supports.contains(v);
    if (!held || !(stiffness > 0)) return 0;
    const Scalar part = opposed_part(context, v);
    return part * part / stiffness;
}

/// Vertices shared with the constraint, or beside fixed ones, may move by `distance` in this step [m]: the motion of a
/// tool or a target since the last one, and the violation.
template <Real Scalar>
void allow_motion(ConstraintContext<Scalar>& context, Scalar distance) noexcept {
    Scalar& largest = context.step().contacts.largest_motion;
    largest = (std::max)(largest, distance);
}

/// Moves those of `vertices` that have moved farther than that in this step back to there: a triangle that rocks
/// between two tools may turn over in few passes.
template <Real Scalar>
void limit_motion(ConstraintContext<Scalar>& context, std::span<const Index> vertices) noexcept {
    const Scalar largest = context.step().contacts.largest_motion;
    for (const Index v : vertices) {
        const Vector3<Scalar> by = context.position(v) - context.start(v);
        const Scalar distance = norm(by);
        if (distance > largest && !context.fixed(v))
            context.set_position(v, context.start(v) + (largest / distance) * by);
    }
}

/// The triangle of these vertices at their current positions.
template <Real Scalar>
[[nodiscard]] Triangle<Scalar> triangle_of(const ConstraintContext<Scalar>& context,
                                           const std::array<Index, 3>& corners) noexcept {
    return {context.position(corners[0]), context.position(corners[1]), context.position(corners[2])};
}

/// If all corners are vertices, seeds them and returns true; else the step is refused.
template <Real Scalar>
bool seed_corners(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners) noexcept {
    for (const Index v : corners) {
        if (!context.validate(v)) return false;
        context.seed(v);
    }
    return true;
}

/// Distributes `force` [N] on the point to the corners.
template <Real Scalar>
void add_point_force(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners,
                     const Vector3<Scalar>& weights, const Vector3<Scalar>& force) noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        context.step().add_force(corners[k], weights[static_cast<Eigen::Index>(k)] * force);
    }
}

/// The weights of the corners that are free to move, zero for the others.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> free_weights(const ConstraintContext<Scalar>& context,
                                           const std::array<Index, 3>& corners,
                                           const Vector3<Scalar>& weights) noexcept {
    Vector3<Scalar> free = weights;
    for (std::size_t k = 0; k < 3; ++k) {
        if (context.fixed(corners[k])) free[static_cast<Eigen::Index>(k)] = 0;
    }
    return free;
}

/// Whether a corner is fixed, or was shared by several constraints in the last step.
template <Real Scalar>
[[nodiscard]] bool is_on_fixed(const ConstraintContext<Scalar>& context, std::span<const Index> corners) noexcept {
    return std::any_of(corners.begin(), corners.end(),
                       [&](Index v) { return context.fixed(v) || context.step().contacts.shared.contains(v); });
}

/// Displaces the free corners as if all corners were free and the point moved by a displacement [m]: a point on fixed
/// corners stays, and displacements are continuous in the weights.
template <Real Scalar>
void press_in(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners, const Vector3<Scalar>& weights,
              const Vector3<Scalar>& by) noexcept {
    const Vector3<Scalar> free = free_weights(context, corners, weights);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar part = free[static_cast<Eigen::Index>(k)] / squared_norm(weights);
        if (part > 0) context.move(corners[k], part * by);
    }
}

/// Displacement of the point's fixed and shared corners by a force on it, over the force [m/N].
template <Real Scalar>
[[nodiscard]] Scalar support_compliance(const ConstraintContext<Scalar>& context,
                                        const ContactPoint<Scalar>& point) noexcept {
    Scalar sum = 0;
    for (std::size_t k = 0; k < 3 && point.on_fixed; ++k) {
        const Scalar weight = point.weights[static_cast<Eigen::Index>(k)];
        sum += weight * weight * support_compliance(context, point.corners[k]);
    }
    return sum;
}

/// Response of the point to `force` [m], with the displacement of fixed and shared corners.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> response_of(const ConstraintContext<Scalar>& context, const ContactPoint<Scalar>& point,
                                          const Vector3<Scalar>& force) noexcept {
    Vector3<Scalar> sum = support_compliance(context, point) * force;
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = point.weights[static_cast<Eigen::Index>(k)];
        sum += weight * context.response(point.corners[k], weight * force);
    }
    return sum;
}

/// The force that moves the point by a displacement [N]; zero if no force can.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> force_for(const ConstraintContext<Scalar>& context, const ContactPoint<Scalar>& point,
                                        const Vector3<Scalar>& by) noexcept {
    const Vector3<Scalar> x = response_of<Scalar>(context, point, Vector3<Scalar>::UnitX());
    const Vector3<Scalar> y = response_of<Scalar>(context, point, Vector3<Scalar>::UnitY());
    const Vector3<Scalar> z = response_of<Scalar>(context, point, Vector3<Scalar>::UnitZ());
    if (!(x[0] > 0)) return Vector3<Scalar>::Zero();
    const Scalar stiffness = 1 / x[0];  // scaled: the cubed compliances in a determinant may leave a float's range
    return inverse(stiffness * Symmetric3<Scalar>{x[0], y[1], z[2], x[1], x[2], y[2]}) * (stiffness * by);
}

/// A negligible displacement of a vertex: the response to a negligible force, or a few roundings [m].
template <Real Scalar>
[[nodiscard]] Scalar negligible_distance(const ConstraintContext<Scalar>& context, Index v) noexcept {
    return (std::max)(context.force_tolerance() * context.compliance(v), detail::rounding_at(context.position(v)));
}

/// A negligible displacement of a point, by the compliances of all its corners [m].
template <Real Scalar>
[[nodiscard]] Scalar negligible_distance(const ConstraintContext<Scalar>& context,
                                         const ContactPoint<Scalar>& point) noexcept {
    Scalar sum = support_compliance(context, point);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = point.weights[static_cast<Eigen::Index>(k)];
        sum += weight * weight * context.compliance(point.corners[k]);
    }
    return (std::max)(context.force_tolerance() * sum, detail::rounding_at(context.position(point.corners[0])) / 8);
}

/// Adds `force` [N] to the force of a point, and moves its corners by their response.
template <Real Scalar>
void change_force(ConstraintContext<Scalar>& context, ContactPoint<Scalar>& point,
                  const Vector3<Scalar>& force) noexcept {
    point.force += force;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<Scalar> part = point.weights[static_cast<Eigen::Index>(k)] * force;
        context.step().add_force(point.corners[k], part);
        const Vector3<Scalar> by = context.response(point.corners[k], part);
        if (!by.isZero(0)) context.move(point.corners[k], by);
    }
}

/// Displacement of the point by its fixed and shared corners under the constraint [m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> support_displacement(const ConstraintContext<Scalar>& context,
                                                   const ContactPoint<Scalar>& point) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3 && point.on_fixed; ++k) {
        sum += point.weights[static_cast<Eigen::Index>(k)] * support_displacement(context, point.corners[k]);
    }
    return sum;
}

/// The force of the membrane on the constraint at all its points [N].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> reaction_at_points(const ConstraintContext<Scalar>& context) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const auto& point : context.points()) sum -= point.force;
    return sum;
}

}  // namespace membrane
