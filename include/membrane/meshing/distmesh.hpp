// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>

#include <membrane/meshing/isosurface.hpp>
#include <membrane/meshing/level_surface.hpp>
#include <membrane/meshing/remesh.hpp>
#include <membrane/meshing/signed_distance.hpp>
#include <membrane/surface/triangle_mesh.hpp>

/// Surfaces from signed distances: the mesh generation of the paper.
///
///     #include <membrane/meshing/distmesh.hpp>
///     const auto sphere = membrane::distmesh(membrane::Ball{.radius = 1}, {.edge_length = 0.1});
///     const auto bowl   = membrane::distmesh(membrane::trimmed(membrane::Ball{.radius = 1}, membrane::HalfSpace{}),
///                                            {.edge_length = 0.1});                  // the lower half, with a border
///     const auto own    = membrane::distmesh([](const membrane::Vector3<double>& p) { return norm(p) - 1; },
///                                            {.edge_length = 0.1,
///                                             .bounds = membrane::Bounds{{-1, -1, -1}, {1, 1, 1}}});
namespace membrane {

/// Options of `distmesh`.
struct DistMeshOptions {
    EdgeLength edge_length = {};         ///< Target length [m], or a function of the position. Required.
    std::optional<Bounds> bounds = {};   ///< Box around the surface [m]; required if the body has no bounds of its own.
    Index iterations = 200;              ///< Upper limit; the default is the paper's.
    std::optional<double> spacing = {};  ///< Cell size of the initial grid [m], see `distmesh`.
    std::function<void(const RemeshProgress&)> progress = {};  ///< Called after each iteration.
};

/// The surface of a body, closed and facing outward; of a `trimmed` body the part within, with a border. Equal input
/// gives equal bits. [Liu07] 2.1 after [Persson04], with these differences. Points start from an `isosurface` instead
/// of a random choice from a grid. The triangulation is repaired by flips on the surface; Delaunay tetrahedra would
/// have to be sorted into inside and outside. Edges are split and collapsed, so that the mean edge is close to
/// `edge_length` for any start.
///
/// Each vertex is within 1e-10 of the size of the bounds from the surface, a border vertex from both surfaces. If the
/// surface is smooth and edges are at most 0.6 of its radii of curvature, all angles are above 30 degrees, and the mean
/// of the triangles' smallest angles is 53 degrees. 95 % of the edges are within 25 % of their mean, and the mean is
/// within 20 % of `edge_length` (measured on hundreds of random bodies, with a constant length). Edges and corners of
/// the body are not followed: triangles cut them off, and near edges sharper than a right angle triangles can be bad.
/// If edges are longer than the body is thin, triangles may intersect.
///
/// The default `spacing` is 0.8 of the smallest edge length at 17^3 points, but at most a twelfth of the shortest side
/// of the bounds. Features smaller than the spacing can be lost.
///
/// @throws InvalidInput if bounds are missing, not finite, empty, or farther from 0 than 1e7 times their size; if
/// `iterations` is below 0; if a spacing or edge length is not finite and positive; for errors of `isosurface`
/// Cost: O(grid) + O(vertices) for each iteration: 0.3 s for 1,500 vertices and 200 iterations. A body much thinner
/// than the edges are long starts with many more vertices than remain, at 20 us each: then use a wider `spacing`.
template <Real Scalar = double, class Body>
    requires(!detail::is_trimmed<Body> && CheckedSignedDistance<Body>)
[[nodiscard]] TriangleMesh<Scalar> distmesh(Body body, const DistMeshOptions& options);

/// The surface of a trimmed body, with a border.
template <Real Scalar = double, CheckedSignedDistance Body, SignedDistance Within>
[[nodiscard]] TriangleMesh<Scalar> distmesh(const Trimmed<Body, Within>& surface, const DistMeshOptions& options);

namespace detail {

inline constexpr std::string_view distmesh_name = "distmesh";

template <class Surface>
[[nodiscard]] Bounds checked_bounds(const Surface& surface, const DistMeshOptions& options) {
    Bounds bounds = options.bounds ? *options.bounds : bounds_of(surface);
    for (int k = 0; k < 3; ++k) {
        const double low = bounds.low[k], high = bounds.high[k];
        if (is_finite(low) && is_finite(high) && low < high) continue;
        refuse(distmesh_name, "bounds along ", std::string_view("xyz").substr(static_cast<std::size_t>(k), 1),
               " must be finite, low below high [m], got ", low, " to ", high,
               options.bounds ? "" : "; give bounds where the body has none");
    }
    const double largest_coordinate = bounds.low.cwiseAbs().cwiseMax(bounds.high.cwiseAbs()).maxCoeff();
    const double most = 1e7 * (bounds.high - bounds.low).maxCoeff();
    if (largest_coordinate > most) {
        refuse(distmesh_name, "bounds must be within 1e7 times their size of 0, here ", most,
               " [m], or numbers are too coarse for the surface, got ", largest_coordinate);
    }
    return bounds;
}

[[nodiscard]] inline double spacing_for(const Bounds& bounds, const DistMeshOptions& options) {
    if (options.spacing) {
        check_option(distmesh_name, *options.spacing, "spacing", "m", false);
        return *options.spacing;
    }
    constexpr int steps = 16;
    const Vector3<double> size = bounds.high - bounds.low;
    double least = size.minCoeff() / 12;
    for (int i = 0; i <= steps; ++i) {
        for (int j = 0; j <= steps; ++j) {
            for (int k = 0; k <= steps; ++k) {
                const Vector3<double> part = Vector3<double>(i, j, k) / steps;
                least = (std::min)(least, 0.8 * options.edge_length(bounds.low + size.cwiseProduct(part)));
            }
        }
    }
    return least;
}

template <Real Scalar, class Surface>
[[nodiscard]] TriangleMesh<Scalar> distmesh(const Surface& surface, const DistMeshOptions& options) {
    if (options.iterations < 0) refuse(distmesh_name, "iterations must be at least 0, got ", options.iterations);
    const Bounds bounds = checked_bounds(surface, options);
    const double spacing = spacing_for(bounds, options);
    const auto level = LevelSurface(surface, bounds);
    const auto mesh =
        remesh(isosurface(level, bounds, spacing), level, options.edge_length, options.iterations, options.progress);
    return TriangleMesh<Scalar>(mesh.positions().template cast<Scalar>(), mesh.triangles());
}

}  // namespace detail

template <Real Scalar, class Body>
    requires(!detail::is_trimmed<Body> && CheckedSignedDistance<Body>)
TriangleMesh<Scalar> distmesh(Body body, const DistMeshOptions& options) {
    return detail::distmesh<Scalar>(body, options);
}

template <Real Scalar, CheckedSignedDistance Body, SignedDistance Within>
TriangleMesh<Scalar> distmesh(const Trimmed<Body, Within>& surface, const DistMeshOptions& options) {
    return detail::distmesh<Scalar>(surface, options);
}

}  // namespace membrane
