// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include <membrane/solve/constraint_context.hpp>
#include <membrane/surface/triangle.hpp>

/// What constraints do to a point of a triangle: they add forces to it or move it through the triangle's corners, each in
/// proportion to its barycentric weight.
namespace membrane {

/// The triangle with these vertices where it is now.
template <Real Scalar>
[[nodiscard]] Triangle<Scalar> triangle_of(const ConstraintContext<Scalar>& context,
                                           const std::array<Index, 3>& corners) noexcept {
    return {context.position(corners[0]), context.position(corners[1]), context.position(corners[2])};
}

/// Whether the corners are vertices; if they are, they become seeds, else the step is refused.
template <Real Scalar>
bool seed_corners(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners) noexcept {
    for (const Index v : corners) {
        if (!context.check(v)) return false;
        context.seed(v);
    }
    return true;
}

/// Distributes `force` [N] on the point to the corners.
template <Real Scalar>
void add_point_force(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners,
                     const Vector3<Scalar>& weights, const Vector3<Scalar>& force) noexcept {
    for (std::size_t k = 0; k < 3; ++k) context.add_force(corners[k], weights[static_cast<Eigen::Index>(k)] * force);
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

/// Whether the point hardly moves however far its free corners do: less than a tenth as far. No force moves it then.
template <Real Scalar>
[[nodiscard]] bool is_rigid(const ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners,
                            const Vector3<Scalar>& weights) noexcept {
    return squared_norm(free_weights(context, corners, weights)) < Scalar(0.01);
}

/// Moves the point by a displacement [m], each free corner in proportion to its weight; not if it is rigid.
template <Real Scalar>
void move_point(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners, const Vector3<Scalar>& weights,
                const Vector3<Scalar>& by) noexcept {
    if (is_rigid(context, corners, weights)) return;
    const Vector3<Scalar> free = free_weights(context, corners, weights);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar part = free[static_cast<Eigen::Index>(k)] / squared_norm(free);
        if (part > 0) context.move(corners[k], part * by);
    }
}

/// Moves the free corners as they move where the point goes by a displacement [m] and fixed corners yield as much as free
/// ones: a point on fixed corners stays, and nothing jumps in between.
template <Real Scalar>
void press_in(ConstraintContext<Scalar>& context, const std::array<Index, 3>& corners, const Vector3<Scalar>& weights,
              const Vector3<Scalar>& by) noexcept {
    const Vector3<Scalar> free = free_weights(context, corners, weights);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar part = free[static_cast<Eigen::Index>(k)] / squared_norm(weights);
        if (part > 0) context.move(corners[k], part * by);
    }
}

/// How far the point moves for `force` on it [m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> response_of(const ConstraintContext<Scalar>& context, const ContactPoint<Scalar>& point,
                                          const Vector3<Scalar>& force) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = point.weights[static_cast<Eigen::Index>(k)];
        sum += weight * context.response(point.corners[k], weight * force);
    }
    return sum;
}

/// The force that would move it by a displacement [N]; none where nothing can.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> force_for(const ConstraintContext<Scalar>& context, const ContactPoint<Scalar>& point,
                                        const Vector3<Scalar>& by) noexcept {
    const Vector3<Scalar> x = response_of<Scalar>(context, point, Vector3<Scalar>::UnitX());
    const Vector3<Scalar> y = response_of<Scalar>(context, point, Vector3<Scalar>::UnitY());
    const Vector3<Scalar> z = response_of<Scalar>(context, point, Vector3<Scalar>::UnitZ());
    if (!(x[0] > 0)) return Vector3<Scalar>::Zero();
    const Scalar stiffness = 1 / x[0];  // the determinant of compliances is their cube, and soon out of a float's range
    return inverse(stiffness * Symmetric3<Scalar>{x[0], y[1], z[2], x[1], x[2], y[2]}) * (stiffness * by);
}

/// A distance that is not worth moving a vertex by: what a negligible force does, or a few roundings [m].
template <Real Scalar>
[[nodiscard]] Scalar negligible_distance(const ConstraintContext<Scalar>& context, Index v) noexcept {
    return (std::max)(context.force_tolerance() * context.compliance(v), detail::rounding_at(context.position(v)));
}

/// The same of a point where the springs of all corners resist.
template <Real Scalar>
[[nodiscard]] Scalar negligible_distance(const ConstraintContext<Scalar>& context,
                                         const ContactPoint<Scalar>& point) noexcept {
    Scalar sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = point.weights[static_cast<Eigen::Index>(k)];
        sum += weight * weight * context.compliance(point.corners[k]);
    }
    return (std::max)(context.force_tolerance() * sum, detail::rounding_at(context.position(point.corners[0])));
}

/// Adds `force` [N] to what a point acts with, and lets its corners follow as far as they will for that.
template <Real Scalar>
void change_force(ConstraintContext<Scalar>& context, ContactPoint<Scalar>& point,
                  const Vector3<Scalar>& force) noexcept {
    point.force += force;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<Scalar> part = point.weights[static_cast<Eigen::Index>(k)] * force;
        context.add_force(point.corners[k], part);
        const Vector3<Scalar> by = context.response(point.corners[k], part);
        if (!by.isZero(0)) context.move(point.corners[k], by);
    }
}

/// Adds the part of `force` [N] on the point that its fixed corners take to the force of the tools on these.
template <Real Scalar>
void add_support_forces(ConstraintContext<Scalar>& context, const ContactPoint<Scalar>& point,
                        const Vector3<Scalar>& force) noexcept {
    for (std::size_t k = 0; k < 3 && point.on_fixed; ++k) {
        context.add_support_force(point.corners[k], point.weights[static_cast<Eigen::Index>(k)] * force);
    }
}

/// How far the fixed corners of the point yield to tools [m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> support_displacement(const ConstraintContext<Scalar>& context,
                                                   const ContactPoint<Scalar>& point) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3 && point.on_fixed; ++k) {
        sum += point.weights[static_cast<Eigen::Index>(k)] * context.support_displacement(point.corners[k]);
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
