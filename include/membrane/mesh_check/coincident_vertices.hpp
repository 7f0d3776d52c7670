// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/core/types.hpp>

/// Coincident and nearly coincident vertices.
///
///     const membrane::CoincidentVertices near(x, vertices);
///     near.representative()[v];  // the lowest vertex at the position of v, possibly v itself
namespace membrane {

/// Groups of vertices at equal positions, and pairs at nearly equal ones.
class CoincidentVertices {
  public:
    /// Compares the points `vertices` of `x` [m], which must be finite; all others count as distinct. O(n log n).
    inline CoincidentVertices(const Points<double>& x, std::span<const Index> vertices);

    /// For each vertex the lowest vertex at exactly the same position.
    [[nodiscard]] const std::vector<Index>& representative() const& noexcept { return representative_; }
    [[nodiscard]] std::vector<Index> representative() && noexcept { return std::move(representative_); }

    /// Calls `visit(v, w)`, v < w, for each pair of representatives at most `distance` [m] apart. Each pair tested
    /// subtracts 1 from `effort`. If `effort` falls below 0, the search stops and returns false; if it completes,
    /// returns true.
    template <class Visit>
    [[nodiscard]] bool for_each_pair(double distance, std::int64_t& effort, Visit visit) const;

  private:
    struct Entry {
        double along;  // coordinate along a line with a direction unlikely in meshes
        Vector3<double> point;
        Index vertex;
    };

    std::vector<Index> representative_;
    std::vector<Entry> entries_;  // one a representative, in order along the line
    double rounding_ = 0;         // error bound of `along`
};

inline CoincidentVertices::CoincidentVertices(const Points<double>& x, std::span<const Index> vertices)
    : representative_(static_cast<std::size_t>(x.cols())) {
    const Vector3<double> line(0.5377, 0.6180, 0.5736);
    for (std::size_t v = 0; v < representative_.size(); ++v) representative_[v] = static_cast<Index>(v);
    entries_.reserve(vertices.size());
    double largest = 0;
    for (const Index v : vertices) {
        entries_.push_back({dot<double>(line, point(x, v)), point(x, v), v});
        largest = (std::max)(largest, point(x, v).cwiseAbs().maxCoeff());
    }
    rounding_ = 8 * std::numeric_limits<double>::epsilon() * largest;
    std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
        return std::tie(a.along, a.point[0], a.point[1], a.point[2], a.vertex) <
               std::tie(b.along, b.point[0], b.point[1], b.point[2], b.vertex);
    });
    std::size_t kept = 0;
    for (const Entry& entry : entries_) {
        if (kept > 0 && entries_[kept - 1].point == entry.point) {
            representative_[static_cast<std::size_t>(entry.vertex)] = entries_[kept - 1].vertex;
        } else {
            entries_[kept++] = entry;
        }
    }
    entries_.resize(kept);
}

template <class Visit>
bool CoincidentVertices::for_each_pair(double distance, std::int64_t& effort, Visit visit) const {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
        const double end = entries_[i].along + distance + rounding_;  // the line's direction is at most 1 long
        for (std::size_t j = i + 1; j < entries_.size() && entries_[j].along <= end; ++j) {
            if (--effort < 0) return false;
            const auto [v, w] = std::minmax(entries_[i].vertex, entries_[j].vertex);
            if (norm<double>(entries_[j].point - entries_[i].point) <= distance) visit(v, w);
        }
    }
    return true;
}

}  // namespace membrane
