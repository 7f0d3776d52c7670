// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "truth_flat.hpp"

/// Rigid balls without friction, pressed into the flat disc: one in the middle, or two at once.
namespace bench::truth {

inline constexpr double start_gap = 0.01;  // between ball and sheet before the press, in radii

/// Directions of a quarter of a ball's lower side, the angle from its bottom as the distance from the origin: fine
/// where contact begins.
[[nodiscard]] inline ShellMesh ball_directions(int across) {
    const Zone around{.radius = 1.2, .rings = 2 * across, .growth = std::pow(12.0, 0.5 / across)};
    return quarter_disc({.across = across, .core = 0.1, .zones = {around}});
}

/// Quads that are fine under a ball in the middle.
[[nodiscard]] inline QuarterDiscOptions ball_disc(int across, double radius) {
    const Zone under{.radius = radius, .rings = 2 * across};
    const Zone outside{
        .radius = disc_radius, .rings = 3 * across / 2, .growth = std::pow(disc_radius / radius, 1.0 / across)};
    return {.across = across, .core = 0.25 * radius, .zones = {under, outside}};
}

/// The quarter of the disc, in quads that are fine under a ball at (x, 0).
[[nodiscard]] inline ShellMesh disc_around(int across, double radius, double x) {
    const Zone under{.radius = radius, .rings = 2 * across};
    const Zone outside{
        .radius = 2 * radius, .rings = 3 * across / 2, .growth = std::pow(disc_radius / radius, 1.0 / across)};
    ShellMesh half = mirrored(quarter_disc({.across = across, .core = 0.25 * radius, .zones = {under, outside}}), 0);
    const double right = std::numbers::pi / 2, corner = std::atan2(disc_radius, -x);  // seen from the ball
    const auto on_border = [&](double angle) -> Vector3 {  // of the quarter, whose corner is at a right angle
        if (angle == right) return {0, disc_radius, 0};
        const double turned = angle * corner / right, rest = (std::numbers::pi - angle) * (2 - corner / right);
        if (angle > right) return {0, x * std::tan(rest), 0};
        const double beside = x * std::sin(turned);
        const double distance = std::sqrt(disc_radius * disc_radius - beside * beside) - x * std::cos(turned);
        return {x + distance * std::cos(turned), distance * std::sin(turned), 0};
    };
    for (Vector3& node : half.nodes) {
        double part = std::max(0.0, node.norm() / radius - 1);  // 0 under the ball, 1 at the border
        if (part > 1 - 1e-9) part = 1;
        const Vector3 inside = Vector3(x, 0, 0) + node / (1 + part);
        node = (1 - part) * inside + part * on_border(std::atan2(node.y(), node.x()));
    }
    return half;
}

/// What carries the contact of the ball.
enum class Carried {
    by_default,  ///< vertices, where triangles are fine
    by_faces,    ///< faces alone
    corrected,   ///< faces, the ball moved back by `FacetCorrection`
};

/// A ball at (x, 0), to be compared with another program; if x is not 0, a second one at (-x, 0) does the same.
struct BallScene {
    double radius, x;            ///< [m]
    std::vector<double> depths;  ///< of the lowest point under the flat sheet, in radii

    /// The force on the ball at each depth [mN], in the limit of a membrane unless `part` of the thickness is 1.
    [[nodiscard]] Column calculix(const Effort& effort, const std::string& name, double part) const;

    /// The same by the library.
    [[nodiscard]] std::vector<double> forces(const Mesh& mesh, Carried kind = Carried::by_default) const;
};

inline Column BallScene::calculix(const Effort& effort, const std::string& name, double part) const {
    return compared(name, effort.across, [&](int across) {
        const ShellSection section = section_of(soft).thinned(part);
        const int fine = 3 * across / 2;
        FlatShell shell(x == 0 ? quarter_disc(ball_disc(fine, radius)) : disc_around(fine, radius, x), section,
                        {{"BALL", 1, 3, 0}});
        // What touches is the shell's upper side, half its thickness off the middle.
        const Vector3 bottom(x, 0, section.thickness / 2 + start_gap * radius);
        const ShellMesh quarter = ball_directions(3 * across);
        shell.scene.add_ball("BALL", bottom, radius - section.thickness / 2, x == 0 ? quarter : mirrored(quarter, 0));
        for (const double depth : depths) {
            shell.add_step({{"BALL", 1, 2, 0}, {"BALL", 3, 3, -(depth + start_gap) * radius}});
        }
        shell.scene.print("BALL");
        const auto results = shell.scene.run(effort.folder, "ball" + std::to_string(across));
        const double parts = x == 0 ? 4 : 2;
        return collected(depths, [&](int i) { return -parts * 1e3 * results.force("BALL", i + 2).z(); });
    });
}

inline std::vector<double> BallScene::forces(const Mesh& mesh, Carried kind) const {
    Sheet sheet = flat_sheet(mesh);
    if (kind != Carried::by_default) sheet.fine_triangles = 0;
    Points position = mesh.positions();
    std::vector<double> found;
    for (const double depth : depths) {
        Tool ball{.position = {x, 0, (1 - depth) * radius}, .radius = radius};
        std::vector<Tool> tools{ball};
        ball.position.x() = -x;
        if (x != 0) tools.push_back(ball);
        const auto equilibrium = kind == Carried::corrected ? sheet.corrected_equilibrium(position, tools)
                                                            : sheet.equilibrium(position, tools);
        position = equilibrium.x;
        found.push_back(1e3 * equilibrium.reactions[0].z());
    }
    return found;
}

/// The disc of rings with its inner vertices moved by `offset` in the middle and less towards the rim.
[[nodiscard]] inline Mesh shifted_disc(const Mesh& mesh, const Vector3& offset) {
    Points x = mesh.positions();
    for (auto position : x.colwise()) {
        position += (1 - position.squaredNorm() / (disc_radius * disc_radius)) * offset.eigen();
    }
    return {x, mesh.triangles()};
}

/// Over a vertex, the middle of an edge and the middle of a triangle.
struct Placement {
    std::string name;
    Mesh mesh;
};

[[nodiscard]] inline std::vector<Placement> placements(int rings) {
    const Mesh mesh = disc_with_patch(rings);
    const auto corners = mesh.triangles().col(0);
    const auto& x = mesh.positions();
    return {{"over a vertex", mesh},
            {"over an edge", shifted_disc(mesh, -(x.col(corners[0]) + x.col(corners[1])) / 2)},
            {"over a face", shifted_disc(mesh, -(x.col(corners[0]) + x.col(corners[1]) + x.col(corners[2])) / 3)}};
}

/// A ball of this radius, 1 % from a depth of a tenth of it on.
[[nodiscard]] inline Comparison ball(const Effort& effort, const std::string& key, const std::string& title,
                                     double radius) {
    Comparison table{.key = key,
                     .title = title,
                     .load = "depth [radii]",
                     .quantity = "force [mN]",
                     .bound = 0.01,
                     .bound_from = 0.1,
                     .bounded = 3,
                     .loads = effort.some({0.02, 0.05, 0.1, 0.2, 0.5})};
    const BallScene scene{.radius = radius, .x = 0, .depths = table.loads};
    table.reference = scene.calculix(effort, "CalculiX", 0.1);
    const auto fine = placements(effort.rings), coarse = placements(effort.rings / 2);
    for (std::size_t i = 0; i < fine.size(); ++i) {
        table.ours.push_back(single(fine[i].name, [&] { return scene.forces(fine[i].mesh); }));
        table.ours.back().coarse = scene.forces(coarse[i].mesh);
    }
    for (const auto& [name, mesh] : fine) {
        table.ours.push_back(single(name + ", by faces", [&] { return scene.forces(mesh, Carried::by_faces); }));
        table.ours.push_back(
            single(name + ", by faces, corrected", [&] { return scene.forces(mesh, Carried::corrected); }));
    }
    const Mesh graded = disc_for_loads(effort.rings, {{.radius = radius / 2}});
    const std::string name = "graded by DistMesh, " + vertices_of(graded);
    table.ours.push_back(single(name, [&] { return scene.forces(graded); }));
    table.explained = name;
    table.ours.push_back(
        single(name + ", by faces, corrected", [&] { return scene.forces(graded, Carried::corrected); }));
    return table;
}

[[nodiscard]] inline Comparison small_ball(const Effort& effort) {
    return ball(effort, "ball_a", "6a. A ball of 0.5 mm", 0.5e-3);
}
[[nodiscard]] inline Comparison middle_ball(const Effort& effort) {
    return ball(effort, "ball_b", "6b. A ball of 1 mm", 1e-3);
}
[[nodiscard]] inline Comparison large_ball(const Effort& effort) {
    return ball(effort, "ball_c", "6c. A ball of 2 mm", 2e-3);
}

[[nodiscard]] inline Comparison two_balls(const Effort& effort) {
    Comparison table{.key = "tools",
                     .title = "9. Two balls of 1 mm at once, 3 mm apart",
                     .load = "depth [radii]",
                     .quantity = "force on each [mN]",
                     .bound = 0.01,
                     .bound_from = 0.1,
                     .loads = effort.some({0.1, 0.2, 0.5})};
    const BallScene scene{.radius = 1e-3, .x = 1.5e-3, .depths = table.loads};
    table.reference = scene.calculix(effort, "CalculiX", 0.1);
    table.ours.push_back(
        compared(effort.rings_name(), effort.rings, [&](int rings) { return scene.forces(disc_with_patch(rings)); }));
    const Mesh mesh = disc_with_patch(effort.rings);
    table.ours.push_back(single("by faces", [&] { return scene.forces(mesh, Carried::by_faces); }));
    table.ours.push_back(single("by faces, corrected", [&] { return scene.forces(mesh, Carried::corrected); }));
    const Mesh graded = disc_for_loads(effort.rings, {{.centre = {scene.x, 0, 0}, .radius = scene.radius / 2},
                                                      {.centre = {-scene.x, 0, 0}, .radius = scene.radius / 2}});
    table.explained = "graded by DistMesh, " + vertices_of(graded);
    table.ours.push_back(single(table.explained, [&] { return scene.forces(graded); }));
    table.ours.push_back(
        single(table.explained + ", by faces, corrected", [&] { return scene.forces(graded, Carried::corrected); }));
    return table;
}

}  // namespace bench::truth
