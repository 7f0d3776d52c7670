// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <membrane/core/check.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/surface/triangle.hpp>

namespace membrane {

/// The tool that the device moves: a point, a sphere, or a capsule (an instrument's shaft).
///
///     const membrane::Tool<double> tip{.position = {0, 0, 0.011}, .radius = 1e-3};
///     const membrane::Tool<double> shaft{.position = {0, 0, 0.011}, .axis = {0, 0, 0.04}, .radius = 5e-4};
template <Real Scalar>
struct Tool {
    Vector3<Scalar> position =
        Vector3<Scalar>::Zero();  ///< reference point: centre of the sphere, or of the capsule's tip [m]
    Vector3<Scalar> axis =
        Vector3<Scalar>::Zero();  ///< from `position` to the other end of a capsule; zero for a sphere [m]
    Scalar radius = 0;            ///< zero for a point [m]
    Vector3<Scalar> velocity = Vector3<Scalar>::Zero();  ///< of the reference point [m/s]
    Scalar time = 0;                                     ///< [s]
    bool grasping = false;                               ///< whether the forceps are closed
};

/// Whether every number of the tool is finite and the radius not negative.
template <Real Scalar>
[[nodiscard]] bool is_valid(const Tool<Scalar>& tool) noexcept {
    return is_finite(tool.position) && is_finite(tool.axis) && is_finite(tool.velocity) && is_finite(tool.time) &&
           is_finite(tool.radius) && tool.radius >= 0;
}

/// The tool in the frame of a moving body.
template <Real Scalar>
[[nodiscard]] Tool<Scalar> to_body_frame(const Tool<Scalar>& tool, const RigidFrame<Scalar>& body) noexcept {
    Tool<Scalar> seen = tool;
    seen.position = body.point_to_body(tool.position);
    seen.axis = body.vector_to_body(tool.axis);
    seen.velocity = body.velocity_in(tool.velocity, tool.position);
    return seen;
}

/// The nearest points of tool and triangle.
template <Real Scalar>
struct ClosestPoints {
    Vector3<Scalar> barycentric;  ///< of the triangle's point
    Vector3<Scalar> separation;   ///< from that point to the tool's axis [m]; the gap is its length minus the radius
};

/// Whether the axis of the tool has a length: a capsule, such as a shaft.
template <Real Scalar>
[[nodiscard]] bool is_shaft(const Tool<Scalar>& tool) noexcept {
    return !tool.axis.isZero(0);
}

/// The vector from `p` to the nearest point of the segment from `start` to `start` + `axis` [m].
template <Number N>
[[nodiscard]] Vector3<N> to_segment(const Vector3<N>& p, const Vector3<N>& start, const Vector3<N>& axis) noexcept {
    const Vector3<N> to_start = start - p;
    return to_start + detail::fraction<N>(-dot(to_start, axis), squared_norm(axis)) * axis;
}

/// The nearest points of the triangle and the tool's axis.
template <Real Scalar>
[[nodiscard]] SegmentPair<Scalar> closest_to_axis(const Triangle<Scalar>& triangle, const Tool<Scalar>& tool) noexcept {
    if (!is_shaft(tool)) return {0, closest_point(triangle, tool.position)};
    return closest_to_segment<Scalar>(triangle, tool.position, tool.position + tool.axis);
}

/// Number of pairs of features that can be in contact at once: 1 for a sphere; 5 for a capsule, its two ends and its
/// axis across the three edges.
template <Real Scalar>
[[nodiscard]] int feature_pairs(const Tool<Scalar>& tool) noexcept {
    return is_shaft(tool) ? 5 : 1;
}

/// Nearest points of pair `pair`, 0 to `feature_pairs(tool)` - 1: each end of the axis with the triangle, then the axis
/// with each edge. If the axis is nearest to the edge with an end, returns no points: that end has its own pair. Each
/// pair changes smoothly with the positions. If all gaps are positive, the tool is outside the triangle, or its axis
/// runs through the triangle's interior.
template <Real Scalar>
[[nodiscard]] std::optional<ClosestPoints<Scalar>> closest_points(const Triangle<Scalar>& triangle,
                                                                  const Tool<Scalar>& tool, int pair) noexcept;

template <Real Scalar>
std::optional<ClosestPoints<Scalar>> closest_points(const Triangle<Scalar>& triangle, const Tool<Scalar>& tool,
                                                    int pair) noexcept {
    const Vector3<Scalar> other_end = tool.position + tool.axis;
    if (pair < 2) {
        const Vector3<Scalar>& end = pair == 0 ? tool.position : other_end;
        const auto nearest = closest_point(triangle, end);
        return ClosestPoints<Scalar>{nearest.barycentric, end - nearest.point};
    }
    const auto nearest = closest_to_segment(triangle, pair - 2, tool.position, other_end);
    if (!(nearest.fraction > 0 && nearest.fraction < 1)) return std::nullopt;
    const Vector3<Scalar> axis_point = tool.position + nearest.fraction * tool.axis;
    return ClosestPoints<Scalar>{nearest.on_triangle.barycentric, axis_point - nearest.on_triangle.point};
}

}  // namespace membrane
