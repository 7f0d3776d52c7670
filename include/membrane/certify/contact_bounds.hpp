// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/accuracy/equilibrium_scene.hpp>
#include <membrane/accuracy/tool_points.hpp>

/// Bounds, in a neighbourhood of a state, where tools press, with which forces, and how much these reduce the
/// stiffness.
///
///     membrane::ContactBounds pressed(problem);
///     pressed.assign(problem, triangles, y, scene.tools(), rest.contacts);
///     if (pressed.bound_softening(problem, force, magnitude, 1e-5)) stiffness -= pressed.softening(v);  // [N/m]
namespace membrane {

/// Bounds for tools in contact that hold at all states whose vertices are within `max_displacement` of y.
///
/// Contact forces reduce the stiffness, at each vertex, by at most the multipliers on its corners over the distance
/// from the axis. At a vertex, the sum of the multipliers is at most the force of springs and foundation over the
/// cosine of the largest angle between a contact direction and their middle. Derivation: README.md in this folder.
class ContactBounds {
  public:
    /// Cost: O(V) memory.
    explicit ContactBounds(const EquilibriumProblem& problem)
        : marks_(static_cast<std::size_t>(problem.vertex_count())), borne_(marks_.size()), stiffness_(marks_.size()) {}

    /// Removes all tools.
    void clear() noexcept;

    /// Takes the tools of a scene, and the contact points whose forces approximately balance the membrane at `y` (3 x V
    /// [m]); `carriers` are as for `tool_points`. Offline.
    /// @pre the contact points are of these tools
    void assign(const EquilibriumProblem& problem, const Triangles& triangles, const Points<double>& y,
                std::span<const ScenePress> tools, std::span<const ToolPoint> contacts,
                std::span<const ContactVertices> carriers = {});

    /// Computes the bounds below for all states within `max_displacement` [m] of y, where the membrane acts on its
    /// vertices with `force`, a sum of terms of this `magnitude` [N]. False if a tool may touch a vertex that is fixed
    /// or that another tool may touch, or if the tool is too small or the displacement too large to bound the contact
    /// directions.
    bool bound_softening(const EquilibriumProblem& problem, const Points<double>& force,
                         std::span<const double> magnitude, double max_displacement) noexcept;

    /// Upper bound of the reduction of stiffness by contact forces at vertex `v` [N/m].
    [[nodiscard]] double softening(Index v) const noexcept { return marks_[at(v)].softening; }

    /// Adds 1 to the weights of the vertices that tool number `i` of the scene may touch: the forces on them are
    /// balanced by reactions on the tool.
    void share(std::size_t i, std::vector<double>& weights) const noexcept {
        for (std::size_t v = 0; v < marks_.size(); ++v) weights[v] += marks_[v].tool == i ? 1 : 0;
    }

    /// Upper bound of the penetration of a tool at y, rounding included [m].
    [[nodiscard]] double penetration() const noexcept { return penetration_; }

    /// Upper bound of the residual work at y: contact forces times their gaps, plus the work of contact forces across
    /// penetrations [J].
    [[nodiscard]] double work() const noexcept { return work_ + max_normal_force_ * penetration_; }

    /// A ball around y with at least this radius contains a state without penetration, with clearance [m].
    [[nodiscard]] double min_radius() const noexcept { return 4 * clearance_; }

    /// Upper limit of the radius of a ball around y [m].
    [[nodiscard]] double max_radius() const noexcept { return max_radius_; }

    /// Adds the contact forces to the forces on the vertices [N], and to their magnitudes.
    void add_force(Points<double>& force, std::vector<double>& magnitude) const noexcept;

  private:
    static constexpr std::size_t none = (std::numeric_limits<std::size_t>::max)();

    using Wide = Eigen::Matrix<long double, 3, 1>;
    struct Near {  // a triangle that a tool may touch, or a vertex that carries the contact, three times
        std::size_t tool;
        std::array<Index, 3> corners;
        double min_distance;  // from the axis that contact leaves: the tool's radius and the lift [m]
        Vector3<double> u;    // from the axis to the triangle
        double distance;      // [m]
    };
    struct Mark {  // of a vertex
        std::size_t tool = none;
        Vector3<double> middle = Vector3<double>::Zero();
        double cosine = 1;
        double softening = 0;  // [N/m]
    };
    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    void find_near(std::size_t i, const Triangles& triangles, const Points<double>& y, const Tool<double>& tool,
                   const ContactVertices& vertices);
    void add_near(std::size_t i, const std::array<Index, 3>& corners, double lift, const Points<double>& y,
                  const Tool<double>& tool);
    [[nodiscard]] Vector3<double> take_contact(const ToolPoint& contact, const Points<double>& y,
                                               const Tool<double>& tool) noexcept;
    [[nodiscard]] static Wide wide(const Vector3<double>& a) noexcept { return {a.x(), a.y(), a.z()}; }
    [[nodiscard]] static Wide seen_from(const Tool<double>& tool, const Points<double>& y, Index v) noexcept {
        return wide(point(y, v)) - wide(tool.position);
    }
    bool mark(const EquilibriumProblem& problem, double max_displacement) noexcept;
    bool narrow(double max_displacement) noexcept;

    std::vector<double> radii_, least_;  // of the tools; least distances from their axes of what may touch [m]
    std::vector<Near> near_;
    std::vector<ToolPoint> contacts_;
    std::vector<Mark> marks_;
    std::vector<double> borne_, stiffness_;             // of vertices: multipliers at y [N], stiffness bound [N/m]
    double penetration_ = 0, work_ = 0, rounding_ = 0;  // at y
    double max_normal_force_ = 0, clearance_ = 0, max_radius_ = std::numeric_limits<double>::infinity();
};

inline void ContactBounds::clear() noexcept {
    radii_.clear();
    near_.clear();
    contacts_.clear();
    std::fill(marks_.begin(), marks_.end(), Mark{});
    penetration_ = work_ = rounding_ = max_normal_force_ = clearance_ = 0;
    max_radius_ = std::numeric_limits<double>::infinity();
}

inline void ContactBounds::assign(const EquilibriumProblem& problem, const Triangles& triangles,
                                  const Points<double>& y, std::span<const ScenePress> tools,
                                  std::span<const ToolPoint> contacts, std::span<const ContactVertices> carriers) {
    clear();
    for (std::size_t i = 0; i < tools.size(); ++i) {
        radii_.push_back(tools[i].tool.radius);
        find_near(i, triangles, y, tools[i].tool, i < carriers.size() ? carriers[i] : ContactVertices());
    }
    std::fill(borne_.begin(), borne_.end(), 0.0);
    for (const auto& contact : contacts) {
        contacts_.push_back(contact);
        contacts_.back().normal = take_contact(contact, y, tools[contact.tool].tool);
        for (std::size_t k = 0; k < 3; ++k) {
            borne_[at(contact.corners[k])] += contact.multiplier * contact.weight(k);
        }
    }
    for (Index v = 0; v < problem.vertex_count(); ++v) stiffness_[at(v)] = problem.foundation(v);
    for (const auto& spring : problem.springs()) {
        stiffness_[at(spring.first)] += 2 * spring.stiffness;
        stiffness_[at(spring.second)] += 2 * spring.stiffness;
    }
}

inline void ContactBounds::find_near(std::size_t i, const Triangles& triangles, const Points<double>& y,
                                     const Tool<double>& tool, const ContactVertices& vertices) {
    const double max_distance = 1.25 * (tool.radius + vertices.largest_lift(tool.radius));
    for (const auto& of_triangle : triangles.colwise()) {
        const std::array<Index, 3> corners{of_triangle[0], of_triangle[1], of_triangle[2]};
        if (detail::is_far(triangle_at(y, corners), tool, max_distance)) continue;
        for (const Index v : corners) {
            if (vertices.carries(v, tool.radius)) add_near(i, {v, v, v}, vertices.lift(v, tool.radius), y, tool);
        }
        add_near(i, corners, vertices.face_lift(corners, tool.radius), y, tool);
    }
}

// Computed relative to the tool, where numbers are small, and in long double: the bound is no better than the square
// root of rounding. The smallest projection of a corner onto u is a lower bound of the distance from the axis, even if
// u is off by rounding.
inline void ContactBounds::add_near(std::size_t i, const std::array<Index, 3>& corners, double lift,
                                    const Points<double>& y, const Tool<double>& tool) {
    const auto nearest = closest_to_axis(triangle_at(y, corners), tool);
    const Vector3<double> separation = nearest.on_triangle.point - tool.position - nearest.fraction * tool.axis;
    const Vector3<double> u = direction<double>(separation, Vector3<double>::Zero());
    const Wide wide_u = wide(u), axis = wide(tool.axis);
    long double distance = std::numeric_limits<long double>::infinity(), size = axis.norm() + tool.radius;
    for (const Index v : corners) {
        const Wide corner = seen_from(tool, y, v);
        distance = (std::min)(distance, wide_u.dot(corner));
        size = (std::max)(size, corner.norm() + axis.norm());
    }
    distance = (distance - (std::max)(wide_u.dot(axis), 0.0L)) / (std::max)(wide_u.norm(), 0.5L);
    constexpr long double rounding = 16 * std::numeric_limits<long double>::epsilon();
    const double min_distance = tool.radius + lift;
    rounding_ = (std::max)(rounding_, static_cast<double>(rounding * size));
    penetration_ = (std::max)(penetration_, static_cast<double>(min_distance - distance + rounding * size));
    near_.push_back({i, corners, min_distance, u, static_cast<double>(distance)});
}

// The normal at the contact point at `y`; adds the work across its gap.
inline Vector3<double> ContactBounds::take_contact(const ToolPoint& contact, const Points<double>& y,
                                                   const Tool<double>& tool) noexcept {
    Wide position = Wide::Zero();
    long double weights = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const long double weight = contact.weight(k);
        position += weight * seen_from(tool, y, contact.corners[k]);
        weights += weight;
    }
    position /= weights;
    const Wide axis = wide(tool.axis);
    const long double length = axis.squaredNorm();
    long double along = contact.part() == 1 ? 1 : 0;
    if (contact.part() == 2 && length > 0) along = position.dot(axis) / length;
    if (contact.part() == vertex_feature && length > 0) along = std::clamp(position.dot(axis) / length, 0.0L, 1.0L);
    const Wide separation = along * axis - position;
    const auto gap = static_cast<double>(separation.norm() - (tool.radius + contact.lift));
    work_ += contact.multiplier * ((std::max)(gap, 0.0) + rounding_);
    return direction<double>(separation.cast<double>(), contact.normal);
}

inline bool ContactBounds::bound_softening(const EquilibriumProblem& problem, const Points<double>& force,
                                           std::span<const double> magnitude, double max_displacement) noexcept {
    if (radii_.empty()) return true;
    max_displacement =
        (1 + 1e-9) * max_displacement + rounding_ + 1e-15 * *std::max_element(radii_.begin(), radii_.end());
    if (!mark(problem, max_displacement) || !narrow(max_displacement)) return false;
    max_normal_force_ = 0;
    max_radius_ = std::numeric_limits<double>::infinity();
    double min_cosine = 1, count = 0;
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        auto& mark = marks_[at(v)];
        if (mark.tool == none) continue;
        const double max_force =
            norm(point(force, v)) + problem.rounding() * magnitude[at(v)] + stiffness_[at(v)] * max_displacement;
        const double borne = (std::max)(borne_[at(v)], max_force / mark.cosine);
        const double min_distance = least_[mark.tool] - 2 * max_displacement - penetration_;
        if (!(min_distance > radii_[mark.tool] / 4)) return false;
        mark.softening = (1 + 1e-9) * borne / min_distance;
        max_normal_force_ += (1 + 1e-9) * borne;
        max_radius_ = (std::min)(max_radius_, mark.cosine * min_distance);
        min_cosine = (std::min)(min_cosine, mark.cosine);
        count += 1;
    }
    clearance_ = penetration_ * std::sqrt(count) / min_cosine;
    return clearance_ <= max_displacement;
}

// Assigns to each vertex the tool that may touch it; false if there are two, or the vertex is fixed.
inline bool ContactBounds::mark(const EquilibriumProblem& problem, double max_displacement) noexcept {
    std::fill(marks_.begin(), marks_.end(), Mark{});
    least_ = radii_;
    for (const auto& candidate : near_) {
        if (candidate.distance - candidate.min_distance > max_displacement) continue;
        least_[candidate.tool] = (std::min)(least_[candidate.tool], candidate.min_distance);
        for (const Index v : candidate.corners) {
            auto& mark = marks_[at(v)];
            if (problem.fixed(v) || (mark.tool != none && mark.tool != candidate.tool)) return false;
            mark.tool = candidate.tool;
            mark.middle += candidate.u;
        }
    }
    for (auto& mark : marks_) mark.middle = direction<double>(mark.middle, Vector3<double>::Zero());
    return std::all_of(contacts_.begin(), contacts_.end(), [&](const ToolPoint& contact) {
        const auto vertices = contact.vertices();
        return std::all_of(vertices.begin(), vertices.end(),
                           [&](Index v) { return marks_[at(v)].tool == contact.tool; });
    });
}

// Bounds the contact directions at each vertex; false if they are too wide.
inline bool ContactBounds::narrow(double max_displacement) noexcept {
    constexpr double min_allowed = 0.2;  // of a cosine
    const auto sine = [](double cosine) { return std::sqrt((std::max)(1 - cosine * cosine, 0.0)); };
    for (const auto& candidate : near_) {
        if (candidate.distance - candidate.min_distance > max_displacement) continue;
        const double from_u = (std::min)((candidate.distance - max_displacement) / candidate.min_distance, 1.0);
        for (const Index v : candidate.corners) {
            auto& mark = marks_[at(v)];
            const double u_from_middle = (std::min)(dot(mark.middle, candidate.u), 1.0);
            if (!(from_u > min_allowed && u_from_middle > min_allowed)) return false;
            const double together = from_u * u_from_middle - sine(from_u) * sine(u_from_middle) - 1e-12;
            mark.cosine = (std::min)(mark.cosine, together);
            if (!(mark.cosine > min_allowed)) return false;
        }
    }
    return true;
}

inline void ContactBounds::add_force(Points<double>& force, std::vector<double>& magnitude) const noexcept {
    for (const auto& contact : contacts_) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index v = contact.corners[k];
            const Vector3<double> part = contact.multiplier * contact.gradient(k);
            force.col(v) += part;
            magnitude[at(v)] += norm(part);
        }
    }
}

}  // namespace membrane
