// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/collision/box.hpp>
#include <membrane/collision/tree_shape.hpp>
#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/mesh/triangle.hpp>
#include <membrane/mesh/triangle_mesh.hpp>

/// Finds the triangles near a point, a segment, a sphere, a box or a capsule, on a surface that deforms.
///
///     auto tree = membrane::AabbTree(mesh);
///     const auto nearest = tree.closest_point(x, tool.position);
///     tree.refit(x, report.moved);
namespace membrane {

struct TreeOptions {
    /// A set of fewer triangles is shared out evenly into two leaves whatever their positions [Liu07] 2.3. Low: fewer
    /// triangles are tested; high: fewer boxes, and a refit costs less. At least 1.
    Index balance_threshold = 16;
};

/// The point of the surface nearest to another.
template <Real Scalar>
struct SurfacePoint {
    Index triangle;               ///< `no_index`: nothing found.
    Vector3<Scalar> barycentric;  ///< Exactly zero for the corners that have no part in it.
    Vector3<Scalar> point;        ///< [m]
    Scalar squared_distance;      ///< [m^2]
    Index boxes_visited;
};

/// Where a segment first meets the surface.
template <Real Scalar>
struct SurfaceHit {
    Index triangle;  ///< `no_index`: nothing met.
    Scalar along;    ///< 0 at the segment's start, 1 at its end.
    Vector3<Scalar> barycentric;
    Index boxes_visited;
};

/// A tree of boxes over the triangles of a mesh [Bergen97], split as `tree_shape` says.
///
/// The tree owns what it needs of the mesh; positions are handed in. The splits stay as they were at the start, the
/// boxes follow by `refit`. Queries may run in several threads at once, none beside a refit.
///
/// A query with a number that is not finite, a negative radius or a box inside out finds nothing, at no box. A triangle
/// with a corner that is not finite may not be found; the others are as ever (but under `-ffast-math` those in the same
/// boxes are not). Nor is what is so far away that the square of the distance overflows.
template <Real Scalar>
class AabbTree {
  public:
    /// O(F log F) for usual shapes.
    /// @throws InvalidInput if `balance_threshold` is below 1
    explicit AabbTree(const TriangleMesh<Scalar>& mesh, const TreeOptions& options = {});

    /// Fits all boxes to the positions `x`, 3 x V [m]. O(F), no allocation.
    /// @pre `x` has as many points as the mesh (asserted)
    void refit(const ConstPointsRef<Scalar>& x) noexcept;

    /// Fits the boxes around the vertices `moved`, each once, in any order, repeated or not: to the bit what a refit of
    /// all gives if only these have moved since the last one. O(moved * depth), no allocation.
    /// @pre `x` has as many points as the mesh and `moved` names some of them (asserted)
    void refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;

    // All queries take the positions that the tree was last fitted to. They do not allocate, and visit as many boxes as
    // they report: of the order of log F for what is near the surface and small, all at worst.

    /// The point of the surface nearest to `q`. Of points equally near, one; always the same.
    [[nodiscard]] SurfacePoint<Scalar> closest_point(const ConstPointsRef<Scalar>& x,
                                                     const Vector3<Scalar>& q) const noexcept;

    /// Where the segment first meets the surface, from either side; the lowest triangle if it meets several at once.
    [[nodiscard]] SurfaceHit<Scalar> first_hit(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& from,
                                               const Vector3<Scalar>& to) const noexcept;

    /// Calls `visit(Index f)` once for each triangle that has a point in common with the sphere, the box between two
    /// corners, or the capsule around the segment from `p` to `q`; always in the same order. `visit` must not throw.
    /// Returns the boxes visited.
    template <class Visit>
    Index touching_sphere(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& centre, Scalar radius,
                          Visit&& visit) const noexcept;
    template <class Visit>
    Index touching_box(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& low, const Vector3<Scalar>& high,
                       Visit&& visit) const noexcept;
    template <class Visit>
    Index touching_capsule(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& p, const Vector3<Scalar>& q,
                           Scalar radius, Visit&& visit) const noexcept;

    [[nodiscard]] const TreeStatistics& statistics() const noexcept { return statistics_; }

    /// Around all triangles below a node; of node 0, around the surface.
    /// @pre 0 <= `node` < `statistics().nodes` (asserted)
    [[nodiscard]] const Box<Scalar>& box(Index node) const noexcept;

  private:
    struct Node {
        Box<Scalar> box;
        Index first;  // of the two children, or of the leaf's items
        Index count;  // of the leaf's items, or 0
        [[nodiscard]] bool is_leaf() const noexcept { return count > 0; }
    };
    struct Item {
        std::array<Index, 3> corners;
        Index triangle;
    };

    [[nodiscard]] const Node& node(Index i) const noexcept { return nodes_[static_cast<std::size_t>(i)]; }
    [[nodiscard]] std::span<const Item> items(const Node& leaf) const noexcept {
        return {items_.data() + leaf.first, static_cast<std::size_t>(leaf.count)};
    }
    void fit(const ConstPointsRef<Scalar>& x, Index i) noexcept;

    /// Examines the triangles in boxes that have a key below `limit`, the lower of two branches first; `examine` may
    /// lower the limit. Returns the boxes visited.
    template <class Key, class Examine>
    [[nodiscard]] Index search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                               Examine examine) const noexcept;

    std::vector<Node> nodes_;  // as of TreeShape
    std::vector<Item> items_;  // leaf by leaf
    std::vector<Index> parents_;
    CompressedRows<Index> vertices_of_;  // of a leaf
    CompressedRows<Index> leaves_of_;    // around a vertex
    IndexSet stale_;                     // the boxes to fit
    std::vector<std::int8_t> awaited_;   // how many of a box's children are to be fitted before it
    TreeStatistics statistics_;
};

template <Real Scalar>
AabbTree<Scalar>::AabbTree(const TriangleMesh<Scalar>& mesh, const TreeOptions& options) {
    const TreeShape shape = tree_shape(mesh, options.balance_threshold);
    for (const auto& [parent, first, count] : shape.nodes) {
        nodes_.push_back({{}, first, count});
        parents_.push_back(parent);
    }
    for (const Index f : shape.triangles) {
        const auto corners = mesh.triangles().col(f);
        items_.push_back({{corners[0], corners[1], corners[2]}, f});
    }
    const auto node_count = static_cast<Index>(nodes_.size());
    vertices_of_ = CompressedRows<Index>(node_count, [&](auto put) {
        std::vector<Index> latest(static_cast<std::size_t>(mesh.vertex_count()), no_index);
        for (Index i = 0; i < node_count; ++i) {
            if (!node(i).is_leaf()) continue;
            for (const Item& item : items(node(i))) {
                for (const Index v : item.corners) {
                    if (std::exchange(latest[static_cast<std::size_t>(v)], i) != i) put(i, v);
                }
            }
        }
    });
    leaves_of_ = CompressedRows<Index>(mesh.vertex_count(), [&](auto put) {
        for (Index i = 0; i < node_count; ++i) {
            for (const Index v : vertices_of_[i]) put(v, i);
        }
    });
    stale_ = IndexSet(node_count);
    awaited_.assign(nodes_.size(), 0);
    statistics_ = membrane::statistics(shape);
    refit(mesh.positions());
}

template <Real Scalar>
void AabbTree<Scalar>::fit(const ConstPointsRef<Scalar>& x, Index i) noexcept {
    Node& fitted = nodes_[static_cast<std::size_t>(i)];
    fitted.box = {};
    if (fitted.is_leaf()) {
        for (const Index v : vertices_of_[i]) fitted.box.include(point(x, v));
    } else {
        fitted.box.include(node(fitted.first).box);
        fitted.box.include(node(fitted.first + 1).box);
    }
}

template <Real Scalar>
void AabbTree<Scalar>::refit(const ConstPointsRef<Scalar>& x) noexcept {
    MEMBRANE_ASSERT(x.cols() == leaves_of_.row_count());
    for (auto i = static_cast<Index>(nodes_.size()); i-- > 0;) fit(x, i);  // children come after their parent
}

template <Real Scalar>
void AabbTree<Scalar>::refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
    MEMBRANE_ASSERT(x.cols() == leaves_of_.row_count());
    if (moved.size() >= static_cast<std::size_t>(x.cols()) / 2) return refit(x);  // costs less from there on
    const auto parent = [this](Index i) { return parents_[static_cast<std::size_t>(i)]; };
    const auto awaited = [this](Index i) -> std::int8_t& { return awaited_[static_cast<std::size_t>(i)]; };
    stale_.clear();
    for (const Index v : moved) {
        for (Index i : leaves_of_[v]) {
            for (; stale_.insert(i) && i != 0; i = parent(i)) ++awaited(parent(i));
        }
    }
    for (Index i : stale_.items()) {
        if (!node(i).is_leaf()) continue;
        fit(x, i);
        while (i != 0 && --awaited(parent(i)) == 0) fit(x, i = parent(i));
    }
}

template <Real Scalar>
template <class Key, class Examine>
Index AabbTree<Scalar>::search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                               Examine examine) const noexcept {
    struct Waiting {
        Scalar key;
        Index node;
    };
    std::array<Waiting, TreeShape::max_depth + 1> waiting;
    std::size_t count = 0;
    waiting[count++] = {key(node(0).box), 0};
    Index visited = 1;
    while (count > 0) {
        Waiting next = waiting[--count];
        if (!(next.key < limit)) continue;
        while (!node(next.node).is_leaf()) {
            const Index child = node(next.node).first;
            Waiting far{key(node(child + 1).box), child + 1};
            next = {key(node(child).box), child};
            if (far.key < next.key) std::swap(next, far);
            if (far.key < limit) waiting[count++] = far;
            visited += 2;
        }
        if (!(next.key < limit)) continue;
        for (const Item& item : items(node(next.node))) {
            const auto triangle = triangle_at(x, item.corners);
            if (key(bounds(triangle)) < limit) examine(item.triangle, triangle);
        }
    }
    return visited;
}

template <Real Scalar>
SurfacePoint<Scalar> AabbTree<Scalar>::closest_point(const ConstPointsRef<Scalar>& x,
                                                     const Vector3<Scalar>& q) const noexcept {
    using Limits = std::numeric_limits<Scalar>;
    SurfacePoint<Scalar> best{no_index, {0, 0, 0}, {0, 0, 0}, (Limits::max)(), 0};
    if (!is_finite(q)) return best;
    const auto distance_to = [&](const Box<Scalar>& box) { return squared_distance(box, q); };
    best.boxes_visited = search(x, distance_to, best.squared_distance, [&](Index f, const Triangle<Scalar>& triangle) {
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
    const CapsuleProbe<Scalar> probe(from, to, 0, node(0).box);
    Scalar limit = 1 + epsilon;
    const auto entry_to = [&](const Box<Scalar>& box) { return probe.entry(box); };
    best.boxes_visited = search(x, entry_to, limit, [&](Index f, const Triangle<Scalar>& triangle) {
        const auto hit = membrane::first_hit(triangle, from, to);
        if (!hit) return;
        const bool tie = hit->along == best.along && (best.triangle == no_index || f < best.triangle);
        if (!(hit->along < best.along || tie)) return;
        best = {f, hit->along, hit->barycentric, 0};
        limit = best.along + epsilon;
    });
    return best;
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::touching_sphere(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& centre, Scalar radius,
                                        Visit&& visit) const noexcept {
    using Limits = std::numeric_limits<Scalar>;
    if (!is_finite(centre) || !is_finite(radius) || !(radius >= 0)) return 0;
    const Scalar limit = radius * radius;
    const Scalar beyond = limit * (1 + 16 * Limits::epsilon()) + (Limits::min)();
    return search(
        x, [&](const Box<Scalar>& box) { return squared_distance(box, centre); }, beyond,
        [&](Index f, const Triangle<Scalar>& triangle) {
            if (membrane::closest_point(triangle, centre).squared_distance <= limit) visit(f);
        });
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::touching_box(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& low,
                                     const Vector3<Scalar>& high, Visit&& visit) const noexcept {
    if (!is_finite(low) || !is_finite(high) || !(low.array() <= high.array()).all()) return 0;
    const Box<Scalar> asked{low, high};
    return search(
        x, [&](const Box<Scalar>& box) { return Scalar(overlap(box, asked) ? 0 : 1); }, Scalar(1),
        [&](Index f, const Triangle<Scalar>& triangle) {
            if (touches_box(triangle, low, high)) visit(f);
        });
}

template <Real Scalar>
template <class Visit>
Index AabbTree<Scalar>::touching_capsule(const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& p,
                                         const Vector3<Scalar>& q, Scalar radius, Visit&& visit) const noexcept {
    if (!is_finite(p) || !is_finite(q) || !is_finite(radius) || !(radius >= 0)) return 0;
    const CapsuleProbe<Scalar> probe(p, q, radius, node(0).box);
    return search(
        x, [&](const Box<Scalar>& box) { return probe.entry(box); }, probe.never,
        [&](Index f, const Triangle<Scalar>& triangle) {
            const auto nearest = closest_to_segment(triangle, p, q);
            if (nearest.on_triangle.squared_distance <= radius * radius) visit(f);
        });
}

template <Real Scalar>
const Box<Scalar>& AabbTree<Scalar>::box(Index node) const noexcept {
    MEMBRANE_ASSERT(node >= 0 && node < statistics_.nodes);
    return nodes_[static_cast<std::size_t>(node)].box;
}

}  // namespace membrane
