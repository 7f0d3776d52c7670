// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <membrane/surface/aabb.hpp>
#include <membrane/surface/triangle.hpp>

namespace membrane {

/// Time of impact of the triangle with `q` as its corners move in straight lines: a time from 0 to 1 just before the
/// impact, or 1 if there is none. The volume between triangle and `q` is a cubic of time, and changes its sign at the
/// impact.
template <Real Scalar>
[[nodiscard]] Scalar time_of_impact(const Triangle<Scalar>& from, const Triangle<Scalar>& to,
                                    const Vector3<Scalar>& q) noexcept;

namespace detail {

/// The polynomial of degree 3 with these Bernstein coefficients, at `t`.
template <Real Scalar>
[[nodiscard]] Scalar cubic_at(const std::array<Scalar, 4>& p, Scalar t) noexcept {
    const auto between = [t](Scalar a, Scalar b) { return (1 - t) * a + t * b; };
    const Scalar ab = between(p[0], p[1]), bc = between(p[1], p[2]), cd = between(p[2], p[3]);
    return between(between(ab, bc), between(bc, cd));
}

/// `part / whole` clamped to [0, 1], for any two numbers.
template <Real Scalar>
[[nodiscard]] Scalar quotient_inside(Scalar part, Scalar whole) noexcept {
    return whole < 0 ? fraction(-part, -whole) : fraction(part, whole);
}

/// 0, 1, and the times between at which the cubic may have an extremum, ascending: it is monotonic from each to the
/// next.
template <Real Scalar>
[[nodiscard]] std::array<Scalar, 4> turning_times(const std::array<Scalar, 4>& p) noexcept {
    const Scalar c = p[1] - p[0], b = (p[2] - p[1]) - c, a = (p[3] - p[2]) - (p[2] - p[1]) - b;  // a t^2 + 2 b t + c
    const Scalar root = std::sqrt((std::max)(b * b - a * c, Scalar(0)));
    const Scalar sum = b < 0 ? b - root : b + root;
    const auto [first, second] = std::minmax({quotient_inside(-sum, a), quotient_inside(-c, sum)});
    return {0, first, second, 1};
}

}  // namespace detail

template <Real Scalar>
Scalar time_of_impact(const Triangle<Scalar>& from, const Triangle<Scalar>& to, const Vector3<Scalar>& q) noexcept {
    Aabb<Scalar> swept = bounds(from);
    swept.include(bounds(to));
    if (!contains(swept, q)) return 1;

    const Triangle<Scalar> begin{from.a - q, from.b - q, from.c - q}, end{to.a - q, to.b - q, to.c - q};
    const auto volume = [](const Vector3<Scalar>& a, const Vector3<Scalar>& b, const Vector3<Scalar>& c) {
        return dot(a, cross(b, c));
    };
    const std::array<Scalar, 4> volumes{
        volume(begin.a, begin.b, begin.c),
        (volume(end.a, begin.b, begin.c) + volume(begin.a, end.b, begin.c) + volume(begin.a, begin.b, end.c)) / 3,
        (volume(begin.a, end.b, end.c) + volume(end.a, begin.b, end.c) + volume(end.a, end.b, begin.c)) / 3,
        volume(end.a, end.b, end.c)};
    const auto [least, most] = std::minmax_element(volumes.begin(), volumes.end());
    if (*least > 0 || *most < 0) return 1;  // a cubic stays between its Bernstein coefficients

    const Scalar size = detail::largest_magnitude<Scalar>(swept.high - swept.low);
    const auto is_behind = [&](Scalar t) { return detail::cubic_at(volumes, t) < 0; };
    const auto meets = [&](Scalar t) {
        const auto corner = [t](const Vector3<Scalar>& a, const Vector3<Scalar>& b) {
            return Vector3<Scalar>((1 - t) * a + t * b);
        };
        const Triangle<Scalar> then{corner(begin.a, end.a), corner(begin.b, end.b), corner(begin.c, end.c)};
        return closest_point<Scalar>(then, Vector3<Scalar>::Zero()).squared_distance <= Scalar(1e-10) * size * size;
    };
    constexpr int halvings = 40;
    const auto times = detail::turning_times(volumes);
    for (std::size_t i = 0; i < 3; ++i) {
        Scalar first = times[i], last = times[i + 1];
        const bool before = is_behind(first);
        if (is_behind(last) == before) continue;
        for (int k = 0; k < halvings; ++k) {
            const Scalar middle = (first + last) / 2;
            (is_behind(middle) == before ? first : last) = middle;
        }
        if (meets(last)) return first;
    }
    return 1;
}

}  // namespace membrane
