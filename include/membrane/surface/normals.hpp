// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/arctangent.hpp>
#include <membrane/core/compressed_rows.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/lane_points.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/surface/vertex_split.hpp>

/// Normals of a moving surface.
///
///     auto normals = membrane::VertexNormals(mesh);
///     normals.update(x, report.moved);    // in the loop: the moved vertices and their neighbours
///     draw(x, normals.values());
namespace membrane {

namespace detail {

/// The one-ring of a vertex; see `one_rings_of`.
struct OneRing {
    std::array<Index, 6> vertices;          ///< The first six, for most vertices all.
    Index overflow = 0, overflow_size = 0;  ///< Start and number of the others in `VertexNormals::overflow_`.
};

}  // namespace detail

/// Unit normals of the vertices, weighted by the area of their triangles. Owns its data: the mesh need not outlive it.
///
/// An update of the moved vertices gives the same bits as an update of all, after tears too. If the triangles of a
/// vertex have no area together, are not finite or too large, the vertex gets its normal at rest, or (0, 0, 1) if it
/// had none or has no triangles: always a finite vector of length 1.
template <Real Scalar>
class VertexNormals {
  public:
    /// The normals of the mesh at rest. O(F log F).
    explicit VertexNormals(const TriangleMesh<Scalar>& mesh);

    /// Updates the normals of all vertices, at the positions `x`, 3 x V [m]. Returns false, and changes nothing, if `x`
    /// does not have V columns. O(F), no allocation.
    bool update(const ConstPointsRef<Scalar>& x) noexcept;

    /// Updates the normals of the vertices `moved` and their neighbours, each once; `moved` may have duplicates. Those
    /// that a tear has doubled or moved since the last update count as moved. Returns these vertices, valid until the
    /// next update. No other normal changes, and only the corners of their triangles are read. Ignores an index that is
    /// no vertex; returns none if `x` does not have V columns. Linear in their number, no allocation.
    std::span<const Index> update(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) & noexcept;

    /// 3 x V, unit length.
    [[nodiscard]] const Points<Scalar>& values() const& noexcept { return values_; }
    [[nodiscard]] Points<Scalar> values() && noexcept { return std::move(values_); }

    ///@{
    /// A vertex becomes two, with one normal until the next update; a tear has moved a vertex. The normal at rest of
    /// each stays. Online. Cost: the triangles around the vertex and its neighbours.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept {
        if (has_reserve_) torn_.insert(moved.vertex);
    }
    ///@}

    /// Visits what a tear changes, see `replay/snapshot.hpp`: of a mesh with a reserve, each vertex's triangles.
    /// Then update the normals.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        if (self.has_reserve_) visit(self.one_rings_, self.overflow_, self.at_rest_);
    }

  private:
    using Fan = std::span<const std::array<Index, 2>>;
    static constexpr auto lanes = static_cast<Index>(Lanes<Scalar>::count);
    static constexpr Index batch_size = 256;  // vertices of a batch: intermediate results stay in the cache

    template <class VertexAt>
    void face(const ConstPointsRef<Scalar>& x, Index count, const VertexAt& vertex) noexcept;
    template <class VertexAt>
    void normalise(const ConstPointsRef<Scalar>& x, const VertexAt& vertex, Index first, Index end) noexcept;
    void replace_degenerate(const Vector3<Scalar>& position, Index v, Scalar squared) noexcept;
    // Of vertices beyond the first six, if all `triangles` of a vertex are apart.
    [[nodiscard]] static std::size_t overflow_capacity(std::size_t triangles) noexcept {
        const std::size_t all = 3 * triangles + triangles % 2, first = detail::OneRing{}.vertices.size();
        return all > first ? all - first : 0;
    }
    [[nodiscard]] std::span<std::array<Index, 2>> fan_of(Index v) noexcept;
    void set_ring(Index v, Fan fan) noexcept;

    std::vector<detail::OneRing> one_rings_;
    std::vector<Index> overflow_;  // vertices of one-rings beyond the first six
    Points<Scalar> values_;
    Points<Scalar> at_rest_;
    IndexSet updated_;                        // by the last call
    std::vector<PaddedPoint<Scalar>> areas_;  // of a batch: twice the areas as z, x, y; then the normals
    bool has_reserve_;
    IndexSet torn_;                          // vertices doubled or moved by a tear since the last update
    std::vector<std::array<Index, 2>> fan_;  // the other corners of the triangles around a vertex
};

/// The angle-weighted normal of the face, edge or corner at `barycentric`. If this is the surface point nearest to a
/// point q, the sign of its dot product with the vector to q separates inside from outside [Baerentzen05].
/// `barycentric` must be exactly zero at the corners not involved, as from `closest_point`. Unit length, or zero if the
/// triangles around it have no area, or `f` is no triangle. No allocation; linear in the triangles of a corner.
template <class Positions>
[[nodiscard]] Vector3<typename Positions::Scalar> pseudo_normal(
    const Positions& x, const Triangles& triangles, const TriangleAdjacency& adjacency, Index f,
    const Vector3<typename Positions::Scalar>& barycentric) noexcept;

namespace detail {

/// `a` at unit length, or `otherwise` if its length is not finite or too small to divide by.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> unit_or(const Vector3<Scalar>& a, const Vector3<Scalar>& otherwise) noexcept {
    const Scalar squared = squared_norm(a);
    if (!is_finite(squared) || squared < (std::numeric_limits<Scalar>::min)()) return otherwise;
    return a / std::sqrt(squared);
}

/// The one-ring of each vertex, counter-clockwise: its neighbours; at a border, the vertex and its neighbours. If the
/// number is odd, the first vertex is appended, so that it is even.
template <Real Scalar>
[[nodiscard]] CompressedRows<Index> one_rings_of(const TriangleMesh<Scalar>& mesh) {
    const Adjacency adjacency(mesh);
    const auto& triangles = mesh.triangles();
    return {mesh.vertex_count(), [&](auto put) {
                for (Index v = 0; v < mesh.vertex_count(); ++v) {
                    const auto corner = [&](Index f, Index k) {  // k corners after the vertex
                        return ((triangles(0, f) == v ? 0 : triangles(1, f) == v ? 1 : 2) + k) % 3;
                    };
                    const auto across = [&](Index f, Index k) {
                        return adjacency.triangle_neighbours(f)[static_cast<std::size_t>(corner(f, k))];
                    };
                    const auto around = adjacency.triangles_of(v);
                    const std::size_t neighbours = adjacency.neighbours(v).size();
                    const bool closed = neighbours == around.size();  // an isolated vertex has none of either
                    Index f = around.empty() ? no_index : around[0];
                    while (!closed && across(f, 0) != no_index) f = across(f, 0);
                    const Index first = closed && f != no_index ? triangles(corner(f, 1), f) : v;
                    put(v, first);
                    if (!closed) put(v, triangles(corner(f, 1), f));
                    for (std::size_t n = closed ? 1 : 0; n < around.size(); ++n, f = across(f, 2)) {
                        put(v, triangles(corner(f, 2), f));
                    }
                    if ((neighbours + (closed ? 0 : 1)) % 2 == 1 || around.empty()) put(v, first);
                }
            }};
}

/// Twice the area that the one-ring encloses, as z, x, y. The triangles from its first vertex have this area together.
/// They are computed two at a time, as the cross product of their diagonals.
template <Real Scalar>
MEMBRANE_INLINE PaddedVector<Scalar> area_within(const OneRing& ring, const Index* overflow, const Scalar* x,
                                                 std::ptrdiff_t stride) noexcept {
    const auto at = [&](Index v) { return PaddedVector<Scalar>::load_point(x + v * stride); };
    const auto first = at(ring.vertices[0]);
    auto last = at(ring.vertices[1]);
    const auto next_two = [&](Index p, Index q) {
        const auto next = at(q), a = at(p) - first, b = next - last;
        last = next;
        return a * b.turned() - a.turned() * b;
    };
    auto area = next_two(ring.vertices[2], ring.vertices[3]);
    area = area + next_two(ring.vertices[4], ring.vertices[5]);
    for (Index k = ring.overflow; k < ring.overflow + ring.overflow_size; k += 2) {
        area = area + next_two(overflow[k], overflow[k + 1]);
    }
    return area;
}

/// The angle between two sides [rad].
template <Real Scalar>
[[nodiscard]] Scalar angle_between(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
    return arctangent(norm(cross(a, b)), dot(a, b));
}

}  // namespace detail

template <Real Scalar>
VertexNormals<Scalar>::VertexNormals(const TriangleMesh<Scalar>& mesh)
    : one_rings_(static_cast<std::size_t>(mesh.vertex_count())),
      values_(3, mesh.vertex_count()),
      at_rest_(Vector3<Scalar>::UnitZ().eigen().replicate(1, mesh.vertex_count())),
      updated_(mesh.vertex_count()),
      areas_(static_cast<std::size_t>(batch_size)),
      has_reserve_(reserve_of(mesh) > 0),
      torn_(has_reserve_ ? mesh.vertex_count() : 0) {
    std::vector<std::size_t> capacity(one_rings_.size(), 0);
    if (has_reserve_) {
        for (const Index v : mesh.triangles().reshaped()) ++capacity[static_cast<std::size_t>(v)];
        fan_.resize(*std::max_element(capacity.begin(), capacity.end()));
        std::transform(capacity.begin(), capacity.end(), capacity.begin(), overflow_capacity);
    }
    const CompressedRows<Index> whole = detail::one_rings_of(mesh);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        detail::OneRing& ring = one_rings_[static_cast<std::size_t>(v)];
        const auto points = whole[v];
        const std::size_t here = (std::min)(points.size(), ring.vertices.size());
        ring.vertices.fill(points[0]);
        ring.overflow = static_cast<Index>(overflow_.size());
        ring.overflow_size = static_cast<Index>(points.size() - here);
        for (std::size_t k = 0; k < here; ++k) ring.vertices[k] = points[k];
        for (const Index w : points.subspan(here)) overflow_.push_back(w);
        const std::size_t end = static_cast<std::size_t>(ring.overflow) + capacity[static_cast<std::size_t>(v)];
        overflow_.resize((std::max)(overflow_.size(), end), v);
    }
    update(mesh.positions());
    at_rest_ = values_;
}

template <Real Scalar>
bool VertexNormals<Scalar>::update(const ConstPointsRef<Scalar>& x) noexcept {
    if (x.cols() != values_.cols()) return false;
    face(x, static_cast<Index>(values_.cols()), [](Index v) { return v; });
    torn_.clear();
    return true;
}

template <Real Scalar>
std::span<const Index> VertexNormals<Scalar>::update(const ConstPointsRef<Scalar>& x,
                                                     std::span<const Index> moved) & noexcept {
    updated_.clear();
    if (x.cols() != values_.cols()) return {};
    for (const auto vertices : {moved, torn_.items()}) {
        for (const Index v : vertices) updated_.insert(v);
    }
    torn_.clear();
    // Neighbours of moved vertices have mostly moved too: one branch for all of them is predicted.
    const auto own = updated_.items();
    for (const Index v : own) {
        const detail::OneRing& ring = one_rings_[static_cast<std::size_t>(v)];
        bool all_in = true;
        for (const Index w : ring.vertices) all_in &= updated_.contains(w);
        if (!all_in) {
            for (const Index w : ring.vertices) updated_.insert(w);
        }
        for (Index k = ring.overflow; k < ring.overflow + ring.overflow_size; ++k) {
            updated_.insert(overflow_[static_cast<std::size_t>(k)]);
        }
    }
    const auto updated = updated_.items();
    face(x, updated_.count(), [&](Index n) { return updated[static_cast<std::size_t>(n)]; });
    return updated;
}

template <Real Scalar>
void VertexNormals<Scalar>::split(const VertexSplit& split) noexcept {
    const auto fan = fan_of(split.vertex);
    const auto stays = [&](const auto& triangle) { return !split.takes(triangle[0], triangle[1]); };
    // Those that stay first; both in order: a fan is short.
    std::size_t left = 0;
    for (std::size_t i = 0; i < fan.size(); ++i) {
        if (!stays(fan[i])) continue;
        std::rotate(fan.begin() + static_cast<std::ptrdiff_t>(left), fan.begin() + static_cast<std::ptrdiff_t>(i),
                    fan.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        ++left;
    }
    one_rings_[static_cast<std::size_t>(split.copy)].overflow =
        one_rings_[static_cast<std::size_t>(split.vertex)].overflow + static_cast<Index>(overflow_capacity(left));
    set_ring(split.vertex, fan.first(left));
    set_ring(split.copy, fan.subspan(left));
    for (const auto& corners : split.corners) {
        for (const Index w : corners) {
            if (w == split.vertex) continue;
            const auto around = fan_of(w);
            for (auto& [first, second] : around) {
                if (first == split.vertex && split.takes(w, second)) first = split.copy;
                if (second == split.vertex && split.takes(w, first)) second = split.copy;
            }
            set_ring(w, around);
        }
    }
    for (auto* normals : {&values_, &at_rest_}) normals->col(split.copy) = normals->col(split.vertex);
    for (const Index v : {split.vertex, split.copy}) torn_.insert(v);
}

// The triangles around `v`, counter-clockwise: in each its other two corners.
template <Real Scalar>
std::span<std::array<Index, 2>> VertexNormals<Scalar>::fan_of(Index v) noexcept {
    const detail::OneRing& ring = one_rings_[static_cast<std::size_t>(v)];
    const std::size_t here = ring.vertices.size(), size = here + static_cast<std::size_t>(ring.overflow_size);
    const auto at = [&](std::size_t k) {
        return k < here ? ring.vertices[k] : overflow_[static_cast<std::size_t>(ring.overflow) + (k - here)];
    };
    std::size_t count = 0;
    for (std::size_t k = 0; k < size; ++k) {
        const Index first = at(k), second = at((k + 1) % size);
        if (first != second && first != v && second != v) fan_[count++] = {first, second};
    }
    return std::span(fan_).first(count);
}

// Stores the one-ring of the triangles `fan` around `v`: with `v` wherever two in a row share no side.
template <Real Scalar>
void VertexNormals<Scalar>::set_ring(Index v, Fan fan) noexcept {
    detail::OneRing& ring = one_rings_[static_cast<std::size_t>(v)];
    const std::size_t n = fan.size(), here = ring.vertices.size();
    const auto parts = [&](std::size_t i) { return fan[(i + n - 1) % n][1] != fan[i % n][0]; };  // from the last one
    std::size_t start = 0, count = 0;
    while (start < n && !parts(start)) ++start;
    const bool closed = n > 0 && start == n;
    const Index first = closed ? fan[0][0] : v;
    const auto put = [&](Index w) {
        (count < here ? ring.vertices[count] : overflow_[static_cast<std::size_t>(ring.overflow) + (count - here)]) = w;
        ++count;
    };
    for (std::size_t i = start; i < start + n; ++i) {
        if (parts(i)) put(v);
        if (parts(i) || closed) put(fan[i % n][0]);
        if (!closed) put(fan[i % n][1]);
    }
    if (count % 2 == 1) put(first);
    ring.overflow_size = count > here ? static_cast<Index>(count - here) : 0;
    std::fill(ring.vertices.begin() + static_cast<std::ptrdiff_t>((std::min)(count, here)), ring.vertices.end(), first);
}

/// Computes the normals of `vertex(n)` for n from 0 to `count` - 1.
template <Real Scalar>
template <class VertexAt>
void VertexNormals<Scalar>::face(const ConstPointsRef<Scalar>& x, Index count, const VertexAt& vertex) noexcept {
    // Read once: the compiler must assume that the stores below change them.
    const detail::OneRing* rings = one_rings_.data();
    const Index* overflow = overflow_.data();
    const Scalar* positions = x.data();
    PaddedPoint<Scalar>* areas = areas_.data();
    const std::ptrdiff_t stride = x.outerStride();
    for (Index first = 0; first < count; first += batch_size) {
        const Index some = (std::min)(batch_size, count - first);
        for (Index k = 0; k < some; ++k) {
            const auto area = detail::area_within(rings[vertex(first + k)], overflow, positions, stride);
            area.store(areas[k].number.data());
        }
        const auto batch_vertex = [&](Index k) { return vertex(first + k); };
        Index k = 0;
        for (; k + lanes <= some; k += lanes) normalise(x, batch_vertex, k, k + lanes);
        if (k < some) normalise(x, batch_vertex, k, some);
    }
}

/// Normalises the areas `first` to `end` - 1, those of `vertex(first)` to `vertex(end - 1)`, at most as many as there
/// are lanes: square root and division are slow one by one.
template <Real Scalar>
template <class VertexAt>
MEMBRANE_INLINE void VertexNormals<Scalar>::normalise(const ConstPointsRef<Scalar>& x, const VertexAt& vertex,
                                                      Index first, Index end) noexcept {
    std::array<Index, Lanes<Scalar>::count> begins, vertices;
    PaddedVector<Scalar> positions;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Index k = (std::min)(first + static_cast<Index>(i), end - 1);
        begins[i] = numbers_in_point * k;
        vertices[i] = vertex(k);
        positions = positions + PaddedVector<Scalar>::load_point(x.data() + vertices[i] * x.outerStride());
    }
    const Vector3<Lanes<Scalar>> turned = gather(areas_.data(), begins.data());
    const Vector3<Lanes<Scalar>> area(turned.y(), turned.z(), turned.x());
    const Lanes<Scalar> squared = squared_norm(area), length = sqrt(squared);
    scatter<Scalar>({area.x() / length, area.y() / length, area.z() / length}, areas_.data(), begins.data());
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Scalar* normal = areas_.front().number.data() + begins[i];
        values_.col(vertices[i]) = Vector3<Scalar>(normal[0], normal[1], normal[2]);
    }

    Scalar all = positions.sum();  // finite only if all summands are; a vertex is not in its one-ring
    for (std::size_t i = 0; i < vertices.size(); ++i) all += squared[i];
    if (is_finite(all) && !any(squared < (std::numeric_limits<Scalar>::min)())) [[likely]]
        return;
    for (std::size_t i = 0; i < vertices.size(); ++i)
        replace_degenerate(point(x, vertices[i]), vertices[i], squared[i]);
}

/// Sets the normal at rest of vertex `v` if it has no other; `squared` is the square of twice its area.
template <Real Scalar>
MEMBRANE_NOINLINE void VertexNormals<Scalar>::replace_degenerate(const Vector3<Scalar>& position, Index v,
                                                                 Scalar squared) noexcept {
    const bool measurable = is_finite(squared) && squared >= (std::numeric_limits<Scalar>::min)();
    if (!measurable || !is_finite(position)) values_.col(v) = at_rest_.col(v);
}

template <class Positions>
Vector3<typename Positions::Scalar> pseudo_normal(const Positions& x, const Triangles& triangles,
                                                  const TriangleAdjacency& adjacency, Index f,
                                                  const Vector3<typename Positions::Scalar>& barycentric) noexcept {
    using Scalar = typename Positions::Scalar;
    const Vector3<Scalar> none(0, 0, 0);
    if (f < 0 || f >= triangles.cols()) return none;
    const auto face_normal = [&](Index g) {
        return detail::unit_or(area_vector(triangle_at(x, triangles.col(g))), none);
    };
    const auto zeros = std::count(barycentric.begin(), barycentric.end(), Scalar(0));
    if (zeros == 0) return face_normal(f);
    if (zeros == 1) {
        const Index k = barycentric[0] == 0 ? 0 : barycentric[1] == 0 ? 1 : 2;
        const Index across = adjacency.triangle_neighbours(f)[static_cast<std::size_t>((k + 1) % 3)];
        if (across == no_index) return face_normal(f);
        return detail::unit_or<Scalar>(face_normal(f) + face_normal(across), none);
    }
    const Index v = triangles(barycentric[0] != 0 ? 0 : barycentric[1] != 0 ? 1 : 2, f);
    Vector3<Scalar> sum = none;
    for (const Index g : adjacency.triangles_of(v)) {
        const auto corner = triangles.col(g);
        const Index k = corner[0] == v ? 0 : corner[1] == v ? 1 : 2;
        const Vector3<Scalar> next = point(x, corner[(k + 1) % 3]) - point(x, v);
        const Vector3<Scalar> last = point(x, corner[(k + 2) % 3]) - point(x, v);
        sum += detail::angle_between(next, last) * face_normal(g);
    }
    return detail::unit_or(sum, none);
}

}  // namespace membrane
