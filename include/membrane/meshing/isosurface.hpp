// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include <membrane/meshing/level_surface.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Initial triangles of `distmesh`: correct topology, vertices on the surface, any triangle shape.
///
///     const auto ball = membrane::LevelSurface(membrane::Ball{}, membrane::Ball{}.bounds());
///     const auto raw  = membrane::isosurface(ball, membrane::Ball{}.bounds(), 0.1);       // cells of 0.1 m
namespace membrane {

/// The zero level of `surface` in a grid of cells `spacing` [m] wide over `bounds`. Each cell is cut into six
/// tetrahedra, with one vertex on each of their edges that crosses the surface [Doi91]. A surface with a border is then
/// cut where its edges cross the border. Every vertex is within the surface's tolerance of it, a border vertex of both
/// distances.
///
/// Features smaller than a cell can be lost.
/// @throws InvalidInput if there is no surface; if it extends beyond the bounds; if a surface without a border has its
/// inside beyond the bounds; if a distance is not finite; if the grid has more than 1.3e8 points or 2e6 in a plane; if
/// the border is not found because the two surfaces are tangent
/// Cost: O(points of the grid) time, O(one layer of the grid + surface) memory.
template <class Surface>
[[nodiscard]] TriangleMesh<double> isosurface(const Surface& surface, const Bounds& bounds, double spacing);

namespace detail {

inline constexpr std::string_view isosurface_name = "isosurface";

/// A growing set of triangles.
struct Soup {
    std::vector<Vector3<double>> x;
    std::vector<std::array<Index, 3>> triangles;

    [[nodiscard]] Index add(const Vector3<double>& p) {
        x.push_back(p);
        return static_cast<Index>(x.size() - 1);
    }
    [[nodiscard]] const Vector3<double>& at(Index v) const { return x[static_cast<std::size_t>(v)]; }

    /// The mesh of the referenced vertices, in the order of their first reference.
    [[nodiscard]] TriangleMesh<double> mesh() const {
        std::vector<Index> number(x.size(), no_index);
        Points<double> points(3, static_cast<Eigen::Index>(x.size()));
        Triangles corners(3, static_cast<Eigen::Index>(triangles.size()));
        Index used = 0;
        for (std::size_t f = 0; f < triangles.size(); ++f) {
            for (std::size_t k = 0; k < 3; ++k) {
                Index& mine = number[static_cast<std::size_t>(triangles[f][k])];
                if (mine == no_index) {
                    mine = used++;
                    points.col(mine) = at(triangles[f][k]);
                }
                corners(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(f)) = mine;
            }
        }
        return {points.leftCols(used), corners};
    }
};

/// One vertex per crossing edge, made at the first request.
class EdgeVertices {
  public:
    template <class Make>
    Index at(std::uint64_t edge, Make make) {
        const auto found = vertices_.find(edge);
        if (found != vertices_.end()) return found->second;
        const Index made = make();
        vertices_.emplace(edge, made);
        return made;
    }

  private:
    std::unordered_map<std::uint64_t, Index> vertices_;
};

/// The fraction, 0 to 1, at which `is_inside` turns from true to false, to within 2^-51.
template <class IsInside>
[[nodiscard]] double crossing(IsInside is_inside) {
    double low = 0, high = 1;
    for (int i = 0; i < 50; ++i) {
        const double middle = (low + high) / 2;
        (is_inside(middle) ? low : high) = middle;
    }
    return (low + high) / 2;
}

/// Marching tetrahedra, one layer of cubes after another.
template <class Surface>
class MarchingTetrahedra {
  public:
    MarchingTetrahedra(const Surface& surface, const Bounds& bounds, double spacing)
        : surface_(surface), spacing_(spacing) {
        double points = 1, fewest = 1.3e8;
        for (int k = 0; k < 3; ++k) {
            const double cells = std::ceil((bounds.high[k] - bounds.low[k]) / spacing) + 3;
            points *= cells + 1;
            fewest = (std::min)(fewest, cells + 1);
            if (points > 1.3e8 || (k == 2 && points / fewest > 2e6)) {
                refuse(isosurface_name, "a grid of cells of ", spacing, " [m] over the bounds has more than 1.3e8 ",
                       "points, or 2e6 in a plane; use longer edges, a wider spacing or narrower bounds");
            }
            points_[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(cells) + 1;
            // Off centre, so that symmetry planes of bodies do not lie on planes of the grid.
            origin_[k] = (bounds.low[k] + bounds.high[k]) / 2 - (cells / 2 - 0.0271828 * (k + 1)) * spacing;
        }
    }

    [[nodiscard]] Soup march() {
        std::vector<double> below = layer(0), above;
        starts_inside_ = below[0] < 0;
        for (std::int64_t z = 0; z + 1 < points_[2]; ++z) {
            above = layer(z + 1);
            for (std::int64_t y = 0; y + 1 < points_[1]; ++y) {
                for (std::int64_t x = 0; x + 1 < points_[0]; ++x) cube({x, y, z}, below, above);
            }
            below.swap(above);
        }
        return std::move(soup_);
    }

    /// Whether a corner of the grid is inside the body.
    [[nodiscard]] bool starts_inside() const noexcept { return starts_inside_; }

  private:
    using Cell = std::array<std::int64_t, 3>;
    struct Corner {
        int bits;  // one per axis x, y, z: 0 on the lower side of the cube, 1 on the upper
        double distance;
    };

    [[nodiscard]] Vector3<double> grid_point(const Cell& cell, int bits) const {
        Vector3<double> p;
        for (int k = 0; k < 3; ++k) {
            p[k] = origin_[k] + static_cast<double>(cell[static_cast<std::size_t>(k)] + (bits >> k & 1)) * spacing_;
        }
        return p;
    }

    [[nodiscard]] std::vector<double> layer(std::int64_t z) const {
        std::vector<double> distances;
        distances.reserve(static_cast<std::size_t>(points_[0] * points_[1]));
        for (std::int64_t y = 0; y < points_[1]; ++y) {
            for (std::int64_t x = 0; x < points_[0]; ++x) {
                const Vector3<double> p = grid_point({x, y, z}, 0);
                distances.push_back(surface_.distance(p));
                if (is_finite(distances.back())) continue;
                refuse(isosurface_name, "the distance at (", p.x(), ", ", p.y(), ", ", p.z(),
                       ") must be finite [m], got ", distances.back());
            }
        }
        return distances;
    }

    void cube(const Cell& cell, const std::vector<double>& below, const std::vector<double>& above) {
        const auto first = static_cast<std::size_t>(cell[0] + points_[0] * cell[1]);
        const auto row = static_cast<std::size_t>(points_[0]);
        std::array<double, 8> d;
        int inside = 0;
        for (unsigned bits = 0; bits < 8; ++bits) {
            d[bits] = (bits & 4U ? above : below)[first + (bits & 1U) + (bits & 2U ? row : 0)];
            inside += d[bits] < 0 ? 1 : 0;
        }
        if (inside == 0 || inside == 8) return;
        // The six paths from corner 0 to corner 7 along the three axes.
        static constexpr std::array<std::array<int, 2>, 6> paths{{{1, 3}, {2, 6}, {4, 5}, {2, 3}, {1, 5}, {4, 6}}};
        for (std::size_t n = 0; n < 6; ++n) {
            const auto [p, q] = paths[n];
            std::array<Corner, 4> corner{{{0, 0}, {p, 0}, {q, 0}, {7, 0}}};
            for (Corner& c : corner) c.distance = d[static_cast<std::size_t>(c.bits)];
            tetrahedron(cell, corner, n < 3);
        }
    }

    /// Sorts corners inside to the front; each swap reverses the orientation.
    void tetrahedron(const Cell& cell, std::array<Corner, 4> c, bool positive) {
        std::size_t inside = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            if (!(c[i].distance < 0)) continue;
            if (i != inside) {
                std::swap(c[i], c[inside]);
                positive = !positive;
            }
            ++inside;
        }
        if (inside == 0 || inside == 4) return;
        const auto vertex = [&](std::size_t in, std::size_t out) { return edge_vertex(cell, c[in].bits, c[out].bits); };
        const auto add = [&](Index p, Index q, Index r) {
            if (!positive) std::swap(q, r);
            soup_.triangles.push_back({p, q, r});
        };
        if (inside == 1) add(vertex(0, 1), vertex(0, 2), vertex(0, 3));
        if (inside == 3) add(vertex(0, 3), vertex(1, 3), vertex(2, 3));
        if (inside == 2) {
            const Index p = vertex(0, 2), q = vertex(0, 3), r = vertex(1, 3), s = vertex(1, 2);
            add(p, q, r);
            add(p, r, s);
        }
    }

    [[nodiscard]] Index edge_vertex(const Cell& cell, int in, int out) {
        const int low = in & out, diagonal = in ^ out;  // the edge runs from `low` along the axes of `diagonal`
        std::uint64_t number = 0;
        for (int k = 2; k >= 0; --k) {
            const auto axis = static_cast<std::size_t>(k);
            number = number * static_cast<std::uint64_t>(points_[axis]) +
                     static_cast<std::uint64_t>(cell[axis] + (low >> k & 1));
        }
        return vertices_.at(8 * number + static_cast<std::uint64_t>(diagonal), [&] {
            const Vector3<double> p = grid_point(cell, in), q = grid_point(cell, out);
            const double along = crossing([&](double t) { return surface_.distance(p + t * (q - p)) < 0; });
            return soup_.add(p + along * (q - p));
        });
    }

    const Surface& surface_;
    double spacing_;
    Vector3<double> origin_;
    std::array<std::int64_t, 3> points_{};
    bool starts_inside_ = false;
    Soup soup_;
    EdgeVertices vertices_;
};

/// The part of the surface within the border.
template <class Surface>
[[nodiscard]] Soup cut_at_border(const Surface& surface, Soup soup) {
    std::vector<char> within;
    within.reserve(soup.x.size());
    for (const auto& p : soup.x) within.push_back(surface.beyond_border(p) < 0 ? 1 : 0);
    const auto stays = [&](Index v) { return within[static_cast<std::size_t>(v)] != 0; };
    EdgeVertices vertices;
    const auto cut = [&](Index in, Index out) {
        const auto edge = (static_cast<std::uint64_t>(in) << 32U) + static_cast<std::uint64_t>(out);
        return vertices.at(edge, [&] {
            const Vector3<double> p = soup.at(in), edge_vector = soup.at(out) - p;
            const double along = crossing([&](double t) {
                const auto on_surface = surface.project(p + t * edge_vector);
                return on_surface && surface.beyond_border(on_surface->point) < 0;
            });
            const auto on_border = surface.project_to_border(p + along * edge_vector);
            if (on_border && norm<double>(on_border->point - p) < 2 * norm(edge_vector))
                return soup.add(on_border->point);
            refuse(isosurface_name, "the border near (", p.x(), ", ", p.y(), ", ", p.z(),
                   ") must be where two distances cross at an angle, got none");
        });
    };
    std::vector<std::array<Index, 3>> triangles;
    for (const auto& corners : std::exchange(soup.triangles, {})) {
        std::size_t k = 0;  // rotated so that the corner that differs from the others comes first
        const auto differs = [&](std::size_t i) { return stays(corners[k]) != stays(corners[(k + i) % 3]); };
        while (k < 2 && !(differs(1) && differs(2))) ++k;
        const Index a = corners[k], b = corners[(k + 1) % 3], c = corners[(k + 2) % 3];
        if (stays(a) && stays(b) && stays(c)) {
            triangles.push_back({a, b, c});
        } else if (stays(a)) {
            triangles.push_back({a, cut(a, b), cut(a, c)});
        } else if (stays(b)) {
            const Index ab = cut(b, a), ac = cut(c, a);
            triangles.push_back({ab, b, c});
            triangles.push_back({ab, c, ac});
        }
    }
    soup.triangles = std::move(triangles);
    return soup;
}

}  // namespace detail

template <class Surface>
TriangleMesh<double> isosurface(const Surface& surface, const Bounds& bounds, double spacing) {
    detail::MarchingTetrahedra<Surface> grid(surface, bounds, spacing);
    detail::Soup soup = grid.march();
    const auto crossing_count = static_cast<Index>(soup.x.size());
    if constexpr (Surface::has_border) soup = detail::cut_at_border(surface, std::move(soup));
    if (soup.triangles.empty()) {
        refuse(detail::isosurface_name, "the distance must change its sign within the bounds, got none of cells of ",
               spacing, " [m] where it does");
    }
    Triangles corners(3, static_cast<Eigen::Index>(soup.triangles.size()));
    for (std::size_t f = 0; f < soup.triangles.size(); ++f) {
        corners.col(static_cast<Eigen::Index>(f)) =
            Eigen::Map<const Eigen::Matrix<Index, 3, 1>>(soup.triangles[f].data());
    }
    for_each_edge(half_edges(corners), [&](std::span<const HalfEdge> sides) {
        if (sides.size() != 1 || (sides[0].first >= crossing_count && sides[0].second >= crossing_count)) return;
        const Vector3<double>& p = soup.at(sides[0].first);
        refuse(detail::isosurface_name, "the surface must be within the bounds, got a point out of them near (", p.x(),
               ", ", p.y(), ", ", p.z(), ")");
    });
    if (!Surface::has_border && grid.starts_inside()) {
        refuse(detail::isosurface_name,
               "the distance must be positive out of the bounds, got one that is negative: it "
               "must be negative inside the body, positive outside");
    }
    return soup.mesh();
}

}  // namespace membrane
