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

/// Triangles on a surface made even: the iteration of `distmesh`.
///
///     const auto even = membrane::remesh(raw, membrane::LevelSurface(body, bounds), membrane::EdgeLength(0.1), 200);
namespace membrane {

/// How long edges should be [m]: everywhere the same, or a function of the place.
class EdgeLength {
  public:
    EdgeLength() = default;
    EdgeLength(double everywhere)  // NOLINT(google-explicit-constructor)
        : at_([everywhere](const Vector3<double>&) { return everywhere; }) {}
    template <class At>
        requires(!std::same_as<At, EdgeLength> && std::is_invocable_r_v<double, const At&, const Vector3<double>&>)
    EdgeLength(At at) : at_(std::move(at)) {}  // NOLINT(google-explicit-constructor)

    /// @throws InvalidInput unless it is finite and positive there
    [[nodiscard]] double operator()(const Vector3<double>& p) const {
        const double length = at_ ? at_(p) : 0;
        if (is_finite(length) && length > 0) return length;
        refuse("EdgeLength", "the length at (", p.x(), ", ", p.y(), ", ", p.z(),
               ") must be finite and positive [m], got ", length);
    }

  private:
    std::function<double(const Vector3<double>&)> at_;
};

/// How far the iteration has come.
struct RemeshProgress {
    Index iteration;   ///< 1 to the limit.
    Index iterations;  ///< The limit.
    Index vertices;
    double movement;  ///< The farthest that a vertex went in this iteration, as a part of the edge length there.
};

/// `mesh`, whose vertices are on `surface`, with edges as long as `length` says and angles as even as that allows.
///
/// In each iteration edges longer than 4/3 of their length are split and those shorter than 0.7 of it collapsed
/// [Botsch04] (in the last third 1.6 and 0.5: then it only settles); edges are flipped until the triangulation is
/// Delaunay's, the angles across an edge 180 degrees together at most; and vertices go where the edges, as trusses that
/// only push, move them, and back to the surface. A vertex that is pushed against a border becomes one of the border. No
/// change is made that would turn a triangle away from the surface's normals. It ends after the first two thirds when no
/// vertex moves farther than a thousandth of its length.
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
            const auto place = project(mesh_.position(v), mesh_.is_border(v));
            if (place) mesh_.move(v, place->point);
            add_vertex(place ? place->normal : Vector3<double>(0, 0, 0), mesh_.position(v));
        }
    }

    /// Those longer, those shorter than so many times what is wanted.
    inline void split_edges(double longer);
    inline void collapse_edges(double shorter);
    inline void flip_to_delaunay();
    /// Leaves no gaps in memory where most of what was there is collapsed, as after the first iterations.
    inline void compact();
    /// Makes vertices of the border of those that were pushed to it.
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
        wanted_.push_back(length_(p));
        ++vertices_;
    }
    [[nodiscard]] Vector3<double> edge(Index side) const {
        return mesh_.position(mesh_.to(side)) - mesh_.position(mesh_.from(side));
    }
    [[nodiscard]] double wanted(Index side) const {
        return (wanted_[at(mesh_.from(side))] + wanted_[at(mesh_.to(side))]) / 2;
    }
    [[nodiscard]] bool is_first(Index side) const {  // of the one or two of an edge
        return mesh_.exists(side) && (mesh_.twin(side) == no_index || side < mesh_.twin(side));
    }

    /// The cosine between a triangle and the normals at its corners; -1 if it has no area.
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
    Index vertices_ = 0;  // that are there
    const Surface& surface_;
    const EdgeLength& length_;
    std::vector<Vector3<double>> normals_;
    std::vector<double> wanted_;  // length at each vertex [m]
    std::vector<Vector3<double>> forces_;
};

/// Whether no triangle around `v` would turn away from the surface, more than before. Those with `but_next_to` go.
template <class Surface>
bool Remesher<Surface>::may_move(Index v, const OnSurface& to, Index but_next_to) const {
    double before = min_facing, after = 1;
    mesh_.around(v, [&](Index side) {
        const Index b = mesh_.to(side), c = mesh_.apex(side);
        if (b == but_next_to || c == but_next_to) return;
        after = (std::min)(after, facing(to, b, c));
    });
    if (after >= min_facing) return true;
    mesh_.around(v, [&](Index side) { before = (std::min)(before, facing(v, mesh_.to(side), mesh_.apex(side))); });
    return after >= before;
}

/// Whether no half of a triangle at the edge would turn away from the surface, more than all of it does.
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

/// Whether the angles across the edge are 180 degrees together at most, but for roundings.
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
    std::size_t left = 10 * pending.size();  // bent surfaces have no measure that each flip lowers
    while (!pending.empty() && left > 0) {
        const Index side = pending.back();
        pending.pop_back();
        if (mesh_.twin(side) == no_index || is_delaunay(side) || !may_flip(side) || !mesh_.flip(side)) continue;
        --left;
        const Index other = mesh_.twin(side);
        pending.insert(pending.end(), {mesh_.next(side), mesh_.last(side), mesh_.next(other), mesh_.last(other)});
    }
}

template <class Surface>
void Remesher<Surface>::split_edges(double longer) {
    const Index sides = mesh_.side_count();
    for (Index side = 0; side < sides; ++side) {
        if (!is_first(side) || squared_norm(edge(side)) < square(longer * wanted(side))) continue;
        const Vector3<double> middle = (mesh_.position(mesh_.from(side)) + mesh_.position(mesh_.to(side))) / 2;
        const auto place = project(middle, mesh_.twin(side) == no_index);
        if (!place || norm<double>(place->point - middle) > norm(edge(side)) / 2 || !may_split(side, *place)) continue;
        add_vertex(place->normal, place->point);
        mesh_.split(side, place->point);
    }
}

/// Makes one vertex of two, half way between them, or on the border if one is there.
template <class Surface>
bool Remesher<Surface>::collapse(Index side) {
    const Index a = mesh_.from(side), b = mesh_.to(side);
    const bool to_border = mesh_.twin(side) == no_index;
    OnSurface target{mesh_.position(b), normals_[at(b)]};
    if (to_border || !mesh_.is_border(b)) {
        const auto place = project((mesh_.position(a) + mesh_.position(b)) / 2, to_border);
        if (!place) return false;
        target = *place;
    }
    if (!may_move(a, target, b) || !may_move(b, target, a) || !mesh_.collapse(side)) return false;
    --vertices_;
    mesh_.move(b, target.point);
    normals_[at(b)] = target.normal;
    wanted_[at(b)] = length_(target.point);
    return true;
}

template <class Surface>
void Remesher<Surface>::collapse_edges(double shorter) {
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side) || squared_norm(edge(side)) > square(shorter * wanted(side))) continue;
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
        wanted_[kept++] = wanted_[at(v)];
    }
    normals_.resize(kept);
    wanted_.resize(kept);
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
        const auto place = surface_.project_to_border(tip);
        if (!place || norm<double>(place->point - tip) > norm<double>(p - q) / 2) continue;
        add_vertex(place->normal, place->point);
        mesh_.split(side, place->point);
        collapse(mesh_.twin(mesh_.next(side)));
    }
}

/// Moves the vertices by the forces of their edges; the farthest move, as a part of the length wanted there.
template <class Surface>
double Remesher<Surface>::push() {
    constexpr double internal_pressure = 1.2, step = 0.2;  // [Persson04]
    double squares = 0, wanted_squares = 0;
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side)) continue;
        squares += squared_norm(edge(side));
        wanted_squares += square(wanted(side));
    }
    const double scale = internal_pressure * std::sqrt(squares / wanted_squares);
    forces_.assign(at(mesh_.vertex_count()), Vector3<double>(0, 0, 0));
    for (Index side = 0; side < mesh_.side_count(); ++side) {
        if (!is_first(side)) continue;
        const Vector3<double> displacement = edge(side);
        const double length = norm(displacement), excess = scale * wanted(side) - length;
        if (!(excess > 0) || !(length > 0)) continue;
        forces_[at(mesh_.from(side))] -= excess / length * displacement;
        forces_[at(mesh_.to(side))] += excess / length * displacement;
    }
    double farthest = 0;
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
        if (!mesh_.is_vertex(v)) continue;
        const Vector3<double> force = step * forces_[at(v)];
        const Vector3<double> displacement = force - dot(force, normals_[at(v)]) * normals_[at(v)];
        const double most = 0.25 * wanted_[at(v)], far = norm(displacement);
        const auto place =
            project(mesh_.position(v) + (far > most ? most / far : 1) * displacement, mesh_.is_border(v));
        if (!place || !may_move(v, *place)) continue;
        farthest = (std::max)(farthest, norm<double>(place->point - mesh_.position(v)) / wanted_[at(v)]);
        mesh_.move(v, place->point);
        normals_[at(v)] = place->normal;
        wanted_[at(v)] = length_(place->point);
    }
    return farthest;
}

}  // namespace detail

template <class Surface>
TriangleMesh<double> remesh(const TriangleMesh<double>& mesh, const Surface& surface, const EdgeLength& length,
                            Index iterations, const std::function<void(const RemeshProgress&)>& progress) {
    detail::Remesher<Surface> remesher(mesh, surface, length);
    for (Index i = 1; i <= iterations; ++i) {
        const bool settling = 3 * i > 2 * iterations;
        remesher.split_edges(settling ? 1.6 : 4.0 / 3);
        remesher.collapse_edges(settling ? 0.5 : 0.7);
        remesher.compact();
        if constexpr (Surface::has_border) remesher.widen_border();
        remesher.flip_to_delaunay();
        const double movement = remesher.push();
        if (progress) progress({i, iterations, remesher.vertices(), movement});
        if (settling && movement < 1e-3) break;
    }
    remesher.flip_to_delaunay();
    return remesher.mesh().mesh();
}

}  // namespace membrane
