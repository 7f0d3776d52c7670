// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/model/mass_spring_network.hpp>

namespace membrane {

/// Largest curvature that the network gives the energy when vertex `v` moves alone [N/m]: the largest eigenvalue
/// of the vertex's own 3 x 3 block. Moving vertices one by one converges while the step for each newton stays below 2
/// over this; the sum of stiffnesses in `VertexForce` is a bound of it that costs nothing.
template <Real Scalar, ElasticNetwork<Scalar> Network>
[[nodiscard]] Scalar largest_curvature(const Network& network, Index v, const ConstPointsRef<Scalar>& x) noexcept {
    return largest_eigenvalue(network.curvature(v, x));
}

/// At least that, in half the time; of several vertices at once, too.
template <Number Scalar>
[[nodiscard]] Scalar curvature_bound(const EnergyMajoriser<Scalar>& pull) noexcept {
    Symmetric3<Scalar> block = diagonal3(pull.stiffness);
    block += Scalar(-1) * pull.stiffness_reduction;
    return eigenvalue_bound(block);
}

}  // namespace membrane
