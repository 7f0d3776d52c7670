// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/mesh/triangle.hpp>

namespace membrane {

/// When the triangle first passes `q` as its corners move in straight lines: a time from 0 to 1 just before it does, or
/// 1 if it does not. Passings that undo each other within a sixteenth of the time may go unseen.
template <Real Scalar>
[[nodiscard]] Scalar passing_time(const Triangle<Scalar>& from, const Triangle<Scalar>& to,
                                  const Vector3<Scalar>& q) noexcept;

template <Real Scalar>
Scalar passing_time(const Triangle<Scalar>& from, const Triangle<Scalar>& to, const Vector3<Scalar>& q) noexcept {
    const Vector3<Scalar> low = from.a.cwiseMin(from.b).cwiseMin(from.c).cwiseMin(to.a).cwiseMin(to.b).cwiseMin(to.c);
    const Vector3<Scalar> high = from.a.cwiseMax(from.b).cwiseMax(from.c).cwiseMax(to.a).cwiseMax(to.b).cwiseMax(to.c);
    if (!((low.array() <= q.array()).all() && (q.array() <= high.array()).all())) return 1;

    const auto seen_from_q = [&](Scalar t) {
        const auto corner = [&](const Vector3<Scalar>& begin, const Vector3<Scalar>& end) {
            return Vector3<Scalar>((1 - t) * (begin - q) + t * (end - q));
        };
        return Triangle<Scalar>{corner(from.a, to.a), corner(from.b, to.b), corner(from.c, to.c)};
    };
    const auto is_behind = [&](Scalar t) {
        const auto triangle = seen_from_q(t);
        return dot(triangle.a, cross(triangle.b, triangle.c)) < 0;
    };
    constexpr int parts = 16, halvings = 30;
    const Scalar size = detail::largest_magnitude<Scalar>(high - low);
    bool before = is_behind(0);
    for (int part = 1; part <= parts; ++part) {
        Scalar first = static_cast<Scalar>(part - 1) / parts, last = static_cast<Scalar>(part) / parts;
        const bool now = is_behind(last);
        if (now == before) continue;
        for (int i = 0; i < halvings; ++i) {
            const Scalar middle = (first + last) / 2;
            (is_behind(middle) == before ? first : last) = middle;
        }
        const auto nearest = closest_point<Scalar>(seen_from_q(last), Vector3<Scalar>::Zero());
        if (nearest.squared_distance <= Scalar(1e-10) * size * size) return first;
        before = now;
    }
    return 1;
}

}  // namespace membrane
