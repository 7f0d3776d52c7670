// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <limits>
#include <numeric>
#include <vector>

#include <membrane/core/compressed_rows.hpp>

/// An order of elimination for sparse factors of a mesh.
///
///     for (const auto& part : membrane::nested_dissection(neighbours)) ...   // vertices that are eliminated together
namespace membrane {

/// The vertices of a graph, in parts, in an order in which their elimination links few others [George73]. The last part
/// separates the rest into two halves, each of which is ordered likewise. A separator is a level of a breadth-first
/// search: that with the smallest ratio of its size to the product of the sizes of the halves. Offline. Cost for a
/// mesh: O(V log V).
[[nodiscard]] inline std::vector<std::vector<Index>> nested_dissection(const CompressedRows<Index>& neighbours);

namespace detail {

class Dissection {
  public:
    explicit Dissection(const CompressedRows<Index>& neighbours)
        : neighbours_(neighbours), region_(static_cast<std::size_t>(neighbours.row_count()), 0) {}

    /// Orders some or all of the vertices of one region.
    void dissect(const std::vector<Index>& vertices);

    std::vector<std::vector<Index>> parts;

  private:
    struct Levels {
        std::vector<Index> vertices;    // level by level
        std::vector<std::size_t> ends;  // of each level
    };
    [[nodiscard]] std::size_t& region(Index v) noexcept { return region_[static_cast<std::size_t>(v)]; }
    [[nodiscard]] Levels levels_from(Index first);
    void cut(const Levels& levels);

    const CompressedRows<Index>& neighbours_;
    std::vector<std::size_t> region_;  // of each vertex
    std::size_t last_region_ = 0;
};

inline void Dissection::dissect(const std::vector<Index>& vertices) {
    if (vertices.empty()) return;
    const std::size_t whole = region(vertices.front());
    for (const Index v : vertices) {
        if (region(v) != whole) continue;  // it belongs to a connected component that is done
        const Index far_away = levels_from(v).vertices.back();
        cut(levels_from(far_away));
    }
}

// All vertices that are connected with the first one in its region. They become a region of their own.
inline Dissection::Levels Dissection::levels_from(Index first) {
    const std::size_t before = region(first), now = ++last_region_;
    region(first) = now;
    Levels levels{{first}, {}};
    for (std::size_t i = 0; i < levels.vertices.size();) {
        levels.ends.push_back(levels.vertices.size());
        for (; i < levels.ends.back(); ++i) {
            for (const Index w : neighbours_[levels.vertices[i]]) {
                if (region(w) != before) continue;
                region(w) = now;
                levels.vertices.push_back(w);
            }
        }
    }
    return levels;
}

inline void Dissection::cut(const Levels& levels) {
    constexpr std::size_t cut_above = 8;
    const auto& vertices = levels.vertices;
    std::size_t first = 0, last = 0;  // of the separator
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t level = 1; level + 1 < levels.ends.size() && vertices.size() > cut_above; ++level) {
        const std::size_t begin = levels.ends[level - 1], end = levels.ends[level];
        const double ratio = static_cast<double>(end - begin) /
                             (static_cast<double>(begin) * static_cast<double>(vertices.size() - end));
        if (ratio >= best) continue;
        best = ratio, first = begin, last = end;
    }
    const auto some = [&](std::size_t begin, std::size_t end) {
        return std::vector<Index>(vertices.begin() + static_cast<std::ptrdiff_t>(begin),
                                  vertices.begin() + static_cast<std::ptrdiff_t>(end));
    };
    if (last == 0) return parts.push_back(vertices);
    ++last_region_;
    for (std::size_t i = first; i < last; ++i) region(vertices[i]) = last_region_;
    dissect(some(0, first));
    dissect(some(last, vertices.size()));
    parts.push_back(some(first, last));
}

}  // namespace detail

inline std::vector<std::vector<Index>> nested_dissection(const CompressedRows<Index>& neighbours) {
    detail::Dissection dissection(neighbours);
    std::vector<Index> all(static_cast<std::size_t>(neighbours.row_count()));
    std::iota(all.begin(), all.end(), Index(0));
    dissection.dissect(all);
    return dissection.parts;
}

}  // namespace membrane
