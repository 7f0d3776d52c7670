// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <type_traits>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/contact/tool.hpp>

/// Geometry of a contact in a given triangle.
namespace membrane {

/// The contact of a tool near triangle `f` or in penetration, without phase, depth, points, triangles and candidates.
/// `radius` is the tool's [m], `side` its side of the surface; beside a border the contact may be on the other side.
template <Real Scalar>
[[nodiscard]] Contact<Scalar> contact_in(const LocalSurface<Scalar>& surface,
                                         const std::type_identity_t<ConstPointsRef<Scalar>>& x, Index f,
                                         const Tool<Scalar>& tool, Scalar radius, Scalar side) noexcept;

/// The contact of a point of the tool that passed through triangle `f` at `barycentric`, from `from` to `to` [m]. The
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
    auto nearest = closest_to_axis(triangle, tool);
    Contact<Scalar> contact;
    contact.patch.side = side;
    contact.patch.axis_point = tool.position + nearest.fraction * tool.axis;
    Vector3<Scalar> outward = direction<Scalar>(area_vector(triangle), Vector3<Scalar>::Zero());
    if (nearest.on_triangle.squared_distance == 0 && is_shaft(tool)) {
        // The shaft passes through the triangle: the gap is that of its lower end, if that is not beyond the border.
        const bool is_second = side * dot(outward, tool.axis) < 0;
        const Vector3<Scalar> end = is_second ? Vector3<Scalar>(tool.position + tool.axis) : tool.position;
        const Index g = surface.closed() ? f : surface.walk_to_closest(x, f, end);
        if (!surface.on_border(g, closest_point(surface.triangle(x, g), end).barycentric)) {
            contact.patch.axis_point = end;
            nearest.on_triangle = closest_point(triangle, end);
        }
    } else {
        outward = surface.outward(x, f, nearest.on_triangle.barycentric);
    }
    contact.triangle = f;
    contact.corners = surface.corners(f);
    contact.barycentric = nearest.on_triangle.barycentric;
    contact.point = nearest.on_triangle.point;
    const Vector3<Scalar> separation = contact.patch.axis_point - contact.point;
    if (surface.on_border(f, contact.barycentric))
        contact.patch.side = dot(separation, outward) < 0 ? Scalar(-1) : Scalar(1);
    outward *= contact.patch.side;
    const Scalar sign = dot(separation, outward) < 0 ? Scalar(-1) : Scalar(1);
    const Scalar distance = norm(separation);
    contact.gap = sign * distance - radius;
    // At an edge or a corner the normal points to the tool. With penetration it turns to `outward`, the shortest exit.
    const Vector3<Scalar> up = sign * separation + (std::max)(radius - distance, Scalar(0)) * outward;
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
    contact.patch.side = side;
    contact.patch.previous_axis_point = from;
    contact.patch.axis_point = to;
    contact.gap = dot<Scalar>(contact.normal, to - contact.point);
    contact.patch.tunnelled = true;
    return contact;
}

}  // namespace membrane
