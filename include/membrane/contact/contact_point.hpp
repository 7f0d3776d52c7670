// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>

#include <membrane/contact/tool.hpp>

/// Contact points of a surface and a tool.
///
///     for (const auto& point : contact.patch.points) std::printf("gap %g m\n", point.gap);   // found by the tracker
///     for (const auto& point : solver.contact_points(0)) total += point.force;               // after a step [N]
namespace membrane {

/// The feature of a vertex that carries the contact: it is corner 0 of the triangle, with all of the weight.
inline constexpr int vertex_feature = -2;

/// The point of a triangle nearest to one feature of the tool, and the contact force there. The tracker finds it; the
/// solver updates it and sets its force, as does Newton's method for the exact equilibrium.
template <Real Scalar>
struct ContactPoint {
    Index triangle = no_index;  ///< with `feature`, identifies the point across steps
    int feature = 0;            ///< of the tool, see `feature_pairs`; custom constraints may number their points freely
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< vertices of the triangle
    Vector3<Scalar> weights = Vector3<Scalar>::Zero();           ///< barycentric, of the corners
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();  ///< unit vector from the surface to the tool; zero on its axis
    Vector3<Scalar> force = Vector3<Scalar>::Zero();   ///< on the membrane [N]
    bool on_fixed =
        false;  ///< whether a corner is fixed, or shared with a point of another constraint; set by the solver
    bool by_plane = false;  ///< whether the tool is kept on its side of the triangle's plane, not of the triangle only
    Scalar side = 0;        ///< of the triangle, 1 or -1, if the tool is over its interior; 0: as in the last step
    Scalar gap = 0;         ///< signed distance of the tool when the point was found [m]; negative in penetration
    Scalar lift = 0;        ///< least gap: above 0 for a vertex that carries the contact, see `ContactVertices` [m]

    /// The corners that carry the point: all, or the vertex.
    [[nodiscard]] std::span<const Index> vertices() const& noexcept {
        return std::span<const Index>(corners).first(feature == vertex_feature ? 1 : 3);
    }
    void vertices() && = delete;
};

/// The contact point of triangle `f` and a feature of the tool, 0 to `feature_pairs(tool)` - 1, without force. If
/// another feature of the axis is nearest, returns no point. `radius` is the tool's [m].
template <Real Scalar>
[[nodiscard]] std::optional<ContactPoint<Scalar>> contact_point(Index f, const std::array<Index, 3>& corners,
                                                                const Triangle<Scalar>& triangle,
                                                                const Tool<Scalar>& tool, int feature,
                                                                Scalar radius) noexcept {
    const auto nearest = closest_points(triangle, tool, feature);
    if (!nearest) return std::nullopt;
    ContactPoint<Scalar> point{f, feature, corners, nearest->barycentric};
    point.normal = direction(nearest->separation, Vector3<Scalar>::Zero());
    point.gap = norm(nearest->separation) - radius;
    return point;
}

/// Visits the contact points of triangle `f` and all features of the tool, see `contact_point`.
template <Real Scalar, class Visit>
void each_contact_point(Index f, const std::array<Index, 3>& corners, const Triangle<Scalar>& triangle,
                        const Tool<Scalar>& tool, Scalar radius, const Visit& visit) noexcept {
    for (int feature = 0; feature < feature_pairs(tool); ++feature) {
        if (const auto point = contact_point(f, corners, triangle, tool, feature, radius)) visit(*point);
    }
}

/// The contact point of vertex `v`, at `p` [m], a corner of triangle `f` that carries the contact with this lift [m],
/// without force. `radius` is the tool's [m].
template <Real Scalar>
[[nodiscard]] ContactPoint<Scalar> vertex_point(Index v, const Vector3<Scalar>& p, Index f,
                                                std::array<Index, 3> corners, const Tool<Scalar>& tool, Scalar radius,
                                                Scalar lift) noexcept {
    std::rotate(corners.begin(), std::find(corners.begin(), corners.end(), v), corners.end());
    ContactPoint<Scalar> point{f, vertex_feature, corners, {1, 0, 0}};
    const Vector3<Scalar> separation = to_segment(p, tool.position, tool.axis);
    point.normal = direction_or_zero(separation);
    point.gap = norm(separation) - radius;
    point.lift = lift;
    return point;
}

}  // namespace membrane
