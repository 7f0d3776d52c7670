// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <concepts>
#include <string_view>

#include <membrane/core/check.hpp>
#include <membrane/core/vector3.hpp>

/// When a tear advances, where to, and what that takes.
///
///     const auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 1.4e3, .thickness = 12e-6});
namespace membrane {

/// The membrane at the tip of a tear. Directions are those of the surface at rest.
template <Real Scalar>
struct TipState {
    Vector3<Scalar> driving_force;      ///< energy released by an advance, per length; along the best direction [N]
    Scalar tension = 0;                 ///< largest principal tension of the triangles around the tip [N/m]
    Vector3<Scalar> tension_direction;  ///< its direction, a unit vector
    Vector3<Scalar> heading;            ///< the direction of the last advance, a unit vector
};

/// When a tear advances. `opens(tip)`: whether it does now; `direction(tip)`: where to, not necessarily a unit vector,
/// 0: nowhere; `resistance()`: the energy that a length takes [J/m], and so the driving force [N] near which an edge
/// opens.
template <class Criterion, class Scalar>
concept TearCriterion = Real<Scalar> && std::copyable<Criterion> &&
    requires(const Criterion& criterion, const TipState<Scalar>& tip) {
    { criterion.opens(tip) }
    noexcept->std::same_as<bool>;
    { criterion.direction(tip) }
    noexcept->std::convertible_to<Vector3<Scalar>>;
    { criterion.resistance() }
    noexcept->std::convertible_to<Scalar>;
};

/// Griffith's criterion [Griffith21]: a tear advances if that releases at least the energy that the new surface takes.
/// Whatever the mesh, it needs the same force. Direction: that of the configurational force, in which an advance
/// releases most [Miehe07].
struct EnergyRelease {
    double toughness;  ///< [J/m^2]
    double thickness;  ///< of the membrane [m]

    /// @throws InvalidInput if a number is not positive and finite
    void validate() const {
        detail::check_option("EnergyRelease", toughness, "toughness", "J/m^2", false);
        detail::check_option("EnergyRelease", thickness, "thickness", "m", false);
    }

    ///@{
    /// As `TearCriterion` requires.
    template <Real Scalar>
    [[nodiscard]] bool opens(const TipState<Scalar>& tip) const noexcept {
        return norm(tip.driving_force) >= resistance();
    }
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> direction(const TipState<Scalar>& tip) const noexcept {
        return tip.driving_force;
    }
    [[nodiscard]] double resistance() const noexcept { return toughness * thickness; }
    ///@}
};

/// For comparison: a tear advances across the largest tension at its tip, where that exceeds a strength. The tension at
/// a tip increases without bound as the triangles become smaller, and so the force that such a tear needs depends on
/// the mesh. It takes no energy.
struct LargestTension {
    double strength;  ///< force per width [N/m]

    /// @throws InvalidInput if the strength is not positive and finite
    void validate() const { detail::check_option("LargestTension", strength, "strength", "N/m", false); }

    ///@{
    /// As `TearCriterion` requires.
    template <Real Scalar>
    [[nodiscard]] bool opens(const TipState<Scalar>& tip) const noexcept {
        return tip.tension >= strength;
    }
    template <Real Scalar>
    [[nodiscard]] Vector3<Scalar> direction(const TipState<Scalar>& tip) const noexcept {
        return tip.heading - dot(tip.heading, tip.tension_direction) * tip.tension_direction;
    }
    [[nodiscard]] double resistance() const noexcept { return 0; }
    ///@}
};

static_assert(TearCriterion<EnergyRelease, float> && TearCriterion<LargestTension, double>);

}  // namespace membrane
