// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <string>

#include <membrane/tissue/elements.hpp>

#include "support/figure.hpp"
#include "support/surface_state.hpp"

/// Tension as colour.
namespace examples {

/// The mean tension of each triangle at `x` [N/m], as it is on average around its corners: that of a single triangle,
/// in which it is constant, jumps from one to the next.
template <class Sheet>
[[nodiscard]] Eigen::VectorXd tensions(const Sheet& sheet, const membrane::Points<double>& x) {
    const Eigen::VectorXd around = vertex_tensions(sheet, x);
    Eigen::VectorXd result(static_cast<Eigen::Index>(sheet.all().size()));
    for (std::size_t f = 0; f < sheet.all().size(); ++f) {
        const auto& corners = sheet.all()[f].corners;
        result[static_cast<Eigen::Index>(f)] = (around[corners[0]] + around[corners[1]] + around[corners[2]]) / 3;
    }
    return result;
}

namespace detail {

[[nodiscard]] inline double quantile(Eigen::VectorXd values, double share) {
    std::sort(values.begin(), values.end());
    return values[static_cast<Eigen::Index>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace detail

/// The sheet of `pressed` at rest and pressed, with its tension as colour.
template <class Sheet>
[[nodiscard]] Figure tension_figure(const std::string& name, const Sheet& sheet, Picture pressed) {
    const auto& mesh = pressed.mesh;
    const Eigen::Vector3d low = mesh.positions().rowwise().minCoeff(), high = mesh.positions().rowwise().maxCoeff();
    const double width = (high - low).head<2>().maxCoeff(), metre = 260 / width;
    Picture rest{.mesh = mesh, .points = mesh.positions()};
    rest.values = tensions(sheet, rest.points);
    pressed.values = tensions(sheet, pressed.points);
    pressed.arrow = 0.2 * width / pressed.force.norm();
    const double low_tension = detail::quantile(*pressed.values, 0.02);
    const double high_tension = detail::quantile(*pressed.values, 0.995);
    rest.colours = pressed.colours = {.name = "mean tension",
                                      .unit = "N/m",
                                      .per_unit = 1,
                                      .low = low_tension,
                                      .high = high_tension + 0.5 * (high_tension - low_tension)};  // none nearly black
    return {
        .name = name,
        .title = name + ": tension at rest and pressed",
        .panels = {{"At rest", std::to_string(mesh.vertex_count()) + " vertices", rest},
                   {"Pressed", detail::force_text(pressed.force.norm()), pressed}},
        .camera = {.target = (low + high) / 2, .azimuth = 20, .elevation = 50, .distance = 8 * width, .metre = metre},
        .columns = 2,
        .cell_height = 240,
        .headroom = 20};
}

}  // namespace examples
