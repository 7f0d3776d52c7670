// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include <membrane/calibration/fit.hpp>

#include "tissue_biaxial.hpp"
#include "tissue_eye.hpp"

/// A whole human eye under pressure: a sphere of even thickness. Its stress is that of a sheet of the library's
/// elements under equal stretches; with Laplace's law this needs no mesh of the sphere.
namespace bench::tissue {

struct Globe {
    double radius;     ///< at zero pressure [m]
    double thickness;  ///< [m]

    /// Pressure for a stretch and the true stress [MPa] there [mmHg].
    [[nodiscard]] double pressure(double stretch, double stress) const {
        return 2 * 1e6 * stress * thickness / (radius * std::pow(stretch, 3)) / mmhg;
    }
    /// How much the volume grows up to a stretch [ul].
    [[nodiscard]] double growth(double stretch) const {
        return 1e9 * 4 / 3 * std::numbers::pi * std::pow(radius, 3) * (std::pow(stretch, 3) - 1);
    }
};

/// The radius of a sphere of sclera and cornea [m] for an area of the sclera [m^2]. [Rufer05] diameter of the cornea.
[[nodiscard]] inline double globe_radius(double sclera) {
    constexpr double rim = 5.855e-3;
    double radius = 0.012;
    for (int i = 0; i < 50; ++i) {
        const double cornea = 2 * std::numbers::pi * radius * (radius - std::sqrt(radius * radius - rim * rim));
        radius = std::sqrt((sclera + cornea) / (4 * std::numbers::pi));
    }
    return radius;
}

/// Mean thickness over the area of the sclera [m], linear in the angle between the places of [Vurgese12]: the limbus,
/// the equator, half way to the pole, and the pole.
[[nodiscard]] inline double mean_thickness() {
    constexpr std::array angles{30.0, 90.0, 135.0, 180.0}, values{0.50e-3, 0.42e-3, 0.65e-3, 0.94e-3};
    double sum = 0, weight = 0;
    for (std::size_t i = 0; i + 1 < angles.size(); ++i) {
        for (int k = 0; k < 100; ++k) {
            const double s = (k + 0.5) / 100, angle = angles[i] + s * (angles[i + 1] - angles[i]);
            const double part = std::sin(angle * std::numbers::pi / 180) * (angles[i + 1] - angles[i]);
            sum += part * (values[i] + s * (values[i + 1] - values[i]));
            weight += part;
        }
    }
    return sum / weight;
}

/// [Olsen98] the sclera has 16.3 cm^2.
inline constexpr double sclera_area = 16.3e-4;

/// What the volume grows from 10 mmHg to each pressure [ul].
[[nodiscard]] inline std::vector<double> growths(const Globe& globe, Law law, std::span<const double> constants,
                                                 std::span<const double> pressures) {
    const auto stretch_at = [&](double pressure) {
        double low = 1, high = 1.2;
        while (high - low > 1e-10) {
            const double middle = (low + high) / 2;
            (globe.pressure(middle, law(constants, {middle, middle})[0]) < pressure ? low : high) = middle;
        }
        return low;
    };
    const double start = globe.growth(stretch_at(10));
    std::vector<double> found;
    for (const double pressure : pressures) found.push_back(globe.growth(stretch_at(pressure)) - start);
    return found;
}

/// Enucleated human eyes, the author's equation for measurements: (cube root of pressure - that of 10 mmHg) / k,
/// k = 0.03 mmHg^(1/3)/ul [VanDerWerff81]. "Over a wide range" of pressures; the one here is assumed.
[[nodiscard]] inline double measured_growth(double pressure) { return (std::cbrt(pressure) - std::cbrt(10.0)) / 0.03; }

inline const std::vector<double> globe_pressures{12.5, 15, 17.5, 20, 22.5, 25, 27.5, 30, 32.5, 35, 37.5, 40};  // [mmHg]

/// `stiffening_sheet` for strains below a hundredth.
[[nodiscard]] inline Pair stiffening_globe(std::span<const double> constants, const Pair& stretch) {
    return stiffening_sheet(constants, stretch, 1.01);
}

/// Collagen of all directions in a matrix, under equal stretches. Constants C1, C3 [MPa] and C4: the matrix has the
/// energy C1 (I1 - 3), and a fibre the true stress C3 (exp(C4 (stretch - 1)) - 1), half of which acts in each
/// direction. The fibres are exponential springs along the edges and the diagonal of the square, three springs' worth
/// to each axis.
[[nodiscard]] inline Pair springs_in_matrix(std::span<const double> constants, const Pair& stretch) {
    const Mesh square = unit_square();
    const membrane::Material matrix{.young_modulus = 6e6 * constants[0], .poisson_ratio = 0.5, .thickness = 1};
    const membrane::ExponentialSpring law{.stiffening = constants[2], .strain_limit = 0.04};
    const membrane::MassSpringNetwork fibres(square, law, {.stiffness = 1e6 * constants[1] * constants[2] / 6});
    return true_stresses(square, stretch, membrane::Tissue(fibres, membrane::neo_hookean(square, matrix)));
}

/// [Sclera20] table 2, after Girard and others; the units are taken as MPa, as those of its other rows.
inline const std::vector<double> sclera_constants{0.805, 0.01269, 1102.25};

/// E at rest and stiffening, by `fit` to the measured growth.
[[nodiscard]] inline membrane::Fit fitted_globe(const Globe& globe) {
    membrane::ForceTable table;
    for (const double pressure : globe_pressures) {
        table.depth.push_back(pressure);
        table.force.push_back(measured_growth(pressure));
        table.deviation.push_back(1);
    }
    const auto model = [&](std::span<const double> constants, std::span<const double> pressures) {
        return growths(globe, stiffening_globe, constants, pressures);
    };
    return membrane::fit(table, {3, 1000}, model, {.search_factor = 15});
}

}  // namespace bench::tissue
