// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <membrane/core/check.hpp>
#include <membrane/core/lanes.hpp>

/// Distances of one triangle from a point, a segment or a box.
///
///     const auto triangle = membrane::triangle_at(x, mesh.triangles().col(f));
///     const auto nearest  = membrane::closest_point(triangle, tool.position);
///     if (nearest.squared_distance < radius * radius) touched = nearest.point;
///
/// All functions are pure, do not allocate and cost a bounded number of operations. Differences are taken first, so
/// accuracy depends on the size of the triangle and the distances, not on the position of the origin. Triangles without
/// area, down to three equal corners, are segments or points. No finite input gives a NaN.
namespace membrane {

/// Three corners, counter-clockwise seen from outside [m]. With `Lanes`: several triangles.
template <Number N>
struct Triangle {
    ///@{
    /// A corner [m].
    Vector3<N> a, b, c;
    ///@}
};

/// A point of a triangle and its squared distance from the query. With `Lanes`: of several triangles.
template <Number N>
struct TrianglePoint {
    Vector3<N> barycentric;  ///< Weights of a, b, c: not negative, sum 1; exactly zero for corners not involved.
    Vector3<N> point;        ///< [m]
    N squared_distance;      ///< [m^2]
};

/// A point of a segment and the point of a triangle nearest to it.
template <Real Scalar>
struct SegmentPair {
    Scalar fraction;                    ///< 0 at the segment's start, 1 at its end.
    TrianglePoint<Scalar> on_triangle;  ///< The point of the triangle.
};

/// Where a segment enters a triangle.
template <Real Scalar>
struct SegmentHit {
    Scalar fraction;              ///< 0 at the segment's start, 1 at its end.
    Vector3<Scalar> barycentric;  ///< Weights of a, b, c: sum 1.
};

/// The triangle whose corners are the points `corners[0..2]` of `x`.
template <class Positions, class Corners>
[[nodiscard]] Triangle<typename Positions::Scalar> triangle_at(const Positions& x, const Corners& corners) noexcept;

/// The normal, with the area of the triangle as its length [m^2].
template <Number N>
[[nodiscard]] Vector3<N> area_vector(const Triangle<N>& triangle) noexcept;

/// The point with the weights `barycentric`; exactly a corner if its weight is 1 and the others are 0.
template <Number N>
[[nodiscard]] Vector3<N> point_at(const Triangle<N>& triangle, const Vector3<N>& barycentric) noexcept;

/// The point of the triangle nearest to `q`; several triangles at once give the same bits. Accurate to some epsilon
/// times edge^2 / height, for the longest edge and the height above it. A triangle whose height is below sqrt(epsilon)
/// of its edges counts as its three edges, which moves the point by at most that height. If a triangle is not finite,
/// or the square of its area overflows, its distance is infinite.
template <Number N>
[[nodiscard]] TrianglePoint<N> closest_point(const Triangle<N>& triangle, const Vector3<N>& q) noexcept;

/// Squared distance of `closest_point` from `q` [m^2], with the same bits.
template <Number N>
[[nodiscard]] N squared_distance(const Triangle<N>& triangle, const Vector3<N>& q) noexcept;

/// The nearest points of the triangle and of the segment from `p` to `q`; at distance 0 if they intersect.
template <Real Scalar>
[[nodiscard]] SegmentPair<Scalar> closest_to_segment(const Triangle<Scalar>& triangle, const Vector3<Scalar>& p,
                                                     const Vector3<Scalar>& q) noexcept;

/// The nearest points of the triangle's edge `k`, from corner `k` to the next, and of the segment from `p` to `q`.
template <Real Scalar>
[[nodiscard]] SegmentPair<Scalar> closest_to_segment(const Triangle<Scalar>& triangle, int k, const Vector3<Scalar>& p,
                                                     const Vector3<Scalar>& q) noexcept;

/// The first point where the segment meets the triangle, from either side; edges, corners and the segment's ends belong
/// to it.
///
/// Watertight: a possible hit within the rounding errors is a hit, so that no segment passes between two triangles with
/// a common edge. For triangles that are not thin these errors are some 100 epsilon times the size of the triangle, or
/// its distance from `from` if that is larger: the point at the fraction is as near to the plane, and an edge is missed
/// by at most as much over the sine of its angle to the segment. So a segment almost in the plane may be off along the
/// plane by far more than a rounding. The weights are those of the point of the triangle nearest to that at the
/// fraction.
///
/// A segment in the plane of the triangle enters at an edge, or starts inside. A triangle without area is never hit:
/// its neighbours are.
template <Real Scalar>
[[nodiscard]] std::optional<SegmentHit<Scalar>> first_hit(const Triangle<Scalar>& triangle, const Vector3<Scalar>& from,
                                                          const Vector3<Scalar>& to) noexcept;

/// Whether the triangle and the box between the corners `low` and `high` have a common point, borders included; a
/// possible common point within the rounding errors is one. Separating axes, all 13 [Akenine-Moeller01].
template <Real Scalar>
[[nodiscard]] bool touches_box(const Triangle<Scalar>& triangle, const Vector3<Scalar>& low,
                               const Vector3<Scalar>& high) noexcept;

namespace detail {

/// `part / whole` clamped to [0, 1], for any two numbers.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N fraction(const N& part, const N& whole) noexcept {
    const auto inside = (part > 0) & (part < whole);
    return select<N>(inside, part / select<N>(inside, whole, 1), select<N>(part > 0, 1, 0));
}

template <Number N>
[[nodiscard]] N largest_magnitude(const Vector3<N>& a) noexcept {
    using std::abs;
    return larger(larger<N>(abs(a.x()), abs(a.y())), N(abs(a.z())));
}

/// Bound of a few rounding errors at a point of the magnitude of `a`.
template <Real Scalar>
[[nodiscard]] Scalar rounding_at(const Vector3<Scalar>& a) noexcept {
    return 16 * std::numeric_limits<Scalar>::epsilon() * largest_magnitude(a);
}

/// Corner `k`: 0, 1, 2, or 3 for corner 0.
template <Real Scalar>
[[nodiscard]] const Vector3<Scalar>& corner(const Triangle<Scalar>& triangle, int k) noexcept {
    return k == 1 ? triangle.b : k == 2 ? triangle.c : triangle.a;
}

/// The weights of a point on the edge from corner `k` to the next.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> on_edge(int k, Scalar along) noexcept {
    Vector3<Scalar> barycentric(0, 0, 0);
    barycentric[k] = 1 - along;
    barycentric[k == 2 ? 0 : k + 1] = along;
    return barycentric;
}

}  // namespace detail

template <class Positions, class Corners>
Triangle<typename Positions::Scalar> triangle_at(const Positions& x, const Corners& corners) noexcept {
    return {point(x, corners[0]), point(x, corners[1]), point(x, corners[2])};
}

template <Number N>
Vector3<N> area_vector(const Triangle<N>& triangle) noexcept {
    const Vector3<N> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
    return cross(ab, ac) / N(2);
}

template <Number N>
Vector3<N> point_at(const Triangle<N>& triangle, const Vector3<N>& barycentric) noexcept {
    return (barycentric[0] * triangle.a + barycentric[1] * triangle.b) + barycentric[2] * triangle.c;
}

namespace detail {

/// Inline, so that unused results are not computed. With `branches`, a triangle with its nearest point on the face
/// costs half: for several triangles only if this holds for all of them.
template <bool branches, Number N>
MEMBRANE_INLINE TrianglePoint<N> closest_point_inline(const Triangle<N>& triangle, const Vector3<N>& q) noexcept {
    using Limits = std::numeric_limits<Each<N>>;
    const Vector3<N> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, aq = q - triangle.a;
    const Vector3<N> normal = cross(ab, ac);
    const N whole = squared_norm(normal);
    const N weight_b = dot(normal, cross(aq, ac)), weight_c = dot(normal, cross(ab, aq));
    const N weight_a = whole - weight_b - weight_c;
    const auto finite = whole <= (Limits::max)();  // otherwise a corner is not finite or far too large
    const auto has_area = whole > Limits::epsilon() * (squared_norm(ab) * squared_norm(ac));
    const auto over_face = finite & has_area & (weight_a >= 0) & (weight_b >= 0) & (weight_c >= 0);

    const N divisor = select<N>(over_face, whole, 1);  // outside the face no quotient may overflow
    const N b = select<N>(over_face, weight_b / divisor, 0), c = select<N>(over_face, weight_c / divisor, 0);
    Vector3<N> barycentric(larger<N>(0, 1 - b - c), b, c);
    N nearest = squared_norm<N>(aq - b * ab - c * ac);
    if (!branches || !all(over_face)) {
        // Outside, the nearest point lies on an edge that faces q.
        N on_edges = Limits::infinity();
        Vector3<N> weights(1, 0, 0);
        const auto consider = [&](Eigen::Index k, const auto& faces, const Vector3<N>& offset, const Vector3<N>& edge)
                                  MEMBRANE_INLINE_LAMBDA {
                                      if (Real<N> && !any(faces))
                                          return;  // for several triangles this branch is not predictable
                                      const N along = fraction(dot(offset, edge), squared_norm(edge));
                                      const N squared_distance = squared_norm<N>(offset - along * edge);
                                      const auto nearer = finite & faces & (squared_distance < on_edges);
                                      on_edges = select<N>(nearer, squared_distance, on_edges);
                                      const Eigen::Index next = (k + 1) % 3, last = (k + 2) % 3;
                                      weights[k] = select<N>(nearer, 1 - along, weights[k]);
                                      weights[next] = select<N>(nearer, along, weights[next]);
                                      weights[last] = select<N>(nearer, 0, weights[last]);
                                  };
        consider(0, (!has_area) | (weight_c < 0), aq, ab);
        consider(1, (!has_area) | (weight_a < 0), q - triangle.b, triangle.c - triangle.b);
        consider(2, (!has_area) | (weight_b < 0), q - triangle.c, -ac);
        for (Eigen::Index k = 0; k < 3; ++k) barycentric[k] = select<N>(over_face, barycentric[k], weights[k]);
        nearest = select<N>(over_face, nearest, on_edges);
    }
    return {barycentric, point_at(triangle, barycentric), nearest};
}

}  // namespace detail

template <Number N>
TrianglePoint<N> closest_point(const Triangle<N>& triangle, const Vector3<N>& q) noexcept {
    return detail::closest_point_inline<Real<N>>(triangle, q);
}

template <Number N>
N squared_distance(const Triangle<N>& triangle, const Vector3<N>& q) noexcept {
    return detail::closest_point_inline<Real<N>>(triangle, q).squared_distance;
}

namespace detail {

/// The nearest points of a segment and an edge.
template <Number N>
struct SegmentAndEdge {
    N fraction, foot;  ///< of the segment, and of the edge: 0 to 1
};

/// The nearest points of two lines, each then clamped to its segment in turn [Ericson05] 5.1.9. `offset` runs from the
/// start of the segment to that of the edge.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE SegmentAndEdge<N> closest_on_edge(const Vector3<N>& segment, const Vector3<N>& edge,
                                                                const Vector3<N>& offset) noexcept {
    const Vector3<N> common = cross(segment, edge);
    const N on_line = fraction<N>(dot(cross(offset, edge), common), squared_norm(common));
    const N foot = fraction<N>(dot<N>(on_line * segment - offset, edge), squared_norm(edge));
    return {fraction<N>(dot<N>(offset + foot * edge, segment), squared_norm(segment)), foot};
}

}  // namespace detail

template <Real Scalar>
SegmentPair<Scalar> closest_to_segment(const Triangle<Scalar>& triangle, int k, const Vector3<Scalar>& p,
                                       const Vector3<Scalar>& q) noexcept {
    const Vector3<Scalar> segment = q - p, start = detail::corner(triangle, k), offset = start - p;
    const Vector3<Scalar> edge = detail::corner(triangle, k + 1) - start;
    const auto [along, foot] = detail::closest_on_edge(segment, edge, offset);
    const auto squared_distance = squared_norm<Scalar>((offset + foot * edge) - along * segment);
    const Vector3<Scalar> barycentric = detail::on_edge(k, foot);
    return {along, {barycentric, point_at(triangle, barycentric), squared_distance}};
}

template <Real Scalar>
SegmentPair<Scalar> closest_to_segment(const Triangle<Scalar>& triangle, const Vector3<Scalar>& p,
                                       const Vector3<Scalar>& q) noexcept {
    if (const auto hit = first_hit(triangle, p, q)) {
        return {hit->fraction, {hit->barycentric, point_at(triangle, hit->barycentric), 0}};
    }
    SegmentPair<Scalar> best{0, closest_point(triangle, p)};
    const auto end = closest_point(triangle, q);
    if (end.squared_distance < best.on_triangle.squared_distance) best = {1, end};

    for (int k = 0; k < 3; ++k) {
        const auto edge = closest_to_segment(triangle, k, p, q);
        if (edge.on_triangle.squared_distance < best.on_triangle.squared_distance) best = edge;
    }
    return best;
}

namespace detail {

/// Relative bound, with a safety factor, of the rounding error of a sum of products of three differences, in units of
/// the product of their largest components.
template <Real Scalar>
inline constexpr Scalar rounding = 64 * std::numeric_limits<Scalar>::epsilon();

/// Narrows [first, last] to where `value + along * slope` is not negative; returns false if the interval is empty.
template <Real Scalar>
[[nodiscard]] bool clip(Scalar value, Scalar slope, Scalar& first, Scalar& last) noexcept {
    if (slope == 0) return value >= 0;
    const Scalar crossing = -value / slope;
    (slope > 0 ? first : last) = slope > 0 ? (std::max)(first, crossing) : (std::min)(last, crossing);
    return first <= last;
}

/// Intersection of a segment with a triangle that is not parallel to it.
template <Number N>
struct Crossing {
    using YesNo = decltype(N() < N());
    YesNo clear, met;   ///< `met` is valid only if `clear`
    N distance, whole;  ///< of the segment; distance / whole is the fraction

    /// Cramer's rule for from + along * segment = a + b * ab + c * ac [Moeller97], signs decided before the division.
    Crossing(const Triangle<N>& triangle, const Vector3<Each<N>>& from, const Vector3<Each<N>>& to) noexcept {
        const Vector3<N> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
        const Vector3<N> start(from.x(), from.y(), from.z()), offset = triangle.a - start;
        const Vector3<N> segment = Vector3<N>(to.x(), to.y(), to.z()) - start;
        const Vector3<N> normal = cross(ab, ac), moment = cross(segment, offset);
        const N climb = dot(segment, normal), sign = select<N>(climb < 0, -1, 1);
        const N size = larger(largest_magnitude(ab), largest_magnitude(ac));
        const N area = larger(size, largest_magnitude(offset)) * size, rounded = rounding<Each<N>> * area;
        const N slack = rounded * largest_magnitude(segment), end_slack = rounded * size;
        const N weight_b = -sign * dot(moment, ac), weight_c = sign * dot(moment, ab);
        whole = sign * climb;
        distance = sign * dot(normal, offset);
        clear = whole > slack;
        met = (weight_b >= -slack) & (weight_c >= -slack) & (weight_b + weight_c <= whole + slack) &
              (distance >= -end_slack) & (distance <= whole + (slack + end_slack));
    }
};

/// The weights are computed from the point on the segment. A common solution would separate them from it if the segment
/// meets the plane at a small angle.
template <Real Scalar>
[[nodiscard]] SegmentHit<Scalar> hit_at(const Triangle<Scalar>& triangle, const Vector3<Scalar>& from,
                                        const Vector3<Scalar>& segment, Scalar along) noexcept {
    return {along, closest_point<Scalar>(triangle, from + along * segment).barycentric};
}

/// `first_hit` for a segment in the triangle's plane, or parallel to it.
template <Real Scalar>
[[nodiscard]] std::optional<SegmentHit<Scalar>> first_hit_in_plane(const Triangle<Scalar>& triangle,
                                                                   const Vector3<Scalar>& from,
                                                                   const Vector3<Scalar>& segment) noexcept {
    const Vector3<Scalar> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, start = from - triangle.a;
    const Vector3<Scalar> normal = cross(ab, ac);
    const Scalar size = (std::max)(largest_magnitude(ab), largest_magnitude(ac));
    const Scalar extent = (std::max)(size, largest_magnitude(start));
    if (!(squared_norm(normal) > std::numeric_limits<Scalar>::epsilon() * (squared_norm(ab) * squared_norm(ac)))) {
        return std::nullopt;
    }
    Scalar first = 0, last = 1;
    const Scalar height = dot(normal, start), climb = dot(normal, segment), slack = rounding<Scalar> * extent * size;
    if (!clip(slack * size + height, climb, first, last)) return std::nullopt;
    if (!clip(slack * size - height, -climb, first, last)) return std::nullopt;
    for (int k = 0; k < 3; ++k) {
        const Vector3<Scalar> inward = cross<Scalar>(normal, corner(triangle, k + 1) - corner(triangle, k));
        const auto inside = dot<Scalar>(inward, from - corner(triangle, k));
        if (!clip(slack * largest_magnitude(normal) + inside, dot(inward, segment), first, last)) return std::nullopt;
    }
    return hit_at(triangle, from, segment, first);
}

}  // namespace detail

template <Real Scalar>
std::optional<SegmentHit<Scalar>> first_hit(const Triangle<Scalar>& triangle, const Vector3<Scalar>& from,
                                            const Vector3<Scalar>& to) noexcept {
    const detail::Crossing<Scalar> crossing(triangle, from, to);
    if (!crossing.clear) return detail::first_hit_in_plane<Scalar>(triangle, from, to - from);
    if (!crossing.met) return std::nullopt;
    return detail::hit_at<Scalar>(triangle, from, to - from, detail::fraction(crossing.distance, crossing.whole));
}

template <Real Scalar>
bool touches_box(const Triangle<Scalar>& triangle, const Vector3<Scalar>& low, const Vector3<Scalar>& high) noexcept {
    using std::abs;
    Scalar size = (std::max)(detail::largest_magnitude(low), detail::largest_magnitude(high));
    for (int k = 0; k < 3; ++k) size = (std::max)(size, detail::largest_magnitude(detail::corner(triangle, k)));
    const Scalar slack = 8 * std::numeric_limits<Scalar>::epsilon() * size;
    const Vector3<Scalar> centre = (low + high) / 2, half = (high - low) / 2 + Vector3<Scalar>::Constant(slack);
    const Vector3<Scalar> corners[] = {triangle.a - centre, triangle.b - centre, triangle.c - centre};
    const auto overlap_along = [&](const Vector3<Scalar>& axis) {
        const Scalar a = dot(axis, corners[0]), b = dot(axis, corners[1]), c = dot(axis, corners[2]);
        const Scalar half_width = (half.x() * abs(axis.x()) + half.y() * abs(axis.y())) + half.z() * abs(axis.z());
        return (std::min)((std::min)(a, b), c) <= half_width && (std::max)((std::max)(a, b), c) >= -half_width;
    };
    if (!overlap_along({1, 0, 0}) || !overlap_along({0, 1, 0}) || !overlap_along({0, 0, 1})) return false;
    for (int k = 0; k < 3; ++k) {
        const Vector3<Scalar> edge = corners[k == 2 ? 0 : k + 1] - corners[k];
        if (!overlap_along({0, -edge.z(), edge.y()}) || !overlap_along({edge.z(), 0, -edge.x()})) return false;
        if (!overlap_along({-edge.y(), edge.x(), 0})) return false;
    }
    return overlap_along(cross<Scalar>(corners[1] - corners[0], corners[2] - corners[0]));
}

}  // namespace membrane
