// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include <membrane/core/check.hpp>
#include <membrane/core/compressed_rows.hpp>
#include <membrane/model/elastic_network.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Few points of a membrane, and the weights with which they displace the others.
///
///     const membrane::CoarsePoints points(mesh, network, 64);
///     for (const auto& [k, weight] : points.weights(v)) displacement += double(weight) * of_point[k];
namespace membrane {

/// Coarse points: vertices as far from each other along the mesh as their number allows, pinned ones first.
///
/// A free vertex follows the points within 2.5 times their spacing by moving least squares [Lancaster81]: its
/// displacement is that of the affine function that fits those of the points best, near ones with more weight. Pinned
/// points do not move, so the displacements fall to zero towards pinned vertices.
class CoarsePoints {
  public:
    /// A point that displaces a vertex.
    struct Weight {
        Index point;   ///< number of the point, from 0 to `count()` - 1
        float weight;  ///< of its displacement [1]
    };

    /// About `count` points that are not pinned; at least one in each piece of the mesh that is not. Vertices that
    /// nothing joins to others have no weights.
    /// @throws InvalidInput for a network of other vertices than the mesh's. Offline. Cost: O(V log V) for each point.
    template <Real Scalar, ElasticNetwork<Scalar> Network>
    CoarsePoints(const TriangleMesh<Scalar>& mesh, const Network& network, Index count);

    /// Number of points that are not pinned.
    [[nodiscard]] Index count() const noexcept { return count_; }

    /// The points that displace vertex `v`; none if it is pinned.
    [[nodiscard]] std::span<const Weight> weights(Index v) const& noexcept {
        return weights_[row_[static_cast<std::size_t>(v)]];
    }
    void weights(Index) && = delete;

    /// The largest distance of a vertex from the nearest point, along edges [m].
    [[nodiscard]] double spacing() const noexcept { return spacing_; }

    /// A vertex becomes two: the points displace the copy as the vertex. Online.
    void split(const VertexSplit& split) noexcept {
        row_[static_cast<std::size_t>(split.copy)] = row_[static_cast<std::size_t>(split.vertex)];
    }

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.row_);
    }

  private:
    static constexpr double range = 2.5;  // of a point, in spacings

    struct Near {  // a point near a vertex
        Index point;
        double distance;  // along edges [m]
    };
    using Graph = CompressedRows<std::pair<Index, double>>;  // of each vertex, its neighbours and their distances

    template <class Visit>
    static void for_each_within(const Graph& graph, Index from, double distance, std::vector<double>& found,
                                const Visit& visit);
    void add_points(const Graph& graph, const std::vector<Index>& candidates, double spacing, Index count,
                    const std::vector<bool>& pinned, std::vector<double>& distances);
    template <Real Scalar>
    void find_weights(const Points<Scalar>& rest, const Graph& graph, const std::vector<bool>& pinned);
    template <Real Scalar>
    [[nodiscard]] std::vector<Weight> fit(const Points<Scalar>& rest, Index v, const std::vector<Near>& around) const;

    std::vector<Index> points_;  // vertices
    std::vector<Index> number_;  // of each point among those that are not pinned, or `no_index`
    CompressedRows<Weight> weights_;
    std::vector<Index> row_;  // of each vertex in these
    Index count_ = 0;
    double spacing_ = 0;
};

template <Real Scalar, ElasticNetwork<Scalar> Network>
CoarsePoints::CoarsePoints(const TriangleMesh<Scalar>& mesh, const Network& network, Index count) {
    const Points<Scalar>& rest = mesh.positions();
    if (network.vertex_count() != mesh.vertex_count()) {
        refuse("CoarsePoints", "the network must be of the mesh's ", mesh.vertex_count(), " vertices, got one of ",
               network.vertex_count());
    }
    const Graph graph(mesh.vertex_count(), [&](auto put) {
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            for (const auto& end : network.neighbours(v)) {
                put(v,
                    std::pair(end.other, static_cast<double>(norm<Scalar>(point(rest, end.other) - point(rest, v)))));
            }
        }
    });
    std::vector<bool> pinned;
    std::vector<Index> joined, pins;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        pinned.push_back(network.pinned(v));
        if (!graph[v].empty()) joined.push_back(v);
        if (!graph[v].empty() && network.pinned(v)) pins.push_back(v);
    }
    // How far apart that many points are, then as far apart again, pinned ones first.
    const std::vector<double> far_off(pinned.size(), std::numeric_limits<double>::infinity());
    std::vector<double> distances = far_off;
    add_points(graph, joined, 0, count, pinned, distances);
    for (const Index v : joined) spacing_ = (std::max)(spacing_, distances[static_cast<std::size_t>(v)]);
    points_.clear();
    distances = far_off;
    add_points(graph, pins, spacing_, unlimited, pinned, distances);
    add_points(graph, joined, spacing_, unlimited, pinned, distances);
    for (Index v = 0; v < mesh.vertex_count(); ++v) row_.push_back(v);
    for (const Index v : points_) number_.push_back(network.pinned(v) ? no_index : count_++);
    find_weights(rest, graph, pinned);
}

// Visits each vertex within `distance` of `from`, nearest first: Dijkstra's algorithm. `found` is infinite everywhere,
// and is so again in the end.
template <class Visit>
void CoarsePoints::for_each_within(const Graph& graph, Index from, double distance, std::vector<double>& found,
                                   const Visit& visit) {
    using Item = std::pair<double, Index>;
    std::priority_queue<Item, std::vector<Item>, std::greater<>> front;
    std::vector<Index> changed;
    const auto add = [&](Index v, double at) {
        double& known = found[static_cast<std::size_t>(v)];
        if (at > distance || !(at < known)) return;
        if (!is_finite(known)) changed.push_back(v);
        known = at;
        front.push({at, v});
    };
    add(from, 0);
    while (!front.empty()) {
        const auto [at, v] = front.top();
        front.pop();
        if (at > found[static_cast<std::size_t>(v)] || !visit(v, at)) continue;
        for (const auto& [other, length] : graph[v]) add(other, at + length);
    }
    for (const Index v : changed) found[static_cast<std::size_t>(v)] = std::numeric_limits<double>::infinity();
}

// Adds the candidate that is farthest from all points, again and again, until all are within `spacing`, or there are
// `count` points that are not pinned and each piece of the mesh has one. `distances` are those from each vertex to the
// nearest point.
inline void CoarsePoints::add_points(const Graph& graph, const std::vector<Index>& candidates, double spacing,
                                     Index count, const std::vector<bool>& pinned, std::vector<double>& distances) {
    std::vector<double> found(distances.size(), std::numeric_limits<double>::infinity());
    const auto is_nearer = [&](Index a, Index b) {
        return distances[static_cast<std::size_t>(a)] < distances[static_cast<std::size_t>(b)];
    };
    while (!candidates.empty()) {
        const Index next = *std::max_element(candidates.begin(), candidates.end(), is_nearer);
        const double distance = distances[static_cast<std::size_t>(next)];  // infinite in a piece without a point
        if (!(distance > spacing) || (count <= 0 && is_finite(distance))) return;
        points_.push_back(next);
        count -= pinned[static_cast<std::size_t>(next)] ? 0 : 1;
        for_each_within(graph, next, std::numeric_limits<double>::infinity(), found, [&](Index v, double at) {
            const auto i = static_cast<std::size_t>(v);
            if (!(at < distances[i])) return false;
            distances[i] = at;
            return true;
        });
    }
}

template <Real Scalar>
void CoarsePoints::find_weights(const Points<Scalar>& rest, const Graph& graph, const std::vector<bool>& pinned) {
    std::vector<std::vector<Near>> around(pinned.size());
    std::vector<double> found(pinned.size(), std::numeric_limits<double>::infinity());
    for (std::size_t k = 0; k < points_.size(); ++k) {
        for_each_within(graph, points_[k], range * spacing_, found, [&](Index v, double at) {
            around[static_cast<std::size_t>(v)].push_back({static_cast<Index>(k), at});
            return true;
        });
    }
    std::vector<std::vector<Weight>> all(pinned.size());
    for (std::size_t v = 0; v < all.size(); ++v) {
        if (!pinned[v] && !around[v].empty()) all[v] = fit(rest, static_cast<Index>(v), around[v]);
    }
    weights_ = CompressedRows<Weight>(static_cast<Index>(all.size()), [&](auto put) {
        for (std::size_t v = 0; v < all.size(); ++v) {
            for (const Weight& weight : all[v]) put(static_cast<Index>(v), weight);
        }
    });
}

// The weights of the points in the value at `v` of the function a + b . (x - x_v) that fits theirs. Where the points
// lie in a plane b has no component across it: the small diagonal decides. It leaves the constant exact.
template <Real Scalar>
std::vector<CoarsePoints::Weight> CoarsePoints::fit(const Points<Scalar>& rest, Index v,
                                                    const std::vector<Near>& around) const {
    using Basis = Eigen::Vector4d;
    std::vector<std::pair<Basis, double>> at;
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    double all = 0;
    for (const Near& one : around) {
        const auto apart = point(rest, points_[static_cast<std::size_t>(one.point)]) - point(rest, v);
        const double radius = (std::max)(range * spacing_, (std::numeric_limits<double>::min)());
        const double s = (std::min)(one.distance / radius, 1.0);
        Basis basis(1, 0, 0, 0);
        for (Eigen::Index k = 0; k < 3; ++k) basis[k + 1] = static_cast<double>(apart[k]) / radius;
        const double weight = std::pow(1 - s, 4) * (4 * s + 1);  // [Wendland95]
        at.emplace_back(basis, weight);
        sum += weight * basis * basis.transpose();
        all += weight;
    }
    sum.diagonal().tail<3>().array() += 1e-6 * all;
    const Basis value = sum.ldlt().solve(Basis::Unit(0));
    std::vector<Weight> weights;
    for (std::size_t i = 0; i < around.size(); ++i) {
        const Index number = number_[static_cast<std::size_t>(around[i].point)];
        const double weight = at[i].second * at[i].first.dot(value);
        if (number != no_index && weight != 0) weights.push_back({number, static_cast<float>(weight)});
    }
    return weights;
}

}  // namespace membrane
