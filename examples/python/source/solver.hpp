// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <limits>
#include <utility>
#include <variant>

#include "types.hpp"

/// The step, for each type of rule, foundation and law.
namespace membrane_python {

template <class Rule>
using SolverOf = membrane::QuasiStaticSolver<double, Rule>;

/// A solver of one of the rules, and the report of its last step.
struct Solver {
    std::variant<SolverOf<membrane::BlockStep>, SolverOf<membrane::SafeStep>, SolverOf<membrane::MassStep>> any;
    Index vertex_count;
    SurfaceVersion version;
    StepReport report = {};
};

/// The arguments of a step. `seconds` is the time that it has, infinite if it has no deadline.
struct StepArguments {
    MovingPositions x;
    double dt;
    const Network& network;
    const Constraints& constraints;
    double seconds = std::numeric_limits<double>::infinity();
};

/// One step. Compiled once for each rule and foundation: solve_block.cpp and its neighbours.
template <class Rule, class Volume>
[[nodiscard]] StepReport take_step(SolverOf<Rule>& solver, const StepArguments& arguments, const Volume& volume);

#define MEMBRANE_PYTHON_STEPS(PREFIX, RULE)                                                                            \
    PREFIX StepReport take_step(SolverOf<RULE>&, const StepArguments&, const membrane::VirtualVolumeSprings<double>&); \
    PREFIX StepReport take_step(SolverOf<RULE>&, const StepArguments&, const membrane::FoundationSprings<double>&);    \
    PREFIX StepReport take_step(SolverOf<RULE>&, const StepArguments&, const membrane::NoFoundation&);                 \
    PREFIX StepReport take_step(SolverOf<RULE>&, const StepArguments&, const membrane::CohesiveSprings<double>&)

MEMBRANE_PYTHON_STEPS(extern template, membrane::BlockStep);
MEMBRANE_PYTHON_STEPS(extern template, membrane::SafeStep);
MEMBRANE_PYTHON_STEPS(extern template, membrane::MassStep);

namespace detail {

///@{
/// A network as a step takes it: springs that tear are like others to it.
template <class Network>
[[nodiscard]] const Network& in_step(const Network& network) {
    return network;
}
template <class Law>
[[nodiscard]] const SpringsOf<Law>& in_step(const TearableOf<Law>& springs) {
    return springs;
}
///@}

/// A step with this number of constraints: it takes them one by one.
template <class Rule, class Volume, class Springs, std::size_t... i>
[[nodiscard]] StepReport step_with(SolverOf<Rule>& solver, const StepArguments& with, const Springs& springs,
                                   const Volume& volume, std::index_sequence<i...>) {
    using Reference = membrane::ConstraintRef<double>;
    if (with.seconds == std::numeric_limits<double>::infinity()) {
        return solver.step(with.x.map(), with.dt, springs, volume,
                           static_cast<const Reference&>(with.constraints.all[i])...);
    }
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                        std::chrono::duration<double>((std::min)(with.seconds, 1e6)));
    return solver.step_until(membrane::Deadline([] { return Clock::now(); }, end), with.x.map(), with.dt, springs,
                             volume, static_cast<const Reference&>(with.constraints.all[i])...);
}

}  // namespace detail

template <class Rule, class Volume>
StepReport take_step(SolverOf<Rule>& solver, const StepArguments& with, const Volume& volume) {
    const auto step_of = [&]<class Springs>(const Springs& springs) {
        using Step = StepReport (*)(SolverOf<Rule>&, const StepArguments&, const Springs&, const Volume&);
        constexpr auto by_count = []<std::size_t... n>(std::index_sequence<n...>) {
            return std::array<Step, sizeof...(n)>{
                [](SolverOf<Rule>& of, const StepArguments& a, const Springs& s, const Volume& v) {
                    return detail::step_with(of, a, s, v, std::make_index_sequence<n>());
                }...};
        }
        (std::make_index_sequence<max_constraints + 1>());
        return by_count[with.constraints.count](solver, with, springs, volume);
    };
    return std::visit([&](const auto& network) { return step_of(detail::in_step(network)); }, with.network.any);
}

}  // namespace membrane_python
