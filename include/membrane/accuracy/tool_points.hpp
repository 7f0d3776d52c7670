// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/contact/contact_point.hpp>
#include <membrane/contact/contact_vertices.hpp>
#include <membrane/surface/aabb.hpp>

/// The contact points of tools with a whole surface, and the derivatives of their gaps.
///
///     for (const auto& point : membrane::tool_points(triangles, x, tools, far)) {
///         point.gap; point.gradient(k); membrane::gap_hessian(point, x, tools[point.tool]);
///     }
namespace membrane {

/// A contact point of one of several tools. A corner or edge shared by triangles is one point, of the first of these
/// triangles.
struct ToolPoint : ContactPoint<double> {
    std::size_t tool = 0;   ///< number of the tool
    double multiplier = 0;  ///< force along the normal [N]

    /// The part of the tool: 0 one end of the axis, 1 the other end, 2 the segment between them; `vertex_feature` for a
    /// vertex that carries the contact.
    [[nodiscard]] int part() const noexcept { return (std::min)(feature, 2); }

    /// Barycentric weight of corner `k`.
    [[nodiscard]] double weight(std::size_t k) const noexcept { return weights[static_cast<Eigen::Index>(k)]; }

    /// Derivative of the gap by the position of corner `k`.
    [[nodiscard]] Vector3<double> gradient(std::size_t k) const noexcept { return -weight(k) * normal; }
};

/// Orders points by tool, part of the tool, and corners with a weight.
[[nodiscard]] inline bool is_before(const ToolPoint& a, const ToolPoint& b);

/// The contact points with a gap of at most `far` [m], sorted by `is_before`, without duplicates. A point on the axis
/// has no normal and is left out. `carriers` are for each tool the vertices that carry the contact; none: the faces do.
/// A gap is that beyond the point's lift. Cost: O(F) for each tool.
[[nodiscard]] inline std::vector<ToolPoint> tool_points(const Triangles& triangles, const Points<double>& x,
                                                        std::span<const Tool<double>> tools, double max_distance,
                                                        std::span<const ContactVertices> carriers = {});

/// Second derivative of the gap by the positions of the triangle's corners, x y z each [1/m]. As the corners move, the
/// closest points slide along edge, face and axis: each sliding direction is eliminated by a Schur complement.
[[nodiscard]] inline Eigen::Matrix<double, 9, 9> gap_hessian(const ToolPoint& point, const Points<double>& x,
                                                             const Tool<double>& tool);

/// Distance of the triangle from the tool's axis [m].
[[nodiscard]] inline double distance_from_axis(const Triangle<double>& triangle, const Tool<double>& tool) noexcept {
    return std::sqrt(closest_to_axis(triangle, tool).on_triangle.squared_distance);
}

/// The largest part, up to 1, of a `step` (3 x V [m]) in which no triangle can reach the axis of a tool: no corner
/// moves as far as the distance of its triangle from the axis.
[[nodiscard]] inline double collision_free_step(const Triangles& triangles, const Points<double>& x,
                                                const Points<double>& step, std::span<const Tool<double>> tools);

/// Whether the tool's axis intersects a triangle with a free corner: such a triangle has no gap.
[[nodiscard]] inline bool is_pierced(const Triangles& triangles, const Points<double>& x, const Tool<double>& tool,
                                     const std::vector<unsigned char>& fixed);

namespace detail {

/// Whether bounding boxes show that no point of the triangle is closer to the tool's axis than `far`.
[[nodiscard]] inline bool is_far(const Triangle<double>& t, const Tool<double>& tool, double max_distance) noexcept {
    Aabb<double> axis{tool.position, tool.position};
    axis.include(tool.position + tool.axis);
    return gap_between(bounds(t), axis) > max_distance;
}

/// Whether a vertex that carries the contact is nearest to the axis between its ends.
[[nodiscard]] inline bool is_beside_axis(const ToolPoint& point, const Points<double>& x,
                                         const Tool<double>& tool) noexcept {
    if (point.part() != vertex_feature) return false;
    const auto along = dot<double>(membrane::point(x, point.corners[0]) - tool.position, tool.axis);
    return along > 0 && along < squared_norm(tool.axis);
}

/// Tool, part, corners with a weight, ascending.
[[nodiscard]] inline std::array<Index, 5> name_of(const ToolPoint& point) noexcept {
    std::array<Index, 5> name{static_cast<Index>(point.tool), point.part(), no_index, no_index, no_index};
    for (std::size_t k = 0; k < 3; ++k) {
        if (point.weight(k) > 0) name[2 + k] = point.corners[k];
    }
    std::sort(name.begin() + 2, name.end());
    return name;
}

}  // namespace detail

inline bool is_before(const ToolPoint& a, const ToolPoint& b) { return detail::name_of(a) < detail::name_of(b); }

inline std::vector<ToolPoint> tool_points(const Triangles& triangles, const Points<double>& x,
                                          std::span<const Tool<double>> tools, double max_distance,
                                          std::span<const ContactVertices> carriers) {
    const ContactVertices none;
    std::vector<ToolPoint> points;
    for (std::size_t i = 0; i < tools.size(); ++i) {
        const auto& tool = tools[i];
        const ContactVertices& vertices = i < carriers.size() ? carriers[i] : none;
        const double within = tool.radius + vertices.largest_lift(tool.radius) + max_distance;
        for (Index f = 0; f < static_cast<Index>(triangles.cols()); ++f) {
            const std::array<Index, 3> corners{triangles(0, f), triangles(1, f), triangles(2, f)};
            const auto triangle = triangle_at(x, corners);
            if (detail::is_far(triangle, tool, within)) continue;
            for (const Index v : corners) {
                if (!vertices.carries(v, tool.radius)) continue;
                ToolPoint point{vertex_point<double>(v, membrane::point(x, v), f, corners, tool, tool.radius,
                                                     vertices.lift(v, tool.radius)),
                                i};
                point.gap -= point.lift;
                if (!point.normal.isZero(0) && point.gap <= max_distance) points.push_back(point);
            }
            each_contact_point(f, corners, triangle, tool, tool.radius, [&](ContactPoint<double> point) {
                point.lift = vertices.face_lift(corners, tool.radius);
                point.gap -= point.lift;
                if (!point.normal.isZero(0) && point.gap <= max_distance) points.push_back({point, i});
            });
        }
    }
    // Of faces that share their nearest point, the one that may cut in least comes first.
    const auto key = [](const ToolPoint& a) { return std::pair(detail::name_of(a), -a.lift); };
    std::stable_sort(points.begin(), points.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
    const auto same = [](const ToolPoint& a, const ToolPoint& b) { return detail::name_of(a) == detail::name_of(b); };
    points.erase(std::unique(points.begin(), points.end(), same), points.end());
    return points;
}

inline Eigen::Matrix<double, 9, 9> gap_hessian(const ToolPoint& point, const Points<double>& x,
                                               const Tool<double>& tool) {
    constexpr int slides = 9;  // first index; at most three: along two sides and the axis
    const Vector3<double>& normal = point.normal;
    const double distance = point.gap + tool.radius + point.lift;
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - normal * normal.transpose()) / distance;
    Eigen::Matrix<double, 3, 12> separation = Eigen::Matrix<double, 3, 12>::Zero();  // its derivatives
    Eigen::Matrix<double, 12, 12> mixed = Eigen::Matrix<double, 12, 12>::Zero();
    Eigen::Index first = no_index;
    for (Eigen::Index k = 0; k < 3; ++k) {
        const double weight = point.weights[k];
        if (!(weight > 0)) continue;
        separation.middleCols<3>(3 * k) = -weight * Eigen::Matrix3d::Identity();
        if (first == no_index) {
            first = k;
            continue;
        }
        // Sliding moves weight from the first corner to this one.
        const Eigen::Index slide = slides + k - 1;
        const auto corner = [&](Eigen::Index at) {
            return membrane::point(x, point.corners[static_cast<std::size_t>(at)]);
        };
        separation.col(slide) = corner(first) - corner(k);
        mixed.block<3, 1>(3 * first, slide) = normal;
        mixed.block<3, 1>(3 * k, slide) = -normal;
    }
    if (point.part() == 2 || detail::is_beside_axis(point, x, tool)) separation.col(slides + 2) = tool.axis;

    Eigen::Matrix<double, 12, 12> second = separation.transpose() * across * separation + mixed + mixed.transpose();
    for (Eigen::Index slide = slides; slide < 12; ++slide) {
        const double pivot = second(slide, slide);
        const double size = squared_norm<double>(separation.col(slide)) / distance;
        if (!(pivot > 1e-12 * size)) continue;  // along the normal, or eliminated: no sliding
        second -= (second.col(slide) * second.row(slide) / pivot).eval();
    }
    return second.topLeftCorner<9, 9>();
}

inline bool is_pierced(const Triangles& triangles, const Points<double>& x, const Tool<double>& tool,
                       const std::vector<unsigned char>& fixed) {
    for (const auto& corners : triangles.colwise()) {
        const auto triangle = triangle_at(x, corners);
        if (detail::is_far(triangle, tool, 0) || distance_from_axis(triangle, tool) > 0) continue;
        for (const Index v : corners) {
            if (fixed[static_cast<std::size_t>(v)] == 0) return true;
        }
    }
    return false;
}

inline double collision_free_step(const Triangles& triangles, const Points<double>& x, const Points<double>& step,
                                  std::span<const Tool<double>> tools) {
    constexpr double caution = 0.8;
    double part = 1;
    for (const auto& tool : tools) {
        for (const auto& corners : triangles.colwise()) {
            const auto triangle = triangle_at(x, corners), displacement = triangle_at(step, corners);
            const double most = std::sqrt(
                (std::max)({squared_norm(displacement.a), squared_norm(displacement.b), squared_norm(displacement.c)}));
            if (most == 0 || detail::is_far(triangle, tool, part * most / caution)) continue;
            part = (std::min)(part, caution * distance_from_axis(triangle, tool) / most);
        }
    }
    return part;
}

}  // namespace membrane
