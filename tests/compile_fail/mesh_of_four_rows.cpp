// SPDX-License-Identifier: MIT
// Homogeneous points, or any others of four rows.
// expect: positions must be 3 x V
// expect: transpose
#include <membrane/surface/triangle_mesh.hpp>

auto mesh(const Eigen::Matrix4Xd& positions, const Eigen::Matrix3Xi& triangles) {
#ifdef CORRECT
    return membrane::TriangleMesh(positions.topRows<3>(), triangles);
#else
    return membrane::TriangleMesh(positions, triangles);
#endif
}
