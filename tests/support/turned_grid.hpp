// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <map>

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include "support/meshes.hpp"

/// Rectangles on grids of any direction.
///
///     const auto surface = test::turned_grid<double>(40, 20, 1e-3, 0.3);  // 40 mm x 20 mm
namespace test {

/// A rectangle of `columns` x `rows` edges [m], from the origin on, on a grid of equilateral triangles that is turned
/// by `turn` [rad]; its border is straight. Triangulated by CGAL.
template <membrane::Real Scalar>
Surface<Scalar> turned_grid(int columns, int rows, double edge, double turn) {
    using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
    using Delaunay = CGAL::Delaunay_triangulation_2<Kernel>;
    const double length = columns * edge, height = rows * edge, cosine = std::cos(turn), sine = std::sin(turn);
    Delaunay delaunay;
    for (int i = 0; i <= columns; ++i) {
        for (const double y : {0.0, height}) delaunay.insert({i * edge, y});
    }
    for (int i = 0; i <= rows; ++i) {
        for (const double x : {0.0, length}) delaunay.insert({x, i * edge});
    }
    const int extent = columns + rows;
    for (int i = -extent; i <= extent; ++i) {
        for (int j = -extent; j <= extent; ++j) {
            const double a = (i + j / 2.0 + 0.3) * edge, b = (j * std::sqrt(0.75) + 0.4) * edge;
            const double x = length / 2 + cosine * a - sine * b, y = height / 2 + sine * a + cosine * b;
            const double gap = 0.6 * edge;
            if (x > gap && x < length - gap && y > gap && y < height - gap) delaunay.insert({x, y});
        }
    }
    Surface<Scalar> surface;
    std::map<Delaunay::Vertex_handle, membrane::Index> number;
    for (auto v = delaunay.finite_vertices_begin(); v != delaunay.finite_vertices_end(); ++v) {
        const auto x = static_cast<Scalar>(v->point().x()), y = static_cast<Scalar>(v->point().y());
        number[v] = surface.add(membrane::Vector3<Scalar>(x, y, 0));
    }
    for (auto f = delaunay.finite_faces_begin(); f != delaunay.finite_faces_end(); ++f) {
        const auto at = [&](int i) { return number[f->vertex(i)]; };
        const membrane::Index f0 = surface.add(at(0), at(1), at(2));
        const auto x = membrane::triangle_at(surface.x, surface.triangles.col(f0));
        if (!(norm(membrane::area_vector(x)) > 1e-3 * edge * edge)) surface.remove_triangle(f0);
    }
    return surface;
}

}  // namespace test
