// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>

#include <membrane/contact/tool.hpp>

/// Where a surface and a tool touch, point by point.
///
///     for (const auto& point : contact.points) std::printf("gap %g m\n", point.gap);         // found by the tracker
///     for (const auto& point : solver.contact_points(0)) total += point.force;               // after a step [N]
namespace membrane {

/// The point of a triangle that is nearest to one feature of the tool, and the force there. It is found by the tracker,
/// brought up to date and loaded by the solver, and by Newton's method where the exact equilibrium is wanted.
template <Real Scalar>
struct ContactPoint {
    Index triangle = no_index;  ///< with `feature`, what identifies the point from step to step
    int feature = 0;            ///< of the tool, see `feature_pairs`; an own constraint numbers its points as it likes
    std::array<Index, 3> corners{no_index, no_index, no_index};
    Vector3<Scalar> weights = Vector3<Scalar>::Zero();  ///< of the corners: barycentric
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();   ///< unit vector from the surface to the tool; zero on its axis
    Vector3<Scalar> force = Vector3<Scalar>::Zero();    ///< on the membrane [N]
    bool on_fixed = false;  ///< whether a corner is fixed, and takes part of the force; the solver sets it
    bool by_plane = false;  ///< whether the tool stays on its side of the triangle's plane, there and beside it
    Scalar side = 0;        ///< of the triangle that the tool is on where it is over its inside, 1 or -1; 0: as before
    Scalar gap = 0;         ///< signed distance of the tool when the point was found [m]; negative where it overlaps
};

/// The contact point of triangle `f` and a feature of the tool, 0 to `feature_pairs(tool)` - 1, without force; none where the
/// axis is nearest with another feature. `radius` is the tool's [m].
template <Real Scalar>
[[nodiscard]] std::optional<ContactPoint<Scalar>> contact_point(Index f, const std::array<Index, 3>& corners,
                                                                const Triangle<Scalar>& triangle,
                                                                const Tool<Scalar>& tool, int feature,
                                                                Scalar radius) noexcept {
    const auto nearest = proximity(triangle, tool, feature);
    if (!nearest) return std::nullopt;
    ContactPoint<Scalar> point{f, feature, corners, nearest->barycentric};
    point.normal = direction(nearest->reach, Vector3<Scalar>::Zero());
    point.gap = norm(nearest->reach) - radius;
    return point;
}

}  // namespace membrane
