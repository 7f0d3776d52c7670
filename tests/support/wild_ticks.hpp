// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include <membrane/replay/recording.hpp>

#include "support/random.hpp"

namespace test {

/// A tick of any numbers: large, small, negative zero, infinite, NaN.
template <membrane::Real S>
membrane::RecordedTick<S> wild_tick(Random& random) {
    using Limits = std::numeric_limits<S>;
    constexpr std::array<S, 6> odd{S(-0.0),          Limits::infinity(), Limits::quiet_NaN(), Limits::denorm_min(),
                                   Limits::lowest(), Limits::max()};
    std::array<S, membrane::detail::numbers_of_tick> numbers{};
    for (S& number : numbers) {
        number = random.chance(0.2) ? odd[static_cast<std::size_t>(random.index(6))] : random.number<S>(-1, 1);
    }
    return membrane::detail::tick_of(numbers, random.chance(0.5));
}

template <membrane::Real S>
membrane::Recording<S> wild_recording(Random& random, int ticks) {
    membrane::Recording<S> recording{.vertex_count = random.index(1000)};
    for (int i = 0; i < ticks; ++i) recording.ticks.push_back(wild_tick<S>(random));
    return recording;
}

template <membrane::Real S>
bool identical(const membrane::Recording<S>& a, const membrane::Recording<S>& b) {
    if (a.vertex_count != b.vertex_count || a.ticks.size() != b.ticks.size()) return false;
    for (std::size_t i = 0; i < a.ticks.size(); ++i) {
        if (!membrane::identical(a.ticks[i], b.ticks[i])) return false;
    }
    return true;
}

}  // namespace test
