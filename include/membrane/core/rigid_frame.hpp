// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/core/types.hpp>

namespace membrane {

/// Pose and velocity of a rigid body, as an eye in its orbit. The membrane is simulated in the body's frame, where its
/// anchors are fixed, at no cost per vertex: only the tool and the force are transformed.
///
///     const auto tool = membrane::to_body_frame(device.read(), eye);
///     // contact, solve, force: in the eye's frame
///     device.write(eye.vector_to_world(force));
template <Real Scalar>
struct RigidFrame {
    Eigen::Matrix<Scalar, 3, 3> rotation = Eigen::Matrix<Scalar, 3, 3>::Identity();  ///< from the body to the world
    Vector3<Scalar> origin = Vector3<Scalar>::Zero();                                ///< the body's, in the world [m]
    Vector3<Scalar> velocity = Vector3<Scalar>::Zero();                              ///< of the origin [m/s]
    Vector3<Scalar> angular_velocity = Vector3<Scalar>::Zero();                      ///< in the world [rad/s]

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.rotation, self.origin, self.velocity, self.angular_velocity);
    }

    ///@{
    /// A point [m]: rotated and translated.
    [[nodiscard]] Vector3<Scalar> point_to_body(const Vector3<Scalar>& world) const noexcept {
        return vector_to_body(world - origin);
    }
    [[nodiscard]] Vector3<Scalar> point_to_world(const Vector3<Scalar>& body) const noexcept {
        return origin + vector_to_world(body);
    }
    ///@}

    ///@{
    /// A force, an axis or a normal: rotated, not translated.
    [[nodiscard]] Vector3<Scalar> vector_to_body(const Vector3<Scalar>& world) const noexcept {
        return {dot(point(rotation, 0), world), dot(point(rotation, 1), world), dot(point(rotation, 2), world)};
    }
    [[nodiscard]] Vector3<Scalar> vector_to_world(const Vector3<Scalar>& body) const noexcept {
        return point(rotation, 0) * body.x() + point(rotation, 1) * body.y() + point(rotation, 2) * body.z();
    }
    ///@}

    /// World velocity [m/s] of a point that moves with the body, at `position` in the world [m].
    [[nodiscard]] Vector3<Scalar> velocity_at(const Vector3<Scalar>& position) const noexcept {
        return velocity + cross<Scalar>(angular_velocity, position - origin);
    }

    /// Velocity in the body frame [m/s] of a point with world velocity `velocity_of` at `position` in the world [m].
    [[nodiscard]] Vector3<Scalar> velocity_in(const Vector3<Scalar>& velocity_of,
                                              const Vector3<Scalar>& position) const noexcept {
        return vector_to_body(velocity_of - velocity - cross<Scalar>(angular_velocity, position - origin));
    }

    /// Whether rotation and origin are equal, bit for bit.
    [[nodiscard]] bool same_pose(const RigidFrame& other) const noexcept {
        return rotation == other.rotation && origin == other.origin;
    }
};

/// The motion of a body from pose `from` to pose `to`: `point_to_world` maps the old world position of a point on the
/// body to the new one. Velocities are zero.
template <Real Scalar>
[[nodiscard]] RigidFrame<Scalar> motion_between(const RigidFrame<Scalar>& from, const RigidFrame<Scalar>& to) noexcept {
    RigidFrame<Scalar> motion;
    for (Eigen::Index k = 0; k < 3; ++k) {  // each world axis: into the old body frame, then out of the new
        motion.rotation.col(k) = to.vector_to_world(from.rotation.row(k).transpose());
    }
    motion.origin = to.origin - motion.vector_to_world(from.origin);
    return motion;
}

}  // namespace membrane
