// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include <membrane/network/mass_spring_network.hpp>

namespace membrane {

/// Largest curvature that the springs of vertex `v` give the energy when it moves alone [N/m]: the largest eigenvalue
/// of the vertex's own 3 x 3 block. Moving vertices one by one converges while the step for each newton stays below 2
/// over this; the sum of stiffnesses in `Pull` is a bound of it that costs nothing.
template <Real Scalar, class Law>
[[nodiscard]] Scalar largest_curvature(const MassSpringNetwork<Scalar, Law>& network, Index v,
                                       const ConstPointsRef<Scalar>& x) noexcept;

/// At least that, in half the time; of several vertices at once, too.
template <Number Scalar>
[[nodiscard]] Scalar curvature_bound(const CurvedPull<Scalar>& pull) noexcept {
    Symmetric3<Scalar> block = diagonal3(pull.stiffness);
    block += Scalar(-1) * pull.relief;
    return root_of<Scalar>((block.xx * block.xx + block.yy * block.yy + block.zz * block.zz) +
                           2 * (block.xy * block.xy + block.xz * block.xz + block.yz * block.yz));
}

template <Real Scalar, class Law>
Scalar largest_curvature(const MassSpringNetwork<Scalar, Law>& network, Index v,
                         const ConstPointsRef<Scalar>& x) noexcept {
    Symmetric3<Scalar> block;
    network.for_each_pull(v, x, [&](const SpringPull<Scalar>& spring) {
        block += diagonal3(spring.across);
        if (spring.length != 0) block += outer<Scalar>(spring.along - spring.across, spring.reach / spring.length);
    });
    return largest_eigenvalue(block);
}

}  // namespace membrane
