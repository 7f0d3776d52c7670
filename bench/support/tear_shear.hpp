// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "support/pure_shear.hpp"
#include "support/torn_sheet.hpp"

/// A strip in pure shear: clamps along both long sides move apart, and a notch from a short side tears on.
namespace bench::tears {

using membrane::Index;
using test::torn_material;
using test::TornSheet;
using test::TornSheetOptions;
using test::vertices_where;
using Vector = membrane::Vector3<double>;

inline constexpr double degree = std::numbers::pi / 180;
inline constexpr double toughness = 1000;                                  // [J/m^2]
inline constexpr double resistance = toughness * torn_material.thickness;  // [J/m]

struct Shear {
    int rows = 20, columns = 40, notch = 12;  ///< height, length and notch [edges]
    double turn = 0;                          ///< of the grid [rad]
    double damping = 0;                       ///< of a vertex [N s/m]
    bool move_vertices = true;                ///< onto the tear's direction

    static constexpr double height = 20e-3;  ///< [m]
    static constexpr test::PureShear closed_form{torn_material, toughness, height};

    [[nodiscard]] double edge() const { return height / rows; }

    template <class Criterion>
    [[nodiscard]] TornSheet<double, Criterion> notched(const Criterion& criterion) const {
        const auto mesh = test::turned_grid<double>(columns, rows, edge(), turn).mesh();
        const double middle = height / 2, half = middle - edge() / 2;
        TornSheet<double, Criterion> strip(
            membrane::with_reserve(mesh, 2 * columns),
            {.hands = {vertices_where(mesh, [&](const Vector& at) { return at[1] - middle < -half; }),
                       vertices_where(mesh, [&](const Vector& at) { return at[1] - middle > half; })},
             .tolerance = 3e-4 * resistance,
             .damping = damping,
             .tear = {.move_vertices = move_vertices}},
            criterion);
        strip.cut({0, height / 2, 0}, {1, 0, 0}, notch);
        return strip;
    }
    template <class Criterion>
    static void stretch(TornSheet<double, Criterion>& strip, double to) {
        strip.x.row(1) = to * strip.tear.surface().rest_positions().row(1);
        strip.start();
    }
};

/// What a tear has done.
struct ShearRun {
    Index vertices = 0;
    double begins = 0;                        ///< the stretch
    double off_line = 0;                      ///< largest distance from the line of the notch [edges]
    double torn = 0;                          ///< [m]
    double given = 0, dissipated = 0;         ///< by the clamps and the strip; taken by the tear [J]
    double damped = 0, lost = 0;              ///< by damping; by nothing [J]
    std::vector<std::array<double, 2>> path;  ///< of the tip, from the notch on [edges]
};

/// Tears on by this number of edges, as slowly as forces balance.
[[nodiscard]] inline ShearRun run(const Shear& shear, double edges) {
    auto strip = shear.notched(membrane::EnergyRelease{toughness, torn_material.thickness});
    const double critical = Shear::closed_form.critical_stretch();
    double stretch = 0.98 * critical;
    Shear::stretch(strip, stretch);
    const auto& rest = strip.tear.surface().rest_positions();
    const Vector start = membrane::point(rest, strip.tear.tips()[0].vertex);
    ShearRun result;
    result.vertices = strip.mesh.vertex_count() - 2 * shear.columns;
    while (strip.tear.torn_length() < edges * shear.edge()) {
        // With damping the strip moves as long as the clamps do.
        const double by = strip.at_rest() || shear.damping > 0 ? 2e-4 * critical : 0;
        stretch += by;
        strip.tick({Vector(0, 0, 0), Vector(0, by * Shear::height, 0)});
        if (strip.tear.tips().empty()) break;
        if (result.begins == 0 && strip.tear.torn_length() > 0) result.begins = stretch;
        const Vector at = (1 / shear.edge()) * (membrane::point(rest, strip.tear.tips()[0].vertex) - start);
        if (result.path.empty() || result.path.back()[0] != at[0]) result.path.push_back({at[0], at[1]});
        result.off_line = std::max(result.off_line, std::abs(at[1]));
    }
    result.torn = strip.tear.torn_length();
    result.given = strip.work - strip.stored();
    result.dissipated = strip.tear.dissipated();
    result.damped = strip.damped;
    result.lost = strip.lost();
    return result;
}

/// The driving force at the notch over the closed form, at nine tenths of the critical stretch.
[[nodiscard]] inline double driving_force(const Shear& shear) {
    const double stretch = 0.9 * Shear::closed_form.critical_stretch();
    auto strip = shear.notched(membrane::EnergyRelease{toughness, torn_material.thickness});
    Shear::stretch(strip, stretch);
    strip.update();
    return norm(strip.tear.tips()[0].driving_force) / (Shear::closed_form.energy_density(stretch) * Shear::height);
}

/// At the tip, what criteria get.
struct Recorder {
    membrane::TipState<double>* state;

    [[nodiscard]] bool opens(const membrane::TipState<double>& tip) const noexcept {
        *state = tip;
        return false;
    }
    [[nodiscard]] Vector direction(const membrane::TipState<double>& tip) const noexcept { return tip.heading; }
    [[nodiscard]] double resistance() const noexcept { return 0; }
};

/// What opens the notch at a stretch, and the clamps' force per length then [N/m].
struct AtStretch {
    double stretch, force, driving_force, tension;
};

[[nodiscard]] inline std::vector<AtStretch> loaded(const Shear& shear, const std::vector<double>& stretches) {
    membrane::TipState<double> tip;
    auto strip = shear.notched(Recorder{&tip});
    std::vector<AtStretch> result;
    for (const double stretch : stretches) {
        Shear::stretch(strip, stretch);
        strip.update();
        const double length = shear.columns * shear.edge();
        result.push_back({stretch, strip.forces[1][1] / length, norm(tip.driving_force), tip.tension});
    }
    return result;
}

/// `y(state)` where `x(state)`, which increases, is `value`: linear between stretches; NaN beyond them.
template <class X, class Y>
[[nodiscard]] double value_where(const std::vector<AtStretch>& states, const X& x, const Y& y, double value) {
    for (std::size_t i = 1; i < states.size(); ++i) {
        const double before = x(states[i - 1]), after = x(states[i]);
        if (before <= value && value <= after) {
            const double part = (value - before) / (after - before);
            return y(states[i - 1]) + part * (y(states[i]) - y(states[i - 1]));
        }
    }
    return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace bench::tears
