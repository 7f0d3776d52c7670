// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <membrane/haptics/device.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/camera.hpp"
#include "support/plot.hpp"
#include "support/specimen.hpp"

/// The membranes of `press_and_pull`, and the motions of the tool.
namespace examples {

/// A membrane that is part of a sphere around the origin, or similar to one, with its tool.
struct Scene {
    std::string key, name;  ///< For files, and for people.
    membrane::TriangleMesh<double> mesh;
    std::vector<membrane::Index> pinned;
    double radius;                       ///< Of the membrane at rest [m].
    double tool_radius;                  ///< [m]
    double depth;                        ///< Of the press, and height of the pull [m].
    Vector3d pressed, slid;              ///< Unit vectors to the point of the press, and to the end of the slide.
    Camera::Options camera;              ///< Sees the tool from the side.
    Camera::Options camera_after;        ///< Sees the point of the press.
    Camera::Options film_camera = {};    ///< Sees both.
    double stiffness = 40;               ///< Of the springs [N/m].
    double foundation_stiffness = 4;     ///< Of the volume springs [N/m],
    double foundation_damping = 0.02;    ///< and their damping [N s/m].
    double picture_height;               ///< [px]
    std::string paper_figure = {};       ///< Empty where the paper has no such scene.
    double paper_frames = 0;             ///< A second, in [Liu07] 3; zero where the paper has no such scene.
    std::size_t film_interval = 0;       ///< Frames between the states of the film; 0: no film.
    bool uneven = false;                 ///< Not everywhere `radius` from the origin.
    Vector3d origin = Vector3d::Zero();  ///< Position of the scene's origin in the file of the mesh [m].

    /// Distance of the rest surface from the origin, in the direction of a unit vector [m].
    [[nodiscard]] double surface(const Vector3d& direction) const;
};

inline double Scene::surface(const Vector3d& direction) const {
    double farthest = 0;
    if (!uneven) return radius;
    for (const auto& corners : mesh.triangles().colwise()) {
        Eigen::Matrix3d edges;
        const Vector3d a = mesh.positions().col(corners[0]);
        edges << mesh.positions().col(corners[1]) - a, mesh.positions().col(corners[2]) - a, -direction;
        const Vector3d at = edges.fullPivLu().solve(-a);  // a + at[0] ab + at[1] ac = at[2] direction
        const bool hit = edges.determinant() != 0 && at[0] >= 0 && at[1] >= 0 && at[0] + at[1] <= 1;
        if (hit) farthest = std::max(farthest, at[2]);
    }
    return farthest > 0 ? farthest : radius;
}

/// A sphere as in the paper's figures 3 and 4.
[[nodiscard]] inline Scene sphere_scene(membrane::Index subdivisions, const std::string& paper_figure,
                                        double paper_frames) {
    auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = subdivisions});
    const Camera::Options camera{.elevation = 18, .distance = 0.08, .metre = 1.07e4};
    const Camera::Options above{.azimuth = 75, .elevation = 45, .distance = 0.08, .metre = 1.07e4};
    const std::string count = std::to_string(mesh.vertex_count());
    return {.key = "sphere_" + count,
            .name = "sphere, " + count + " vertices",
            .mesh = std::move(mesh),
            .pinned = {},
            .radius = 0.01,
            .tool_radius = 2.5e-3,
            .depth = 2e-3,
            .pressed = Camera(camera).seen(0.25, 0.80, 0.50),
            .slid = Camera(camera).seen(0.62, 0.72, 0.36),
            .camera = camera,
            .camera_after = above,
            .film_camera = {.azimuth = 30, .elevation = 42, .distance = 0.08},
            .picture_height = 236,
            .paper_figure = paper_figure,
            .paper_frames = paper_frames,
            .film_interval = 50};
}

/// A cap with a cornea's measures, its rim clamped.
[[nodiscard]] inline Scene cornea_scene() {
    auto mesh = membrane::spherical_cap<double>({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 12});
    const Camera::Options camera{.target = {0, 0, 5.45e-3}, .elevation = 20, .distance = 0.06, .metre = 2e4};
    const membrane::Adjacency adjacency(mesh);
    const auto rim = adjacency.border_vertices();
    const std::string count = std::to_string(mesh.vertex_count());
    return {.key = "cornea",
            .name = "cornea, " + count + " vertices",
            .mesh = std::move(mesh),
            .pinned = {rim.begin(), rim.end()},
            .radius = 7.8e-3,
            .tool_radius = 1.2e-3,
            .depth = 1e-3,
            .pressed = Vector3d(-0.05, -0.20, 0.96).normalized(),
            .slid = Vector3d(0.36, -0.10, 0.92).normalized(),
            .camera = camera,
            .camera_after = camera,
            .picture_height = 136};
}

/// The membrane of a file, with the origin below the point of contact.
[[nodiscard]] inline Scene file_scene(const Specimen& specimen) {
    const Vector3d origin = specimen.above(-1);
    auto mesh = membrane::TriangleMesh<double>(specimen.surface.points.colwise() - origin, specimen.surface.triangles);
    const Vector3d across = specimen.outward.unitOrthogonal();
    const Camera::Options camera{.target = specimen.centre - origin,
                                 .elevation = specimen.outward.z() < 0 ? -20.0 : 20.0,
                                 .distance = 8 * specimen.size,
                                 .metre = 100 / specimen.size};
    const std::string count = std::to_string(mesh.vertex_count());
    auto rim = membrane::border(mesh);
    return {.key = "file",
            .name = "mesh of " + count + " vertices",
            .mesh = std::move(mesh),
            .pinned = std::move(rim),
            .radius = specimen.size,
            .tool_radius = specimen.tool_radius(),
            .depth = 0.15 * specimen.size,
            .pressed = specimen.outward,
            .slid = (specimen.outward + 0.25 * across).normalized(),
            .camera = camera,
            .camera_after = camera,
            .picture_height = 236,
            .uneven = true,
            .origin = origin};
}

/// The paper's spheres and a cornea, or the membrane of the file.
[[nodiscard]] inline std::vector<Scene> scenes(const MeshOptions& options) {
    if (options.file.empty()) return {sphere_scene(2, "3", 84), sphere_scene(3, "4", 23), cornea_scene()};
    return {file_scene(options.specimen(stock_sphere()))};
}

/// One motion of the tool.
struct Move {
    std::string name;
    double duration;  ///< [s]
    Vector3d toward;  ///< Unit vector to its end,
    double height;    ///< and the height of the tool's surface above the membrane at rest [m].
    bool grasping = false;
};

/// Indices of the moves of press and pull together, and of their phases and snapshots.
enum Step : std::size_t { approach, press_in, slide, let_go, recover, touch, pull_out, open, recover_again };

[[nodiscard]] inline std::vector<Move> press_moves(const Scene& scene) {
    const double away = 0.7 * scene.depth;
    return {{"approach", 0.15, scene.pressed, 0},
            {"press", 0.25, scene.pressed, -scene.depth},
            {"slide", 0.35, scene.slid, -scene.depth},
            {"let go", 0.15, scene.slid, away},
            {"recover", 0.25, scene.slid, away}};
}

[[nodiscard]] inline std::vector<Move> pull_moves(const Scene& scene) {
    const double away = 1.7 * scene.depth;
    return {{"grasp", 0.15, scene.slid, -0.1 * scene.depth},
            {"pull", 0.30, scene.slid, scene.depth, true},
            {"let go", 0.15, scene.slid, away},
            {"recover", 0.25, scene.slid, away}};
}

[[nodiscard]] inline std::vector<Move> joined(std::vector<Move> first, const std::vector<Move>& then) {
    first.insert(first.end(), then.begin(), then.end());
    return first;
}

/// Moves as the script of a device, with the name and time of each phase.
struct Motion {
    std::vector<membrane::Waypoint<double>> script;
    std::vector<Phase> phases;
};

/// The moves one after the other from `start` [s], each with zero velocity at its ends, `speed_factor` times as fast.
/// If the tool stands still, the time is not shortened, because the membrane recovers no faster.
[[nodiscard]] inline Motion motion(const Scene& scene, const std::vector<Move>& moves, double speed_factor,
                                   double start = 0) {
    constexpr int steps = 40;  // of a move
    Motion result;
    double time = start, height = 0.7 * scene.depth;
    Vector3d toward = moves.front().toward;
    const auto position = [&](const Vector3d& direction, double above) {
        const Vector3d unit = direction.normalized();
        return Vector3d((scene.surface(unit) + scene.tool_radius + above) * unit);
    };
    for (const Move& move : moves) {
        const bool still = move.toward == toward && move.height == height;
        const double duration = still ? move.duration : move.duration / speed_factor;
        for (int i = 0; i < steps; ++i) {
            const double s = static_cast<double>(i) / steps, share = s * s * (3 - 2 * s);
            result.script.push_back(
                {time + s * duration,
                 position(toward + share * (move.toward - toward), height + share * (move.height - height)),
                 move.grasping});
        }
        result.phases.push_back({move.name, time, time + duration});
        time += duration;
        toward = move.toward;
        height = move.height;
    }
    result.script.push_back({time, position(toward, height)});
    return result;
}

}  // namespace examples
