// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <membrane/mesh/triangle.hpp>

/// Boxes along the axes, and what is near them.
///
///     membrane::Box<double> box;
///     for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) box.include(point(x, v));
///     if (squared_distance(box, tool.position) > tool.radius * tool.radius) { /* the tool touches nothing */ }
namespace membrane {

/// All points between two corners, borders included [m]; empty until something is included.
template <Real Scalar>
struct Box {
    Vector3<Scalar> low = Vector3<Scalar>::Constant((std::numeric_limits<Scalar>::max)());
    Vector3<Scalar> high = Vector3<Scalar>::Constant(std::numeric_limits<Scalar>::lowest());

    /// Grows to hold `p`; coordinates that are NaN are left out.
    void include(const Vector3<Scalar>& p) noexcept;
    void include(const Box& other) noexcept;
};

/// The smallest box around a triangle.
template <Real Scalar>
[[nodiscard]] Box<Scalar> bounds(const Triangle<Scalar>& triangle) noexcept;

/// The axis along which the box is longest, 0 to 2; the first of equals.
template <Real Scalar>
[[nodiscard]] int longest_axis(const Box<Scalar>& box) noexcept;

/// Whether the boxes have a point in common.
template <Real Scalar>
[[nodiscard]] bool overlap(const Box<Scalar>& a, const Box<Scalar>& b) noexcept;

/// From `q` to the nearest point of the box, 0 inside [m^2].
template <Real Scalar>
[[nodiscard]] Scalar squared_distance(const Box<Scalar>& box, const Vector3<Scalar>& q) noexcept;

/// From `q` to the farthest corner, along the axis where that is most [m].
template <Real Scalar>
[[nodiscard]] Scalar reach(const Box<Scalar>& box, const Vector3<Scalar>& q) noexcept;

/// A capsule made ready to be tested against many boxes; a segment if its radius is zero.
template <Real Scalar>
class CapsuleProbe {
  public:
    static constexpr Scalar never = 2;

    /// Around the segment between two points. The boxes to test lie in `all`: its size tells how much the capsule must
    /// be thickened, so that rounding errors never make it miss a box.
    CapsuleProbe(const Vector3<Scalar>& from, const Vector3<Scalar>& to, Scalar radius,
                 const Box<Scalar>& all) noexcept;

    /// A bound from below of how far along the segment, 0 to 1, the capsule meets the box; `never` if it does not.
    [[nodiscard]] Scalar entry(const Box<Scalar>& box) const noexcept;

  private:
    Vector3<Scalar> from_low_, from_high_, pace_;  // pace: what part of the segment it takes to advance by a metre
};

template <Real Scalar>
void Box<Scalar>::include(const Vector3<Scalar>& p) noexcept {
    for (int k = 0; k < 3; ++k) {
        low[k] = (std::min)(low[k], p[k]);
        high[k] = (std::max)(high[k], p[k]);
    }
}

template <Real Scalar>
void Box<Scalar>::include(const Box& other) noexcept {
    for (int k = 0; k < 3; ++k) {
        low[k] = (std::min)(low[k], other.low[k]);
        high[k] = (std::max)(high[k], other.high[k]);
    }
}

template <Real Scalar>
Box<Scalar> bounds(const Triangle<Scalar>& triangle) noexcept {
    Box<Scalar> box{triangle.a, triangle.a};
    box.include(triangle.b);
    box.include(triangle.c);
    return box;
}

template <Real Scalar>
int longest_axis(const Box<Scalar>& box) noexcept {
    const Vector3<Scalar> side = box.high - box.low;
    const int longer = side[1] > side[0] ? 1 : 0;
    return side[2] > side[longer] ? 2 : longer;
}

template <Real Scalar>
bool overlap(const Box<Scalar>& a, const Box<Scalar>& b) noexcept {
    bool apart = false;
    for (int k = 0; k < 3; ++k) apart |= !(a.low[k] <= b.high[k] && b.low[k] <= a.high[k]);
    return !apart;
}

template <Real Scalar>
Scalar squared_distance(const Box<Scalar>& box, const Vector3<Scalar>& q) noexcept {
    const auto offset = [&](int k) { return q[k] - (std::min)((std::max)(q[k], box.low[k]), box.high[k]); };
    return squared_norm<Scalar>({offset(0), offset(1), offset(2)});
}

template <Real Scalar>
Scalar reach(const Box<Scalar>& box, const Vector3<Scalar>& q) noexcept {
    Scalar most = 0;
    for (int k = 0; k < 3; ++k) most = (std::max)((std::max)(most, q[k] - box.low[k]), box.high[k] - q[k]);
    return most;
}

template <Real Scalar>
CapsuleProbe<Scalar>::CapsuleProbe(const Vector3<Scalar>& from, const Vector3<Scalar>& to, Scalar radius,
                                   const Box<Scalar>& all) noexcept {
    using std::abs;
    using Limits = std::numeric_limits<Scalar>;
    const Scalar size = reach(all, from) + radius, margin = radius + 64 * Limits::epsilon() * size;
    // A step below the rounding is lost in the margin; taken for no shorter, nothing times its pace overflows.
    const Scalar shortest = (std::max)(Limits::epsilon() * size, (Limits::min)());
    for (int k = 0; k < 3; ++k) {
        const Scalar step = to[k] - from[k];
        from_low_[k] = from[k] + margin;
        from_high_[k] = from[k] - margin;
        pace_[k] = 1 / (abs(step) >= shortest ? step : shortest);
    }
}

template <Real Scalar>
Scalar CapsuleProbe<Scalar>::entry(const Box<Scalar>& box) const noexcept {
    Scalar first = 0, last = 1;
    for (int k = 0; k < 3; ++k) {
        const Scalar to_low = (box.low[k] - from_low_[k]) * pace_[k],
                     to_high = (box.high[k] - from_high_[k]) * pace_[k];
        first = (std::max)(first, (std::min)(to_low, to_high));
        last = (std::min)(last, (std::max)(to_low, to_high));
    }
    return first <= last ? first : never;
}

}  // namespace membrane
