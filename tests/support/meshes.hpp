// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include <membrane/surface/shapes.hpp>
#include <membrane/surface/triangle_mesh.hpp>

#include "support/random.hpp"
#include "support/refusal.hpp"

/// Surfaces to change before they become a mesh.
///
///     auto surface = test::random_surface<double>(random);
///     surface.triangles(0, 3) = 1000;
///     CHECK(test::refusal([&] { surface.mesh(); }) == "...");
namespace test {

template <membrane::Real Scalar>
struct Surface {
    membrane::Points<Scalar> x;
    membrane::Triangles triangles;

    membrane::TriangleMesh<Scalar> mesh() const { return {x, triangles}; }
    membrane::Index vertex_count() const { return static_cast<membrane::Index>(x.cols()); }
    membrane::Index triangle_count() const { return static_cast<membrane::Index>(triangles.cols()); }

    membrane::Index add(const membrane::Vector3<Scalar>& point) {
        x.conservativeResize(3, x.cols() + 1);
        x.col(x.cols() - 1) = point;
        return vertex_count() - 1;
    }
    membrane::Index add(membrane::Index a, membrane::Index b, membrane::Index c) {
        triangles.conservativeResize(3, triangles.cols() + 1);
        triangles.col(triangles.cols() - 1) << a, b, c;
        return triangle_count() - 1;
    }
    /// The triangles and vertices of `other` beside these.
    void add(const Surface& other) {
        const membrane::Index vertices = vertex_count(), first = triangle_count();
        x.conservativeResize(3, x.cols() + other.x.cols());
        x.rightCols(other.x.cols()) = other.x;
        triangles.conservativeResize(3, first + other.triangles.cols());
        triangles.rightCols(other.triangles.cols()) = other.triangles.array() + vertices;
    }
    void remove_triangle(membrane::Index f) {
        triangles.col(f) = triangles.col(triangles.cols() - 1).eval();
        triangles.conservativeResize(3, triangles.cols() - 1);
    }
    void turn(membrane::Index f) { std::swap(triangles(0, f), triangles(1, f)); }
};

/// A sphere of this radius [m] whose edges at the -z pole are `k` times as long as on an even one, at the +z pole a
/// `k`-th: a Moebius map draws the vertices to one pole.
inline membrane::TriangleMesh<double> graded_sphere(double radius, int subdivisions, double k) {
    const auto mesh = membrane::icosphere<double>({.radius = radius, .subdivisions = subdivisions});
    membrane::Points<double> x = mesh.positions();
    for (auto at : x.colwise()) {
        const double z = at.z() / radius, along = ((k * k + 1) * z + k * k - 1) / ((k * k - 1) * z + k * k + 1);
        const double across = std::sqrt(std::max(0.0, 1 - along * along)), from = std::hypot(at.x(), at.y());
        if (from > 0) at << across / from * at.x() * radius, across / from * at.y() * radius, along * radius;
    }
    return {x, mesh.triangles()};
}

template <membrane::Real Scalar>
Surface<Scalar> surface_of(const membrane::TriangleMesh<Scalar>& mesh) {
    return {mesh.positions(), mesh.triangles()};
}

inline std::vector<membrane::Index> random_order(membrane::Index count, Random& random) {
    std::vector<membrane::Index> order(static_cast<std::size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    for (membrane::Index i = count; i > 1; --i) {
        std::swap(order[static_cast<std::size_t>(i - 1)], order[static_cast<std::size_t>(random.index(i))]);
    }
    return order;
}

/// The same surface with vertices and triangles in another order and other first corners.
template <membrane::Real Scalar>
Surface<Scalar> shuffled(const Surface<Scalar>& surface, Random& random) {
    Surface<Scalar> result = surface;
    const auto vertices = random_order(surface.vertex_count(), random);
    const auto triangles = random_order(surface.triangle_count(), random);
    for (membrane::Index v = 0; v < surface.vertex_count(); ++v) {
        result.x.col(vertices[static_cast<std::size_t>(v)]) = surface.x.col(v);
    }
    for (membrane::Index f = 0; f < surface.triangle_count(); ++f) {
        const membrane::Index first = random.index(3);
        for (membrane::Index k = 0; k < 3; ++k) {
            result.triangles(k, triangles[static_cast<std::size_t>(f)]) =
                vertices[static_cast<std::size_t>(surface.triangles((k + first) % 3, f))];
        }
    }
    return result;
}

/// A flat disc of 10 m, all triangles around its middle, vertex 0.
template <membrane::Real Scalar>
Surface<Scalar> fan(membrane::Index triangles) {
    Surface<Scalar> surface{membrane::Points<Scalar>(3, triangles + 1), membrane::Triangles(3, triangles)};
    surface.x.col(0).setZero();
    for (membrane::Index i = 0; i < triangles; ++i) {
        const double angle = 2 * std::numbers::pi * i / triangles;
        surface.x.col(i + 1) << static_cast<Scalar>(10 * std::cos(angle)), static_cast<Scalar>(10 * std::sin(angle)), 0;
        surface.triangles.col(i) << 0, 1 + i, 1 + (i + 1) % triangles;
    }
    return surface;
}

/// A flat strip of equilateral triangles along x, `columns` edges long and `rows` triangles wide.
template <membrane::Real Scalar>
membrane::TriangleMesh<Scalar> triangle_strip(membrane::Index columns, membrane::Index rows, double edge) {
    const double height = edge * std::sqrt(3.0) / 2;
    Surface<Scalar> strip;
    for (membrane::Index j = 0; j <= rows; ++j) {
        for (membrane::Index i = 0; i <= columns; ++i)
            strip.add({Scalar(edge * (i + (j % 2) / 2.0)), Scalar(height * j), Scalar(0)});
    }
    const auto at = [&](membrane::Index i, membrane::Index j) { return j * (columns + 1) + i; };
    for (membrane::Index j = 0; j < rows; ++j) {
        for (membrane::Index i = 0; i < columns; ++i) {
            const membrane::Index a = at(i, j), b = at(i + 1, j), c = at(i, j + 1), d = at(i + 1, j + 1);
            strip.add(a, b, j % 2 == 0 ? c : d);
            strip.add(j % 2 == 0 ? b : a, d, c);
        }
    }
    return strip.mesh();
}

/// An irregular flat sheet of the unit square, inner vertices moved by up to 0.3 of a square.
inline membrane::TriangleMesh<double> irregular_sheet(membrane::Index squares, Random& random) {
    auto surface = surface_of(membrane::sheet({.width = 1, .height = 1, .columns = squares, .rows = squares}));
    const double side = 1.0 / squares;
    for (membrane::Index v = 0; v < surface.vertex_count(); ++v) {
        const bool inside = surface.x.col(v).head<2>().cwiseAbs().maxCoeff() < 0.5 - side / 2;
        if (inside) surface.x.col(v).head<2>() += 0.3 * side * random.vector(-1.0, 1.0).eigen().head<2>();
    }
    return surface.mesh();
}

/// A closed surface: an icosphere of 12 to 162 vertices, jittered, turned, moved, shuffled, 1 mm to 10 m large.
template <membrane::Real Scalar>
Surface<Scalar> random_closed_surface(Random& random) {
    Surface<Scalar> surface = surface_of(membrane::icosphere<Scalar>({.radius = 1, .subdivisions = random.index(3)}));
    const auto size = static_cast<Scalar>(std::pow(10, random.number(-3.0, 1.0)));
    surface.x = size * (random.rotation<Scalar>() * jittered(surface.x, Scalar(0.03), random));
    surface.x.colwise() += size * random.vector<Scalar>().eigen();
    return shuffled(surface, random);
}

/// A surface with a border: a sheet, disc or cap, jittered, turned, moved, shuffled, 1 mm to 10 m large.
template <membrane::Real Scalar>
Surface<Scalar> random_open_surface(Random& random) {
    Surface<Scalar> surface;
    switch (const membrane::Index n = 1 + random.index(5); random.index(3)) {
        case 0:
            surface = surface_of(membrane::sheet<Scalar>({.width = 1, .height = 1, .columns = n, .rows = 6 - n}));
            break;
        case 1: surface = surface_of(membrane::disc<Scalar>({.radius = 1, .rings = n})); break;
        default: surface = surface_of(membrane::spherical_cap<Scalar>({.radius = 1, .diameter = 1.5, .rings = n}));
    }
    const auto size = static_cast<Scalar>(std::pow(10, random.number(-3.0, 1.0)));
    surface.x = size * (random.rotation<Scalar>() * jittered(surface.x, Scalar(0.03), random));
    surface.x.colwise() += size * random.vector<Scalar>().eigen();
    return shuffled(surface, random);
}

template <membrane::Real Scalar>
Surface<Scalar> random_surface(Random& random) {
    return random.chance(0.5) ? random_closed_surface<Scalar>(random) : random_open_surface<Scalar>(random);
}

/// The surface with holes, ragged borders and perhaps several parts and isolated vertices, still one that is accepted.
template <membrane::Real Scalar>
Surface<Scalar> with_holes(Surface<Scalar> surface, Random& random) {
    const membrane::Index most = surface.triangle_count() / 2;
    for (membrane::Index removed = 0; removed < most; ++removed) {
        Surface<Scalar> smaller = surface;
        smaller.remove_triangle(random.index(smaller.triangle_count()));
        if (refusal([&] { (void)smaller.mesh(); }).empty()) surface = smaller;
    }
    return surface;
}

/// A triangle and a side of it that another triangle shares.
template <membrane::Real S>
std::array<membrane::Index, 3> inner_side(const Surface<S>& surface, Random& random) {
    for (;;) {
        const membrane::Index f = random.index(surface.triangle_count()), k = random.index(3);
        const membrane::Index from = surface.triangles(k, f), to = surface.triangles((k + 1) % 3, f);
        for (membrane::Index g = 0; g < surface.triangle_count(); ++g) {
            for (membrane::Index i = 0; i < 3; ++i) {
                if (surface.triangles(i, g) == to && surface.triangles((i + 1) % 3, g) == from) return {f, g, k};
            }
        }
    }
}

/// A band of `count` squares, closed to a ring with a twist.
template <membrane::Real S>
Surface<S> moebius_strip(membrane::Index count) {
    Surface<S> strip;
    for (membrane::Index i = 0; i < count; ++i) {
        const S turn = 2 * std::numbers::pi_v<S> * S(i) / S(count);
        const membrane::Vector3<S> centre(std::cos(turn), std::sin(turn), 0);
        const membrane::Vector3<S> half =
            S(0.3) * membrane::Vector3<S>(std::cos(turn / 2) * std::cos(turn), std::cos(turn / 2) * std::sin(turn),
                                          std::sin(turn / 2));
        strip.add(membrane::Vector3<S>(centre - half));
        strip.add(membrane::Vector3<S>(centre + half));
    }
    for (membrane::Index i = 0; i < count; ++i) {
        const membrane::Index a = 2 * i, b = a + 1;
        const membrane::Index c = i + 1 < count ? a + 2 : 1, d = i + 1 < count ? a + 3 : 0;
        strip.add(a, c, b);
        strip.add(b, c, d);
    }
    return strip;
}

/// A torus of squares whose last column is joined to the first upside down.
template <membrane::Real S>
Surface<S> klein_bottle(membrane::Index columns, membrane::Index rows, bool twisted = true) {
    Surface<S> surface;
    for (membrane::Index i = 0; i < columns; ++i) {
        for (membrane::Index j = 0; j < rows; ++j) {
            const S u = 2 * std::numbers::pi_v<S> * S(i) / S(columns), v = 2 * std::numbers::pi_v<S> * S(j) / S(rows);
            surface.add(
                membrane::Vector3<S>((2 + std::cos(v)) * std::cos(u), (2 + std::cos(v)) * std::sin(u), std::sin(v)));
        }
    }
    const auto vertex = [&](membrane::Index i, membrane::Index j) {
        const membrane::Index row = i < columns || !twisted ? j % rows : (2 * rows - j) % rows;
        return (i % columns) * rows + row;
    };
    for (membrane::Index i = 0; i < columns; ++i) {
        for (membrane::Index j = 0; j < rows; ++j) {
            surface.add(vertex(i, j), vertex(i + 1, j), vertex(i, j + 1));
            surface.add(vertex(i, j + 1), vertex(i + 1, j), vertex(i + 1, j + 1));
        }
    }
    return surface;
}

template <membrane::Real S>
Surface<S> tetrahedron() {
    Surface<S> result;
    result.x.resize(3, 4);
    result.x << 0, 1, 0, 0,  //
        0, 0, 1, 0,          //
        0, 0, 0, 1;
    result.triangles.resize(3, 4);
    result.triangles << 0, 0, 0, 1,  //
        2, 1, 3, 2,                  //
        1, 3, 2, 3;
    return result;
}

}  // namespace test
