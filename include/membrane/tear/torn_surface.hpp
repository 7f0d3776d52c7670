// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/tear/crack_driving_force.hpp>

/// The surface of a membrane that tears: triangles, rest positions, and the vertices left to double others.
namespace membrane {

/// One change of the surface, which all parts follow: a vertex may first move at rest, then one becomes two. Valid
/// until the surface changes again.
template <Real Scalar>
struct TearEvent {
    MovedVertex<Scalar> moved;  ///< `vertex` is `no_index`: none has moved
    VertexSplit split;          ///< `vertex` is `no_index`: none has become two
};

/// The triangles of a membrane and their shapes at rest, as they are torn by now. Online but for the constructor.
template <Real Scalar>
class TornSurface {
  public:
    /// The reserve: the vertices of `mesh` without triangles, see `with_reserve`. Cost: O(F log F).
    explicit TornSurface(const TriangleMesh<Scalar>& mesh);

    ///@{
    /// Triangles by now, 3 x F; rest positions by now, 3 x V [m]; neighbours.
    [[nodiscard]] const Triangles& triangles() const& noexcept { return triangles_; }
    [[nodiscard]] Triangles triangles() && noexcept { return std::move(triangles_); }
    [[nodiscard]] const Points<Scalar>& rest_positions() const& noexcept { return rest_; }
    [[nodiscard]] Points<Scalar> rest_positions() && noexcept { return std::move(rest_); }
    [[nodiscard]] const TriangleAdjacency& adjacency() const& noexcept { return adjacency_; }
    void adjacency() && = delete;
    ///@}

    /// Vertices of triangle `f`.
    [[nodiscard]] std::array<Index, 3> corners(Index f) const noexcept {
        return {triangles_(0, f), triangles_(1, f), triangles_(2, f)};
    }

    /// Rest positions, or positions `x`, of the corners of triangle `f` [m].
    template <class Positions>
    [[nodiscard]] std::array<Vector3<Scalar>, 3> corners_at(const Positions& x, Index f) const noexcept {
        const auto v = corners(f);
        return {point(x, v[0]), point(x, v[1]), point(x, v[2])};
    }

    /// Number of vertices left to double others.
    [[nodiscard]] Index reserve() const noexcept { return static_cast<Index>(reserve_.size() - used_); }

    /// Number of vertices that have become two.
    [[nodiscard]] Index splits() const noexcept { return static_cast<Index>(used_); }

    /// Whether an edge joins `v` to `other`, with a triangle on either side.
    [[nodiscard]] bool has_inner_edge(Index v, Index other) const noexcept;

    /// The vertex next to `v` over an edge with two triangles whose direction at rest is nearest to `direction`, less
    /// than 60 degrees from it; or `no_index`.
    [[nodiscard]] Index nearest_in_direction(Index v, const Vector3<Scalar>& direction) const noexcept;

    /// Mean length of the edges at `v` at rest [m].
    [[nodiscard]] Scalar mean_edge(Index v) const noexcept;

    ///@{
    /// Area of triangle `f`, and of the triangles around `v`, at rest [m^2].
    [[nodiscard]] Scalar rest_area(Index f) const noexcept { return norm(area_vector(triangle_at(rest_, corners(f)))); }
    [[nodiscard]] Scalar area_around(Index v) const noexcept;
    ///@}

    /// A unit vector along the normals of the triangles around `v` at rest.
    [[nodiscard]] Vector3<Scalar> rest_normal(Index v) const noexcept;

    ///@{
    /// The changes since `begin`.
    [[nodiscard]] std::span<const TearEvent<Scalar>> events() const& noexcept { return events_.items(); }
    void events() && = delete;
    void begin() noexcept;
    ///@}

    /// Moves `v` at rest toward `place`, as far as no angle of its triangles becomes less than `min_angle` [rad], and
    /// in `x` to the same point of the membrane. False if it cannot move.
    bool move_vertex(PointsRef<Scalar>& x, Index v, const Vector3<Scalar>& place, Scalar min_angle) noexcept;

    /// Doubles `v`: the triangles on the left of its edge to `out` get a copy, as far as the edge to `back` or to the
    /// next border. Returns the copy, or `no_index` if nothing can part. An end of such an edge that is on a border
    /// must be split next, or it joins two fans of triangles; `back` is for a vertex that is not on a border.
    Index split(PointsRef<Scalar>& x, Index v, Index out, Index back = no_index) noexcept;

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if constexpr (Visit::restores) self.begin();
        visit(self.triangles_, self.rest_, self.adjacency_, self.used_);
    }

  private:
    [[nodiscard]] std::size_t corner_of(Index f, Index v) const noexcept {
        return triangles_(0, f) == v ? 0 : triangles_(1, f) == v ? 1 : 2;
    }
    [[nodiscard]] Index corner(Index f, std::size_t k) const noexcept {
        return triangles_(static_cast<Eigen::Index>(k % 3), f);
    }
    [[nodiscard]] bool keeps_angles(Index v, const Vector3<Scalar>& place, Scalar min_angle) const noexcept;
    [[nodiscard]] Vector3<Scalar> present_place(const PointsRef<Scalar>& x, Index v,
                                                const Vector3<Scalar>& place) const noexcept;
    void list_left(Index v, Index out, Index back) noexcept;

    Triangles triangles_;
    Points<Scalar> rest_;
    TriangleAdjacency adjacency_;
    std::vector<Index> reserve_;
    std::size_t used_ = 0;
    FixedVector<TearEvent<Scalar>> events_;
    FixedVector<Index> parted_;  // triangles of all events; their corners
    FixedVector<std::array<Index, 3>> parted_corners_;
    FixedVector<ReshapedTriangle<Scalar>> reshaped_;
};

template <Real Scalar>
TornSurface<Scalar>::TornSurface(const TriangleMesh<Scalar>& mesh)
    : triangles_(mesh.triangles()), rest_(mesh.positions()), adjacency_(mesh) {
    std::size_t largest = 1;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const std::size_t count = adjacency_.triangles_of(v).size();
        if (count == 0) reserve_.push_back(v);
        largest = (std::max)(largest, count);
    }
    events_ = FixedVector<TearEvent<Scalar>>(2 * reserve_.size() + 1);
    parted_ = FixedVector<Index>(largest * (reserve_.size() + 1));
    parted_corners_ = FixedVector<std::array<Index, 3>>(parted_.capacity());
    reshaped_ = FixedVector<ReshapedTriangle<Scalar>>(parted_.capacity());
}

template <Real Scalar>
void TornSurface<Scalar>::begin() noexcept {
    events_.clear();
    parted_.clear();
    parted_corners_.clear();
    reshaped_.clear();
}

template <Real Scalar>
bool TornSurface<Scalar>::has_inner_edge(Index v, Index other) const noexcept {
    for (const Index f : adjacency_.triangles_of(v)) {
        const std::size_t k = corner_of(f, v);
        if (corner(f, k + 1) == other) return adjacency_.triangle_neighbours(f)[k] != no_index;
    }
    return false;
}

template <Real Scalar>
Index TornSurface<Scalar>::nearest_in_direction(Index v, const Vector3<Scalar>& direction) const noexcept {
    Index nearest = no_index;
    Scalar largest = norm(direction) / 2;
    for (const Index f : adjacency_.triangles_of(v)) {
        const std::size_t k = corner_of(f, v);
        if (adjacency_.triangle_neighbours(f)[k] == no_index) continue;
        const Index other = corner(f, k + 1);
        const auto along = dot<Scalar>(direction, direction_or_zero<Scalar>(point(rest_, other) - point(rest_, v)));
        if (along > largest) largest = along, nearest = other;
    }
    return nearest;
}

template <Real Scalar>
Scalar TornSurface<Scalar>::mean_edge(Index v) const noexcept {
    Scalar sum = 0;
    const auto around = adjacency_.triangles_of(v);
    for (const Index f : around) sum += norm<Scalar>(point(rest_, corner(f, corner_of(f, v) + 1)) - point(rest_, v));
    return around.empty() ? Scalar(0) : sum / static_cast<Scalar>(around.size());
}

template <Real Scalar>
Scalar TornSurface<Scalar>::area_around(Index v) const noexcept {
    Scalar sum = 0;
    for (const Index f : adjacency_.triangles_of(v)) sum += rest_area(f);
    return sum;
}

template <Real Scalar>
Vector3<Scalar> TornSurface<Scalar>::rest_normal(Index v) const noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index f : adjacency_.triangles_of(v)) sum += RestTriangle<Scalar>(corners_at(rest_, f)).normal;
    return direction_or_zero(sum);
}

template <Real Scalar>
bool TornSurface<Scalar>::keeps_angles(Index v, const Vector3<Scalar>& place, Scalar min_angle) const noexcept {
    const Scalar least = std::tan(min_angle);
    for (const Index f : adjacency_.triangles_of(v)) {
        auto x = corners_at(rest_, f);
        const Vector3<Scalar> normal = RestTriangle<Scalar>(x).normal;
        x[corner_of(f, v)] = place;
        for (std::size_t k = 0; k < 3; ++k) {
            const Vector3<Scalar> next = x[(k + 1) % 3] - x[k], last = x[(k + 2) % 3] - x[k];
            const Scalar sine = dot<Scalar>(normal, cross(next, last)), cosine = dot(next, last);
            if (!(sine > 0) || (cosine > 0 && sine < least * cosine)) return false;
        }
    }
    return true;
}

// Where the point of the membrane is now that is at `place` at rest, near `v`.
template <Real Scalar>
Vector3<Scalar> TornSurface<Scalar>::present_place(const PointsRef<Scalar>& x, Index v,
                                                   const Vector3<Scalar>& place) const noexcept {
    Vector3<Scalar> found = point(x, v);
    Scalar largest = -1;  // the least coordinate in the triangle that contains it best
    for (const Index f : adjacency_.triangles_of(v)) {
        const auto at_rest = corners_at(rest_, f), now = corners_at(x, f);
        const RestTriangle<Scalar> rest(at_rest);
        std::array<Scalar, 3> weights{1, 0, 0};
        Vector3<Scalar> at = now[0];
        for (std::size_t k = 1; k < 3; ++k) {
            weights[k] = dot<Scalar>(rest.gradient[k], place - at_rest[0]);
            weights[0] -= weights[k];
            at += weights[k] * (now[k] - now[0]);
        }
        const Scalar least = *std::min_element(weights.begin(), weights.end());
        if (least > largest) largest = least, found = at;
    }
    return found;
}

template <Real Scalar>
bool TornSurface<Scalar>::move_vertex(PointsRef<Scalar>& x, Index v, const Vector3<Scalar>& place,
                                      Scalar min_angle) noexcept {
    const Vector3<Scalar> from = point(rest_, v);
    Vector3<Scalar> to = place;
    constexpr int halvings = 4;
    for (int i = 0; !keeps_angles(v, to, min_angle); ++i) {
        if (i == halvings) return false;
        to = Scalar(0.5) * (from + to);
    }
    const auto around = adjacency_.triangles_of(v);
    if (reshaped_.capacity() - reshaped_.size() < around.size()) return false;
    const Vector3<Scalar> now = present_place(x, v, to);
    const std::size_t first = reshaped_.size();
    for (const Index f : around) {
        ReshapedTriangle<Scalar> triangle{f, corners(f), corners_at(rest_, f), corners_at(rest_, f)};
        triangle.after[corner_of(f, v)] = to;
        reshaped_.try_push_back(triangle);
    }
    rest_.col(v) = to;
    set_point(x, v, now);
    events_.try_push_back({{v, to, std::as_const(reshaped_).items().subspan(first)}, {}});
    return true;
}

// Appends to `parted_` the triangles from the left of the edge to `out` counter-clockwise.
template <Real Scalar>
void TornSurface<Scalar>::list_left(Index v, Index out, Index back) noexcept {
    const auto around = adjacency_.triangles_of(v);
    const auto found =
        std::find_if(around.begin(), around.end(), [&](Index f) { return corner(f, corner_of(f, v) + 1) == out; });
    Index f = found == around.end() ? no_index : *found;
    for (std::size_t n = 0; f != no_index && n < around.size(); ++n) {
        if (!parted_.try_push_back(f)) return;
        parted_corners_.try_push_back(corners(f));
        const std::size_t k = (corner_of(f, v) + 2) % 3;
        if (corner(f, k) == back) return;
        f = adjacency_.triangle_neighbours(f)[k];
    }
}

template <Real Scalar>
Index TornSurface<Scalar>::split(PointsRef<Scalar>& x, Index v, Index out, Index back) noexcept {
    const auto around = adjacency_.triangles_of(v);
    if (used_ == reserve_.size()) return no_index;
    const std::size_t first = parted_.size();
    list_left(v, out, back);
    const std::size_t count = parted_.size() - first;
    if (count == 0 || count == around.size()) {
        parted_.truncate(first);
        parted_corners_.truncate(first);
        return no_index;
    }
    const Index copy = reserve_[used_++];
    VertexSplit split{v, copy, std::as_const(parted_).items().subspan(first),
                      std::as_const(parted_corners_).items().subspan(first), 0};
    double area = 0, taken = 0;
    for (const Index f : around) {
        const auto own = static_cast<double>(rest_area(f));
        area += own;
        if (split.takes(f)) taken += own;
    }
    split.area_share = taken / area;
    for (const Index f : split.triangles) triangles_(static_cast<Eigen::Index>(corner_of(f, v)), f) = copy;
    adjacency_.split(split);
    rest_.col(copy) = rest_.col(v);
    set_point(x, copy, point(x, v));
    events_.try_push_back({{}, split});
    return copy;
}

}  // namespace membrane
