// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <type_traits>

#include <membrane/solve/contact_state.hpp>
#include <membrane/solve/vertex_rows.hpp>

/// The stiffness of vertices that constraints cannot move freely, against these constraints: constraints that cannot
/// all hold then share the violation.
///
/// A fixed vertex, pinned or prescribed, would leave the contact force of a penetrating tool undetermined, and the
/// force would depend on whether a contact point has a thousandth of its weight on a free corner. Against constraints,
/// a fixed vertex is therefore on a spring of stiffness k to its position. A contact point with the weights w has on
/// fixed corners the compliance sum w^2 / k, added to that of the free corners. So its force is continuous in the
/// tool's position, and k d at a penetration d of a fixed vertex. The forces of several points on a fixed vertex add
/// up, but each displaces it by at least w / k times its own: opposite forces, as on both sides of a shaft, stay
/// bounded. Springs and foundation use the vertex's own position.
///
/// A free vertex may be shared: several constraints have points on it, as two tools that pinch a sheet, or a tool on
/// tissue that forceps hold. If one constraint acts on it with the force f, and the others oppose f by g, then to this
/// constraint the vertex seems displaced by f g / (f + g) / k. Without opposition this is 0; a fixed vertex opposes any
/// force. So two tools that overlap by d penetrate by d / 2 each, with the force k d at a vertex between them.
namespace membrane {

namespace detail {

// A free vertex among fixed neighbours has the compliance 1 / stiffness, among free neighbours several times that. With
// a factor of 4 a fixed vertex is stiffer than every free one, and the contact forces at a rim and at the vertices
// beside it still converge in few iterations.
inline constexpr int support_factor = 4;

// A free vertex between two tools also yields sideways: a stiffer one would be squeezed out from between them.
inline constexpr double shared_support_factor = 0.5;

}  // namespace detail

/// The stiffness of vertex `v` at the start of the step, by its springs and foundation without damping [N/m].
template <class Scalar, class Network, class Volume>
[[nodiscard]] Scalar own_stiffness(const StepInput<Scalar, Network, Volume>& scene, Index v) noexcept {
    const Vector3<Scalar> here = point(scene.start, v);
    constexpr Scalar for_ever = (std::numeric_limits<Scalar>::max)();  // damping vanishes
    return scene.network.force_on(v, scene.start).stiffness + scene.volume.force_on(v, here, here, for_ever).stiffness;
}

/// Sets the stiffness against constraints of the fixed and the shared ones among `vertices`. Fixed: `stiffness` [N/m],
/// or for 0 four times the largest stiffness of the vertex and its neighbours. Shared: half of that largest stiffness.
/// Online. Cost: the springs of the vertices' neighbours.
template <class Scalar, class Network, class Volume>
void set_supports(const StepInput<Scalar, Network, Volume>& scene, ContactState<Scalar>& contacts,
                  std::type_identity_t<Scalar> stiffness, std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        const bool fixed = scene.rows.is_fixed(v);
        if (!fixed && !contacts.shared.contains(v)) continue;
        Scalar support = stiffness;
        if (stiffness == 0 || !fixed) {
            Scalar stiffest = own_stiffness(scene, v);
            for (const auto& end : scene.network.neighbours(v)) {
                stiffest = (std::max)(stiffest, own_stiffness(scene, end.other));
            }
            support = (fixed ? detail::support_factor : static_cast<Scalar>(detail::shared_support_factor)) * stiffest;
        }
        contacts.set_support_stiffness(v, support);
        if (fixed) scene.rows.clear_response(v);
    }
}

}  // namespace membrane
