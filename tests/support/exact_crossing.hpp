// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <membrane/surface/triangle.hpp>

#include "support/brute_force.hpp"

/// Where a segment meets a triangle, and by how much roundings of `first_hit` may change that.
///
///     if (!test::ExactCrossing(triangle, from, to).may_hit_at(hit.fraction)) FAIL_CHECK("missed");
namespace test {

/// Signed volumes decide: sums of six products of three differences each. With one rounding for each difference and
/// product and at most three for the sums, eight in all, a computed one is off by at most 6 * 8 * epsilon / 2 = 24
/// epsilon times the largest components of the three differences. Nothing is divided: no bound grows as the segment
/// becomes parallel to the plane or to an edge.
class ExactCrossing {
    using Long = long double;

  public:
    template <membrane::Real S>
    ExactCrossing(const membrane::Triangle<S>& triangle, const membrane::Vector3<S>& from,
                  const membrane::Vector3<S>& to)
        : start_(from.eigen().template cast<Long>()), segment_(to.eigen().template cast<Long>() - start_) {
        const auto [a, b, c] = brute_triangle<Long>(triangle);
        corners_ = {a, b, c};
        normal_ = cross<Long>(b - a, c - a);
        sign_ = normal_.dot(segment_) < 0 ? -1 : 1;
        climb_ = sign_ * normal_.dot(segment_);
        before_ = sign_ * normal_.dot(a - start_);
        length_ = largest(segment_);
        size_ = std::max(largest(b - a), largest(c - a));
        farthest_ = std::max(size_, largest(a - start_));
        epsilon_ = std::numeric_limits<S>::epsilon();
    }

    /// Whether `first_hit` may report the point at this fraction of the segment.
    bool may_hit_at(Long fraction) const {
        return fraction >= 0 && fraction <= 1 && on_plane(fraction) && (met() || inside(fraction));
    }

    /// Whether the point at this fraction is beyond the plane by more than roundings, so that a triangle that is met
    /// must be hit before. What may count as parallel is not.
    bool is_before(Long fraction) const {
        return !may_be_parallel() && fraction * climb_ - before_ > rounding * slack_of(size_ + fraction * length_);
    }

  private:
    static constexpr Long allowed = 64;   // by `first_hit`, so that it is watertight
    static constexpr Long rounding = 32;  // 24, the fraction's own, and those of the allowance

    static Long largest(const Vector<Long>& v) { return v.cwiseAbs().maxCoeff(); }

    /// Epsilon times the third difference `of` and the largest components of the two others.
    Long slack_of(Long of) const { return epsilon_ * farthest_ * size_ * of; }

    bool may_be_parallel() const { return climb_ <= (allowed + rounding) * slack_of(length_); }

    /// The allowance is used at the segment's ends, where the fraction is clamped, and by what counts as parallel.
    bool on_plane(Long fraction) const {
        const Long most = fraction == 0 || fraction == 1 || may_be_parallel() ? allowed + rounding : rounding;
        return std::abs(fraction * climb_ - before_) <= most * slack_of(size_ + fraction * length_);
    }

    /// Whether the line passes all edges on the inner side, and the plane lies between the ends.
    bool met() const {
        for (std::size_t k = 0; k < 3; ++k) {  // the edge opposite to corner k
            const auto &first = corners_[(k + 1) % 3], &second = corners_[(k + 2) % 3];
            const Long volume = sign_ * cross<Long>(segment_, first - start_).dot(second - first);
            const int computed = k == 0 ? 3 : 1;  // opposite to corner 0: from the volumes of the others and the climb
            if (volume < -(allowed + computed * rounding) * slack_of(length_)) return false;
        }
        return before_ >= -(allowed + rounding) * slack_of(size_) &&
               climb_ - before_ >= -(allowed + rounding) * slack_of(length_ + size_);
    }

    /// Whether a segment that may count as parallel is, at this fraction, on the inner side of all edges: sums of
    /// twelve products of four differences, with eleven roundings each, and one difference of up to twice the size: 132
    /// epsilon.
    bool inside(Long fraction) const {
        if (!may_be_parallel()) return false;
        for (std::size_t k = 0; k < 3; ++k) {
            const Vector<Long> offset = start_ - corners_[k];
            const Vector<Long> inward = cross<Long>(normal_, corners_[(k + 1) % 3] - corners_[k]);
            const Long extent = largest(offset) + fraction * length_;
            const Long slack =
                allowed * slack_of(largest(normal_)) + (132 + rounding) * epsilon_ * size_ * size_ * size_ * extent;
            if (inward.dot(offset + fraction * segment_) < -slack) return false;
        }
        return true;
    }

    Vector<Long> start_, segment_, normal_;
    std::array<Vector<Long>, 3> corners_;
    Long sign_, climb_, before_;     // of the segment against the normal; of its part before the plane
    Long size_, length_, farthest_;  // largest components: of triangle, segment, and triangle or its distance
    Long epsilon_;
};

}  // namespace test
