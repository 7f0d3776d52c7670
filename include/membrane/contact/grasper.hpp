// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Forceps: what they hold, from closing to opening.
///
///     auto grasper = membrane::Grasper(mesh);
///     const auto grasp  = grasper.update(contact, x, tool);
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
namespace membrane {

template <Real Scalar>
class MovingBody;  // of moving_body.hpp

/// A point of the membrane that moves with the tool.
template <Real Scalar>
struct Grasp {
    Index triangle = no_index;                                   ///< none: nothing is held
    std::array<Index, 3> corners{no_index, no_index, no_index};  ///< its vertices
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();       ///< of the held point
    Vector3<Scalar> offset = Vector3<Scalar>::Zero();            ///< from the tool to the held point [m]
    Vector3<Scalar> origin = Vector3<Scalar>::Zero();            ///< where the held point would be without the tool [m]
    Vector3<Scalar> body_velocity = Vector3<Scalar>::Zero();     ///< of the body there, where it moves [m/s]

    [[nodiscard]] bool holding() const noexcept { return triangle != no_index; }

    /// How far the tool has taken the held point from where it would be without it [m]. @pre holding()
    [[nodiscard]] Vector3<Scalar> displacement(const Tool<Scalar>& tool) const noexcept {
        return tool.position + offset - origin;
    }
};

/// How forceps take hold.
struct GraspOptions {
    bool snap_to_vertex = false;  ///< hold the nearest vertex rather than the very point touched
};

/// Takes hold of the contact point when the tool closes on the membrane, and lets go when it opens.
template <Real Scalar>
class Grasper {
  public:
    explicit Grasper(const TriangleMesh<Scalar>& mesh, GraspOptions options = {})
        : origins_(mesh.positions()), options_(options) {}

    /// What the tool holds now. Forceps that were closed before they touched hold nothing.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool) noexcept;

    /// The same on a body that moves: the held point goes along with it, and turns with it about the tool.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept;

    /// Lets go and forgets whether it was closed: from here on it does what a new one does, to the bit.
    void reset() noexcept {
        grasp_ = {};
        pose_ = {};
        closed_ = false;
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
