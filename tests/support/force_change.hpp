// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <limits>

#include <membrane/core/types.hpp>
#include <membrane/core/vector3.hpp>

/// How much a force changes from one tick to the next, against what a limit of the slew allows.
///
///     CHECK(test::within_slew(before, felt, slew * dt));
namespace test {

template <membrane::Real S>
double size_of(const membrane::Vector3<S>& force) {
    return membrane::norm<double>(force.template cast<double>());
}

/// Whether a change from `before` to `after` is no larger than `most`, or straight towards zero. What a float is off by
/// its own rounding is no change.
template <membrane::Real S>
bool within_slew(const membrane::Vector3<S>& before, const membrane::Vector3<S>& after, double most) {
    const membrane::Vector3<double> p = before.template cast<double>(), f = after.template cast<double>();
    if (membrane::norm<double>(f - p) <= most * (1 + 1e-12)) return true;
    const double kept = std::clamp(membrane::dot(f, p) / membrane::squared_norm(p), 0.0, 1.0);
    const double rounding = 16 * static_cast<double>(std::numeric_limits<S>::epsilon()) * membrane::norm(p);
    return membrane::norm<double>(f - kept * p) <= rounding;
}

}  // namespace test
