// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <type_traits>

#include <membrane/solve/vertex_update.hpp>

/// How stiff a pinned or held vertex is to a tool.
///
/// A vertex that does not give way would answer a tool inside the surface with any force, and the force would depend on
/// whether a contact point has a thousandth of its weight on a free corner. To tools, and to them alone, a fixed vertex
/// is therefore one on a spring of stiffness k to its place: a contact point with the weights w bears on fixed corners with
/// the compliance sum w^2 / k, beside that of the free ones, so that its force is continuous in the tool's position, and a
/// tool that is d inside a fixed vertex is pushed out with k d. Springs and foundation see the vertex where it is.
namespace membrane {

namespace detail {

// A free vertex whose neighbours stand still gives way by 1 / stiffness for each newton; among neighbours that give way
// it does so several times as far. With a factor of 4 what is fixed is stiffer than all that may move, beyond doubt, and
// the contact forces of a rim and the vertices beside it still find their balance in few rounds.
inline constexpr int support_factor = 4;

}  // namespace detail

/// The stiffness of the vertex `v` where the step begins, its springs and volume spring without damping [N/m].
template <class Scalar, class Network, class Volume>
[[nodiscard]] Scalar own_stiffness(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const Vector3<Scalar> here = point(scene.start, v);
    constexpr Scalar for_ever = (std::numeric_limits<Scalar>::max)();  // nothing is left of damping
    return scene.network.force_on(v, scene.start).stiffness + scene.volume.force_on(v, here, here, for_ever).stiffness;
}

/// Sets how stiff those of the `vertices` are to tools that are fixed: `stiffness` [N/m], or for 0 four times as stiff as
/// the stiffest of each and its neighbours. Online. Cost: for 0, the springs of the fixed vertices' neighbours.
template <class Scalar, class Network, class Volume>
void set_supports(const StepInput<Scalar, Network, Volume>& scene, std::type_identity_t<Scalar> stiffness,
                  std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (!scene.state.is_fixed(v)) continue;
        Scalar support = stiffness;
        if (stiffness == 0) {
            Scalar stiffest = own_stiffness(scene, v);
            for (const auto& end : scene.network.neighbours(v)) {
                stiffest = (std::max)(stiffest, own_stiffness(scene, end.other));
            }
            support = detail::support_factor * stiffest;
        }
        scene.state.set_support_stiffness(v, support);
        scene.state.clear_response(v);
    }
}

}  // namespace membrane
