// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// Kinds of mesh defects, their severity and their remedy.
///
///     for (const auto& finding : membrane::validate(x, triangles).findings) {
///         std::cout << name(finding.defect) << ": " << finding.text << "; " << remedy(finding.defect) << "\n";
///     }
namespace membrane {

/// The kinds of defects. Those up to `non_manifold_vertex` are errors: `TriangleMesh` refuses them.
enum class MeshDefect : std::uint8_t {
    no_vertices,               ///< There are no positions.
    no_triangles,              ///< There are positions only.
    index_out_of_range,        ///< A triangle names a vertex that does not exist.
    repeated_vertex,           ///< A triangle names a vertex twice.
    coordinate_not_finite,     ///< A coordinate is infinite or NaN.
    coordinate_too_large,      ///< Squares of areas overflow.
    too_small,                 ///< Squares of areas vanish.
    too_coarse,                ///< So far from 0, floating point does not resolve the edges.
    all_at_one_point,          ///< All positions are equal.
    all_on_one_line,           ///< No triangle has an area.
    duplicate_triangle,        ///< Two triangles have the same vertices in the same orientation,
    double_sided_triangle,     ///< or in opposite orientation.
    non_manifold_edge,         ///< An edge of three triangles or more.
    one_sided,                 ///< A Moebius strip, a Klein bottle.
    inconsistent_orientation,  ///< Two triangles run along their edge in the same direction.
    non_manifold_vertex,       ///< It joins triangles that no edges connect around it.

    coincident_vertices,         ///< At equal positions.
    nearly_coincident_vertices,  ///< Closer than the tolerance.
    zero_area,                   ///< Exactly: the corners are on one line.
    needle,                      ///< The shortest edge is at most a millionth of the longest.
    cap,                         ///< An angle of 179.999 degrees or more.
    isolated_vertex,             ///< No triangle references it.
    missing_triangle,            ///< A border of three edges.
    t_junction,                  ///< A vertex of the border on the middle of an edge of the border.
    several_components,          ///< Parts that no edge connects.
    no_volume,                   ///< Closed and flat.
    inward,                      ///< Closed, and its triangles run clockwise seen from outside.
    nested_components,           ///< One closed component inside another.
    self_intersection,           ///< Triangles intersect outside their common vertices and edges.
};

/// Number of kinds of defects.
inline constexpr std::size_t mesh_defect_count = static_cast<std::size_t>(MeshDefect::self_intersection) + 1;

/// What follows from a defect.
enum class Severity : std::uint8_t {
    error,    ///< `TriangleMesh` refuses the mesh.
    warning,  ///< The mesh is accepted unchanged and may behave in an unwanted manner.
};

/// An error up to `non_manifold_vertex`, a warning beyond.
[[nodiscard]] constexpr Severity severity(MeshDefect defect) noexcept {
    return defect <= MeshDefect::non_manifold_vertex ? Severity::error : Severity::warning;
}

namespace detail {

struct DefectText {
    std::string_view name, remedy;
};

/// In the order of `MeshDefect`.
inline constexpr std::array<DefectText, mesh_defect_count> defect_texts{{
    {"no vertices", "pass the positions, one point a column"},
    {"no triangles", "pass the triangles, three vertices a column"},
    {"index out of range", "count vertices from 0; check for triangles cut off or of another mesh"},
    {"repeated vertex", "repair with .drop_repeated"},
    {"coordinate not finite", "check the program that wrote it: it cannot be repaired"},
    {"coordinate too large", "check the program that wrote it, or choose metres as unit"},
    {"too small", "choose metres as unit, or use double"},
    {"too coarse", "move the mesh to the origin, or use double"},
    {"all at one point", "check the program that wrote the positions"},
    {"all on one line", "check the program that wrote the positions"},
    {"duplicate triangle", "repair with .drop_duplicates"},
    {"double-sided triangle", "repair with .drop_duplicates: a membrane is one sheet, with two sides anyway"},
    {"non-manifold edge",
     "repair with .weld and .drop_duplicates if triangles are doubled; else remove triangles until two are left, or "
     "give "
     "the others vertices of their own: the mesh does not say which ones are the membrane"},
    {"one-sided", "cut it open: a tool needs an outside to work on"},
    {"inconsistent orientation", "repair with .orient"},
    {"non-manifold vertex", "repair with .weld if vertices coincide there, else with .split_vertices"},
    {"coincident vertices", "repair with .weld = 0 (merges identical positions), or the surface falls apart there"},
    {"nearly coincident vertices", "repair with .weld and a distance, or the surface falls apart there"},
    {"zero area", "repair with .weld and .drop_repeated if corners coincide, else with .drop_zero_area; or remesh"},
    {"needle", "repair with .weld and .drop_repeated, or remesh"},
    {"cap", "turn its longest edge, or remesh"},
    {"isolated vertex", "repair with .drop_isolated"},
    {"missing triangle", "add the triangle, if the surface is meant to be closed"},
    {"T-junction", "repair with .weld if vertices nearly coincide there, else cut the triangle at that edge in two"},
    {"several components",
     "repair with .weld if they meet along a seam; make a mesh of each, if they are not meant to be one membrane"},
    {"no volume", "leave out one of the two sides"},
    {"inward", "repair with .flip_inward, or the tool works from inside"},
    {"nested components", "leave out the inner one, if it is not meant"},
    {"self-intersection",
     "repair with .weld if vertices coincide there, or nearly, else remesh, or move the vertices apart"},
}};

}  // namespace detail

/// A short name.
[[nodiscard]] constexpr std::string_view name(MeshDefect defect) noexcept {
    return detail::defect_texts[static_cast<std::size_t>(defect)].name;
}

/// How to remove the defect.
[[nodiscard]] constexpr std::string_view remedy(MeshDefect defect) noexcept {
    return detail::defect_texts[static_cast<std::size_t>(defect)].remedy;
}

}  // namespace membrane
