// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <span>
#include <vector>

#include <membrane/calibration/fit.hpp>
#include <membrane/model/spring_law.hpp>

/// Strips of human amnion in tension, by `ExponentialSpring`.
namespace bench::tissue {

/// A point of a measured curve of stress by strain, means of 12 strips.
struct StripPoint {
    double strain, stress, deviation;  // deviation and stress in MPa
};

// [Amnion12] table 1: where the curve turns steep, and where the strip fails. The published deviations of the strains,
// 0.8 to 1.6 %, are left out.
inline constexpr std::array fresh_amnion{StripPoint{0.11808, 0.144, 0.037}, StripPoint{0.32695, 0.820, 0.028}};
inline constexpr std::array acellular_amnion{StripPoint{0.12200, 0.142, 0.026}, StripPoint{0.33777, 0.796, 0.045}};

/// Stress of a strip [MPa] with a modulus at rest [MPa] and a stiffening.
[[nodiscard]] inline double strip_stress(double modulus, double stiffening, double strain) {
    const membrane::ExponentialSpring law{.stiffening = stiffening};
    return law(membrane::SpringState<double>{.stiffness = modulus, .rest_length = 1, .length = 1 + strain}).tension;
}

/// The modulus [MPa] and the stiffening for which the curve goes through both points.
[[nodiscard]] inline std::array<double, 2> strip_through(const std::array<StripPoint, 2>& points) {
    const double ratio = points[1].stress / points[0].stress;
    double low = 1e-3, high = 50;
    while (high - low > 1e-9) {
        const double middle = (low + high) / 2;
        const double found = strip_stress(1, middle, points[1].strain) / strip_stress(1, middle, points[0].strain);
        (found < ratio ? low : high) = middle;
    }
    return {points[0].stress / strip_stress(1, low, points[0].strain), low};
}

/// The same by `fit` from the points of both kinds.
[[nodiscard]] inline membrane::Fit fitted_strip() {
    membrane::ForceTable table;
    for (const auto& points : {fresh_amnion, acellular_amnion}) {
        for (const StripPoint& point : points) {
            table.depth.push_back(point.strain);
            table.force.push_back(point.stress);
            table.deviation.push_back(point.deviation);
        }
    }
    const auto model = [](std::span<const double> constants, std::span<const double> strains) {
        std::vector<double> stresses;
        for (const double strain : strains) stresses.push_back(strip_stress(constants[0], constants[1], strain));
        return stresses;
    };
    return membrane::fit(table, {1, 5}, model, {.search_factor = 10});
}

}  // namespace bench::tissue
