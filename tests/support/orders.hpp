// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>

#include <membrane/solve/step.hpp>

namespace test {

/// An order of visits for each seed, all of them in turn: what holds in one must hold in every one.
///
///     QuasiStaticSolver solver(network, {.order = test::order_of(seed)});
[[nodiscard]] inline membrane::VisitOrder order_of(int seed) {
    using membrane::VisitOrder;
    return std::array{VisitOrder::groups, VisitOrder::arrival, VisitOrder::colours}[static_cast<std::size_t>(seed) % 3];
}

}  // namespace test
