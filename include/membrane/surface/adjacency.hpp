// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Neighbours of vertices and triangles on a surface.
///
///     const membrane::Adjacency adjacency(mesh);
///     for (const auto [first, second] : adjacency.edges()) { ... }
///     for (const membrane::Index w : adjacency.neighbours(v)) { ... }
namespace membrane {

/// Neighbours of vertices and triangles in flat arrays. Owns its data: the mesh need not outlive it.
class Adjacency {
  public:
    /// O(F log F).
    template <Real Scalar>
    explicit Adjacency(const TriangleMesh<Scalar>& mesh) : Adjacency(mesh, half_edges(mesh.triangles())) {}

    /// Vertices that an edge joins to `v`, ascending.
    /// @pre `v` is a vertex (asserted).
    [[nodiscard]] std::span<const Index> neighbours(Index v) const& noexcept { return neighbours_[v]; }
    void neighbours(Index) && = delete;

    /// Triangles that have `v` as a corner, ascending.
    /// @pre `v` is a vertex (asserted).
    [[nodiscard]] std::span<const Index> triangles_of(Index v) const& noexcept { return around_.triangles_of(v); }
    void triangles_of(Index) && = delete;

    /// The triangle across each side of `f`, side k running from corner k to the next; `no_index` at a border.
    /// @pre `f` is a triangle (asserted).
    [[nodiscard]] std::array<Index, 3> triangle_neighbours(Index f) const noexcept {
        return around_.triangle_neighbours(f);
    }

    /// The two vertices of each edge, the lower first; ascending.
    [[nodiscard]] std::span<const std::array<Index, 2>> edges() const& noexcept { return edges_; }
    void edges() && = delete;

    /// Vertices on an edge that has one triangle only, ascending; empty if the surface is closed.
    [[nodiscard]] std::span<const Index> border_vertices() const& noexcept { return border_vertices_; }
    void border_vertices() && = delete;

    /// Whether every edge has two triangles.
    [[nodiscard]] bool closed() const noexcept { return border_vertices_.empty(); }

    /// The part without edges, for `pseudo_normal`.
    operator const TriangleAdjacency&() const noexcept { return around_; }  // NOLINT(google-explicit-constructor)

  private:
    template <Real Scalar>
    Adjacency(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides);

    TriangleAdjacency around_;
    std::vector<std::array<Index, 2>> edges_;
    std::vector<Index> border_vertices_;
    CompressedRows<Index> neighbours_;
};

/// The two vertices of each edge of `mesh`, the lower first; ascending. O(F log F).
template <Real Scalar>
[[nodiscard]] std::vector<std::array<Index, 2>> edges(const TriangleMesh<Scalar>& mesh) {
    std::vector<std::array<Index, 2>> all;
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> edge) {
        all.push_back({edge[0].first, edge[0].second});
    });
    return all;
}

/// The vertices on the border of `mesh`, ascending, for example to pin a rim. O(F log F).
template <Real Scalar>
[[nodiscard]] std::vector<Index> border(const TriangleMesh<Scalar>& mesh) {
    const Adjacency adjacency(mesh);
    return {adjacency.border_vertices().begin(), adjacency.border_vertices().end()};
}

template <Real Scalar>
Adjacency::Adjacency(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides) : around_(mesh, sides) {
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) { edges_.push_back({edge[0].first, edge[0].second}); });
    neighbours_ = CompressedRows<Index>(mesh.vertex_count(), [&](auto put) {
        for (const auto& [first, second] : edges_) {  // ascending, so each row is ascending
            put(first, second);
            put(second, first);
        }
    });
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (around_.on_border(v)) border_vertices_.push_back(v);
    }
}

}  // namespace membrane
