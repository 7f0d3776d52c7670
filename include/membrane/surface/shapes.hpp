// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string_view>

#include <membrane/core/check.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Surfaces made without a file.
///
///     const auto sphere = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});   // 642 vertices
///     const auto skin   = membrane::sheet<float>({.width = 0.1, .height = 0.05, .columns = 40, .rows = 20});
///     const auto cornea = membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 12});
namespace membrane {

/// Options of `icosphere`.
struct IcosphereOptions {
    double radius = 0.01;    ///< [m]
    Index subdivisions = 3;  ///< 0 to 9. Each multiplies the triangles by four and halves the edges.
};

/// Options of `sheet`.
struct SheetOptions {
    double width = 0.1;   ///< Along x [m].
    double height = 0.1;  ///< Along y [m].
    Index columns = 20;   ///< Of squares, 1 to 1000.
    Index rows = 20;      ///< Of squares, 1 to 1000.
};

/// Options of `disc`.
struct DiscOptions {
    double radius = 0.05;  ///< [m]
    Index rings = 12;      ///< 1 to 1000. Edges are about radius / rings long.
};

/// Options of `spherical_cap`.
struct SphericalCapOptions {
    double radius = 7.8e-3;     ///< Of the sphere, here a cornea's [m].
    double diameter = 11.7e-3;  ///< Of the rim, at most twice the radius [m].
    Index rings = 12;           ///< 1 to 1000. Edges are about half the arc from rim to rim / rings long.
};

/// A sphere around the origin: 10 * 4^s + 2 vertices, 20 * 4^s triangles. The regular icosahedron with its vertices at
/// the directions of (0, +-1, +-phi) and cyclic permutations, each triangle split at its edges' midpoints, projected
/// to the sphere. The first 12 vertices have five neighbours, all others six.
/// @throws InvalidInput if an option is out of its range
template <Real Scalar = double>
[[nodiscard]] TriangleMesh<Scalar> icosphere(const IcosphereOptions& options = {});

/// A rectangle around the origin at z = 0, facing +z: (columns + 1) * (rows + 1) vertices, row by row, and two
/// triangles for each square, cut from its lower left to its upper right.
/// @throws InvalidInput if an option is out of its range
template <Real Scalar = double>
[[nodiscard]] TriangleMesh<Scalar> sheet(const SheetOptions& options = {});

/// A disc around the origin at z = 0, facing +z: vertex 0 in the centre, then rings of 6, 12, 18 ... vertices;
/// 1 + 3 r (r + 1) vertices and 6 r^2 triangles.
/// @throws InvalidInput if an option is out of its range
template <Real Scalar = double>
[[nodiscard]] TriangleMesh<Scalar> disc(const DiscOptions& options = {});

/// The part of a sphere around the origin that lies above a plane, facing outward: vertex 0 is the apex at
/// (0, 0, radius), then rings as of a disc; the last ring is the rim.
/// @throws InvalidInput if an option is out of its range
template <Real Scalar = double>
[[nodiscard]] TriangleMesh<Scalar> spherical_cap(const SphericalCapOptions& options = {});

/// The point in the middle between two [m].
struct Midpoint {
    /// (a + b) / 2.
    [[nodiscard]] Vector3<double> operator()(const Vector3<double>& a, const Vector3<double>& b) const noexcept {
        return (a + b) / 2;
    }
};

/// The mesh with each edge halved and each triangle split into four. Its first vertices are those of `mesh`; then comes
/// one for each edge from a to b, at `between(a, b)` [m]: `Midpoint` keeps the shape of the mesh, a user-defined
/// function puts the vertex on the surface or the border that the mesh approximates.
/// @throws InvalidInput for a position that is not finite. O(F log F).
template <Real Scalar, class Between = Midpoint>
[[nodiscard]] TriangleMesh<Scalar> refined(const TriangleMesh<Scalar>& mesh, Between between = {});

namespace detail {

inline void check_length(std::string_view shape, std::string_view option, double length) {
    check_option(shape, length, option, "m", false);
}

inline void check_count(std::string_view shape, std::string_view option, Index count, Index least, Index most) {
    if (count < least || count > most) refuse(shape, option, " must be ", least, " to ", most, ", got ", count);
}

/// Splits every triangle into four. `x` has capacity for the new vertices from `vertex_count` on, which grows by one
/// for each edge. The new vertex of an edge from a to b is at `between(a, b)`.
template <class Between>
Triangles subdivided(const Triangles& triangles, Points<double>& x, Index& vertex_count, Between between) {
    Triangles midpoints(3, triangles.cols());
    for_each_edge(half_edges(triangles), [&](std::span<const HalfEdge> sides) {
        for (const HalfEdge& side : sides) midpoints(side.side, side.triangle) = vertex_count;
        x.col(vertex_count++) = between(point(x, sides[0].first), point(x, sides[0].second));
    });
    Triangles finer(3, 4 * triangles.cols());
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        const Eigen::Matrix<Index, 3, 1> corner = triangles.col(f), middle = midpoints.col(f);
        finer.col(4 * f) << corner[0], middle[0], middle[2];
        finer.col(4 * f + 1) << middle[0], corner[1], middle[1];
        finer.col(4 * f + 2) << middle[2], middle[1], corner[2];
        finer.col(4 * f + 3) = middle;
    }
    return finer;
}

/// A centre with rings of 6, 12, 18 ... vertices around it; `position(r, angle)` is that of a vertex of ring r.
template <Real Scalar, class Position>
TriangleMesh<Scalar> concentric(Index rings, Position position) {
    const auto first_of = [](Index ring) { return ring == 0 ? 0 : 1 + 3 * ring * (ring - 1); };
    Points<double> x(3, first_of(rings + 1));
    x.col(0) = position(0, 0.0);
    Triangles triangles(3, 6 * rings * rings);
    Eigen::Index f = 0;
    for (Index ring = 1; ring <= rings; ++ring) {
        const Index count = 6 * ring, inner_count = (std::max)(count - 6, 1);
        const auto outer = [&](Index i) { return first_of(ring) + i % count; };
        const auto inner = [&](Index i) { return first_of(ring - 1) + i % inner_count; };
        for (Index i = 0; i < count; ++i) {
            x.col(outer(i)) = position(ring, 2 * std::numbers::pi * i / count);
            const Index j = i - i / ring;  // each of the six sectors has one inner vertex less
            triangles.col(f++) << inner(j), outer(i), outer(i + 1);
            if (i % ring + 1 < ring) triangles.col(f++) << inner(j), outer(i + 1), inner(j + 1);
        }
    }
    return TriangleMesh<Scalar>(x.cast<Scalar>(), triangles);
}

}  // namespace detail

template <Real Scalar, class Between>
TriangleMesh<Scalar> refined(const TriangleMesh<Scalar>& mesh, Between between) {
    Index vertex_count = mesh.vertex_count();
    Points<double> x(3, vertex_count + static_cast<Index>(edges(mesh).size()));
    x.leftCols(vertex_count) = mesh.positions().template cast<double>();
    const Triangles triangles = detail::subdivided(mesh.triangles(), x, vertex_count, between);
    return TriangleMesh<Scalar>(x.cast<Scalar>(), triangles);
}

template <Real Scalar>
TriangleMesh<Scalar> icosphere(const IcosphereOptions& options) {
    detail::check_length("icosphere", "radius", options.radius);
    detail::check_count("icosphere", "subdivisions", options.subdivisions, 0, 9);
    Points<double> x(3, 10 * (Eigen::Index{1} << (2 * options.subdivisions)) + 2);
    Index vertex_count = 0;
    const double length = std::sqrt(1 + std::numbers::phi * std::numbers::phi);
    for (const int zero : {0, 1, 2}) {
        for (const double one : {1.0, -1.0}) {
            for (const double phi : {std::numbers::phi, -std::numbers::phi}) {
                auto vertex = x.col(vertex_count++);
                vertex[zero] = 0;
                vertex[(zero + 1) % 3] = one / length;
                vertex[(zero + 2) % 3] = phi / length;
            }
        }
    }
    Triangles triangles(3, 20);
    triangles << 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 5, 5,  //
        2, 5, 4, 10, 8, 6, 3, 8, 7, 10, 9, 5, 11, 6, 11, 9, 6, 9, 10, 7,      //
        4, 2, 8, 5, 10, 3, 7, 6, 10, 8, 4, 11, 9, 9, 7, 11, 8, 6, 7, 11;
    const auto onto_sphere = [](const Vector3<double>& a, const Vector3<double>& b) {
        const Vector3<double> sum = a + b;
        return Vector3<double>(sum / norm(sum));
    };
    for (Index level = 0; level < options.subdivisions; ++level) {
        triangles = detail::subdivided(triangles, x, vertex_count, onto_sphere);
    }
    return TriangleMesh<Scalar>((options.radius * x).cast<Scalar>(), triangles);
}

template <Real Scalar>
TriangleMesh<Scalar> sheet(const SheetOptions& options) {
    const Index columns = options.columns, rows = options.rows;
    detail::check_length("sheet", "width", options.width);
    detail::check_length("sheet", "height", options.height);
    detail::check_count("sheet", "columns", columns, 1, 1000);
    detail::check_count("sheet", "rows", rows, 1, 1000);
    const auto vertex = [&](Index row, Index column) { return row * (columns + 1) + column; };
    Points<double> x(3, vertex(rows + 1, 0));
    Triangles triangles(3, 2 * columns * rows);
    Eigen::Index f = 0;
    for (Index row = 0; row <= rows; ++row) {
        for (Index column = 0; column <= columns; ++column) {
            x.col(vertex(row, column)) << (2 * column - columns) * options.width / (2 * columns),
                (2 * row - rows) * options.height / (2 * rows), 0;
            if (row == rows || column == columns) continue;
            const Index lower_left = vertex(row, column), upper_right = vertex(row + 1, column + 1);
            triangles.col(f++) << lower_left, lower_left + 1, upper_right;
            triangles.col(f++) << lower_left, upper_right, upper_right - 1;
        }
    }
    return TriangleMesh<Scalar>(x.cast<Scalar>(), triangles);
}

template <Real Scalar>
TriangleMesh<Scalar> disc(const DiscOptions& options) {
    detail::check_length("disc", "radius", options.radius);
    detail::check_count("disc", "rings", options.rings, 1, 1000);
    return detail::concentric<Scalar>(options.rings, [&](Index ring, double angle) {
        const double distance = options.radius * ring / options.rings;
        return Vector3<double>(distance * std::cos(angle), distance * std::sin(angle), 0);
    });
}

template <Real Scalar>
TriangleMesh<Scalar> spherical_cap(const SphericalCapOptions& options) {
    const double radius = options.radius;
    detail::check_length("spherical_cap", "radius", radius);
    detail::check_length("spherical_cap", "diameter", options.diameter);
    detail::check_count("spherical_cap", "rings", options.rings, 1, 1000);
    if (options.diameter > 2 * radius) {
        refuse("spherical_cap", "diameter must be at most ", 2 * radius, " [m], twice the radius, got ",
               options.diameter);
    }
    const double rim = std::asin(options.diameter / (2 * radius));
    return detail::concentric<Scalar>(options.rings, [&](Index ring, double angle) {
        const double polar = rim * ring / options.rings, distance = radius * std::sin(polar);
        return Vector3<double>(distance * std::cos(angle), distance * std::sin(angle), radius * std::cos(polar));
    });
}

}  // namespace membrane
