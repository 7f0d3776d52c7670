// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include <membrane/core/types.hpp>

/// Surfaces from files. The library takes arrays and knows no file; the examples read their arrays by this.
///
///     const auto [points, triangles] = examples::read_mesh("lens.obj", 1e-3);  // in the file: millimetres
///     const auto mesh = membrane::TriangleMesh(points, triangles);
namespace examples {

/// A surface as arrays: the contents of a file, not checked for validity.
struct Surface {
    membrane::Points<double> points;  ///< 3 x V [m]
    membrane::Triangles triangles;
};

/// Reads Wavefront OBJ (by tinyobjloader, in double precision), and PLY, OFF and STL (by assimp, in single precision);
/// the file's ending says which. Vertices keep their order; those of STL, which repeats them in every triangle, are one
/// where all three coordinates are the same. Polygons become fans of triangles. Colours, normals, textures and
/// materials are ignored.
/// `unit` is the length of one unit of the file [m].
/// @throws InvalidInput for a file that is missing, malformed, or of a kind that the libraries misread; the
///   message names the file, and the line or element where there is one
[[nodiscard]] Surface read_mesh(const std::filesystem::path& file, double unit = 1);

}  // namespace examples
