// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// A depth and a normal that belong together, so that a force made of them has a potential.
///
///     const auto rest = membrane::RestContact(mesh);
///     device.write(feel({tool, rest(contact, tool), report}));      // for the force; the solver takes the contact itself
namespace membrane {

/// The contact with the surface at rest instead of the deformed one. The depth is measured from the distance to it, the
/// normal is the gradient of that distance, and both depend on where the tool is now and on nothing else. So
/// `SpringDamperForce` is a spring, with the energy stiffness / 2 depth^2, and its damper takes energy: whatever closed
/// path a tool goes along slowly, the hand gets none. The depth of a `ContactTracker`, which is the same, under the normal
/// of the deformed surface gives some on each turn.
///
/// The force is continuous where the tool's centre is outside a convex surface. Where it is deeper, or over a concave
/// edge, the normal jumps between those of the triangles as the tool slides (`ReactionForce` does not jump).
///
/// For `SampledLoop`: the largest slope is the stiffness. The negative one is across the normal: stiffness * depth /
/// distance, from the tool's centre to where the normals around it meet; that is radius - depth at a convex edge or corner,
/// and the radius of curvature more on a smooth surface. A jump, stiffness * depth * 2 sin(half the angle between the
/// normals), is `off_potential`, and has to be less than the device's friction.
///
/// On an open surface the tool must touch (the deformed surface) to be felt, from the side of the contact; where its
/// centre is below the surface, there is no potential nearer to the border than it is deep. A shaft is felt at points
/// along its axis; what it does to a hand that turns it is not felt, and not counted. One for any number of tools and
/// threads.
template <Real Scalar>
class RestContact {
  public:
    /// Cost: O(F log F).
    explicit RestContact(const TriangleMesh<Scalar>& mesh) : at_rest_(mesh.positions()), surface_(mesh), tree_(mesh) {}

    /// Not for the solver. Online. Cost: O(log F) for a sphere, 17 times that for a shaft.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact, const Tool<Scalar>& tool) const noexcept {
        return contact_with(at_rest_, tree_, contact, tool);
    }

    /// The same on a body that moves; `tree` is fitted to its anchors.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact, const Tool<Scalar>& tool,
                                             const AabbTree<Scalar>& tree,
                                             const MovingBody<Scalar>& body) const noexcept {
        auto found = contact_with(body.anchors(), tree, contact, tool);
        if (found.touching()) {
            found.body_velocity = body.velocity_at(tool.position, found.corners, found.barycentric);
        }
        return found;
    }

  private:
    [[nodiscard]] Contact<Scalar> contact_with(const ConstPointsRef<Scalar>& anchors, const AabbTree<Scalar>& tree,
                                               const Contact<Scalar>& contact, const Tool<Scalar>& tool) const noexcept;
    [[nodiscard]] Contact<Scalar> contact_of(const Vector3<Scalar>& q, Scalar side, const AabbTree<Scalar>& tree,
                                             const ConstPointsRef<Scalar>& anchors) const noexcept;

    static constexpr int points_along_shaft = 17;

    Points<Scalar> at_rest_;
    LocalSurface<Scalar> surface_;
    AabbTree<Scalar> tree_;
};

template <Real Scalar>
Contact<Scalar> RestContact<Scalar>::contact_with(const ConstPointsRef<Scalar>& anchors, const AabbTree<Scalar>& tree,
                                                  const Contact<Scalar>& contact,
                                                  const Tool<Scalar>& tool) const noexcept {
    MEMBRANE_ASSERT(anchors.cols() == at_rest_.cols());
    Contact<Scalar> lowest;
    if (!is_valid(tool) || (!surface_.closed() && !contact.touching())) return lowest;
    const Scalar side = surface_.closed() ? Scalar(1) : contact.side;
    const int points = feature_pairs(tool) == 1 ? 1 : points_along_shaft;
    for (int i = 0; i < points; ++i) {
        const Scalar along = points == 1 ? Scalar(0) : static_cast<Scalar>(i) / static_cast<Scalar>(points - 1);
        const auto here = contact_of(tool.position + along * tool.axis, side, tree, anchors);
        if (here.triangle == no_index) continue;
        if (lowest.triangle == no_index || here.gap < lowest.gap) lowest = here;
    }
    if (lowest.triangle == no_index) return lowest;
    lowest.gap -= tool.radius;
    lowest.radius = tool.radius;
    if (!(lowest.gap < 0)) return lowest;
    lowest.depth = -lowest.gap;
    lowest.phase = contact.touching() ? contact.phase : ContactPhase::ongoing;
    return lowest;
}

/// Of a point of the axis.
template <Real Scalar>
Contact<Scalar> RestContact<Scalar>::contact_of(const Vector3<Scalar>& q, Scalar side, const AabbTree<Scalar>& tree,
                                                const ConstPointsRef<Scalar>& anchors) const noexcept {
    const auto nearest = tree.closest_point(anchors, q);
    Contact<Scalar> contact;
    if (nearest.triangle == no_index) return contact;
    contact.triangle = nearest.triangle;
    contact.corners = surface_.corners(nearest.triangle);
    contact.barycentric = nearest.barycentric;
    contact.point = nearest.point;
    contact.axis_point = contact.previous_axis_point = q;
    contact.side = side;
    const Vector3<Scalar> reach = q - nearest.point;
    const Vector3<Scalar> outward = side * surface_.outward(anchors, nearest.triangle, nearest.barycentric);
    // Round a border there is no other side.
    const bool inside = dot(reach, outward) < 0 && !surface_.on_border(nearest.triangle, nearest.barycentric);
    const Scalar sign = inside ? Scalar(-1) : Scalar(1);
    contact.gap = sign * norm(reach);
    const bool on_face = nearest.barycentric.minCoeff() > 0;
    contact.normal = on_face ? outward : direction<Scalar>(sign * reach, outward);
    return contact;
}

}  // namespace membrane
