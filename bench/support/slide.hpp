// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "scene.hpp"

/// A tool that is pressed in and slides along a great circle, and the reference force of each tick, without a time
/// limit.
///
///     SlidingLoop<double> loop(642, {}, {.layers = 6, .sweeps = 2}, 0);
///     for (Index t = 0; t < Slide::ticks; ++t) loop.frame();
namespace bench {

using membrane::Real;

/// Straight in at one point, then along a great circle.
struct Slide {
    static constexpr Index ticks_in = 60, ticks = ticks_in + 240;
    static constexpr Index late_ticks = 1500;    // of a slide that leaves a long trail
    static constexpr Index first_measured = 80;  // the transient of the press is over
    static constexpr double speed = 0.05;        // [m/s]

    double tool_radius = 2e-3;  ///< zero for a point [m]
    double shaft = 0;           ///< its length, across the motion; zero for a sphere [m]

    [[nodiscard]] static Vector3 start() { return Vector3(0.31, 0.17, 0.93).normalized(); }
    [[nodiscard]] static Vector3 along() {
        return membrane::cross<double>(start(), Vector3(0.7, -0.5, 0.2)).normalized();
    }
    [[nodiscard]] static Vector3 across() { return membrane::cross(start(), along()); }

    template <Real Scalar>
    [[nodiscard]] membrane::Tool<Scalar> at(Index t) const {
        const Vector3 end = position(t) - shaft / 2 * across();
        return {.position = end.cast<Scalar>(),
                .axis = (shaft * across()).cast<Scalar>(),
                .radius = static_cast<Scalar>(tool_radius),
                .velocity = ((position(t) - position(t - 1)) / tick).cast<Scalar>(),
                .time = static_cast<Scalar>(tick * t)};
    }

    /// The middle of the tool [m]; the press begins at t = -1.
    [[nodiscard]] Vector3 position(Index t) const {
        const double pressed = depth * std::min(t + 1, ticks_in) / ticks_in;
        const double angle = std::max(t - ticks_in + 1, 0) * speed * tick / radius;
        return (radius + tool_radius - pressed) * (std::cos(angle) * start() + std::sin(angle) * along());
    }
};

template <Real Scalar>
using SlidingLoop = LoopOf<Scalar, membrane::BlockStep, Slide>;

/// The reaction in each measured tick, by a step with many layers and sweeps.
struct Reference {
    static constexpr membrane::SolverOptions<double> options{.layers = 40, .sweeps = 200};

    std::vector<Vector3> forces;  ///< [N]
    double rms = 0, largest = 0;  ///< of their norms [N]
};

/// The reference for a mesh of this number of vertices; computed once: some minutes for 40,962.
[[nodiscard]] inline const Reference& reference_of(std::int64_t vertices) {
    static std::map<std::int64_t, Reference> known;
    Reference& reference = known[vertices];
    if (!reference.forces.empty()) return reference;
    SlidingLoop<double> loop(vertices, {}, Reference::options, Slide::first_measured);
    double squares = 0;
    while (loop.now < Slide::ticks) {
        loop.frame();
        const Vector3& force = loop.report.reactions[0];
        reference.forces.push_back(force);
        squares += membrane::squared_norm(force);
        reference.largest = std::max(reference.largest, membrane::norm(force));
    }
    loop.validate();
    reference.rms = std::sqrt(squares / static_cast<double>(reference.forces.size()));
    return reference;
}

[[nodiscard]] inline double median(std::vector<double> numbers) {
    const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
    std::nth_element(numbers.begin(), middle, numbers.end());
    return *middle;
}

}  // namespace bench
