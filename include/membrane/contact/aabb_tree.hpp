// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <span>
#include <utility>

#include <membrane/contact/wide_bvh.hpp>
#include <membrane/surface/aabb.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Finds the triangles near a point, a segment, a sphere, a box or a capsule, on a deforming surface.
///
///     auto tree = membrane::AabbTree(mesh);
///     const auto nearest = tree.closest_point(x, tool.position);
///     tree.refit(x, report.moved);
namespace membrane {

/// The point of the surface nearest to a query point.
template <Real Scalar>
struct SurfacePoint {
    Index triangle;               ///< `no_index`: nothing found.
    Vector3<Scalar> barycentric;  ///< Exactly zero for corners that do not contribute.
    Vector3<Scalar> point;        ///< [m]
    Scalar squared_distance;      ///< [m^2]
    Index nodes_visited;          ///< Boxes that the search tested.
};

/// The first intersection of a segment with the surface.
template <Real Scalar>
struct SurfaceHit {
    Index triangle;               ///< `no_index`: no intersection.
    Scalar fraction;              ///< 0 at the segment's start, 1 at its end.
    Vector3<Scalar> barycentric;  ///< Of the intersection.
    Index nodes_visited;          ///< Boxes that the search tested.
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// A tree of boxes over the triangles of a mesh [Bergen97], and its queries.
///
/// The tree keeps its own copy of the triangles; positions are arguments. The splits never change; `refit` updates the
/// boxes. Queries may run in several threads at once, but not during a refit.
///
/// If an argument is not finite, a radius is negative or a box is inverted, a query finds nothing and tests no box. A
/// triangle with a corner that is not finite may be missed; it does not affect other triangles (under `-ffast-math`
/// those in the same boxes may be missed too). A triangle is missed if the square of its distance overflows.
template <Real Scalar>
class AabbTree {
  public:
    /// O(F log F) for usual shapes.
    /// @throws InvalidInput if `balance_threshold` is below 1
    explicit AabbTree(const TriangleMesh<Scalar>& mesh, const TreeOptions& options = {}) : boxes_(mesh, options) {}

    /// Refits all boxes to the positions `x`, 3 x V [m]. Returns false, and changes nothing, if `x` does not have as
    /// many points as the mesh. O(F), no allocation.
    bool refit(const ConstPointsRef<Scalar>& x) noexcept { return boxes_.refit(x); }

    /// Refits the boxes around the vertices `moved`, each box once. `moved` may have any order and repetitions. If no
    /// other vertex has moved since the last refit, the boxes equal those of a full refit bit for bit.
    /// Ignores an index that is no vertex. O(moved * depth), plus one bit a node; no allocation.
    bool refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
        return boxes_.refit(x, moved);
    }

    /// A vertex becomes two, at one position until the next refit. Boxes keep their triangles: a flap that moves far
    /// away makes those that have triangles on either side of a tear larger. The memory is there if the mesh of the
    /// tree has vertices without triangles: that of a leaf for all corners of its triangles. Online. Cost: the leaves
    /// around the vertex.
    void split(const VertexSplit& split) noexcept { boxes_.split(split); }

    /// A vertex has moved as a tear has moved it: the next refit includes it. Online. Cost: the leaves around it.
    void reshape(const MovedVertex<Scalar>& moved) noexcept { boxes_.reshape(moved); }

    /// Number of splits that it has followed.
    [[nodiscard]] Index splits() const noexcept { return boxes_.splits(); }

    // All queries take the positions of the last refit, and find nothing if their number is another. They do not
    // allocate. They report the number of boxes visited: O(log F) for a small query near the surface, all at worst.

    /// The point of the surface nearest to `q`. If several points are equally near, returns one, always the same one.
    [[nodiscard]] SurfacePoint<Scalar> closest_point(const ConstPointsRef<Scalar>& x,
                                                     const Vector3<Scalar>& q) const noexcept;

    /// The first intersection of the segment with the surface, from either side, as exact as `first_hit` of a triangle.
    /// If it meets several triangles at the same point, returns the one of lowest index.
    [[nodiscard]] SurfaceHit<Scalar> first_hit(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& from,
                                               const Vector3<Scalar>& to) const noexcept;

    ///@{
    /// Calls `visit(Index f)` once for each triangle that intersects the sphere, the box between two corners, or the
    /// capsule around the segment from `p` to `q`, in a reproducible order. `visit` must not throw. Returns the number
    /// of boxes visited.
    template <class Visit>
    Index overlap_sphere(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& centre, Scalar radius,
                         Visit&& visit) const noexcept;
    template <class Visit>
    Index overlap_box(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& low, const Vector3<Scalar>& high,
                      Visit&& visit) const noexcept;
    template <class Visit>
    Index overlap_capsule(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& p, const Vector3<Scalar>& q,
                          Scalar radius, Visit&& visit) const noexcept;
    ///@}

    /// Size and shape of the tree.
    [[nodiscard]] TreeStatistics statistics() const noexcept { return boxes_.statistics(); }

    /// The box around all triangles below a node of `tree_shape`; node 0: around the surface. Empty if there is no such
    /// node.
    [[nodiscard]] Aabb<Scalar> box(Index node) const noexcept { return boxes_.box(node); }

    /// Visits what a tear changes, see `core/snapshot.hpp`: of a mesh with a reserve, the triangles. Then refit the
    /// tree.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.boxes_);
    }

  private:
    WideBvh<Scalar> boxes_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

namespace detail {

/// Lower bound of the fraction of the segment at which it meets a box; for triangles 0 if it may meet them, else
/// `probe.never`.
template <Real Scalar>
struct SegmentKey {
    const CapsuleQuery<Scalar>& probe;
    const Vector3<Scalar>&from, &to;

    template <Number N>
    [[nodiscard]] N operator()(const Aabb<N>& box) const noexcept {
        return probe.entry(box);
    }
    template <Number N>
    [[nodiscard]] N operator()(const Triangle<N>& triangles) const noexcept {
        const Crossing<N> crossing(triangles, from, to);
        return select<N>(crossing.clear, select<N>(crossing.met, 0, probe.never), 0);
    }
};

}  // namespace detail

template <Real Scalar>
SurfacePoint<Scalar> AabbTree<Scalar>::closest_point(const ConstPointsRef<Scalar>& x,
                                                     const Vector3<Scalar>& q) const noexcept {
    using Limits = std::numeric_limits<Scalar>;
    SurfacePoint<Scalar> best{no_index, {0, 0, 0}, {0, 0, 0}, (Limits::max)(), 0};
    if (!is_finite(q)) return best;
    const auto distance_to = [&]<Number N>(const Aabb<N>& box) { return squared_distance(box, q); };
    best.nodes_visited =
        boxes_.search(x, distance_to, best.squared_distance, [&](Index f, const Triangle<Scalar>& triangle) {
            const auto found = membrane::closest_point(triangle, q);
            if (!(found.squared_distance < best.squared_distance)) return;
            best = {f, found.barycentric, found.point, found.squared_distance, 0};
        });
    return best;
}

template <Real Scalar>
SurfaceHit<Scalar> AabbTree<Scalar>::first_hit(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& from,
                                               const Vector3<Scalar>& to) const noexcept {
    constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon();
    SurfaceHit<Scalar> best{no_index, 1, {0, 0, 0}, 0};
    if (!is_finite(from) || !is_finite(to)) return best;
    const CapsuleQuery<Scalar> probe(from, to, 0, boxes_.surface());
    Scalar limit = 1 + epsilon;
    const auto examine = [&](Index f, const Triangle<Scalar>& triangle) {
        const auto hit = membrane::first_hit(triangle, from, to);
        if (!hit) return;
        const bool tie = hit->fraction == best.fraction && (best.triangle == no_index || f < best.triangle);
        if (!(hit->fraction < best.fraction || tie)) return;
        best = {f, hit->fraction, hit->barycentric, 0};
        limit = best.fraction + epsilon;
    };
    best.nodes_visited = boxes_.search(x, detail::SegmentKey<Scalar>{probe, from, to}, limit, examine);
    return best;
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::overlap_sphere(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& centre, Scalar radius,
                                       Visit&& visit) const noexcept {
    using Limits = std::numeric_limits<Scalar>;
    if (!is_finite(centre) || !is_finite(radius) || !(radius >= 0)) return 0;
    const Scalar limit = radius * radius;
    const Scalar beyond = limit * (1 + 16 * Limits::epsilon()) + (Limits::min)();
    return boxes_.search(
        x, [&]<Number N>(const Aabb<N>& box) { return squared_distance(box, centre); }, beyond,
        [&](Index f, const Triangle<Scalar>& triangle) {
            if (membrane::closest_point(triangle, centre).squared_distance <= limit) visit(f);
        });
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::overlap_box(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& low,
                                    const Vector3<Scalar>& high, Visit&& visit) const noexcept {
    if (!is_finite(low) || !is_finite(high) || !at_most(low, high)) return 0;
    const Aabb<Scalar> asked{low, high};
    return boxes_.search(
        x, [&]<Number N>(const Aabb<N>& box) { return select<N>(overlap(box, asked), 0, 1); }, Scalar(1),
        [&](Index f, const Triangle<Scalar>& triangle) {
            if (touches_box(triangle, low, high)) visit(f);
        });
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::overlap_capsule(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& p,
                                        const Vector3<Scalar>& q, Scalar radius, Visit&& visit) const noexcept {
    if (!is_finite(p) || !is_finite(q) || !is_finite(radius) || !(radius >= 0)) return 0;
    const CapsuleQuery<Scalar> probe(p, q, radius, boxes_.surface());
    return boxes_.search(
        x, [&]<Number N>(const Aabb<N>& box) { return probe.entry(box); }, probe.never,
        [&](Index f, const Triangle<Scalar>& triangle) {
            const auto nearest = closest_to_segment(triangle, p, q);
            if (nearest.on_triangle.squared_distance <= radius * radius) visit(f);
        });
}

}  // namespace membrane
