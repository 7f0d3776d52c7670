// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/meshing/editable_mesh.hpp>
#include <membrane/meshing/level_surface.hpp>
#include <membrane/surface/triangle.hpp>

/// Even triangles on a surface: the iteration of `distmesh`.
///
///     const auto even = membrane::remesh(raw, membrane::LevelSurface(body, bounds), membrane::EdgeLength(0.1), 200);
namespace membrane {

/// Target length of the edges [m]: a constant, or a function of the position.
class EdgeLength {
  public:
    EdgeLength() = default;  ///< No length: options refuse it.

    /// The same length everywhere [m].
    EdgeLength(double everywhere)  // NOLINT(google-explicit-constructor)
        : at_([everywhere](const Vector3<double>&) { return everywhere; }) {}

    /// `at(p)`: the length at the position `p` [m].
    template <class At>
        requires(!std::same_as<At, EdgeLength> && std::is_invocable_r_v<double, const At&, const Vector3<double>&>)
    EdgeLength(At at) : at_(std::move(at)) {}  // NOLINT(google-explicit-constructor)

    /// @throws InvalidInput if the length there is not finite and positive
    [[nodiscard]] double operator()(const Vector3<double>& p) const {
        const double length = at_ ? at_(p) : 0;
        if (is_finite(length) && length > 0) return length;
        refuse("EdgeLength", "the length at (", p.x(), ", ", p.y(), ", ", p.z(),
               ") must be finite and positive [m], got ", length);
    }

  private:
    std::function<double(const Vector3<double>&)> at_;
};

/// Progress of the iteration.
struct RemeshProgress {
    Index iteration;   ///< 1 to the limit.
    Index iterations;  ///< The limit.
    Index vertices;    ///< Number of vertices now.
    double movement;   ///< Largest displacement in this iteration, relative to the target length there.
};

/// `mesh`, whose vertices are on `surface`, with edges close to the target `length` and even angles.
///
/// In each iteration edges longer than 4/3 of their target length are split and edges shorter than 0.7 of it are
/// collapsed [Botsch04] (1.6 and 0.5 in the last third, for convergence). Edges are flipped until the triangulation is
/// Delaunay: the angles opposite to an edge sum to at most 180 degrees. Vertices move by the forces of their edges, as
/// trusses that only push, and are projected back onto the surface. A vertex pushed against a border becomes a border
/// vertex. Changes that would turn a triangle away from the surface's normals are not made. After two thirds of the
/// iterations it stops as soon as no vertex moves by more than a thousandth of its target length.
/// @throws InvalidInput if a length is not finite and positive
template <class Surface>
[[nodiscard]] TriangleMesh<double> remesh(const TriangleMesh<double>& mesh, const Surface& surface,
                                          const EdgeLength& length, Index iterations,
                                          const std::function<void(const RemeshProgress&)>& progress = {});

namespace detail {

template <class Surface>
class Remesher {
  public:
    Remesher(const TriangleMesh<double>& mesh, const Surface& surface, const EdgeLength& length)
        : mesh_(mesh), surface_(surface), length_(length) {
        for (Index v = 0; v < mesh_.vertex_count(); ++v) {
            const auto projected = project(mesh_.position(v), mesh_.is_border(v));
            if (projected) mesh_.move(v, projected->point);
            add_vertex(projected ? projected->normal : Vector3<double>(0, 0, 0), mesh_.position(v));
        }
    }

    /// Splits edges longer, collapses edges shorter than this factor of their target length.
    inline void split_edges(double longer);
    inline void collapse_edges(double shorter);
    inline void flip_to_delaunay();
    /// Frees the memory of collapsed elements if at least half of the vertices are collapsed, as after the first
    /// iterations.
    inline void compact();
    /// Turns vertices that were pushed against the border into border vertices.
    inline void widen_border();
    inline double push();

    [[nodiscard]] const EditableMesh& mesh() const noexcept { return mesh_; }
    [[nodiscard]] Index vertices() const noexcept { return vertices_; }

  private:
    static constexpr double min_facing = 0.5;  // cosine

    [[nodiscard]] static std::size_t at(Index i) noexcept { return static_cast<std::size_t>(i); }
    [[nodiscard]] static double square(double a) noexcept { return a * a; }

    [[nodiscard]] auto project(const Vector3<double>& p, bool to_border) const {
        return to_border ? surface_.project_to_border(p) : surface_.project(p);
    }
    void add_vertex(const Vector3<double>& normal, const Vector3<double>& p) {
        normals_.push_back(normal);
        target_length_.push_back(length_(p));
        ++vertices_;
    }
    [[nodiscard]] Vector3<double> edge(Index side) const {
        return mesh_.position(mesh_.to(side)) - mesh_.position(mesh_.from(side));
    }
    [[nodiscard]] double target_length(Index side) const {
        return (target_length_[at(mesh_.from(side))] + target_length_[at(mesh_.to(side))]) / 2;
    }
    [[nodiscard]] bool is_first(Index side) const {  // of the one or two sides of an edge
        return mesh_.exists(side) && (mesh_.twin(side) == no_index || side < mesh_.twin(side));
    }

    /// Cosine between the normal of a triangle and the sum of the normals at its corners; -1 if it has no area.
    [[nodiscard]] double facing(const OnSurface& a, Index b, Index c) const {
        const Vector3<double> normal = a.normal + normals_[at(b)] + normals_[at(c)];
        const Vector3<double> area = cross<double>(mesh_.position(b) - a.point, mesh_.position(c) - a.point);
        const double size = std::sqrt(squared_norm(area) * squared_norm(normal));
        return size > 0 ? dot(area, normal) / size : -1;
    }
    [[nodiscard]] double facing(Index a, Index b, Index c) const {
        return facing(OnSurface{mesh_.position(a), normals_[at(a)]}, b, c);
    }

    [[nodiscard]] inline bool may_split(Index side, const OnSurface& middle) const;
    [[nodiscard]] inline bool may_flip(Index side) const;
    [[nodiscard]] inline bool may_move(Index v, const OnSurface& to, Index but_next_to = no_index) const;
    [[nodiscard]] inline bool is_delaunay(Index side) const;
    inline bool collapse(Index side);

    EditableMesh mesh_;
    Index vertices_ = 0;  // not collapsed
    const Surface& surface_;
    const EdgeLength& length_;
    std::vector<Vector3<double>> normals_;
    std::vector<double> target_length_;  // at each vertex [m]
    std::vector<Vector3<double>> forces_;
};

/// Whether no triangle around `v` would turn further away from the surface than it is. Triangles at the vertex
/// `but_next_to` are not tested, since they will be removed.
template <class Surface>
bool Remesher<Surface>::may_move(Index v, const OnSurface& to, Index but_next_to) const {
    double before = min_facing, after = 1;
    mesh_.for_each_outgoing(v, [&](Index side) {
        const Index b = mesh_.to(side), c = mesh_.apex(side);
        if (b == but_next_to || c == but_next_to) return;
        after = (std::min)(after, facing(to, b, c));
    });
    if (after >= min_facing) return true;
    mesh_.for_each_outgoing(
        v, [&](Index side) { before = (std::min)(before, facing(v, mesh_.to(side), mesh_.apex(side))); });
    return after >= before;
}

/// Whether no half of a triangle at the edge would turn further away from the surface than the whole triangle.
template <class Surface>
bool Remesher<Surface>::may_split(Index side, const OnSurface& middle) const {
    const auto may = [&](Index s) {
        const Index a = mesh_.from(s), b = mesh_.to(s), c = mesh_.apex(s);
        return (std::min)(facing(middle, b, c), facing(middle, c, a)) >= (std::min)(facing(a, b, c), min_facing);
    };
    return may(side) && (mesh_.twin(side) == no_index || may(mesh_.twin(side)));
}

template <class Surface>
bool Remesher<Surface>::may_flip(Index side) const {
    const Index a = mesh_.from(side), b = mesh_.to(side), c = mesh_.apex(side), d = mesh_.apex(mesh_.twin(side));
    const double before = (std::min)(facing(a, b, c), facing(b, a, d));
    return (std::min)(facing(d, c, a), facing(c, d, b)) >= (std::min)(before, min_facing);
}

/// Whether the angles opposite to the edge sum to at most 180 degrees, up to rounding.
template <class Surface>
bool Remesher<Surface>::is_delaunay(Index side) const {
    const auto cotangent = [&](Index s) {
        const Vector3<double> p = mesh_.position(mesh_.from(s)) - mesh_.position(mesh_.apex(s));
        const Vector3<double> q = mesh_.position(mesh_.to(s)) - mesh_.position(mesh_.apex(s));
        const double area = norm(cross(p, q)), along = dot(p, q);
        return area > 1e-12 * std::abs(along) ? along / area : 1e12;
    };
    return cotangent(side) + cotangent(mesh_.twin(side)) > -1e-6;
}

template <class Surface>
void Remesher<Surface>::flip_to_delaunay() {
    std::vector<Index> pending;
    for (Index side = mesh_.side_count() - 1; side >= 0; --side) {
        if (is_first(side)) pending.push_back(side);
    }
    std::size_t left = 10 * pending.size();  // a limit: on curved surfaces no measure falls with each flip
    while (!pending.empty() && left > 0) {
        const Index side = pending.back();
        pending.pop_back();
        if (mesh_.twin(side) == no_index || is_delaunay(side) || !may_flip(side) || !mesh_.flip(side)) continue;
        --left;
        const Index other = mesh_.twin(side);
        pending.insert(pending.end(), {mesh_.next(side), mesh_.prev(side), mesh_.next(other), mesh_.prev(other)});
    }
}

template <class Surface>
void Remesher<Surface>::split_edges(double longer) {
    const Index sides = mesh_.side_count();
    for (Index side = 0; side < sides; ++side) {
        if (!is_first(side) || squared_norm(edge(side)) < square(longer * target_length(side))) continue;
        const Vector3<double> middle = (mesh_.position(mesh_.from(side)) + mesh_.position(mesh_.to(side))) / 2;
        const auto projected = project(middle, mesh_.twin(side) == no_index);
        if (!projected || norm<double>(projected->point - middle) > norm(edge(side)) / 2 ||
            !may_split(side, *projected))
            continue;
        add_vertex(projected->normal, projected->point);
        mesh_.split(side, projected->point);
    }
}

/// Merges two vertices at their midpoint, or at the one on the border.
template <class Surface>
bool Remesher<Surface>::collapse(Index side) {
    const Index a = mesh_.from(side), b = mesh_.to(side);
    const bool to_border = mesh_.twin(side) == no_index;
    OnSurface target{mesh_.position(b), normals_[at(b)]};
    if (to_border || !mesh_.is_border(b)) {
        const auto projected = project((mesh_.position(a) + mesh_.position(b)) / 2, to_border);
        if (!projected) return false;
        target = *projected;
    }
    if (!may_move(a, target, b) || !may_move(b, target, a) || !mesh_.collapse(side)) return false;
    --vertices_;
    mesh_.move(b, target.point);
    normals_[at(b)] = target.normal;
    target_length_[at(b)] = length_(target.point);
    return true;
}

template <class Surface>
void Remesher<Surface>::collapse_edges(double shorter) {
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side) || squared_norm(edge(side)) > square(shorter * target_length(side))) continue;
        if (!collapse(side) && mesh_.twin(side) != no_index) collapse(mesh_.twin(side));
    }
}

template <class Surface>
void Remesher<Surface>::compact() {
    if (2 * vertices_ > mesh_.vertex_count()) return;
    std::size_t kept = 0;
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
        if (!mesh_.is_vertex(v)) continue;
        normals_[kept] = normals_[at(v)];
        target_length_[kept++] = target_length_[at(v)];
    }
    normals_.resize(kept);
    target_length_.resize(kept);
    mesh_ = EditableMesh(mesh_.mesh());
}

template <class Surface>
void Remesher<Surface>::widen_border() {
    const Index sides = mesh_.side_count();
    for (Index side = 0; side < sides; ++side) {
        if (!mesh_.exists(side) || mesh_.twin(side) != no_index || mesh_.is_border(mesh_.apex(side))) continue;
        const Vector3<double> tip = mesh_.position(mesh_.apex(side));
        const Vector3<double> p = mesh_.position(mesh_.from(side)) - tip, q = mesh_.position(mesh_.to(side)) - tip;
        if (dot(p, q) > -0.5 * norm(p) * norm(q)) continue;  // less than 120 degrees
        const auto projected = surface_.project_to_border(tip);
        if (!projected || norm<double>(projected->point - tip) > norm<double>(p - q) / 2) continue;
        add_vertex(projected->normal, projected->point);
        mesh_.split(side, projected->point);
        collapse(mesh_.twin(mesh_.next(side)));
    }
}

/// Moves the vertices by the forces of their edges. Returns the largest displacement relative to the target length.
template <class Surface>
double Remesher<Surface>::push() {
    constexpr double internal_pressure = 1.2, step = 0.2;  // [Persson04]
    double squares = 0, target_squares = 0;
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side)) continue;
        squares += squared_norm(edge(side));
        target_squares += square(target_length(side));
    }
    const double scale = internal_pressure * std::sqrt(squares / target_squares);
    forces_.assign(at(mesh_.vertex_count()), Vector3<double>(0, 0, 0));
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side)) continue;
        const Vector3<double> edge_vector = edge(side);
        const double length = norm(edge_vector), excess = scale * target_length(side) - length;
        if (!(excess > 0) || !(length > 0)) continue;
        forces_[at(mesh_.from(side))] -= excess / length * edge_vector;
        forces_[at(mesh_.to(side))] += excess / length * edge_vector;
    }
    double farthest = 0;
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
        if (!mesh_.is_vertex(v)) continue;
        const Vector3<double> force = step * forces_[at(v)];
        const Vector3<double> displacement = force - dot(force, normals_[at(v)]) * normals_[at(v)];
        const double most = 0.25 * target_length_[at(v)], length = norm(displacement);
        const auto projected =
            project(mesh_.position(v) + (length > most ? most / length : 1) * displacement, mesh_.is_border(v));
        if (!projected || !may_move(v, *projected)) continue;
        farthest = (std::max)(farthest, norm<double>(projected->point - mesh_.position(v)) / target_length_[at(v)]);
        mesh_.move(v, projected->point);
        normals_[at(v)] = projected->normal;
        target_length_[at(v)] = length_(projected->point);
    }
    return farthest;
}

}  // namespace detail

template <class Surface>
TriangleMesh<double> remesh(const TriangleMesh<double>& mesh, const Surface& surface, const EdgeLength& length,
                            Index iterations, const std::function<void(const RemeshProgress&)>& progress) {
    detail::Remesher<Surface> remesher(mesh, surface, length);
    for (Index i = 1; i <= iterations; ++i) {
        const bool last_third = 3 * i > 2 * iterations;
        remesher.split_edges(last_third ? 1.6 : 4.0 / 3);
        remesher.collapse_edges(last_third ? 0.5 : 0.7);
        remesher.compact();
        if constexpr (Surface::has_border) remesher.widen_border();
        remesher.flip_to_delaunay();
        const double movement = remesher.push();
        if (progress) progress({i, iterations, remesher.vertices(), movement});
        if (last_third && movement < 1e-3) break;
    }
    remesher.flip_to_delaunay();
    return remesher.mesh().mesh();
}

}  // namespace membrane
