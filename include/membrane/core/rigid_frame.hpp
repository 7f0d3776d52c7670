// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/core/types.hpp>

namespace membrane {

/// A body that moves rigidly, as an eye in its orbit. The membrane stays in the body's own frame, where its anchors
/// rest, at no cost per vertex: carry the tool in and the force out.
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

    [[nodiscard]] Vector3<Scalar> point_to_body(const Vector3<Scalar>& world) const noexcept {
        return vector_to_body(world - origin);
    }
    [[nodiscard]] Vector3<Scalar> point_to_world(const Vector3<Scalar>& body) const noexcept {
        return origin + vector_to_world(body);
    }

    /// A force, an axis, a normal: turned, not moved.
    [[nodiscard]] Vector3<Scalar> vector_to_body(const Vector3<Scalar>& world) const noexcept {
        return {dot(point(rotation, 0), world), dot(point(rotation, 1), world), dot(point(rotation, 2), world)};
    }
    [[nodiscard]] Vector3<Scalar> vector_to_world(const Vector3<Scalar>& body) const noexcept {
        return point(rotation, 0) * body.x() + point(rotation, 1) * body.y() + point(rotation, 2) * body.z();
    }

    /// Velocity in the world of what moves with the body and is at `place` [m/s], [m].
    [[nodiscard]] Vector3<Scalar> velocity_at(const Vector3<Scalar>& place) const noexcept {
        return velocity + cross<Scalar>(angular_velocity, place - origin);
    }

    /// Velocity as seen from the body of what moves with `velocity_of` at `place`, both in the world [m/s], [m].
    [[nodiscard]] Vector3<Scalar> velocity_in(const Vector3<Scalar>& velocity_of,
                                              const Vector3<Scalar>& place) const noexcept {
        return vector_to_body(velocity_of - velocity - cross<Scalar>(angular_velocity, place - origin));
    }

    /// The same place and attitude, to the bit.
    [[nodiscard]] bool same_pose(const RigidFrame& other) const noexcept {
        return rotation == other.rotation && origin == other.origin;
    }
};

/// The motion that takes a body from pose `from` to pose `to`: `point_to_world` of where something on the body was is where it
/// is, in the world. Without velocities.
template <Real Scalar>
[[nodiscard]] RigidFrame<Scalar> motion_between(const RigidFrame<Scalar>& from, const RigidFrame<Scalar>& to) noexcept {
    RigidFrame<Scalar> motion;
    for (Eigen::Index k = 0; k < 3; ++k) {  // the rotation takes each of the world's axes into the body and out again
        motion.rotation.col(k) = to.vector_to_world(from.rotation.row(k).transpose());
    }
    motion.origin = to.origin - motion.vector_to_world(from.origin);
    return motion;
}

}  // namespace membrane
