// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <membrane/calibration/fit.hpp>
#include <membrane/tissue/fibres.hpp>
#include <membrane/tissue/fung.hpp>
#include <membrane/tissue/neo_hookean.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "sheet.hpp"

/// Stresses of a sheet that is stretched along two axes, by the library's laws, and their fit to measured ones.
///
///     const auto found = bench::tissue::stresses(bench::tissue::two_families, constants, {1.1, 1.05});   // [MPa]
namespace bench::tissue {

/// Stretches, or true stresses [MPa], along x and y.
using Pair = std::array<double, 2>;

/// A state of a sheet that was measured.
struct Biaxial {
    Pair stretch;  ///< length over length at rest
    Pair stress;   ///< force per area of the deformed section [MPa]
};

/// A sheet of 1 m by 1 m of two triangles.
[[nodiscard]] inline Mesh unit_square() {
    Points x(3, 4);
    x << 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0;
    Eigen::Matrix<Index, 3, 2> corners;
    corners << 0, 0, 1, 2, 2, 3;
    return {x, membrane::Triangles(corners)};
}

/// True stresses [MPa] of a tissue of this square, 1 m thick at rest and incompressible: by virtual work, the sum of
/// force times position over the volume, which is 1 m^3.
[[nodiscard]] Pair true_stresses(const Mesh& square, const Pair& stretch, const auto& tissue) {
    Points x = square.positions();
    x.row(0) *= stretch[0];
    x.row(1) *= stretch[1];
    Pair sum{};
    for (Index v = 0; v < square.vertex_count(); ++v) {
        const Vector3 force = tissue.force_on(v, x).force;
        for (int axis : {0, 1}) {
            const auto k = static_cast<std::size_t>(axis);
            sum[k] -= 1e-6 * force[axis] * x(axis, v);
        }
    }
    return sum;
}

/// The same of these elements.
[[nodiscard]] Pair stresses_of(const Mesh& square, const Pair& stretch, const auto&... elements) {
    const membrane::MassSpringNetwork none(square, membrane::LinearSpring{}, {.stiffness = 0.0});
    return true_stresses(square, stretch, membrane::Tissue(none, elements...));
}

/// A law with its positive constants, moduli in MPa.
using Law = Pair (*)(std::span<const double> constants, const Pair& stretch);

/// Constant: E.
[[nodiscard]] inline Pair linear_sheet(std::span<const double> constants, const Pair& stretch) {
    const Mesh square = unit_square();
    const membrane::Material material{.young_modulus = 1e6 * constants[0], .poisson_ratio = 0.49, .thickness = 1};
    return stresses_of(square, stretch, membrane::triangular_springs(square, material));
}

/// Constant: E.
[[nodiscard]] inline Pair rubber(std::span<const double> constants, const Pair& stretch) {
    const Mesh square = unit_square();
    const membrane::Material material{.young_modulus = 1e6 * constants[0], .poisson_ratio = 0.5, .thickness = 1};
    return stresses_of(square, stretch, membrane::neo_hookean(square, material));
}

/// Constants: E at rest, stiffening; `limit` as in `FungOptions`.
[[nodiscard]] inline Pair stiffening_sheet(std::span<const double> constants, const Pair& stretch, double limit) {
    const Mesh square = unit_square();
    const membrane::Material material{.young_modulus = 1e6 * constants[0], .poisson_ratio = 0.5, .thickness = 1};
    const membrane::FungOptions options{.stiffening = constants[1], .stretch_limit = limit};
    return stresses_of(square, stretch, membrane::fung(square, material, options));
}

[[nodiscard]] inline Pair stiffening_skin(std::span<const double> constants, const Pair& stretch) {
    return stiffening_sheet(constants, stretch, 1.14);
}

/// Fibres along y, or of all directions alike: the limits of the exponential are above all strains here, and low enough
/// for constants that are tried in a fit.
[[nodiscard]] inline auto fibres_along_y(const Mesh& square, double stiffness, double stiffening, double dispersion) {
    const auto along_y = membrane::fibre_directions(square, [](const auto&) { return Vector3(Vector3::UnitY()); });
    const membrane::FibreMaterial material{.stiffness = 1e6 * stiffness,
                                           .stiffening = stiffening,
                                           .dispersion = dispersion,
                                           .thickness = 1,
                                           .stretch_limit = dispersion > 0 ? 1.06 : 1.18};
    return membrane::fibres(square, material, {along_y});
}

/// Constants: stiffness and stiffening of fibres of all directions alike, and of fibres along y.
[[nodiscard]] inline Pair two_families(std::span<const double> constants, const Pair& stretch) {
    const Mesh square = unit_square();
    return stresses_of(square, stretch, fibres_along_y(square, constants[0], constants[1], 1.0 / 3),
                       fibres_along_y(square, constants[2], constants[3], 0));
}

/// Constants: E at rest and stiffening of the matrix, stiffness and stiffening of fibres along y.
[[nodiscard]] inline Pair matrix_and_fibres(std::span<const double> constants, const Pair& stretch) {
    const Mesh square = unit_square();
    const membrane::Material material{.young_modulus = 1e6 * constants[0], .poisson_ratio = 0.5, .thickness = 1};
    const membrane::FungOptions options{.stiffening = constants[1], .stretch_limit = 1.14};
    return stresses_of(square, stretch, membrane::fung(square, material, options),
                       fibres_along_y(square, constants[2], constants[3], 0));
}

/// The constants that come closest to all stresses of these states, each with the same weight: `fit`.
[[nodiscard]] inline membrane::Fit fitted(Law law, const std::vector<double>& start,
                                          const std::vector<Biaxial>& states) {
    membrane::ForceTable table;
    for (std::size_t row = 0; row < 2 * states.size(); ++row) {
        table.depth.push_back(static_cast<double>(row));
        table.force.push_back(states[row / 2].stress[row % 2]);
        table.deviation.push_back(1e-3);
    }
    const auto model = [&](std::span<const double> constants, std::span<const double> rows) {
        std::vector<double> found;
        for (const double row : rows) {
            const auto k = static_cast<std::size_t>(row);
            try {
                found.push_back(law(constants, states[k / 2].stretch)[k % 2]);
            } catch (const membrane::InvalidInput&) {  // stiffens too much for the limit of its law
                found.push_back(std::numeric_limits<double>::quiet_NaN());
            }
        }
        return found;
    };
    return membrane::fit(table, start, model, {.search_factor = 100});
}

}  // namespace bench::tissue
