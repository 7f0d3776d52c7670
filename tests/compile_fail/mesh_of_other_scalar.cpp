// SPDX-License-Identifier: MIT
// Float positions for a mesh of doubles.
// expect: positions must be of the mesh's own scalar
// expect: cast
#include <membrane/surface/triangle_mesh.hpp>

auto mesh(const Eigen::Matrix3Xf& positions, const Eigen::Matrix3Xi& triangles) {
#ifdef CORRECT
    return membrane::TriangleMesh<double>(positions.cast<double>(), triangles);
#else
    return membrane::TriangleMesh<double>(positions, triangles);
#endif
}
