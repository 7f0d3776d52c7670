// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/core/fixed_vector.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Coulomb friction between a tool and the membrane: the tool drags the tissue along.
///
///     auto friction = membrane::ToolFriction<double>({.coefficient = 0.3});
///     const auto contact = tracker.update(tree, x, tool);
///     const auto report  = solver.step(x, dt, network, foundation, friction.press(tool, contact));
namespace membrane {

/// Options of `ToolFriction`.
struct ToolFrictionOptions {
    double coefficient;               ///< of Coulomb friction: largest ratio of tangential to normal force, at most 10
    Index max_contact_points = 4096;  ///< capacity, see `SolverOptions`; points beyond it have no friction

    /// @throws InvalidInput if a number is out of its range
    void check() const;
};

/// The place of the membrane that a contact point holds, and the friction force there.
template <Real Scalar>
struct StickingPoint {
    Index triangle;                   ///< of the contact point
    int feature;                      ///< of the tool, as of the contact point
    std::array<Index, 3> corners;     ///< of the triangle
    Vector3<Scalar> weights;          ///< barycentric, of the place on the membrane
    Scalar along;                     ///< of the place on the tool: fraction of the axis
    Vector3<Scalar> offset;           ///< from there to the place on the membrane [m]
    Vector3<Scalar> force;            ///< of friction on the membrane [N]
    Vector3<Scalar> sticking_force;   ///< that would keep the place, by the last pass [N]
    Scalar pressure = 0;              ///< the normal force [N]
    Vector3<Scalar> normal{0, 0, 1};  ///< of the contact point
};

template <Real Scalar>
class ToolFriction;

/// `ToolContact` with friction: made by `ToolFriction::press`.
template <Real Scalar>
struct FrictionalContact {
    ToolContact<Scalar> normal;      ///< without friction
    ToolFriction<Scalar>* friction;  ///< of this tool; must outlive the step

    ///@{
    /// As `Constraint` requires. The reaction is the sum of normal and friction forces.
    [[nodiscard]] bool valid() const noexcept { return normal.valid(); }
    [[nodiscard]] DrivingInput<Scalar> driving_input() const noexcept { return normal.driving_input(); }
    void begin(ConstraintContext<Scalar>& context) const noexcept {
        normal.begin(context);
        friction->begin(context, normal.tool);
    }
    bool enforce(ConstraintContext<Scalar>& context) const noexcept {
        if (!normal.contact.touching()) return false;
        const bool slipped = friction->solve(context, normal.tool);
        const bool pressed = normal.enforce(context);
        friction->limit(context);
        return slipped || pressed;
    }
    [[nodiscard]] Vector3<Scalar> reaction(const ConstraintContext<Scalar>& context) const noexcept {
        return normal.reaction(context) + friction->reaction();
    }
    void end(const ConstraintContext<Scalar>& context) const noexcept { friction->end(context, normal.tool); }
    ///@}
};

/// Friction of one tool, and what it keeps from tick to tick. Each contact point holds a place of the membrane: a force
/// along the surface keeps it where it is on the tool, as long as that takes at most `coefficient` times the normal
/// force of the point; else the place slips, against that force: the exact cone. The forces are found within the step,
/// with all others, by projected Gauss-Seidel. Under a tool at rest the membrane does not creep: places are kept, and
/// not displacements. With a coefficient near 1 or above it may: normal and friction forces of neighbouring points may
/// alternate, so that a step does not converge. A contact point that moves on to another triangle takes hold anew.
///
/// The tool does not rotate: a shaft that turns drags as if it were shifted. Fixed corners take no friction. `ContactFriction` adds friction to the
/// hand's force alone; with this part the reaction has it. `equilibrium` and error bounds do not know it.
///
/// A step that is refused leaves it unchanged, to the bit.
///
/// Online, but for the constructor. Cost: linear in the contact points, in each sweep.
template <Real Scalar>
class ToolFriction {
  public:
    /// Allocates. @throws InvalidInput if an option is out of its range
    explicit ToolFriction(const ToolFrictionOptions& options)
        : coefficient_((options.check(), static_cast<Scalar>(options.coefficient))),
          points_(static_cast<std::size_t>(options.max_contact_points)),
          kept_(points_) {}

    /// The tool presses at its contact, as by `membrane::press`, with friction. In one step at most once; must outlive
    /// the step.
    [[nodiscard]] FrictionalContact<Scalar> press(const Tool<Scalar>& tool, const Contact<Scalar>& contact,
                                                  const Grasp<Scalar>& grasp = {}) noexcept {
        return {membrane::press(tool, contact, grasp), this};
    }

    /// The contact points of the last step, with their friction.
    [[nodiscard]] std::span<const StickingPoint<Scalar>> points() const noexcept { return kept_.items(); }

    /// Whether a point with a normal force slips in the last step.
    [[nodiscard]] bool slips() const noexcept {
        return std::any_of(points().begin(), points().end(),
                           [this](const Point& point) { return point.pressure > 0 && is_at_limit(point); });
    }

    ///@{
    /// A vertex becomes two; a vertex moves at rest. A point holds the same place of the membrane. Online. Cost: contact
    /// points times the triangles around the vertex.
    void split(const VertexSplit& split) noexcept {
        for (Point& point : kept_.items()) {
            if (split.takes(point.triangle)) split.replace_in(point.corners);
        }
    }
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Forgets all places. Cost: O(1).
    void reset() noexcept {
        kept_.clear();
        tool_ = {};
        has_tool_ = false;
    }

    /// Visits what is kept from tick to tick, see `core/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.kept_, self.tool_, self.has_tool_);
    }

  private:
    friend FrictionalContact<Scalar>;
    using Context = ConstraintContext<Scalar>;
    using Point = StickingPoint<Scalar>;

    void begin(Context& context, const Tool<Scalar>& tool) noexcept;
    bool solve(Context& context, const Tool<Scalar>& tool) noexcept;
    void limit(Context& context) noexcept;
    [[nodiscard]] Vector3<Scalar> reaction() const noexcept;
    void end(const Context& context, const Tool<Scalar>& tool) noexcept;

    void read_normal_forces(Context& context) noexcept;
    [[nodiscard]] const Point* kept(const ContactPoint<Scalar>& point, std::size_t& next) const noexcept;
    [[nodiscard]] Scalar stick(Context& context, const Tool<Scalar>& tool, Point& point) const noexcept;
    [[nodiscard]] Vector3<Scalar> limited(const Vector3<Scalar>& force, const Point& point) const noexcept;
    [[nodiscard]] bool is_at_limit(const Point& point) const noexcept {
        constexpr Scalar rounding = Scalar(64) * std::numeric_limits<Scalar>::epsilon();
        return norm(point.force) >= coefficient_ * point.pressure * (1 - rounding);
    }
    [[nodiscard]] static Vector3<Scalar> place(const Context& context, const Point& point) noexcept {
        return point_at(triangle_of(context, point.corners), point.weights);
    }
    [[nodiscard]] static Vector3<Scalar> on_tool(const Tool<Scalar>& tool, const Point& point) noexcept {
        return tool.position + point.along * tool.axis;
    }
    // Lets the point hold its place, at `position`, by `tool`.
    static void hold(Point& point, const Vector3<Scalar>& position, const Tool<Scalar>& tool) noexcept;

    Scalar coefficient_;
    FixedVector<Point> points_, kept_;  // of this step, in the order of the contact points; of the last one
    Tool<Scalar> tool_;                 // in the last step
    bool has_tool_ = false;
};

inline void ToolFrictionOptions::check() const {
    constexpr std::string_view component = "ToolFriction";
    detail::check_option(component, coefficient, "coefficient", "1");
    if (coefficient > 10) refuse(component, "coefficient must be at most 10, got ", coefficient);
    if (max_contact_points < 1) {
        refuse(component, "max_contact_points must be at least 1, got ", max_contact_points);
    }
}

// Finds the places that the contact points of this step hold, and applies their forces of the last step.
template <Real Scalar>
void ToolFriction<Scalar>::begin(Context& context, const Tool<Scalar>& tool) noexcept {
    points_.clear();
    const auto contacts = std::as_const(context).points();
    std::size_t next = 0;  // of the points that are kept, in nearly the same order
    for (const auto& contact : contacts) {
        Point point;
        if (const auto* before = kept(contact, next); before != nullptr) {
            point = *before;
        } else {
            point.triangle = contact.triangle;
            point.feature = contact.feature;
            point.corners = contact.corners;
            point.weights = contact.weights;
            point.force = Vector3<Scalar>::Zero();
            const auto& v = contact.corners;
            const Triangle<Scalar> start{context.start(v[0]), context.start(v[1]), context.start(v[2])};
            hold(point, point_at(start, point.weights), has_tool_ ? tool_ : tool);
        }
        point.pressure = norm(contact.force);
        point.normal = contact.normal;
        point.force = point.sticking_force = limited(point.force, point);
        if (!points_.try_push_back(point)) break;
        add_point_force(context, point.corners, point.weights, point.force);
    }
}

// The point of the last step with this triangle and feature, or null; searches from `next` on.
template <Real Scalar>
auto ToolFriction<Scalar>::kept(const ContactPoint<Scalar>& point, std::size_t& next) const noexcept -> const Point* {
    const auto all = kept_.items();
    const auto same = [&](const Point& other) {
        return other.triangle == point.triangle && other.feature == point.feature && other.corners == point.corners;
    };
    const auto from = all.begin() + static_cast<std::ptrdiff_t>(next);
    auto found = std::find_if(from, all.end(), same);
    if (found == all.end()) {
        found = std::find_if(all.begin(), from, same);
        if (found == from) return nullptr;
    }
    next = static_cast<std::size_t>(found - all.begin()) + 1;
    return is_finite(found->force) && is_finite(found->offset) ? &*found : nullptr;
}

template <Real Scalar>
void ToolFriction<Scalar>::hold(Point& point, const Vector3<Scalar>& position, const Tool<Scalar>& tool) noexcept {
    const Scalar square = squared_norm<Scalar>(tool.axis);
    const Scalar along = square > 0 ? dot<Scalar>(position - tool.position, tool.axis) / square : Scalar(0);
    point.along = std::clamp(along, Scalar(0), Scalar(1));
    point.offset = position - on_tool(tool, point);
}

// Normal forces and normals by the last pass over the contact points.
template <Real Scalar>
void ToolFriction<Scalar>::read_normal_forces(Context& context) noexcept {
    auto& state = context.state();
    const auto first = static_cast<Index>(state.point_ranges[context.constraint()].begin);
    for (const auto& pack : state.pack_ranges[context.constraint()].of(state.packs.items())) {
        for (std::size_t i = 0; i < pack.size; ++i) {
            const auto at = static_cast<std::size_t>(pack.point[i] - first);
            if (at >= points_.size()) continue;
            Point& point = points_.items()[at];
            point.pressure = pack.load.force[i];
            point.normal = {pack.load.normal[0][i], pack.load.normal[1][i], pack.load.normal[2][i]};
        }
    }
}

// Without the part along the normal, and within the cone.
template <Real Scalar>
Vector3<Scalar> ToolFriction<Scalar>::limited(const Vector3<Scalar>& force, const Point& point) const noexcept {
    const Vector3<Scalar> tangential = force - dot(force, point.normal) * point.normal;
    const Scalar size = norm(tangential), largest = coefficient_ * point.pressure;
    return size > largest ? (largest / size) * tangential : tangential;
}

// Changes the force of a point by its slip over the compliance in that direction, and moves the corners by their
// response. Returns the change [N], zero if the response is negligible.
template <Real Scalar>
Scalar ToolFriction<Scalar>::stick(Context& context, const Tool<Scalar>& tool, Point& point) const noexcept {
    const Vector3<Scalar> now = place(context, point), off = now - on_tool(tool, point) - point.offset;
    const Vector3<Scalar> slip = off - dot(off, point.normal) * point.normal;
    const Vector3<Scalar> along = direction_or_zero(slip);
    const Scalar compliance = dot(along, response_of<Scalar>(context, point, along));
    point.sticking_force = compliance > 0 ? point.force - (1 / compliance) * slip : point.force;
    const Vector3<Scalar> change = limited(point.sticking_force, point) - point.force;
    const Scalar size = norm(change);
    if (!(size > context.force_tolerance()) || !(size * compliance > detail::rounding_at(now))) return 0;
    membrane::change_force<Scalar>(context, point, change);
    return size;
}

// Some passes of projected Gauss-Seidel. Returns whether a force changed.
template <Real Scalar>
bool ToolFriction<Scalar>::solve(Context& context, const Tool<Scalar>& tool) noexcept {
    constexpr int max_passes = 4;
    read_normal_forces(context);
    Scalar first = 0;
    for (int pass = 0; pass < max_passes; ++pass) {
        Scalar largest = 0;
        for (auto& point : points_.items()) largest = (std::max)(largest, stick(context, tool, point));
        if (pass == 0) first = largest;
        if (!(largest > first / 2)) break;
    }
    return first > 0;
}

// Limits the forces by the normal forces of now, which the contact has changed since the last pass.
template <Real Scalar>
void ToolFriction<Scalar>::limit(Context& context) noexcept {
    read_normal_forces(context);
    for (auto& point : points_.items()) {
        const Vector3<Scalar> now = limited(point.sticking_force, point);
        if (now == point.force) continue;
        add_point_force<Scalar>(context, point.corners, point.weights, now - point.force);
        point.force = now;
    }
}

// The sum of the forces on the tool.
template <Real Scalar>
Vector3<Scalar> ToolFriction<Scalar>::reaction() const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const auto& point : points_.items()) sum -= point.force;
    return sum;
}

// Keeps the points of a step that has advanced. Those that slip, or do not press, hold what is in contact now.
template <Real Scalar>
void ToolFriction<Scalar>::end(const Context& context, const Tool<Scalar>& tool) noexcept {
    const auto contacts = context.points();
    for (std::size_t i = 0; i < points_.size(); ++i) {
        Point& point = points_.items()[i];
        if (!is_at_limit(point)) continue;
        point.weights = contacts[i].weights;
        hold(point, place(context, point), tool);
    }
    std::swap(points_, kept_);
    tool_ = tool;
    has_tool_ = true;
}

namespace detail {

/// The weights of the point of the triangle's plane that is nearest to `q`; negative beyond a side.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> weights_in_plane(const Triangle<Scalar>& triangle, const Vector3<Scalar>& q) noexcept {
    const Vector3<Scalar> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, aq = q - triangle.a;
    const Vector3<Scalar> twice = cross(ab, ac), normal = direction_or_zero(twice);
    const Scalar b = dot(cross(aq, ac), normal) / norm(twice), c = dot(cross(ab, aq), normal) / norm(twice);
    return {1 - b - c, b, c};
}

}  // namespace detail

// The place may be beyond a side of its triangle from then on: as far as the membrane is smooth, the same place.
template <Real Scalar>
void ToolFriction<Scalar>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    const auto at = [](const std::array<Vector3<Scalar>, 3>& x) { return Triangle<Scalar>{x[0], x[1], x[2]}; };
    for (Point& point : kept_.items()) {
        for (const auto& one : moved.triangles) {
            if (one.triangle != point.triangle) continue;
            point.weights = detail::weights_in_plane(at(one.after), point_at(at(one.before), point.weights));
        }
    }
}

static_assert(Constraint<FrictionalContact<double>, double> && Constraint<FrictionalContact<float>, float>);

}  // namespace membrane
