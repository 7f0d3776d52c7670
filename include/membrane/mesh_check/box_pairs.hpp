// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <membrane/surface/aabb.hpp>

/// Pairs of overlapping boxes.
///
///     std::int64_t effort = 1000000;
///     const bool all = for_each_overlap(boxes, effort, [&](membrane::Index i, membrane::Index j) { ... });
namespace membrane {

/// Calls `visit(i, j)`, i < j, once for each pair of overlapping boxes. Each pair of tree nodes tested and each pair of
/// boxes found subtracts 1 from `effort`; `visit` may subtract more. If `effort` falls below 0, the search stops and
/// returns false; if it completes, returns true. O(n log n) if boxes overlap few others.
template <class Visit>
[[nodiscard]] bool for_each_overlap(std::span<const Aabb<double>> boxes, std::int64_t& effort, Visit visit);

namespace detail {

/// A tree of boxes, split into halves of equal count along the longest axis.
class HalvedBoxes {
  public:
    struct Node {
        Aabb<double> box;
        std::size_t first, count;  // range in the order
        std::size_t right;         // child, 0 for a leaf; the left child is the next node
        [[nodiscard]] bool is_leaf() const noexcept { return right == 0; }
    };

    explicit HalvedBoxes(std::span<const Aabb<double>> boxes) : boxes_(boxes), order_(boxes.size()) {
        std::iota(order_.begin(), order_.end(), Index{0});
        if (!boxes.empty()) split(0, boxes.size());
    }
    [[nodiscard]] const std::vector<Node>& nodes() const noexcept { return nodes_; }
    [[nodiscard]] std::span<const Index> items(const Node& node) const noexcept {
        return std::span(order_).subspan(node.first, node.count);
    }

  private:
    void split(std::size_t first, std::size_t count) {  // recursion depth: log2 of the count
        const std::size_t n = nodes_.size();
        nodes_.push_back({{}, first, count, 0});
        Aabb<double> middles;
        for (const Index i : std::span(order_).subspan(first, count)) {
            nodes_[n].box.include(boxes_[static_cast<std::size_t>(i)]);
            middles.include(middle(i));
        }
        if (count <= 4) return;
        const int axis = major_axis(middles);
        const auto begin = order_.begin() + static_cast<std::ptrdiff_t>(first);
        const std::size_t half = count / 2;
        std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half), begin + static_cast<std::ptrdiff_t>(count),
                         [&](Index i, Index j) { return middle(i)[axis] < middle(j)[axis]; });
        split(first, half);
        nodes_[n].right = nodes_.size();
        split(first + half, count - half);
    }
    [[nodiscard]] Vector3<double> middle(Index i) const noexcept {
        const Aabb<double>& box = boxes_[static_cast<std::size_t>(i)];
        return box.low + box.high;
    }

    std::span<const Aabb<double>> boxes_;
    std::vector<Index> order_;
    std::vector<Node> nodes_;
};

}  // namespace detail

template <class Visit>
bool for_each_overlap(std::span<const Aabb<double>> boxes, std::int64_t& effort, Visit visit) {
    if (boxes.empty()) return true;
    const detail::HalvedBoxes tree(boxes);
    const auto& nodes = tree.nodes();
    const auto box = [&](Index i) -> const Aabb<double>& { return boxes[static_cast<std::size_t>(i)]; };
    std::vector<std::pair<std::size_t, std::size_t>> waiting{{0, 0}};
    while (!waiting.empty()) {
        const auto [m, n] = waiting.back();
        waiting.pop_back();
        if (--effort < 0) return false;
        const auto &a = nodes[m], &b = nodes[n];
        if (m == n && !a.is_leaf()) {
            waiting.insert(waiting.end(), {{m + 1, m + 1}, {m + 1, a.right}, {a.right, a.right}});
        } else if (m == n || (a.is_leaf() && b.is_leaf() && overlap(a.box, b.box))) {
            for (const Index i : tree.items(a)) {
                for (const Index j : tree.items(b)) {
                    if ((m == n && i >= j) || !overlap(box(i), box(j))) continue;
                    if (--effort < 0) return false;
                    visit((std::min)(i, j), (std::max)(i, j));
                }
            }
        } else if (overlap(a.box, b.box)) {
            const bool halve_a = b.is_leaf() || (!a.is_leaf() && a.count >= b.count);
            const std::size_t left = (halve_a ? m : n) + 1, right = halve_a ? a.right : b.right,
                              other = halve_a ? n : m;
            waiting.insert(waiting.end(), {{left, other}, {right, other}});
        }
    }
    return true;
}

}  // namespace membrane
