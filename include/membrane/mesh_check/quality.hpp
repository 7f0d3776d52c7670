// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/triangle.hpp>

/// Quality of the triangles of a mesh.
///
///     const auto quality = membrane::quality_of(mesh);
///     if (quality.smallest_angle < 30) ...                     // degrees
namespace membrane {

/// Angles [degrees] and edges of a mesh.
struct MeshQuality {
    double smallest_angle = 0;       ///< Smallest angle of all triangles.
    double mean_smallest_angle = 0;  ///< Mean of each triangle's smallest angle: 60 if all are equilateral.
    double mean_edge = 0;            ///< [m]
    double even_edges = 0;           ///< Fraction of the edges with a length within 25 % of the mean.
};

/// Computed in double. O(F log F).
template <Real Scalar>
[[nodiscard]] MeshQuality quality_of(const TriangleMesh<Scalar>& mesh) {
    using Vector = Vector3<double>;
    const auto at = [&](Index v) { return Vector(point(mesh.positions(), v).template cast<double>()); };
    MeshQuality quality{.smallest_angle = 180};
    for (const auto& corner : mesh.triangles().colwise()) {
        double smallest = 180;
        for (int k = 0; k < 3; ++k) {
            const Vector p = at(corner[k]), next = at(corner[(k + 1) % 3]) - p, last = at(corner[(k + 2) % 3]) - p;
            const double angle = std::atan2(norm(cross(next, last)), dot(next, last));
            smallest = (std::min)(smallest, angle * 180 / std::numbers::pi);
        }
        quality.smallest_angle = (std::min)(quality.smallest_angle, smallest);
        quality.mean_smallest_angle += smallest / mesh.triangle_count();
    }
    std::vector<double> lengths;
    const Adjacency adjacency(mesh);
    for (const auto& [first, second] : adjacency.edges()) lengths.push_back(norm<double>(at(second) - at(first)));
    const auto count = static_cast<double>(lengths.size());
    for (const double length : lengths) quality.mean_edge += length / count;
    for (const double length : lengths) {
        if (std::abs(length - quality.mean_edge) <= 0.25 * quality.mean_edge) quality.even_edges += 1 / count;
    }
    return quality;
}

}  // namespace membrane
