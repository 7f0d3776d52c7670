// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <type_traits>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/contact/tool.hpp>

/// What a contact looks like once it is known in which triangle it is.
namespace membrane {

/// The contact of a tool that is near triangle `f`, or overlaps it: everything but phase, depth and what is touched.
/// `radius` is the tool's [m], `side` the one it is on; round a border it may have gone to the other.
template <Real Scalar>
[[nodiscard]] Contact<Scalar> contact_in(const LocalSurface<Scalar>& surface,
                                         const std::type_identity_t<ConstPointsRef<Scalar>>& x, Index f,
                                         const Tool<Scalar>& tool, Scalar radius, Scalar side) noexcept;

/// The contact of a point of the tool that went through triangle `f`, there where it did, from `from` to `to` [m]; the
/// gap is that of a tool without radius, and negative if `to` is behind the triangle.
template <Real Scalar>
[[nodiscard]] Contact<Scalar> contact_where_passed(const LocalSurface<Scalar>& surface,
                                                   const std::type_identity_t<ConstPointsRef<Scalar>>& x, Index f,
                                                   const Vector3<Scalar>& barycentric, const Vector3<Scalar>& from,
                                                   const Vector3<Scalar>& to, Scalar side) noexcept;

template <Real Scalar>
Contact<Scalar> contact_in(const LocalSurface<Scalar>& surface, const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                           Index f, const Tool<Scalar>& tool, Scalar radius, Scalar side) noexcept {
    const auto triangle = surface.triangle(x, f);
    auto nearest = surface.nearest(x, f, tool);
    Contact<Scalar> contact;
    contact.side = side;
    contact.axis_point = tool.position + nearest.along * tool.axis;
    Vector3<Scalar> outward = direction<Scalar>(area_vector(triangle), Vector3<Scalar>::Zero());
    if (nearest.on_triangle.squared_distance == 0 && feature_pairs(tool) > 1) {
        // The shaft goes through: what counts is how far its lower end is behind.
        contact.axis_point = tool.position;
        if (side * dot(outward, tool.axis) < 0) contact.axis_point += tool.axis;
        nearest.on_triangle = closest_point(triangle, contact.axis_point);
    } else {
        outward = surface.outward(x, f, nearest.on_triangle.barycentric);
    }
    contact.triangle = f;
    contact.corners = surface.corners(f);
    contact.barycentric = nearest.on_triangle.barycentric;
    contact.point = nearest.on_triangle.point;
    const Vector3<Scalar> reach = contact.axis_point - contact.point;
    if (surface.on_border(f, contact.barycentric)) contact.side = dot(reach, outward) < 0 ? Scalar(-1) : Scalar(1);
    outward *= contact.side;
    const Scalar sign = dot(reach, outward) < 0 ? Scalar(-1) : Scalar(1);
    const Scalar distance = norm(reach);
    contact.gap = sign * distance - radius;
    // At an edge or a corner the normal leads to the tool; the less so the deeper the tool is in, for the way out is up.
    const Vector3<Scalar> up = sign * reach + (std::max)(radius - distance, Scalar(0)) * outward;
    contact.normal = direction(up, outward);
    return contact;
}

template <Real Scalar>
Contact<Scalar> contact_where_passed(const LocalSurface<Scalar>& surface,
                                     const std::type_identity_t<ConstPointsRef<Scalar>>& x, Index f,
                                     const Vector3<Scalar>& barycentric, const Vector3<Scalar>& from,
                                     const Vector3<Scalar>& to, Scalar side) noexcept {
    const auto triangle = surface.triangle(x, f);
    Contact<Scalar> contact;
    contact.triangle = f;
    contact.corners = surface.corners(f);
    contact.barycentric = barycentric;
    contact.point = point_at(triangle, barycentric);
    contact.normal = side * direction<Scalar>(area_vector(triangle), Vector3<Scalar>::Zero());
    contact.side = side;
    contact.previous_axis_point = from;
    contact.axis_point = to;
    contact.gap = dot<Scalar>(contact.normal, to - contact.point);
    contact.tunnelled = true;
    return contact;
}

}  // namespace membrane
