// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <vector>

#include <Eigen/Core>

#include "support/plot.hpp"

namespace examples {

/// Amplitude spectrum [mN] of equidistant forces [N], over frequencies from `lowest` on [Hz]. Uses a Hann window, which
/// removes the effect of the ends of the record.
[[nodiscard]] inline Curve spectrum(const std::vector<Eigen::Vector3d>& forces, double tick, double lowest) {
    const auto count = static_cast<double>(forces.size());
    Curve amplitudes;
    for (double k = std::ceil(lowest * tick * count); 2 * k < count; ++k) {
        Eigen::Vector3cd sum = Eigen::Vector3cd::Zero();
        for (std::size_t i = 0; i < forces.size(); ++i) {
            const double turn = 2 * std::numbers::pi * static_cast<double>(i) / count;
            sum += (1 - std::cos(turn)) * std::polar(1.0, -k * turn) * forces[i];
        }
        amplitudes.push_back({k / (tick * count), 2e3 * sum.norm() / count});
    }
    return amplitudes;
}

}  // namespace examples
