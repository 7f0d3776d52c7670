// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <type_traits>

#include <membrane/core/symmetric3.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/moving_body.hpp>

/// A foundation on a moving body.
///
///     solver.step(x, dt, network, on(body, foundation), press(tool, contact));
namespace membrane {

namespace detail {

/// A rotation in another number type, orthonormal to its rounding.
template <Real Number, Real Scalar>
[[nodiscard]] Eigen::Matrix<Number, 3, 3> rotation_in(const Eigen::Matrix<Scalar, 3, 3>& rotation) noexcept {
    Eigen::Matrix<Number, 3, 3> r = rotation.template cast<Number>();
    if constexpr (!std::is_same_v<Number, Scalar>) {
        const Vector3<Number> x = r.col(0) / norm<Number>(r.col(0));
        const Vector3<Number> z = cross<Number>(x, r.col(1));
        r.col(0) = x;
        r.col(2) = z / norm(z);
        r.col(1) = cross<Number>(r.col(2), x);
    }
    return r;
}

}  // namespace detail

/// The rigid motion of the body at vertex `v`, between its rest pose and now.
template <Real Scalar>
struct FrameOnBody {
    /// Of `body` where vertex `v` is anchored.
    FrameOnBody(const MovingBody<Scalar>& body, Index v) noexcept
        : at_rest(point(body.anchors_at_rest(), v)), now(point(body.anchors(), v)) {
        turn.rotation = body.rotation_at(v);
    }

    ///@{
    /// A point near the vertex in the rest pose of the body, and back [m].
    [[nodiscard]] Vector3<Scalar> point_to_body(const Vector3<Scalar>& position) const noexcept {
        return at_rest + turn.vector_to_body(position - now);
    }
    [[nodiscard]] Vector3<Scalar> point_to_world(const Vector3<Scalar>& position) const noexcept {
        return now + turn.vector_to_world(position - at_rest);
    }
    ///@}

    Vector3<Scalar> at_rest;  ///< the anchor in the rest pose [m]
    Vector3<Scalar> now;      ///< the anchor [m]
    RigidFrame<Scalar> turn;  ///< rotates without translation
};

/// Any `FoundationModel` on a body that has moved: at each vertex the model is translated with the anchor and rotated
/// with the body. Arguments are transformed to the rest pose of the body, results back. A short-lived view of both, see
/// `on`.
template <class Volume, Real Scalar>
class MovingFoundation {
  public:
    /// Keeps references to both.
    MovingFoundation(const MovingBody<Scalar>& body, const Volume& volume) noexcept : body_(&body), volume_(&volume) {}

    /// The body, with which a solver carries the membrane along.
    [[nodiscard]] const MovingBody<Scalar>& body() const noexcept { return *body_; }

    /// As `FoundationModel` requires; [N] and [N/m] in the frame of `position`.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const Vector3<Scalar>& position, const Vector3<Scalar>& start,
                                               Scalar dt) const noexcept {
        const FrameOnBody<Scalar> frame(*body_, v);
        auto sum = volume_->force_on(v, frame.point_to_body(position), frame.point_to_body(start), dt);
        sum.force = frame.turn.vector_to_world(sum.force);
        return sum;
    }

    /// The spring of vertex `v`, if the model has springs.
    [[nodiscard]] auto spring(Index v, const Vector3<Scalar>& start,
                              Scalar dt) const noexcept requires HasSprings<Volume, Scalar> {
        const FrameOnBody<Scalar> frame(*body_, v);
        return volume_->spring(v, frame.point_to_body(start), dt)
            .moved([&](const Vector3<Scalar>& place) { return frame.point_to_world(place); },
                   [&](const Vector3<Scalar>& vector) { return frame.turn.vector_to_world(vector); });
    }

    /// The current anchors, if those of the model are those of the body at rest [m].
    [[nodiscard]] const Points<Scalar>& anchors() const noexcept requires requires(const Volume& volume) {
        volume.anchors();
    }
    { return body_->anchors(); }

    /// Hessian of the energy of the model at vertex `v`, rotated with the body [N/m]. Exists if the model has one.
    template <Real Number = Scalar>
    [[nodiscard]] Symmetric3<Number> hessian(Index v) const noexcept requires requires(const Volume& volume) {
        volume.hessian(v);
    }
    {
        const auto rotation = detail::rotation_in<Number>(body_->rotation_at(v));
        if constexpr (requires { volume_->template hessian<Number>(v); }) {
            return rotated(volume_->template hessian<Number>(v), rotation);
        } else {
            const Symmetric3<Scalar> k = volume_->hessian(v);
            return rotated<Number>({k.xx, k.yy, k.zz, k.xy, k.xz, k.yz}, rotation);
        }
    }

    /// Energy of the model at vertex `v` [J]. Exists if the model has one.
    [[nodiscard]] Scalar energy(Index v, const Vector3<Scalar>& position) const noexcept requires
        requires(const Volume& volume) {
        volume.energy(v, position);
    }
    { return volume_->energy(v, FrameOnBody<Scalar>(*body_, v).point_to_body(position)); }

    /// Of the model, if it has one [N].
    [[nodiscard]] Scalar force_tolerance(Scalar dt) const noexcept requires requires(const Volume& volume) {
        volume.force_tolerance(dt);
    }
    { return volume_->force_tolerance(dt); }

    /// Of the model, if it counts the splits that it has followed.
    [[nodiscard]] Index splits() const noexcept requires std::derived_from<Volume, SplitCount> {
        return volume_->splits();
    }

  private:
    const MovingBody<Scalar>* body_;
    const Volume* volume_;
};

/// `volume`, made for the body at rest, on the current `body`. Both must outlive the result.
template <Real Scalar, FoundationModel<Scalar> Volume>
[[nodiscard]] MovingFoundation<Volume, Scalar> on(const MovingBody<Scalar>& body, const Volume& volume) noexcept {
    return {body, volume};
}

static_assert(FoundationModel<MovingFoundation<VirtualVolumeSprings<float>, float>, float>);
static_assert(FoundationModel<MovingFoundation<NoFoundation, double>, double>);

}  // namespace membrane
