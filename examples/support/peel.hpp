// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <membrane/haptics/device.hpp>
#include <membrane/model/material.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/plot.hpp"
#include "support/specimen.hpp"
#include "support/tension.hpp"

/// A membrane that forceps peel off the body under it.
namespace examples {

/// What is peeled, and how. The front is taken to be straight.
struct PeelScene {
    std::string name;
    membrane::TriangleMesh<double> mesh;
    Vector3d grip;                             ///< where the forceps take hold [m]
    Vector3d over = Vector3d::UnitX();         ///< unit vector: where the front goes
    Vector3d up = Vector3d::UnitZ();           ///< normal at `grip`
    double flap = 0, length = 0;               ///< from `grip` to the front, in the beginning and in the end [m]
    double angle = 0;                          ///< between what is drawn off and the bare surface [rad]
    std::function<double(double)> width = {};  ///< of the front at a distance from the border [m]; none: not known

    static constexpr double speed = 1e-3;                 ///< of the front [m/s]
    static constexpr double touched = 0.1, lifted = 1.1;  ///< times at which the flap is touched, and upright [s]

    /// Whether vertex `v` does not adhere.
    [[nodiscard]] bool in_flap(membrane::Index v) const {
        return over.dot(Vector3d(mesh.positions().col(v)) - grip) < flap;
    }
    /// From `grip` to the front [m].
    [[nodiscard]] double peeled(double time) const { return flap + speed * std::max(0.0, time - lifted); }
    [[nodiscard]] double end() const { return lifted + (length - flap) / speed; }

    /// The hand touches the flap and closes the forceps, turns the flap about the front, and follows the front.
    [[nodiscard]] std::vector<membrane::Waypoint<double>> script() const;
};

/// Mean length of the edges, were all triangles equilateral [m].
[[nodiscard]] inline double mean_edge(const membrane::TriangleMesh<double>& mesh) {
    double area = 0;
    for (const double each : membrane::vertex_areas(mesh)) area += each;
    return std::sqrt(4 / std::sqrt(3.0) * area / static_cast<double>(mesh.triangles().cols()));
}

inline std::vector<membrane::Waypoint<double>> PeelScene::script() const {
    constexpr int turns = 20;
    const double radius = mean_edge(mesh);
    const auto at = [&](double from_front, double turned) -> Vector3d {
        return grip + (0.98 * radius + from_front * std::sin(turned)) * up + from_front * (1 - std::cos(turned)) * over;
    };
    std::vector<membrane::Waypoint<double>> path{{0.0, grip + 2 * radius * up}};
    for (int i = 0; i <= turns; ++i) {
        const double share = double(i) / turns;
        path.push_back({touched + share * (lifted - touched), at(flap, share * angle), true});
    }
    path.push_back({end(), at(length, angle), true});
    return path;
}

/// A strip of 4 mm by 0.48 mm, peeled at 90 degrees.
[[nodiscard]] inline PeelScene strip_scene() {
    constexpr double width = 0.48e-3;
    constexpr membrane::Index columns = 50;
    return {.name = "strip",
            .mesh = membrane::sheet({.width = 4e-3, .height = width, .columns = columns, .rows = 6}),
            .grip = {-2e-3 + 4e-3 / columns, 0, 0},
            .flap = 0.6e-3,
            .length = 2.6e-3,
            .angle = std::numbers::pi / 2,
            .width = [](double) { return width; }};
}

/// A circle of 3 mm, peeled at 120 degrees.
[[nodiscard]] inline PeelScene circle_scene() {
    constexpr double radius = 1.5e-3;
    constexpr membrane::Index rings = 13;
    return {.name = "circle",
            .mesh = membrane::disc({.radius = radius, .rings = rings}),
            .grip = {-radius * (rings - 1) / rings, 0, 0},
            .flap = 0.4e-3,
            .length = 1.6e-3,
            .angle = 2 * std::numbers::pi / 3,
            .width = [](double from_border) { return 2 * std::sqrt(from_border * (2 * radius - from_border)); }};
}

/// A scene with a membrane from a file. Half of it is the flap.
[[nodiscard]] inline PeelScene peel_scene(const Specimen& body) {
    return {.name = "mesh",
            .mesh = membrane::TriangleMesh(body.surface.points, body.surface.triangles),
            .grip = body.above(0),
            .over = membrane::direction<double>(membrane::cross<double>(body.outward, {1, 3, 2}), body.outward).eigen(),
            .up = body.outward,
            .flap = 0.2 * body.size,
            .length = 0.5 * body.size,
            .angle = 2};
}

/// What a peel took.
struct Peeled {
    Curve force = {};                             ///< over the displacement of the forceps [mm], [mN]
    std::vector<Picture> states = {};             ///< before, during, after
    double peak = 0;                              ///< of the force [N]
    double work = 0, stored = 0, dissipated = 0;  ///< of the hand; in membrane and adhesion; by the damage [J]
    double area = 0;                              ///< that has let go [m^2]
    double seconds = 0;                           ///< of computation

    /// A tick.
    void add(const PeelScene& scene, const membrane::Points<double>& x, const membrane::Tool<double>& tool,
             const Vector3d& felt);

    /// Of the force, while the front makes the second half of its path [N].
    [[nodiscard]] double mean() const { return late_force_ / late_ticks_; }

    /// Mean of force * (1 - cos) / width then, by the force's own direction, as a part of `energy` [J/m^2].
    [[nodiscard]] double of_closed_form(double energy) const { return late_energy_ / late_ticks_ / energy; }

    /// energy * width / (1 - cos) while the front moves, in the units of `force`.
    [[nodiscard]] Curve closed_form(double energy) const {
        Curve curve = per_energy_;
        for (Sample& sample : curve) sample.y *= 1e3 * energy;
        return curve;
    }

  private:
    Curve per_energy_;
    Vector3d first_ = Vector3d::Zero(), last_ = first_, last_force_ = first_;
    double late_force_ = 0, late_energy_ = 0, late_ticks_ = 0;
};

inline void Peeled::add(const PeelScene& scene, const membrane::Points<double>& x, const membrane::Tool<double>& tool,
                        const Vector3d& felt) {
    const Vector3d at = tool.position;
    const double front = scene.peeled(tool.time);
    const bool late = front > (scene.flap + scene.length) / 2, last = tool.time > scene.end() - 1e-6;
    if (states.empty() && tool.grasping) first_ = at;
    if ((states.empty() && tool.grasping) || (states.size() == 1 && late) || (states.size() == 2 && last)) {
        states.push_back({.mesh = scene.mesh, .points = x, .tool = tool, .force = felt});
    }
    work -= (last_force_ + felt).dot(at - last_) / 2;
    last_ = at;
    last_force_ = felt;
    peak = std::max(peak, felt.norm());
    if (states.empty()) return;
    force.push_back({1e3 * (at - first_).norm(), 1e3 * felt.norm()});
    const double width =
        scene.width ? scene.width(front + mean_edge(scene.mesh)) : 0;  // `grip` is an edge from the end
    if (front > scene.flap) per_energy_.push_back({force.back().x, width / (1 - std::cos(scene.angle))});
    if (!late) return;
    ++late_ticks_;
    late_force_ += felt.norm();
    late_energy_ += (felt.norm() - felt.dot(scene.over)) / std::max(width, 1e-9);
}

/// The picture with the body bare under what has come off by more than `least` [m]: the rest surface, turned over.
[[nodiscard]] inline Picture with_bare_body(const Picture& picture, double least) {
    const membrane::Points<double>& rest = picture.mesh.positions();
    const Eigen::Index count = rest.cols(), all = picture.mesh.triangles().cols();
    const auto off = [&](membrane::Index v) { return (picture.points.col(v) - rest.col(v)).norm() > least; };
    membrane::Triangles triangles(3, 2 * all);
    triangles.leftCols(all) = picture.mesh.triangles();
    Eigen::Index used = all;
    for (Eigen::Index f = 0; f < all; ++f) {
        const Eigen::Matrix<membrane::Index, 3, 1> corners = triangles.col(f);
        if (!off(corners[0]) || !off(corners[1]) || !off(corners[2])) continue;
        triangles.col(used++) = corners.reverse().array() + static_cast<membrane::Index>(count);
    }
    membrane::Points<double> both(3, 2 * count), points(3, 2 * count);
    both << rest, rest;
    points << picture.points, rest;
    Picture result = picture;
    result.mesh = membrane::TriangleMesh<double>(both, triangles.leftCols(used).eval());
    result.points = points;
    Eigen::VectorXd values = Eigen::VectorXd::Zero(used);
    values.head(all) = *picture.values;
    result.values = values;
    return result;
}

/// A peel before, during and after, with the tension as colour.
[[nodiscard]] inline Figure peel_figure(const std::string& name, const membrane::Material& material,
                                        std::vector<Picture> states) {
    const auto& mesh = states.front().mesh;
    const auto sheet = membrane::triangular_springs(mesh, material, 1.0);
    const Vector3d low = mesh.positions().rowwise().minCoeff(), high = mesh.positions().rowwise().maxCoeff();
    const double width = (high - low).maxCoeff();
    double tension = 0, force = 0;
    for (Picture& state : states) {
        state.values = tensions(sheet, state.points);
        tension = std::max(tension, detail::quantile(*state.values, 0.98));
        force = std::max(force, state.force.norm());
    }
    Figure figure{.name = name,
                  .title = name + ": tension before, during and after the peel",
                  .camera = {.target = (low + high) / 2 + Vector3d(0, 0, 0.22 * width),
                             .azimuth = -28,
                             .elevation = 28,
                             .distance = 8 * width,
                             .metre = 250 / width},
                  .cell_height = 230};
    const std::vector<std::string> titles{"Flap held by forceps", "During the peel", "After"};
    for (std::size_t i = 0; i < states.size(); ++i) {
        states[i].arrow = 0.2 * width / force;
        states[i].colours = {
            .name = "mean tension", .unit = "N/m", .per_unit = 1, .low = 0, .high = std::ceil(100 * tension) / 100};
        figure.panels.push_back({titles[i], i == 0 ? std::to_string(mesh.vertex_count()) + " vertices" : "",
                                 with_bare_body(states[i], 0.02 * width)});
    }
    return figure;
}

}  // namespace examples
