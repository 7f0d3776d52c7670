// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/foundation_layer.hpp>

#include "support/peel_scene.hpp"
#include "support/specimen.hpp"

/// A capsulorhexis: forceps guide a tear in the lens capsule round, to its own beginning.
namespace examples {

using Vector = membrane::Vector3<double>;
using Tear = membrane::Tearing<double>;

/// A ball under the membrane: it pushes out what is pressed into it, without friction, and so lets go of the flap. A
/// `FoundationModel`.
class BallUnder {
  public:
    /// `stiffness` is the pressure per depth [N/m^3].
    BallUnder(const membrane::TriangleMesh<double>& mesh, const Vector& centre, double radius, double stiffness)
        : centre_(centre), radius_(radius), stiffness_(membrane::vertex_areas(mesh)) {
        for (double& each : stiffness_) each *= stiffness;
    }

    [[nodiscard]] membrane::VertexForce<double> force_on(membrane::Index v, const Vector& position, const Vector&,
                                                         double) const noexcept {
        const double stiffness = stiffness_[static_cast<std::size_t>(v)];
        const Vector out = membrane::direction_or_zero<double>(position - centre_);
        return {stiffness * depth(position) * out, stiffness};
    }

    /// Energy stored [J].
    [[nodiscard]] double energy(const membrane::Points<double>& x) const {
        double sum = 0;
        for (std::size_t v = 0; v < stiffness_.size(); ++v) {
            const double deep = depth(x.col(static_cast<Eigen::Index>(v)));
            sum += stiffness_[v] * (deep * deep) / 2;
        }
        return sum;
    }

    void split(const membrane::VertexSplit& split) noexcept {
        membrane::divide(stiffness_[static_cast<std::size_t>(split.vertex)],
                         stiffness_[static_cast<std::size_t>(split.copy)], split.area_share);
    }

  private:
    [[nodiscard]] double depth(const Vector& position) const noexcept {
        return std::max(0.0, radius_ - (position - centre_).norm());
    }

    Vector centre_;
    double radius_;
    std::vector<double> stiffness_;  // [N/m]
};

/// What is opened. Angles are about an axis through the membrane, from the cut with which the tear begins.
struct RhexisScene {
    std::string name;
    membrane::TriangleMesh<double> mesh;  ///< with a reserve
    std::vector<membrane::Index> pinned;  ///< vertices
    Vector middle, axis;                  ///< where the axis meets the membrane [m]; unit vector, outward
    double radius = 0;                    ///< of the opening that is wanted [m]
    double stretch = 1;                   ///< of the membrane before it is torn
    double ball = 1, ball_stiffness = 0;  ///< radius [m] and stiffness [N/m^3] of the ball under it
    double edge = mean_edge(mesh);        ///< [m]

    [[nodiscard]] BallUnder body() const { return {mesh, middle - ball * axis, ball, ball_stiffness}; }

    /// What of the ball the opening may lay bare, from its inside, a little deeper: for pictures.
    [[nodiscard]] membrane::TriangleMesh<double> ball_under_opening() const;

    /// Unit vector across the axis.
    [[nodiscard]] Vector across(double angle) const {
        const Vector east = membrane::direction<double>(Vector(0, 1, 0).cross(axis), {1, 0, 0});
        return std::cos(angle) * east + std::sin(angle) * axis.cross(east);
    }
    /// Of a point, 0 to 2 pi [rad].
    [[nodiscard]] double angle(const Vector& p) const {
        const Vector from = p - middle;
        const double angle = std::atan2(across(std::numbers::pi / 2).dot(from), across(0).dot(from));
        return angle < 0 ? angle + 2 * std::numbers::pi : angle;
    }
    /// Of a point [m].
    [[nodiscard]] double from_axis(const Vector& p) const { return axis.cross(p - middle).norm(); }

    /// Vertices from near the axis outward, and then along the circle.
    [[nodiscard]] std::vector<membrane::Index> cut(const membrane::TornSurface<double>& surface) const;
};

/// The front of a lens: a cap of a ball, held at its rim.
[[nodiscard]] inline RhexisScene capsule_scene(const membrane::TriangleMesh<double>& cap, double ball) {
    const membrane::FoundationLayer cortex{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    return {.name = "capsule",
            .mesh = membrane::with_reserve(cap, cap.vertex_count() / 2),
            .pinned = membrane::border(cap),
            .middle = {0, 0, ball},
            .axis = {0, 0, 1},
            .radius = 2.6e-3,
            .stretch = 1.01,
            .ball = ball,
            .ball_stiffness = cortex.normal_stiffness()};
}

/// A membrane from a file, on nothing and not stretched, with edges short against the opening.
[[nodiscard]] inline RhexisScene rhexis_scene(const Specimen& body) {
    const double radius = 0.5 * body.size;
    Specimen finer = body;
    while (mean_edge({finer.surface.points, finer.surface.triangles}) > radius / 4) {
        const auto mesh = membrane::refined(membrane::TriangleMesh(finer.surface.points, finer.surface.triangles));
        finer.surface = {mesh.positions(), mesh.triangles()};
    }
    const membrane::TriangleMesh<double> mesh(finer.surface.points, finer.surface.triangles);
    return {.name = "mesh",
            .mesh = membrane::with_reserve(mesh, mesh.vertex_count()),
            .pinned = finer.rim(),
            .middle = finer.above(0),
            .axis = finer.outward,
            .radius = radius};
}

inline membrane::TriangleMesh<double> RhexisScene::ball_under_opening() const {
    auto cap = membrane::spherical_cap({.radius = ball, .diameter = 2.6 * radius, .rings = 4});
    Eigen::Matrix3d axes;
    axes << across(0).eigen(), across(std::numbers::pi / 2).eigen(), axis.eigen();
    membrane::Points<double> points = axes * cap.positions();
    points.colwise() += (middle - (ball + 0.2 * radius) * axis).eigen();
    return {points, cap.triangles().colwise().reverse()};
}

inline std::vector<membrane::Index> RhexisScene::cut(const membrane::TornSurface<double>& surface) const {
    const double corner = 0.2 * radius, straight = radius - corner, turned = corner * std::numbers::pi / 2;
    const double begin = 0.08 * radius, end = straight + turned + 0.4 * radius;
    const auto at =
        [&](double s) -> Vector {  // after a length of s; the distance of the membrane from the tangent plane
        const double turn = std::clamp((s - straight) / corner, 0.0, std::numbers::pi / 2);  // does not matter
        const double along = std::min(s, straight) + corner * std::sin(turn), aside = corner * (1 - std::cos(turn));
        const Vector p = middle + along * across(0) + aside * across(std::numbers::pi / 2);
        return s > straight + turned ? middle + radius * across(angle(p) + (s - straight - turned) / radius) : p;
    };
    const auto flat = [&](membrane::Index v) -> Vector {
        const Vector p = surface.rest_positions().col(v);
        return p - axis.dot(p - middle) * axis;
    };
    const auto nearest = [&](const Vector& p) {
        membrane::Index best = surface.corners(0)[0];
        for (const membrane::Index v : surface.triangles().reshaped()) {
            const Vector from = Vector(surface.rest_positions().col(v)) - middle;
            if (axis.dot(from) > -radius && (flat(v) - p).norm() < (flat(best) - p).norm()) best = v;
        }
        return best;
    };
    std::vector<membrane::Index> path{nearest(at(begin))};
    for (double s = begin; s < end - edge / 2;) {
        const membrane::Index next = surface.nearest_in_direction(path.back(), at(s + 1.5 * edge) - flat(path.back()));
        if (next == membrane::no_index || std::find(path.begin(), path.end(), next) != path.end()) break;
        path.push_back(next);
        const double last = s;
        for (double t = last; t < last + 2 * edge; t += edge / 50) {
            if ((at(t) - flat(next)).norm() < (at(s) - flat(next)).norm()) s = t;
        }
        if (s == last) break;
    }
    return path;
}

/// Whether the leading tip has met the beginning of the tear, and the last edge has opened. One at the tip near the
/// axis may be opening still.
[[nodiscard]] inline bool is_round(const Tear& tear) {
    if (tear.tips().size() > 1) return false;
    const auto opening = tear.ligaments().ligaments;
    const membrane::Index within = tear.tips().empty() ? membrane::no_index : tear.tips().front().behind[1];
    return std::all_of(opening.begin(), opening.end(), [&](const auto& one) { return one.copy == within; });
}

/// Forceps that hold the flap behind the tear's tip, and their hand. While the tear advances toward d, the hand moves
/// along e, and the flap between tip and forceps becomes longer against m: unit vectors from the tip to the held point,
/// now and at rest. The driving force is the force times e - m. So the hand goes where the mirror image of the flap is,
/// across the direction that the tear should take: along the circle, and inward if the tip is out. When the tip is far
/// ahead, the forceps open, so that the flap slips out of them, and grasp anew.
class Forceps {
  public:
    /// For a scene that outlives them; they pull at an angle `lift` to the surface [rad].
    Forceps(const RhexisScene& scene, double lift) : scene_(scene), lift_(lift) {}

    /// Moves the hand for a tick of `dt` [s], or opens or closes the forceps. `force`: on them, by the last step [N].
    void guide(const Tear& tear, const membrane::Points<double>& x, double dt, double force);

    /// What holds the flap.
    [[nodiscard]] membrane::PointAttachment<double> hold(const Tear& tear) const {
        if (!closed()) return {};
        return {triangle_,
                tear.surface().corners(triangle_),
                {1.0 / 3, 1.0 / 3, 1.0 / 3},
                position_ + slipped_,
                max_force_};
    }
    /// After a step: the flap slips out of forceps that open.
    void slip(const Tear& tear, const membrane::Points<double>& x) {
        if (opens()) slipped_ = middle_of(tear.surface().corners_at(x, triangle_)) - position_;
    }
    /// How far the flap has slipped out of them [m].
    [[nodiscard]] const Vector& slipped() const { return slipped_; }
    [[nodiscard]] bool closed() const { return triangle_ != membrane::no_index; }
    [[nodiscard]] const Vector& position() const { return position_; }
    [[nodiscard]] int grasps() const { return grasps_; }

  private:
    static constexpr double infinite = std::numeric_limits<double>::infinity();
    static constexpr double speed = 6e-3;     // of the hand [m/s]
    static constexpr double ahead = 0.3;      // part of it at which it draws away from the tip
    static constexpr double open_time = 0.1;  // in which they hold less and less [s]

    static Vector middle_of(const std::array<Vector, 3>& corners) {
        return (corners[0] + corners[1] + corners[2]) / 3.0;
    }
    [[nodiscard]] bool opens() const { return max_force_ < infinite; }
    [[nodiscard]] Vector wanted_direction(const Vector& tip, const Vector& normal) const;
    void grasp(const membrane::TornSurface<double>& surface, const Vector& place);

    const RhexisScene& scene_;
    double lift_;
    membrane::Index triangle_ = membrane::no_index;
    Vector position_ = Vector::Zero();
    double max_force_ = infinite;      // that they hold [N]
    double force_before_ = 0;          // on them when they began to open [N]
    Vector slipped_ = Vector::Zero();  // from the hand to what they hold [m]
    double fold_ = 0;                  // by which the flap is turned over [rad]
    double stretch_ = 1;               // of the flap between tip and forceps
    Vector drawn_ = Vector::Zero();    // from the tip, a unit vector
    int grasps_ = 0;
};

// Near its end the tear goes inward by most of an edge, so as not to miss its beginning.
inline Vector Forceps::wanted_direction(const Vector& tip, const Vector& normal) const {
    const Vector from = tip - scene_.middle;
    const Vector out = membrane::direction_or_zero<double>(from - normal.dot(from) * normal);
    const double radius = scene_.radius - 0.7 * scene_.edge * std::clamp(scene_.angle(tip) - 5, 0.0, 1.0);
    const double too_far = (scene_.from_axis(tip) - radius) / (4 * scene_.edge);
    return membrane::direction_or_zero<double>(normal.cross(out) - too_far * out);
}

inline void Forceps::grasp(const membrane::TornSurface<double>& surface, const Vector& place) {
    double nearest = std::numeric_limits<double>::infinity();
    for (membrane::Index f = 0; f < static_cast<membrane::Index>(surface.triangles().cols()); ++f) {
        const auto corners = surface.corners_at(surface.rest_positions(), f);
        const double distance = (middle_of(corners) - place).norm();
        if (distance < nearest) nearest = distance, triangle_ = f;
    }
    ++grasps_;
}

inline void Forceps::guide(const Tear& tear, const membrane::Points<double>& x, double dt, double force) {
    if (tear.tips().size() < 2) {  // round
        position_ += ahead * speed * dt * drawn_;
        return;
    }
    const auto& surface = tear.surface();
    const auto& rest = surface.rest_positions();
    const auto& tip = tear.tips().back();
    const Vector start = rest.col(tip.vertex), now = x.col(tip.vertex);
    const auto to_held = [&]() -> Vector { return middle_of(surface.corners_at(rest, triangle_)) - start; };
    if (closed() && !opens() && to_held().norm() > 0.62 * scene_.radius) max_force_ = force_before_ = force;
    if (opens()) {
        max_force_ -= force_before_ * dt / open_time;
        if (!(max_force_ > 0)) triangle_ = membrane::no_index, max_force_ = infinite;
        return;
    }
    const Vector normal = surface.rest_normal(tip.vertex), toward = wanted_direction(start, normal);
    if (!closed()) {
        grasp(surface, start - 0.3 * scene_.radius * toward + 1.5 * scene_.edge * normal.cross(toward));
        position_ = middle_of(surface.corners_at(x, triangle_));
        slipped_ = Vector::Zero();
        stretch_ = (position_ - now).norm() / to_held().norm();
    }
    const double length = to_held().norm(), most = speed * dt;
    const Vector held = membrane::direction_or_zero<double>(to_held() - normal.dot(to_held()) * normal);
    const double behind = -held.dot(toward);
    fold_ = std::min(fold_ + most / length, std::numbers::pi - lift_);
    if (fold_ == std::numbers::pi - lift_) stretch_ += ahead * most / length;
    drawn_ = held + behind * ((1 - std::cos(fold_)) * toward + std::sin(fold_) * normal);
    const Vector move = now + stretch_ * length * drawn_ - position_;
    position_ += std::min(1.0, most / std::max(move.norm(), most)) * move;
}

}  // namespace examples
