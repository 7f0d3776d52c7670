// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/vertex_split.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

/// Springs of a membrane that may tear.
///
///     const auto mesh = membrane::with_reserve(sheet, 400);  // for 400 vertices that double
///     auto springs = membrane::TearableSprings(mesh, membrane::MassSpringNetwork(mesh, law, options));
namespace membrane {

/// `mesh` with `count` more vertices, at the place of vertex 0 and without triangles: for the vertices that a tear
/// doubles. @throws InvalidInput if `count` is negative. O(V + F log F).
template <Real Scalar>
[[nodiscard]] TriangleMesh<Scalar> with_reserve(const TriangleMesh<Scalar>& mesh, Index count);

/// A `MassSpringNetwork` that follows a tear. The stiffness of a spring between two triangles is the sum of two shares,
/// in proportion to their areas; when they part, each keeps its own. The order in which a vertex lists its springs then
/// changes. A doubled vertex has its share of mass and viscosity, and is pinned if the vertex is.
template <Real Scalar_, CheckedSpringLaw<Scalar_> Law = LinearSpring>
class TearableSprings : public MassSpringNetwork<Scalar_, Law>, public SplitCount {
    using Base = MassSpringNetwork<Scalar_, Law>;

  public:
    using Scalar = Scalar_;  ///< of the constants and forces

    /// @throws InvalidInput if the network is not of the mesh. O(F log F).
    TearableSprings(const TriangleMesh<Scalar>& mesh, const Base& network);

    /// The energy [J] of the shares of triangle `f` with these corners, and their forces on the corners [N].
    [[nodiscard]] TriangleResponse<Scalar> triangle_response(Index f, const std::array<Index, 3>& corners,
                                                             const ConstPointsRef<Scalar>& x) const noexcept;

    /// The most springs that vertex `v` may have if all its triangles part.
    [[nodiscard]] std::size_t capacity(Index v) const noexcept { return static_cast<std::size_t>(capacity_[at(v)]); }

    ///@{
    /// A vertex becomes two; a vertex moves at rest: its springs have their rest lengths in proportion to the edges,
    /// and their stiffnesses in proportion to area over squared length. Online. Cost: that of the springs around the
    /// vertex.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        Base::visit_tear(self, visit);
        visit(self.sides_, self.shares_, self.capacity_, self.splits_);
    }

  private:
    struct Share {
        Index triangle = no_index;
        Scalar stiffness = 0;
    };
    using Shares = std::array<Share, 2>;  // of a spring

    [[nodiscard]] static std::size_t at(Index i) noexcept { return static_cast<std::size_t>(i); }
    void build_rows();
    void part(const VertexSplit& split, Index f, Index& side) noexcept;
    void store(Index s) noexcept;
    [[nodiscard]] SpringEnd<Scalar>* end_at(Index v, Index other) noexcept;

    std::vector<std::array<Index, 3>> sides_;  // springs of a triangle, side k from corner k to the next, or no_index
    std::vector<Shares> shares_;   // of each spring, and of those in reserve; the first always has a triangle
    std::vector<Index> capacity_;  // for springs of each vertex
};

template <Real Scalar>
TriangleMesh<Scalar> with_reserve(const TriangleMesh<Scalar>& mesh, Index count) {
    if (count < 0) refuse("with_reserve", "count must not be negative, got ", count);
    Points<Scalar> x(3, mesh.vertex_count() + count);
    x.leftCols(mesh.vertex_count()) = mesh.positions();
    for (Index v = mesh.vertex_count(); v < x.cols(); ++v) x.col(v) = mesh.positions().col(0);
    return {x, mesh.triangles()};
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
TearableSprings<Scalar, Law>::TearableSprings(const TriangleMesh<Scalar>& mesh, const Base& network)
    : Base(network),
      sides_(at(mesh.triangle_count()), {no_index, no_index, no_index}),
      shares_(this->springs_.size()),
      capacity_(at(mesh.vertex_count()), 0) {
    constexpr std::string_view component = "TearableSprings";
    if (network.vertex_count() != mesh.vertex_count()) {
        refuse(component, "network must be of the mesh of ", mesh.vertex_count(), " vertices, got one of ",
               network.vertex_count());
    }
    std::size_t s = 0;
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        if (s == this->springs_.size()) return;
        const Spring<Scalar>& spring = this->springs_[s];
        const std::array<Index, 2> ends{spring.first, spring.second};
        if (ends != std::array<Index, 2>{(std::min)(sides[0].first, sides[0].second),
                                         (std::max)(sides[0].first, sides[0].second)}) {
            return;  // an edge without spring
        }
        std::array<Scalar, 2> areas{};
        for (std::size_t i = 0; i < sides.size(); ++i) {
            areas[i] = detail::area_of(mesh, sides[i].triangle);
            sides_[at(sides[i].triangle)][static_cast<std::size_t>(sides[i].side)] = static_cast<Index>(s);
        }
        const Scalar both = areas[0] + areas[1];
        const Scalar first = both > 0 ? spring.stiffness * (areas[0] / both) : spring.stiffness;
        shares_[s][0] = {sides[0].triangle, sides.size() == 2 ? first : spring.stiffness};
        if (sides.size() == 2) shares_[s][1] = {sides[1].triangle, spring.stiffness - first};
        ++s;
    });
    if (s != this->springs_.size()) refuse(component, "network must be of the mesh, spring ", s, " is no edge of it");
    for (const auto& corners : mesh.triangles().colwise()) {
        for (const Index v : corners) capacity_[at(v)] += 2;
    }
    build_rows();
}

// Rows with capacity for the springs of all triangles apart, and a list with capacity for springs that part.
template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void TearableSprings<Scalar, Law>::build_rows() {
    CompressedRows<SpringEnd<Scalar>> rows(this->vertex_count(), [&](auto put) {
        for (Index v = 0; v < this->vertex_count(); ++v) {
            for (Index i = 0; i < capacity_[at(v)]; ++i) put(v, SpringEnd<Scalar>{});
        }
    });
    for (Index v = 0; v < this->vertex_count(); ++v) {
        rows.truncate(v, 0);
        for (const auto& end : this->ends_[v]) rows.append(v, end);
    }
    this->ends_ = std::move(rows);
    // A vertex that doubles parts two springs at most.
    const auto reserve = static_cast<std::size_t>(std::count(capacity_.begin(), capacity_.end(), 0));
    FixedVector<Spring<Scalar>> springs(this->springs_.size() + 2 * reserve);
    for (const auto& spring : this->springs()) springs.try_push_back(spring);
    this->springs_ = std::move(springs);
    shares_.resize(this->springs_.capacity());
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
SpringEnd<Scalar>* TearableSprings<Scalar, Law>::end_at(Index v, Index other) noexcept {
    for (auto& end : this->ends_[v]) {
        if (end.other == other) return &end;
    }
    return nullptr;
}

// Writes stiffness and rest length of spring `s` to the rows of its ends.
template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void TearableSprings<Scalar, Law>::store(Index s) noexcept {
    const auto& spring = this->springs_[at(s)];
    for (const auto& [v, other] : {std::pair(spring.first, spring.second), std::pair(spring.second, spring.first)}) {
        auto* const end = end_at(v, other);
        MEMBRANE_ASSERT(end != nullptr);
        *end = {other, spring.stiffness, spring.rest_length};
    }
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
TriangleResponse<Scalar> TearableSprings<Scalar, Law>::triangle_response(
    Index f, const std::array<Index, 3>& corners, const ConstPointsRef<Scalar>& x) const noexcept {
    TriangleResponse<Scalar> sum;
    for (std::size_t k = 0; k < 3; ++k) {
        const Index s = sides_[at(f)][k];
        if (s == no_index) continue;
        const std::size_t next = (k + 1) % 3;
        const Shares& shares = shares_[at(s)];
        const SpringElement<Scalar, Law> spring{&this->law(), shares[shares[0].triangle == f ? 0 : 1].stiffness,
                                                this->springs_[at(s)].rest_length};
        const auto force = spring.template force_along<Scalar>(point(x, corners[next]) - point(x, corners[k]));
        sum.energy += spring.response(force.length).energy;
        sum.force[k] += force.force();
        sum.force[next] -= force.force();
    }
    return sum;
}

// A side of triangle `f`, which gets the copy: its spring goes along, or two triangles share it no more.
template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void TearableSprings<Scalar, Law>::part(const VertexSplit& split, Index f, Index& side) noexcept {
    auto& spring = this->springs_.items()[at(side)];
    if (spring.first == split.copy || spring.second == split.copy) return;  // it went with its other triangle
    const Index other = spring.first == split.vertex ? spring.second : spring.first;
    Shares& shares = shares_[at(side)];
    const std::size_t own = shares[0].triangle == f ? 0 : 1;
    const Share left = shares[1 - own];
    if (left.triangle == no_index || split.takes(left.triangle)) {
        (spring.first == split.vertex ? spring.first : spring.second) = split.copy;
        end_at(other, split.vertex)->other = split.copy;
        return;
    }
    const Share share = shares[own];
    shares = {left, Share{}};
    spring.stiffness = left.stiffness;
    store(side);
    this->ends_.append(other, {split.copy, share.stiffness, spring.rest_length});
    side = static_cast<Index>(this->springs_.size());
    MEMBRANE_ASSERT(this->springs_.size() < this->springs_.capacity());
    this->springs_.try_push_back({split.copy, other, share.stiffness, spring.rest_length});
    shares_[at(side)] = {share, Share{}};
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void TearableSprings<Scalar, Law>::split(const VertexSplit& split) noexcept {
    ++splits_;
    const Index v = split.vertex, copy = split.copy;
    for (std::size_t n = 0; n < split.triangles.size(); ++n) {
        const Index f = split.triangles[n];
        for (std::size_t k = 0; k < 3; ++k) {
            Index& side = sides_[at(f)][k];
            const auto& corners = split.corners[n];
            if (side != no_index && (corners[k] == v || corners[(k + 1) % 3] == v)) part(split, f, side);
        }
    }
    capacity_[at(copy)] = 2 * static_cast<Index>(split.triangles.size());
    capacity_[at(v)] -= capacity_[at(copy)];
    this->ends_.split(
        v, copy, [&](const SpringEnd<Scalar>& end) { return end_at(end.other, v) == nullptr; }, at(capacity_[at(v)]));
    for (const Index f : split.triangles) {
        for (const Index side : sides_[at(f)]) {
            if (side == no_index) continue;
            const auto& spring = this->springs_[at(side)];
            if (spring.first != copy && spring.second != copy) continue;
            const Index other = spring.first == copy ? spring.second : spring.first;
            if (end_at(copy, other) == nullptr) {
                this->ends_.append(copy, {other, spring.stiffness, spring.rest_length});
            }
        }
    }
    for (auto* of_vertex : {&this->mass_, &this->viscosity_}) {
        if (of_vertex->empty()) continue;
        divide((*of_vertex)[at(v)], (*of_vertex)[at(copy)], split.area_share);
    }
    this->pinned_[at(copy)] = this->pinned_[at(v)];
}

template <Real Scalar, CheckedSpringLaw<Scalar> Law>
void TearableSprings<Scalar, Law>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    const auto area = [](const std::array<Vector3<Scalar>, 3>& x) {
        return norm<Scalar>(cross<Scalar>(x[1] - x[0], x[2] - x[0]));
    };
    for (const auto& triangle : moved.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index s = sides_[at(triangle.triangle)][k];
            if (s == no_index) continue;
            const std::size_t next = (k + 1) % 3;
            const auto before = norm<Scalar>(triangle.before[next] - triangle.before[k]);
            const auto after = norm<Scalar>(triangle.after[next] - triangle.after[k]);
            auto& spring = this->springs_.items()[at(s)];
            Shares& shares = shares_[at(s)];
            const bool is_first = shares[0].triangle == triangle.triangle;
            Share& share = shares[is_first ? 0 : 1];
            const Scalar ratio = before / after;
            share.stiffness *= area(triangle.after) / area(triangle.before) * (ratio * ratio);
            if (is_first) spring.rest_length *= after / before;  // once: both triangles of such an edge are listed
            spring.stiffness = shares[0].stiffness + shares[1].stiffness;
            store(s);
        }
    }
}

}  // namespace membrane
