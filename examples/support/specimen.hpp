// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>

#include "support/command_line.hpp"
#include "support/mesh_file.hpp"

/// The membrane of an example: its own, or one from a file, of any size and position.
namespace examples {

/// A membrane, and the point of contact with a tool.
struct Specimen {
    Surface surface;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< Of its bounding box [m].
    double size = 0;                                   ///< Half of the middle one of its extents along x, y and z [m].
    membrane::Index vertex =
        0;  ///< The point of contact: if it has a rim, the vertex farthest from it, else the highest.
    Eigen::Vector3d outward = Eigen::Vector3d::UnitZ();  ///< Normal at `vertex`, of length 1.

    /// The centre of a sphere on the surface is `above(0)`; if `height` [sizes] is negative, deeper.
    [[nodiscard]] Eigen::Vector3d above(double height) const {
        return surface.points.col(vertex) + height * size * outward;
    }
    /// A radius for a tool [m].
    [[nodiscard]] double tool_radius() const { return 0.2 * size; }
    /// Vertices to clamp: those on the rim or, if there is none, the lower half.
    [[nodiscard]] std::vector<membrane::Index> rim() const;
};

/// @throws InvalidInput for a surface that is no membrane
[[nodiscard]] Specimen specimen_of(const membrane::TriangleMesh<double>& mesh);

/// The default membrane of the examples: a sphere of 642 vertices.
[[nodiscard]] membrane::TriangleMesh<double> stock_sphere();

/// The options `--mesh FILE` and `--unit UNIT`, the same for all examples.
struct MeshOptions {
    std::string file, unit = "m";

    void add_to(CommandLine& command);

    /// The membrane of the file, if one was named, or `stock`.
    /// @throws InvalidInput for a file that cannot be read, or holds no membrane
    [[nodiscard]] Specimen specimen(const membrane::TriangleMesh<double>& stock) const;
};

/// For a program that takes no other options: `stock_sphere`, or the membrane of the file.
[[nodiscard]] Specimen specimen(const std::string& purpose, int argc, char** argv);

}  // namespace examples
