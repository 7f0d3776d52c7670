// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/solve/quasi_static.hpp>

namespace test {

/// Steps of `dt` until nothing is left to do, or `most` of them; the last one's report.
///
///     const auto report = test::run_to_equilibrium(solver, x, dt, network, foundation, membrane::pull(v, target));
///     REQUIRE(report.converged);
template <class Solver, class Positions, class Network, class Volume, class... Constraints>
auto run_within(int most, Solver& solver, Positions& x, typename Network::Scalar dt, const Network& network,
                const Volume& volume, const Constraints&... constraints) {
    auto report = solver.step(x, dt, network, volume, constraints...);
    for (int i = 1; i < most && !report.converged; ++i) {
        if (report.status != membrane::StepStatus::advanced) break;
        report = solver.step(x, dt, network, volume, constraints...);
    }
    return report;
}

template <class Solver, class Positions, class Network, class Volume, class... Constraints>
auto run_to_equilibrium(Solver& solver, Positions& x, typename Network::Scalar dt, const Network& network,
                        const Volume& volume, const Constraints&... constraints) {
    return run_within(100'000, solver, x, dt, network, volume, constraints...);
}

}  // namespace test
