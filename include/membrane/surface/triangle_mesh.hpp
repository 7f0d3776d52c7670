// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/mesh_checks.hpp>
#include <membrane/surface/mesh_defect.hpp>

/// The surface at rest: points, and triangles that join them.
///
///     const auto mesh = membrane::TriangleMesh(positions, triangles);                  // matrices 3 x V [m] and 3 x F
///     const auto mesh = membrane::TriangleMesh(std::span(xyz), std::span(corners));    // x y z x y z ... [m]
///     const Eigen::Map<const Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> vertices(buffer, 3, V, {8});
///     const auto mesh = membrane::TriangleMesh(vertices, triangles);                   // an engine's vertices
namespace membrane {

/// An oriented surface of triangles, with or without a border, constant once built.
///
/// Accepted unchanged: vertices without triangles, several vertices at one position, triangles without area among
/// others that have some, several components, a surface that faces inward.
template <Real Scalar>
class TriangleMesh {
  public:
    /// From points 3 x V [m] and triangles 3 x F of any integer type, counter-clockwise seen from outside. O(F log F).
    /// @throws InvalidInput unless
    /// - the shapes are as above, there is at least one triangle, and each has three different vertices that exist;
    /// - coordinates are finite, squares of areas neither overflow nor vanish, and the mean edge is at least a
    ///   thousand times the spacing of numbers at the largest coordinate: in float, edges of 1 mm within 8 m of 0;
    /// - some triangle has an area;
    /// - no two triangles have the same three vertices, at most two share an edge and they run along it in opposite
    ///   directions, and the triangles of each vertex form one fan.
    template <class P, class T>
    TriangleMesh(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles);

    /// From x y z x y z ... [m] and three vertices for each triangle.
    template <std::integral I, std::size_t n>
    TriangleMesh(std::span<const Scalar> xyz, std::span<I, n> corners);

    ///@{
    /// Number of vertices V, number of triangles F.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(positions_.cols()); }
    [[nodiscard]] Index triangle_count() const noexcept { return static_cast<Index>(triangles_.cols()); }
    ///@}

    /// 3 x V [m].
    [[nodiscard]] const Points<Scalar>& positions() const& noexcept { return positions_; }
    [[nodiscard]] Points<Scalar> positions() && noexcept { return std::move(positions_); }

    /// 3 x F.
    [[nodiscard]] const Triangles& triangles() const& noexcept { return triangles_; }
    [[nodiscard]] Triangles triangles() && noexcept { return std::move(triangles_); }

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

/// Refuses the first defect.
struct RefuseDefect {
    template <class... Parts>
    void operator()(MeshDefect, const std::vector<Index>&, const std::vector<Index>&, const Parts&... parts) const {
        refuse(triangle_mesh, parts...);
    }
};

}  // namespace detail

template <Real Scalar>
template <class P, class T>
TriangleMesh<Scalar>::TriangleMesh(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles) {
    detail::check_types<P, T>();
    static_assert(std::same_as<typename P::Scalar, Scalar>,
                  "positions must be of the mesh's own scalar: pass positions.cast<float>() or .cast<double>()");
    constexpr detail::RefuseDefect found;
    detail::check_shapes(detail::triangle_mesh, positions, triangles, found);
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        detail::check_corners(triangles.derived(), f, positions.cols(), found);
    }
    positions_ = positions;
    triangles_ = triangles.template cast<Index>();
    Scalar largest = 0;
    for (Index v = 0; v < vertex_count(); ++v) detail::check_point(positions_, v, largest, found);
    detail::check_size(positions_, triangles_, largest, found);
    const std::vector<HalfEdge> sides = half_edges(triangles_);
    detail::check_edges(sides, found);
    detail::check_turns(sides, static_cast<std::size_t>(triangle_count()), found);
    detail::check_fans(triangles_, sides, vertex_count(), found);
}

template <Real Scalar>
template <std::integral I, std::size_t n>
TriangleMesh<Scalar>::TriangleMesh(std::span<const Scalar> xyz, std::span<I, n> corners)
    : TriangleMesh(detail::by_threes(detail::triangle_mesh, xyz, "positions"),
                   detail::by_threes(detail::triangle_mesh, corners, "triangles")) {}

}  // namespace membrane
