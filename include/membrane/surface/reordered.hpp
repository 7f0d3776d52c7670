// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include <membrane/surface/box.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// A mesh in an order in which what is near in space is near in memory.
///
///     const auto [near, source_vertex, triangle_before] = membrane::reordered(mesh);
///     for (membrane::Index v = 0; v < near.vertex_count(); ++v) colour_now[v] = colour[source_vertex[v]];
namespace membrane {

/// A mesh, and what its vertices and triangles were before.
template <Real Scalar>
struct ReorderedMesh {
    TriangleMesh<Scalar> mesh;
    std::vector<Index> source_vertex;    ///< vertex v was this one
    std::vector<Index> triangle_before;  ///< triangle f was this one
};

/// The same surface, its vertices along a curve that fills space [Morton66], its triangles by the first of their vertices.
/// A tool that comes to another place finds there in few lines of the cache what it needs, which tells from about
/// 100,000 vertices on. The same for the same mesh, on every machine; what is in this order stays in it. O(F log F).
template <Real Scalar>
[[nodiscard]] ReorderedMesh<Scalar> reordered(const TriangleMesh<Scalar>& mesh);

namespace detail {

/// The lowest 21 bits of `number`, two zeros between any two.
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint64_t number) noexcept {
    number &= 0x1fffff;
    number = (number | number << 32) & 0x1f00000000ffff;
    number = (number | number << 16) & 0x1f0000ff0000ff;
    number = (number | number << 8) & 0x100f00f00f00f00f;
    number = (number | number << 4) & 0x10c30c30c30c30c3;
    return (number | number << 2) & 0x1249249249249249;
}

/// The numbers 0, 1, ... by their keys; those with the same key as they came.
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
    Box<Scalar> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) all.include(point(x, v));
    const Vector3<Scalar> low = all.low, size = all.high - all.low;
    const Scalar cells = Scalar(1 << 21) * (1 - Scalar(1e-6)), per_metre = cells / size.maxCoeff();
    std::vector<std::uint64_t> place;
    for (const auto& p : x.colwise()) {
        std::uint64_t key = 0;
        for (const Index k : {0, 1, 2}) {
            key |= detail::spread_bits(static_cast<std::uint64_t>((p[k] - low[k]) * per_metre)) << k;
        }
        place.push_back(key);
    }
    const std::vector<Index> vertices = detail::sorted_by(place);

    std::vector<Index> now(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v)
        now[static_cast<std::size_t>(vertices[v])] = static_cast<Index>(v);
    const Triangles renamed = mesh.triangles().unaryExpr([&](Index v) { return now[static_cast<std::size_t>(v)]; });
    std::vector<Index> first;
    for (const auto& corners : renamed.colwise()) first.push_back(corners.minCoeff());
    const std::vector<Index> triangles = detail::sorted_by(first);
    return {TriangleMesh<Scalar>(x(Eigen::all, vertices), renamed(Eigen::all, triangles)), vertices, triangles};
}

}  // namespace membrane
