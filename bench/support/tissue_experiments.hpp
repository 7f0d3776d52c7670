// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <membrane/calibration/fit.hpp>

#include "tissue_eye.hpp"
#include "tissue_shell.hpp"

/// Published experiments on the wall of the eye, each with constants published by others. All are means with deviations
/// at one load, not curves. Numbers are from abstracts and tables: nothing is read from a figure.
namespace bench::tissue {

// [Munoz21] E by inflation, no deviation given; [Sanchez11] radii of curvature 337.5 / dioptres in both meridians, mean
// of half the two diameters, thickness by ultrasound and by slit scan.
inline const Eye pig_cornea{.radius = 8.44e-3, .rim = 6.58e-3, .thickness = 0.89e-3, .young_modulus = 0.188e6};
// [Pye20] E of 0.25 +- 0.10 MPa in vivo; [Atchison05] radius of the front; [Rufer05] diameter; [Poloxamer20] thickness.
inline const Eye human_cornea{.radius = 7.8e-3, .rim = 5.855e-3, .thickness = 0.574e-3, .young_modulus = 0.25e6};
// [Leung14] radius and thickness; E of the same animal's cornea [Munoz21]; the border is assumed.
inline const Eye pig_sclera{.radius = 7.86e-3, .rim = 6.8e-3, .thickness = 1.03e-3, .young_modulus = 0.188e6};

/// Eyes with one constant changed: to the ends of its published deviation, to that of other eyes, or in what is
/// assumed.
[[nodiscard]] inline std::vector<Eye> pig_cornea_variants() {
    const Eye& eye = pig_cornea;
    return {eye.hinged(),
            eye.with(&Eye::radius, 8.19e-3),      // [Sanchez11] one meridian
            eye.with(&Eye::radius, 8.69e-3),      // [Sanchez11] the other
            eye.with(&Eye::rim, 6e-3),            // [Sanchez11] vertical
            eye.with(&Eye::rim, 7.155e-3),        // [Sanchez11] horizontal
            eye.with(&Eye::thickness, 0.825e-3),  // [Poloxamer20] 891 +- 66 um
            eye.with(&Eye::thickness, 0.957e-3),
            {8.07e-3, 6.89e-3, 1.009e-3, eye.young_modulus}};  // [Menduni18] the whole shape, 60 eyes
}

[[nodiscard]] inline std::vector<Eye> human_cornea_variants() {
    const Eye& eye = human_cornea;
    return {eye.hinged(), eye.with(&Eye::young_modulus, 0.15e6),                        // [Pye20]
            eye.with(&Eye::young_modulus, 0.35e6), eye.with(&Eye::thickness, 0.54e-3),  // [Poloxamer20] 574 +- 34 um
            eye.with(&Eye::thickness, 0.608e-3)};
}

[[nodiscard]] inline std::vector<Eye> pig_sclera_variants() {
    const Eye& eye = pig_sclera;
    return {eye.hinged(),
            eye.with(&Eye::radius, 7.37e-3),  // [Leung14] 7.86 +- 0.49 mm
            eye.with(&Eye::radius, 8.35e-3),
            eye.with(&Eye::rim, 5.8e-3),
            eye.with(&Eye::thickness, 0.89e-3),  // [Leung14] 1.03 +- 0.14 mm
            eye.with(&Eye::thickness, 1.17e-3)};
}

/// A quantity as a function of Young's modulus: a polynomial in logarithms through five values.
class ByModulus {
  public:
    explicit ByModulus(const std::function<double(double)>& predict) {
        for (std::size_t k = 0; k < moduli.size(); ++k) values_[k] = std::log(predict(moduli[k]));
    }

    [[nodiscard]] double operator()(double modulus) const {
        double sum = 0;
        for (std::size_t k = 0; k < moduli.size(); ++k) {
            double weight = 1;
            for (std::size_t j = 0; j < moduli.size(); ++j) {
                if (j != k) weight *= std::log(modulus / moduli[j]) / std::log(moduli[k] / moduli[j]);
            }
            sum += weight * values_[k];
        }
        return std::exp(sum);
    }

    /// The modulus for which the quantity has this value; NaN outside of the table.
    [[nodiscard]] double modulus_for(double value) const {
        double low = moduli.front(), high = moduli.back();
        const bool rises = (*this)(high) > (*this)(low);
        const auto is_below = [&](double modulus) { return ((*this)(modulus) < value) == rises; };
        if (!is_below(low) || is_below(high)) return std::numeric_limits<double>::quiet_NaN();
        while (high / low > 1 + 1e-9) {
            const double middle = std::sqrt(low * high);
            (is_below(middle) ? low : high) = middle;
        }
        return low;
    }

    static constexpr std::array moduli{0.1e6, 0.18e6, 0.32e6, 0.57e6, 1e6};  ///< [Pa]

  private:
    std::array<double, moduli.size()> values_;
};

/// A measurement and the model's numbers for it, in one unit.
struct Experiment {
    std::string name, unit, keys;
    double measured, deviation;
    double published;                                          ///< modulus [Pa]
    double predicted;                                          ///< from published constants
    std::vector<double> variants;                              ///< with one of them changed
    double shell = std::numeric_limits<double>::quiet_NaN();   ///< by the shell of revolution
    double coarse = std::numeric_limits<double>::quiet_NaN();  ///< on a mesh with half as many rings
    ByModulus by_modulus;

    /// How much the table by moduli differs from the model at the published one, relative.
    [[nodiscard]] double table_error() const { return by_modulus(published) / predicted - 1; }
    [[nodiscard]] double score() const { return (predicted - measured) / deviation; }
    [[nodiscard]] double lowest() const {
        return (std::min)(predicted, *std::min_element(variants.begin(), variants.end()));
    }
    [[nodiscard]] double highest() const {
        return (std::max)(predicted, *std::max_element(variants.begin(), variants.end()));
    }
};

/// Middles of an eye at each of these pressures [mmHg], ascending.
[[nodiscard]] inline std::vector<Middle> inflated(const Eye& eye, const std::vector<double>& pressures, int rings) {
    Inflation inflation(eye, rings);
    std::vector<Middle> found;
    for (const double pressure : pressures) found.push_back(inflation.at(pressure * mmhg));
    return found;
}

/// How much the middle of a cornea becomes thinner from 5 to 30 mmHg [%].
[[nodiscard]] inline double thinning(const Eye& eye, int rings) {
    const auto found = inflated(eye, {5, 15, 30}, rings);
    return -100 * thickness_strain(found[0].stretch, found[2].stretch, eye.poisson_ratio);
}

/// How much it rises up to 27.25 mmHg from a lower pressure [um].
[[nodiscard]] inline double rise(const Eye& eye, int rings, double from = 0) {
    const auto found = inflated(eye, {from, 15, 27.25}, rings);
    return 1e6 * (found[2].rise - found[0].rise);
}

inline const std::vector<double> punch_depths{0.1e-3, 0.2e-3, 0.3e-3, 0.4e-3, 0.5e-3, 0.6e-3, 0.7e-3, 0.8e-3};  // [m]

/// The force of a punch over its depth of 0.8 mm [N/m].
[[nodiscard]] inline double punch_stiffness(const Eye& eye, int rings) {
    const double force = punch_forces(eye, 15 * mmhg, punch_depths, rings).back();
    if (!std::isfinite(force)) throw std::runtime_error("no equilibrium under the punch");
    return force / punch_depths.back();
}

[[nodiscard]] inline ByModulus tabulated(const Eye& eye, double (*quantity)(const Eye&, int), int rings) {
    return ByModulus([&](double modulus) { return quantity(eye.with(&Eye::young_modulus, modulus), rings); });
}

/// [Chang20] 437 +- 63 um in 7 eyes; the pressure of its zero is not published.
[[nodiscard]] inline Experiment pig_cornea_rises(int rings) {
    const auto whole = [](const Eye& eye, int count) { return rise(eye, count); };
    Experiment result{.name = "pig cornea: its middle rises, 0 to 27.25 mmHg",
                      .unit = "um",
                      .keys = "[Chang20]; [Munoz21] [Sanchez11] [Menduni18]",
                      .measured = 437,
                      .deviation = 63,
                      .published = pig_cornea.young_modulus,
                      .predicted = rise(pig_cornea, rings),
                      .variants = {rise(pig_cornea, rings, 5)},
                      .coarse = rise(pig_cornea, rings / 2),
                      .by_modulus = tabulated(pig_cornea, whole, rings)};
    for (const Eye& variant : pig_cornea_variants()) result.variants.push_back(rise(variant, rings));
    RevolvedShell shell(pig_cornea, shell_elements);
    static_cast<void>(shell.at(15 * mmhg));
    result.shell = 1e6 * shell.at(27.25 * mmhg).rise;
    return result;
}

[[nodiscard]] inline double shell_thinning(const Eye& eye) {
    RevolvedShell shell(eye, shell_elements);
    const double before = shell.at(5 * mmhg).stretch;
    static_cast<void>(shell.at(15 * mmhg));
    return -100 * thickness_strain(before, shell.at(30 * mmhg).stretch, eye.poisson_ratio);
}

/// [Poloxamer20] -6.42 +- 1.50 % of pigs, -2.85 +- 0.09 % of humans, by ultrasound.
[[nodiscard]] inline Experiment cornea_thins(const std::string& whose, const Eye& eye, double measured,
                                             double deviation, const std::vector<Eye>& variants,
                                             const std::string& keys, int rings) {
    Experiment result{.name = whose + " cornea: its middle becomes thinner, 5 to 30 mmHg",
                      .unit = "%",
                      .keys = "[Poloxamer20]; " + keys,
                      .measured = measured,
                      .deviation = deviation,
                      .published = eye.young_modulus,
                      .predicted = thinning(eye, rings),
                      .variants = {},
                      .shell = shell_thinning(eye),
                      .coarse = thinning(eye, rings / 2),
                      .by_modulus = tabulated(eye, thinning, rings)};
    for (const Eye& variant : variants) result.variants.push_back(thinning(variant, rings));
    return result;
}

/// [Leung14] 0.13 +- 0.02 N/mm in 15 eyes at 15 mmHg, by a punch of 5 mm; the depth is not in the abstract.
[[nodiscard]] inline Experiment pig_sclera_pressed(int rings) {
    Experiment result{.name = "pig sclera: force per depth of a flat punch, at 15 mmHg",
                      .unit = "N/m",
                      .keys = "[Leung14]; [Munoz21]",
                      .measured = 130,
                      .deviation = 20,
                      .published = pig_sclera.young_modulus,
                      .predicted = punch_stiffness(pig_sclera, rings),
                      .variants = {},
                      .coarse = punch_stiffness(pig_sclera, rings / 2),
                      .by_modulus = tabulated(pig_sclera, punch_stiffness, rings)};
    for (const Eye& variant : pig_sclera_variants()) result.variants.push_back(punch_stiffness(variant, rings));
    const auto forces = punch_forces(pig_sclera, 15 * mmhg, punch_depths, rings);
    const double step = punch_depths[1] - punch_depths[0];
    result.variants.push_back(forces[0] / step);  // the slopes at the lowest and the highest depth
    result.variants.push_back((forces.back() - forces[forces.size() - 2]) / step);
    return result;
}

/// The pressure that a tonometer shows for 16 mmHg: its plate flattens a circle of 3.06 mm.
[[nodiscard]] inline double tonometer_reading(double thickness) {
    const Eye eye = human_cornea.with(&Eye::thickness, thickness);
    return applanation_pressure(eye, 16 * mmhg, 13, 3) / mmhg;  // the third ring's diameter is 3.04 mm
}

/// One modulus for all: the fit of `calibration/fit.hpp`, each residual over its deviation.
[[nodiscard]] inline membrane::Fit one_modulus(const std::vector<Experiment>& experiments) {
    membrane::ForceTable table;
    for (std::size_t i = 0; i < experiments.size(); ++i) {
        table.depth.push_back(static_cast<double>(i));
        table.force.push_back(experiments[i].measured);
        table.deviation.push_back(experiments[i].deviation);
    }
    const auto model = [&](std::span<const double> modulus, std::span<const double> rows) {
        std::vector<double> found;
        for (const double row : rows)
            found.push_back(experiments[static_cast<std::size_t>(row)].by_modulus(modulus[0]));
        return found;
    };
    return membrane::fit(table, {pig_cornea.young_modulus}, model, {.search_factor = 5});
}

}  // namespace bench::tissue
