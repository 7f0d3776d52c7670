// SPDX-License-Identifier: MIT
// Triangles that name their vertices by floating-point numbers.
// expect: triangles must be of an integer type
#include <membrane/surface/triangle_mesh.hpp>

auto mesh(const Eigen::Matrix3Xd& positions, const Eigen::Matrix3Xd& triangles) {
#ifdef CORRECT
    return membrane::TriangleMesh(positions, triangles.cast<int>());
#else
    return membrane::TriangleMesh(positions, triangles);
#endif
}
