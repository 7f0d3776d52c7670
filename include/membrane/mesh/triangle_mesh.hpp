// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/mesh/half_edges.hpp>

/// The surface at rest: points, and triangles that join them.
///
///     const auto mesh = membrane::TriangleMesh(positions, triangles);                  // matrices 3 x V [m] and 3 x F
///     const auto mesh = membrane::TriangleMesh(std::span(xyz), std::span(corners));    // x y z x y z ... [m]
///     const Eigen::Map<const Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> vertices(buffer, 3, V, {8});
///     const auto mesh = membrane::TriangleMesh(vertices, triangles);                   // an engine's vertices
namespace membrane {

/// An oriented surface of triangles, with or without a border, constant once built.
///
/// Accepted as they are: vertices that no triangle names, several vertices at one place, triangles without area among
/// others that have some, several components, a surface that faces inward.
template <Real Scalar>
class TriangleMesh {
  public:
    /// From points 3 x V [m] and triangles 3 x F of any integer type, counter-clockwise seen from outside.
    /// @throws InvalidInput unless
    ///   - the shapes are as said, there is a triangle at least, and each names three different vertices that exist;
    ///   - coordinates are finite, squares of areas neither overflow nor vanish, and the mean edge is at least a
    ///     hundred times the spacing of numbers at the largest coordinate;
    ///   - some triangle has an area;
    ///   - no two triangles name the same three vertices, at most two share an edge and they run along it in opposite
    ///     directions, and the triangles of each vertex form one fan.
    /// O(F log F).
    template <class P, class T>
    TriangleMesh(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles);

    /// The same from x y z x y z ... [m] and three vertices for each triangle.
    template <std::integral I, std::size_t n>
    TriangleMesh(std::span<const Scalar> xyz, std::span<I, n> corners);

    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(positions_.cols()); }
    [[nodiscard]] Index triangle_count() const noexcept { return static_cast<Index>(triangles_.cols()); }

    /// 3 x V [m].
    [[nodiscard]] const Points<Scalar>& positions() const noexcept { return positions_; }

    /// 3 x F.
    [[nodiscard]] const Triangles& triangles() const noexcept { return triangles_; }

  private:
    Points<Scalar> positions_;
    Triangles triangles_;
};

template <class P, class T>
TriangleMesh(const Eigen::MatrixBase<P>&, const Eigen::MatrixBase<T>&) -> TriangleMesh<typename P::Scalar>;

template <class S, std::size_t m, class I, std::size_t n>
TriangleMesh(std::span<S, m>, std::span<I, n>) -> TriangleMesh<std::remove_const_t<S>>;

namespace detail {

inline constexpr std::string_view triangle_mesh = "TriangleMesh";

/// Three to a column, without a copy.
template <class Number, std::size_t n>
auto by_threes(std::span<Number, n> numbers, std::string_view what) {
    if (numbers.size() % 3 != 0) {
        refuse(triangle_mesh, what, " must be a multiple of 3 numbers, got ", numbers.size());
    }
    using Columns = Eigen::Matrix<std::remove_const_t<Number>, 3, Eigen::Dynamic>;
    return Eigen::Map<const Columns>(numbers.data(), 3, static_cast<Eigen::Index>(numbers.size() / 3));
}

inline void check_shape(Eigen::Index rows, Eigen::Index columns, Eigen::Index most, std::string_view what,
                        std::string_view shape) {
    if (rows == 3 && columns > most) {
        refuse(triangle_mesh, "at most ", most, " ", what, " can be numbered, got ", columns);
    }
    if (rows == 3 && columns > 0) return;
    if (columns == 0) refuse(triangle_mesh, what, " must be ", shape, ", got none");
    const std::string_view remedy = columns == 3 ? "; pass the transpose" : "";
    refuse(triangle_mesh, what, " must be ", shape, ", got ", rows, " x ", columns, remedy);
}

/// Refuses corners that are no vertex, before they are stored as `Index`, which could hide what they are.
template <class T>
void check_corners(const T& triangles, Eigen::Index vertex_count) {
    using Corner = typename T::Scalar;
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        const std::array<Corner, 3> corner{triangles(0, f), triangles(1, f), triangles(2, f)};
        for (const Corner v : corner) {
            if (std::cmp_greater_equal(v, 0) && std::cmp_less(v, vertex_count)) continue;
            refuse(triangle_mesh, "triangle ", f, " names vertex ", v, ", expected 0 to ", vertex_count - 1);
        }
        for (const std::size_t i : {0U, 1U, 2U}) {
            if (corner[i] != corner[(i + 1) % 3]) continue;
            refuse(triangle_mesh, "triangle ", f, " names vertex ", corner[i], " twice, expected three vertices");
        }
    }
}

/// The largest magnitude of a coordinate [m]; refuses those that one cannot compute with.
template <Real Scalar>
Scalar check_coordinates(const Points<Scalar>& x) {
    const Scalar most = std::sqrt(std::sqrt((std::numeric_limits<Scalar>::max)())) / 4;
    Scalar largest = 0;
    for (Index v = 0; v < x.cols(); ++v) {
        for (const Index k : {0, 1, 2}) {
            const Scalar magnitude = std::abs(x(k, v));
            const std::string_view name = std::string_view("xyz").substr(static_cast<std::size_t>(k), 1);
            if (!is_finite(magnitude)) {
                refuse(triangle_mesh, name, " of vertex ", v, " must be finite [m], got ", x(k, v));
            }
            if (magnitude > most) {
                refuse(triangle_mesh, name, " of vertex ", v, " must be within ", most,
                       " [m] of 0, or squares of areas overflow, got ", x(k, v));
            }
            largest = (std::max)(largest, magnitude);
        }
    }
    return largest;
}

/// Refuses a surface without size or area, or with numbers too coarse for its edges.
template <Real Scalar>
void check_size(const Points<Scalar>& x, const Triangles& triangles, Scalar largest_coordinate) {
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
    if (!(mean_edge > 0)) refuse(triangle_mesh, "all vertices of each triangle are at one point, expected a surface");
    if (mean_edge < least) {
        refuse(triangle_mesh, "the mean edge must be at least ", least, " [m], or squares of areas vanish, got ",
               mean_edge);
    }
    if (mean_edge < 100 * spacing) {
        refuse(triangle_mesh, "the mean edge must be at least ", 100 * spacing,
               " [m], a hundred times the spacing of numbers at the largest coordinate, got ", mean_edge,
               "; move the mesh to the origin, or use double");
    }
    if (largest_height <= 4 * spacing) {
        refuse(triangle_mesh, "all vertices of each triangle are on one line, expected a surface");
    }
}

/// Numbers in sets that grow together.
class DisjointSets {
  public:
    explicit DisjointSets(std::size_t count) : parent_(count) {
        std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    }
    std::size_t find(std::size_t i) noexcept {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    void unite(std::size_t i, std::size_t j) noexcept {
        const auto [first, second] = std::minmax({find(i), find(j)});
        parent_[second] = first;
    }

  private:
    std::vector<std::size_t> parent_;
};

/// Whether the triangles can be turned so that neighbours run along their edge in opposite directions.
inline bool orientable(std::span<const HalfEdge> sides) {
    const std::size_t count = sides.size() / 3;  // set f: the triangle as it is, set f + count: turned
    DisjointSets sets(2 * count);
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() != 2) return;
        const auto f = static_cast<std::size_t>(edge[0].triangle), g = static_cast<std::size_t>(edge[1].triangle);
        const std::size_t turn = edge[0].forward == edge[1].forward ? count : 0;
        sets.unite(f, g + turn);
        sets.unite(f + count, g + count - turn);
    });
    for (std::size_t f = 0; f < count; ++f) {
        if (sets.find(f) == sets.find(f + count)) return false;
    }
    return true;
}

/// Refuses edges where triangles do not lie side by side.
inline void check_edges(std::span<const HalfEdge> sides) {
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        const Index first = edge[0].first, second = edge[0].second;
        for (std::size_t i = 1; i < edge.size(); ++i) {
            if (edge[i].apex != edge[i - 1].apex) continue;
            refuse(triangle_mesh, "triangles ", edge[i - 1].triangle, " and ", edge[i].triangle,
                   " name the same vertices ", first, ", ", second, " and ", edge[i].apex, ", expected one of them");
        }
        if (edge.size() > 2) {
            refuse(triangle_mesh, "edge ", first, "-", second, " belongs to ", edge.size(), " triangles (",
                   edge[0].triangle, ", ", edge[1].triangle, ", ", edge[2].triangle, edge.size() > 3 ? ", ..." : "",
                   "), expected 1 or 2");
        }
    });
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() < 2 || edge[0].forward != edge[1].forward) return;
        if (!orientable(sides)) refuse(triangle_mesh, "the surface is one-sided (a Moebius strip), expected two sides");
        refuse(triangle_mesh, "triangles ", edge[0].triangle, " and ", edge[1].triangle, " run along edge ",
               edge[0].first, "-", edge[0].second, " in the same direction, expected opposite ones; turn one of them");
    });
}

/// Refuses a vertex whose triangles do not all hang together by edges at that vertex.
inline void check_fans(const Triangles& triangles, std::span<const HalfEdge> sides, Index vertex_count) {
    const auto corner_at = [&](const HalfEdge& side, Index v) {
        const Index k = triangles(side.side, side.triangle) == v ? side.side : (side.side + 1) % 3;
        return static_cast<std::size_t>(3 * static_cast<Eigen::Index>(side.triangle) + k);
    };
    DisjointSets fans(sides.size());
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() != 2) return;
        for (const Index v : {edge[0].first, edge[0].second}) fans.unite(corner_at(edge[0], v), corner_at(edge[1], v));
    });
    const std::size_t none = sides.size();
    std::vector<std::size_t> fan_of(static_cast<std::size_t>(vertex_count), none);
    for (std::size_t corner = 0; corner < sides.size(); ++corner) {
        const Index v = triangles.data()[corner];
        std::size_t& fan = fan_of[static_cast<std::size_t>(v)];
        if (fan == none) fan = fans.find(corner);
        if (fan == fans.find(corner)) continue;
        refuse(triangle_mesh, "vertex ", v, " joins triangles ", fan / 3, " and ", corner / 3,
               ", which no edges connect around it, expected one fan of triangles");
    }
}

}  // namespace detail

template <Real Scalar>
template <class P, class T>
TriangleMesh<Scalar>::TriangleMesh(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles) {
    static_assert(P::RowsAtCompileTime == 3 || P::RowsAtCompileTime == Eigen::Dynamic,
                  "positions must be 3 x V, one point a column: pass the transpose if yours are one point a row");
    static_assert(T::RowsAtCompileTime == 3 || T::RowsAtCompileTime == Eigen::Dynamic,
                  "triangles must be 3 x F, one triangle a column: pass the transpose if yours are one triangle a row, "
                  "and cut quads into triangles");
    static_assert(std::same_as<typename P::Scalar, Scalar>,
                  "positions must be of the mesh's own scalar: pass positions.cast<float>() or .cast<double>()");
    static_assert(std::integral<typename T::Scalar> && !std::same_as<typename T::Scalar, bool>,
                  "triangles must be of an integer type: pass triangles.cast<int>()");
    constexpr Eigen::Index most = (std::numeric_limits<Index>::max)();
    detail::check_shape(positions.rows(), positions.cols(), most, "positions", "3 x V, one point a column");
    detail::check_shape(triangles.rows(), triangles.cols(), most / 3, "triangles", "3 x F, one triangle a column");
    detail::check_corners(triangles.derived(), positions.cols());
    positions_ = positions;
    triangles_ = triangles.template cast<Index>();
    detail::check_size(positions_, triangles_, detail::check_coordinates(positions_));
    const std::vector<HalfEdge> sides = half_edges(triangles_);
    detail::check_edges(sides);
    detail::check_fans(triangles_, sides, vertex_count());
}

template <Real Scalar>
template <std::integral I, std::size_t n>
TriangleMesh<Scalar>::TriangleMesh(std::span<const Scalar> xyz, std::span<I, n> corners)
    : TriangleMesh(detail::by_threes(xyz, "positions"), detail::by_threes(corners, "triangles")) {}

}  // namespace membrane
