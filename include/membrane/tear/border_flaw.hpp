// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <membrane/tear/crack_driving_force.hpp>
#include <membrane/tear/torn_surface.hpp>

/// The energy that a flaw of the border releases as it becomes a tear.
///
///     const auto border = membrane::border_state<double>(tear.surface(), v, x, tissue);
///     const auto force = membrane::flaw_driving_force(border, 20e-6);  // of a flaw of 20 um [N]
namespace membrane {

/// The membrane at a vertex of its border. Directions, widths and areas are those at rest.
template <Real Scalar>
struct BorderState {
    Vector3<Scalar> along = Vector3<Scalar>::Zero();   ///< unit vector along the border, the membrane on its left
    Vector3<Scalar> inward = Vector3<Scalar>::Zero();  ///< unit vector into the membrane; both 0: not on a border
    Scalar stretch = 1;                                ///< along the border
    Scalar tension = 0;                                ///< along the border, per width [N/m]; negative: compression
    Scalar energy = 0;                                 ///< of that tension, per area [J/m^2]
};

/// The state of the border at vertex `v`, as the mean of the triangles around it. Of their energy it has the share of
/// the tension along the border in the squared tensions: all of it where no force acts across the border. Online.
template <Real Scalar, class Network>
[[nodiscard]] BorderState<Scalar> border_state(const TornSurface<Scalar>& surface, Index v,
                                               const ConstPointsRef<Scalar>& x, const Network& network) noexcept;

/// The energy that an advance of a flaw releases, per length [N]: a cut of this `length` [m] into a straight border
/// under tension. 2 k W c for the energy W per area and the length c [Rivlin53], with k = 1.1215^2 pi / sqrt(stretch):
/// that of an edge crack in linear elasticity [Tada00], decreasing with the stretch as in [Lindley72]. At stretches of
/// 1.2 to 2 a cut in a sheet of rubber-like tissue releases 10 to 30 % less. It is 0 where the border is slack or in
/// compression.
template <Real Scalar>
[[nodiscard]] Scalar flaw_driving_force(const BorderState<Scalar>& border, Scalar length) noexcept {
    if (!(border.tension > 0 && border.stretch > 0)) return 0;
    constexpr auto factor = Scalar(2 * 1.1215 * 1.1215 * std::numbers::pi);
    return factor / std::sqrt(border.stretch) * border.energy * length;
}

namespace detail {

/// The sum of the directions of both border edges at `v` at rest.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> along_border(const TornSurface<Scalar>& surface, Index v) noexcept {
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (const Index f : surface.adjacency().triangles_of(v)) {
        const auto corners = surface.corners(f);
        const auto& across = surface.adjacency().triangle_neighbours(f);
        const auto edge = [&](std::size_t k) {
            const auto& rest = surface.rest_positions();
            return direction_or_zero<Scalar>(point(rest, corners[(k + 1) % 3]) - point(rest, corners[k]));
        };
        for (std::size_t k = 0; k < 3; ++k) {
            const bool is_at_v = corners[k] == v || corners[(k + 1) % 3] == v;
            if (is_at_v && across[k] == no_index) sum += edge(k);
        }
    }
    return sum;
}

}  // namespace detail

template <Real Scalar, class Network>
BorderState<Scalar> border_state(const TornSurface<Scalar>& surface, Index v, const ConstPointsRef<Scalar>& x,
                                 const Network& network) noexcept {
    BorderState<Scalar> border;
    const Vector3<Scalar> normal = surface.rest_normal(v), edges = detail::along_border(surface, v);
    border.along = direction_or_zero<Scalar>(edges - dot(edges, normal) * normal);
    border.inward = cross(normal, border.along);
    if (border.along == Vector3<Scalar>::Zero()) return border;
    Vector3<Scalar> force = Vector3<Scalar>::Zero(), stretch = Vector3<Scalar>::Zero();  // times area
    Scalar energy = 0, squares = 0, area = 0;
    for (const Index f : surface.adjacency().triangles_of(v)) {
        const auto at_rest = surface.corners_at(surface.rest_positions(), f), now = surface.corners_at(x, f);
        const RestTriangle<Scalar> shape(at_rest);
        const auto response = network.triangle_response(f, surface.corners(f), x);
        for (std::size_t k = 1; k < 3; ++k) {
            force -= dot<Scalar>(at_rest[k] - at_rest[0], border.along) * response.force[k];
            stretch += shape.area * dot(shape.gradient[k], border.along) * (now[k] - now[0]);
        }
        const auto squared = squared_tension(shape, at_rest, response);
        squares += shape.area * (squared.xx + squared.yy + squared.zz);
        energy += response.energy;
        area += shape.area;
    }
    border.stretch = norm(stretch) / area;
    border.tension = dot(force, direction_or_zero(stretch)) / area;
    if (squares > 0) border.energy = energy / area * (squared_norm(force) / (squares * area));
    return border;
}

}  // namespace membrane
