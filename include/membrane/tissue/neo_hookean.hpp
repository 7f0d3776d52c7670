// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <membrane/tissue/incompressible_triangle.hpp>
#include <membrane/tissue/material.hpp>

/// A sheet of rubber-like tissue at any strain.
///
///     const auto tissue = membrane::Tissue(springs, membrane::neo_hookean(mesh, material));
namespace membrane {

/// A linear triangle of an incompressible neo-Hookean sheet in plane stress [Holzapfel00] 6.5: it stores
/// area thickness mu / 2 (I1 - 3). The shear modulus mu is a third of Young's modulus. At small strain this is the
/// sheet of a `TriangularSpring` with Poisson ratio 0.5. See `IncompressibleTriangle` for strong compression.
///
/// Finite if no edge is longer than 1e8 times the lengths at rest in float, 1e70 times in double.
template <Number Scalar>
struct NeoHookeanTriangle {
    static constexpr std::size_t corner_count = 3;                          ///< the triangle's
    static constexpr auto orders = IncompressibleTriangle<Scalar>::orders;  ///< see `Element`

    IncompressibleTriangle<Scalar> rest;  ///< shape
    Scalar stiffness;                     ///< area thickness mu / 2 [J]

    ///@{
    /// As `Element` requires.
    template <Number N>
    [[nodiscard]] CornerForce<N> force_on(const Corners<N, 3>& x, std::size_t i) const noexcept {
        const auto k = static_cast<N>(stiffness);
        CornerForce<N> result = detail::corner_force<N>({0, k, 0}, rest.invariant_slope(x, i));
        result.remainder = rest.invariant_remainder(x, i);
        result.remainder.fourth *= k;
        return result;
    }
    template <Number N>
    [[nodiscard]] N energy(const Corners<N, 3>& x) const noexcept {
        return static_cast<N>(stiffness) * rest.invariant(x);
    }
    template <Number N>
    [[nodiscard]] EnergyChange<N> energy_change(const Corners<N, 3>& x, std::size_t i,
                                                const Vector3<N>& displacement) const noexcept {
        const auto strain = rest.invariant_change(x, i, displacement);
        return {static_cast<N>(stiffness) * strain.change, static_cast<N>(stiffness) * strain.size};
    }
    [[nodiscard]] Eigen::Matrix3d hessian_block(const Corners<double, 3>& x, std::size_t i,
                                                std::size_t j) const noexcept {
        return static_cast<double>(stiffness) * rest.invariant_hessian(x, i, j);
    }
    [[nodiscard]] NeoHookeanTriangle in_order(std::size_t i) const noexcept { return {rest.in_order(i), stiffness}; }
    [[nodiscard]] NeoHookeanTriangle reshaped(const Corners<Scalar, 3>& before,
                                              const Corners<Scalar, 3>& after) const noexcept {
        const auto shape = rest.reshaped(before, after);
        return {shape, stiffness * (shape.area() / rest.area())};
    }
    ///@}

    /// Mean of the two principal tensions, force per current width [N/m].
    template <Number N>
    [[nodiscard]] N mean_tension(const Corners<N, 3>& x) const noexcept {
        return rest.mean_tension(x, 2 * static_cast<N>(stiffness) * rest.invariant_dilation(x));
    }
};
static_assert(Element<NeoHookeanTriangle<float>> && Element<NeoHookeanTriangle<double>>);

/// One for each triangle of `mesh`, whose lengths are `stretch` times those at rest. A triangle without area is left
/// out. The sheet is incompressible: the material's Poisson ratio is not used.
/// @throws InvalidInput for a material or a stretch out of its range. O(F).
template <Real Scalar>
[[nodiscard]] Elements<Scalar, NeoHookeanTriangle<Scalar>> neo_hookean(const TriangleMesh<Scalar>& mesh,
                                                                       const Material& material, double stretch = 1) {
    material.validate();
    detail::check_option("neo_hookean", stretch, "stretch", "1", false);
    const double modulus = material.young_modulus / 3 * material.thickness;
    std::vector<ElementInstance<NeoHookeanTriangle<Scalar>>> all;
    detail::for_each_rest_triangle(mesh, stretch, [&](Index f, const Corners<double, 3>& x) {
        const auto rest = incompressible_triangle(x);
        const auto corners = mesh.triangles().col(f);
        all.push_back({{corners[0], corners[1], corners[2]},
                       {detail::rounded<Scalar>(rest), static_cast<Scalar>(modulus / 2 * rest.area())}});
    });
    return {mesh, std::move(all)};
}

}  // namespace membrane
