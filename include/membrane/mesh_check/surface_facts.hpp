// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include <membrane/core/disjoint_sets.hpp>
#include <membrane/mesh_check/box_pairs.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle.hpp>

/// Size and topology of a surface: components, borders, handles.
///
///     const auto facts = membrane::validate(mesh).facts;
///     if (facts.likely_unit == membrane::LengthUnit::millimetre) positions /= 1000;
namespace membrane {

/// Orientation of the closed components.
enum class Facing : std::uint8_t {
    unknown,  ///< No component is closed.
    outward,  ///< All face outward.
    inward,   ///< All face inward.
    both,     ///< Some face outward, others inward.
};

/// A unit of length.
enum class LengthUnit : std::uint8_t {
    unknown,     ///< None of the others.
    metre,       ///< [m]
    millimetre,  ///< 1e-3 m
    micrometre,  ///< 1e-6 m
};

/// Facts of the triangles with three different vertices. Lengths, angles, area and volume count usable coordinates
/// only.
struct SurfaceFacts {
    Index vertices = 0;               ///< Vertices referenced by a triangle.
    Index edges = 0;                  ///< Pairs of vertices joined by a side.
    Index triangles = 0;              ///< Triangles with three different vertices.
    Index components = 0;             ///< Connected components: triangles joined by edges.
    Index borders = 0;                ///< Connected lines of border edges.
    Index border_edges = 0;           ///< Edges with one triangle; 0 if the surface is closed.
    Index genus = no_index;           ///< Handles, of all components together; `no_index` if the mesh has errors.
    Facing facing = Facing::unknown;  ///< Of the closed components; `unknown` if there is none.
    ///@{
    /// Length of an edge [m].
    double shortest_edge = 0, mean_edge = 0, max_edge = 0;
    ///@}
    ///@{
    /// Between two sides of a triangle [rad].
    double smallest_angle = 0, largest_angle = 0;
    ///@}
    double area = 0;                                 ///< [m^2]
    double volume = 0;                               ///< Of the closed components, negative if inward [m^3].
    Vector3<double> size = Vector3<double>::Zero();  ///< Along the axes [m].
    /// The unit in which the surface is 1 mm to 2 m large: an estimate.
    LengthUnit likely_unit = LengthUnit::unknown;

    /// Whether there are triangles, and no border.
    [[nodiscard]] bool closed() const noexcept { return triangles > 0 && border_edges == 0; }
};

/// A connected component: triangles joined by edges.
struct SurfaceComponent {
    Index first_triangle = no_index;  ///< The lowest index of its triangles.
    Index triangle_count = 0;         ///< Number of its triangles.
    bool closed = true;               ///< Each edge has two triangles, which run along it in opposite directions.
    /// Closed, but for holes that, filled from their middles, have at most a quarter of its area.
    bool encloses = true;
    double area = 0;      ///< [m^2]
    double volume = 0;    ///< If it encloses one, with the holes filled; negative if inward [m^3].
    Aabb<double> extent;  ///< The box around it [m].
};

/// The connected components, in order of their first triangles.
struct SurfaceParts {
    std::vector<SurfaceComponent> parts;  ///< One for each component.
    std::vector<Index> part_of;           ///< Component of each triangle; `no_index` for triangles without half-edges.
};

/// The connected components of the triangles with half-edges in `sides`. `finite` says which triangles have only usable
/// points. O(F).
[[nodiscard]] inline SurfaceParts surface_parts(const Points<double>& x, const Triangles& triangles,
                                                std::span<const HalfEdge> sides, const std::vector<bool>& finite);

/// The border edges, grouped by connected line; lines that meet at a vertex are one line.
[[nodiscard]] inline std::vector<std::vector<HalfEdge>> border_lines(std::span<const HalfEdge> sides,
                                                                     Index vertex_count);

/// The likely unit of the coordinates of a tissue with the given largest extent.
[[nodiscard]] constexpr LengthUnit likely_unit(double extent) noexcept {
    if (extent >= 1e-3 && extent <= 2) return LengthUnit::metre;
    if (extent > 2 && extent <= 2e3) return LengthUnit::millimetre;
    if (extent > 2e3 && extent <= 2e6) return LengthUnit::micrometre;
    return LengthUnit::unknown;
}

/// The facts of the triangles of `surface_parts`. `valid`: the mesh has no errors. O(F).
[[nodiscard]] inline SurfaceFacts surface_facts(const Points<double>& x, std::span<const HalfEdge> sides,
                                                const std::vector<bool>& finite, const SurfaceParts& parts,
                                                Index borders, bool valid);

namespace detail {

/// Adds the volumes behind the holes to the components that have them, and decides which components enclose one.
inline void fill_holes(const Points<double>& x, const Triangles& triangles, std::span<const HalfEdge> sides,
                       SurfaceParts& parts) {
    std::vector<double> area(parts.parts.size(), 0);
    for (const auto& line : border_lines(sides, static_cast<Index>(x.cols()))) {
        Vector3<double> middle = Vector3<double>::Zero();
        for (const HalfEdge& side : line) middle += point(x, side.first) + point(x, side.second);
        middle /= 2 * static_cast<double>(line.size());
        for (const HalfEdge& side : line) {
            const auto p = static_cast<std::size_t>(parts.part_of[static_cast<std::size_t>(side.triangle)]);
            SurfaceComponent& part = parts.parts[p];
            const auto origin = point(x, triangles(0, part.first_triangle));
            const Vector3<double> a = point(x, side.forward ? side.second : side.first) - origin;
            const Vector3<double> b = point(x, side.forward ? side.first : side.second) - origin;
            const Vector3<double> twice = cross<double>(a - (middle - origin), b - (middle - origin));
            area[p] += norm(twice) / 2;
            part.volume += dot<double>(middle - origin, twice) / 6;
        }
    }
    for (std::size_t p = 0; p < area.size(); ++p) {
        parts.parts[p].encloses = parts.parts[p].encloses && area[p] <= parts.parts[p].area / 4;
    }
}

}  // namespace detail

inline SurfaceParts surface_parts(const Points<double>& x, const Triangles& triangles, std::span<const HalfEdge> sides,
                                  const std::vector<bool>& finite) {
    DisjointSets sets(static_cast<std::size_t>(triangles.cols()));
    std::vector<bool> closed(static_cast<std::size_t>(triangles.cols()), true), oriented = closed;
    SurfaceParts result;
    result.part_of.assign(closed.size(), no_index);
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        const bool inner = edge.size() == 2 && edge[0].forward != edge[1].forward;
        for (const HalfEdge& side : edge) {
            const auto f = static_cast<std::size_t>(side.triangle);
            sets.unite(f, static_cast<std::size_t>(edge[0].triangle));
            closed[f] = closed[f] && inner;
            oriented[f] = oriented[f] && (inner || edge.size() == 1);
            result.part_of[f] = 0;
        }
    });
    for (std::size_t f = 0; f < closed.size(); ++f) {
        if (result.part_of[f] == no_index) continue;
        const std::size_t root = sets.find(f);  // the lowest triangle of the component, so it comes first
        if (root == f) {
            result.part_of[f] = static_cast<Index>(result.parts.size());
            result.parts.emplace_back().first_triangle = static_cast<Index>(f);
        }
        result.part_of[f] = result.part_of[root];
        SurfaceComponent& part = result.parts[static_cast<std::size_t>(result.part_of[f])];
        ++part.triangle_count;
        part.closed = part.closed && closed[f] && finite[f];
        part.encloses = part.encloses && oriented[f] && finite[f];
        if (!finite[f]) continue;
        const auto t = triangle_at(x, triangles.col(static_cast<Eigen::Index>(f)));
        const auto origin = point(x, triangles(0, part.first_triangle));
        part.area += norm(area_vector(t));
        part.volume += dot<double>(t.a - origin, cross<double>(t.b - origin, t.c - origin)) / 6;
        for (int k = 0; k < 3; ++k) part.extent.include(detail::corner(t, k));
    }
    detail::fill_holes(x, triangles, sides, result);
    return result;
}

inline std::vector<std::vector<HalfEdge>> border_lines(std::span<const HalfEdge> sides, Index vertex_count) {
    DisjointSets sets(static_cast<std::size_t>(vertex_count));
    std::vector<HalfEdge> border;
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() != 1) return;
        border.push_back(edge[0]);
        sets.unite(static_cast<std::size_t>(edge[0].first), static_cast<std::size_t>(edge[0].second));
    });
    std::vector<Index> line_of(static_cast<std::size_t>(vertex_count), no_index);
    std::vector<std::vector<HalfEdge>> lines;
    for (const HalfEdge& side : border) {
        Index& line = line_of[sets.find(static_cast<std::size_t>(side.first))];
        if (line == no_index) {
            line = static_cast<Index>(lines.size());
            lines.emplace_back();
        }
        lines[static_cast<std::size_t>(line)].push_back(side);
    }
    return lines;
}

namespace detail {

/// Computes lengths, angles and size.
inline void measure(SurfaceFacts& facts, const Points<double>& x, std::span<const HalfEdge> sides,
                    const std::vector<bool>& finite) {
    facts.shortest_edge = facts.smallest_angle = std::numeric_limits<double>::infinity();
    double sum = 0, count = 0;
    Aabb<double> extent;
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (!finite[static_cast<std::size_t>(edge[0].triangle)]) return;
        const auto length = norm<double>(point(x, edge[0].second) - point(x, edge[0].first));
        facts.shortest_edge = (std::min)(facts.shortest_edge, length);
        facts.max_edge = (std::max)(facts.max_edge, length);
        sum += length;
        ++count;
        for (const HalfEdge& side : edge) {
            if (!finite[static_cast<std::size_t>(side.triangle)]) continue;
            const Vector3<double> tip = point(x, side.apex);
            const Vector3<double> first = point(x, side.first) - tip, second = point(x, side.second) - tip;
            const double angle = std::atan2(norm(cross(first, second)), dot(first, second));
            facts.smallest_angle = (std::min)(facts.smallest_angle, angle);
            facts.largest_angle = (std::max)(facts.largest_angle, angle);
            extent.include(tip);
        }
    });
    if (count == 0) {
        facts.shortest_edge = facts.smallest_angle = 0;
        return;
    }
    facts.mean_edge = sum / count;
    facts.size = extent.high - extent.low;
    facts.likely_unit = likely_unit(facts.size.maxCoeff());
}

}  // namespace detail

inline SurfaceFacts surface_facts(const Points<double>& x, std::span<const HalfEdge> sides,
                                  const std::vector<bool>& finite, const SurfaceParts& parts, Index borders,
                                  bool valid) {
    SurfaceFacts facts;
    detail::measure(facts, x, sides, finite);
    std::vector<bool> referenced(static_cast<std::size_t>(x.cols()), false);
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        ++facts.edges;
        facts.border_edges += edge.size() == 1 ? 1 : 0;
        for (const Index v : {edge[0].first, edge[0].second}) referenced[static_cast<std::size_t>(v)] = true;
    });
    facts.vertices = static_cast<Index>(std::count(referenced.begin(), referenced.end(), true));
    facts.triangles = static_cast<Index>(sides.size() / 3);
    facts.components = static_cast<Index>(parts.parts.size());
    facts.borders = borders;
    bool outward = false, inward = false;
    for (const SurfaceComponent& part : parts.parts) {
        facts.area += part.area;
        if (!part.closed) continue;
        facts.volume += part.volume;
        outward = outward || part.volume > 0;
        inward = inward || part.volume < 0;
    }
    facts.facing = outward && inward ? Facing::both
                   : outward         ? Facing::outward
                   : inward          ? Facing::inward
                                     : Facing::unknown;
    // For each component: V - E + F = 2 - 2 genus - borders.
    if (valid) facts.genus = facts.components - (facts.vertices - facts.edges + facts.triangles + borders) / 2;
    return facts;
}

}  // namespace membrane
