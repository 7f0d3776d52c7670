// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <membrane/surface/triangle_mesh.hpp>

/// Our meshes as those of CGAL, the oracle of many tests.
namespace test {

using CgalKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalPoint = CgalKernel::Point_3;
using CgalMesh = CGAL::Surface_mesh<CgalPoint>;

template <membrane::Real Scalar>
CgalPoint cgal_point(const membrane::Vector3<Scalar>& point) {
    return {static_cast<double>(point.x()), static_cast<double>(point.y()), static_cast<double>(point.z())};
}

/// With the same numbers of vertices and triangles. Vertices come first to last, so that the handles count as ours do.
template <class Positions>
CgalMesh cgal_mesh(const Positions& x, const membrane::Triangles& triangles) {
    CgalMesh result;
    for (membrane::Index v = 0; v < x.cols(); ++v) result.add_vertex(cgal_point(membrane::point(x, v)));
    for (const auto& corner : triangles.colwise()) {
        using Handle = CgalMesh::Vertex_index;
        const auto handle = [&](int k) { return Handle(static_cast<Handle::size_type>(corner[k])); };
        result.add_face(handle(0), handle(1), handle(2));
    }
    return result;
}

template <membrane::Real Scalar>
CgalMesh cgal_mesh(const membrane::TriangleMesh<Scalar>& mesh) {
    return cgal_mesh(mesh.positions(), mesh.triangles());
}

/// Triangles as CGAL's functions on polygon soups take them.
inline std::vector<std::array<std::size_t, 3>> cgal_soup(const membrane::Triangles& triangles) {
    std::vector<std::array<std::size_t, 3>> result;
    for (const auto& corner : triangles.colwise()) {
        const auto vertex = [&](int k) { return static_cast<std::size_t>(corner[k]); };
        result.push_back({vertex(0), vertex(1), vertex(2)});
    }
    return result;
}

}  // namespace test
