// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <limits>
#include <span>

#include <membrane/solve/region.hpp>

/// How stiff a pinned or held vertex is to a tool.
///
/// A vertex that does not give way would answer a tool inside the surface with any force, and the force would depend on
/// whether a contact point has a thousandth of its weight on a free corner. To tools, and to them alone, a fixed vertex
/// is therefore one on a spring of stiffness k to its place: a contact point with the weights w bears on fixed corners with
/// the compliance sum w^2 / k, beside that of the free ones, so that its force is continuous in the tool's position, and a
/// tool that is d inside a fixed vertex is pushed out with k d. Springs and backing see the vertex where it is.
namespace membrane {

namespace detail {

// A free vertex whose neighbours stand still gives way by 1 / stiffness for each newton; among neighbours that give way
// it does so several times as far. With a factor of 4 what is fixed is stiffer than all that may move, beyond doubt, and
// the contact forces of a rim and the vertices beside it still find their balance in few rounds.
inline constexpr int support_factor = 4;

}  // namespace detail

/// The stiffness of the vertex `v`, its springs and backing without damping [N/m].
template <Real Scalar, class Network, class Volume>
[[nodiscard]] Scalar own_stiffness(const Network& network, const Volume& volume, const Region<Scalar>& region,
                                   Index v) noexcept {
    const Vector3<Scalar> here = region.position(v);
    constexpr Scalar for_ever = (std::numeric_limits<Scalar>::max)();  // nothing is left of damping
    return network.pull(v, region.positions()).stiffness + volume.pull(v, here, here, for_ever).stiffness;
}

/// Sets how stiff those of the `vertices` are to tools that are fixed: `stiffness` [N/m], or for 0 four times as stiff as
/// the stiffest of each and its neighbours. Online. Cost: for 0, the springs of the fixed vertices' neighbours.
template <Real Scalar, class Network, class Volume>
void set_supports(const Network& network, const Volume& volume, Scalar stiffness, Region<Scalar>& region,
                  std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (!region.fixed(v)) continue;
        Scalar support = stiffness;
        if (stiffness == 0) {
            Scalar stiffest = own_stiffness(network, volume, region, v);
            for (const auto& end : network.neighbours(v)) {
                stiffest = (std::max)(stiffest, own_stiffness(network, volume, region, end.other));
            }
            support = detail::support_factor * stiffest;
        }
        region.set_support(v, support);
    }
}

}  // namespace membrane
