// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>
#include <utility>

#include <membrane/core/check.hpp>

/// Bodies as signed distances, the input of `distmesh`.
///
///     const auto lens = membrane::Ellipsoid{.radii = {5e-3, 5e-3, 2e-3}};                        // [m]
///     const auto bowl = membrane::difference(membrane::Ball{.radius = 1}, membrane::Ball{.radius = 0.9});
///     const auto ring = [](const membrane::Vector3<double>& p) {                                 // user-defined torus
///         return std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()) - 0.3;
///     };
namespace membrane {

/// The signed distance of a point to the surface of a body [m]: negative inside, positive outside.
///
/// Requirements that the compiler cannot check: it is finite, continuous and equal at each call, and its slope across
/// the surface is about 1. For a level set of another slope Newton's method compensates, if the gradient does not
/// vanish there.
template <class D>
concept SignedDistance = requires(const D& distance, const Vector3<double>& p) {
    { distance(p) } -> std::convertible_to<double>;
};

namespace detail {

template <class D>
consteval bool check_signed_distance() noexcept {
    static_assert(SignedDistance<D>, "SignedDistance: distance(const Vector3<double>&) const must give a double [m]");
    return SignedDistance<D>;
}

}  // namespace detail

/// A `SignedDistance`. If a requirement is missing, the compile error names it.
template <class D>
concept CheckedSignedDistance = detail::check_signed_distance<D>();

/// A signed distance with its own gradient: a vector out of the body, of length 1 for a true distance.
template <class D>
concept GivesGradient = SignedDistance<D> && requires(const D& distance, const Vector3<double>& p) {
    { distance.gradient(p) } -> std::convertible_to<Vector3<double>>;
};

/// An axis-aligned box that contains a body [m]. Infinite where the body is.
struct Bounds {
    ///@{
    /// Corners of least and greatest coordinates [m].
    Vector3<double> low = Vector3<double>::Constant(-std::numeric_limits<double>::infinity());
    Vector3<double> high = Vector3<double>::Constant(std::numeric_limits<double>::infinity());
    ///@}

    /// The box with each face moved outward by `by` [m].
    [[nodiscard]] Bounds grown(double by) const noexcept {
        return {low - Vector3<double>::Constant(by), high + Vector3<double>::Constant(by)};
    }

    /// The box that both have in common.
    [[nodiscard]] Bounds within(const Bounds& other) const noexcept {
        return {low.cwiseMax(other.low), high.cwiseMin(other.high)};
    }

    /// The smallest box that contains both.
    [[nodiscard]] Bounds around(const Bounds& other) const noexcept {
        return {low.cwiseMin(other.low), high.cwiseMax(other.high)};
    }
};

/// A body with its own bounding box: `distmesh` then needs no `bounds`.
template <class D>
concept GivesBounds = requires(const D& body) {
    { body.bounds() } -> std::convertible_to<Bounds>;
};

/// The body's own bounds; infinite if it has none.
template <class D>
[[nodiscard]] Bounds bounds_of(const D& body) {
    if constexpr (GivesBounds<D>) return body.bounds();
    return {};
}

/// The body's own gradient at `p`, or central differences with the step `step` [m].
template <SignedDistance D>
[[nodiscard]] Vector3<double> gradient_at(const D& distance, const Vector3<double>& p, double step);

// The bodies below are true distances, except near the intersection of two surfaces: there `united` is not inside,
// `intersection` and `difference` are not outside.

/// A ball.
struct Ball {
    Vector3<double> centre = Vector3<double>::Zero();  ///< [m]
    double radius = 1;                                 ///< [m]

    ///@{
    /// Signed distance to the surface [m], its gradient, and the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return norm<double>(p - centre) - radius; }
    [[nodiscard]] Vector3<double> gradient(const Vector3<double>& p) const {
        return direction<double>(p - centre, Vector3<double>::UnitZ());
    }
    [[nodiscard]] Bounds bounds() const { return Bounds{centre, centre}.grown(radius); }
    ///@}
};

/// An ellipsoid with its axes along x, y and z.
struct Ellipsoid {
    Vector3<double> centre = Vector3<double>::Zero();  ///< [m]
    Vector3<double> radii = Vector3<double>::Ones();   ///< Half the length of each axis [m].

    ///@{
    /// Signed distance to the surface [m], its gradient, and the box around the body.
    [[nodiscard]] inline double operator()(const Vector3<double>& p) const;
    [[nodiscard]] inline Vector3<double> gradient(const Vector3<double>& p) const;
    [[nodiscard]] Bounds bounds() const { return {centre - radii, centre + radii}; }
    ///@}

    /// The point of the surface nearest to `p` [m]. Newton's method on the multiplier of the ellipsoid's equation, from
    /// the side on which it never overshoots [Eberly13].
    [[nodiscard]] inline Vector3<double> nearest(const Vector3<double>& p) const;
};

/// A cuboid with its edges along x, y and z. The mesher does not put vertices on the edges: triangles cut them off.
struct Cuboid {
    Vector3<double> centre = Vector3<double>::Zero();            ///< [m]
    Vector3<double> half_size = Vector3<double>::Constant(0.5);  ///< From the centre to the faces [m].

    ///@{
    /// Signed distance to the surface [m], and the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const {
        const Vector3<double> beyond = (p - centre).cwiseAbs() - half_size;
        return norm<double>(beyond.cwiseMax(Vector3<double>::Zero())) + (std::min)(beyond.maxCoeff(), 0.0);
    }
    [[nodiscard]] Bounds bounds() const { return {centre - half_size, centre + half_size}; }
    ///@}
};

/// All points within `radius` of the segment from `start` to `end`.
struct Capsule {
    Vector3<double> start = Vector3<double>::Zero();  ///< [m]
    Vector3<double> end = Vector3<double>::UnitZ();   ///< [m]
    double radius = 0.5;                              ///< [m]

    ///@{
    /// Signed distance to the surface [m], and the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const {
        const Vector3<double> axis = end - start, offset = p - start;
        const double length = squared_norm(axis);
        const double along = length > 0 ? std::clamp(dot(offset, axis) / length, 0.0, 1.0) : 0.0;
        return norm<double>(offset - along * axis) - radius;
    }
    [[nodiscard]] Bounds bounds() const { return Bounds{start, start}.around({end, end}).grown(radius); }
    ///@}
};

/// The half-space behind a plane, for `intersection` and `trimmed`.
struct HalfSpace {
    Vector3<double> point = Vector3<double>::Zero();    ///< Of the plane [m].
    Vector3<double> normal = Vector3<double>::UnitZ();  ///< Out of the body, of any length.

    ///@{
    /// Signed distance to the plane [m], and its gradient.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return dot<double>(gradient(p), p - point); }
    [[nodiscard]] Vector3<double> gradient(const Vector3<double>&) const {
        return direction<double>(normal, Vector3<double>::UnitZ());
    }
    ///@}
};

/// Two bodies as one.
template <SignedDistance A, SignedDistance B>
struct Union {
    ///@{
    /// A body.
    A a;
    B b;
    ///@}

    ///@{
    /// Signed distance to the surface, near the intersection of both a bound of it [m]; the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return (std::min<double>)(a(p), b(p)); }
    [[nodiscard]] Bounds bounds() const { return bounds_of(a).around(bounds_of(b)); }
    ///@}
};

/// The part that two bodies have in common.
template <SignedDistance A, SignedDistance B>
struct Intersection {
    ///@{
    /// A body.
    A a;
    B b;
    ///@}

    ///@{
    /// Signed distance to the surface, near the intersection of both a bound of it [m]; the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return (std::max<double>)(a(p), b(p)); }
    [[nodiscard]] Bounds bounds() const { return bounds_of(a).within(bounds_of(b)); }
    ///@}
};

/// The part of one body that is not in another.
template <SignedDistance A, SignedDistance B>
struct Difference {
    ///@{
    /// A body, and the one that is taken away from it.
    A a;
    B b;
    ///@}

    ///@{
    /// Signed distance to the surface, near the intersection of both a bound of it [m]; the box around the body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return (std::max<double>)(a(p), -b(p)); }
    [[nodiscard]] Bounds bounds() const { return bounds_of(a); }
    ///@}
};

/// A body with its surface moved outward.
template <SignedDistance A>
struct Offset {
    A body;     ///< before the displacement
    double by;  ///< distance between the surfaces, negative inward [m]

    ///@{
    /// Signed distance to the displaced surface [m], and the box around the displaced body.
    [[nodiscard]] double operator()(const Vector3<double>& p) const { return body(p) - by; }
    [[nodiscard]] Bounds bounds() const { return bounds_of(body).grown(by); }
    ///@}
};

/// The points in `a`, in `b` or in both.
template <SignedDistance A, SignedDistance B>
[[nodiscard]] Union<A, B> united(A a, B b) {
    return {std::move(a), std::move(b)};
}

/// The points in both `a` and `b`.
template <SignedDistance A, SignedDistance B>
[[nodiscard]] Intersection<A, B> intersection(A a, B b) {
    return {std::move(a), std::move(b)};
}

/// `a` without `b`.
template <SignedDistance A, SignedDistance B>
[[nodiscard]] Difference<A, B> difference(A a, B b) {
    return {std::move(a), std::move(b)};
}

/// The body grown by a skin of thickness `by` [m], or shrunk if `by` is negative. A grown `Cuboid` has round edges.
template <SignedDistance A>
[[nodiscard]] Offset<A> offset(A body, double by) {
    return {std::move(body), by};
}

template <SignedDistance D>
Vector3<double> gradient_at(const D& distance, const Vector3<double>& p, double step) {
    if constexpr (GivesGradient<D>) {
        return distance.gradient(p);
    } else {
        Vector3<double> gradient;
        for (int k = 0; k < 3; ++k) {
            const Vector3<double> beside = step * Vector3<double>::Unit(k);
            gradient[k] = (double(distance(p + beside)) - double(distance(p - beside))) / (2 * step);
        }
        return gradient;
    }
}

inline Vector3<double> Ellipsoid::nearest(const Vector3<double>& p) const {
    // By symmetry in one octant: x_k = r_k^2 y_k / (r_k^2 + t), with t such that x is on the surface. The unknown is s
    // = r^2 + t of the shortest axis, so that no digits are lost close to its middle plane.
    const Vector3<double> y = (p - centre).cwiseAbs();
    const auto shortest = std::min_element(radii.begin(), radii.end()) - radii.begin();
    const double least = radii[shortest] * radii[shortest];
    const auto excess = [&](int k) { return radii[k] * radii[k] - least; };
    double s = 0;
    for (int k = 0; k < 3; ++k) s = (std::max)(s, radii[k] * y[k] - excess(k));
    const auto share = [&](int k) { return y[k] > 0 ? radii[k] * y[k] / (s + excess(k)) : 0; };  // x_k / r_k
    for (int i = 0; i < 100; ++i) {
        double value = -1, slope = 0;
        for (int k = 0; k < 3; ++k) {
            value += share(k) * share(k);
            if (y[k] > 0) slope -= 2 * share(k) * share(k) / (s + excess(k));
        }
        const double next = s - value / slope;
        if (!(value > 0) || !(next > s)) break;  // s only grows, until rounding stops it
        s = next;
    }
    Vector3<double> x;
    double rest = 1;
    for (int k = 0; k < 3; ++k) {
        x[k] = std::copysign(radii[k] * share(k), p[k] - centre[k]);
        rest -= share(k) * share(k);
    }
    if (!(s > 0) && rest > 0) {  // on the middle plane, so deep that the nearest point is off this plane
        x[shortest] = radii[shortest] * std::sqrt(rest);
    }
    return centre + x;
}

inline double Ellipsoid::operator()(const Vector3<double>& p) const {
    const Vector3<double> from_centre = (p - centre).cwiseQuotient(radii);
    const auto distance = norm<double>(p - nearest(p));
    return squared_norm(from_centre) < 1 ? -distance : distance;
}

inline Vector3<double> Ellipsoid::gradient(const Vector3<double>& p) const {
    const Vector3<double> x = nearest(p) - centre;
    return direction<double>(x.cwiseQuotient(radii).cwiseQuotient(radii), Vector3<double>::UnitZ());
}

}  // namespace membrane
