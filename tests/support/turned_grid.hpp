// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <vector>

#include "support/cgal.hpp"
#include "support/meshes.hpp"

/// Rectangles on grids of any direction.
///
///     const auto surface = test::turned_grid<double>(40, 20, 1e-3, 0.3);  // 40 mm x 20 mm
namespace test {

/// A rectangle of `columns` x `rows` edges [m], from the origin on, on a grid of equilateral triangles that is turned
/// by `turn` [rad]; its border is straight. Triangulated by CGAL.
template <membrane::Real Scalar>
Surface<Scalar> turned_grid(int columns, int rows, double edge, double turn) {
    const double length = columns * edge, height = rows * edge, cosine = std::cos(turn), sine = std::sin(turn);
    std::vector<double> points;
    const auto insert = [&](double x, double y) { points.insert(points.end(), {x, y}); };
    for (int i = 0; i <= columns; ++i) {
        for (const double y : {0.0, height}) insert(i * edge, y);
    }
    for (int i = 1; i < rows; ++i) {
        for (const double x : {0.0, length}) insert(x, i * edge);
    }
    const int extent = columns + rows;
    for (int i = -extent; i <= extent; ++i) {
        for (int j = -extent; j <= extent; ++j) {
            const double a = (i + j / 2.0 + 0.3) * edge, b = (j * std::sqrt(0.75) + 0.4) * edge;
            const double x = length / 2 + cosine * a - sine * b, y = height / 2 + sine * a + cosine * b;
            const double gap = 0.6 * edge;
            if (x > gap && x < length - gap && y > gap && y < height - gap) insert(x, y);
        }
    }
    const Eigen::Map<const Eigen::Matrix2Xd> grid(points.data(), 2, static_cast<membrane::Index>(points.size() / 2));
    Surface<Scalar> surface;
    for (const auto& p : grid.colwise()) {
        surface.add(membrane::Vector3<Scalar>(static_cast<Scalar>(p.x()), static_cast<Scalar>(p.y()), 0));
    }
    const membrane::Triangles triangles = cgal_delaunay(grid);
    for (const auto& corner : triangles.colwise()) {
        const membrane::Index f = surface.add(corner[0], corner[1], corner[2]);
        const auto x = membrane::triangle_at(surface.x, surface.triangles.col(f));
        if (!(norm(membrane::area_vector(x)) > 1e-3 * edge * edge)) surface.remove_triangle(f);
    }
    return surface;
}

}  // namespace test
