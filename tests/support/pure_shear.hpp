// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/tissue/material.hpp>

/// Closed forms of a strip in pure shear.
namespace test {

/// Clamps along both long sides of a strip move apart, and it cannot become narrower between them. A tear releases its
/// energy per area times its height, whatever the length of the tear.
struct PureShear {
    membrane::Material material;
    double toughness;  ///< [J/m^2]
    double height;     ///< between the clamps [m]

    /// Energy per area at this stretch [J/m^2].
    [[nodiscard]] double energy_density(double stretch) const {
        const double nu = material.poisson_ratio, strain = (stretch * stretch - 1) / 2;
        return material.young_modulus * material.thickness / (1 - nu * nu) * strain * strain / 2;
    }
    /// The stretch at which the energy released is the toughness.
    [[nodiscard]] double critical_stretch() const {
        const double nu = material.poisson_ratio;
        return std::sqrt(1 + 2 * std::sqrt(2 * toughness * (1 - nu * nu) / (material.young_modulus * height)));
    }
};

}  // namespace test
