// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/model/mass_spring_network.hpp>

namespace membrane {

/// The largest eigenvalue of the 3 x 3 Hessian block of vertex `v` in the network [N/m]. Updates vertex by vertex
/// converge while the compliance of the step stays below 2 over this. The stiffness of `VertexForce` is a bound of it
/// at no cost.
template <Real Scalar, ElasticNetwork<Scalar> Network>
[[nodiscard]] Scalar largest_eigenvalue_at(const Network& network, Index v, const ConstPointsRef<Scalar>& x) noexcept {
    return largest_eigenvalue(network.hessian(v, x));
}

/// A bound of that eigenvalue from above, in half the time; in lanes, too.
template <Number Scalar>
[[nodiscard]] Scalar stiffness_bound_of(const EnergyMajoriser<Scalar>& majoriser) noexcept {
    Symmetric3<Scalar> block = diagonal3(majoriser.stiffness);
    block += Scalar(-1) * majoriser.stiffness_reduction;
    return eigenvalue_bound(block);
}

}  // namespace membrane
