// SPDX-License-Identifier: MIT
#include "support/specimen.hpp"

#include <algorithm>
#include <cstddef>
#include <iostream>
#include <map>
#include <utility>

#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/shapes.hpp>

namespace examples {

namespace {

/// The vertex with the most edges to the rim; of several, the one nearest to `centre`.
membrane::Index farthest_from_rim(const membrane::Adjacency& adjacency, const membrane::Points<double>& x,
                                  const Eigen::Vector3d& centre) {
    std::vector<membrane::Index> front(adjacency.border_vertices().begin(), adjacency.border_vertices().end()), next;
    std::vector<char> is_visited(static_cast<std::size_t>(x.cols()));
    const auto visit = [&](membrane::Index v) {
        return std::exchange(is_visited[static_cast<std::size_t>(v)], char{1}) == 0;
    };
    for (const membrane::Index v : front) visit(v);
    while (true) {
        next.clear();
        for (const membrane::Index v : front) {
            for (const membrane::Index w : adjacency.neighbours(v)) {
                if (visit(w)) next.push_back(w);
            }
        }
        if (next.empty()) break;
        front.swap(next);
    }
    const auto distance = [&](membrane::Index v) { return (x.col(v) - centre).squaredNorm(); };
    return *std::min_element(front.begin(), front.end(), [&](auto v, auto w) { return distance(v) < distance(w); });
}

/// Prints a note if the unit was probably forgotten.
void doubt_unit(const std::string& file, const membrane::Points<double>& x) {
    const double size = (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff();
    if (membrane::likely_unit(size) != membrane::LengthUnit::millimetre) return;
    std::cerr << "note: " << file << " is " << size << " m large; in millimetres? --unit mm\n";
}

}  // namespace

Specimen specimen_of(const membrane::TriangleMesh<double>& mesh) {
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
        specimen.vertex = farthest_from_rim(adjacency, x, specimen.centre);
    }
    specimen.outward = membrane::VertexNormals(mesh).values().col(specimen.vertex);
    return specimen;
}

std::vector<membrane::Index> Specimen::rim() const {
    auto result = membrane::border(membrane::TriangleMesh(surface.points, surface.triangles));
    const Eigen::RowVectorXd height = outward.transpose() * surface.points;
    const double middle = (height.minCoeff() + height.maxCoeff()) / 2;
    if (!result.empty()) return result;
    for (membrane::Index v = 0; v < height.size(); ++v) {
        if (height[v] < middle) result.push_back(v);
    }
    return result;
}

membrane::TriangleMesh<double> stock_sphere() {
    return membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});  // [m]
}

void MeshOptions::add_to(CommandLine& command) {
    command.add("--mesh", file, "another membrane: a file .obj, .ply, .stl or .off");
    command.add_word("--unit", unit, {"m", "cm", "mm", "um", "inch"},
                     "of the numbers in that file: m, cm, mm, um or inch");
}

Specimen MeshOptions::specimen(const membrane::TriangleMesh<double>& stock) const {
    if (file.empty()) return specimen_of(stock);
    const auto metres =
        std::map<std::string, double>{{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"inch", 0.0254}};
    const Surface surface = read_mesh(file, metres.at(unit));
    const membrane::TriangleMesh mesh(surface.points, surface.triangles);
    doubt_unit(file, mesh.positions());
    return specimen_of(mesh);
}

Specimen specimen(const std::string& purpose, int argc, char** argv) {
    CommandLine command(purpose);
    MeshOptions options;
    options.add_to(command);
    Specimen result;
    command.run_first(argc, argv, [&] { result = options.specimen(stock_sphere()); });
    return result;
}

}  // namespace examples
