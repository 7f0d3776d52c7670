// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "support/torn_strip.hpp"

/// A strip in pure shear, whose notch tears on.
namespace bench::tears {

using membrane::Index;
using test::torn_material;
using test::TornStrip;
using Vector = membrane::Vector3<double>;

inline constexpr double degree = std::numbers::pi / 180;
inline constexpr double toughness = 1000;                                  // [J/m^2]
inline constexpr double resistance = toughness * torn_material.thickness;  // [J/m]

using Strip = test::TornStripOptions;

/// 20 mm high, at the toughness above, on a grid that is turned by `turn` [rad].
[[nodiscard]] inline Strip strip_of(int rows, int columns, int notch, double turn = 0) {
    return {
        .columns = columns, .rows = rows, .edge = 20e-3 / rows, .notch = notch, .turn = turn, .toughness = toughness};
}

/// What a tear has done.
struct ShearRun {
    Index vertices = 0;
    double begins = 0;                        ///< the stretch, over the critical one
    double off_line = 0;                      ///< largest distance from the line of the notch [edges]
    double torn = 0;                          ///< [m]
    double given = 0, dissipated = 0;         ///< by the clamps and the strip; taken by the tear [J]
    double damped = 0, relaxed = 0;           ///< by the drag; by the steps [J]
    double lost = 0;                          ///< by nothing [J]
    std::vector<std::array<double, 2>> path;  ///< of the tip, from the notch on [edges]
};

/// Tears on by this number of edges, as slowly as forces balance.
[[nodiscard]] inline ShearRun run(const Strip& options, double edges) {
    TornStrip<double> strip(options);
    strip.cut();
    const double critical = strip.pure_shear().critical_stretch();
    strip.stretch(0.98 * critical);
    ShearRun result;
    result.vertices = strip.vertices;
    while (strip.torn_edges() < edges) {
        // In a fluid the strip moves as long as the clamps do.
        strip.tick(strip.at_rest() || options.drag > 0 ? 2e-4 * critical : 0);
        if (strip.tear.tips().empty()) break;
        if (result.begins == 0 && strip.torn_edges() > 0) result.begins = strip.stretched / critical;
        const Vector at = strip.advance();
        if (result.path.empty() || result.path.back()[0] != at[0]) result.path.push_back({at[0], at[1]});
        result.off_line = std::max(result.off_line, std::abs(at[1]));
    }
    result.torn = strip.tear.torn_length();
    result.given = strip.work - strip.stored();
    result.dissipated = strip.tear.dissipated();
    result.damped = strip.damped();
    result.relaxed = strip.relaxed;
    result.lost = strip.lost();
    return result;
}

/// The driving force at the notch over the closed form, at nine tenths of the critical stretch.
[[nodiscard]] inline double driving_force(const Strip& options) {
    TornStrip<double> strip(options);
    strip.cut();
    strip.stretch(0.9 * strip.pure_shear().critical_stretch());
    strip.update();
    return norm(strip.tear.tips()[0].driving_force) /
           (strip.pure_shear().energy_density(strip.stretched) * strip.height());
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

[[nodiscard]] inline std::vector<AtStretch> loaded(const Strip& options, const std::vector<double>& stretches) {
    membrane::TipState<double> tip;
    TornStrip<double, Recorder> strip(options, Recorder{&tip});
    strip.cut();
    std::vector<AtStretch> result;
    for (const double stretch : stretches) {
        strip.stretch(stretch);
        strip.update();
        result.push_back(
            {stretch, strip.force() / (options.columns * options.edge), norm(tip.driving_force), tip.tension});
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
