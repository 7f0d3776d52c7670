// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <membrane/core/lanes.hpp>
#include <membrane/surface/triangle.hpp>

/// Axis-aligned boxes, and tests of points and capsules against them.
///
///     membrane::Aabb<double> box;
///     for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) box.include(membrane::point(x, v));
///     if (squared_distance(box, tool.position) > tool.radius * tool.radius) return;  // no contact
namespace membrane {

/// The points between two corners, borders included [m]; empty until a point or box is included. With `Lanes`: several
/// boxes.
template <Number N>
struct Aabb {
    ///@{
    /// Corners of least and greatest coordinates [m].
    Vector3<N> low = Vector3<N>::Constant((std::numeric_limits<Each<N>>::max)());
    Vector3<N> high = Vector3<N>::Constant(std::numeric_limits<Each<N>>::lowest());
    ///@}

    ///@{
    /// Grows to contain a point or a box; NaN coordinates are ignored.
    void include(const Vector3<N>& p) noexcept;
    void include(const Aabb& other) noexcept;
    ///@}
};

/// The smallest box around a triangle.
template <Number N>
[[nodiscard]] Aabb<N> bounds(const Triangle<N>& triangle) noexcept;

/// The axis along which the box is longest, 0 to 2; the lowest of equal axes.
template <Real Scalar>
[[nodiscard]] int major_axis(const Aabb<Scalar>& box) noexcept;

/// Whether the boxes have a point in common.
template <Number N>
[[nodiscard]] auto overlap(const Aabb<N>& a, const Aabb<Each<N>>& b) noexcept;

/// Largest gap between the boxes along one axis [m]; not positive if they overlap.
template <Real Scalar>
[[nodiscard]] Scalar gap_between(const Aabb<Scalar>& a, const Aabb<Scalar>& b) noexcept;

///@{
/// Whether the point, or another box that is not empty, lies within the box.
template <Real Scalar>
[[nodiscard]] bool contains(const Aabb<Scalar>& box, const Vector3<Scalar>& p) noexcept;
template <Real Scalar>
[[nodiscard]] bool contains(const Aabb<Scalar>& box, const Aabb<Scalar>& other) noexcept;
///@}

/// Squared distance from `q` to the box, 0 inside [m^2].
template <Number N>
[[nodiscard]] N squared_distance(const Aabb<N>& box, const Vector3<Each<N>>& q) noexcept;

/// Largest distance along one axis from `q` to a corner of the box [m].
template <Real Scalar>
[[nodiscard]] Scalar max_axis_distance(const Aabb<Scalar>& box, const Vector3<Scalar>& q) noexcept;

/// A capsule prepared for tests against many boxes; a segment if its radius is zero.
template <Real Scalar>
class CapsuleQuery {
  public:
    static constexpr Scalar never = 2;  ///< fraction of a box that is not hit

    /// Around the segment between two points. The boxes to test must lie in `all`: its size sets by how much the
    /// capsule is thickened, so that rounding errors never make it miss a box.
    CapsuleQuery(const Vector3<Scalar>& from, const Vector3<Scalar>& to, Scalar radius,
                 const Aabb<Scalar>& all) noexcept;

    /// Lower bound of the fraction of the segment, 0 to 1, at which the capsule meets the box; `never` if it does not.
    template <Number N>
    [[nodiscard]] N entry(const Aabb<N>& box) const noexcept;

  private:
    Vector3<Scalar> to_near_, to_far_;  // start of the segment, offset for the sides where it enters and leaves a box
    Vector3<Scalar> inverse_step_;      // one over each component of the segment [1/m]
};

template <Number N>
void Aabb<N>::include(const Vector3<N>& p) noexcept {
    for (int k = 0; k < 3; ++k) {
        low[k] = smaller(low[k], p[k]);
        high[k] = larger(high[k], p[k]);
    }
}

template <Number N>
void Aabb<N>::include(const Aabb& other) noexcept {
    for (int k = 0; k < 3; ++k) {
        low[k] = smaller(low[k], other.low[k]);
        high[k] = larger(high[k], other.high[k]);
    }
}

template <Number N>
Aabb<N> bounds(const Triangle<N>& triangle) noexcept {
    Aabb<N> box{triangle.a, triangle.a};
    box.include(triangle.b);
    box.include(triangle.c);
    return box;
}

template <Real Scalar>
int major_axis(const Aabb<Scalar>& box) noexcept {
    const Vector3<Scalar> side = box.high - box.low;
    const int longer = side[1] > side[0] ? 1 : 0;
    return side[2] > side[longer] ? 2 : longer;
}

template <Number N>
auto overlap(const Aabb<N>& a, const Aabb<Each<N>>& b) noexcept {
    const auto along = [&](int k) {
        const auto begins = a.low[k] <= N(b.high[k]), ends = N(b.low[k]) <= a.high[k];
        return begins & ends;
    };
    const auto x = along(0), y = along(1), z = along(2);
    return x & y & z;
}

template <Real Scalar>
Scalar gap_between(const Aabb<Scalar>& a, const Aabb<Scalar>& b) noexcept {
    Scalar most = std::numeric_limits<Scalar>::lowest();
    for (int k = 0; k < 3; ++k) most = (std::max)(most, (std::max)(a.low[k] - b.high[k], b.low[k] - a.high[k]));
    return most;
}

template <Real Scalar>
bool contains(const Aabb<Scalar>& box, const Vector3<Scalar>& p) noexcept {
    return at_most(box.low, p) && at_most(p, box.high);
}

template <Real Scalar>
bool contains(const Aabb<Scalar>& box, const Aabb<Scalar>& other) noexcept {
    return contains(box, other.low) && contains(box, other.high);
}

template <Number N>
N squared_distance(const Aabb<N>& box, const Vector3<Each<N>>& q) noexcept {
    const auto offset = [&](int k) { return q[k] - smaller(larger(N(q[k]), box.low[k]), box.high[k]); };
    return squared_norm<N>({offset(0), offset(1), offset(2)});
}

template <Real Scalar>
Scalar max_axis_distance(const Aabb<Scalar>& box, const Vector3<Scalar>& q) noexcept {
    Scalar most = 0;
    for (int k = 0; k < 3; ++k) most = (std::max)((std::max)(most, q[k] - box.low[k]), box.high[k] - q[k]);
    return most;
}

template <Real Scalar>
CapsuleQuery<Scalar>::CapsuleQuery(const Vector3<Scalar>& from, const Vector3<Scalar>& to, Scalar radius,
                                   const Aabb<Scalar>& all) noexcept {
    using std::abs;
    using Limits = std::numeric_limits<Scalar>;
    const Scalar size = max_axis_distance(all, from) + radius, margin = radius + 64 * Limits::epsilon() * size;
    // A component below rounding is covered by the margin. It is clamped, so that products with its inverse do not
    // overflow.
    const Scalar shortest = (std::max)(Limits::epsilon() * size, (Limits::min)());
    for (int k = 0; k < 3; ++k) {
        const Scalar step = to[k] - from[k];
        inverse_step_[k] = 1 / (abs(step) >= shortest ? step : shortest);
        const Scalar ahead = inverse_step_[k] > 0 ? margin : -margin;
        to_near_[k] = from[k] + ahead;
        to_far_[k] = from[k] - ahead;
    }
}

template <Real Scalar>
template <Number N>
N CapsuleQuery<Scalar>::entry(const Aabb<N>& box) const noexcept {
    N first = 0, last = 1;
    for (int k = 0; k < 3; ++k) {
        const bool forward = inverse_step_[k] > 0;
        const N& entry = forward ? box.low[k] : box.high[k];
        const N& exit = forward ? box.high[k] : box.low[k];
        first = larger<N>(first, (entry - to_near_[k]) * inverse_step_[k]);
        last = smaller<N>(last, (exit - to_far_[k]) * inverse_step_[k]);
    }
    return select<N>(first <= last, first, never);
}

}  // namespace membrane
