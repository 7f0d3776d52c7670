// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include <membrane/surface/aabb.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// A mesh in an order in which elements close in space are close in memory.
///
///     const auto [near, source_vertex, source_triangle] = membrane::reordered(mesh);
///     for (membrane::Index v = 0; v < near.vertex_count(); ++v) colour_now[v] = colour[source_vertex[v]];
namespace membrane {

/// A mesh, and the former indices of its vertices and triangles.
template <Real Scalar>
struct ReorderedMesh {
    TriangleMesh<Scalar> mesh;           ///< with new indices
    std::vector<Index> source_vertex;    ///< former index of vertex v
    std::vector<Index> source_triangle;  ///< former index of triangle f
};

/// The surface with its vertices along a space-filling curve [Morton66], and its triangles by the first of their
/// vertices. A tool at a new position needs few cache lines, which matters from about 100,000 vertices on.
/// Deterministic on every machine; a mesh in this order keeps it. O(F log F).
template <Real Scalar>
[[nodiscard]] ReorderedMesh<Scalar> reordered(const TriangleMesh<Scalar>& mesh);

namespace detail {

/// The lowest 21 bits of `number`, with two zeros between neighbours.
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint64_t number) noexcept {
    number &= 0x1fffff;
    number = (number | number << 32) & 0x1f00000000ffff;
    number = (number | number << 16) & 0x1f0000ff0000ff;
    number = (number | number << 8) & 0x100f00f00f00f00f;
    number = (number | number << 4) & 0x10c30c30c30c30c3;
    return (number | number << 2) & 0x1249249249249249;
}

/// The indices 0, 1, ... sorted by their keys; equal keys keep their order.
template <class Key>
[[nodiscard]] std::vector<Index> sorted_by(const std::vector<Key>& keys) {
    std::vector<Index> order(keys.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
        return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
    });
    return order;
}

}  // namespace detail

template <Real Scalar>
ReorderedMesh<Scalar> reordered(const TriangleMesh<Scalar>& mesh) {
    const auto& x = mesh.positions();
    Aabb<Scalar> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) all.include(point(x, v));
    const Vector3<Scalar> low = all.low, size = all.high - all.low;
    const Scalar cells = Scalar(1 << 21) * (1 - Scalar(1e-6)), per_metre = cells / size.maxCoeff();
    std::vector<std::uint64_t> cell_keys;
    for (const auto& p : x.colwise()) {
        std::uint64_t key = 0;
        for (const Index k : {0, 1, 2}) {
            key |= detail::spread_bits(static_cast<std::uint64_t>((p[k] - low[k]) * per_metre)) << k;
        }
        cell_keys.push_back(key);
    }
    const std::vector<Index> vertices = detail::sorted_by(cell_keys);

    std::vector<Index> now(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v)
        now[static_cast<std::size_t>(vertices[v])] = static_cast<Index>(v);
    const Triangles renamed = mesh.triangles().unaryExpr([&](Index v) { return now[static_cast<std::size_t>(v)]; });
    std::vector<Index> first;
    for (const auto& corners : renamed.colwise()) first.push_back(corners.minCoeff());
    const std::vector<Index> triangles = detail::sorted_by(first);
    // The placeholder of all rows has another name in Eigen 5.
    return {TriangleMesh<Scalar>(x(Eigen::seqN(0, 3), vertices), renamed(Eigen::seqN(0, 3), triangles)), vertices,
            triangles};
}

}  // namespace membrane
