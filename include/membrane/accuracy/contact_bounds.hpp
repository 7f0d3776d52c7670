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

/// What tools may press on in a neighbourhood of a state, how hard, and what that takes away of the stiffness.
///
///     membrane::ContactBounds pressed(problem);
///     pressed.take(problem, triangles, y, scene.tools(), rest.contacts);
///     if (pressed.around(problem, force, magnitude, displacement)) ... pressed.softening(v) ...
namespace membrane {

/// Tools in contact, for a proof that holds at all states whose vertices are within `displacement` of y.
///
/// A tool of radius R keeps every point p of the surface, a mean of three corners by weights b, at least R away from each
/// point c of its axis: h = |p - c| - R >= 0. Each h is a convex function of the corners, and where the distance is d it
/// does not curve by more than 1/d times the square of the way of p, which is no more than the mean of the squares of
/// the corners' ways. So a multiplier l curves the energy by no more than l/d times that: all of them together take
/// away from the stiffness, at each vertex, the multipliers that its corners bear over d.
///
/// What a vertex may bear: let u be the unit vector between the nearest points of axis and triangle at y, g their
/// distance. As the two are convex, no pair of points is nearer along u. So where, in the neighbourhood, a pair has the
/// distance R, the direction between them has a cosine of at least (g - way) / R with u. All that presses on a vertex
/// at rest balances its springs and foundation; if the directions are within an angle a of one another's middle, the sum of
/// the pressures is at most that force over cos a.
class ContactBounds {
  public:
    /// Cost: O(V) memory.
    explicit ContactBounds(const EquilibriumProblem& problem)
        : marks_(static_cast<std::size_t>(problem.vertex_count())), borne_(marks_.size()), stiffness_(marks_.size()) {}

    /// No tools.
    void clear() noexcept;

    /// The tools of a scene, and the pressures that are thought to balance the membrane at `y` (3 x V [m]). Offline.
    /// @pre the touches are of these tools
    void take(const EquilibriumProblem& problem, const Triangles& triangles, const Points<double>& y,
              std::span<const ScenePress> tools, std::span<const ToolPoint> contacts);

    /// Finds what is below for all states within `displacement` [m] of y, where the membrane acts on its vertices with `force`,
    /// made of numbers of this `magnitude` [N]. False where a tool may touch a vertex that is fixed or that another tool
    /// may touch, or is so small, or the way so long, that it may be pressed from anywhere.
    bool around(const EquilibriumProblem& problem, const Points<double>& force, std::span<const double> magnitude,
                double displacement) noexcept;

    /// What the pressures take away of the stiffness at vertex `v` [N/m].
    [[nodiscard]] double softening(Index v) const noexcept { return marks_[at(v)].softening; }

    /// Adds 1 to the weights of the vertices that tool number `i` of the scene may press on: what pushes there, pushes back
    /// at the tool.
    void share(std::size_t i, std::vector<double>& weights) const noexcept {
        for (std::size_t v = 0; v < marks_.size(); ++v) weights[v] += marks_[v].tool == i ? 1 : 0;
    }

    /// How deep y is in a tool, or may be, given rounding [m].
    [[nodiscard]] double overlap() const noexcept { return overlap_; }

    /// Work that is left over at y: pressures by the gaps they act across, and what pressures may do across overlaps [J].
    [[nodiscard]] double work() const noexcept { return work_ + max_normal_force_ * overlap_; }

    /// A ball around y of this radius, or a larger one, holds a state without overlap, with room to spare [m].
    [[nodiscard]] double min_radius() const noexcept { return 4 * clearance_; }

    /// A ball must be no larger [m].
    [[nodiscard]] double max_radius() const noexcept { return max_radius_; }

    /// Adds the pressures to the forces on the vertices [N], and to their magnitudes.
    void push(Points<double>& force, std::vector<double>& magnitude) const noexcept;

  private:
    static constexpr std::size_t none = (std::numeric_limits<std::size_t>::max)();

    using Wide = Eigen::Matrix<long double, 3, 1>;
    struct Near {  // a triangle that a tool may come to touch
        std::size_t tool;
        std::array<Index, 3> corners;
        Vector3<double> u;  // from the axis to the triangle
        double distance;    // [m]
    };
    struct Mark {  // of a vertex
        std::size_t tool = none;
        Vector3<double> middle = Vector3<double>::Zero();
        double cosine = 1;
        double softening = 0;  // [N/m]
    };
    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    void find_near(std::size_t i, const Triangles& triangles, const Points<double>& y, const Tool<double>& tool);
    [[nodiscard]] Vector3<double> take_touch(const ToolPoint& touch, const Points<double>& y,
                                             const Tool<double>& tool) noexcept;
    [[nodiscard]] static Wide wide(const Vector3<double>& a) noexcept { return {a.x(), a.y(), a.z()}; }
    [[nodiscard]] static Wide seen_from(const Tool<double>& tool, const Points<double>& y, Index v) noexcept {
        return wide(point(y, v)) - wide(tool.position);
    }
    bool mark(const EquilibriumProblem& problem, double displacement) noexcept;
    bool narrow(double displacement) noexcept;
    [[nodiscard]] double radius_of(const Near& near) const noexcept { return radii_[near.tool]; }

    std::vector<double> radii_;  // of the tools [m]
    std::vector<Near> near_;
    std::vector<ToolPoint> touches_;
    std::vector<Mark> marks_;
    std::vector<double> borne_, stiffness_;         // of vertices: multipliers at y [N], most stiffness [N/m]
    double overlap_ = 0, work_ = 0, rounding_ = 0;  // at y
    double max_normal_force_ = 0, clearance_ = 0, max_radius_ = std::numeric_limits<double>::infinity();
};

inline void ContactBounds::clear() noexcept {
    radii_.clear();
    near_.clear();
    touches_.clear();
    std::fill(marks_.begin(), marks_.end(), Mark{});
    overlap_ = work_ = rounding_ = max_normal_force_ = clearance_ = 0;
    max_radius_ = std::numeric_limits<double>::infinity();
}

inline void ContactBounds::take(const EquilibriumProblem& problem, const Triangles& triangles, const Points<double>& y,
                                std::span<const ScenePress> tools, std::span<const ToolPoint> contacts) {
    clear();
    for (std::size_t i = 0; i < tools.size(); ++i) {
        radii_.push_back(tools[i].tool.radius);
        find_near(i, triangles, y, tools[i].tool);
    }
    std::fill(borne_.begin(), borne_.end(), 0.0);
    for (const auto& touch : contacts) {
        touches_.push_back(touch);
        touches_.back().normal = take_touch(touch, y, tools[touch.tool].tool);
        for (std::size_t k = 0; k < 3; ++k) {
            borne_[at(touch.corners[k])] += touch.multiplier * touch.weight(k);
        }
    }
    for (Index v = 0; v < problem.vertex_count(); ++v) stiffness_[at(v)] = problem.foundation(v);
    for (const auto& spring : problem.springs()) {
        stiffness_[at(spring.first)] += 2 * spring.stiffness;
        stiffness_[at(spring.second)] += 2 * spring.stiffness;
    }
}

// Seen from the tool, where numbers are small, and in long double: a bound is no better than the square root of rounding
// here. No corner is nearer to the axis along u than the triangle is: the least of them is a lower bound of its distance
// even where u is off by rounding.
inline void ContactBounds::find_near(std::size_t i, const Triangles& triangles, const Points<double>& y,
                                     const Tool<double>& tool) {
    const Vector3<double> end = tool.position + tool.axis;
    for (const auto& corners : triangles.colwise()) {
        const auto triangle = triangle_at(y, corners);
        if (detail::is_far(triangle, tool, 1.25 * tool.radius)) continue;
        const auto nearest = closest_to_segment(triangle, tool.position, end);
        const Vector3<double> reach = nearest.on_triangle.point - tool.position - nearest.along * tool.axis;
        const Vector3<double> u = direction<double>(reach, Vector3<double>::Zero());
        const Wide wide_u = wide(u), axis = wide(tool.axis);
        long double distance = std::numeric_limits<long double>::infinity(), size = axis.norm() + tool.radius;
        for (const Index v : corners) {
            const Wide corner = seen_from(tool, y, v);
            distance = (std::min)(distance, wide_u.dot(corner));
            size = (std::max)(size, corner.norm() + axis.norm());
        }
        distance = (distance - (std::max)(wide_u.dot(axis), 0.0L)) / (std::max)(wide_u.norm(), 0.5L);
        constexpr long double rounding = 16 * std::numeric_limits<long double>::epsilon();
        rounding_ = (std::max)(rounding_, static_cast<double>(rounding * size));
        overlap_ = (std::max)(overlap_, static_cast<double>(tool.radius - distance + rounding * size));
        near_.push_back({i, {corners[0], corners[1], corners[2]}, u, static_cast<double>(distance)});
    }
}

// The normal at the contact point, where `y` is; the gap there goes into the work.
inline Vector3<double> ContactBounds::take_touch(const ToolPoint& touch, const Points<double>& y,
                                                 const Tool<double>& tool) noexcept {
    Wide place = Wide::Zero();
    long double weights = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const long double weight = touch.weight(k);
        place += weight * seen_from(tool, y, touch.corners[k]);
        weights += weight;
    }
    place /= weights;
    const Wide axis = wide(tool.axis);
    const long double length = axis.squaredNorm();
    const long double along = touch.part() == 2 && length > 0 ? place.dot(axis) / length : touch.part() == 1 ? 1 : 0;
    const Wide reach = along * axis - place;
    const auto gap = static_cast<double>(reach.norm() - tool.radius);
    work_ += touch.multiplier * ((std::max)(gap, 0.0) + rounding_);
    return direction<double>(reach.cast<double>(), touch.normal);
}

inline bool ContactBounds::around(const EquilibriumProblem& problem, const Points<double>& force,
                                  std::span<const double> magnitude, double displacement) noexcept {
    if (radii_.empty()) return true;
    displacement = (1 + 1e-9) * displacement + rounding_ + 1e-15 * *std::max_element(radii_.begin(), radii_.end());
    if (!mark(problem, displacement) || !narrow(displacement)) return false;
    max_normal_force_ = 0;
    max_radius_ = std::numeric_limits<double>::infinity();
    double min_cosine = 1, count = 0;
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        auto& mark = marks_[at(v)];
        if (mark.tool == none) continue;
        const double max_force =
            norm(point(force, v)) + problem.rounding() * magnitude[at(v)] + stiffness_[at(v)] * displacement;
        const double borne = (std::max)(borne_[at(v)], max_force / mark.cosine);
        const double min_distance = radii_[mark.tool] - 2 * displacement - overlap_;
        if (!(min_distance > radii_[mark.tool] / 4)) return false;
        mark.softening = (1 + 1e-9) * borne / min_distance;
        max_normal_force_ += (1 + 1e-9) * borne;
        max_radius_ = (std::min)(max_radius_, mark.cosine * min_distance);
        min_cosine = (std::min)(min_cosine, mark.cosine);
        count += 1;
    }
    clearance_ = overlap_ * std::sqrt(count) / min_cosine;
    return clearance_ <= displacement;
}

// Who may be pressed by whom.
inline bool ContactBounds::mark(const EquilibriumProblem& problem, double displacement) noexcept {
    std::fill(marks_.begin(), marks_.end(), Mark{});
    for (const auto& near : near_) {
        if (near.distance - radius_of(near) > displacement) continue;
        for (const Index v : near.corners) {
            auto& mark = marks_[at(v)];
            if (problem.fixed(v) || (mark.tool != none && mark.tool != near.tool)) return false;
            mark.tool = near.tool;
            mark.middle += near.u;
        }
    }
    for (auto& mark : marks_) mark.middle = direction<double>(mark.middle, Vector3<double>::Zero());
    return std::all_of(touches_.begin(), touches_.end(), [&](const ToolPoint& touch) {
        return std::all_of(touch.corners.begin(), touch.corners.end(),
                           [&](Index v) { return marks_[at(v)].tool == touch.tool; });
    });
}

// From which directions.
inline bool ContactBounds::narrow(double displacement) noexcept {
    constexpr double widest = 0.2;  // cosine
    const auto sine = [](double cosine) { return std::sqrt((std::max)(1 - cosine * cosine, 0.0)); };
    for (const auto& near : near_) {
        if (near.distance - radius_of(near) > displacement) continue;
        const double from_u = (std::min)((near.distance - displacement) / radius_of(near), 1.0);
        for (const Index v : near.corners) {
            auto& mark = marks_[at(v)];
            const double u_from_middle = (std::min)(dot(mark.middle, near.u), 1.0);
            if (!(from_u > widest && u_from_middle > widest)) return false;
            const double together = from_u * u_from_middle - sine(from_u) * sine(u_from_middle) - 1e-12;
            mark.cosine = (std::min)(mark.cosine, together);
            if (!(mark.cosine > widest)) return false;
        }
    }
    return true;
}

inline void ContactBounds::push(Points<double>& force, std::vector<double>& magnitude) const noexcept {
    for (const auto& touch : touches_) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index v = touch.corners[k];
            const Vector3<double> part = touch.multiplier * touch.gradient(k);
            force.col(v) += part;
            magnitude[at(v)] += norm(part);
        }
    }
}

}  // namespace membrane
