// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <membrane/core/lanes.hpp>

/// The angle of a direction in a plane.
///
///     const membrane::Lanes<double> angle = membrane::arctangent(sine, cosine);                      // [rad]
namespace membrane {

namespace detail {

/// (arctan(x) / x - 1) / x^2 as a polynomial in x^2, by Remez' exchange for |x| <= tan(pi / 8): arctan has relative
/// errors of at most 2e-18 and 7e-10.
template <Real Scalar>
inline constexpr auto arctangent_series =
    std::to_array<Scalar>({-0.333333333333331991, 0.199999999999540809, -0.142857142802484131, 0.111111107861338341,
                           -0.0909089783635391833, 0.0769206163572112086, -0.0666312037085999397, 0.0584800883899745387,
                           -0.0503984523272233288, 0.0380783154474687874, -0.0179222748034178637});
template <>
inline constexpr auto arctangent_series<float> = std::to_array<float>({-0.333333155F, 0.199984894F, -0.142438487F,
                                                                       0.105960013F, -0.0608345288F});

/// arctan(t) for |t| <= tan(pi / 8).
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N arctangent_of_small(const N& t) noexcept {
    constexpr auto series = arctangent_series<Each<N>>;
    const N square = t * t, fourth = square * square;
    // Two sums of every other term, which a processor evaluates at the same time.
    constexpr std::size_t last = series.size() - 1;
    N sum = series[last], other = series[last - 1];
    for (std::size_t k = last; k >= 2; k -= 2) {
        sum = sum * fourth + series[k - 2];
        if (k >= 3) other = other * fourth + series[k - 3];
    }
    return t + t * (square * (sum + square * other));
}

}  // namespace detail

/// `std::atan2(y, x)` [rad], to four epsilons for numbers up to half of the largest one; zero at the origin, NaN unless
/// both are finite. It has the same bits on every machine, which the standard library does not promise: by sums,
/// products, one division and comparisons. Faster if all angles are below pi / 8.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N arctangent(const N& y, const N& x) noexcept {
    using std::abs;
    using Scalar = Each<N>;
    constexpr Scalar pi = std::numbers::pi_v<Scalar>, tangent_of_eighth = std::numbers::sqrt2_v<Scalar> - 1;
    const N across = abs(y), along = abs(x);
    // The same as below. The last term is zero or NaN.
    if (all(across <= tangent_of_eighth * x)) {
        return detail::arctangent_of_small<N>(y / select<N>(x > 0, x, 1)) + 0 * x;
    }
    const N longer = larger(across, along), shorter = smaller(across, along);
    // arctan(t) = pi/4 + arctan((t - 1) / (t + 1)).
    const auto beyond = shorter > tangent_of_eighth * longer;
    const N divisor = select<N>(beyond, shorter + longer, longer);
    const N t = select<N>(beyond, shorter - longer, shorter) / select<N>(longer > 0, divisor, 1);
    const N reduced = detail::arctangent_of_small<N>(t);
    const N in_eighth = select<N>(beyond, pi / 4 + reduced, reduced);
    const N in_quarter = select<N>(across > along, pi / 2 - in_eighth, in_eighth);
    const N in_half = select<N>(x < 0, pi - in_quarter, in_quarter);
    return select<N>(y < 0, -in_half, in_half) + (0 * x + 0 * y);  // comparisons alone would lose a NaN
}

}  // namespace membrane
