// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <numbers>

#include <membrane/core/types.hpp>

/// Half width of a confidence interval in standard deviations, if the deviation is estimated from a few numbers.
///
///     mean + membrane::student_t(0.95, 9) * deviation_of_mean;                 // upper end, from 10 numbers: 2.262
namespace membrane {

/// The bound that |t| of Student's distribution stays below with this probability, above 0 and below 1, for `degrees`
/// of freedom, 1 or more. With t = sqrt(degrees) tan(angle) the probability is a finite sum over powers of the cosine,
/// [Abramowitz64] 26.7.3 and 26.7.4. Cost: O(degrees).
[[nodiscard]] inline double student_t(double probability, Index degrees) noexcept {
    const bool even = degrees % 2 == 0;
    const auto probability_of = [=](double angle) {
        const double square = std::cos(angle) * std::cos(angle);
        double term = even ? 1 : std::cos(angle), sum = degrees == 1 ? 0 : term;
        for (Index k = even ? 2 : 3; k < degrees; k += 2) {
            term *= square * (k - 1) / k;
            sum += term;
        }
        return even ? std::sin(angle) * sum : 2 / std::numbers::pi * (angle + std::sin(angle) * sum);
    };
    double low = 0, high = std::numbers::pi / 2;
    for (int halving = 0; halving < 60; ++halving) {
        const double middle = (low + high) / 2;
        (probability_of(middle) < probability ? low : high) = middle;
    }
    return std::sqrt(static_cast<double>(degrees)) * std::tan((low + high) / 2);
}

}  // namespace membrane
