// SPDX-License-Identifier: MIT
//
// The paper's figure 2: the unit sphere of its signed distance, by truss forces in 200 iterations, with edges of 0.4
// and 0.1. Prints how even the triangles are, and draws them.
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <string>

#include <membrane/mesh_check/quality.hpp>
#include <membrane/meshing/distmesh.hpp>

#include "support/camera.hpp"
#include "support/picture.hpp"
#include "support/specimen.hpp"
#include "support/svg.hpp"

using namespace examples;

constexpr double half = 300, head = 46;  // of a square picture, of the margin above it [px]

double paper_sphere(const membrane::Vector3<double>& p) { return membrane::norm(p) - 1; }  // [m]

void print(const membrane::TriangleMesh<double>& mesh) {
    const auto quality = membrane::quality_of(mesh);
    std::cout << "  " << mesh.vertex_count() << " vertices, " << mesh.triangle_count() << " triangles; smallest angle "
              << quality.smallest_angle << ", mean smallest angle " << quality.mean_smallest_angle
              << " degrees; mean edge " << quality.mean_edge << ", " << 100 * quality.even_edges
              << " % of the edges within 25 % of it\n";
}

membrane::TriangleMesh<double> mesh_of(double length, membrane::Index iterations) {
    const membrane::Bounds bounds{{-1, -1, -1}, {1, 1, 1}};
    const auto show = [&](const membrane::RemeshProgress& now) {
        if (now.iteration % 50 != 0) return;
        std::cout << "h = " << length << ": iteration " << now.iteration << " of " << now.iterations << ", "
                  << now.vertices << " vertices, farthest move " << now.movement << " h" << std::endl;
    };
    const auto mesh = membrane::distmesh(
        paper_sphere, {.edge_length = length, .bounds = bounds, .iterations = iterations, .progress = show});
    print(mesh);
    return mesh;
}

void draw_panel(Svg& svg, int panel, const membrane::TriangleMesh<double>& mesh, double length) {
    const double left = 2 * half * panel;
    const Camera camera(
        {.azimuth = 20, .elevation = 20, .distance = 8, .metre = 0.93 * half, .middle = {left + half, head + half}});
    const std::string letter = panel == 0 ? "a" : "b";
    draw(svg, camera, Picture{.mesh = mesh, .points = mesh.positions(), .tool = {}}, "sphere" + letter);
    svg.text({left + 14, 24}, letter, {.size = 15, .colour = "#111", .bold = true});
    svg.text({left + 32, 24}, "h = " + number(length), {.size = 14, .colour = "#111"});
    svg.text({left + 32, 40},
             std::to_string(mesh.vertex_count()) + " vertices, " + std::to_string(mesh.triangle_count()) + " triangles",
             {.size = 11, .colour = "#666"});
}

int main(int argc, char** argv) {
    auto folder = std::filesystem::path(argv[0]).parent_path() / "pictures";
    membrane::Index iterations = 200;
    CommandLine command("Makes a sphere of triangles from its signed distance, coarse and fine, and draws both.");
    MeshOptions other;
    other.add_to(command);
    command.add("--out", folder, "folder for figure_2_distmesh.svg");
    command.add("--iterations", iterations, "at most");
    return command.run(argc, argv, [&] {
        std::cout << std::setprecision(3);
        if (!other.file.empty()) {
            const Surface surface = other.specimen(stock_sphere()).surface;
            std::cout << other.file << ":\n";
            print({surface.points, surface.triangles});
        }
        Svg svg(4 * half, 2 * half + head, "The unit sphere by DistMesh, h = 0.4 and h = 0.1");
        int panel = 0;
        for (const double length : {0.4, 0.1}) draw_panel(svg, panel++, mesh_of(length, iterations), length);
        std::filesystem::create_directories(folder);
        const auto file = folder / "figure_2_distmesh.svg";
        save(file, svg.str());
        std::cout << "picture: " << file.string() << std::endl;
    });
}
