// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <type_traits>

#include <membrane/contact/contact_point.hpp>
#include <membrane/core/check.hpp>

namespace membrane {

/// Contact in this tick and in the last.
enum class ContactPhase {
    none,     ///< no contact
    began,    ///< contact, but not in the last tick
    ongoing,  ///< contact, and in the last tick too
    ended,    ///< no contact, but contact in the last tick
};

/// A triangle near the tool.
struct ContactTriangle {
    Index triangle;                ///< its index
    std::array<Index, 3> corners;  ///< its vertices
    double lift = 0;               ///< least gap of its face, not above 0, see `ContactVertices` [m]
};

/// The tool and the surface around a contact: what `press`, grasper and smoothing need beside the contact itself.
template <Real Scalar>
struct ContactPatch {
    Vector3<Scalar> axis_point = Vector3<Scalar>::Zero();  ///< of the tool's axis, nearest to the contact point [m]
    Vector3<Scalar> previous_axis_point = Vector3<Scalar>::Zero();  ///< in the last tick, off the surface [m]
    Scalar radius = 0;  ///< of the tool [m]; a point tool counts as a small sphere, see `TrackerOptions::margin`
    Scalar side = 1;    ///< of the tool: 1 if triangles run counter-clockwise seen from it, else -1
    Scalar detection_distance = 0;  ///< triangles this near to the axis are listed as `triangles` [m]
    bool tunnelled = false;         ///< the tool passed through the surface at the contact point since the last tick
    bool closed = false;            ///< whether the surface is closed: its back is its inside
    bool has_all_points = true;     ///< false if `points` exceeded its capacity: a step refuses this contact
    Index splits = no_index;  ///< of a tear, that tracker and tree have followed; a step refuses a contact with fewer

    ///@{
    /// Valid until the tracker's next update: a contact point for each vertex that carries the contact, and for each
    /// pair of a face that does and a tool feature within `detection_distance`; the triangles within it, by the active
    /// one, or on a path through; these and their neighbours; and those of `triangles` whose faces carry the contact.
    std::span<const ContactPoint<Scalar>> points;
    std::span<const ContactTriangle> triangles, candidates, faces;
    ///@}

    double fine_triangles = 0;  ///< of `TrackerOptions`; above 0, vertices may carry the contact
};

/// The contact of the tool with the membrane: position, depth and phase.
///
/// At equilibrium all triangles that press are equally near, and rounding decides which of them is the active one, with
/// its point and normal. Contact points, depth, the solver's forces and what forceps hold do not depend on that.
///
///     const auto contact = tracker.update(tree, x, tool);
///     if (contact.touching()) std::printf("depth %g m\n", contact.depth);
template <Real Scalar>
struct Contact {
    ContactPhase phase = ContactPhase::none;                     ///< since when
    Index triangle = no_index;                                   ///< the active triangle: the one nearest to the tool
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< its vertices
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();       ///< of the contact point
    Vector3<Scalar> point = Vector3<Scalar>::Zero();             ///< the contact point, on the present surface [m]
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();            ///< unit vector from the surface to the tool's side
    Scalar gap = 0;    ///< signed distance of the tool from the present surface [m]; negative in penetration
    Scalar depth = 0;  ///< indentation of the tool below the surface without the tool [m], >= 0
    Vector3<Scalar> body_velocity = Vector3<Scalar>::Zero();  ///< of a moving body at the contact point [m/s]
    ContactPatch<Scalar> patch = {};                          ///< for `press`

    /// No contact: the phase is `none`, there are no triangles and no points.
    [[nodiscard]] static Contact none() noexcept { return {}; }

    /// Whether there is contact in this tick.
    [[nodiscard]] bool touching() const noexcept {
        return phase == ContactPhase::began || phase == ContactPhase::ongoing;
    }
};

/// The radius with which `tool` may be drawn so that no triangle of its contact, drawn at `x` (3 x V [m]) after a step,
/// is inside it: its own, or less where vertices carry the contact and the faces between them cut into it [m]. Online.
/// Cost: linear in the triangles of the contact.
template <Real Scalar>
[[nodiscard]] Scalar drawn_radius(const Tool<Scalar>& tool, const Contact<Scalar>& contact,
                                  const std::type_identity_t<ConstPointsRef<Scalar>>& x) noexcept {
    Scalar square = tool.radius * tool.radius;
    for (const auto& listed : contact.patch.triangles) {
        const auto nearest = closest_to_axis(triangle_at(x, listed.corners), tool);
        square = (std::min)(square, nearest.on_triangle.squared_distance);
    }
    return (std::min)(tool.radius, std::sqrt(square));
}

/// Whether the numbers of a touching contact are finite. The caller checks its vertices against the mesh.
template <Real Scalar>
[[nodiscard]] bool is_valid(const Contact<Scalar>& contact) noexcept {
    if (!contact.touching()) return true;
    const auto& patch = contact.patch;
    return is_finite(contact.barycentric) && is_finite(contact.point) && is_finite(contact.normal) &&
           is_finite(contact.gap) && is_finite(patch.axis_point) && is_finite(patch.previous_axis_point) &&
           is_finite(patch.detection_distance) && is_finite(patch.radius) && patch.radius > 0;
}

}  // namespace membrane
