// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>

#include <membrane/contact/contact.hpp>
#include <membrane/contact/tool.hpp>
#include <membrane/core/check.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Forceps: the held point, from closing to opening.
///
///     auto grasper = membrane::Grasper(mesh);
///     const auto grasp  = grasper.update(contact, x, tool);
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
namespace membrane {

template <Real Scalar>
class MovingBody;  // of surface/moving_body.hpp, which the update on a moving body needs

/// Whether forceps hold a point, or why not.
enum class GraspStatus {
    open,     ///< they are not closed
    holding,  ///< they hold a point
    missed,   ///< they closed without contact, as on a flap that nothing supports and that they have pushed away
    slipped,  ///< the tissue has slipped out of the jaws
};

/// A point of the membrane that moves with the tool.
template <Real Scalar>
struct Grasp {
    Index triangle = no_index;                                       ///< `no_index`: no point is held
    std::array<Index, 3> corners{no_index, no_index, no_index};      ///< its vertices
    Vector3<Scalar> barycentric = Vector3<Scalar>::Zero();           ///< of the held point
    Vector3<Scalar> offset = Vector3<Scalar>::Zero();                ///< from the tool to the held point [m]
    Vector3<Scalar> origin = Vector3<Scalar>::Zero();                ///< of the held point, on the rest surface [m]
    Vector3<Scalar> body_velocity = Vector3<Scalar>::Zero();         ///< of a moving body at the held point [m/s]
    Scalar holding_force = std::numeric_limits<Scalar>::infinity();  ///< at which the held point slips [N]
    GraspStatus status = GraspStatus::open;                          ///< whether it is held, or why not

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
    double holding_force = std::numeric_limits<double>::infinity();  ///< at which the tissue slips out of the jaws [N]
    double jaw_length = std::numeric_limits<double>::infinity();     ///< tissue that has slipped so far is free [m]

    /// @throws InvalidInput if a number is not positive
    void validate() const;
};

/// Holds a point from when the tool closes in contact until it opens: the contact point or, where the tool touches
/// several triangles, the point under it along the mean of their normals. If a shaft has no triangle there, as on two
/// hills, it holds the touched point nearest to its `position`.
template <Real Scalar>
class Grasper {
  public:
    /// Keeps a copy of the positions of `mesh`, the rest surface. Cost: O(V).
    /// @throws InvalidInput if an option is out of its range
    explicit Grasper(const TriangleMesh<Scalar>& mesh, GraspOptions options = {})
        : origins_(mesh.positions()), options_((options.validate(), options)), has_reserve_(reserve_of(mesh) > 0) {}

    /// The present grasp. Forceps that closed before the contact hold no point; those that are closed at the first
    /// update count as closing then. If `x` or the body is not of V vertices, nothing changes; a contact of other
    /// vertices is no contact.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool) noexcept;

    /// The present grasp on a moving body: the held point follows the tool, and the body's rotation turns `offset`.
    [[nodiscard]] Grasp<Scalar> update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                       const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept;

    /// After a step: the tissue slips through the jaws if `reaction`, its force on them, is the `holding_force`, and is
    /// free once it has slipped by the `jaw_length`, until they open and close again. Returns whether it slipped.
    /// Jaws of any force: not needed. Online.
    bool slip(const ConstPointsRef<Scalar>& x, const Tool<Scalar>& tool, const Vector3<Scalar>& reaction) noexcept;

    /// Energy that slip through the jaws has taken so far: their force times its distance [J].
    [[nodiscard]] double dissipated() const noexcept { return dissipated_; }

    ///@{
    /// A vertex becomes two; a vertex moves at rest. The held point stays the same point of the tissue. Online.
    void split(const VertexSplit& split) noexcept {
        origins_.col(split.copy) = origins_.col(split.vertex);
        if (split.takes(grasp_.triangle)) split.replace_in(grasp_.corners);
    }
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Drops the held point and the closed state. Later grasps equal those of a new grasper, bit for bit.
    void reset() noexcept {
        grasp_ = {};
        pose_ = {};
        closed_ = false;
        slipped_ = 0;
        dissipated_ = 0;
    }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`; of a mesh with a reserve, the rest surface as
    /// well.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if (self.has_reserve_) visit(self.origins_);
        visit(self.grasp_, self.pose_, self.closed_, self.slipped_, self.dissipated_);
    }

  private:
    void hold(Index triangle, const std::array<Index, 3>& corners, const Vector3<Scalar>& barycentric) noexcept {
        grasp_.triangle = triangle;
        grasp_.corners = corners;
        grasp_.barycentric = barycentric;
    }
    void take_point(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x, const Tool<Scalar>& tool) noexcept;

    Points<Scalar> origins_;
    GraspOptions options_;
    Grasp<Scalar> grasp_;
    RigidFrame<Scalar> pose_;  // of the body at the last update
    bool closed_ = false;
    Scalar slipped_ = 0;  // since the jaws closed [m]
    double dissipated_ = 0;
    bool has_reserve_;
};

inline void GraspOptions::validate() const {
    constexpr std::string_view component = "Grasper";
    if (!(holding_force > 0)) refuse(component, "holding_force must be positive [N], got ", holding_force);
    if (!(jaw_length > 0)) refuse(component, "jaw_length must be positive [m], got ", jaw_length);
}

template <Real Scalar>
Grasp<Scalar> Grasper<Scalar>::update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                      const Tool<Scalar>& tool) noexcept {
    if (x.cols() != origins_.cols()) return grasp_;
    const bool closes = tool.grasping && !closed_;
    closed_ = tool.grasping;
    if (!tool.grasping) grasp_ = {};
    if (closes) grasp_.status = GraspStatus::missed;
    if (!closes || !contact.touching() || !is_valid(tool) || !are_vertices(contact.corners, x.cols())) return grasp_;

    slipped_ = 0;
    grasp_.status = GraspStatus::holding;
    grasp_.holding_force = static_cast<Scalar>(options_.holding_force);
    take_point(contact, x, tool);
    if (options_.snap_to_vertex) {
        const Vector3<Scalar> weights = grasp_.barycentric;
        grasp_.barycentric = Vector3<Scalar>::Unit(std::max_element(weights.begin(), weights.end()) - weights.begin());
    }
    grasp_.offset = point_at(triangle_at(x, grasp_.corners), grasp_.barycentric) - tool.position;
    grasp_.origin = point_at(triangle_at(origins_, grasp_.corners), grasp_.barycentric);
    return grasp_;
}

// At equilibrium the tool touches several triangles, and rounding decides which is the nearest. So the mean of those
// equally near counts, each less the less near it is, whether they carry the contact or their vertices do.
template <Real Scalar>
void Grasper<Scalar>::take_point(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                 const Tool<Scalar>& tool) noexcept {
    hold(contact.triangle, contact.corners, contact.barycentric);
    if (contact.patch.tunnelled) return;
    constexpr Scalar infinity = std::numeric_limits<Scalar>::infinity();
    Scalar least = infinity, sum = 0, nearest = infinity;
    const Scalar farthest = contact.patch.detection_distance - contact.patch.radius;
    const auto each_point = [&](const auto& visit) {
        for (const auto& [f, corners, lift] : contact.patch.triangles) {
            each_contact_point(f, corners, triangle_at(x, corners), tool, contact.patch.radius, visit);
        }
    };
    each_point([&](const auto& point) { least = (std::min)(least, point.gap); });
    Vector3<Scalar> normal = Vector3<Scalar>::Zero(), axis_point = Vector3<Scalar>::Zero();
    each_point([&](const auto& point) {
        const Scalar weight = 1 - 64 * (point.gap - least) / contact.patch.radius;
        if (!(weight > 0) || point.gap > farthest) return;
        const Vector3<Scalar> here =
            point_at(triangle_at(x, point.corners), point.weights) + (point.gap + contact.patch.radius) * point.normal;
        sum += weight;
        normal += weight * point.normal;
        axis_point += weight * here;
        const Scalar from_tip = squared_norm<Scalar>(here - tool.position);
        if (!is_shaft(tool) || !(from_tip < nearest)) return;
        nearest = from_tip;
        hold(point.triangle, point.corners, point.weights);
    });
    if (!(sum > 1) || !(norm(normal) > sum / 8)) return;
    const Vector3<Scalar> from = axis_point / sum, to = from - 4 * contact.patch.radius * direction(normal, normal);
    Scalar first = infinity;
    for (const auto& [triangle, corners, lift] : contact.patch.candidates) {
        const auto hit = first_hit(triangle_at(x, corners), from, to);
        if (!hit || !(hit->fraction < first)) continue;
        first = hit->fraction;
        hold(triangle, corners, hit->barycentric);
    }
}

template <Real Scalar>
bool Grasper<Scalar>::slip(const ConstPointsRef<Scalar>& x, const Tool<Scalar>& tool,
                           const Vector3<Scalar>& reaction) noexcept {
    constexpr Scalar rounding = Scalar(64) * std::numeric_limits<Scalar>::epsilon();
    if (!grasp_.holding() || !(norm(reaction) >= (1 - rounding) * grasp_.holding_force) || !is_valid(tool))
        return false;
    if (x.cols() != origins_.cols()) return false;
    const Vector3<Scalar> now = point_at(triangle_at(x, grasp_.corners), grasp_.barycentric) - tool.position;
    const Vector3<Scalar> by = now - grasp_.offset;
    slipped_ += norm(by);
    dissipated_ += (std::max)(0.0, static_cast<double>(dot(by, reaction)));
    grasp_.offset = now;
    if (slipped_ >= static_cast<Scalar>(options_.jaw_length)) {
        grasp_ = {};
        grasp_.status = GraspStatus::slipped;
    }
    return true;
}

template <Real Scalar>
void Grasper<Scalar>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    origins_.col(moved.vertex) = moved.rest;
    const auto at = [](const std::array<Vector3<Scalar>, 3>& x) { return Triangle<Scalar>{x[0], x[1], x[2]}; };
    const auto held = std::find_if(moved.triangles.begin(), moved.triangles.end(),
                                   [&](const auto& one) { return one.triangle == grasp_.triangle; });
    if (!grasp_.holding() || held == moved.triangles.end()) return;
    const Vector3<Scalar> rest = point_at(at(held->before), grasp_.barycentric);
    Scalar least = std::numeric_limits<Scalar>::infinity();
    for (const auto& one : moved.triangles) {
        const auto nearest = closest_point(at(one.after), rest);
        if (!(nearest.squared_distance < least)) continue;
        least = nearest.squared_distance;
        hold(one.triangle, one.corners, nearest.barycentric);
    }
}

template <Real Scalar>
Grasp<Scalar> Grasper<Scalar>::update(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& x,
                                      const Tool<Scalar>& tool, const MovingBody<Scalar>& body) noexcept {
    if (x.cols() != origins_.cols() || body.anchors().cols() != x.cols()) return grasp_;
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
