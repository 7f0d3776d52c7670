// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/solve/constraint_term.hpp>

namespace membrane {

/// Points of triangles that are held: for each, the weighted sum of its three corners is to be the target.
///
///     membrane::PointAttachments places;
///     places.add(membrane::ConstraintTerm::hold(corners, weights, target));
///     places.settle(y);                        // every point is in its place
///     places.project(displacement);                     // and stays there if y moves by this
class PointAttachments {
  public:
    /// `place` holds a point. False where there are 16 already.
    bool add(const ConstraintTerm& place) noexcept {
        if (count_ == places_.size()) return false;
        places_[count_++] = place;
        return true;
    }
    void clear() noexcept { count_ = 0; }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

    /// Whether no corner that counts is part of two places, or `fixed(v)`. What is below needs that.
    template <class IsFixed>
    [[nodiscard]] bool independent(IsFixed fixed) const noexcept;

    /// Takes out of `f` what moves a point: the orthogonal projection.
    void project(Points<double>& f) const noexcept;

    /// Moves the points to their places, by the shortest way.
    void settle(Points<double>& y) const noexcept;

    /// No more than this way is left to where all points are in their places, rounding included [m].
    [[nodiscard]] double slip(const Points<double>& y) const noexcept;

  private:
    [[nodiscard]] std::span<const ConstraintTerm> places() const noexcept { return {places_.data(), count_}; }
    static void shift(const ConstraintTerm& place, const Vector3<double>& displacement, Points<double>& y) noexcept {
        for (std::size_t k = 0; k < 3; ++k) y.col(place.corners[k]) += place.share(k) * displacement;
    }

    std::array<ConstraintTerm, 16> places_{};
    std::size_t count_ = 0;
};

template <class IsFixed>
bool PointAttachments::independent(IsFixed fixed) const noexcept {
    const auto owners = [&](Index v) {
        int count = 0;
        for (const auto& place : places()) {
            for (std::size_t k = 0; k < 3; ++k) {
                if (place.corners[k] == v && place.weight(k) != 0) ++count;
            }
        }
        return count;
    };
    for (const auto& place : places()) {
        for (const Index v : place.corners) {
            if (owners(v) + (fixed(v) ? 1 : 0) > 1 && owners(v) > 0) return false;
        }
    }
    return true;
}

inline void PointAttachments::project(Points<double>& f) const noexcept {
    for (const auto& place : places()) shift(place, -place.point_to_body(f), f);
}

inline void PointAttachments::settle(Points<double>& y) const noexcept {
    for (const auto& place : places()) shift(place, place.target - place.point_to_body(y), y);
}

inline double PointAttachments::slip(const Points<double>& y) const noexcept {
    double squares = 0;
    for (const auto& place : places()) {
        double size = norm(place.target);
        for (std::size_t k = 0; k < 3; ++k) size += std::abs(place.weight(k)) * norm(point(y, place.corners[k]));
        const double left =
            norm<double>(place.target - place.point_to_body(y)) + 8 * std::numeric_limits<double>::epsilon() * size;
        squares += left * left / squared_norm(place.weights);
    }
    return (1 + 1e-9) * std::sqrt(squares);
}

}  // namespace membrane
