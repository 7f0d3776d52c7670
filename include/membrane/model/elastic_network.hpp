// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <limits>
#include <vector>

#include <membrane/core/lanes.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/core/types.hpp>

/// The elastic forces on the vertices of a membrane and their energy, as a solver needs them.
///
///     template <membrane::ElasticNetwork<double> Network>
///     membrane::Vector3<double> force_on(const Network& network, membrane::Index v, const Eigen::Matrix3Xd& x) {
///         return network.force_on(v, x).force;                                                // [N]
///     }
namespace membrane {

/// Force on a vertex and its stiffness: sums over its springs.
template <Number Scalar>
struct VertexForce {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
    Scalar stiffness = 0;                             ///< stiffness bound: no eigenvalue of the Hessian is larger [N/m]
};

/// What the energy of elements may exceed its quadratic expansion by. With their Hessian H it is, for a displacement d
/// of length s, s^2 <= 1 / per_range, at most E - force . d + second s^2 + (sqrt(d . H d / 2) + sqrt(fourth) s^2)^2.
/// This form is that of energies quadratic in a strain which is not linear in d.
template <Number Scalar>
struct EnergyRemainder {
    Scalar second = 0;     ///< [N/m]
    Scalar fourth = 0;     ///< [N/m^3]
    Scalar per_range = 0;  ///< [1/m^2]; infinite if no bound is known

    /// Adds those of another element at the same vertex.
    MEMBRANE_INLINE EnergyRemainder& operator+=(const EnergyRemainder& other) noexcept {
        second += other.second, fourth += other.fourth;
        per_range = larger(per_range, other.per_range);
        return *this;
    }

    /// The bound beyond E - force . d + d . H d / 2, or infinity. `square` is s^2, `quadratic` at least d . H d / 2
    /// [J].
    [[nodiscard]] MEMBRANE_INLINE Scalar at(const Scalar& square, const Scalar& quadratic) const noexcept {
        const Scalar beyond = square * (second + 2 * root_of<Scalar>(fourth * quadratic) + square * fourth);
        constexpr auto unknown = std::numeric_limits<Each<Scalar>>::infinity();
        return select<Scalar>(square * per_range <= 1, beyond, unknown);
    }
};

/// Force on a vertex and an upper bound of the energy: for a displacement d of length up to rho the energy is at most
/// E - force . d + d . (stiffness I - stiffness_reduction / (1 + rho / size)) d / 2 + remainder, see
/// `CurvedSum`.
template <Number Scalar>
struct EnergyMajoriser {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();              ///< [N]
    Scalar stiffness = 0;                                         ///< [N/m]
    Symmetric3<Scalar> stiffness_reduction;                       ///< positive semidefinite [N/m]
    Scalar size = std::numeric_limits<Each<Scalar>>::infinity();  ///< [m]
    EnergyRemainder<Scalar> remainder{};                          ///< of elements that are not springs
};

/// Change of the energy by the displacement of one vertex.
template <Number Scalar>
struct EnergyChange {
    Scalar change = 0;  ///< [J]
    Scalar size = 0;    ///< of the summed terms: times epsilon, the rounding error [J]

    /// Adds changes and sizes: of the elements at one vertex.
    EnergyChange& operator+=(const EnergyChange& other) noexcept {
        change += other.change, size += other.size;
        return *this;
    }
};

/// The elastic elements of a membrane: a `MassSpringNetwork`, a `TearableSprings` or a `Tissue` of this scalar. What a
/// user adds is a law of the springs (`SpringLaw`) or an `Element` of a tissue.
template <class Network, class Scalar>
concept ElasticNetwork = Real<Scalar> && std::same_as<typename Network::Scalar, Scalar> &&
    requires(const Network& network, Index v) {
    network.law();
    network.springs_of(v);
    network.neighbours(v);
};

namespace detail {

/// The length of half a spacing of numbers in each coordinate, at the largest coordinate of `x`, 3 x V [m]: a vertex is
/// at most that far from where an update would move it.
template <Real Scalar>
[[nodiscard]] Scalar position_rounding(const Points<Scalar>& x) noexcept {
    return Scalar(0.87) * std::numeric_limits<Scalar>::epsilon() * x.cwiseAbs().maxCoeff();
}

/// The force that is negligible on every vertex of a mesh, by the stiffness of all springs or elements at it.
template <Real Scalar>
struct NegligibleForce {
    /// Of a mesh with positions `x`, 3 x V [m]. Cost: O(V).
    explicit NegligibleForce(const Points<Scalar>& x)
        : at_vertex(static_cast<std::size_t>(x.cols()), 0), in_position(position_rounding(x)) {
        const auto width = [&](Index k) { return x.row(k).maxCoeff() - x.row(k).minCoeff(); };
        in_size = 16 * std::numeric_limits<Scalar>::epsilon() * ((std::max)({width(0), width(1), width(2)}) / 2);
    }

    /// Adds a spring or element at vertex `v` [N/m], [m].
    void add(Index v, Scalar stiffness, Scalar length) noexcept {
        Scalar& sum = at_vertex[static_cast<std::size_t>(v)];
        sum += stiffness;
        force = (std::max)({force, stiffness * (std::max)(length / Scalar(1e9), in_size), sum * in_position});
    }

    std::vector<Scalar> at_vertex;  ///< sum of stiffnesses [N/m]
    Scalar in_size, in_position;    ///< rounding errors [m]
    Scalar force = 0;               ///< [N]
};

}  // namespace detail

}  // namespace membrane
