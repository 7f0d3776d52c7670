// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <membrane/core/types.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/mesh_checks.hpp>

/// The usable part of arbitrary positions and triangles, for `validate` and `repair`.
///
///     const auto mesh = membrane::detail::workable(positions, triangles, found);  // calls found(...) for defects
namespace membrane::detail {

/// A mesh that may have defects.
struct CheckedMesh {
    Points<double> x;
    Triangles triangles;            // `no_index` for those without three different valid vertices
    std::vector<Index> referenced;  // triangles with three different valid vertices
    std::vector<Index> points;      // vertices with usable coordinates
    std::vector<bool> finite;       // whether all corners of triangle f are usable
    std::vector<HalfEdge> sides;    // of the triangles `referenced`
    double spacing = 0;             // of floating-point numbers at the largest coordinate [m]
    bool has_size = false;
};

/// The columns `some` of `triangles`.
[[nodiscard]] inline Triangles selected(const Triangles& triangles, std::span<const Index> some) {
    Triangles result(3, static_cast<Eigen::Index>(some.size()));
    for (std::size_t i = 0; i < some.size(); ++i) result.col(static_cast<Eigen::Index>(i)) = triangles.col(some[i]);
    return result;
}

/// The half-edges of the triangles `some`, with their indices in `triangles`.
[[nodiscard]] inline std::vector<HalfEdge> half_edges_of(const Triangles& triangles, std::span<const Index> some) {
    std::vector<HalfEdge> sides = half_edges(selected(triangles, some));
    for (HalfEdge& side : sides) side.triangle = some[static_cast<std::size_t>(side.triangle)];
    return sides;
}

/// Positions as stored, and which of them are usable: finite and not too large.
template <Real Scalar>
struct StoredPoints {
    Points<Scalar> x;
    std::vector<bool> usable;
    std::vector<Index> points;  // indices of the usable ones
    Scalar largest = 0;         // magnitude of a usable coordinate [m]

    template <class P, class Found>
    StoredPoints(const P& positions, Found found)
        : x(3, positions.cols()), usable(static_cast<std::size_t>(positions.cols())) {
        if (x.size() > 0) x = positions;  // an empty matrix may have any shape
        for (Index v = 0; v < x.cols(); ++v) {
            usable[static_cast<std::size_t>(v)] = check_point(x, v, largest, found);
            if (usable[static_cast<std::size_t>(v)]) points.push_back(v);
        }
    }
};

/// Reports defects to `found`. @pre the shapes are checked
template <class P, class T, class Found>
CheckedMesh workable(const P& positions, const T& triangles, Found found) {
    using Scalar = typename P::Scalar;
    const StoredPoints<Scalar> stored(positions, found);
    CheckedMesh mesh;
    mesh.x = stored.x.template cast<double>();
    mesh.points = stored.points;
    mesh.triangles = Triangles::Constant(3, triangles.cols(), no_index);
    mesh.finite.assign(static_cast<std::size_t>(triangles.cols()), false);
    std::vector<Index> finite;
    for (Index f = 0; f < triangles.cols(); ++f) {
        if (!check_corners(triangles, f, mesh.x.cols(), found)) continue;
        mesh.referenced.push_back(f);
        bool all = true;
        for (Index k = 0; k < 3; ++k) {
            mesh.triangles(k, f) = static_cast<Index>(triangles(k, f));
            all = all && stored.usable[static_cast<std::size_t>(mesh.triangles(k, f))];
        }
        mesh.finite[static_cast<std::size_t>(f)] = all;
        if (all) finite.push_back(f);
    }
    mesh.has_size = !finite.empty() && check_size(stored.x, selected(mesh.triangles, finite), stored.largest, found);
    mesh.sides = half_edges_of(mesh.triangles, mesh.referenced);
    mesh.spacing = static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * static_cast<double>(stored.largest);
    return mesh;
}

}  // namespace membrane::detail
