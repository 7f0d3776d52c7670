// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <membrane/core/types.hpp>
#include <membrane/surface/half_edges.hpp>
#include <membrane/surface/mesh_checks.hpp>

/// What is left of any numbers that are said to be a mesh: what `validate` and `repair` look at.
///
///     const auto mesh = membrane::detail::workable(positions, triangles, found);  // calls found(...) as `soundness` does
namespace membrane::detail {

/// A mesh as far as one can work with it.
struct CheckedMesh {
    Points<double> x;
    Triangles triangles;          // `no_index` where they do not name three vertices
    std::vector<Index> named;     // the others
    std::vector<Index> points;    // vertices one can compute with
    std::vector<bool> measured;   // triangles of such
    std::vector<HalfEdge> sides;  // of those named
    double spacing = 0;           // of numbers at the largest coordinate [m]
    bool has_size = false;
};

/// The columns `some` of `triangles`.
[[nodiscard]] inline Triangles selected(const Triangles& triangles, std::span<const Index> some) {
    Triangles result(3, static_cast<Eigen::Index>(some.size()));
    for (std::size_t i = 0; i < some.size(); ++i) result.col(static_cast<Eigen::Index>(i)) = triangles.col(some[i]);
    return result;
}

/// The sides of the triangles `some`, numbered as they are.
[[nodiscard]] inline std::vector<HalfEdge> half_edges_of(const Triangles& triangles, std::span<const Index> some) {
    std::vector<HalfEdge> sides = half_edges(selected(triangles, some));
    for (HalfEdge& side : sides) side.triangle = some[static_cast<std::size_t>(side.triangle)];
    return sides;
}

/// Positions as they are, and with which of them one can compute.
template <Real Scalar>
struct StoredPoints {
    Points<Scalar> x;
    std::vector<bool> usable;
    std::vector<Index> points;  // the usable ones
    Scalar largest = 0;         // magnitude of a usable coordinate [m]

    template <class P, class Found>
    StoredPoints(const P& positions, Found found)
        : x(3, positions.cols()), usable(static_cast<std::size_t>(positions.cols())) {
        if (x.size() > 0) x = positions;  // none may be of any shape
        for (Index v = 0; v < x.cols(); ++v) {
            usable[static_cast<std::size_t>(v)] = check_point(x, v, largest, found);
            if (usable[static_cast<std::size_t>(v)]) points.push_back(v);
        }
    }
};

/// @pre the shapes are checked
template <class P, class T, class Found>
CheckedMesh workable(const P& positions, const T& triangles, Found found) {
    using Scalar = typename P::Scalar;
    const StoredPoints<Scalar> stored(positions, found);
    CheckedMesh mesh;
    mesh.x = stored.x.template cast<double>();
    mesh.points = stored.points;
    mesh.triangles = Triangles::Constant(3, triangles.cols(), no_index);
    mesh.measured.assign(static_cast<std::size_t>(triangles.cols()), false);
    std::vector<Index> measured;
    for (Index f = 0; f < triangles.cols(); ++f) {
        if (!check_corners(triangles, f, mesh.x.cols(), found)) continue;
        mesh.named.push_back(f);
        bool all = true;
        for (Index k = 0; k < 3; ++k) {
            mesh.triangles(k, f) = static_cast<Index>(triangles(k, f));
            all = all && stored.usable[static_cast<std::size_t>(mesh.triangles(k, f))];
        }
        mesh.measured[static_cast<std::size_t>(f)] = all;
        if (all) measured.push_back(f);
    }
    mesh.has_size =
        !measured.empty() && check_size(stored.x, selected(mesh.triangles, measured), stored.largest, found);
    mesh.sides = half_edges_of(mesh.triangles, mesh.named);
    mesh.spacing = static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * static_cast<double>(stored.largest);
    return mesh;
}

}  // namespace membrane::detail
