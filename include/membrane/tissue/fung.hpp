// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/tissue/incompressible_triangle.hpp>
#include <membrane/tissue/material.hpp>

/// A sheet of tissue that stiffens with stretch.
///
///     const auto sheet = membrane::fung(mesh, material, {.stiffening = 20});
///     const auto tissue = membrane::Tissue(springs, sheet);
namespace membrane {

/// How a `FungTriangle` stiffens. Both defaults are placeholders, of no tissue: take `stiffening` from a fit to your
/// measurements. The limit keeps the exponential within the range of numbers; set it above the stretches of your scene.
struct FungOptions {
    double stiffening = 10;      ///< b, positive
    double stretch_limit = 1.3;  ///< above 1: from the I1 of this stretch in all directions on, the energy is quadratic

    /// I1 - 3 at the limit.
    [[nodiscard]] double strain_limit() const noexcept {
        const double square = stretch_limit * stretch_limit;
        return 2 * square + 1 / (square * square) - 3;
    }

    /// @throws InvalidInput for an option out of its range, or if stiffening times `strain_limit()` exceeds 20
    void validate() const;
};

/// A linear triangle of an incompressible isotropic sheet in plane stress whose stiffness grows exponentially
/// [Demiray72], in two dimensions what [Fung67] found in one: it stores area thickness mu / (2 b) (exp(b (I1 - 3)) -
/// 1). At small strain it is a `NeoHookeanTriangle`; its stiffness is e times that where I1 - 3 is 1 / b. Beyond the
/// limit of `FungOptions` the energy continues as its second-order Taylor polynomial in I1. Calls exp: results may
/// differ in the last bits from one mathematics library to another.
///
/// Finite if no edge is longer than 1e5 times the lengths at rest in float, 1e60 times in double.
template <Number Scalar>
struct FungTriangle {
    static constexpr std::size_t corner_count = 3;                          ///< the triangle's
    static constexpr auto orders = IncompressibleTriangle<Scalar>::orders;  ///< see `Element`

    IncompressibleTriangle<Scalar> rest;  ///< shape
    Scalar stiffness;                     ///< area thickness mu / 2 [J]
    Scalar stiffening;                    ///< b [1]
    Scalar limit;                         ///< I1 - 3 from which the energy is quadratic [1]

    /// Energy for a strain I1 - 3, and its derivatives.
    template <Number N>
    [[nodiscard]] StrainResponse<N> response(const N& strain) const noexcept;

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 3>& x, std::size_t i) const noexcept {
        return detail::corner_force<N>(response<N>(rest.invariant(x)), rest.invariant_slope(x, i));
    }
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 3>& x) const noexcept {
        return response<N>(rest.invariant(x)).energy;
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 3>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept;
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                std::size_t j) const noexcept {
        const auto energy = response<double>(rest.invariant(x));
        const auto a = rest.invariant_slope(x, i).gradient, b = rest.invariant_slope(x, j).gradient;
        return energy.slope * rest.invariant_hessian(x, i, j) + energy.curvature * a * b.transpose();
    }
    [[nodiscard]] FungTriangle in_order(std::size_t i) const noexcept {
        return {rest.in_order(i), stiffness, stiffening, limit};
    }
    [[nodiscard]] FungTriangle reshaped(const Corners<Scalar, 3>& before,
                                        const Corners<Scalar, 3>& after) const noexcept {
        const auto shape = rest.reshaped(before, after);
        return {shape, stiffness * (shape.area() / rest.area()), stiffening, limit};
    }
    ///@}

    /// Mean of the two principal tensions, force per current width [N/m].
    template <Number N>
    [[nodiscard]] N mean_tension(const Corners<N, 3>& x) const noexcept {
        return rest.mean_tension(x, 2 * response<N>(rest.invariant(x)).slope * rest.invariant_dilation(x));
    }
};
static_assert(Element<FungTriangle<float>> && Element<FungTriangle<double>>);

/// One for each triangle of `mesh`, whose lengths are `stretch` times those at rest. A triangle without area is left
/// out. The sheet is incompressible: the material's Poisson ratio is not used; its Young's modulus is that at rest.
/// @throws InvalidInput for a material, an option or a stretch out of its range. O(F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, FungTriangle<Scalar>> fung(const TriangleMesh<Scalar>& mesh, const Material& material,
                                                          const FungOptions& options = {}, double stretch = 1);

inline void FungOptions::validate() const {
    constexpr std::string_view component = "FungOptions";
    detail::check_option(component, stiffening, "stiffening", "1", false);
    if (!is_finite(stretch_limit) || !(stretch_limit > 1)) {
        refuse(component, "stretch_limit must be finite and above 1, got ", stretch_limit);
    }
    if (!(stiffening * strain_limit() <= 20)) {
        refuse(component, "stiffening times I1 - 3 at stretch_limit must be at most 20, got ",
               stiffening * strain_limit());
    }
}

template <Number Scalar>
template <Number N>
StrainResponse<N> FungTriangle<Scalar>::response(const N& strain) const noexcept {
    const N b = static_cast<N>(stiffening), k = static_cast<N>(stiffness);
    const auto parts = detail::parts_of<N>(strain - static_cast<N>(limit));
    const N within = smaller<N>(strain, static_cast<N>(limit));
    const N growth = lane_by_lane<N>([](auto z) { return std::expm1(z); }, b * within);
    const N slope = k * (1 + growth);
    return {k * detail::quotient_or_zero<N>(growth, b) + slope * parts.above * (1 + b * parts.above / 2),
            slope * (1 + b * parts.above), slope * b};
}

// Up to the limit the energy grows by exp(b z) (exp(b dz) - 1), z the strain before; beyond, by a polynomial of slope
// exp(b z) at the limit.
template <Number Scalar>
template <Number N>
EnergyChange<N> FungTriangle<Scalar>::energy_change(const Corners<N, 3>& x, std::size_t i,
                                                    const Vector3<N>& displacement) const noexcept {
    const N b = static_cast<N>(stiffening), k = static_cast<N>(stiffness), most = static_cast<N>(limit);
    const auto strain = rest.invariant_change(x, i, displacement);
    const N before = rest.invariant(x);
    const auto parts = detail::parts_of<N>(before - most), by = detail::change_of(parts, strain.change);
    const N slope = k * lane_by_lane<N>([](auto z) { return std::exp(z); }, b * smaller<N>(before, most));
    const N growth = lane_by_lane<N>([](auto z) { return std::expm1(z); }, b * by.below);
    const N beyond = by.above * (1 + b * (parts.above + by.above / 2));
    const N slopes = 1 + b * parts.above + (1 + growth) * (1 + b * (parts.above + by.above));
    return {slope * (detail::quotient_or_zero<N>(growth, b) + (1 + larger<N>(growth, 0)) * beyond),
            slope * slopes * strain.size};
}

template <Real Scalar>
Elements<Scalar, FungTriangle<Scalar>> fung(const TriangleMesh<Scalar>& mesh, const Material& material,
                                            const FungOptions& options, double stretch) {
    material.validate();
    options.validate();
    detail::check_option("fung", stretch, "stretch", "1", false);
    const double modulus = material.young_modulus / 3 * material.thickness;
    const auto cast = [](double number) { return static_cast<Scalar>(number); };
    std::vector<ElementInstance<FungTriangle<Scalar>>> all;
    detail::for_each_rest_triangle(mesh, stretch, [&](Index f, const Corners<double, 3>& x) {
        const auto rest = incompressible_triangle(x);
        const auto corners = mesh.triangles().col(f);
        all.push_back({{corners[0], corners[1], corners[2]},
                       {detail::rounded<Scalar>(rest), cast(modulus / 2 * rest.area()), cast(options.stiffening),
                        cast(options.strain_limit())}});
    });
    return {mesh, std::move(all)};
}

}  // namespace membrane
