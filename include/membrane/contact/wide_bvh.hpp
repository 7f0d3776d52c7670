// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <membrane/contact/tree_topology.hpp>
#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/surface/box.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Boxes around the triangles of a surface that deforms, and the way through them to those that matter.
///
///     auto boxes = membrane::WideBvh(mesh, {.balance_threshold = 16});
///     boxes.refit(x, report.moved);
///     const auto visited = boxes.search(x, key, limit, [&](membrane::Index f, const auto& triangle) { ... });
namespace membrane {

struct TreeOptions {
    /// A set of fewer triangles is shared out evenly into two leaves whatever their positions [Liu07] 2.3. Low: fewer
    /// triangles are tested; high: fewer boxes, and a refit costs less. At least 1.
    Index balance_threshold = 16;
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The splits are those of `tree_shape`; folded, so that a node has as many children as the processor reckons with side
/// by side.
template <Real Scalar>
class WideBvh {
  public:
    /// O(F log F) for usual shapes. @throws InvalidInput if `balance_threshold` is below 1
    explicit WideBvh(const TriangleMesh<Scalar>& mesh, const TreeOptions& options = {});

    /// Fits all boxes, or those around the vertices `moved`: see `AabbTree`.
    void refit(const ConstPointsRef<Scalar>& x) noexcept;
    void refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;

    /// Calls `examine(Index f, triangle)` for the triangles with a key below `limit` in boxes with such a key, the lowest
    /// of several boxes first; `examine` may lower the limit. `key(box)` is a number, of several boxes as many; so is
    /// `key(triangle)`, if there is one: else the key of a triangle is that of its box. Returns the boxes visited.
    template <class Key, class Examine>
    [[nodiscard]] Index search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                               Examine examine) const noexcept;

    [[nodiscard]] const TreeStatistics& statistics() const noexcept { return statistics_; }

    /// Around all triangles.
    [[nodiscard]] const Box<Scalar>& surface() const noexcept { return surface_; }

    /// Around those below a node of `tree_shape`. @pre 0 <= `node` < `statistics().nodes` (asserted)
    [[nodiscard]] Box<Scalar> box(Index node) const noexcept;

  private:
    static constexpr std::size_t width = Lanes<Scalar>::count;
    static constexpr std::size_t bits_in_word = 64;
    static constexpr Index filled = 4;  // what the length of most rows of vertices and leaves is a multiple of

    /// Of each child the box, and which part it is. In place of those that are missing the first one's box: a key is
    /// to be reckoned with valid numbers only.
    struct alignas(64) Node {
        Box<Lanes<Scalar>> boxes;
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
    void share_out_vertices(Index vertex_count);
    [[nodiscard]] Index node_count() const noexcept { return static_cast<Index>(nodes_.size()); }
    [[nodiscard]] std::span<const Item> items_of(Index leaf) const noexcept {
        const auto [first, count] = leaves_[static_cast<std::size_t>(leaf)];
        return std::span(items_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
    }
    [[nodiscard]] Box<Scalar> box_in(Index place) const noexcept;
    void fit_leaf(const ConstPointsRef<Scalar>& x, Index leaf) noexcept;
    void fit_node(Index n) noexcept;
    void put(const Box<Scalar>& box, Index place) noexcept;
    void mark_parent(Index part) noexcept;
    [[nodiscard]] static Triangle<Lanes<Scalar>> triangles_at(const ConstPointsRef<Scalar>& x,
                                                              const Item* some) noexcept;

    template <class Key, class Examine>
    static void examine_leaf(const ConstPointsRef<Scalar>& x, std::span<const Item> leaf, Key key, const Scalar& limit,
                             Examine examine) noexcept;

    TreeTopology shape_;
    std::vector<Node> nodes_;
    Box<Scalar> surface_;      // around everything
    std::vector<Item> items_;  // leaf by leaf
    std::vector<Leaf> leaves_;

    // Parts are the nodes, and after them the leaves; places number node for node what may be a child.
    std::vector<Index> place_of_node_;  // of the shape; `no_index` for the root and what is folded in
    std::vector<Index> place_of_part_;  // `no_index` for the root
    // Filled up by repetition: a processor predicts rows that are nearly all equally long.
    CompressedRows<Index> vertices_of_;       // of a leaf
    CompressedRows<Index> leaves_of_;         // around a vertex
    IndexSet stale_leaves_;                   // to be fitted
    std::vector<std::uint64_t> stale_nodes_;  // 64 in a word
    TreeStatistics statistics_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

namespace detail {

/// Of triangles, the key of their boxes; or the query's own.
template <class Key, Number N>
[[nodiscard]] N key_of(const Key& key, const Triangle<N>& triangles) noexcept {
    if constexpr (requires { key(triangles); })
        return key(triangles);
    else
        return key(bounds(triangles));
}

}  // namespace detail

template <Real Scalar>
WideBvh<Scalar>::WideBvh(const TriangleMesh<Scalar>& mesh, const TreeOptions& options)
    : shape_(tree_shape(mesh, options.balance_threshold)), statistics_(membrane::statistics(shape_)) {
    detail::define_made<WideBvh>();
    items_.reserve(shape_.triangles.size());
    for (const Index f : shape_.triangles) {
        const auto corners = mesh.triangles().col(f);
        items_.push_back({{corners[0], corners[1], corners[2]}, f});
    }
    items_.insert(items_.end(), width - 1, items_.back());  // several are read at once, from any on
    fold();
    share_out_vertices(mesh.vertex_count());
    stale_leaves_ = IndexSet(statistics_.leaves);
    stale_nodes_.assign(nodes_.size() / bits_in_word + 1, 0);
    refit(mesh.positions());
}

template <Real Scalar>
void WideBvh<Scalar>::fold() {
    const auto wide = folded<width>(shape_);
    nodes_.resize(wide.nodes.size());
    place_of_node_.assign(shape_.nodes.size(), no_index);
    place_of_part_.assign(nodes_.size() + static_cast<std::size_t>(statistics_.leaves), no_index);
    std::vector<Index> part_of(shape_.nodes.size(), no_index);  // for the nodes of the shape
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
            const auto place = static_cast<Index>(n * width + node.children);
            place_of_node_[i] = place;
            place_of_part_[static_cast<std::size_t>(part_of[i])] = place;
            node.child[node.children] = part_of[i];
        }
    }
}

template <Real Scalar>
void WideBvh<Scalar>::share_out_vertices(Index vertex_count) {
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

template <Real Scalar>
Box<Scalar> WideBvh<Scalar>::box_in(Index place) const noexcept {
    const auto& boxes = nodes_[static_cast<std::size_t>(place) / width].boxes;
    const std::size_t i = static_cast<std::size_t>(place) % width;
    return {{boxes.low[0][i], boxes.low[1][i], boxes.low[2][i]},
            {boxes.high[0][i], boxes.high[1][i], boxes.high[2][i]}};
}

template <Real Scalar>
[[gnu::always_inline]] inline void WideBvh<Scalar>::fit_leaf(const ConstPointsRef<Scalar>& x, Index leaf) noexcept {
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
    put({low.point(), high.point()}, place_of_part_[static_cast<std::size_t>(node_count() + leaf)]);
}

template <Real Scalar>
void WideBvh<Scalar>::fit_node(Index n) noexcept {
    const std::size_t children = nodes_[static_cast<std::size_t>(n)].children;
    const Index first = n * static_cast<Index>(width);
    const Box<Scalar> in_place_of_missing = box_in(first);
    for (std::size_t i = children; i < width; ++i) put(in_place_of_missing, first + static_cast<Index>(i));
    Box<Scalar> box;
    for (Index i = 0; i < static_cast<Index>(width); ++i) box.include(box_in(first + i));
    const Index place = place_of_part_[static_cast<std::size_t>(n)];
    if (place == no_index) {
        surface_ = box;
    } else {
        put(box, place);
    }
}

template <Real Scalar>
[[gnu::always_inline]] inline void WideBvh<Scalar>::put(const Box<Scalar>& box, Index place) noexcept {
    auto& boxes = nodes_[static_cast<std::size_t>(place) / width].boxes;
    const std::size_t i = static_cast<std::size_t>(place) % width;
    for (int k = 0; k < 3; ++k) {
        boxes.low[k].set(i, box.low[k]);
        boxes.high[k].set(i, box.high[k]);
    }
}

template <Real Scalar>
void WideBvh<Scalar>::mark_parent(Index part) noexcept {
    const std::size_t parent = static_cast<std::size_t>(place_of_part_[static_cast<std::size_t>(part)]) / width;
    stale_nodes_[parent / bits_in_word] |= std::uint64_t{1} << parent % bits_in_word;
}

template <Real Scalar>
Triangle<Lanes<Scalar>> WideBvh<Scalar>::triangles_at(const ConstPointsRef<Scalar>& x, const Item* some) noexcept {
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
void WideBvh<Scalar>::refit(const ConstPointsRef<Scalar>& x) noexcept {
    MEMBRANE_ASSERT(x.cols() == leaves_of_.row_count());
    for (Index leaf = 0; leaf < statistics_.leaves; ++leaf) fit_leaf(x, leaf);
    for (Index n = node_count(); n-- > 0;) fit_node(n);  // children come after their parent
}

template <Real Scalar>
void WideBvh<Scalar>::refit(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
    MEMBRANE_ASSERT(x.cols() == leaves_of_.row_count());
    if (moved.size() >= static_cast<std::size_t>(x.cols()) / 2) return refit(x);  // costs less from there on
    stale_leaves_.clear();
    for (const Index v : moved) {
        for (const Index leaf : leaves_of_[v]) stale_leaves_.insert(leaf);
    }
    for (const Index leaf : stale_leaves_.items()) {
        fit_leaf(x, leaf);
        mark_parent(node_count() + leaf);
    }
    // Parents come before their children: of what is marked the last is fitted first, and all of it once.
    for (std::size_t word = stale_nodes_.size(); word-- > 0;) {
        while (const std::uint64_t left = stale_nodes_[word]) {
            const auto last = bits_in_word - 1 - static_cast<std::size_t>(std::countl_zero(left));
            stale_nodes_[word] = left ^ (std::uint64_t{1} << last);
            const auto n = static_cast<Index>(word * bits_in_word + last);
            fit_node(n);
            if (n != 0) mark_parent(n);
        }
    }
}

template <Real Scalar>
template <class Key, class Examine>
Index WideBvh<Scalar>::search(const ConstPointsRef<Scalar>& x, Key key, const Scalar& limit,
                              Examine examine) const noexcept {
    detail::require_made<WideBvh>();
    constexpr std::size_t max_waiting = (width - 1) * TreeTopology::max_depth + 1;
    std::array<Scalar, max_waiting> keys;
    std::array<Index, max_waiting> parts;
    std::size_t waiting = 0;
    Index visited = 1, part = 0;
    if (!(key(surface_) < limit)) return visited;
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
void WideBvh<Scalar>::examine_leaf(const ConstPointsRef<Scalar>& x, std::span<const Item> leaf, Key key,
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
Box<Scalar> WideBvh<Scalar>::box(Index node) const noexcept {
    MEMBRANE_ASSERT(node >= 0 && node < statistics_.nodes);
    if (node == 0) return surface_;
    const Index place = place_of_node_[static_cast<std::size_t>(node)];
    if (place != no_index) return box_in(place);
    const Index first = shape_.nodes[static_cast<std::size_t>(node)].first;
    Box<Scalar> both = box(first);
    both.include(box(first + 1));
    return both;
}

}  // namespace membrane
