// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>

/// Triangles whose edges can be flipped, split and collapsed.
///
///     membrane::EditableMesh editable(mesh);
///     for (membrane::Index side = 0; side < editable.side_count(); ++side) {
///         if (editable.exists(side) && too_long(editable, side)) editable.split(side, middle(editable, side));
///     }
///     const auto finer = editable.mesh();
namespace membrane {

/// A surface like a `TriangleMesh`; each change keeps it valid.
///
/// Its elements are sides (half-edges): side 3 f + k runs from corner k of triangle f to the next corner,
/// counter-clockwise. The twin of a side is the side of the other triangle at the same edge. Indices of collapsed
/// elements are not reused.
class EditableMesh {
  public:
    /// O(F log F).
    inline explicit EditableMesh(const TriangleMesh<double>& mesh);

    ///@{
    /// Counts include collapsed elements.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(side_from_.size()); }
    [[nodiscard]] Index side_count() const noexcept { return static_cast<Index>(from_.size()); }
    ///@}

    ///@{
    /// Whether the vertex is in a triangle; whether the side's triangle still exists.
    [[nodiscard]] bool is_vertex(Index v) const noexcept { return side_from_[at(v)] != no_index; }
    [[nodiscard]] bool exists(Index side) const noexcept { return from_[at(side)] != no_index; }
    ///@}

    ///@{
    /// In the side's triangle: the next side, the previous side, and the three vertices: first, second, apex.
    [[nodiscard]] static Index next(Index side) noexcept { return side % 3 == 2 ? side - 2 : side + 1; }
    [[nodiscard]] static Index prev(Index side) noexcept { return side % 3 == 0 ? side + 2 : side - 1; }
    [[nodiscard]] Index from(Index side) const noexcept { return from_[at(side)]; }
    [[nodiscard]] Index to(Index side) const noexcept { return from_[at(next(side))]; }
    [[nodiscard]] Index apex(Index side) const noexcept { return from_[at(prev(side))]; }
    ///@}

    /// The other side of the edge; `no_index` at a border.
    [[nodiscard]] Index twin(Index side) const noexcept { return twin_[at(side)]; }

    /// Whether vertex `v` is on the border.
    [[nodiscard]] bool is_border(Index v) const noexcept { return twin(side_from_[at(v)]) == no_index; }

    /// Calls `visit(side)` for the outgoing side of `v` in each of its triangles, counter-clockwise, from border to
    /// border.
    template <class Visit>
    void for_each_outgoing(Index v, Visit visit) const;

    /// Whether an edge joins the two vertices. Linear in the triangles around `v`.
    [[nodiscard]] inline bool has_edge(Index v, Index w) const;

    /// Position of vertex `v` [m].
    [[nodiscard]] Vector3<double> position(Index v) const noexcept { return positions_[at(v)]; }

    /// Moves vertex `v` to the position `to` [m].
    void move(Index v, const Vector3<double>& to) noexcept { positions_[at(v)] = to; }

    /// Replaces the edge by the other diagonal of its two triangles; `side` is then the new edge. If the edge is at a
    /// border or that diagonal is an edge already, returns false and changes nothing.
    inline bool flip(Index side);

    /// Inserts a vertex at `p` on the edge, which splits its triangles in two, and returns the vertex. `side` then ends
    /// there.
    inline Index split(Index side, const Vector3<double>& p);

    /// Moves the first vertex of `side` into the second and removes the triangles at the edge, if the surface keeps its
    /// topology: only the apexes are neighbours of both vertices [Dey99], a border vertex moves only along the border,
    /// and a component of one triangle or one tetrahedron stays. Returns whether it collapsed.
    inline bool collapse(Index side);

    /// The present mesh, vertices and triangles in the order of their indices.
    [[nodiscard]] inline TriangleMesh<double> mesh() const;

  private:
    [[nodiscard]] static std::size_t at(Index i) noexcept { return static_cast<std::size_t>(i); }

    inline Index add_triangle(Index a, Index b, Index c);
    inline void join(Index side, Index other) noexcept;
    inline void remove_triangle(Index side) noexcept;
    [[nodiscard]] inline bool can_collapse(Index side) const;
    inline void begin_at_border(Index v, Index side) noexcept;

    std::vector<Vector3<double>> positions_;
    std::vector<Index> side_from_;  // per vertex: an outgoing side; at a border the one without a twin
    std::vector<Index> from_;       // per side: its first vertex, no_index if its triangle was removed
    std::vector<Index> twin_;
};

inline EditableMesh::EditableMesh(const TriangleMesh<double>& mesh)
    : side_from_(at(mesh.vertex_count()), no_index), twin_(at(3 * mesh.triangle_count()), no_index) {
    for (Index v = 0; v < mesh.vertex_count(); ++v) positions_.push_back(point(mesh.positions(), v));
    for (const auto& corners : mesh.triangles().colwise()) from_.insert(from_.end(), corners.begin(), corners.end());
    for_each_edge(half_edges(mesh.triangles()), [&](std::span<const HalfEdge> sides) {
        if (sides.size() == 2) join(3 * sides[0].triangle + sides[0].side, 3 * sides[1].triangle + sides[1].side);
    });
    for (Index side = 0; side < side_count(); ++side) {
        Index& first = side_from_[at(from(side))];
        if (first == no_index || twin(side) == no_index) first = side;
    }
}

template <class Visit>
void EditableMesh::for_each_outgoing(Index v, Visit visit) const {
    const Index first = side_from_[at(v)];
    Index side = first;
    do {
        visit(side);
        side = twin(prev(side));
    } while (side != first && side != no_index);
}

inline bool EditableMesh::has_edge(Index v, Index w) const {
    bool found = false;
    for_each_outgoing(v, [&](Index side) { found = found || to(side) == w || apex(side) == w; });
    return found;
}

inline void EditableMesh::join(Index side, Index other) noexcept {
    if (side != no_index) twin_[at(side)] = other;
    if (other != no_index) twin_[at(other)] = side;
}

inline Index EditableMesh::add_triangle(Index a, Index b, Index c) {
    from_.insert(from_.end(), {a, b, c});
    twin_.insert(twin_.end(), 3, no_index);
    return side_count() - 3;
}

inline void EditableMesh::remove_triangle(Index side) noexcept {
    for (const Index gone : {side, next(side), prev(side)}) from_[at(gone)] = no_index;
}

/// Sets the first outgoing side of `v`, found from its outgoing `side`: at a border the one without a twin.
inline void EditableMesh::begin_at_border(Index v, Index side) noexcept {
    const Index first = side;
    while (twin(side) != no_index) {
        side = next(twin(side));
        if (side == first) break;
    }
    side_from_[at(v)] = side;
}

inline bool EditableMesh::flip(Index side) {
    const Index other = twin(side);
    if (other == no_index || has_edge(apex(side), apex(other))) return false;
    // Triangles a b c and b a d become d c a, whose first side is `side`, and c d b, whose first is `other`.
    const Index a = from(side), b = to(side), c = apex(side), d = apex(other);
    const Index bc = twin(next(side)), ca = twin(prev(side)), ad = twin(next(other)), db = twin(prev(other));
    const auto turn = [&](Index first, Index p, Index q, Index r) {
        from_[at(first)] = p;
        from_[at(next(first))] = q;
        from_[at(prev(first))] = r;
    };
    turn(side, d, c, a);
    turn(other, c, d, b);
    join(next(side), ca);
    join(prev(side), ad);
    join(next(other), db);
    join(prev(other), bc);
    begin_at_border(a, prev(side));
    begin_at_border(b, prev(other));
    begin_at_border(c, other);
    begin_at_border(d, side);
    return true;
}

inline Index EditableMesh::split(Index side, const Vector3<double>& p) {
    const Index middle = vertex_count(), other = twin(side), ends[] = {from(side), to(side)};
    positions_.push_back(p);
    side_from_.push_back(no_index);
    // In a triangle a b c with the side `first` = a b, `first` keeps a m c; `second` is the new triangle m b c.
    const auto halve = [&](Index first) {
        const Index b = to(first), c = apex(first), bc = twin(next(first));
        const Index second = add_triangle(middle, b, c);
        from_[at(next(first))] = middle;
        join(next(second), bc);
        join(prev(second), next(first));
        begin_at_border(c, prev(second));
        return second;
    };
    const Index second = halve(side);
    if (other != no_index) {
        const Index far_other = halve(other);
        join(side, far_other);
        join(other, second);
    }
    begin_at_border(ends[0], side);
    begin_at_border(ends[1], next(second));
    begin_at_border(middle, second);
    return middle;
}

inline bool EditableMesh::can_collapse(Index side) const {
    const Index a = from(side), b = to(side), other = twin(side);
    const bool inner = other != no_index;
    if (inner && is_border(a)) return false;
    if (!inner && twin(next(side)) == no_index && twin(prev(side)) == no_index) return false;
    bool valid = true;
    int around_a = 0, around_b = 0;
    for_each_outgoing(b, [&](Index) { ++around_b; });
    const auto inspect = [&](Index v) {
        if (v != b && v != apex(side) && (!inner || v != apex(other)) && has_edge(v, b)) valid = false;
    };
    for_each_outgoing(a, [&](Index out) {
        ++around_a;
        inspect(to(out));
        if (twin(prev(out)) == no_index) inspect(apex(out));
    });
    return valid && !(inner && !is_border(b) && around_a == 3 && around_b == 3);
}

inline bool EditableMesh::collapse(Index side) {
    if (!can_collapse(side)) return false;
    const Index a = from(side), b = to(side), other = twin(side);
    std::vector<Index> out_of_a;
    for_each_outgoing(a, [&](Index out) { out_of_a.push_back(out); });
    for (const Index out : out_of_a) from_[at(out)] = b;
    side_from_[at(a)] = no_index;
    // The two other sides of a removed triangle merge: their twins become twins of each other.
    struct Seam {
        Index end, inward, outward;  // the apex, the twin from it to b, the twin from b to it
    };
    std::vector<Seam> seams;
    for (const Index gone : {side, other}) {
        if (gone == no_index) continue;
        seams.push_back({apex(gone), twin(next(gone)), twin(prev(gone))});
        join(seams.back().inward, seams.back().outward);
    }
    remove_triangle(side);
    if (other != no_index) remove_triangle(other);
    for (const auto& [end, inward, outward] : seams) {
        begin_at_border(end, inward != no_index ? inward : next(outward));
        begin_at_border(b, outward != no_index ? outward : next(inward));
    }
    return true;
}

inline TriangleMesh<double> EditableMesh::mesh() const {
    std::vector<Index> number(positions_.size(), no_index);
    Points<double> points(3, static_cast<Eigen::Index>(positions_.size()));
    Index used = 0;
    for (Index v = 0; v < vertex_count(); ++v) {
        if (!is_vertex(v)) continue;
        points.col(used) = position(v);
        number[at(v)] = used++;
    }
    Triangles triangles(3, side_count() / 3);
    Eigen::Index count = 0;
    for (Index side = 0; side < side_count(); side += 3) {
        if (!exists(side)) continue;
        triangles.col(count++) << number[at(from(side))], number[at(to(side))], number[at(apex(side))];
    }
    return {points.leftCols(used), triangles.leftCols(count)};
}

}  // namespace membrane
