// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Triangles around a vertex, and across a side, on a surface that may tear.
///
///     membrane::TriangleAdjacency adjacency(mesh);
///     for (const membrane::Index f : adjacency.triangles_of(v)) { ... }
namespace membrane {

/// The triangles of each vertex and the neighbours of each triangle in flat arrays. Owns its data.
class TriangleAdjacency {
  public:
    /// O(F log F).
    template <Real Scalar>
    explicit TriangleAdjacency(const TriangleMesh<Scalar>& mesh)
        : TriangleAdjacency(mesh, half_edges(mesh.triangles())) {}

    /// With `sides`, the `half_edges` of the mesh. O(F).
    template <Real Scalar>
    TriangleAdjacency(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides);

    /// Triangles that have `v` as a corner, ascending. @pre `v` is a vertex (asserted).
    [[nodiscard]] std::span<const Index> triangles_of(Index v) const& noexcept { return triangles_of_[v]; }
    void triangles_of(Index) && = delete;

    /// The triangle across each side of `f`, side k running from corner k to the next; `no_index` at a border.
    /// @pre `f` is a triangle (asserted).
    [[nodiscard]] std::array<Index, 3> triangle_neighbours(Index f) const noexcept {
        MEMBRANE_ASSERT(f >= 0 && static_cast<std::size_t>(f) < neighbours_.size());
        return neighbours_[static_cast<std::size_t>(f)];
    }

    /// Whether `v` is on an edge that has one triangle only. @pre `v` is a vertex (asserted).
    [[nodiscard]] bool on_border(Index v) const noexcept {
        MEMBRANE_ASSERT(v >= 0 && static_cast<std::size_t>(v) < on_border_.size());
        return on_border_[static_cast<std::size_t>(v)] != 0;
    }

    /// Whether every edge has two triangles.
    [[nodiscard]] bool closed() const noexcept { return closed_; }

    /// A vertex becomes two: triangles that part are neighbours no more. Online. Cost: the triangles around the vertex.
    void split(const VertexSplit& split) noexcept;

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.triangles_of_, self.neighbours_, self.on_border_, self.closed_);
    }

  private:
    CompressedRows<Index> triangles_of_;
    std::vector<std::array<Index, 3>> neighbours_;
    std::vector<unsigned char> on_border_;
    bool closed_ = true;
};

template <Real Scalar>
TriangleAdjacency::TriangleAdjacency(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides)
    : triangles_of_(mesh.vertex_count(),
                    [&](auto put) {
                        for (Index f = 0; f < mesh.triangle_count(); ++f) {
                            for (const Index v : mesh.triangles().col(f)) put(v, f);
                        }
                    }),
      neighbours_(static_cast<std::size_t>(mesh.triangle_count()), {no_index, no_index, no_index}),
      on_border_(static_cast<std::size_t>(mesh.vertex_count()), 0) {
    const auto across = [this](const HalfEdge& side) -> Index& {
        return neighbours_[static_cast<std::size_t>(side.triangle)][static_cast<std::size_t>(side.side)];
    };
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        if (edge.size() == 2) {
            across(edge[0]) = edge[1].triangle;
            across(edge[1]) = edge[0].triangle;
            return;
        }
        closed_ = false;
        for (const Index v : {edge[0].first, edge[0].second}) on_border_[static_cast<std::size_t>(v)] = 1;
    });
}

inline void TriangleAdjacency::split(const VertexSplit& split) noexcept {
    bool parts = false;
    for (std::size_t n = 0; n < split.triangles.size(); ++n) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index f = split.triangles[n], first = split.corners[n][k], second = split.corners[n][(k + 1) % 3];
            Index& across = neighbours_[static_cast<std::size_t>(f)][k];
            if ((first != split.vertex && second != split.vertex) || across == no_index || split.takes(across))
                continue;
            auto& back = neighbours_[static_cast<std::size_t>(across)];
            std::replace(back.begin(), back.end(), f, no_index);
            across = no_index;
            for (const Index v : {first, second}) on_border_[static_cast<std::size_t>(v)] = 1;
            parts = true;
        }
    }
    on_border_[static_cast<std::size_t>(split.copy)] = on_border_[static_cast<std::size_t>(split.vertex)];
    closed_ = closed_ && !parts;
    triangles_of_.split(split.vertex, split.copy, [&](Index f) { return split.takes(f); });
}

}  // namespace membrane
