// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include <membrane/core/types.hpp>

/// Vertices at the very same place, and those nearly so.
///
///     const membrane::CoincidentVertices near(x, vertices);
///     near.representative()[v];  // the lowest vertex there, v itself if it is the only one
namespace membrane {

class CoincidentVertices {
  public:
    /// Of the points `vertices` of `x` [m], which are finite; each other is alone at its place. O(n log n).
    inline CoincidentVertices(const Points<double>& x, std::span<const Index> vertices);

    /// For each point the lowest of those at the very same place.
    [[nodiscard]] const std::vector<Index>& representative() const noexcept { return same_place_; }

    /// Calls `visit(v, w)`, v < w, for places no farther apart than `distance` [m], by their lowest vertices. Each two
    /// looked at take 1 from `effort`; the search ends when none is left, and says whether it has seen everything.
    template <class Visit>
    [[nodiscard]] bool for_each_pair(double distance, std::int64_t& effort, Visit visit) const;

  private:
    struct Place {
        double along;  // on a line that no mesh has a reason to be built along
        Vector3<double> point;
        Index vertex;
    };

    std::vector<Index> same_place_;
    std::vector<Place> places_;  // in their order along that line
    double rounding_ = 0;        // of where they are along it
};

inline CoincidentVertices::CoincidentVertices(const Points<double>& x, std::span<const Index> vertices)
    : same_place_(static_cast<std::size_t>(x.cols())) {
    const Vector3<double> line(0.5377, 0.6180, 0.5736);
    for (std::size_t v = 0; v < same_place_.size(); ++v) same_place_[v] = static_cast<Index>(v);
    places_.reserve(vertices.size());
    double largest = 0;
    for (const Index v : vertices) {
        places_.push_back({dot<double>(line, point(x, v)), point(x, v), v});
        largest = (std::max)(largest, point(x, v).cwiseAbs().maxCoeff());
    }
    rounding_ = 8 * std::numeric_limits<double>::epsilon() * largest;
    std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) {
        return std::tie(a.along, a.point[0], a.point[1], a.point[2], a.vertex) <
               std::tie(b.along, b.point[0], b.point[1], b.point[2], b.vertex);
    });
    std::size_t kept = 0;
    for (const Place& place : places_) {
        if (kept > 0 && places_[kept - 1].point == place.point) {
            same_place_[static_cast<std::size_t>(place.vertex)] = places_[kept - 1].vertex;
        } else {
            places_[kept++] = place;
        }
    }
    places_.resize(kept);
}

template <class Visit>
bool CoincidentVertices::for_each_pair(double distance, std::int64_t& effort, Visit visit) const {
    for (std::size_t i = 0; i < places_.size(); ++i) {
        const double end = places_[i].along + distance + rounding_;  // the line is no longer than 1
        for (std::size_t j = i + 1; j < places_.size() && places_[j].along <= end; ++j) {
            if (--effort < 0) return false;
            const auto [v, w] = std::minmax(places_[i].vertex, places_[j].vertex);
            if (norm<double>(places_[j].point - places_[i].point) <= distance) visit(v, w);
        }
    }
    return true;
}

}  // namespace membrane
