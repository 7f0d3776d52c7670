// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <type_traits>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/local_surface.hpp>
#include <membrane/core/exact_sign.hpp>

/// Whether a point is inside a closed surface, also one with creases and folds.
///
///     if (winding_number(surface, tree, x, tool.position) != 0) tunnelled = true;
namespace membrane {

/// Winding number of a closed surface about `q`: 0 outside a valid surface, 1 inside. It changes only if `q` passes
/// through the surface. Undefined for an open surface; exact except on the surface itself. Online. Cost: the triangles
/// in the boxes that the shortest axis-parallel ray from `q` out of the tree meets.
/// @pre `tree` was last fitted to `x`
template <Real Scalar>
[[nodiscard]] int winding_number(const LocalSurface<Scalar>& surface, const AabbTree<Scalar>& tree,
                                 const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                 const Vector3<Scalar>& q) noexcept;

namespace detail {

/// Winding number of the triangle about `q`, seen from the end of axis `k`. A point on a side that two triangles share
/// is in exactly one of them.
[[nodiscard]] inline int winding_in_plane(const Triangle<double>& triangle, const Vector3<double>& q, int k) noexcept {
    const int up = (k + 2) % 3;
    int sum = 0;
    for (int i = 0; i < 3; ++i) {
        const auto &a = corner(triangle, i), &b = corner(triangle, i == 2 ? 0 : i + 1);
        const bool from_above = a[up] > q[up], to_above = b[up] > q[up];
        if (to_above && !from_above && sign_of_area(a, b, q, k) > 0) ++sum;
        if (from_above && !to_above && sign_of_area(b, a, q, k) > 0) --sum;
    }
    return sum;
}

}  // namespace detail

template <Real Scalar>
int winding_number(const LocalSurface<Scalar>& surface, const AabbTree<Scalar>& tree,
                   const std::type_identity_t<ConstPointsRef<Scalar>>& x, const Vector3<Scalar>& q) noexcept {
    const Aabb<Scalar> all = tree.box(0);
    if (!(squared_distance(all, q) == 0)) return 0;
    const Vector3<Scalar> above = all.high - q, below = q - all.low;
    const bool upward = above.minCoeff() < below.minCoeff();
    const Vector3<Scalar>& lengths = upward ? above : below;  // of the rays
    const auto axis = std::min_element(lengths.begin(), lengths.end()) - lengths.begin();
    Vector3<Scalar> low = q, high = q;
    (upward ? high : low)[axis] = (upward ? all.high : all.low)[axis];

    const Vector3<double> from = q.template cast<double>();
    int sum = 0;
    tree.overlap_box(x, low, high, [&](Index f) {
        const auto t = surface.triangle(x, f);
        const Triangle<double> exact{t.a.template cast<double>(), t.b.template cast<double>(),
                                     t.c.template cast<double>()};
        const int winding = detail::winding_in_plane(exact, from, static_cast<int>(axis));
        if (winding == 0) return;
        const bool is_above = winding * sign_of_volume(exact.a, exact.b, exact.c, from) > 0;
        if (is_above == upward) sum += upward ? winding : -winding;
    });
    return sum;
}

}  // namespace membrane
