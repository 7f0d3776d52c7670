// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include <membrane/core/types.hpp>

namespace membrane {

/// A point of the surface that a constraint acts on, and the force it acts with.
///
///     context.add_point({triangle, 0, corners, weights, normal, force});
///     const auto* before = context.cached_point(triangle, 0, corners[0]);   // of the step before, or null
template <Real Scalar>
struct ContactPoint {
    Index triangle;  ///< with `feature`, what identifies the point from step to step
    int feature;     ///< of the tool, see `feature_pairs`; an own constraint numbers its points as it likes
    std::array<Index, 3> corners;
    Vector3<Scalar> weights;  ///< of the corners: barycentric
    Vector3<Scalar> normal;   ///< from the surface to the tool
    Vector3<Scalar> force;    ///< on the membrane [N]
    bool on_fixed = false;    ///< whether a corner is fixed, and bears part of the force
};

}  // namespace membrane
