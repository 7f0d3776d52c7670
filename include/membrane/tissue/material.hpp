// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

#include <membrane/core/check.hpp>

/// Materials of a tissue and of the layer under it.
///
///     const auto capsule = membrane::materials::lens_capsule().typical;
///     const membrane::FoundationLayer cortex{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
///     cortex.normal_stiffness();                                                            // [N/m^3]
namespace membrane {

/// A thin tissue, isotropic in its surface.
struct Material {
    double young_modulus = 0;  ///< E [Pa], positive
    double poisson_ratio = 0;  ///< nu, 0 to 0.5
    double thickness = 0;      ///< t [m], positive
    double density = 1000;     ///< [kg/m^3], positive

    /// Tension of a sheet, per width, for a unit of equal strain in all directions of it: E t / (1 - nu) [N/m].
    [[nodiscard]] double biaxial_stiffness() const noexcept { return young_modulus * thickness / (1 - poisson_ratio); }

    /// @throws InvalidInput for a number out of its range
    void validate() const;
};

/// The layer under a membrane, on rigid ground, as a Winkler foundation: each piece of it carries only the load
/// directly above it. This holds for a layer thin against the contact. A layer as thick as a tool is wide also deforms
/// around the contact, and is softer than this model.
struct FoundationLayer {
    double young_modulus = 0;  ///< E [Pa], positive
    double poisson_ratio = 0;  ///< nu, 0 to 0.49: near 0.5 the layer is not compressed but flows aside, and its
                               ///< pressure at a point depends on the whole contact
    double thickness = 0;      ///< h [m], positive

    /// Pressure per unit of depth: the constrained modulus, E (1 - nu) / ((1 + nu) (1 - 2 nu)), over h [N/m^3].
    [[nodiscard]] double normal_stiffness() const noexcept {
        const double nu = poisson_ratio;
        return young_modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) / thickness;
    }

    /// Traction per unit of displacement along the surface: the shear modulus, E / (2 (1 + nu)), over h [N/m^3].
    [[nodiscard]] double tangential_stiffness() const noexcept {
        return young_modulus / (2 * (1 + poisson_ratio)) / thickness;
    }

    /// @throws InvalidInput for a number out of its range
    void validate() const;
};

/// Published constants of a tissue: typical ones, and the range of the measurements.
struct MaterialRange {
    ///@{
    /// Typical constants, and the lower and upper ends of the range.
    Material typical, lower, upper;
    ///@}
};

/// Tissues of the eye. They stiffen when stretched, and differ between eyes and between experiments: these constants
/// are a start, not a measurement; `bench/run tissue` compares them with measured eyes. Densities are that of water,
/// 1000: not measured, and of no effect in a quasi-static step.
namespace materials {

/// For a tool that presses, human: 0.25 +- 0.10 MPa (mean and deviation, aged 21) in vivo at the pressure in the eye,
/// from tonometry [Pye20]; against a tonometer's plate the model is then 1.4 times too stiff. For stretch by a rising
/// pressure it is three times too soft: what [Poloxamer20] measured needs 0.75 MPa. The middle is 0.529 +- 0.036 mm
/// thick in one population [Eballe10], 0.544 +- 0.033 mm in another [Kadhim16]: the typical value is between the means,
/// the range holds 95 % of both. The Poisson ratio is assumed, that of tissue full of water.
[[nodiscard]] constexpr MaterialRange cornea() noexcept {
    return {{.young_modulus = 0.25e6, .poisson_ratio = 0.49, .thickness = 0.535e-3},
            {.young_modulus = 0.15e6, .poisson_ratio = 0.49, .thickness = 0.46e-3},
            {.young_modulus = 0.35e6, .poisson_ratio = 0.49, .thickness = 0.61e-3}};
}

/// For stretch, human: 6 MPa in childhood, 3 MPa at 60, 1.5 MPa in extreme old age, Poisson ratio 0.47 [Fisher69]. 11
/// to 15 um thick at the anterior pole, up to 16 um around it, 3.5 um at the posterior pole [Barraquer06]; the typical
/// value is the middle of the anterior range. Other experiments: the stiffness of the empty bag does not depend on age
/// [Ziebarth08]; 0.28 to 2 MPa by swelling in salt, of the pig [Powell10]; 0.02 to 0.13 MPa by indentation with an
/// atomic force microscope [Ziebarth11].
[[nodiscard]] constexpr MaterialRange lens_capsule() noexcept {
    return {{.young_modulus = 3e6, .poisson_ratio = 0.47, .thickness = 13e-6},
            {.young_modulus = 1.5e6, .poisson_ratio = 0.47, .thickness = 3.5e-6},
            {.young_modulus = 6e6, .poisson_ratio = 0.47, .thickness = 16e-6}};
}

/// An order of magnitude. A sheet of the retina of cattle has a tension of about 2 N/m per strain, an E of the order of
/// 20 kPa for the thickness in that experiment [Jones92]; the pig's has 5.5 kPa [Milan25]. Near the human macula it is
/// 0.277 +- 0.034 mm thick in the centre, 0.326 +- 0.020 and 0.282 +- 0.015 mm in rings around it [Macula21]. Typical
/// are this thickness and the modulus with which it has 2 N/m. The Poisson ratio is that of tissue full of water, not
/// measured.
[[nodiscard]] constexpr MaterialRange retina() noexcept {
    return {{.young_modulus = 7e3, .poisson_ratio = 0.49, .thickness = 0.28e-3},
            {.young_modulus = 5.5e3, .poisson_ratio = 0.49, .thickness = 0.24e-3},
            {.young_modulus = 2e4, .poisson_ratio = 0.49, .thickness = 0.35e-3}};
}

}  // namespace materials

namespace detail {

inline void check_poisson_ratio(std::string_view component, double value, double most) {
    if (is_finite(value) && value >= 0 && value <= most) return;
    refuse(component, "poisson_ratio must be 0 to ", most, ", got ", value);
}

}  // namespace detail

inline void Material::validate() const {
    constexpr std::string_view component = "Material";
    detail::check_option(component, young_modulus, "young_modulus", "Pa", false);
    detail::check_poisson_ratio(component, poisson_ratio, 0.5);
    detail::check_option(component, thickness, "thickness", "m", false);
    detail::check_option(component, density, "density", "kg/m^3", false);
}

inline void FoundationLayer::validate() const {
    constexpr std::string_view component = "Foundation";
    detail::check_option(component, young_modulus, "young_modulus", "Pa", false);
    detail::check_poisson_ratio(component, poisson_ratio, 0.49);
    detail::check_option(component, thickness, "thickness", "m", false);
}

}  // namespace membrane
