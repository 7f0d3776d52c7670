// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <span>

#include <membrane/contact/contact_point.hpp>
#include <membrane/core/check.hpp>

namespace membrane {

enum class ContactPhase {
    none,     ///< the tool does not touch
    began,    ///< it touches, and did not in the tick before
    ongoing,  ///< it still touches
    ended,    ///< it touched in the tick before, and does not now
};

/// A triangle that the tool touches.
struct ContactTriangle {
    Index triangle;
    std::array<Index, 3> corners;
};

/// Where the tool touches the membrane, how deep, and since when.
///
///     const auto contact = tracker.update(tree, x, tool);
///     if (contact.touching()) std::printf("depth %g m\n", contact.depth);
template <Real Scalar>
struct Contact {
    ContactPhase phase = ContactPhase::none;
    Index triangle = no_index;                                   ///< the active triangle: the one nearest to the tool
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< its vertices
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();       ///< of the contact point in it
    Vector3<Scalar> point = Vector3<Scalar>::Zero();             ///< the contact point, on the surface as it is now [m]
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();            ///< unit vector from the surface to the tool's side
    Vector3<Scalar> axis_point = Vector3<Scalar>::Zero();        ///< point of the tool's axis nearest to it [m]
    Scalar side = 1;   ///< which side the tool is on: 1 where triangles run counter-clockwise seen from it, else -1
    Scalar gap = 0;    ///< signed distance of the tool to the surface as it is now [m]; negative where it overlaps
    Scalar depth = 0;  ///< how far the tool is inside the surface as it would be without the tool [m], >= 0
    Scalar detection_distance = 0;  ///< triangles up to this far from the tool count as touched [m]
    Scalar radius = 0;              ///< of the tool [m]; a point counts as a small sphere, see `TrackerOptions::margin`
    Vector3<Scalar> previous_axis_point =
        Vector3<Scalar>::Zero();  ///< where `axis_point` was a tick ago, off the surface [m]
    Vector3<Scalar> body_velocity = Vector3<Scalar>::Zero();  ///< of the body there, where it moves [m/s]
    bool tunnelled = false;  ///< the tool's way since the last tick led through the surface at `point`

    // Valid until the tracker's next update.
    std::span<const ContactPoint<Scalar>>
        points;  ///< one for each triangle and feature of the tool within `detection_distance`
    std::span<const ContactTriangle> triangles;   ///< what the tool touches, and what is around the active triangle
    std::span<const ContactTriangle> candidates;  ///< these first, then what is around them
    bool has_all_points = true;  ///< false where there was no room for all: a step with this contact is refused
    bool closed = false;         ///< whether the surface is: what is behind it is inside

    [[nodiscard]] static Contact none() noexcept { return {}; }
    [[nodiscard]] bool touching() const noexcept {
        return phase == ContactPhase::began || phase == ContactPhase::ongoing;
    }
};

/// Whether the numbers of a contact that touches are finite. Its vertices are for those to check who know the mesh.
template <Real Scalar>
[[nodiscard]] bool is_valid(const Contact<Scalar>& contact) noexcept {
    if (!contact.touching()) return true;
    return is_finite(contact.barycentric) && is_finite(contact.point) && is_finite(contact.normal) &&
           is_finite(contact.axis_point) && is_finite(contact.previous_axis_point) && is_finite(contact.gap) &&
           is_finite(contact.detection_distance) && is_finite(contact.radius) && contact.radius > 0;
}

}  // namespace membrane
