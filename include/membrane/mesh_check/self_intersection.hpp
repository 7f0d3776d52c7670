// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/exact_sign.hpp>
#include <membrane/mesh_check/box_pairs.hpp>
#include <membrane/surface/triangle.hpp>

/// Self-intersections of a surface.
///
///     const bool all = membrane::for_each_self_intersection(x, triangles, some, representative, effort,
///                                                           [&](membrane::Index f, membrane::Index g) { ... });
namespace membrane {

/// Calls `found(f, g)`, f < g, for each pair of the triangles `some` that meet outside their shared vertices and edges.
/// Touching counts, and so does folding onto each other. Vertices with the same `representative` count as shared. Exact
/// predicates decide unless the triangles are clearly apart. Subtracts from `effort` as `for_each_overlap` does, and
/// more for pairs that need exact predicates. Returns whether the search is complete.
/// @pre points are finite, and no triangle of `some` has its corners on one line
template <class Found>
[[nodiscard]] bool for_each_self_intersection(const Points<double>& x, const Triangles& triangles,
                                              std::span<const Index> some, const std::vector<Index>& representative,
                                              std::int64_t& effort, Found found);

namespace detail {

/// An axis along which the projected area of `t` is not 0.
[[nodiscard]] inline int axis_across(const Triangle<double>& t) noexcept {
    int k = 0;
    while (k < 2 && sign_of_area(t.a, t.b, t.c, k) == 0) ++k;
    return k;
}

/// Whether the segment from p to q, which lies in the plane of `t`, meets it.
[[nodiscard]] inline bool meets_in_plane(const Triangle<double>& t, const Vector3<double>& p,
                                         const Vector3<double>& q) noexcept {
    const int k = axis_across(t), turn = sign_of_area(t.a, t.b, t.c, k);
    // They are apart if the line of a side of one has all of the other beyond it.
    for (int i = 0; i < 3; ++i) {
        const Vector3<double>&from = corner(t, i), &to = corner(t, (i + 1) % 3);
        if (turn * sign_of_area(from, to, p, k) < 0 && turn * sign_of_area(from, to, q, k) < 0) return false;
    }
    const int a = sign_of_area(p, q, t.a, k), b = sign_of_area(p, q, t.b, k), c = sign_of_area(p, q, t.c, k);
    return a != b || b != c;
}

/// Whether the segment from p to q meets the triangle, touching included.
[[nodiscard]] inline bool meets(const Triangle<double>& t, const Vector3<double>& p,
                                const Vector3<double>& q) noexcept {
    const int start = sign_of_volume(t.a, t.b, t.c, p), end = sign_of_volume(t.a, t.b, t.c, q);
    if (start == end) return start == 0 && meets_in_plane(t, p, q);
    const int a = sign_of_volume(p, q, t.a, t.b), b = sign_of_volume(p, q, t.b, t.c);
    const int c = sign_of_volume(p, q, t.c, t.a);
    return (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0);
}

/// Whether one of these axes certainly separates the triangles: from centroid to centroid, a normal, or the in-plane
/// normal of a side.
[[nodiscard]] inline bool clearly_apart(const Triangle<double>& s, const Triangle<double>& t,
                                        double rounding) noexcept {
    const auto apart = [&](const Vector3<double>& axis) {
        double max_s = -1e300, min_s = 1e300, max_t = -1e300, min_t = 1e300;
        for (int i = 0; i < 3; ++i) {
            const double on_s = dot(axis, corner(s, i)), on_t = dot(axis, corner(t, i));
            max_s = (std::max)(max_s, on_s), min_s = (std::min)(min_s, on_s);
            max_t = (std::max)(max_t, on_t), min_t = (std::min)(min_t, on_t);
        }
        const double margin = rounding * (std::abs(axis[0]) + std::abs(axis[1]) + std::abs(axis[2]));
        return max_s + margin < min_t || max_t + margin < min_s;
    };
    if (apart((t.a + t.b + t.c) - (s.a + s.b + s.c))) return true;
    for (const Triangle<double>* one : {&s, &t}) {
        const Vector3<double> normal = area_vector(*one);
        if (apart(normal)) return true;
        for (int i = 0; i < 3; ++i) {
            if (apart(cross<double>(normal, corner(*one, i) - corner(*one, (i + 1) % 3)))) return true;
        }
    }
    return false;
}

/// Two triangles with their shared corners first.
struct MeetingTriangles {
    Triangle<double> s, t;
    int shared;

    [[nodiscard]] bool meet(double rounding, std::int64_t& effort) const noexcept {
        if (shared == 3) return true;
        if (shared == 2) return folded(effort);
        if (shared == 1 && apart_around(s.a)) return false;
        if (shared == 0 && clearly_apart(s, t, rounding)) return false;
        effort -= 64;
        if (shared == 1) return meets(s, t.b, t.c) || meets(t, s.b, s.c);
        for (int i = 0; i < 3; ++i) {
            if (meets(s, corner(t, i), corner(t, (i + 1) % 3)) || meets(t, corner(s, i), corner(s, (i + 1) % 3))) {
                return true;
            }
        }
        return false;
    }

    /// Whether a plane through the shared vertex `v` certainly separates the other corners.
    [[nodiscard]] bool apart_around(const Vector3<double>& v) const noexcept {
        const std::array<Vector3<double>, 4> from_v{s.b - v, s.c - v, t.b - v, t.c - v};
        const Vector3<double> axis = direction<double>(from_v[2] + from_v[3], Vector3<double>::Zero()) -
                                     direction<double>(from_v[0] + from_v[1], Vector3<double>::Zero());
        const auto side = [&](std::size_t i) {
            const double along = dot(axis, from_v[i]);
            const double error = 1e-14 * from_v[i].cwiseAbs().maxCoeff();
            return along > error ? 1 : along < -error ? -1 : 0;
        };
        return side(0) == -1 && side(1) == -1 && side(2) == 1 && side(3) == 1;
    }

    /// Whether two triangles that share the edge a-b overlap in one plane.
    [[nodiscard]] bool folded(std::int64_t& effort) const noexcept {
        const Vector3<double> edge = s.b - s.a, to_s = s.c - s.a, to_t = t.c - s.a;
        const Vector3<double> normal_s = cross(edge, to_s), normal_t = cross(edge, to_t);
        const double sizes =
            edge.cwiseAbs().sum() * edge.cwiseAbs().sum() * to_s.cwiseAbs().sum() * to_t.cwiseAbs().sum();
        if (dot(normal_s, normal_t) < -1e-14 * sizes) return false;
        effort -= 4;
        if (sign_of_volume(s.a, s.b, s.c, t.c) != 0) return false;
        const int k = axis_across(s);
        return sign_of_area(s.a, s.b, s.c, k) == sign_of_area(s.a, s.b, t.c, k);
    }
};

/// The triangles f and g, their shared corners first.
[[nodiscard]] inline MeetingTriangles meeting(const Points<double>& x, const Triangles& triangles,
                                              const std::vector<Index>& representative, Index f, Index g) noexcept {
    std::array<Index, 3> a{triangles(0, f), triangles(1, f), triangles(2, f)};
    std::array<Index, 3> b{triangles(0, g), triangles(1, g), triangles(2, g)};
    const auto merged = [&](Index v) { return representative[static_cast<std::size_t>(v)]; };
    std::size_t shared = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = shared; j < 3; ++j) {
            if (merged(a[i]) != merged(b[j])) continue;
            std::swap(a[i], a[shared]);
            std::swap(b[j], b[shared]);
            ++shared;
            break;
        }
    }
    return {triangle_at(x, a), triangle_at(x, b), static_cast<int>(shared)};
}

}  // namespace detail

template <class Found>
bool for_each_self_intersection(const Points<double>& x, const Triangles& triangles, std::span<const Index> some,
                                const std::vector<Index>& representative, std::int64_t& effort, Found found) {
    std::vector<Aabb<double>> boxes(some.size());
    double largest = 0;
    for (std::size_t i = 0; i < some.size(); ++i) {
        for (const Index v : triangles.col(some[i])) boxes[i].include(point(x, v));
        largest = (std::max)({largest, boxes[i].low.cwiseAbs().maxCoeff(), boxes[i].high.cwiseAbs().maxCoeff()});
    }
    const double rounding = 64 * std::numeric_limits<double>::epsilon() * largest;
    return for_each_overlap(boxes, effort, [&](Index i, Index j) {
        const Index f = some[static_cast<std::size_t>(i)], g = some[static_cast<std::size_t>(j)];
        const auto two = detail::meeting(x, triangles, representative, f, g);
        if (two.meet(rounding, effort)) found((std::min)(f, g), (std::max)(f, g));
    });
}

}  // namespace membrane
