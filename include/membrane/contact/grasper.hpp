// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Forceps: the held point, from closing to opening.
///
///     auto grasper = membrane::Grasper(mesh);
///     const auto grasp  = grasper.update(contact, x, tool);
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
namespace membrane {

template <Real Scalar>
class MovingBody;  // of surface/moving_body.hpp, which the update on a moving body needs

/// A point of the membrane that moves with the tool.
template <Real Scalar>
struct Grasp {
    Index triangle = no_index;                                   ///< `no_index`: no point is held
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< its vertices
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();       ///< of the held point
    Vector3<Scalar> offset = Vector3<Scalar>::Zero();            ///< from the tool to the held point [m]
    Vector3<Scalar> origin = Vector3<Scalar>::Zero();            ///< of the held point, on the rest surface [m]
    Vector3<Scalar> body_velocity = Vector3<Scalar>::Zero();     ///< of a moving body at the held point [m/s]

    /// Whether a point is held.
    [[nodiscard]] bool holding() const noexcept { return triangle != no_index; }

    /// Displacement of the held point from `origin` [m]. @pre holding()
    [[nodiscard]] Vector3<Scalar> displacement(const Tool<Scalar>& tool) const noexcept {
        return tool.position + offset - origin;
    }
};

/// How forceps grasp.
struct GraspOptions {
    bool snap_to_vertex = false;  ///< hold the corner of largest weight, not the contact point
};

/// Holds the contact point from when the tool closes in contact until it opens.
template <Real Scalar>
class Grasper {
  public:
    /// Keeps a copy of the positions of `mesh`, the rest surface. Cost: O(V).
    explicit Grasper(const TriangleMesh<Scalar>& mesh, GraspOptions options = {})
        : origins_(mesh.positions()), options_(options) {}

    /// The present grasp. Forceps that closed before the contact hold no point; those that are closed at the first
    /// update count as closing then.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool) noexcept;

    /// The present grasp on a moving body: the held point follows the tool, and the body's rotation turns `offset`.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept;

    /// Drops the held point and the closed state. Later grasps equal those of a new grasper, bit for bit.
    void reset() noexcept {
        grasp_ = {};
        pose_ = {};
        closed_ = false;
    }

    /// Visits what is kept from tick to tick, see `core/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.grasp_, self.pose_, self.closed_);
    }

  private:
    Points<Scalar> origins_;
    GraspOptions options_;
    Grasp<Scalar> grasp_;
    RigidFrame<Scalar> pose_;  // of the body at the last update
    bool closed_ = false;
};

template <Real Scalar>
Grasp<Scalar> Grasper<Scalar>::update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                      const Tool<Scalar>& tool) noexcept {
    const bool closes = tool.grasping && !closed_;
    closed_ = tool.grasping;
    if (!tool.grasping) grasp_ = {};
    if (!closes || !contact.touching() || !is_valid(tool)) return grasp_;

    grasp_.triangle = contact.triangle;
    grasp_.corners = contact.corners;
    grasp_.barycentric = contact.barycentric;
    if (options_.snap_to_vertex) {
        const auto& weights = contact.barycentric;
        grasp_.barycentric = Vector3<Scalar>::Unit(std::max_element(weights.begin(), weights.end()) - weights.begin());
    }
    grasp_.offset = point_at(triangle_at(x, grasp_.corners), grasp_.barycentric) - tool.position;
    grasp_.origin = point_at(triangle_at(origins_, grasp_.corners), grasp_.barycentric);
    return grasp_;
}

template <Real Scalar>
Grasp<Scalar> Grasper<Scalar>::update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                      const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept {
    if (!body.pose().same_pose(pose_)) {
        grasp_.offset = motion_between(pose_, body.pose()).vector_to_world(grasp_.offset);
        pose_ = body.pose();
    }
    (void)update(contact, x, tool);
    if (!grasp_.holding()) return grasp_;
    grasp_.origin = point_at(triangle_at(body.anchors(), grasp_.corners), grasp_.barycentric);
    grasp_.body_velocity = body.velocity_at(tool.position, grasp_.corners, grasp_.barycentric);
    return grasp_;
}

}  // namespace membrane
