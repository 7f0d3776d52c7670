// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <compare>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/types.hpp>

/// The half-edges of all triangles, grouped by edge: the input of checks and adjacency.
///
///     membrane::for_each_edge(membrane::half_edges(triangles), [](std::span<const membrane::HalfEdge> sides) {
///         // sides.size() is 1 at a border, 2 inside a surface, more at a non-manifold edge
///     });
namespace membrane {

/// One side of one triangle, oriented as its edge.
struct HalfEdge {
    ///@{
    /// The edge's vertices, first < second.
    Index first, second;
    ///@}
    Index apex;      ///< The triangle's third vertex.
    Index triangle;  ///< The triangle that has this side.
    Index side;      ///< The triangle's side: from its corner `side` to the next.
    bool forward;    ///< Whether the triangle runs from `first` to `second`.

    /// By edge, then apex, then triangle.
    friend constexpr auto operator<=>(const HalfEdge&, const HalfEdge&) = default;
};

/// The 3 F half-edges, ascending by edge, then apex, then triangle. O(F log F).
/// @pre No triangle has a vertex twice.
[[nodiscard]] inline std::vector<HalfEdge> half_edges(const Triangles& triangles);

/// Calls `visit` with the half-edges of each edge, edges ascending.
template <class Visit>
void for_each_edge(std::span<const HalfEdge> sides, Visit visit);

inline std::vector<HalfEdge> half_edges(const Triangles& triangles) {
    std::vector<HalfEdge> sides;
    sides.reserve(static_cast<std::size_t>(triangles.size()));
    for (Index f = 0; f < triangles.cols(); ++f) {
        for (Index side = 0; side < 3; ++side) {
            const Index from = triangles(side, f);
            const Index to = triangles((side + 1) % 3, f);
            const auto [first, second] = std::minmax({from, to});
            sides.push_back({first, second, triangles((side + 2) % 3, f), f, side, from < to});
        }
    }
    std::sort(sides.begin(), sides.end());
    return sides;
}

template <class Visit>
void for_each_edge(std::span<const HalfEdge> sides, Visit visit) {
    for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
        const HalfEdge& edge = sides[begin];
        while (end < sides.size() && sides[end].first == edge.first && sides[end].second == edge.second) ++end;
        visit(sides.subspan(begin, end - begin));
    }
}

}  // namespace membrane
