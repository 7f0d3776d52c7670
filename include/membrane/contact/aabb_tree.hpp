// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/contact/tree_topology.hpp>
#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/core/lanes.hpp>
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

/// Options of a tree.
struct TreeOptions {
    /// A set of fewer triangles is halved into two leaves [Liu07] 2.3. A low value tests fewer triangles; a high value
    /// tests fewer boxes and makes a refit cheaper. At least 1.
    Index balance_threshold = 16;
};

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
class AabbTree : public SplitCount {
  public:
    /// O(F log F) for usual shapes.
    /// @throws InvalidInput if `balance_threshold` is below 1
    explicit AabbTree(const TriangleMesh<Scalar>& mesh, const TreeOptions& options = {});

    /// Refits all boxes to the positions `x`, 3 x V [m]. Returns false, and changes nothing, if `x` does not have as
    /// many points as the mesh. O(F), no allocation.
    bool refit(const ConstPointsRef<Scalar>& x) noexcept;

    /// Refits the boxes around the vertices `moved`, each box once. `moved` may have any order and repetitions. If no
    /// other vertex has moved since the last refit, the boxes equal those of a full refit bit for bit.
    /// Ignores an index that is no vertex. O(moved * depth), plus one bit a node; no allocation.
    bool refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;

    /// A vertex becomes two, at one position until the next refit. Boxes keep their triangles: a flap that moves far
    /// away makes those that have triangles on either side of a tear larger. The memory is there if the mesh of the
    /// tree has vertices without triangles: that of a leaf for all corners of its triangles. Online. Cost: the leaves
    /// around the vertex.
    void split(const VertexSplit& split) noexcept;

    /// A vertex has moved as a tear has moved it: the next refit includes it. Online. Cost: the leaves around it.
    void reshape(const MovedVertex<Scalar>& moved) noexcept {
        for (const Index leaf : leaves_of_[moved.vertex]) stale_leaves_.insert(leaf);
    }

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

    /// A query of your own: calls `examine(Index f, triangle)` for each triangle with a key below `limit`, of boxes
    /// with a key below `limit`. Visits sibling boxes by ascending key; `examine` may lower the limit. `key(box)` is
    /// one number a box; `key(triangle)` is optional: by default a triangle has the key of its box. Returns the number
    /// of boxes visited.
    template <class Key, class Examine>
    [[nodiscard]] Index search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                               Examine examine) const noexcept;

    /// Size and shape of the tree before its nodes were joined to have a child for each of the `Lanes`.
    [[nodiscard]] TreeStatistics statistics() const noexcept { return statistics_; }

    /// The box around all triangles below a node of `tree_shape`; node 0: around the surface. Empty if there is no such
    /// node.
    [[nodiscard]] Aabb<Scalar> box(Index node) const noexcept;

    /// Visits what a tear changes, see `replay/snapshot.hpp`: of a mesh with a reserve, the triangles. Then refit the
    /// tree.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if (self.has_reserve_) visit(self.items_, self.vertices_of_, self.leaves_of_, self.splits_);
    }

  private:
    static constexpr std::size_t width = Lanes<Scalar>::count;
    static constexpr std::size_t bits_in_word = 64;
    static constexpr Index filled = 4;  // most rows of vertices and leaves are padded to a multiple of this

    /// The box and the part index of each child. Missing children have the box of the first child: keys must be
    /// computed from finite numbers only.
    struct alignas(64) Node {
        Aabb<Lanes<Scalar>> boxes;
        std::array<Index, width> child;
        std::size_t children;
    };
    struct Item {
        std::array<Index, 3> corners;
        Index triangle;
    };
    struct Leaf {
        Index first, count;  // of the items
    };

    void fold();
    void collect_vertices_and_leaves(Index vertex_count);
    [[nodiscard]] Index node_count() const noexcept { return static_cast<Index>(nodes_.size()); }
    [[nodiscard]] std::span<const Item> items_of(Index leaf) const noexcept {
        const auto [first, count] = leaves_[static_cast<std::size_t>(leaf)];
        return std::span(items_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
    }
    [[nodiscard]] std::span<Item> items_of(Index leaf) noexcept {
        const auto [first, count] = leaves_[static_cast<std::size_t>(leaf)];
        return std::span(items_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
    }
    void reserve_vertices();
    void add_vertex(Index leaf, Index v) noexcept;
    [[nodiscard]] Aabb<Scalar> box_in(Index slot) const noexcept;
    void fit_leaf(const ConstPointsRef<Scalar>& x, Index leaf) noexcept;
    void fit_node(Index n) noexcept;
    void put(const Aabb<Scalar>& box, Index slot) noexcept;
    void mark_parent(Index part) noexcept;
    [[nodiscard]] static Triangle<Lanes<Scalar>> triangles_at(const ConstPointsRef<Scalar>& x,
                                                              const Item* some) noexcept;

    template <class Key, class Examine>
    static void examine_leaf(const ConstPointsRef<Scalar>& x, std::span<const Item> leaf, Key key, const Scalar& limit,
                             Examine examine) noexcept;

    TreeTopology shape_;
    std::vector<Node> nodes_;
    Aabb<Scalar> surface_;     // around all triangles
    std::vector<Item> items_;  // leaf by leaf
    std::vector<Leaf> leaves_;

    // Part indices: the nodes, then the leaves. Slot indices: `width` child slots for each node.
    std::vector<Index> slot_of_node_;  // of the shape; `no_index` for the root and collapsed nodes
    std::vector<Index> slot_of_part_;  // `no_index` for the root
    // Padded by repetition: branch prediction is better if nearly all rows have the same length.
    CompressedRows<Index> vertices_of_;       // of a leaf
    CompressedRows<Index> leaves_of_;         // around a vertex
    IndexSet stale_leaves_;                   // to be refitted, by the next refit at the latest
    std::vector<std::uint64_t> stale_nodes_;  // 64 nodes a word
    TreeStatistics statistics_;
    bool has_reserve_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

namespace detail {

/// The query's key of the triangles if it has one, else the key of their boxes.
template <class Key, Number N>
[[nodiscard]] N key_of(const Key& key, const Triangle<N>& triangles) noexcept {
    if constexpr (requires { key(triangles); })
        return key(triangles);
    else
        return key(bounds(triangles));
}

}  // namespace detail

template <Real Scalar>
AabbTree<Scalar>::AabbTree(const TriangleMesh<Scalar>& mesh, const TreeOptions& options)
    : shape_(tree_shape(mesh, options.balance_threshold)),
      statistics_(membrane::statistics(shape_)),
      has_reserve_(reserve_of(mesh) > 0) {
    detail::define_made<AabbTree>();
    items_.reserve(shape_.triangles.size());
    for (const Index f : shape_.triangles) {
        const auto corners = mesh.triangles().col(f);
        items_.push_back({{corners[0], corners[1], corners[2]}, f});
    }
    items_.insert(items_.end(), width - 1, items_.back());  // several are read at once, from any item on
    fold();
    collect_vertices_and_leaves(mesh.vertex_count());
    if (has_reserve_) reserve_vertices();
    stale_leaves_ = IndexSet(statistics_.leaves);
    stale_nodes_.assign(nodes_.size() / bits_in_word + 1, 0);
    refit(mesh.positions());
}

template <Real Scalar>
void AabbTree<Scalar>::fold() {
    const auto wide = folded<width>(shape_);
    nodes_.resize(wide.nodes.size());
    slot_of_node_.assign(shape_.nodes.size(), no_index);
    slot_of_part_.assign(nodes_.size() + static_cast<std::size_t>(statistics_.leaves), no_index);
    std::vector<Index> part_of(shape_.nodes.size(), no_index);  // of the nodes of the shape
    for (std::size_t n = 0; n < nodes_.size(); ++n)
        part_of[static_cast<std::size_t>(wide.nodes[n])] = static_cast<Index>(n);
    for (std::size_t i = 0; i < shape_.nodes.size(); ++i) {
        if (!shape_.nodes[i].is_leaf()) continue;
        part_of[i] = node_count() + static_cast<Index>(leaves_.size());
        leaves_.push_back({shape_.nodes[i].first, shape_.nodes[i].count});
    }
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        Node& node = nodes_[n];
        node.child.fill(0);
        for (node.children = 0; node.children < width && wide.children[n][node.children] != no_index; ++node.children) {
            const auto i = static_cast<std::size_t>(wide.children[n][node.children]);
            const auto slot = static_cast<Index>(n * width + node.children);
            slot_of_node_[i] = slot;
            slot_of_part_[static_cast<std::size_t>(part_of[i])] = slot;
            node.child[node.children] = part_of[i];
        }
    }
}

template <Real Scalar>
void AabbTree<Scalar>::collect_vertices_and_leaves(Index vertex_count) {
    vertices_of_ = CompressedRows<Index>(statistics_.leaves, [&](auto put) {
        std::vector<Index> latest(static_cast<std::size_t>(vertex_count), no_index);
        for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) {
            Index count = 0;
            for (const Item& item : items_of(leaf)) {
                for (const Index v : item.corners) {
                    if (std::exchange(latest[static_cast<std::size_t>(v)], leaf) == leaf) continue;
                    put(leaf, v);
                    ++count;
                }
            }
            for (; count % filled != 0; ++count) put(leaf, items_of(leaf)[0].corners[0]);
        }
    });
    leaves_of_ = CompressedRows<Index>(vertex_count, [&](auto put) {
        std::vector<Index> latest(static_cast<std::size_t>(vertex_count), no_index), count(latest.size(), 0);
        for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) {
            for (const Index v : vertices_of_[leaf]) {
                if (std::exchange(latest[static_cast<std::size_t>(v)], leaf) == leaf) continue;
                put(v, leaf);
                ++count[static_cast<std::size_t>(v)];
            }
        }
        for (Index v = 0; v < vertex_count; ++v) {
            const auto some = static_cast<std::size_t>(v);
            for (; count[some] != 0 && count[some] < filled; ++count[some]) put(v, latest[some]);
        }
    });
}

// Gives each leaf the capacity for the vertices of its triangles if all were apart.
template <Real Scalar>
void AabbTree<Scalar>::reserve_vertices() {
    const auto padded = [](std::size_t count) { return (count + filled - 1) / filled * filled; };
    const CompressedRows<Index> present = std::move(vertices_of_);
    vertices_of_ = CompressedRows<Index>(statistics_.leaves, [&](auto put) {
        for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) {
            const auto vertices = present[leaf];
            for (const Index v : vertices) put(leaf, v);
            for (std::size_t n = vertices.size(); n < padded(3 * items_of(leaf).size()); ++n) put(leaf, vertices[0]);
        }
    });
    for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) vertices_of_.truncate(leaf, present[leaf].size());
}

// The leaves of the vertex stay those of both.
template <Real Scalar>
void AabbTree<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits_;
    for (const Index leaf : std::as_const(leaves_of_)[split.vertex]) {
        bool goes = false, stays = false;
        for (Item& item : items_of(leaf)) {
            const auto& corners = item.corners;
            if (split.takes(item.triangle)) {
                split.replace_in(item.corners);
                goes = true;
            } else if (std::find(corners.begin(), corners.end(), split.vertex) != corners.end()) {
                stays = true;
            }
        }
        if (goes && stays) {
            add_vertex(leaf, split.copy);
        } else if (goes) {
            split.replace_in(vertices_of_[leaf]);
        }
    }
    leaves_of_.share(split.vertex, split.copy);
}

// Adds `v` to the vertices of a leaf, in the place of one that is repeated, if any is.
template <Real Scalar>
void AabbTree<Scalar>::add_vertex(Index leaf, Index v) noexcept {
    const auto vertices = vertices_of_[leaf];
    if (std::find(vertices.begin(), vertices.end(), v) != vertices.end()) return;
    const auto spare = std::find_if(vertices.end() - (filled - 1), vertices.end(), [&](const Index& w) {
        return &*std::find(vertices.begin(), vertices.end(), w) != &w;
    });
    if (spare != vertices.end()) {
        *spare = v;
        return;
    }
    for (Index n = 0; n < filled; ++n) vertices_of_.append(leaf, v);
}

template <Real Scalar>
Aabb<Scalar> AabbTree<Scalar>::box_in(Index slot) const noexcept {
    const auto& boxes = nodes_[static_cast<std::size_t>(slot) / width].boxes;
    const std::size_t i = static_cast<std::size_t>(slot) % width;
    return {{boxes.low[0][i], boxes.low[1][i], boxes.low[2][i]},
            {boxes.high[0][i], boxes.high[1][i], boxes.high[2][i]}};
}

template <Real Scalar>
MEMBRANE_INLINE void AabbTree<Scalar>::fit_leaf(const ConstPointsRef<Scalar>& x, Index leaf) noexcept {
    using Limits = std::numeric_limits<Scalar>;
    const Scalar* const first = x.data();
    const std::ptrdiff_t stride = x.outerStride();
    const auto vertices = vertices_of_[leaf];
    PaddedVector<Scalar> low((Limits::max)()), high(Limits::lowest());
    for (std::size_t i = 0; i < vertices.size(); i += static_cast<std::size_t>(filled)) {
        for (std::size_t k = i; k < i + static_cast<std::size_t>(filled); ++k) {
            const auto p = PaddedVector<Scalar>::load_point(first + vertices[k] * stride);
            low = smaller(low, p);
            high = larger(high, p);
        }
    }
    put({low.point(), high.point()}, slot_of_part_[static_cast<std::size_t>(node_count() + leaf)]);
}

template <Real Scalar>
void AabbTree<Scalar>::fit_node(Index n) noexcept {
    const std::size_t children = nodes_[static_cast<std::size_t>(n)].children;
    const Index first = n * static_cast<Index>(width);
    const Aabb<Scalar> box_of_first = box_in(first);
    for (std::size_t i = children; i < width; ++i) put(box_of_first, first + static_cast<Index>(i));
    Aabb<Scalar> box;
    for (Index i = 0; i < static_cast<Index>(width); ++i) box.include(box_in(first + i));
    const Index slot = slot_of_part_[static_cast<std::size_t>(n)];
    if (slot == no_index) {
        surface_ = box;
    } else {
        put(box, slot);
    }
}

template <Real Scalar>
MEMBRANE_INLINE void AabbTree<Scalar>::put(const Aabb<Scalar>& box, Index slot) noexcept {
    auto& boxes = nodes_[static_cast<std::size_t>(slot) / width].boxes;
    const std::size_t i = static_cast<std::size_t>(slot) % width;
    for (int k = 0; k < 3; ++k) {
        boxes.low[k].set(i, box.low[k]);
        boxes.high[k].set(i, box.high[k]);
    }
}

template <Real Scalar>
void AabbTree<Scalar>::mark_parent(Index part) noexcept {
    const std::size_t parent = static_cast<std::size_t>(slot_of_part_[static_cast<std::size_t>(part)]) / width;
    stale_nodes_[parent / bits_in_word] |= std::uint64_t{1} << parent % bits_in_word;
}

template <Real Scalar>
Triangle<Lanes<Scalar>> AabbTree<Scalar>::triangles_at(const ConstPointsRef<Scalar>& x, const Item* some) noexcept {
    std::array<std::array<std::array<Scalar, width>, 3>, 3> number;
    for (std::size_t i = 0; i < width; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Vector3<Scalar> p = point(x, some[i].corners[k]);
            for (std::size_t axis = 0; axis < 3; ++axis) number[k][axis][i] = p.data()[axis];
        }
    }
    const auto corner = [&](std::size_t k) {
        return Vector3<Lanes<Scalar>>(Lanes<Scalar>::load(number[k][0].data()),
                                      Lanes<Scalar>::load(number[k][1].data()),
                                      Lanes<Scalar>::load(number[k][2].data()));
    };
    return {corner(0), corner(1), corner(2)};
}

template <Real Scalar>
bool AabbTree<Scalar>::refit(const ConstPointsRef<Scalar>& x) noexcept {
    if (x.cols() != leaves_of_.row_count()) return false;
    for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) fit_leaf(x, leaf);
    for (Index n = node_count(); n-- > 0;) fit_node(n);  // children come after their parent
    stale_leaves_.clear();
    return true;
}

template <Real Scalar>
bool AabbTree<Scalar>::refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
    if (x.cols() != leaves_of_.row_count()) return false;
    if (moved.size() >= static_cast<std::size_t>(x.cols()) / 2) return refit(x);  // cheaper from here on
    for (const Index v : moved) {
        if (v < 0 || v >= x.cols()) continue;
        for (const Index leaf : leaves_of_[v]) stale_leaves_.insert(leaf);
    }
    for (const Index leaf : stale_leaves_.items()) {
        fit_leaf(x, leaf);
        mark_parent(node_count() + leaf);
    }
    // Parents come before their children: marked nodes are refitted in descending order, each once.
    for (std::size_t word = stale_nodes_.size(); word-- > 0;) {
        while (const std::uint64_t left = stale_nodes_[word]) {
            const auto last = bits_in_word - 1 - static_cast<std::size_t>(std::countl_zero(left));
            stale_nodes_[word] = left ^ (std::uint64_t{1} << last);
            const auto n = static_cast<Index>(word * bits_in_word + last);
            fit_node(n);
            if (n != 0) mark_parent(n);
        }
    }
    stale_leaves_.clear();
    return true;
}

template <Real Scalar>
template <class Key, class Examine>
Index AabbTree<Scalar>::search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                               Examine examine) const noexcept {
    detail::require_made<AabbTree>();
    constexpr std::size_t max_waiting = (width - 1) * TreeTopology::max_depth + 1;
    std::array<Scalar, max_waiting> keys;
    std::array<Index, max_waiting> parts;
    std::size_t waiting = 0;
    Index visited = 1, part = 0;
    if (!(key(surface_) < limit) || x.cols() != leaves_of_.row_count()) return visited;
    while (true) {
        if (part >= node_count()) {
            examine_leaf(x, items_of(part - node_count()), key, limit, examine);
        } else {
            const Node& node = nodes_[static_cast<std::size_t>(part)];
            const Lanes<Scalar> key_of = key(node.boxes);
            const std::size_t before = waiting;
            for (auto below = bits(key_of < Lanes<Scalar>(limit)) & ((1U << node.children) - 1); below != 0;
                 below &= below - 1) {
                const auto i = static_cast<std::size_t>(std::countr_zero(below));
                std::size_t at = waiting++;
                for (; at > before && keys[at - 1] < key_of[i]; --at) {
                    keys[at] = keys[at - 1];
                    parts[at] = parts[at - 1];
                }
                keys[at] = key_of[i];
                parts[at] = node.child[i];
            }
            visited += static_cast<Index>(node.children);
        }
        do {
            if (waiting == 0) return visited;
        } while (!(keys[--waiting] < limit));
        part = parts[waiting];
    }
}

template <Real Scalar>
template <class Key, class Examine>
void AabbTree<Scalar>::examine_leaf(const ConstPointsRef<Scalar>& x, std::span<const Item> leaf, Key key,
                                    const Scalar& limit, Examine examine) noexcept {
    for (std::size_t i = 0; i < leaf.size(); i += width) {
        const Item* some = leaf.data() + i;
        const Lanes<Scalar> keys = detail::key_of(key, triangles_at(x, some));
        auto below = bits(keys < Lanes<Scalar>(limit));
        if (leaf.size() - i < width) below &= (1U << (leaf.size() - i)) - 1;
        for (; below != 0; below &= below - 1) {
            const auto k = static_cast<std::size_t>(std::countr_zero(below));
            if (keys[k] < limit) examine(some[k].triangle, triangle_at(x, some[k].corners));
        }
    }
}

template <Real Scalar>
Aabb<Scalar> AabbTree<Scalar>::box(Index node) const noexcept {
    if (node < 0 || node >= statistics_.nodes) return {};
    if (node == 0) return surface_;
    const Index slot = slot_of_node_[static_cast<std::size_t>(node)];
    if (slot != no_index) return box_in(slot);
    const Index first = shape_.nodes[static_cast<std::size_t>(node)].first;
    Aabb<Scalar> both = box(first);
    both.include(box(first + 1));
    return both;
}

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
    best.nodes_visited = search(x, distance_to, best.squared_distance, [&](Index f, const Triangle<Scalar>& triangle) {
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
    const CapsuleQuery<Scalar> probe(from, to, 0, surface_);
    Scalar limit = 1 + epsilon;
    const auto examine = [&](Index f, const Triangle<Scalar>& triangle) {
        const auto hit = membrane::first_hit(triangle, from, to);
        if (!hit) return;
        const bool tie = hit->fraction == best.fraction && (best.triangle == no_index || f < best.triangle);
        if (!(hit->fraction < best.fraction || tie)) return;
        best = {f, hit->fraction, hit->barycentric, 0};
        limit = best.fraction + epsilon;
    };
    best.nodes_visited = search(x, detail::SegmentKey<Scalar>{probe, from, to}, limit, examine);
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
    return search(
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
    return search(
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
    const CapsuleQuery<Scalar> probe(p, q, radius, surface_);
    return search(
        x, [&]<Number N>(const Aabb<N>& box) { return probe.entry(box); }, probe.never,
        [&](Index f, const Triangle<Scalar>& triangle) {
            const auto nearest = closest_to_segment(triangle, p, q);
            if (nearest.on_triangle.squared_distance <= radius * radius) visit(f);
        });
}

}  // namespace membrane
