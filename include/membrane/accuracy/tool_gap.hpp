// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/collision/tool.hpp>
#include <membrane/mesh/box.hpp>

/// How far a tool is from the corners, edges and insides of triangles, and how that changes as these move.
///
///     for (const auto& gap : membrane::gaps_near(triangles, x, tools, far)) {
///         gap.value; gap.gradient(k); membrane::curvature_of(gap, x, tools[gap.tool]);
///     }
namespace membrane {

/// A corner, an edge or the inside of a triangle, and the part of a tool that is nearest to it.
struct ToolGap {
    std::size_t tool;
    int part;                      ///< of the tool: 0 one end of the axis, 1 the other, 2 what is between
    std::array<Index, 3> corners;  ///< of the triangle
    Vector3<double> barycentric;   ///< of the nearest point; zero for corners that are not of the edge or corner
    Vector3<double> reach;         ///< from that point to the tool's axis [m]
    double value;                  ///< the gap: the reach less the tool's radius [m]
    double pressure = 0;           ///< [N]

    [[nodiscard]] Vector3<double> normal() const noexcept { return reach / norm(reach); }

    /// Derivative by the position of corner `k`.
    [[nodiscard]] Vector3<double> gradient(std::size_t k) const noexcept {
        return -barycentric[static_cast<Eigen::Index>(k)] * normal();
    }
};

/// Orders gaps by tool, part and the corners involved: what triangles have in common is one and the same.
[[nodiscard]] inline bool is_before(const ToolGap& a, const ToolGap& b);

/// The gaps of all that is at most `far` [m] away from a tool, in order, each once. What has its nearest point on the
/// axis itself has no normal and is left out. O(F) for each tool.
[[nodiscard]] inline std::vector<ToolGap> gaps_near(const Triangles& triangles, const Points<double>& x,
                                                    std::span<const Tool<double>> tools, double far);

/// Second derivative of the gap by the positions of the triangle's corners, x y z each [1/m]. The nearest points slide
/// along edge, face and axis as the corners move: what they gain by that is taken off, a Schur complement for each way
/// to slide.
[[nodiscard]] inline Eigen::Matrix<double, 9, 9> curvature_of(const ToolGap& gap, const Points<double>& x,
                                                              const Tool<double>& tool);

/// Distance of the triangle from the tool's axis [m].
[[nodiscard]] inline double distance_from_axis(const Triangle<double>& triangle, const Tool<double>& tool) noexcept {
    if (feature_pairs(tool) == 1) return std::sqrt(closest_point(triangle, tool.position).squared_distance);
    const Vector3<double> end = tool.position + tool.axis;
    return std::sqrt(closest_to_segment(triangle, tool.position, end).on_triangle.squared_distance);
}

/// The largest part, up to 1, of a `step` (3 x V [m]) in which no triangle can reach the axis of a tool: none of its
/// corners goes as far as it is away.
[[nodiscard]] inline double safe_part(const Triangles& triangles, const Points<double>& x, const Points<double>& step,
                                      std::span<const Tool<double>> tools);

/// Whether the tool's axis meets a triangle that is not fixed with all its corners: there it has no gap.
[[nodiscard]] inline bool is_pierced(const Triangles& triangles, const Points<double>& x, const Tool<double>& tool,
                                     const std::vector<unsigned char>& fixed);

namespace detail {

/// Whether no point of the triangle is nearer than `far` to the tool's axis, at a glance.
[[nodiscard]] inline bool is_far(const Triangle<double>& t, const Tool<double>& tool, double far) noexcept {
    Box<double> axis{tool.position, tool.position};
    axis.include(tool.position + tool.axis);
    return gap_between(bounds(t), axis) > far;
}

/// Tool, part, corners involved, ascending.
[[nodiscard]] inline std::array<Index, 5> name_of(const ToolGap& gap) noexcept {
    std::array<Index, 5> name{static_cast<Index>(gap.tool), gap.part, no_index, no_index, no_index};
    for (std::size_t k = 0; k < 3; ++k) {
        if (gap.barycentric[static_cast<Eigen::Index>(k)] > 0) name[2 + k] = gap.corners[k];
    }
    std::sort(name.begin() + 2, name.end());
    return name;
}

}  // namespace detail

inline bool is_before(const ToolGap& a, const ToolGap& b) { return detail::name_of(a) < detail::name_of(b); }

inline std::vector<ToolGap> gaps_near(const Triangles& triangles, const Points<double>& x,
                                      std::span<const Tool<double>> tools, double far) {
    std::vector<ToolGap> gaps;
    for (std::size_t i = 0; i < tools.size(); ++i) {
        for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
            const std::array<Index, 3> corners{triangles(0, f), triangles(1, f), triangles(2, f)};
            const auto triangle = triangle_at(x, corners);
            if (detail::is_far(triangle, tools[i], tools[i].radius + far)) continue;
            for (int pair = 0; pair < feature_pairs(tools[i]); ++pair) {
                const auto nearest = proximity(triangle, tools[i], pair);
                if (!nearest) continue;
                const double distance = norm(nearest->reach), value = distance - tools[i].radius;
                if (!(distance > 0) || !(value <= far)) continue;
                gaps.push_back({i, (std::min)(pair, 2), corners, nearest->barycentric, nearest->reach, value});
            }
        }
    }
    std::sort(gaps.begin(), gaps.end(), is_before);
    const auto same = [](const ToolGap& a, const ToolGap& b) { return detail::name_of(a) == detail::name_of(b); };
    gaps.erase(std::unique(gaps.begin(), gaps.end(), same), gaps.end());
    return gaps;
}

inline Eigen::Matrix<double, 9, 9> curvature_of(const ToolGap& gap, const Points<double>& x, const Tool<double>& tool) {
    constexpr int slides = 9;  // their first place; there are three at most: along two sides and the axis
    const Vector3<double> normal = gap.normal();
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - normal * normal.transpose()) / norm(gap.reach);
    Eigen::Matrix<double, 3, 12> reach = Eigen::Matrix<double, 3, 12>::Zero();  // derivatives of it
    Eigen::Matrix<double, 12, 12> mixed = Eigen::Matrix<double, 12, 12>::Zero();
    Eigen::Index first = no_index;
    for (Eigen::Index k = 0; k < 3; ++k) {
        const double weight = gap.barycentric[k];
        if (!(weight > 0)) continue;
        reach.middleCols<3>(3 * k) = -weight * Eigen::Matrix3d::Identity();
        if (first == no_index) {
            first = k;
            continue;
        }
        // Weight goes from the first corner to this one.
        const Eigen::Index slide = slides + k - 1;
        const auto corner = [&](Eigen::Index at) { return point(x, gap.corners[static_cast<std::size_t>(at)]); };
        reach.col(slide) = corner(first) - corner(k);
        mixed.block<3, 1>(3 * first, slide) = normal;
        mixed.block<3, 1>(3 * k, slide) = -normal;
    }
    if (gap.part == 2) reach.col(slides + 2) = tool.axis;

    Eigen::Matrix<double, 12, 12> second = reach.transpose() * across * reach + mixed + mixed.transpose();
    for (Eigen::Index slide = slides; slide < 12; ++slide) {
        const double pivot = second(slide, slide);
        const double size = squared_norm<double>(reach.col(slide)) / norm(gap.reach);
        if (!(pivot > 1e-12 * size)) continue;  // along the normal, or along what has been taken off: nothing slides
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

inline double safe_part(const Triangles& triangles, const Points<double>& x, const Points<double>& step,
                        std::span<const Tool<double>> tools) {
    constexpr double caution = 0.8;
    double part = 1;
    for (const auto& tool : tools) {
        for (const auto& corners : triangles.colwise()) {
            const auto triangle = triangle_at(x, corners), way = triangle_at(step, corners);
            const double most = std::sqrt((std::max)({squared_norm(way.a), squared_norm(way.b), squared_norm(way.c)}));
            if (most == 0 || detail::is_far(triangle, tool, part * most / caution)) continue;
            part = (std::min)(part, caution * distance_from_axis(triangle, tool) / most);
        }
    }
    return part;
}

}  // namespace membrane
