// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include <membrane/surface/aabb.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// The topology of a binary tree over the triangles of a mesh.
///
///     const auto shape = membrane::tree_shape(mesh, 16);
///     std::printf("%d leaves, %d levels\n", statistics(shape).leaves, statistics(shape).depth);
namespace membrane {

/// A binary tree over triangles, without geometry. Node 0 is the root.
struct TreeTopology {
    /// Upper bound of the steps from the root to a node, for any mesh: see `tree_shape`.
    static constexpr Index max_depth = 63;

    /// A set of triangles: a leaf, or the union of two children.
    struct Node {
        Index parent;  ///< `no_index` for the root.
        Index first;   ///< Of the two children, `first` and `first + 1`; for a leaf, its start in `triangles`.
        Index count;   ///< Number of a leaf's triangles; 0 for a node with children.

        /// Whether the node has triangles of its own, and no children.
        [[nodiscard]] bool is_leaf() const noexcept { return count > 0; }
    };
    std::vector<Node> nodes;       ///< Depth first: children after their parent.
    std::vector<Index> triangles;  ///< Leaf by leaf, in ascending order within each.
};

/// Size and shape of a tree.
struct TreeStatistics {
    ///@{
    /// Number of all nodes, and of those that are leaves.
    Index nodes, leaves;
    ///@}

    Index depth;  ///< Steps from the root to the deepest leaf.

    ///@{
    /// [triangles]
    Index smallest_leaf, largest_leaf;
    ///@}

    double mean_leaf;  ///< [triangles]
};

/// A set of triangles is split by centroid at the middle of the longest side of its box. If one part is empty, the set
/// is halved at the median of the centroids instead. A set of fewer than `balance_threshold` triangles is halved into
/// two leaves, independently of the middle [Liu07] 2.3.
///
/// From 32 steps below the root on, every set is halved: a set of fewer than 2^31 triangles is split into single ones
/// within 31 more steps. So `max_depth` bounds the depth, and with it the capacity of the stack of a search.
///
/// The tree is the same on all platforms. O(F log F) for usual shapes, at most O(F max_depth).
/// @throws InvalidInput if `balance_threshold` is below 1
template <Real Scalar>
[[nodiscard]] TreeTopology tree_shape(const TriangleMesh<Scalar>& mesh, Index balance_threshold);

/// O(F).
[[nodiscard]] inline TreeStatistics statistics(const TreeTopology& shape);

/// A binary tree with most nodes collapsed into their ancestors: each inner node left has up to `width` children.
template <std::size_t width>
struct CollapsedTree {
    using Children = std::array<Index, width>;  ///< Nodes of the binary tree, then `no_index`.

    std::vector<Index> nodes;        ///< Indices in the binary tree; the root first, children after their parent.
    std::vector<Children> children;  ///< Of each node.
};

/// Collapses the nodes with most triangles first. A root that is a leaf becomes its own only child. O(nodes).
template <std::size_t width>
[[nodiscard]] CollapsedTree<width> folded(const TreeTopology& shape);

namespace detail {

/// Splits sets of triangles along the longest side of their box.
template <Real Scalar>
class TriangleSplit {
  public:
    explicit TriangleSplit(const TriangleMesh<Scalar>& mesh);

    /// Partitions the set into two parts, neither of them empty, and returns the size of the first.
    /// @pre at least two triangles
    [[nodiscard]] Index operator()(std::span<Index> set, bool evenly) const;

  private:
    std::vector<Aabb<Scalar>> boxes_;
    std::vector<Vector3<Scalar>> centroids_;
};

template <Real Scalar>
TriangleSplit<Scalar>::TriangleSplit(const TriangleMesh<Scalar>& mesh) {
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(f));
        boxes_.push_back(bounds(triangle));
        centroids_.push_back((triangle.a + triangle.b + triangle.c) / 3);
    }
}

template <Real Scalar>
Index TriangleSplit<Scalar>::operator()(std::span<Index> set, bool evenly) const {
    Aabb<Scalar> box;
    for (const Index f : set) box.include(boxes_[static_cast<std::size_t>(f)]);
    const int axis = major_axis(box);
    const auto coordinate = [&](Index f) { return centroids_[static_cast<std::size_t>(f)][axis]; };
    if (!evenly) {
        const Scalar middle = (box.low[axis] + box.high[axis]) / 2;
        const auto right = std::partition(set.begin(), set.end(), [&](Index f) { return coordinate(f) < middle; });
        if (right != set.begin() && right != set.end()) return static_cast<Index>(right - set.begin());
    }
    const auto median = set.begin() + static_cast<std::ptrdiff_t>(set.size() / 2);
    std::nth_element(set.begin(), median, set.end(), [&](Index f, Index g) {
        // A strict order: the result does not depend on the library.
        return coordinate(f) != coordinate(g) ? coordinate(f) < coordinate(g) : f < g;
    });
    return static_cast<Index>(median - set.begin());
}

/// Builds the tree below node `i`, which is still a leaf.
template <Real Scalar>
void grow(TreeTopology& shape, const TriangleSplit<Scalar>& split, Index balance_threshold, Index i, Index depth) {
    constexpr Index halving_depth = TreeTopology::max_depth - 31;
    const auto [parent, first, count] = shape.nodes[static_cast<std::size_t>(i)];
    if (count == 1) return;
    const bool into_leaves = count < balance_threshold;
    const auto set =
        std::span(shape.triangles).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
    const Index half = split(set, into_leaves || depth >= halving_depth);
    const auto child = static_cast<Index>(shape.nodes.size());
    shape.nodes[static_cast<std::size_t>(i)] = {parent, child, 0};
    shape.nodes.push_back({i, first, half});
    shape.nodes.push_back({i, first + half, count - half});
    if (into_leaves) return;
    grow(shape, split, balance_threshold, child, depth + 1);
    grow(shape, split, balance_threshold, child + 1, depth + 1);
}

}  // namespace detail

template <Real Scalar>
TreeTopology tree_shape(const TriangleMesh<Scalar>& mesh, Index balance_threshold) {
    if (balance_threshold < 1) refuse("AabbTree", "balance_threshold must be at least 1, got ", balance_threshold);
    TreeTopology shape{{{no_index, 0, mesh.triangle_count()}},
                       std::vector<Index>(static_cast<std::size_t>(mesh.triangle_count()))};
    std::iota(shape.triangles.begin(), shape.triangles.end(), 0);
    detail::grow(shape, detail::TriangleSplit<Scalar>(mesh), balance_threshold, 0, 0);
    for (const TreeTopology::Node& node : shape.nodes) {
        const auto begin = shape.triangles.begin() + node.first;
        if (node.is_leaf()) std::sort(begin, begin + node.count);
    }
    return shape;
}

inline TreeStatistics statistics(const TreeTopology& shape) {
    TreeStatistics tree{static_cast<Index>(shape.nodes.size()), 0, 0, unlimited, 0, 0};
    std::vector<Index> depth;
    for (const TreeTopology::Node& node : shape.nodes) {
        depth.push_back(node.parent == no_index ? 0 : depth[static_cast<std::size_t>(node.parent)] + 1);
        tree.depth = (std::max)(tree.depth, depth.back());
        if (!node.is_leaf()) continue;
        ++tree.leaves;
        tree.smallest_leaf = (std::min)(tree.smallest_leaf, node.count);
        tree.largest_leaf = (std::max)(tree.largest_leaf, node.count);
    }
    tree.mean_leaf = static_cast<double>(shape.triangles.size()) / tree.leaves;
    return tree;
}

template <std::size_t width>
CollapsedTree<width> folded(const TreeTopology& shape) {
    const auto node = [&](Index i) -> const TreeTopology::Node& { return shape.nodes[static_cast<std::size_t>(i)]; };
    std::vector<Index> sizes(shape.nodes.size());  // [triangles]
    const auto size = [&](Index i) -> Index& { return sizes[static_cast<std::size_t>(i)]; };
    for (auto i = static_cast<Index>(sizes.size()); i-- > 0;) {
        size(i) = node(i).is_leaf() ? node(i).count : size(node(i).first) + size(node(i).first + 1);
    }
    CollapsedTree<width> wide{{0}, {}};
    for (std::size_t n = 0; n < wide.nodes.size(); ++n) {
        typename CollapsedTree<width>::Children children;
        children.fill(no_index);
        children[0] = wide.nodes[n];
        for (std::size_t count = 1; count < width; ++count) {
            const auto weight = [&](Index i) { return i == no_index || node(i).is_leaf() ? 0 : size(i); };
            const auto largest = std::max_element(children.begin(), children.end(),
                                                  [&](Index a, Index b) { return weight(a) < weight(b); });
            if (weight(*largest) == 0) break;
            children[count] = node(*largest).first + 1;
            *largest = node(*largest).first;
        }
        for (const Index i : children) {
            if (i != no_index && !node(i).is_leaf()) wide.nodes.push_back(i);
        }
        wide.children.push_back(children);
    }
    return wide;
}

}  // namespace membrane
