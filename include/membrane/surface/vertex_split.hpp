// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/core/vector3.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Changes of a surface that tears, which all parts that know its triangles follow.
///
///     for (const auto& event : tear.update(x, dt, tissue, foundation)) {
///         tissue.split(event.split);
///         tree.split(event.split);
///     }
namespace membrane {

/// A vertex that becomes two: some of its triangles get another vertex in its place. Numbers and order of all triangles
/// stay. Valid until the surface changes again.
struct VertexSplit {
    Index vertex = no_index;                             ///< keeps the other triangles
    Index copy = no_index;                               ///< until now a vertex without triangles
    std::span<const Index> triangles = {};               ///< whose corner `vertex` becomes `copy`
    std::span<const std::array<Index, 3>> corners = {};  ///< theirs until now, in the same order
    double area_share = 0;                               ///< of the area around `vertex` that goes with `copy`, 0 to 1

    /// Whether triangle `f` gets the copy.
    [[nodiscard]] bool takes(Index f) const noexcept {
        return std::find(triangles.begin(), triangles.end(), f) != triangles.end();
    }

    /// The corners of triangle `f` until now. @pre takes(f)
    [[nodiscard]] std::array<Index, 3> corners_of(Index f) const noexcept {
        return corners[static_cast<std::size_t>(std::find(triangles.begin(), triangles.end(), f) - triangles.begin())];
    }

    /// Whether a triangle of `vertex` and these two other corners, in any order, gets the copy.
    [[nodiscard]] bool takes(Index first, Index second) const noexcept {
        return std::any_of(corners.begin(), corners.end(), [&](const auto& all) {
            const auto has = [&](Index v) { return std::find(all.begin(), all.end(), v) != all.end(); };
            return has(first) && has(second);
        });
    }

    /// Puts the copy in the place of the vertex in `list`, the corners of a triangle that gets it.
    template <class List>
    void replace_in(List&& list) const noexcept {
        std::replace(list.begin(), list.end(), vertex, copy);
    }
};

/// The number of vertices of `mesh` without triangles. If it is 0, parts have no memory to follow a split. O(V + F).
template <Real Scalar>
[[nodiscard]] Index reserve_of(const TriangleMesh<Scalar>& mesh) {
    std::vector<bool> referenced(static_cast<std::size_t>(mesh.vertex_count()), false);
    for (const Index v : mesh.triangles().reshaped()) referenced[static_cast<std::size_t>(v)] = true;
    return static_cast<Index>(std::count(referenced.begin(), referenced.end(), false));
}

/// Divides a constant of the vertex that is in proportion to the area around it.
template <Real Scalar>
void divide(Scalar& of_vertex, Scalar& of_copy, double area_share) noexcept {
    of_copy = static_cast<Scalar>(area_share) * of_vertex;
    of_vertex -= of_copy;
}

/// A triangle whose shape at rest changes.
template <Real Scalar>
struct ReshapedTriangle {
    Index triangle;                         ///< its number
    std::array<Index, 3> corners;           ///< its vertices
    std::array<Vector3<Scalar>, 3> before;  ///< their rest positions until now [m]
    std::array<Vector3<Scalar>, 3> after;   ///< their rest positions from now on [m]
};

/// A vertex that gets another place on the rest surface, so that an edge lies where the tear runs. Valid until the
/// surface changes again.
template <Real Scalar>
struct MovedVertex {
    Index vertex = no_index;                                   ///< `no_index`: none
    Vector3<Scalar> rest = Vector3<Scalar>::Zero();            ///< its rest position from now on [m]
    std::span<const ReshapedTriangle<Scalar>> triangles = {};  ///< all triangles around it
};

/// A part that follows a `VertexSplit`.
template <class Part>
concept FollowsSplit = requires(Part& part, const VertexSplit& split) {
    { part.split(split) }
    noexcept;
};

/// Counts the splits that a part has followed: the parts of a step must have followed the same ones.
class SplitCount {
  public:
    /// Splits until now.
    [[nodiscard]] Index splits() const noexcept { return splits_; }

  protected:
    Index splits_ = 0;  // of the part's own `split`; a snapshot holds it
};

/// A part that depends on the shape at rest.
template <class Part, class Scalar>
concept FollowsMovedVertex = requires(Part& part, const MovedVertex<Scalar>& moved) {
    { part.reshape(moved) }
    noexcept;
};

}  // namespace membrane
