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

/// A surface like a `TriangleMesh`, and as valid after each change as before.
///
/// It is seen by its sides: side 3 f + k runs from corner k of triangle f to the next corner, counter-clockwise, and the
/// twin of a side is the side of the other triangle at the same edge. Numbers of what was collapsed are not used again.
class EditableMesh {
  public:
    /// O(F log F).
    inline explicit EditableMesh(const TriangleMesh<double>& mesh);

    /// Of all that ever were, those collapsed too.
    [[nodiscard]] Index vertex_count() const noexcept { return static_cast<Index>(side_from_.size()); }
    [[nodiscard]] Index side_count() const noexcept { return static_cast<Index>(from_.size()); }

    /// Whether the vertex is in a triangle; whether the side's triangle is there still.
    [[nodiscard]] bool is_vertex(Index v) const noexcept { return side_from_[at(v)] != no_index; }
    [[nodiscard]] bool exists(Index side) const noexcept { return from_[at(side)] != no_index; }

    /// Around the side's triangle: the next side, the one before, and the vertices of these three: the side's first, its
    /// second, and the third.
    [[nodiscard]] static Index next(Index side) noexcept { return side % 3 == 2 ? side - 2 : side + 1; }
    [[nodiscard]] static Index last(Index side) noexcept { return side % 3 == 0 ? side + 2 : side - 1; }
    [[nodiscard]] Index from(Index side) const noexcept { return from_[at(side)]; }
    [[nodiscard]] Index to(Index side) const noexcept { return from_[at(next(side))]; }
    [[nodiscard]] Index apex(Index side) const noexcept { return from_[at(last(side))]; }

    /// `no_index` at a border.
    [[nodiscard]] Index twin(Index side) const noexcept { return twin_[at(side)]; }
    [[nodiscard]] bool is_border(Index v) const noexcept { return twin(side_from_[at(v)]) == no_index; }

    /// Calls `visit(side)` for the side out of `v` of each triangle around, counter-clockwise, from border to border.
    template <class Visit>
    void around(Index v, Visit visit) const;

    /// Whether an edge joins the two. Linear in the triangles around `v`.
    [[nodiscard]] inline bool joined(Index v, Index w) const;

    [[nodiscard]] const Vector3<double>& position(Index v) const noexcept { return positions_[at(v)]; }
    void move(Index v, const Vector3<double>& to) noexcept { positions_[at(v)] = to; }

    /// Exchanges the edge for the other diagonal of its two triangles, if it has two and the other is no edge yet. Says
    /// whether it did; `side` is then the new edge.
    inline bool flip(Index side);

    /// Puts a vertex on the edge at `place`, which splits its triangles in two, and returns it. `side` then ends there.
    inline Index split(Index side, const Vector3<double>& place);

    /// Moves the first vertex of `side` into the second, with the triangles at the edge gone, if the surface stays one of
    /// the same topology: no vertex but the apexes is next to both [Dey99], a vertex of the border goes only along the
    /// border, and of a part that is one triangle or a tetrahedron all stays. Says whether it did.
    inline bool collapse(Index side);

    /// What is there now, vertices and triangles in the order of their numbers.
    [[nodiscard]] inline TriangleMesh<double> mesh() const;

  private:
    [[nodiscard]] static std::size_t at(Index i) noexcept { return static_cast<std::size_t>(i); }

    inline Index add_triangle(Index a, Index b, Index c);
    inline void join(Index side, Index other) noexcept;
    inline void remove_triangle(Index side) noexcept;
    [[nodiscard]] inline bool can_collapse(Index side) const;
    inline void begin_at_border(Index v, Index side) noexcept;

    std::vector<Vector3<double>> positions_;
    std::vector<Index> side_from_;  // each vertex: one that begins there; at a border the one that has no twin
    std::vector<Index> from_;       // each side: its first vertex, no_index if its triangle is gone
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
void EditableMesh::around(Index v, Visit visit) const {
    const Index first = side_from_[at(v)];
    Index side = first;
    do {
        visit(side);
        side = twin(last(side));
    } while (side != first && side != no_index);
}

inline bool EditableMesh::joined(Index v, Index w) const {
    bool found = false;
    around(v, [&](Index side) { found = found || to(side) == w || apex(side) == w; });
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
    for (const Index gone : {side, next(side), last(side)}) from_[at(gone)] = no_index;
}

/// The vertex's triangles, of which `side` is one's side out of it, are visited from the border on.
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
    if (other == no_index || joined(apex(side), apex(other))) return false;
    // Triangles a b c and b a d become d c a, whose first side is `side`, and c d b, whose first is `other`.
    const Index a = from(side), b = to(side), c = apex(side), d = apex(other);
    const Index bc = twin(next(side)), ca = twin(last(side)), ad = twin(next(other)), db = twin(last(other));
    const auto turn = [&](Index first, Index p, Index q, Index r) {
        from_[at(first)] = p;
        from_[at(next(first))] = q;
        from_[at(last(first))] = r;
    };
    turn(side, d, c, a);
    turn(other, c, d, b);
    join(next(side), ca);
    join(last(side), ad);
    join(next(other), db);
    join(last(other), bc);
    begin_at_border(a, last(side));
    begin_at_border(b, last(other));
    begin_at_border(c, other);
    begin_at_border(d, side);
    return true;
}

inline Index EditableMesh::split(Index side, const Vector3<double>& place) {
    const Index middle = vertex_count(), other = twin(side), ends[] = {from(side), to(side)};
    positions_.push_back(place);
    side_from_.push_back(no_index);
    // Of a triangle a b c, with `near` its side a b, `near` keeps a m c; the new one is m b c.
    const auto halve = [&](Index near) {
        const Index b = to(near), c = apex(near), bc = twin(next(near));
        const Index far = add_triangle(middle, b, c);
        from_[at(next(near))] = middle;
        join(next(far), bc);
        join(last(far), next(near));
        begin_at_border(c, last(far));
        return far;
    };
    const Index far = halve(side);
    if (other != no_index) {
        const Index far_other = halve(other);
        join(side, far_other);
        join(other, far);
    }
    begin_at_border(ends[0], side);
    begin_at_border(ends[1], next(far));
    begin_at_border(middle, far);
    return middle;
}

inline bool EditableMesh::can_collapse(Index side) const {
    const Index a = from(side), b = to(side), other = twin(side);
    const bool inner = other != no_index;
    if (inner && is_border(a)) return false;
    if (!inner && twin(next(side)) == no_index && twin(last(side)) == no_index) return false;
    bool valid = true;
    int around_a = 0, around_b = 0;
    around(b, [&](Index) { ++around_b; });
    const auto check = [&](Index v) {
        if (v != b && v != apex(side) && (!inner || v != apex(other)) && joined(v, b)) valid = false;
    };
    around(a, [&](Index out) {
        ++around_a;
        check(to(out));
        if (twin(last(out)) == no_index) check(apex(out));
    });
    return valid && !(inner && !is_border(b) && around_a == 3 && around_b == 3);
}

inline bool EditableMesh::collapse(Index side) {
    if (!can_collapse(side)) return false;
    const Index a = from(side), b = to(side), other = twin(side);
    std::vector<Index> out_of_a;
    around(a, [&](Index out) { out_of_a.push_back(out); });
    for (const Index out : out_of_a) from_[at(out)] = b;
    side_from_[at(a)] = no_index;
    // The two other sides of a triangle that goes close up, and what was across them lies side by side.
    struct Seam {
        Index end, inward, outward;  // an apex, what is across from it to b, what is across from b to it
    };
    std::vector<Seam> seams;
    for (const Index gone : {side, other}) {
        if (gone == no_index) continue;
        seams.push_back({apex(gone), twin(next(gone)), twin(last(gone))});
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
