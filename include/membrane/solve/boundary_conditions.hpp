// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/contact/grasper.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/solve/constraints.hpp>

/// Boundary conditions: constraints that attach points and vertices, pin vertices, or load points.
///
///     const auto report = solver.step(x, dt, network, foundation, pull(tool, grasp), membrane::pin(vertices));
namespace membrane {

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
