// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <membrane/tissue/material.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/peel_scene.hpp"
#include "support/plot.hpp"
#include "support/specimen.hpp"
#include "support/tension.hpp"

/// What a peel takes, and its pictures.
namespace examples {

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
    Curve force = {};                   ///< over the displacement of the forceps [mm], [mN]
    std::vector<Picture> states = {};   ///< before, during, after
    double peak = 0;                    ///< of the force [N]
    double work = 0, stored = 0;        ///< of the hand; in membrane and adhesion [J]
    double dissipated = 0, damped = 0;  ///< by the damage; by a fluid [J]
    double area = 0;                    ///< that has let go [m^2]
    double seconds = 0;                 ///< of computation

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
