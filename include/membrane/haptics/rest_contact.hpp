// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// A consistent depth and normal: a spring force of them has a potential.
///
///     const auto rest = membrane::RestContact(mesh);
///     device.write(feel({tool, rest(contact, tool), report}));    // for the force; the solver takes `contact`
namespace membrane {

/// The contact with the surface at rest instead of the deformed surface. The depth is measured by the distance to it,
/// the normal is the gradient of that distance, and both depend only on the present position of the tool. So
/// `SpringDamperForce` is a spring with the energy stiffness / 2 depth^2, and its damper dissipates energy: on a slow
/// closed path the hand gains no energy. A `ContactTracker` has the same depth, but with the normal of the deformed
/// surface a force gives some energy on each turn.
///
/// The force is continuous if the tool's centre is outside a convex surface. If it is deeper, or over a concave edge,
/// the normal jumps between triangles as the tool slides (`ReactionForce` does not jump).
///
/// For `SampledLoop`: the largest slope is the stiffness. The negative slope is across the normal: stiffness * depth /
/// distance, from the tool's centre to the point where the normals around it meet. That distance is radius - depth at a
/// convex edge or corner, and larger by the radius of curvature on a smooth surface. A jump, stiffness * depth * 2
/// sin(half the angle between the normals), counts as `off_potential` and must be less than the device's friction.
///
/// On an open surface the force exists only while the tool is in contact with the deformed surface, from the side of
/// that contact. If the tool's centre is below the surface and nearer to the border than it is deep, there is no
/// potential. A shaft is sampled at points along its axis; its torque on the hand is not rendered and not counted. One
/// instance serves any number of tools and threads.
template <Real Scalar>
class RestContact {
  public:
    /// Cost: O(F log F).
    explicit RestContact(const TriangleMesh<Scalar>& mesh) : at_rest_(mesh.positions()), surface_(mesh), tree_(mesh) {}

    /// For the force, not for the solver. Online. Cost: O(log F) for a sphere, 17 times that for a shaft.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact, const Tool<Scalar>& tool) const noexcept {
        return contact_with(at_rest_, tree_, contact, tool);
    }

    /// The contact on a moving body; `tree` must be fitted to its anchors.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact, const Tool<Scalar>& tool,
                                             const AabbTree<Scalar>& tree,
                                             const MovingBody<Scalar>& body) const noexcept {
        auto found = contact_with(body.anchors(), tree, contact, tool);
        if (found.touching()) {
            found.body_velocity = body.velocity_at(tool.position, found.corners, found.barycentric);
        }
        return found;
    }

    ///@{
    /// A vertex becomes two; a vertex moves at rest. The surface at rest does not part, but where it is torn a tool may
    /// be behind it: from then on it counts as open. Online.
    void split(const VertexSplit& /*split*/) noexcept { torn_ = true; }
    void reshape(const MovedVertex<Scalar>& moved) noexcept {
        at_rest_.col(moved.vertex) = moved.rest;
        tree_.refit(at_rest_, {&moved.vertex, 1});
    }
    ///@}

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.at_rest_, self.torn_);
        if constexpr (Visit::restores) self.tree_.refit(self.at_rest_);
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
    bool torn_ = false;
};

template <Real Scalar>
Contact<Scalar> RestContact<Scalar>::contact_with(const ConstPointsRef<Scalar>& anchors, const AabbTree<Scalar>& tree,
                                                  const Contact<Scalar>& contact,
                                                  const Tool<Scalar>& tool) const noexcept {
    Contact<Scalar> lowest;
    const bool closed = surface_.closed() && !torn_;
    if (anchors.cols() != at_rest_.cols() || !is_valid(tool) || (!closed && !contact.touching())) return lowest;
    const Scalar side = closed ? Scalar(1) : contact.patch.side;
    const int points = is_shaft(tool) ? points_along_shaft : 1;
    for (int i = 0; i < points; ++i) {
        const Scalar along = points == 1 ? Scalar(0) : static_cast<Scalar>(i) / static_cast<Scalar>(points - 1);
        const auto here = contact_of(tool.position + along * tool.axis, side, tree, anchors);
        if (here.triangle == no_index) continue;
        if (lowest.triangle == no_index || here.gap < lowest.gap) lowest = here;
    }
    if (lowest.triangle == no_index) return lowest;
    lowest.gap -= tool.radius;
    lowest.patch.radius = tool.radius;
    if (!(lowest.gap < 0)) return lowest;
    lowest.depth = -lowest.gap;
    lowest.phase = contact.touching() ? contact.phase : ContactPhase::ongoing;
    return lowest;
}

/// The contact of a point `q` of the axis.
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
    contact.patch.axis_point = contact.patch.previous_axis_point = q;
    contact.patch.side = side;
    const Vector3<Scalar> separation = q - nearest.point;
    const Vector3<Scalar> outward = side * surface_.outward(anchors, nearest.triangle, nearest.barycentric);
    // Beyond a border there is no inside.
    const bool inside = dot(separation, outward) < 0 && !surface_.on_border(nearest.triangle, nearest.barycentric);
    const Scalar sign = inside ? Scalar(-1) : Scalar(1);
    contact.gap = sign * norm(separation);
    const bool on_face = nearest.barycentric.minCoeff() > 0;
    contact.normal = on_face ? outward : direction<Scalar>(sign * separation, outward);
    return contact;
}

}  // namespace membrane
