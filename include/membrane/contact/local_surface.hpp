// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <membrane/contact/tool.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Local queries on a surface around a triangle: neighbours, outward direction, nearest point.
///
///     const membrane::LocalSurface<double> around(mesh);
///     const membrane::Index f = around.walk_to_closest(x, start, q);
///     const double height = around.height(x, f, q);              // of q above the surface, negative behind it
namespace membrane {

/// The triangles of a mesh with their neighbours, and the geometric queries that need both. Positions are arguments.
/// Online except for the constructor.
template <Real Scalar>
class LocalSurface {
  public:
    /// Cost: O(V + F log F).
    explicit LocalSurface(const TriangleMesh<Scalar>& mesh) : LocalSurface(mesh, half_edges(mesh.triangles())) {}

    /// Number of triangles F.
    [[nodiscard]] Index triangle_count() const noexcept { return static_cast<Index>(triangles_.cols()); }

    /// Whether the surface has no border.
    [[nodiscard]] bool closed() const noexcept { return adjacency_.closed(); }
    /// Of the mesh, before it tears [m].
    [[nodiscard]] Scalar mean_edge() const noexcept { return mean_edge_; }

    /// Vertices of triangle `f`.
    [[nodiscard]] std::array<Index, 3> corners(Index f) const noexcept {
        return {triangles_(0, f), triangles_(1, f), triangles_(2, f)};
    }

    /// Triangle `f` at the positions `x` [m].
    [[nodiscard]] Triangle<Scalar> triangle(const ConstPointsRef<Scalar>& x, Index f) const noexcept {
        return triangle_at(x, triangles_.col(f));
    }

    /// Triangles with the corner `v`, in ascending order.
    [[nodiscard]] std::span<const Index> triangles_of(Index v) const& noexcept { return adjacency_.triangles_of(v); }
    void triangles_of(Index) && = delete;

    ///@{
    /// Calls `visit(g)` once for each triangle that shares a side with `f`; or a corner, including `f` itself.
    template <class Visit>
    void across_sides(Index f, Visit&& visit) const noexcept;
    template <class Visit>
    void around_corners(Index f, Visit&& visit) const noexcept;
    ///@}

    /// The outward unit vector at the point `barycentric` of triangle `f`, see `pseudo_normal`.
    [[nodiscard]] Vector3<Scalar> outward(const ConstPointsRef<Scalar>& x, Index f,
                                          const Vector3<Scalar>& barycentric) const noexcept {
        return pseudo_normal(x, triangles_, adjacency_, f, barycentric);
    }

    /// Whether the point `barycentric` of triangle `f` is on the border of the surface.
    [[nodiscard]] bool on_border(Index f, const Vector3<Scalar>& barycentric) const noexcept;

    /// Whether a corner of triangle `f` is on the border.
    [[nodiscard]] bool has_border_vertex(Index f) const noexcept {
        const auto vertices = corners(f);
        return std::any_of(vertices.begin(), vertices.end(), [&](Index v) { return adjacency_.on_border(v); });
    }

    ///@{
    /// Walks from `f` over triangles that share a corner, ever nearer to `q`, to a local minimum of the distance; only
    /// over triangles `g` for which `may(g)` holds.
    template <class May>
    [[nodiscard]] Index walk_to_closest(const ConstPointsRef<Scalar>& x, Index f, const Vector3<Scalar>& q,
                                        const May& may) const noexcept;
    [[nodiscard]] Index walk_to_closest(const ConstPointsRef<Scalar>& x, Index f,
                                        const Vector3<Scalar>& q) const noexcept {
        return walk_to_closest(x, f, q, [](Index) { return true; });
    }
    ///@}

    /// Signed distance of `q` from its nearest point of triangle `f`, negative behind the surface [m].
    [[nodiscard]] Scalar height(const ConstPointsRef<Scalar>& x, Index f, const Vector3<Scalar>& q) const noexcept;

    using Wide = std::array<Index, Lanes<Scalar>::count>;  ///< triangles

    ///@{
    /// In lane i the squared distance of triangle `some[i]` from `q`, or from the tool's axis [m^2]. Equals the results
    /// of `closest_point` and `closest_to_axis` bit for bit.
    [[nodiscard]] Lanes<Scalar> squared_distances(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                  const Vector3<Scalar>& q) const noexcept;
    [[nodiscard]] Lanes<Scalar> squared_distances(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                  const Tool<Scalar>& tool) const noexcept;
    ///@}

    /// In lane i the point of triangle `some[i]` nearest to `q`.
    [[nodiscard]] TrianglePoint<Lanes<Scalar>> closest_points(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                              const Vector3<Scalar>& q) const noexcept;

    /// A vertex becomes two. Cost: the triangles around it.
    void split(const VertexSplit& split) noexcept;

    /// Whether a vertex of the mesh had no triangles, see `surface/vertex_split.hpp`.
    [[nodiscard]] bool has_reserve() const noexcept { return has_reserve_; }

    /// Visits what a tear changes, see `replay/snapshot.hpp`: of a mesh with a reserve, the triangles.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if (self.has_reserve_) visit(self.triangles_, self.adjacency_);
    }

  private:
    LocalSurface(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides);
    [[nodiscard]] Triangle<Lanes<Scalar>> gather(const ConstPointsRef<Scalar>& x, const Wide& some) const noexcept;

    Triangles triangles_;
    TriangleAdjacency adjacency_;
    Scalar mean_edge_ = 0;
    bool has_reserve_;
};

template <Real Scalar>
LocalSurface<Scalar>::LocalSurface(const TriangleMesh<Scalar>& mesh, std::span<const HalfEdge> sides)
    : triangles_(mesh.triangles()), adjacency_(mesh, sides), has_reserve_(reserve_of(mesh) > 0) {
    Index edges = 0;
    for_each_edge(sides, [&](std::span<const HalfEdge> edge) {
        mean_edge_ += norm<Scalar>(point(mesh.positions(), edge[0].second) - point(mesh.positions(), edge[0].first));
        ++edges;
    });
    mean_edge_ /= static_cast<Scalar>(edges);
}

template <Real Scalar>
void LocalSurface<Scalar>::split(const VertexSplit& split) noexcept {
    for (const Index f : split.triangles) split.replace_in(triangles_.col(f));
    adjacency_.split(split);
}

template <Real Scalar>
template <class Visit>
void LocalSurface<Scalar>::across_sides(Index f, Visit&& visit) const noexcept {
    for (const Index g : adjacency_.triangle_neighbours(f)) {
        if (g != no_index) visit(g);
    }
}

template <Real Scalar>
template <class Visit>
void LocalSurface<Scalar>::around_corners(Index f, Visit&& visit) const noexcept {
    const auto vertices = corners(f);
    const auto has = [this](Index g, Index v) {
        return triangles_(0, g) == v || triangles_(1, g) == v || triangles_(2, g) == v;
    };
    for (std::size_t k = 0; k < 3; ++k) {
        for (const Index g : triangles_of(vertices[k])) {
            const bool seen = (k > 0 && has(g, vertices[0])) || (k > 1 && has(g, vertices[1]));
            if (!seen) visit(g);
        }
    }
}

template <Real Scalar>
bool LocalSurface<Scalar>::on_border(Index f, const Vector3<Scalar>& barycentric) const noexcept {
    const auto vertices = corners(f);
    for (std::size_t k = 0; k < 3; ++k) {
        const auto weight = [&](std::size_t i) { return barycentric[static_cast<Eigen::Index>(i % 3)]; };
        if (weight(k) == 1) return adjacency_.on_border(vertices[k]);
        if (weight(k) > 0 && weight(k + 1) > 0 && weight(k + 2) == 0) {
            return adjacency_.triangle_neighbours(f)[k] == no_index;
        }
    }
    return false;
}

template <Real Scalar>
template <class May>
Index LocalSurface<Scalar>::walk_to_closest(const ConstPointsRef<Scalar>& x, Index f, const Vector3<Scalar>& q,
                                            const May& may) const noexcept {
    Scalar square = closest_point(triangle(x, f), q).squared_distance;
    Wide some;
    std::size_t count = 0;
    const auto examine = [&] {
        std::fill(some.begin() + static_cast<std::ptrdiff_t>(count), some.end(), some[0]);
        const auto squares = squared_distances(x, some, q);
        for (std::size_t i = 0; i < count; ++i) {
            if (!(squares[i] < square)) continue;
            square = squares[i];
            f = some[i];
        }
        count = 0;
    };
    for (Index from = no_index; from != f;) {
        from = f;
        around_corners(from, [&](Index g) {
            if (!may(g)) return;
            some[count++] = g;
            if (count == some.size()) examine();
        });
        if (count > 0) examine();
    }
    return f;
}

template <Real Scalar>
Scalar LocalSurface<Scalar>::height(const ConstPointsRef<Scalar>& x, Index f, const Vector3<Scalar>& q) const noexcept {
    const auto nearest = closest_point(triangle(x, f), q);
    const Vector3<Scalar> separation = q - nearest.point;
    return dot(separation, outward(x, f, nearest.barycentric)) < 0 ? -norm(separation) : norm(separation);
}

template <Real Scalar>
Triangle<Lanes<Scalar>> LocalSurface<Scalar>::gather(const ConstPointsRef<Scalar>& x, const Wide& some) const noexcept {
    const auto corner = [&](Eigen::Index k) {
        std::array<const Scalar*, Lanes<Scalar>::count> p;
        for (std::size_t i = 0; i < p.size(); ++i) p[i] = x.data() + triangles_(k, some[i]) * x.outerStride();
        const auto along = [&](std::size_t axis) {
            return Lanes<Scalar>::of([&](std::size_t i) { return p[i][axis]; });
        };
        return Vector3<Lanes<Scalar>>(along(0), along(1), along(2));
    };
    return {corner(0), corner(1), corner(2)};
}

template <Real Scalar>
TrianglePoint<Lanes<Scalar>> LocalSurface<Scalar>::closest_points(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                                  const Vector3<Scalar>& q) const noexcept {
    return closest_point<Lanes<Scalar>>(gather(x, some), q.template cast<Lanes<Scalar>>());
}

template <Real Scalar>
Lanes<Scalar> LocalSurface<Scalar>::squared_distances(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                      const Vector3<Scalar>& q) const noexcept {
    if constexpr (Lanes<Scalar>::parts > 1) {  // several registers, no blend instruction: scalar code is faster
        return Lanes<Scalar>::of([&](std::size_t i) { return squared_distance(triangle(x, some[i]), q); });
    }
    return squared_distance(gather(x, some), q.template cast<Lanes<Scalar>>());
}

template <Real Scalar>
Lanes<Scalar> LocalSurface<Scalar>::squared_distances(const ConstPointsRef<Scalar>& x, const Wide& some,
                                                      const Tool<Scalar>& tool) const noexcept {
    if (!is_shaft(tool)) return squared_distances(x, some, tool.position);
    return Lanes<Scalar>::of(
        [&](std::size_t i) { return closest_to_axis(triangle(x, some[i]), tool).on_triangle.squared_distance; });
}

}  // namespace membrane
