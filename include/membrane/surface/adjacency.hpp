// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/surface/half_edges.hpp>
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
    explicit Adjacency(const TriangleMesh<Scalar>& mesh);

    /// Vertices that an edge joins to `v`, ascending.
    /// @pre `v` is a vertex (asserted).
    [[nodiscard]] std::span<const Index> neighbours(Index v) const noexcept { return neighbours_[v]; }

    /// Triangles that have `v` as a corner, ascending.
    /// @pre `v` is a vertex (asserted).
    [[nodiscard]] std::span<const Index> triangles_of(Index v) const noexcept { return triangles_of_[v]; }

    /// The triangle across each side of `f`, side k running from corner k to the next; `no_index` at a border.
    /// @pre `f` is a triangle (asserted).
    [[nodiscard]] const std::array<Index, 3>& triangle_neighbours(Index f) const noexcept;

    /// The two vertices of each edge, the lower first; ascending.
    [[nodiscard]] std::span<const std::array<Index, 2>> edges() const noexcept { return edges_; }

    /// Vertices on an edge that has one triangle only, ascending; empty if the surface is closed.
    [[nodiscard]] std::span<const Index> border_vertices() const noexcept { return border_vertices_; }

    /// Whether every edge has two triangles.
    [[nodiscard]] bool closed() const noexcept { return border_vertices_.empty(); }

  private:
    inline void collect_edges(const Triangles& triangles);

    std::vector<std::array<Index, 2>> edges_;
    std::vector<std::array<Index, 3>> triangle_neighbours_;
    std::vector<Index> border_vertices_;
    CompressedRows<Index> neighbours_;
    CompressedRows<Index> triangles_of_;
};

/// The vertices on the border of `mesh`, ascending, for example to pin a rim. O(F log F).
template <Real Scalar>
[[nodiscard]] std::vector<Index> border(const TriangleMesh<Scalar>& mesh) {
    const Adjacency adjacency(mesh);
    return {adjacency.border_vertices().begin(), adjacency.border_vertices().end()};
}

template <Real Scalar>
Adjacency::Adjacency(const TriangleMesh<Scalar>& mesh) {
    collect_edges(mesh.triangles());
    neighbours_ = CompressedRows<Index>(mesh.vertex_count(), [&](auto put) {
        for (const auto& [first, second] : edges_) {  // ascending, so each row is ascending
            put(first, second);
            put(second, first);
        }
    });
    triangles_of_ = CompressedRows<Index>(mesh.vertex_count(), [&](auto put) {
        for (Index f = 0; f < mesh.triangle_count(); ++f) {
            for (const Index v : mesh.triangles().col(f)) put(v, f);
        }
    });
}

inline const std::array<Index, 3>& Adjacency::triangle_neighbours(Index f) const noexcept {
    MEMBRANE_ASSERT(f >= 0 && static_cast<std::size_t>(f) < triangle_neighbours_.size());
    return triangle_neighbours_[static_cast<std::size_t>(f)];
}

inline void Adjacency::collect_edges(const Triangles& triangles) {
    triangle_neighbours_.assign(static_cast<std::size_t>(triangles.cols()), {no_index, no_index, no_index});
    const auto across = [this](const HalfEdge& side) -> Index& {
        return triangle_neighbours_[static_cast<std::size_t>(side.triangle)][static_cast<std::size_t>(side.side)];
    };
    for_each_edge(half_edges(triangles), [&](std::span<const HalfEdge> sides) {
        edges_.push_back({sides[0].first, sides[0].second});
        if (sides.size() == 2) {
            across(sides[0]) = sides[1].triangle;
            across(sides[1]) = sides[0].triangle;
        } else {
            border_vertices_.insert(border_vertices_.end(), {sides[0].first, sides[0].second});
        }
    });
    std::sort(border_vertices_.begin(), border_vertices_.end());
    border_vertices_.erase(std::unique(border_vertices_.begin(), border_vertices_.end()), border_vertices_.end());
}

}  // namespace membrane
