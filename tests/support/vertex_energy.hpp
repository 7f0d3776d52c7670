// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <type_traits>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/tissue/elements.hpp>

/// The energy of a network as one vertex moves, from its springs and elements.
///
///     const auto bound = test::majoriser(network, v, x);
///     const auto energy = test::energy_change(network, v, displacement, x);
namespace test {

/// Calls `act(element, corners, i)` for each element of `network` with vertex `v` as its corner `i`.
template <class Network, class Act>
void for_each_element_at(const Network& network, membrane::Index v,
                         const membrane::ConstPointsRef<typename Network::Scalar>& x, const Act& act) {
    if constexpr (requires { network.for_each_kind([](const auto&) {}); }) {
        network.for_each_kind([&](const auto& elements) {
            elements.for_each(v, x, [&](const auto& instance, const auto& corners, std::size_t i) {
                act(instance.element, corners, i);
            });
        });
    }
}

/// The bound of the energy at vertex `v`, as a pack of vertices sums it.
template <class Network>
auto majoriser(const Network& network, membrane::Index v, const membrane::ConstPointsRef<typename Network::Scalar>& x) {
    using Scalar = typename Network::Scalar;
    membrane::CurvedSum<Scalar> springs;
    for (const auto& end : network.springs_of(v)) {
        const membrane::Vector3<Scalar> edge = point(x, end.other) - point(x, v);
        add(springs, membrane::spring_force<Scalar>(network.law(), edge, end.stiffness, end.rest_length));
    }
    membrane::CornerForce<Scalar> elements{{}, {}, {}};
    for_each_element_at(network, v, x, [&](const auto& element, const auto& corners, std::size_t i) {
        elements += element.force_on(corners, i);
    });
    auto sum = springs.total();
    add(sum, elements);
    return sum;
}

/// Change of the energy if vertex `v` is displaced by `by` [m].
template <class Network>
auto energy_change(const Network& network, membrane::Index v, const membrane::Vector3<typename Network::Scalar>& by,
                   const membrane::ConstPointsRef<typename Network::Scalar>& x) {
    using Scalar = typename Network::Scalar;
    using Law = std::remove_cvref_t<decltype(network.law())>;
    membrane::EnergyChange<Scalar> sum;
    for (const auto& end : network.springs_of(v)) {
        const membrane::SpringElement<Scalar, Law> spring{&network.law(), end.stiffness, end.rest_length};
        sum += spring.template energy_change<Scalar>({point(x, v), point(x, end.other)}, 0, by);
    }
    for_each_element_at(network, v, x, [&](const auto& element, const auto& corners, std::size_t i) {
        sum += element.energy_change(corners, i, by);
    });
    return sum;
}

}  // namespace test
