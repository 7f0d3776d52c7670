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
/// `MassSpringNetwork::majoriser`.
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

/// The elastic elements of a membrane: springs, or springs and others. Beyond the signatures: all forces derive from
/// one energy; `neighbours(v)` lists, by their `other`, all vertices whose position changes the force on `v`; the bound
/// of `EnergyMajoriser` holds for every displacement if the network `never_stiffens`, else as far as its
/// remainder is known.
template <class Network, class Scalar>
concept ElasticNetwork = Real<Scalar> && std::same_as<typename Network::Scalar, Scalar> &&
    requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x, const Vector3<Scalar>& displacement) {
    { Network::never_stiffens } -> std::convertible_to<bool>;
    { network.vertex_count() }
    noexcept->std::same_as<Index>;
    { network.pinned(v) }
    noexcept->std::same_as<bool>;
    { network.has_masses() }
    noexcept->std::same_as<bool>;
    { network.mass(v) }
    noexcept->std::same_as<Scalar>;
    { network.viscosity(v) }
    noexcept->std::same_as<Scalar>;
    { network.neighbours(v)[0].other } -> std::convertible_to<Index>;
    { network.force_on(v, x) }
    noexcept->std::same_as<VertexForce<Scalar>>;
    { network.majoriser(v, x) }
    noexcept->std::same_as<EnergyMajoriser<Scalar>>;
    { network.hessian(v, x) }
    noexcept->std::same_as<Symmetric3<Scalar>>;
    { network.energy_change(v, displacement, x) }
    noexcept->std::same_as<EnergyChange<Scalar>>;
    { network.force_tolerance() }
    noexcept->std::same_as<Scalar>;
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

template <class Network, class Scalar>
consteval bool check_elastic_network() noexcept {  // NOLINT(readability-function-size): a sentence for each requirement
    static_assert(
        requires { requires std::same_as<typename Network::Scalar, Scalar>; },
        "ElasticNetwork: must have Scalar, the scalar of the solver");
    static_assert(
        requires {
            { Network::never_stiffens } -> std::convertible_to<bool>;
        },
        "ElasticNetwork: must have static constexpr bool never_stiffens");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.vertex_count() }
            noexcept->std::same_as<Index>;
        },
        "ElasticNetwork: vertex_count() const noexcept must return Index");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.pinned(v) }
            noexcept->std::same_as<bool>;
        },
        "ElasticNetwork: pinned(Index) const noexcept must return bool");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.has_masses() }
            noexcept->std::same_as<bool>;
        },
        "ElasticNetwork: has_masses() const noexcept must return bool");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.mass(v) }
            noexcept->std::same_as<Scalar>;
        },
        "ElasticNetwork: mass(Index) const noexcept must return Scalar");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.viscosity(v) }
            noexcept->std::same_as<Scalar>;
        },
        "ElasticNetwork: viscosity(Index) const noexcept must return Scalar");
    static_assert(
        requires(const Network& network, Index v) {
            { network.neighbours(v)[0].other } -> std::convertible_to<Index>;
        },
        "ElasticNetwork: neighbours(Index) const must give a range of something with .other, an Index");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.force_on(v, x) }
            noexcept->std::same_as<VertexForce<Scalar>>;
        },
        "ElasticNetwork: force_on(Index, const ConstPointsRef<Scalar>&) const noexcept must return "
        "VertexForce<Scalar>");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.majoriser(v, x) }
            noexcept->std::same_as<EnergyMajoriser<Scalar>>;
        },
        "ElasticNetwork: majoriser(Index, const ConstPointsRef<Scalar>&) const noexcept must return "
        "EnergyMajoriser<Scalar>");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.hessian(v, x) }
            noexcept->std::same_as<Symmetric3<Scalar>>;
        },
        "ElasticNetwork: hessian(Index, const ConstPointsRef<Scalar>&) const noexcept must return "
        "Symmetric3<Scalar>");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.energy_change(v, displacement, x) }
            noexcept->std::same_as<EnergyChange<Scalar>>;
        },
        "ElasticNetwork: energy_change(Index, const Vector3<Scalar>&, const ConstPointsRef<Scalar>&) const noexcept "
        "must return EnergyChange<Scalar>");
    static_assert(
        requires(const Network& network, Index v, const ConstPointsRef<Scalar>& x,
                 const Vector3<Scalar>& displacement) {
            { network.force_tolerance() }
            noexcept->std::same_as<Scalar>;
        },
        "ElasticNetwork: force_tolerance() const noexcept must return Scalar");
    return ElasticNetwork<Network, Scalar>;
}

}  // namespace detail

/// An `ElasticNetwork`: if a type does not satisfy it, the error names the missing requirement.
template <class Network, class Scalar>
concept CheckedElasticNetwork = detail::check_elastic_network<Network, Scalar>();

}  // namespace membrane
