// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/exact_sign.hpp>
#include <membrane/mesh_check/checked_mesh.hpp>
#include <membrane/mesh_check/coincident_vertices.hpp>
#include <membrane/mesh_check/mesh_report.hpp>
#include <membrane/mesh_check/nesting.hpp>
#include <membrane/mesh_check/self_intersection.hpp>
#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/mesh_checks.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Finds the defects and the facts of a mesh.
///
///     const auto report = membrane::validate(x, triangles);  // any numbers, 3 x V [m] and 3 x F
///     if (!report.valid()) std::cerr << to_string(report);
///     std::cout << report.facts.components << " components, " << report.facts.borders << " borders\n";
namespace membrane {

/// Options of `validate`.
struct ValidateOptions {
    /// Vertices at most this far from each other or from a border edge count as unjoined [m]. Default: the larger of a
    /// millionth of the mean edge and four times the spacing of floating-point numbers at the largest coordinate; for
    /// two vertices of the border also a thousandth of the shortest border edge at them.
    std::optional<double> tolerance{};

    /// Maximum number of findings listed for each kind. All are counted, except self-intersections: their search stops
    /// at this number. At least 1.
    Index max_findings_per_kind = 100;

    /// Each search tests at most a million pairs plus this number for each triangle. Not negative.
    Index max_pairs_per_triangle = 100;
};

/// All defects, with their vertices and triangles and a remedy, and the facts. `valid()` exactly if `TriangleMesh`
/// accepts the mesh.
///
/// The time is bounded for any input, O(F log F) for usual shapes: a search that exceeds its limit stops, and
/// `unfinished` has its kind. Further checks skip triangles without three different valid vertices. Checks of positions
/// skip triangles with a corner that is not finite or too large. Checks of distances are skipped if the mesh has no
/// size.
/// @throws InvalidInput if a matrix does not have three rows or has too many columns for `Index`, and for options out
/// of range
template <class P, class T>
[[nodiscard]] MeshReport validate(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles,
                                  const ValidateOptions& options = {});

/// Validates a mesh given as x y z x y z ... [m] and three vertices for each triangle.
template <class S, std::size_t m, std::integral I, std::size_t n>
[[nodiscard]] MeshReport validate(std::span<S, m> xyz, std::span<I, n> corners, const ValidateOptions& options = {}) {
    return validate(detail::by_threes("validate", xyz, "positions"),
                    detail::by_threes("validate", corners, "triangles"), options);
}

/// Validates a mesh that `TriangleMesh` has accepted: its findings are warnings.
template <Real Scalar>
[[nodiscard]] MeshReport validate(const TriangleMesh<Scalar>& mesh, const ValidateOptions& options = {}) {
    return validate(mesh.positions(), mesh.triangles(), options);
}

namespace detail {

inline void check_options(const ValidateOptions& options) {
    constexpr std::string_view component = "validate";
    if (options.tolerance) check_option(component, *options.tolerance, "tolerance", "m");
    if (options.max_findings_per_kind < 1) {
        refuse(component, "max_findings_per_kind must be at least 1, got ", options.max_findings_per_kind);
    }
    if (options.max_pairs_per_triangle < 0)
        refuse(component, "max_pairs_per_triangle must not be negative, got ", options.max_pairs_per_triangle);
}

/// Finds the defects, other than errors, that follow from the indices alone.
template <class Found>
void check_extras(const CheckedMesh& mesh, const SurfaceParts& parts, std::span<const std::vector<HalfEdge>> borders,
                  Index max_findings_per_kind, Found found) {
    std::vector<bool> is_referenced(static_cast<std::size_t>(mesh.x.cols()), mesh.referenced.empty());
    for (const HalfEdge& side : mesh.sides) is_referenced[static_cast<std::size_t>(side.apex)] = true;
    for (Index v = 0; v < mesh.x.cols(); ++v) {
        if (!is_referenced[static_cast<std::size_t>(v)]) {
            found(MeshDefect::isolated_vertex, {v}, {}, "no triangle names vertex ", v);
        }
    }
    for (const auto& line : borders) {
        if (line.size() != 3 || (line[0].triangle == line[1].triangle && line[1].triangle == line[2].triangle))
            continue;
        std::vector<Index> corners;
        for (const HalfEdge& side : line) corners.insert(corners.end(), {side.first, side.second});
        std::sort(corners.begin(), corners.end());
        corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
        if (corners.size() != 3) continue;
        found(MeshDefect::missing_triangle, corners, {line[0].triangle, line[1].triangle, line[2].triangle},
              "the triangle of vertices ", corners[0], ", ", corners[1], " and ", corners[2], " is missing");
    }
    if (parts.parts.size() < 2) return;
    std::vector<Index> first;  // at least two, for the text
    for (const SurfaceComponent& part : parts.parts) {
        if (first.size() < 2 || first.size() < static_cast<std::size_t>(max_findings_per_kind)) {
            first.push_back(part.first_triangle);
        }
    }
    found(MeshDefect::several_components, {}, first, "the surface has ", parts.parts.size(),
          " components, one with triangle ", first[0], ", one with triangle ", first[1]);
}

/// Finds triangles of bad shape; returns those with an area.
template <class Found>
std::vector<Index> check_triangles(const CheckedMesh& mesh, Found found) {
    constexpr double max_angle = 179.999 * std::numbers::pi / 180;
    std::vector<Index> with_area;
    for (const Index f : mesh.referenced) {
        if (!mesh.finite[static_cast<std::size_t>(f)]) continue;
        const auto t = triangle_at(mesh.x, mesh.triangles.col(f));
        const std::vector<Index> corners{mesh.triangles(0, f), mesh.triangles(1, f), mesh.triangles(2, f)};
        if (on_one_line(t.a, t.b, t.c)) {
            found(MeshDefect::zero_area, corners, {f}, "the corners of triangle ", f, " are on one line");
            continue;
        }
        with_area.push_back(f);
        double shortest = std::numeric_limits<double>::infinity(), longest = 0, largest_angle = 0;
        for (int k = 0; k < 3; ++k) {
            const Vector3<double>& tip = corner(t, k);
            const Vector3<double> to_next = corner(t, (k + 1) % 3) - tip, to_last = corner(t, (k + 2) % 3) - tip;
            shortest = (std::min)(shortest, norm(to_next));
            longest = (std::max)(longest, norm(to_next));
            largest_angle = (std::max)(largest_angle, std::atan2(norm(cross(to_next, to_last)), dot(to_next, to_last)));
        }
        if (shortest <= 1e-6 * longest) {
            found(MeshDefect::needle, corners, {f}, "the sides of triangle ", f, " are ", shortest, " to ", longest,
                  " [m] long");
        }
        if (largest_angle >= max_angle) {
            found(MeshDefect::cap, corners, {f}, "triangle ", f, " has an angle of pi - ",
                  std::numbers::pi - largest_angle, " [rad]");
        }
    }
    return with_area;
}

/// Finds border vertices that lie on a border edge, but not at its ends; reports each vertex once. Returns whether the
/// search is complete.
template <class Found>
bool check_t_junctions(const CheckedMesh& mesh, std::span<const std::vector<HalfEdge>> borders, double tolerance,
                       std::int64_t effort, Found found) {
    std::vector<HalfEdge> edges;
    std::vector<Aabb<double>> boxes;
    for (const auto& line : borders) {
        for (const HalfEdge& side : line) {
            if (!mesh.finite[static_cast<std::size_t>(side.triangle)]) continue;
            edges.push_back(side);
            Aabb<double> box;
            for (const Index v : {side.first, side.second}) {
                box.include(point(mesh.x, v) - Vector3<double>::Constant(tolerance));
                box.include(point(mesh.x, v) + Vector3<double>::Constant(tolerance));
            }
            boxes.push_back(box);
        }
    }
    std::vector<bool> reported(static_cast<std::size_t>(mesh.x.cols()), false);
    const auto test_vertex = [&](const HalfEdge& edge, Index v) {
        if (reported[static_cast<std::size_t>(v)] || v == edge.first || v == edge.second || v == edge.apex) return;
        const Vector3<double> along = point(mesh.x, edge.second) - point(mesh.x, edge.first);
        const Vector3<double> to_v = point(mesh.x, v) - point(mesh.x, edge.first);
        if (norm(to_v) <= tolerance || norm<double>(to_v - along) <= tolerance) return;
        const double part = fraction(dot(to_v, along), squared_norm(along));
        if (!(part > 0 && part < 1) || norm<double>(to_v - part * along) > tolerance) return;
        reported[static_cast<std::size_t>(v)] = true;
        found(MeshDefect::t_junction, {v, edge.first, edge.second}, {edge.triangle}, "vertex ", v, " is on edge ",
              edge.first, "-", edge.second, " of triangle ", edge.triangle, ", expected at an end of it");
    };
    return for_each_overlap(boxes, effort, [&](Index i, Index j) {
        const HalfEdge &a = edges[static_cast<std::size_t>(i)], &b = edges[static_cast<std::size_t>(j)];
        for (const Index v : {b.first, b.second}) test_vertex(a, v);
        for (const Index v : {a.first, a.second}) test_vertex(b, v);
    });
}

/// Finds closed components that have no volume, face inward, or are inside another. Returns whether the search is
/// complete.
template <class Found>
bool check_volumes(const CheckedMesh& mesh, const SurfaceParts& parts, std::int64_t effort, Found found) {
    for (const SurfaceComponent& part : parts.parts) {
        if (!part.closed) continue;
        if (std::abs(part.volume) <= mesh.spacing * part.area) {  // within the rounding error of the coordinates
            found(MeshDefect::no_volume, {}, {part.first_triangle}, "the closed component of triangle ",
                  part.first_triangle, " is flat");
        } else if (part.volume < 0) {
            found(MeshDefect::inward, {}, {part.first_triangle}, "the closed component of triangle ",
                  part.first_triangle, " faces inward, its volume is ", part.volume, " [m^3]");
        }
    }
    return for_each_nested(mesh.x, mesh.triangles, parts, effort, [&](Index outer, Index inner) {
        const Index f = parts.parts[static_cast<std::size_t>(inner)].first_triangle;
        const Index g = parts.parts[static_cast<std::size_t>(outer)].first_triangle;
        found(MeshDefect::nested_components, {}, {f, g}, "the component of triangle ", f,
              " is inside that of triangle ", g);
    });
}

/// For each vertex how near another counts as unjoined [m]: within `tolerance`, and on a border within a thousandth of
/// its shortest border edge, so that a seam which is a little open is found.
inline std::vector<double> seam_widths(const CheckedMesh& mesh, std::span<const std::vector<HalfEdge>> borders,
                                       double tolerance) {
    std::vector<double> edge(static_cast<std::size_t>(mesh.x.cols()), std::numeric_limits<double>::infinity());
    for (const auto& line : borders) {
        for (const HalfEdge& side : line) {
            if (!mesh.finite[static_cast<std::size_t>(side.triangle)]) continue;
            const auto length = norm<double>(point(mesh.x, side.second) - point(mesh.x, side.first));
            for (double* at :
                 {&edge[static_cast<std::size_t>(side.first)], &edge[static_cast<std::size_t>(side.second)]})
                *at = (std::min)(*at, length);
        }
    }
    for (double& width : edge) width = std::isinf(width) ? tolerance : (std::max)(tolerance, 1e-3 * width);
    return edge;
}

/// Finds vertices that are nearer to each other than both their `widths`. Returns whether the search is complete.
template <class Found>
bool check_near_vertices(const CheckedMesh& mesh, const CoincidentVertices& vertices, const std::vector<double>& widths,
                         std::int64_t effort, Found found) {
    return vertices.for_each_pair(*std::max_element(widths.begin(), widths.end()), effort, [&](Index v, Index w) {
        const auto distance = norm<double>(point(mesh.x, v) - point(mesh.x, w));
        const double apart = (std::min)(widths[static_cast<std::size_t>(v)], widths[static_cast<std::size_t>(w)]);
        if (distance > apart) return;
        found(MeshDefect::nearly_coincident_vertices, {v, w}, {}, "vertices ", v, " and ", w, " are ", distance,
              " [m] apart, expected more than ", apart);
    });
}

/// The checks that need distances; returns the kinds of the searches that are not complete.
template <class Found>
std::vector<MeshDefect> check_geometry(const CheckedMesh& mesh, const SurfaceParts& parts,
                                       std::span<const std::vector<HalfEdge>> borders, double mean_edge,
                                       const ValidateOptions& options, Found found) {
    const double tolerance = options.tolerance.value_or((std::max)(1e-6 * mean_edge, 4 * mesh.spacing));
    const std::int64_t effort = 1'000'000 + std::int64_t{options.max_pairs_per_triangle} * mesh.triangles.cols();
    const CoincidentVertices coincident(mesh.x, mesh.points);
    const auto& representative = coincident.representative();
    for (Index v = 0; v < mesh.x.cols(); ++v) {
        const Index lowest = representative[static_cast<std::size_t>(v)];
        if (lowest != v) {
            found(MeshDefect::coincident_vertices, {lowest, v}, {}, "vertices ", lowest, " and ", v,
                  " are at one place");
        }
    }
    std::vector<MeshDefect> unfinished;
    const auto note = [&](MeshDefect defect, bool complete) {
        if (!complete) unfinished.push_back(defect);
    };
    // A tolerance that the caller gives holds along seams as well.
    const auto widths = options.tolerance ? std::vector<double>(representative.size(), tolerance)
                                          : seam_widths(mesh, borders, tolerance);
    note(MeshDefect::nearly_coincident_vertices, check_near_vertices(mesh, coincident, widths, effort, found));
    const std::vector<Index> with_area = check_triangles(mesh, found);
    note(MeshDefect::t_junction, check_t_junctions(mesh, borders, tolerance, effort, found));
    note(MeshDefect::nested_components, check_volumes(mesh, parts, effort, found));
    Index meetings = 0;
    std::int64_t left = effort;
    const auto meet = [&](Index f, Index g) {
        found(MeshDefect::self_intersection, {}, {f, g}, "triangles ", f, " and ", g, " meet");
        if (++meetings == options.max_findings_per_kind) left = 0;
    };
    note(MeshDefect::self_intersection,
         for_each_self_intersection(mesh.x, mesh.triangles, with_area, representative, left, meet));
    return unfinished;
}

}  // namespace detail

template <class P, class T>
MeshReport validate(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles,
                    const ValidateOptions& options) {
    detail::check_types<P, T>();
    static_assert(Real<typename P::Scalar>, "positions must be float or double");
    detail::check_options(options);
    MeshReport report;
    const detail::Recorder found(report, options.max_findings_per_kind);
    detail::check_shapes("validate", positions, triangles, found);
    const detail::CheckedMesh mesh = detail::workable(positions.derived(), triangles.derived(), found);
    const auto vertices = static_cast<Index>(mesh.x.cols());
    detail::check_edges(mesh.sides, found);
    detail::check_turns(mesh.sides, mesh.finite.size(), found);
    detail::check_fans(mesh.triangles, mesh.sides, vertices, found);

    const SurfaceParts parts = surface_parts(mesh.x, mesh.triangles, mesh.sides, mesh.finite);
    const auto borders = border_lines(mesh.sides, vertices);
    report.facts =
        surface_facts(mesh.x, mesh.sides, mesh.finite, parts, static_cast<Index>(borders.size()), report.valid());
    detail::check_extras(mesh, parts, borders, options.max_findings_per_kind, found);
    if (mesh.has_size) {
        report.unfinished = detail::check_geometry(mesh, parts, borders, report.facts.mean_edge, options, found);
        report.complete = report.unfinished.empty();
    }
    return report;
}

}  // namespace membrane
