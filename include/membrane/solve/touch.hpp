// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include <membrane/mesh/triangle.hpp>
#include <membrane/solve/region.hpp>

/// What constraints do to a point of a triangle: it is pushed, held or shifted by way of the triangle's corners, each in
/// proportion to its barycentric weight.
namespace membrane {

/// The triangle with these vertices where it is now.
template <Real Scalar>
[[nodiscard]] Triangle<Scalar> triangle_of(const Region<Scalar>& region, const std::array<Index, 3>& corners) noexcept {
    return {region.position(corners[0]), region.position(corners[1]), region.position(corners[2])};
}

/// The same as a tool finds it.
template <Real Scalar>
[[nodiscard]] Triangle<Scalar> surface_triangle(const Region<Scalar>& region,
                                                const std::array<Index, 3>& corners) noexcept {
    return {region.surface_position(corners[0]), region.surface_position(corners[1]),
            region.surface_position(corners[2])};
}

/// And as it found it where its vertices were kept.
template <Real Scalar>
[[nodiscard]] Triangle<Scalar> kept_surface_triangle(const Region<Scalar>& region,
                                                     const std::array<Index, 3>& corners) noexcept {
    const auto kept = [&](Index v) { return Vector3<Scalar>(region.kept(v) + region.yielding(v)); };
    return {kept(corners[0]), kept(corners[1]), kept(corners[2])};
}

/// Whether the corners are vertices; if they are, they become seeds, else the step is refused.
template <Real Scalar>
bool seed_corners(Region<Scalar>& region, const std::array<Index, 3>& corners) noexcept {
    for (const Index v : corners) {
        if (!region.check(v)) return false;
        region.seed(v);
    }
    return true;
}

/// `force` [N] on the point, shared out to the corners.
template <Real Scalar>
void push_point(Region<Scalar>& region, const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric,
                const Vector3<Scalar>& force) noexcept {
    for (std::size_t k = 0; k < 3; ++k) region.push(corners[k], barycentric[static_cast<Eigen::Index>(k)] * force);
}

/// The weights of the corners that are free to move, zero for the others.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> free_weights(const Region<Scalar>& region, const std::array<Index, 3>& corners,
                                           const Vector3<Scalar>& barycentric) noexcept {
    Vector3<Scalar> weights = barycentric;
    for (std::size_t k = 0; k < 3; ++k) {
        if (region.fixed(corners[k])) weights[static_cast<Eigen::Index>(k)] = 0;
    }
    return weights;
}

/// Whether the point hardly moves however far its free corners do: less than a tenth as far. No force makes it give way.
template <Real Scalar>
[[nodiscard]] bool is_rigid(const Region<Scalar>& region, const std::array<Index, 3>& corners,
                            const Vector3<Scalar>& barycentric) noexcept {
    return squared_norm(free_weights(region, corners, barycentric)) < Scalar(0.01);
}

/// Moves the point by `way` [m], each free corner in proportion to its weight; not if it is rigid.
template <Real Scalar>
void shift_point(Region<Scalar>& region, const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric,
                 const Vector3<Scalar>& way) noexcept {
    if (is_rigid(region, corners, barycentric)) return;
    const Vector3<Scalar> weights = free_weights(region, corners, barycentric);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar part = weights[static_cast<Eigen::Index>(k)] / squared_norm(weights);
        if (part > 0) region.shift(corners[k], part * way);
    }
}

/// Moves the free corners as they move where the point goes by `way` [m] and fixed corners yield as much as free ones: a
/// point on fixed corners stays, and nothing jumps on the way there.
template <Real Scalar>
void press_in(Region<Scalar>& region, const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric,
              const Vector3<Scalar>& way) noexcept {
    const Vector3<Scalar> weights = free_weights(region, corners, barycentric);
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar part = weights[static_cast<Eigen::Index>(k)] / squared_norm(barycentric);
        if (part > 0) region.shift(corners[k], part * way);
    }
}

/// How far the touched point moves for `force` on it [m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> answer_of(const Region<Scalar>& region, const Touch<Scalar>& touch,
                                        const Vector3<Scalar>& force) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = touch.barycentric[static_cast<Eigen::Index>(k)];
        sum += weight * region.answer(touch.corners[k], weight * force);
    }
    return sum;
}

/// A distance that is not worth moving a vertex by: what a negligible force does, or a few roundings [m].
template <Real Scalar>
[[nodiscard]] Scalar negligible_shift(const Region<Scalar>& region, Index v) noexcept {
    return (std::max)(region.negligible_force() * region.compliance(v), detail::rounding_at(region.position(v)));
}

/// The same of the touched point where all springs resist.
template <Real Scalar>
[[nodiscard]] Scalar negligible_shift(const Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    Scalar sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Scalar weight = touch.barycentric[static_cast<Eigen::Index>(k)];
        sum += weight * weight * region.compliance(touch.corners[k]);
    }
    return (std::max)(region.negligible_force() * sum, detail::rounding_at(region.position(touch.corners[0])));
}

/// How far it moves along its normal for each newton along that [m/N].
template <Real Scalar>
[[nodiscard]] Scalar compliance_of(const Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    return dot(touch.normal, answer_of(region, touch, touch.normal));
}

/// How far a tool gets into it for each newton where fixed corners bear it [m/N]: they yield as springs of their support
/// stiffness do, though they stay in their place.
template <Real Scalar>
[[nodiscard]] Scalar support_compliance_of(const Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    Scalar sum = 0;
    for (std::size_t k = 0; k < 3 && touch.on_fixed; ++k) {
        const Scalar weight = touch.barycentric[static_cast<Eigen::Index>(k)];
        sum += weight * weight * region.support_compliance(touch.corners[k]);
    }
    return sum;
}

/// How far the fixed corners of the touched point yield to tools [m].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> yielding_of(const Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3 && touch.on_fixed; ++k) {
        sum += touch.barycentric[static_cast<Eigen::Index>(k)] * region.yielding(touch.corners[k]);
    }
    return sum;
}

/// The force that would move it by `way` [N]; none where nothing can.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> force_for(const Region<Scalar>& region, const Touch<Scalar>& touch,
                                        const Vector3<Scalar>& way) noexcept {
    const Vector3<Scalar> x = answer_of<Scalar>(region, touch, Vector3<Scalar>::UnitX());
    const Vector3<Scalar> y = answer_of<Scalar>(region, touch, Vector3<Scalar>::UnitY());
    const Vector3<Scalar> z = answer_of<Scalar>(region, touch, Vector3<Scalar>::UnitZ());
    if (!(x[0] > 0)) return Vector3<Scalar>::Zero();
    const Scalar stiffness = 1 / x[0];  // the determinant of compliances is their cube, and soon out of a float's range
    return inverse(stiffness * Symmetric3<Scalar>{x[0], y[1], z[2], x[1], x[2], y[2]}) * (stiffness * way);
}

/// Adds `force` [N] to what the touched point's fixed corners bear.
template <Real Scalar>
void bear(Region<Scalar>& region, const Touch<Scalar>& touch, const Vector3<Scalar>& force) noexcept {
    for (std::size_t k = 0; k < 3 && touch.on_fixed; ++k) {
        region.bear(touch.corners[k], touch.barycentric[static_cast<Eigen::Index>(k)] * force);
    }
}

/// Brings what the touch does to its corners into the region, and takes it out again.
template <Real Scalar>
void attach(Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    push_point(region, touch.corners, touch.barycentric, touch.force);
    bear(region, touch, touch.force);
    for (std::size_t k = 0; k < 3; ++k) {
        region.stiffen(touch.corners[k], touch.stiffness[static_cast<Eigen::Index>(k)]);
    }
}
template <Real Scalar>
void detach(Region<Scalar>& region, const Touch<Scalar>& touch) noexcept {
    push_point<Scalar>(region, touch.corners, touch.barycentric, -touch.force);
    bear<Scalar>(region, touch, -touch.force);
    for (std::size_t k = 0; k < 3; ++k) {
        region.stiffen(touch.corners[k], -touch.stiffness[static_cast<Eigen::Index>(k)]);
    }
}

/// Adds `force` [N] to what an attached touch acts with, and lets its corners follow as far as they will for that.
template <Real Scalar>
void change_force(Region<Scalar>& region, Touch<Scalar>& touch, const Vector3<Scalar>& force) noexcept {
    touch.force += force;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<Scalar> part = touch.barycentric[static_cast<Eigen::Index>(k)] * force;
        region.push(touch.corners[k], part);
        const Vector3<Scalar> way = region.answer(touch.corners[k], part);
        if (!way.isZero(0)) region.shift(touch.corners[k], way);
    }
}

/// The force of the membrane on whoever touches it in these touches [N].
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> reaction_of_touches(const Region<Scalar>& region) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const auto& touch : region.touches()) sum -= touch.force;
    return sum;
}

}  // namespace membrane
