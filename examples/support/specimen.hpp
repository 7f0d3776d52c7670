// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <membrane/mesh/adjacency.hpp>
#include <membrane/mesh/normals.hpp>
#include <membrane/mesh/shapes.hpp>
#include <membrane/mesh/surface_facts.hpp>

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

namespace detail {

/// The vertex that takes the most edges to the rim; of several, the one nearest to `centre`.
inline membrane::Index farthest_from_rim(const membrane::Adjacency& adjacency, const membrane::Points<double>& x,
                                         const Eigen::Vector3d& centre) {
    std::vector<membrane::Index> front(adjacency.border_vertices().begin(), adjacency.border_vertices().end()), next;
    std::vector<char> reached(static_cast<std::size_t>(x.cols()));
    const auto reach = [&](membrane::Index v) {
        return std::exchange(reached[static_cast<std::size_t>(v)], char{1}) == 0;
    };
    for (const membrane::Index v : front) reach(v);
    while (true) {
        next.clear();
        for (const membrane::Index v : front) {
            for (const membrane::Index w : adjacency.neighbours(v)) {
                if (reach(w)) next.push_back(w);
            }
        }
        if (next.empty()) break;
        front.swap(next);
    }
    const auto distance = [&](membrane::Index v) { return (x.col(v) - centre).squaredNorm(); };
    return *std::min_element(front.begin(), front.end(), [&](auto v, auto w) { return distance(v) < distance(w); });
}

}  // namespace detail

/// @throws InvalidInput for a surface that is no membrane
[[nodiscard]] inline Specimen specimen_of(const membrane::TriangleMesh<double>& mesh) {
    const auto& x = mesh.positions();
    const Eigen::Vector3d low = x.rowwise().minCoeff(), high = x.rowwise().maxCoeff();
    Eigen::Vector3d extent = high - low;
    std::sort(extent.begin(), extent.end());
    Specimen specimen{.surface = {x, mesh.triangles()}, .centre = (low + high) / 2, .size = extent[1] / 2};
    const membrane::Adjacency adjacency(mesh);
    if (adjacency.closed()) {
        const auto corners = mesh.triangles().reshaped();
        specimen.vertex =
            *std::max_element(corners.begin(), corners.end(), [&](auto v, auto w) { return x(2, v) < x(2, w); });
    } else {
        specimen.vertex = detail::farthest_from_rim(adjacency, x, specimen.centre);
    }
    specimen.outward = membrane::VertexNormals(mesh).values().col(specimen.vertex);
    return specimen;
}

inline std::vector<membrane::Index> Specimen::rim() const {
    auto result = membrane::border(membrane::TriangleMesh(surface.points, surface.triangles));
    const Eigen::RowVectorXd height = outward.transpose() * surface.points;
    const double middle = (height.minCoeff() + height.maxCoeff()) / 2;
    if (!result.empty()) return result;
    for (membrane::Index v = 0; v < height.size(); ++v) {
        if (height[v] < middle) result.push_back(v);
    }
    return result;
}

/// What the examples press if no file is named: a sphere of 642 vertices.
[[nodiscard]] inline membrane::TriangleMesh<double> stock_sphere() {
    return membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});  // [m]
}

/// The options `--mesh FILE` and `--unit UNIT`, the same for all examples.
struct MeshOptions {
    std::string file, unit = "m";

    void add_to(CLI::App& app) {
        app.add_option("--mesh", file, "another membrane: a file .obj, .ply, .stl or .off");
        app.add_option("--unit", unit, "of the numbers in that file: m, cm, mm, um or inch")
            ->check(CLI::IsMember({"m", "cm", "mm", "um", "inch"}))
            ->capture_default_str();
    }

    /// The membrane of the file, if one was named, or `stock`.
    /// @throws InvalidInput for a file that cannot be read, or holds no membrane
    [[nodiscard]] Specimen specimen(const membrane::TriangleMesh<double>& stock) const {
        if (file.empty()) return specimen_of(stock);
        const auto metres =
            std::map<std::string, double>{{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"inch", 0.0254}};
        const Surface surface = read_mesh(file, metres.at(unit));
        const membrane::TriangleMesh mesh(surface.points, surface.triangles);
        doubt_unit(mesh.positions());
        return specimen_of(mesh);
    }

  private:
    /// A note, if it looks as if the unit had been forgotten.
    void doubt_unit(const membrane::Points<double>& x) const {
        const double size = (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff();
        if (membrane::likely_unit(size) != membrane::LengthUnit::millimetre) return;
        std::cerr << "note: " << file << " is " << size << " m large; in millimetres? --unit mm\n";
    }
};

/// For a program that takes no other options: `stock_sphere`, or the membrane of the file.
[[nodiscard]] inline Specimen specimen(const std::string& purpose, int argc, char** argv) {
    CLI::App app(purpose);
    MeshOptions options;
    options.add_to(app);
    Specimen result;
    run_first(app, argc, argv, [&] { result = options.specimen(stock_sphere()); });
    return result;
}

}  // namespace examples
