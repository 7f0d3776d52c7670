// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/mesh/adjacency.hpp>
#include <membrane/mesh/triangle.hpp>

/// Which way a surface faces as it moves.
///
///     auto normals = membrane::VertexNormals(mesh);
///     normals.update(x, report.moved);    // in the loop: the moved vertices and their neighbours
///     draw(x, normals.values());
namespace membrane {

/// Unit normals of the vertices, weighted by the area of their triangles. Owns all it holds; the mesh may go.
///
/// An update of the moved vertices gives the same bits as one of all. A vertex whose triangles have no area together,
/// or are not finite or too large for the numbers, gets its normal at rest, and (0, 0, 1) if it had none there or has
/// no triangles: always a finite vector of length 1.
template <Real Scalar>
class VertexNormals {
  public:
    /// Of the mesh at rest. O(F).
    explicit VertexNormals(const TriangleMesh<Scalar>& mesh);

    /// Of all vertices, at the positions `x`, 3 x V [m]. O(F), no allocation.
    /// @pre `x` has a column for each vertex (asserted).
    void update(const ConstPointsRef<Scalar>& x) noexcept;

    /// Of the vertices `moved` and their neighbours, each once; a vertex may be named several times. Returns them, valid
    /// until the next update: no other normal has changed. Linear in the number of their triangles, no allocation.
    /// @pre `x` has a column for each vertex and `moved` names vertices (asserted).
    std::span<const Index> update(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;

    /// 3 x V, unit length.
    [[nodiscard]] const Points<Scalar>& values() const noexcept { return values_; }

  private:
    void measure(const ConstPointsRef<Scalar>& x, Index f) noexcept;
    void sum_up(Index v) noexcept;

    Triangles triangles_;
    CompressedRows<Index> triangles_of_;  // around a vertex
    Points<Scalar> areas_;                // twice the area of each triangle, along its normal
    Points<Scalar> values_;
    Points<Scalar> at_rest_;
    IndexSet measured_, updated_;  // by the last call
};

/// The angle-weighted normal where `barycentric` says, of the face, edge or corner: its sign against the way from there
/// to a point tells inside from outside when that is the surface point nearest to it [Baerentzen05].
/// `barycentric` is exactly zero at the corners that have no part in it, as `closest_point` gives it. Unit length, or
/// zero where the triangles around have no area. No allocation; linear in the triangles of a corner.
/// @pre `f` is a triangle (asserted).
template <class Positions>
[[nodiscard]] Vector3<typename Positions::Scalar> pseudo_normal(
    const Positions& x, const Triangles& triangles, const Adjacency& adjacency, Index f,
    const Vector3<typename Positions::Scalar>& barycentric) noexcept;

namespace detail {

/// `a` at unit length, or `otherwise` where its length is not a number one can divide by.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> unit_or(const Vector3<Scalar>& a, const Vector3<Scalar>& otherwise) noexcept {
    const Scalar squared = squared_norm(a);
    if (!is_finite(squared) || squared < (std::numeric_limits<Scalar>::min)()) return otherwise;
    return a / std::sqrt(squared);
}

/// The angle between two sides [rad].
template <Real Scalar>
[[nodiscard]] Scalar angle_between(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

}  // namespace detail

template <Real Scalar>
VertexNormals<Scalar>::VertexNormals(const TriangleMesh<Scalar>& mesh)
    : triangles_(mesh.triangles()),
      triangles_of_(mesh.vertex_count(),
                    [&](auto put) {
                        for (Index f = 0; f < mesh.triangle_count(); ++f) {
                            for (const Index v : mesh.triangles().col(f)) put(v, f);
                        }
                    }),
      areas_(3, mesh.triangle_count()),
      values_(3, mesh.vertex_count()),
      at_rest_(Vector3<Scalar>(0, 0, 1).replicate(1, mesh.vertex_count())),
      measured_(mesh.triangle_count()),
      updated_(mesh.vertex_count()) {
    update(mesh.positions());
    at_rest_ = values_;
}

template <Real Scalar>
void VertexNormals<Scalar>::update(const ConstPointsRef<Scalar>& x) noexcept {
    MEMBRANE_ASSERT(x.cols() == values_.cols());
    for (Index f = 0; f < static_cast<Index>(triangles_.cols()); ++f) measure(x, f);
    for (Index v = 0; v < triangles_of_.row_count(); ++v) sum_up(v);
}

template <Real Scalar>
std::span<const Index> VertexNormals<Scalar>::update(const ConstPointsRef<Scalar>& x,
                                                     std::span<const Index> moved) noexcept {
    MEMBRANE_ASSERT(x.cols() == values_.cols());
    measured_.clear();
    updated_.clear();
    for (const Index v : moved) {
        updated_.insert(v);
        for (const Index f : triangles_of_[v]) {
            if (!measured_.insert(f)) continue;
            measure(x, f);
            for (const Index corner : triangles_.col(f)) updated_.insert(corner);
        }
    }
    for (const Index v : updated_.items()) sum_up(v);
    return updated_.items();
}

template <Real Scalar>
void VertexNormals<Scalar>::measure(const ConstPointsRef<Scalar>& x, Index f) noexcept {
    areas_.col(f) = 2 * area_vector(triangle_at(x, triangles_.col(f)));
}

template <Real Scalar>
void VertexNormals<Scalar>::sum_up(Index v) noexcept {
    Vector3<Scalar> area(0, 0, 0);
    for (const Index f : triangles_of_[v]) area += point(areas_, f);
    values_.col(v) = detail::unit_or(area, point(at_rest_, v));
}

template <class Positions>
Vector3<typename Positions::Scalar> pseudo_normal(const Positions& x, const Triangles& triangles,
                                                  const Adjacency& adjacency, Index f,
                                                  const Vector3<typename Positions::Scalar>& barycentric) noexcept {
    using Scalar = typename Positions::Scalar;
    MEMBRANE_ASSERT(f >= 0 && f < triangles.cols());
    const Vector3<Scalar> none(0, 0, 0);
    const auto face_normal = [&](Index g) {
        return detail::unit_or(area_vector(triangle_at(x, triangles.col(g))), none);
    };
    const auto zeros = (barycentric.array() == 0).count();
    if (zeros == 0) return face_normal(f);
    if (zeros == 1) {
        const Index k = barycentric[0] == 0 ? 0 : barycentric[1] == 0 ? 1 : 2;
        const Index across = adjacency.triangle_neighbours(f)[static_cast<std::size_t>((k + 1) % 3)];
        if (across == no_index) return face_normal(f);
        return detail::unit_or<Scalar>(face_normal(f) + face_normal(across), none);
    }
    const Index v = triangles(barycentric[0] != 0 ? 0 : barycentric[1] != 0 ? 1 : 2, f);
    Vector3<Scalar> sum = none;
    for (const Index g : adjacency.triangles_of(v)) {
        const auto corner = triangles.col(g);
        const Index k = corner[0] == v ? 0 : corner[1] == v ? 1 : 2;
        const Vector3<Scalar> next = point(x, corner[(k + 1) % 3]) - point(x, v);
        const Vector3<Scalar> last = point(x, corner[(k + 2) % 3]) - point(x, v);
        sum += detail::angle_between(next, last) * face_normal(g);
    }
    return detail::unit_or(sum, none);
}

}  // namespace membrane
