// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include <membrane/tissue/triangular_springs.hpp>

#include "support/capsulorhexis.hpp"
#include "support/opening.hpp"
#include "support/plot.hpp"
#include "support/tension.hpp"

/// What a capsulorhexis took: force, energies, the opening, pictures.
namespace examples {

/// The membrane with its tension as colour, the ball under it, and the forceps with the force on them. What has come
/// off is taken away.
[[nodiscard]] inline Picture picture_of(const RhexisScene& scene, const Capsulorhexis& operation,
                                        const Forceps& forceps, const Vector& felt) {
    const auto& surface = operation.tear().surface();
    const auto& x = operation.x();
    const Opening opening = opening_of(scene, surface);
    const auto ball = scene.ball_under_opening();
    const Eigen::Index count = surface.triangles().cols(),
                       under = scene.ball_stiffness > 0 ? ball.triangles().cols() : 0;
    const Eigen::VectorXd tension = tensions(operation.sheet(), x);
    membrane::Triangles triangles(3, count + under);
    Eigen::VectorXd values = Eigen::VectorXd::Zero(count + under);
    Eigen::Index used = 0;
    for (Eigen::Index f = 0; f < count; ++f) {
        if (opening.circularity > 0 && opening.inside[static_cast<std::size_t>(f)]) continue;
        triangles.col(used) = surface.triangles().col(f);
        values[used++] = tension[f];
    }
    triangles.middleCols(used, under) =
        ball.triangles().leftCols(under).array() + static_cast<membrane::Index>(x.cols());
    used += under;
    membrane::Points<double> rest(3, x.cols() + ball.vertex_count()), points = rest;
    rest << surface.rest_positions(), ball.positions();
    points << x, ball.positions();
    for (Eigen::Index v = 0; v < x.cols(); ++v) {  // the flap lies on the membrane: drawn a little above, to hide it
        if ((points.col(v) - rest.col(v)).norm() > scene.radius / 6)
            points.col(v) += scene.radius / 12 * scene.axis.eigen();
    }
    Picture picture{.mesh = {rest, triangles.leftCols(used)}, .points = points};
    picture.values = values.head(used).eval();
    if (opening.circularity > 0) return picture;
    picture.tool = membrane::Tool<double>{.position = forceps.position(), .radius = scene.edge / 2};
    picture.force = felt.eigen();
    return picture;
}

/// What a capsulorhexis took.
struct Opened {
    Curve force = {};             ///< on the forceps over the torn length [mm], [mN]
    std::vector<Picture> states;  ///< before, during, after
    double work = 0;              ///< of the hand [J]
    double stored = 0, torn = 0;  ///< in membrane, ball and opening edges; by the tear [J]
    double damped = 0;            ///< by a fluid [J]
    double slipped = 0;           ///< by slip out of the forceps as they open [J]
    double length = 0;            ///< torn [m]
    double circularity = 0;       ///< of the opening
    double seconds = 0;           ///< of computation
    int ticks = 0, grasps = 0;
    int converged = 0;  ///< ticks after which no residual force exceeded a hundredth of what the forceps feel

    /// A tick.
    void add(const RhexisScene& scene, const Capsulorhexis& operation, const Forceps& forceps, const Vector& felt);

    ///@{
    /// Of the force that is felt: root of the mean square, largest [N]. Mean angle between it and the tear [rad].
    [[nodiscard]] double rms() const { return std::sqrt(squares_ / held_ticks_); }
    [[nodiscard]] double peak() const { return peak_; }
    [[nodiscard]] double angle() const { return angles_ / advances_; }
    ///@}

  private:
    void add_force(const Tear& tear, const Forceps& forceps, const Vector& felt);

    Vector last_ = Vector::Zero(), last_slip_ = last_, last_force_ = last_;
    bool held_ = false;
    double squares_ = 0, held_ticks_ = 0, peak_ = 0, angles_ = 0, advances_ = 0;
};

inline void Opened::add(const RhexisScene& scene, const Capsulorhexis& operation, const Forceps& forceps,
                        const Vector& felt) {
    const auto& tear = operation.tear();
    const auto& x = operation.x();
    if (forceps.closed()) add_force(tear, forceps, felt);
    stored = operation.body().energy(x) + tear.stored(x);
    operation.tissue().for_each_element([&](const auto& one) { stored += one.element.energy(one.where(x)); });
    torn = tear.dissipated();
    damped = operation.damped();
    length = tear.torn_length();
    grasps = forceps.grasps();
    ++ticks;
    held_ = forceps.closed();
    last_ = forceps.position();
    last_force_ = felt;
    if (!held_ || tear.tips().size() < 2) return;
    const bool is_half = scene.angle(tear.surface().rest_positions().col(tear.tips().back().vertex)) > std::numbers::pi;
    if (states.size() < (is_half ? 2u : 1u)) {
        states.push_back(picture_of(scene, operation, forceps, felt));
    }
}

inline void Opened::add_force(const Tear& tear, const Forceps& forceps, const Vector& felt) {
    if (held_) {
        work -= (last_force_ + felt).dot(forceps.position() - last_) / 2;
        slipped += (last_force_ + felt).dot(forceps.slipped() - last_slip_) / 2;
    }
    last_slip_ = forceps.slipped();
    squares_ += felt.squaredNorm();
    ++held_ticks_;
    peak_ = std::max(peak_, felt.norm());
    force.push_back({1e3 * tear.torn_length(), 1e3 * felt.norm()});
    if (!(tear.torn_length() > length) || tear.tips().size() < 2) return;
    angles_ += std::acos(-tear.tips().back().heading.dot(felt) / felt.norm());
    ++advances_;
}

/// Prints it; `resistance` is the energy that a length of the tear takes [J/m].
inline void print(const RhexisScene& scene, const Opened& opened, double resistance) {
    std::printf(
        "%s, %d vertices: circularity %.3f; %.3g mm torn in %d ticks, %.0f %% converged, %.0f us for a tick, %d "
        "grasps\n",
        scene.name.c_str(), int{scene.mesh.vertex_count()}, opened.circularity, 1e3 * opened.length, opened.ticks,
        100.0 * opened.converged / opened.ticks, 1e6 * opened.seconds / opened.ticks, opened.grasps);
    std::printf("  force: RMS %.3g mN (surgeons: expert 8.97, novice 17.16), peak %.3g mN, %.0f degrees off the tear\n",
                1e3 * opened.rms(), 1e3 * opened.peak(), 180 / std::numbers::pi * opened.angle());
    std::printf("  the tear took %.3f of toughness * thickness * length\n", opened.torn / (resistance * opened.length));
    std::printf(
        "  the hand's work %.3g uJ = %.3g stored + %.3g torn + %.3g by the fluid + %.3g by slip in the forceps + "
        "%.1f %% by the steps\n",
        1e6 * opened.work, 1e6 * opened.stored, 1e6 * opened.torn, 1e6 * opened.damped, 1e6 * opened.slipped,
        100 * (1 - (opened.stored + opened.torn + opened.damped + opened.slipped) / opened.work));
}

/// The pictures side by side.
[[nodiscard]] inline Figure rhexis_figure(const RhexisScene& scene, std::vector<Picture> states) {
    const auto& rest = scene.mesh.positions();
    const double width = (rest.rowwise().maxCoeff() - rest.rowwise().minCoeff()).maxCoeff();
    double tension = 0, force = 1e-9;
    for (const Picture& state : states) {
        tension = std::max(tension, detail::quantile(*state.values, 0.98));
        force = std::max(force, state.force.norm());
    }
    Figure figure{.name = scene.name,
                  .title = "Capsulorhexis: tension before, during and after",
                  .camera = {.target = scene.middle.eigen(),
                             .azimuth = -28,
                             .elevation = 55,
                             .distance = 8 * width,
                             .metre = 270 / width},
                  .cell_height = 250};
    const std::vector<std::string> titles{"The cut", "Half round", "The flap is taken out"};
    for (std::size_t i = 0; i < states.size(); ++i) {
        states[i].arrow = 0.2 * width / force;
        states[i].colours = {
            .name = "mean tension", .unit = "N/m", .per_unit = 1, .low = 0, .high = std::ceil(tension)};
        figure.panels.push_back({i + 1 < states.size() ? titles[i] : titles.back(),
                                 i == 0 ? std::to_string(scene.mesh.vertex_count()) + " vertices" : "", states[i]});
    }
    return figure;
}

}  // namespace examples
