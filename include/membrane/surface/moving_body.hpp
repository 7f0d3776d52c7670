// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include <membrane/core/arctangent.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// The moving body under the membrane: one source of its motion for all parts.
///
///     auto body = membrane::MovingBody(mesh);
///     if (!body.move_to(pose, x)) ...                                          // each tick: a rigid motion, or
///     if (!body.move_to(anchors, dt, x)) ...                                   // any motion
///     tree.refit(x);
///     const auto contact = tracker.update(tree, x, tool, body);
///     const auto grasp   = grasper.update(contact, x, tool, body);
///     const auto report  = solver.step(x, dt, network, on(body, foundation), press(tool, contact, grasp),
///                                     pull(tool, grasp));
///     device.write(feel({tool, smooth(contact, body), report, grasp}));
namespace membrane {

/// Motion of the body. The anchors are the positions of the membrane without any tool; the pose is the best rigid
/// motion from the mesh to the anchors.
///
/// A motion carries the membrane, pinned vertices included: the offset of each vertex from its anchor is kept and
/// rotated with the pose. The state of other parts (contact, grasp, forces, displacements) is transformed with the pose
/// at their next call. So a rigid motion of body, membrane and tool together has no effect, up to rounding; but a
/// tool with friction (`ToolFriction`) does not rotate: a body that turns with it slips. Vertices are woken only if the
/// motion of the anchors is not rigid.
///
/// A body with rigid motion only, as an eye in its orbit, does not need this class if positions need not be in the
/// world: with `to_body_frame(tool, frame)` the membrane stays in the frame of the body, at no cost. Loads with a fixed
/// direction in the world (`DeadLoad`) do not rotate with a body, and force policies that store a position in the world
/// (`ContactFriction`) do not move with it; with `to_body_frame` they do.
///
/// A membrane that tears does not tear the body: a vertex and its copy have one anchor and one normal. The last
/// vertices of the mesh, if they have no triangles, do not count in the pose.
template <Real Scalar>
class MovingBody {
  public:
    /// At the identity pose, with the positions of `mesh` as anchors. Cost: O(F log F).
    explicit MovingBody(const TriangleMesh<Scalar>& mesh);

    /// Moves the body to `pose`, relative to the mesh, and with it `x` (3 x V [m]). Call it in every tick: velocities
    /// are those of the last call. Then refit the whole tree.
    ///
    /// If a number in `pose`, in `x` or in the result is not finite, the rotation is not orthonormal, or `x` does not
    /// have a column for each vertex, returns false and changes nothing. Online. Cost: O(V).
    [[nodiscard]] bool move_to(const RigidFrame<Scalar>& pose, PointsRef<Scalar> x) noexcept;

    /// Moves a body of any motion: its anchors are now at `anchors` (3 x V [m]), after a motion of `dt` [s]. The pose
    /// is the least-squares fit, by quaternions [Horn87]. A motion whose velocity is not finite is refused as well. The
    /// anchor given for a copy of a vertex is not used. Cost: O(F).
    [[nodiscard]] bool move_to(const ConstPointsRef<Scalar>& anchors, Scalar dt, PointsRef<Scalar> x) noexcept;

    /// Present anchors, 3 x V [m].
    [[nodiscard]] const Points<Scalar>& anchors() const& noexcept { return anchors_; }
    [[nodiscard]] Points<Scalar> anchors() && noexcept { return std::move(anchors_); }

    /// Unit normals at the vertices of the surface of the anchors, 3 x V.
    [[nodiscard]] const Points<Scalar>& normals() const& noexcept { return normals_; }
    [[nodiscard]] Points<Scalar> normals() && noexcept { return std::move(normals_); }

    /// The rigid motion from the mesh to the anchors, with the velocities of the last motion.
    [[nodiscard]] const RigidFrame<Scalar>& pose() const& noexcept { return pose_; }
    [[nodiscard]] RigidFrame<Scalar> pose() && noexcept { return std::move(pose_); }

    /// Number of motions of the anchors that were not rigid. Each takes a membrane out of equilibrium.
    [[nodiscard]] std::uint64_t deformations() const noexcept { return deformations_; }

    /// Velocity at `position` of a point fixed to the body at `barycentric` in the triangle of vertices `corners`
    /// [m/s].
    [[nodiscard]] Vector3<Scalar> velocity_at(const Vector3<Scalar>& position, const std::array<Index, 3>& corners,
                                              const Vector3<Scalar>& barycentric) const noexcept;

    /// Rotation of the body at vertex `v`: that of the pose. If the body is deformed, a further rotation aligns the
    /// normal at rest with the present normal.
    [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> rotation_at(Index v) const noexcept;

    /// The anchors of the undeformed body: the positions of the mesh.
    [[nodiscard]] const Points<Scalar>& anchors_at_rest() const& noexcept { return at_rest_; }
    [[nodiscard]] Points<Scalar> anchors_at_rest() && noexcept { return std::move(at_rest_); }

    ///@{
    /// A vertex becomes two; a vertex moves at rest, and its anchor with it: do not move one if `move_to` gets anchors.
    /// Online.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if (self.copies_.capacity() > 0) visit(self.copies_, self.at_rest_, self.normals_at_rest_);
        visit(self.anchors_, self.normals_, self.previous_, self.pose_, self.rate_, self.deformed_, self.deformations_);
    }

  private:
    [[nodiscard]] bool carry(const RigidFrame<Scalar>& pose, PointsRef<Scalar>& x) noexcept;
    [[nodiscard]] RigidFrame<Scalar> fit(const ConstPointsRef<Scalar>& anchors) const noexcept;
    [[nodiscard]] bool is_carried(const RigidFrame<Scalar>& motion, const Points<Scalar>& from) const noexcept;

    struct Copy {
        Index vertex, copy;
    };
    static constexpr void copy_columns(const Copy& of, auto&... points) noexcept {
        ((points.col(of.copy) = points.col(of.vertex)), ...);
    }

    Points<Scalar> at_rest_;
    VertexNormals<Scalar> surface_;
    FixedVector<Copy> copies_;  // vertices that a tear has doubled, in order
    Index fitted_;              // the pose is fitted to the anchors of these first vertices
    Points<Scalar> normals_at_rest_, anchors_, normals_;
    Points<Scalar> previous_;        // anchors before the last motion
    Points<Scalar> next_, carried_;  // during a motion: new anchors, new positions of the membrane
    RigidFrame<Scalar> pose_;
    Scalar rate_ = 0;        // 1 / dt of the last motion; 0: velocities are those of the pose [1/s]
    bool deformed_ = false;  // anchors differ from the mesh at the pose
    std::uint64_t deformations_ = 0;
};

namespace detail {

/// The eigenvector of the largest eigenvalue, by Jacobi's method.
[[nodiscard]] inline std::array<double, 4> largest_eigenvector(std::array<std::array<double, 4>, 4> a) noexcept {
    std::array<std::array<double, 4>, 4> vectors{};  // as columns
    for (std::size_t i = 0; i < 4; ++i) vectors[i][i] = 1;
    for (int sweep = 0; sweep < 16; ++sweep) {  // quadratic convergence: about six suffice
        bool done = true;
        for (std::size_t p = 0; p < 3; ++p) {
            for (std::size_t q = p + 1; q < 4; ++q) {
                if (!(std::abs(a[p][q]) > 1e-30 * (std::abs(a[p][p]) + std::abs(a[q][q])))) continue;
                done = false;
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double root = std::abs(theta) < 1e9 ? std::sqrt(theta * theta + 1) : std::abs(theta);
                const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + root);
                const double c = 1 / std::sqrt(t * t + 1), s = t * c;
                for (std::size_t i = 0; i < 4; ++i) {
                    const double ip = a[i][p], iq = a[i][q];
                    a[i][p] = c * ip - s * iq;
                    a[i][q] = s * ip + c * iq;
                }
                for (std::size_t i = 0; i < 4; ++i) {
                    const double pi = a[p][i], qi = a[q][i];
                    a[p][i] = c * pi - s * qi;
                    a[q][i] = s * pi + c * qi;
                    const double vp = vectors[i][p], vq = vectors[i][q];
                    vectors[i][p] = c * vp - s * vq;
                    vectors[i][q] = s * vp + c * vq;
                }
                a[p][q] = a[q][p] = 0;
            }
        }
        if (done) break;
    }
    std::size_t largest = 0;
    for (std::size_t i = 1; i < 4; ++i) {
        if (a[i][i] > a[largest][largest]) largest = i;
    }
    return {vectors[0][largest], vectors[1][largest], vectors[2][largest], vectors[3][largest]};
}

/// The rotation by a quaternion w, x, y, z, which need not be of length 1.
template <Real Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 3, 3> rotation_by(const std::array<double, 4>& quaternion) noexcept {
    const auto [w, x, y, z] = quaternion;
    const double s = 2 / ((w * w + x * x) + (y * y + z * z));
    const Eigen::Matrix3d rotation{{1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
                                   {s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)},
                                   {s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)}};
    return rotation.cast<Scalar>();
}

/// Axis times angle of a rotation by less than half a turn.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> rotation_vector(const Eigen::Matrix<Scalar, 3, 3>& r) noexcept {
    const Vector3<Scalar> twice_sine(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
    const Scalar sine = norm(twice_sine) / 2, cosine = ((r(0, 0) + r(1, 1)) + r(2, 2) - 1) / 2;
    return sine > 0 ? Vector3<Scalar>(arctangent(sine, cosine) / (2 * sine) * twice_sine) : Vector3<Scalar>(twice_sine);
}

template <Real Scalar>
[[nodiscard]] bool is_rotation(const Eigen::Matrix<Scalar, 3, 3>& r) noexcept {
    const Vector3<Scalar> x = r.col(0), y = r.col(1), z = r.col(2);
    const Scalar off = norm<Scalar>(cross(x, y) - z) + norm<Scalar>(cross(y, z) - x);
    return off <= Scalar(1e-4);
}

}  // namespace detail

template <Real Scalar>
MovingBody<Scalar>::MovingBody(const TriangleMesh<Scalar>& mesh)
    : at_rest_(mesh.positions()),
      surface_(mesh),
      copies_(static_cast<std::size_t>(reserve_of(mesh))),
      fitted_(mesh.triangles().maxCoeff() + 1),
      normals_at_rest_(surface_.values()),
      anchors_(at_rest_),
      normals_(normals_at_rest_),
      previous_(at_rest_),
      next_(at_rest_),
      carried_(at_rest_) {}

template <Real Scalar>
bool MovingBody<Scalar>::move_to(const RigidFrame<Scalar>& pose, PointsRef<Scalar> x) noexcept {
    if (x.cols() != anchors_.cols() || !is_finite(pose.rotation) || !is_finite(pose.origin)) return false;
    if (!is_finite(pose.velocity) || !is_finite(pose.angular_velocity)) return false;
    if (!detail::is_rotation(pose.rotation)) return false;
    for (Index v = 0; v < anchors_.cols(); ++v) next_.col(v) = pose.point_to_world(point(at_rest_, v));
    const bool was_deformed = deformed_;
    if (!carry(pose, x)) return false;
    rate_ = 0;
    deformed_ = false;
    if (was_deformed) ++deformations_;
    for (Index v = 0; v < anchors_.cols(); ++v) normals_.col(v) = pose.vector_to_world(point(normals_at_rest_, v));
    return true;
}

template <Real Scalar>
bool MovingBody<Scalar>::move_to(const ConstPointsRef<Scalar>& anchors, Scalar dt, PointsRef<Scalar> x) noexcept {
    if (x.cols() != anchors_.cols() || anchors.cols() != anchors_.cols()) return false;
    if (!is_finite(dt) || !(dt >= (std::numeric_limits<Scalar>::min)()) || !is_finite(anchors)) return false;
    RigidFrame<Scalar> pose = fit(anchors);
    const auto motion = motion_between(pose_, pose);
    pose.angular_velocity = detail::rotation_vector(motion.rotation) / dt;
    pose.velocity = (pose.origin - pose_.origin) / dt;
    if (!is_finite(pose.rotation) || !is_finite(pose.velocity) || !is_finite(pose.angular_velocity)) return false;
    next_ = anchors;
    for (const Copy& of : copies_.items()) copy_columns(of, next_);
    if (!carry(pose, x)) return false;
    rate_ = 1 / dt;
    if (!is_carried(motion, previous_)) ++deformations_;
    deformed_ = !is_carried(pose_, at_rest_);
    surface_.update(anchors_);
    normals_ = surface_.values();
    for (const Copy& of : copies_.items()) copy_columns(of, normals_);
    return true;
}

template <Real Scalar>
void MovingBody<Scalar>::split(const VertexSplit& split) noexcept {
    const Copy of{split.vertex, split.copy};
    copies_.try_push_back(of);
    copy_columns(of, at_rest_, normals_at_rest_, anchors_, normals_, previous_);
}

template <Real Scalar>
void MovingBody<Scalar>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    const Vector3<Scalar> displacement = pose_.vector_to_world(moved.rest - point(at_rest_, moved.vertex));
    at_rest_.col(moved.vertex) = moved.rest;
    for (auto* anchors : {&anchors_, &previous_}) anchors->col(moved.vertex) += displacement.eigen();
}

// Moves the membrane to the anchors in `next_`, which belong to `pose`.
template <Real Scalar>
bool MovingBody<Scalar>::carry(const RigidFrame<Scalar>& pose, PointsRef<Scalar>& x) noexcept {
    const auto motion = motion_between(pose_, pose);
    for (Index v = 0; v < anchors_.cols(); ++v) {
        const Vector3<Scalar> off = point(x, v) - point(anchors_, v);
        carried_.col(v) = point(next_, v) + motion.vector_to_world(off);
    }
    if (!is_finite(next_) || !is_finite(carried_)) return false;
    x = carried_;
    previous_.swap(anchors_);
    anchors_.swap(next_);
    pose_ = pose;
    return true;
}

template <Real Scalar>
RigidFrame<Scalar> MovingBody<Scalar>::fit(const ConstPointsRef<Scalar>& anchors) const noexcept {
    // Relative to the largest coordinate, so that no product overflows.
    const auto size_of = [](const auto& points) {
        const auto largest = static_cast<double>(points.size() > 0 ? points.cwiseAbs().maxCoeff() : Scalar(0));
        return (std::max)(largest, (std::numeric_limits<double>::min)());
    };
    const double scale = size_of(at_rest_), scale_now = size_of(anchors);
    const auto count = static_cast<double>(fitted_);
    Vector3<double> centre = Vector3<double>::Zero(), centre_now = centre;
    for (Index v = 0; v < fitted_; ++v) {
        centre += point(at_rest_, v).template cast<double>() / scale;
        centre_now += point(anchors, v).template cast<double>() / scale_now;
    }
    centre /= count;
    centre_now /= count;
    Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
    for (Index v = 0; v < fitted_; ++v) {
        const Vector3<double> p = point(at_rest_, v).template cast<double>() / scale - centre;
        const Vector3<double> q = point(anchors, v).template cast<double>() / scale_now - centre_now;
        for (Eigen::Index k = 0; k < 3; ++k) m.col(k) += q[k] * p;
    }
    RigidFrame<Scalar> pose;
    pose.rotation = detail::rotation_by<Scalar>(detail::largest_eigenvector(
        {{{(m(0, 0) + m(1, 1)) + m(2, 2), m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0)},
          {m(1, 2) - m(2, 1), (m(0, 0) - m(1, 1)) - m(2, 2), m(0, 1) + m(1, 0), m(2, 0) + m(0, 2)},
          {m(2, 0) - m(0, 2), m(0, 1) + m(1, 0), (m(1, 1) - m(0, 0)) - m(2, 2), m(1, 2) + m(2, 1)},
          {m(0, 1) - m(1, 0), m(2, 0) + m(0, 2), m(1, 2) + m(2, 1), (m(2, 2) - m(0, 0)) - m(1, 1)}}}));
    const Vector3<Scalar> mean = (scale * centre).template cast<Scalar>();
    pose.origin = (scale_now * centre_now).template cast<Scalar>() - pose.vector_to_world(mean);
    return pose;
}

// Whether `motion` maps the points `from` to the anchors, up to rounding.
template <Real Scalar>
bool MovingBody<Scalar>::is_carried(const RigidFrame<Scalar>& motion, const Points<Scalar>& from) const noexcept {
    Scalar off = 0, size = 0;
    for (Index v = 0; v < fitted_; ++v) {
        const Vector3<Scalar> now = point(anchors_, v);
        off = (std::max)(off, norm<Scalar>(motion.point_to_world(point(from, v)) - now));
        size = (std::max)({size, norm(now), norm(point(from, v))});
    }
    return off <= 64 * std::numeric_limits<Scalar>::epsilon() * size;
}

template <Real Scalar>
Vector3<Scalar> MovingBody<Scalar>::velocity_at(const Vector3<Scalar>& position, const std::array<Index, 3>& corners,
                                                const Vector3<Scalar>& barycentric) const noexcept {
    if (rate_ == 0) return pose_.velocity_at(position);
    const Vector3<Scalar> now = point_at(triangle_at(anchors_, corners), barycentric);
    const Vector3<Scalar> before = point_at(triangle_at(previous_, corners), barycentric);
    return rate_ * (now - before) + cross<Scalar>(pose_.angular_velocity, position - now);
}

template <Real Scalar>
Eigen::Matrix<Scalar, 3, 3> MovingBody<Scalar>::rotation_at(Index v) const noexcept {
    if (!deformed_) return pose_.rotation;
    // Rotated further by the smallest angle that aligns the normals.
    const Vector3<Scalar> from = pose_.vector_to_world(point(normals_at_rest_, v)), to = point(normals_, v);
    const Vector3<Scalar> axis = cross(from, to);
    const Scalar cosine = dot(from, to);
    if (!(cosine > Scalar(-0.5))) return pose_.rotation;  // here the axis is ill-conditioned
    Eigen::Matrix<Scalar, 3, 3> rotation;
    for (Eigen::Index k = 0; k < 3; ++k) {
        const Vector3<Scalar> column = pose_.rotation.col(k), turned = cross(axis, column);
        rotation.col(k) = column + turned + cross(axis, turned) / (1 + cosine);
    }
    return rotation;
}

}  // namespace membrane
