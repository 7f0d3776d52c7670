// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <limits>

#include <membrane/core/lanes.hpp>
#include <membrane/model/elastic_network.hpp>

/// An element of any number of vertices: its force, its energy, and their derivatives.
///
///     static_assert(membrane::Element<MyElement>);
///     const membrane::CornerForce<double> on_second_corner = element.force_on(corners, 1);        // [N], [N/m]
namespace membrane {

/// Force of an element on one of its corners, and the Hessian of its energy by that corner.
template <Number Scalar>
struct CornerForce {
    Vector3<Scalar> force = Vector3<Scalar>::Zero();  ///< [N]
    Symmetric3<Scalar> hessian = {};                  ///< of the energy by the corner, positive semidefinite [N/m]
    EnergyRemainder<Scalar> remainder{
        .per_range = std::numeric_limits<Each<Scalar>>::infinity()};  ///< of the energy beyond force and Hessian

    /// Adds those of another element at the same vertex.
    MEMBRANE_INLINE CornerForce& operator+=(const CornerForce& other) noexcept {
        force += other.force, hessian += other.hessian, remainder += other.remainder;
        return *this;
    }
};

/// Adds the elements at a vertex, with their Hessian at the present positions; the size is left as it is.
template <Number Scalar>
MEMBRANE_INLINE void add(EnergyMajoriser<Scalar>& sum, const CornerForce<Scalar>& elements) noexcept {
    const Scalar stiffness = eigenvalue_bound(elements.hessian);
    sum.force += elements.force;
    sum.stiffness += stiffness;
    sum.stiffness_reduction += diagonal3(stiffness);
    sum.stiffness_reduction += Scalar(-1) * elements.hessian;
    sum.remainder += elements.remainder;
}

/// Positions of an element's corners [m].
template <Number Scalar, std::size_t count>
using Corners = std::array<Vector3<Scalar>, count>;

/// One element with its constants, evaluated in float and in double. Beyond the signatures: force, Hessian and change
/// of energy belong to one energy; `hessian_block(x, i, j)` is its second derivative by corners i and j [N/m], or an
/// approximation with which Newton's method still converges.
///
/// Optional, where not all corners are joined by edges of the mesh:
/// - `E::edges`: the pairs of corners that are. A `PropagationQueue` counts its layers along edges.
///
/// Optional, so that a membrane may tear:
/// - `E::triangles`: the triples of corners that are triangles of the mesh, if there is more than one.
/// - `reshaped(before, after)`: the element of the same material whose triangle has other corners at rest; or
///   `E::is_load`, if its energy does not depend on the shape at rest.
///
/// Optional, for speed, and satisfied by the elements of this library:
/// - `CornerForce::remainder`: with it most updates need no evaluation of the energy.
/// - `E` is `E<Scalar>`, its members are `Scalar`s, and it takes `Lanes` as constants and as positions: several
///   elements of one kind at once, each with the same bits as alone. With all constants zero it has neither force nor
///   energy, also where all corners coincide: lanes without an element have such a one.
/// - `E::orders` and `in_order(i)`: in the order `orders[i]` of the corners, with the constants `in_order(i)`, the
///   element is the same. Corners that come to the same place are evaluated together.
template <class E>
concept Element = std::copyable<E> && requires(const E& element, const Corners<double, E::corner_count>& x,
                                               const Corners<float, E::corner_count>& y, std::size_t i) {
    { element.force_on(x, i) }
    noexcept->std::same_as<CornerForce<double>>;
    { element.force_on(y, i) }
    noexcept->std::same_as<CornerForce<float>>;
    { element.energy(x) }
    noexcept->std::same_as<double>;
    { element.energy_change(x, i, x[i]) }
    noexcept->std::same_as<EnergyChange<double>>;
    { element.energy_change(y, i, y[i]) }
    noexcept->std::same_as<EnergyChange<float>>;
    { element.hessian_block(x, i, i) } -> std::same_as<Eigen::Matrix3d>;
};

/// An element and its vertices.
template <class E>
struct ElementInstance {
    std::array<Index, E::corner_count> corners;  ///< vertices, in the order of the element
    E element;                                   ///< the constants

    /// Positions of its corners.
    template <class Positions>
    [[nodiscard]] Corners<typename Positions::Scalar, E::corner_count> where(const Positions& x) const noexcept {
        Corners<typename Positions::Scalar, E::corner_count> positions;
        for (std::size_t i = 0; i < positions.size(); ++i) positions[i] = point(x, corners[i]);
        return positions;
    }
};

namespace detail {

template <class E>
consteval bool check_element() noexcept {  // NOLINT(readability-function-size): a sentence for each requirement
    static_assert(std::copyable<E>, "Element: must be copyable");
    static_assert(
        requires {
            requires E::corner_count >
            0;
        },
        "Element: must have static constexpr corner_count, the number of its corners");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.force_on(x, i) }
            noexcept->std::same_as<CornerForce<double>>;
        },
        "Element: force_on(const Corners<double, corner_count>&, std::size_t) const noexcept must return "
        "CornerForce<double>");
    static_assert(
        requires(const E& element, const Corners<float, E::corner_count>& x, std::size_t i) {
            { element.force_on(x, i) }
            noexcept->std::same_as<CornerForce<float>>;
        },
        "Element: force_on(const Corners<float, corner_count>&, std::size_t) const noexcept must return "
        "CornerForce<float>");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.energy(x) }
            noexcept->std::same_as<double>;
        },
        "Element: energy(const Corners<double, corner_count>&) const noexcept must return double");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.energy_change(x, i, x[i]) }
            noexcept->std::same_as<EnergyChange<double>>;
        },
        "Element: energy_change(const Corners<double, corner_count>&, std::size_t, const Vector3<double>&) const "
        "noexcept must return EnergyChange<double>");
    static_assert(
        requires(const E& element, const Corners<float, E::corner_count>& x, std::size_t i) {
            { element.energy_change(x, i, x[i]) }
            noexcept->std::same_as<EnergyChange<float>>;
        },
        "Element: energy_change(const Corners<float, corner_count>&, std::size_t, const Vector3<float>&) const "
        "noexcept must return EnergyChange<float>");
    static_assert(
        requires(const E& element, const Corners<double, E::corner_count>& x, std::size_t i) {
            { element.hessian_block(x, i, i) } -> std::same_as<Eigen::Matrix3d>;
        },
        "Element: hessian_block(const Corners<double, corner_count>&, std::size_t, std::size_t) const must return "
        "Eigen::Matrix3d");
    return Element<E>;
}

}  // namespace detail

/// An `Element`: if a type does not satisfy it, the error names the missing requirement.
template <class E>
concept CheckedElement = detail::check_element<E>();

/// Energy of a triangle [J], and its forces on its corners [N].
template <Real Scalar>
struct TriangleResponse {
    Scalar energy = 0;  ///< [J]
    /// On the corners [N].
    std::array<Vector3<Scalar>, 3> force{Vector3<Scalar>::Zero(), Vector3<Scalar>::Zero(), Vector3<Scalar>::Zero()};
};

}  // namespace membrane
