// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>

#include <membrane/solve/step.hpp>

namespace test {

/// An order of updates for each seed, all of them in turn: what holds in one must hold in every one.
///
///     QuasiStaticSolver solver(network, {.order = test::order_of(seed)});
[[nodiscard]] inline membrane::UpdateOrder order_of(int seed) {
    using membrane::UpdateOrder;
    return std::array{UpdateOrder::colour_layers, UpdateOrder::breadth_first,
                      UpdateOrder::colour_all}[static_cast<std::size_t>(seed) % 3];
}

}  // namespace test
