// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/core/types.hpp>

namespace membrane {

/// Points of triangles that are held: for each, the weighted sum of its three corners is to be the target.
///
///     membrane::HeldPlaces places;
///     places.add({corners, weights, target});
///     places.settle(y);                        // every point is in its place
///     places.project(way);                     // and stays there if y moves by this
class HeldPlaces {
  public:
    struct Place {
        std::array<Index, 3> corners;
        Vector3<double> weights, target;
    };

    /// False where there are 16 already.
    bool add(const Place& place) noexcept {
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
    [[nodiscard]] std::span<const Place> places() const noexcept { return {places_.data(), count_}; }
    [[nodiscard]] static Vector3<double> sum(const Place& place, const Points<double>& y) noexcept {
        const auto part = [&](int k) {
            return Vector3<double>(place.weights[k] * point(y, place.corners[static_cast<std::size_t>(k)]));
        };
        return (part(0) + part(1)) + part(2);
    }
    static void shift(const Place& place, const Vector3<double>& way, Points<double>& y) noexcept {
        for (int k = 0; k < 3; ++k) {
            const double part = place.weights[k] / squared_norm(place.weights);
            y.col(place.corners[static_cast<std::size_t>(k)]) += part * way;
        }
    }

    std::array<Place, 16> places_{};
    std::size_t count_ = 0;
};

template <class IsFixed>
bool HeldPlaces::independent(IsFixed fixed) const noexcept {
    const auto owners = [&](Index v) {
        int count = 0;
        for (const auto& place : places()) {
            for (int k = 0; k < 3; ++k) {
                if (place.corners[static_cast<std::size_t>(k)] == v && place.weights[k] != 0) ++count;
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

inline void HeldPlaces::project(Points<double>& f) const noexcept {
    for (const auto& place : places()) shift(place, -sum(place, f), f);
}

inline void HeldPlaces::settle(Points<double>& y) const noexcept {
    for (const auto& place : places()) shift(place, place.target - sum(place, y), y);
}

inline double HeldPlaces::slip(const Points<double>& y) const noexcept {
    double squares = 0;
    for (const auto& place : places()) {
        double size = norm(place.target);
        for (int k = 0; k < 3; ++k) {
            size += std::abs(place.weights[k]) * norm(point(y, place.corners[static_cast<std::size_t>(k)]));
        }
        const double left =
            norm<double>(place.target - sum(place, y)) + 8 * std::numeric_limits<double>::epsilon() * size;
        squares += left * left / squared_norm(place.weights);
    }
    return (1 + 1e-9) * std::sqrt(squares);
}

}  // namespace membrane
