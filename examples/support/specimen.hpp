// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>

#include "support/command_line.hpp"
#include "support/mesh_file.hpp"

/// The membrane an example works on: its own, or one from a file, whatever its size and place.
namespace examples {

/// A membrane, and where a tool meets it.
struct Specimen {
    Surface surface;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< Of the box around it [m].
    double size = 0;  ///< Half of its extent along x, y or z, whichever is neither the longest nor the shortest [m].
    membrane::Index vertex =
        0;  ///< Where it is met: the highest, or that which is farthest from the rim if it has one.
    Eigen::Vector3d outward = Eigen::Vector3d::UnitZ();  ///< There, of length 1.

    /// A sphere's centre is `above(0)` when it is on the surface, deeper where `height` [sizes] is negative.
    [[nodiscard]] Eigen::Vector3d above(double height) const {
        return surface.points.col(vertex) + height * size * outward;
    }
    /// A radius for a tool [m].
    [[nodiscard]] double tool_radius() const { return 0.2 * size; }
    /// What can be clamped: the vertices on the rim, or the lower half where there is no rim.
    [[nodiscard]] std::vector<membrane::Index> rim() const;
};

/// @throws InvalidInput for a surface that is no membrane
[[nodiscard]] Specimen specimen_of(const membrane::TriangleMesh<double>& mesh);

/// What the examples press if no file is named: a sphere of 642 vertices.
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
