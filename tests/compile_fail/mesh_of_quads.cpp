// SPDX-License-Identifier: MIT
// Four corners to a face.
// expect: triangles must be 3 x F
// expect: cut quads into triangles
#include <membrane/surface/triangle_mesh.hpp>

#ifdef CORRECT
inline constexpr int corners = 3;
#else
inline constexpr int corners = 4;
#endif

auto mesh(const Eigen::Matrix3Xd& positions, const Eigen::Matrix<int, corners, Eigen::Dynamic>& faces) {
    return membrane::TriangleMesh(positions, faces);
}
