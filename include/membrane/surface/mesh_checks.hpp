// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/disjoint_sets.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/mesh_defect.hpp>

/// Checks of a mesh: `TriangleMesh` refuses the first defect, `validate` collects all defects.
///
///     check_edges(sides, found);  // calls found(MeshDefect, vertices, triangles, parts of a message...)
///
/// If `found` returns, the check goes on.
namespace membrane::detail {

/// Maps the numbers as columns of three, without a copy.
template <class Number, std::size_t n>
auto by_threes(std::string_view component, std::span<Number, n> numbers, std::string_view what) {
    if (numbers.size() % 3 != 0) {
        refuse(component, what, " must be a multiple of 3 numbers, got ", numbers.size());
    }
    using Columns = Eigen::Matrix<std::remove_const_t<Number>, 3, Eigen::Dynamic, Eigen::ColMajor>;
    return Eigen::Map<const Columns>(numbers.data(), 3, static_cast<Eigen::Index>(numbers.size() / 3));
}

/// Refuses at compile time types that cannot be a mesh.
template <class P, class T>
constexpr void check_types() {
    static_assert(P::RowsAtCompileTime == 3 || P::RowsAtCompileTime == Eigen::Dynamic,
                  "positions must be 3 x V, one point a column: pass the transpose if yours are one point a row");
    static_assert(T::RowsAtCompileTime == 3 || T::RowsAtCompileTime == Eigen::Dynamic,
                  "triangles must be 3 x F, one triangle a column: pass the transpose if yours are one triangle a row, "
                  "and cut quads into triangles");
    static_assert(std::integral<typename T::Scalar> && !std::same_as<typename T::Scalar, bool>,
                  "triangles must be of an integer type: pass triangles.cast<int>()");
}

/// Refuses a matrix that does not have three rows, or has more columns than `Index` can number. Nothing is stored
/// before.
template <class Found>
void check_shape(std::string_view component, Eigen::Index rows, Eigen::Index columns, Eigen::Index most,
                 MeshDefect none, Found found) {
    const bool points = none == MeshDefect::no_vertices;
    const std::string_view what = points ? "positions" : "triangles";
    const std::string_view shape = points ? "3 x V, one point a column" : "3 x F, one triangle a column";
    if (columns == 0) return found(none, {}, {}, what, " must be ", shape, ", got none");
    if (rows != 3) {
        const std::string_view hint = columns == 3 ? "; pass the transpose" : "";
        refuse(component, what, " must be ", shape, ", got ", rows, " x ", columns, hint);
    }
    if (columns > most) refuse(component, "at most ", most, " ", what, " can be numbered, got ", columns);
}

/// Checks the shapes of positions and triangles.
template <class P, class T, class Found>
void check_shapes(std::string_view component, const P& positions, const T& triangles, Found found) {
    constexpr Eigen::Index most = (std::numeric_limits<Index>::max)();
    check_shape(component, positions.rows(), positions.cols(), most, MeshDefect::no_vertices, found);
    check_shape(component, triangles.rows(), triangles.cols(), most / 3, MeshDefect::no_triangles, found);
}

/// Whether triangle `f` has three different, existing vertices. Checked before they are stored as `Index`, which could
/// hide a wrong number.
template <class T, class Found>
bool check_corners(const T& triangles, Eigen::Index f, Eigen::Index vertex_count, Found found) {
    using Corner = typename T::Scalar;
    const std::array<Corner, 3> corner{triangles(0, f), triangles(1, f), triangles(2, f)};
    const auto number = static_cast<Index>(f);
    for (const Corner v : corner) {
        if (std::cmp_greater_equal(v, 0) && std::cmp_less(v, vertex_count)) continue;
        found(MeshDefect::index_out_of_range, {}, {number}, "triangle ", f, " names vertex ", v, ", expected 0 to ",
              vertex_count - 1);
        return false;
    }
    for (const std::size_t i : {0U, 1U, 2U}) {
        if (corner[i] != corner[(i + 1) % 3]) continue;
        found(MeshDefect::repeated_vertex, {static_cast<Index>(corner[i])}, {number}, "triangle ", f, " names vertex ",
              corner[i], " twice, expected three vertices");
        return false;
    }
    return true;
}

/// Whether the coordinates of vertex `v` are finite and not too large. If so, `largest` grows to their largest
/// magnitude [m].
template <Real Scalar, class Found>
bool check_point(const Points<Scalar>& x, Index v, Scalar& largest, Found found) {
    const Scalar most = std::sqrt(std::sqrt((std::numeric_limits<Scalar>::max)())) / 4;
    Scalar magnitude[3];
    for (const Index k : {0, 1, 2}) {
        magnitude[k] = std::abs(x(k, v));
        const std::string_view name = std::string_view("xyz").substr(static_cast<std::size_t>(k), 1);
        if (!is_finite(magnitude[k])) {
            found(MeshDefect::coordinate_not_finite, {v}, {}, name, " of vertex ", v, " must be finite [m], got ",
                  x(k, v));
            return false;
        }
        if (magnitude[k] > most) {
            found(MeshDefect::coordinate_too_large, {v}, {}, name, " of vertex ", v, " must be within ", most,
                  " [m] of 0, or squares of areas overflow, got ", x(k, v));
            return false;
        }
    }
    largest = (std::max)({largest, magnitude[0], magnitude[1], magnitude[2]});
    return true;
}

/// Whether the surface has a size and an area, and floating point resolves its edges.
template <Real Scalar, class Found>
bool check_size(const Points<Scalar>& x, const Triangles& triangles, Scalar largest_coordinate, Found found) {
    using Limits = std::numeric_limits<Scalar>;
    const double least = 4 * std::sqrt(std::sqrt(static_cast<double>((Limits::min)())));
    const double spacing = static_cast<double>(Limits::epsilon()) * static_cast<double>(largest_coordinate);
    double sum = 0, largest_height = 0;
    for (Index f = 0; f < triangles.cols(); ++f) {
        const auto corner = [&](Index k) { return Vector3<double>(point(x, triangles(k, f)).template cast<double>()); };
        const Vector3<double> ab = corner(1) - corner(0), bc = corner(2) - corner(1), ca = corner(0) - corner(2);
        const auto length = [](const Vector3<double>& side) { return std::hypot(side.x(), side.y(), side.z()); };
        sum += length(ab) + length(bc) + length(ca);
        const double longest = (std::max)({length(ab), length(bc), length(ca)});
        if (longest > 0) largest_height = (std::max)(largest_height, length(cross(ab, bc)) / longest);
    }
    const double mean_edge = sum / (3.0 * static_cast<double>(triangles.cols()));
    if (!(mean_edge > 0)) {
        found(MeshDefect::all_at_one_point, {}, {},
              "all vertices of each triangle are at one point, expected a surface");
    } else if (mean_edge < least) {
        found(MeshDefect::too_small, {}, {}, "the mean edge must be at least ", least,
              " [m], or squares of areas vanish, got ", mean_edge);
    } else if (mean_edge < 1000 * spacing) {
        found(MeshDefect::too_coarse, {}, {}, "the mean edge must be at least ", 1000 * spacing,
              " [m], a thousand times the spacing of numbers at the largest coordinate, got ", mean_edge,
              "; move the mesh to the origin, or use double");
    } else if (largest_height <= 4 * spacing) {
        found(MeshDefect::all_on_one_line, {}, {}, "all vertices of each triangle are on one line, expected a surface");
    } else {
        return true;
    }
    return false;
}

/// Finds triangles with the same three vertices, and edges of three triangles or more.
template <class Found>
void check_edges(std::span<const HalfEdge> sides, Found found) {
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        const Index first = edge[0].first, second = edge[0].second;
        std::size_t different = 1;
        for (std::size_t i = 1; i < edge.size(); ++i) {
            const HalfEdge &before = edge[i - 1], &side = edge[i];
            if (side.apex != before.apex) ++different;
            if (side.apex != before.apex || side.apex < second) continue;  // reported once, at the lowest two vertices
            const bool same = side.forward == before.forward;
            found(same ? MeshDefect::duplicate_triangle : MeshDefect::double_sided_triangle, {first, second, side.apex},
                  {before.triangle, side.triangle}, "triangles ", before.triangle, " and ", side.triangle,
                  " name the same vertices ", first, ", ", second, " and ", side.apex, ", expected one of them");
        }
        if (different < 3) return;
        std::vector<Index> all;
        for (const HalfEdge& side : edge) all.push_back(side.triangle);
        found(MeshDefect::non_manifold_edge, {first, second}, all, "edge ", first, "-", second, " belongs to ",
              edge.size(), " triangles (", all[0], ", ", all[1], ", ", all[2], edge.size() > 3 ? ", ..." : "",
              "), expected 1 or 2");
    });
}

/// Whether exactly two triangles share the edge and run along it in the same direction.
inline bool against(std::span<const HalfEdge> edge) {
    return edge.size() == 2 && edge[0].forward == edge[1].forward && edge[0].apex != edge[1].apex;
}

/// Sets of triangles with consistent orientation, in which neighbours run along their edge in opposite directions.
/// Element f is triangle f as given, element f + `triangle_count` is triangle f reversed. If one set has both, the
/// surface is one-sided.
inline DisjointSets turns(std::span<const HalfEdge> sides, std::size_t triangle_count) {
    DisjointSets sets(2 * triangle_count);
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() != 2 || edge[0].apex == edge[1].apex) return;
        const auto f = static_cast<std::size_t>(edge[0].triangle), g = static_cast<std::size_t>(edge[1].triangle);
        const std::size_t turn = against(edge) ? triangle_count : 0;
        sets.unite(f, g + turn);
        sets.unite(f + triangle_count, g + triangle_count - turn);
    });
    return sets;
}

/// Finds neighbours of opposite orientation, and one-sided surfaces.
template <class Found>
void check_turns(std::span<const HalfEdge> sides, std::size_t triangle_count, Found found) {
    DisjointSets sets(0);
    std::vector<bool> reported;
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (!against(edge)) return;
        if (reported.empty()) {
            sets = turns(sides, triangle_count);
            reported.assign(2 * triangle_count, false);
        }
        const Index f = edge[0].triangle, g = edge[1].triangle, first = edge[0].first, second = edge[0].second;
        const std::size_t set = sets.find(static_cast<std::size_t>(f));
        if (set != sets.find(static_cast<std::size_t>(f) + triangle_count)) {
            found(MeshDefect::inconsistent_orientation, {first, second}, {f, g}, "triangles ", f, " and ", g,
                  " run along edge ", first, "-", second,
                  " in the same direction, expected opposite ones; turn one of them");
        } else if (!reported[set]) {
            reported[set] = true;
            found(MeshDefect::one_sided, {first, second}, {f, g},
                  "the surface is one-sided (a Moebius strip), expected two sides");
        }
    });
}

/// Sets of corners that edges connect around their vertex: element 3 f + k is corner k of triangle f.
inline DisjointSets fans(const Triangles& triangles, std::span<const HalfEdge> sides) {
    const auto corner_at = [&](const HalfEdge& side, Index v) {
        const Index k = triangles(side.side, side.triangle) == v ? side.side : (side.side + 1) % 3;
        return static_cast<std::size_t>(3 * static_cast<Eigen::Index>(side.triangle) + k);
    };
    DisjointSets sets(static_cast<std::size_t>(triangles.size()));
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        for (const HalfEdge& side : edge.subspan(1)) {
            for (const Index v : {side.first, side.second}) sets.unite(corner_at(edge[0], v), corner_at(side, v));
        }
    });
    return sets;
}

/// Finds vertices whose triangles are not all connected by edges at that vertex; each is reported once. Triangles of
/// `no_index` are skipped.
template <class Found>
void check_fans(const Triangles& triangles, std::span<const HalfEdge> sides, Index vertex_count, Found found) {
    DisjointSets fan_of = fans(triangles, sides);
    const auto none = static_cast<std::size_t>(triangles.size());
    std::vector<std::size_t> first_fan(static_cast<std::size_t>(vertex_count), none);
    std::vector<bool> reported(static_cast<std::size_t>(vertex_count), false);
    for (std::size_t corner = 0; corner < none; ++corner) {
        if (triangles.data()[corner] == no_index) continue;
        const auto v = static_cast<std::size_t>(triangles.data()[corner]);
        if (first_fan[v] == none) first_fan[v] = fan_of.find(corner);
        if (first_fan[v] == fan_of.find(corner) || reported[v]) continue;
        reported[v] = true;
        const auto f = static_cast<Index>(first_fan[v] / 3), g = static_cast<Index>(corner / 3);
        found(MeshDefect::non_manifold_vertex, {static_cast<Index>(v)}, {f, g}, "vertex ", v, " joins triangles ", f,
              " and ", g, ", which no edges connect around it, expected one fan of triangles");
    }
}

}  // namespace membrane::detail
