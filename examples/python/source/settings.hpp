// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <membrane/accuracy/choose_settings.hpp>

#include "accuracy.hpp"

/// Trials and the choice of settings, for each type of rule.
namespace membrane_python {

using Trajectory = membrane::ToolTrajectory<double>;
using References = std::vector<membrane::ReferenceTick>;
using Choice = membrane::ChosenSettings<double>;
using Experiment = membrane::GridSearchOptions<double>;

/// A membrane and what is done to it.
struct Scene {
    const Mesh& mesh;
    const Network& network;
    const Foundation& foundation;
    const Trajectory& trajectory;
};

///@{
/// As the functions of the library. Compiled once for each rule: settings_block.cpp and its neighbours.
template <class Rule>
[[nodiscard]] membrane::TrialResult run_trial(const Scene& scene, const References& references,
                                              const SolverOptions& options, const Rule& rule) {
    return unlocked("run_trial", scene.network, scene.foundation, [&](const auto& springs, const auto& volume) {
        return membrane::run_trial(scene.mesh, springs, volume, scene.trajectory, references, options, rule);
    });
}
template <class Rule>
[[nodiscard]] Choice choose_settings(const Scene& scene, const membrane::Requirement& requirement,
                                     const Experiment& experiment, const Rule& rule) {
    return unlocked("choose_settings", scene.network, scene.foundation, [&](const auto& springs, const auto& volume) {
        return membrane::choose_settings(scene.mesh, springs, volume, scene.trajectory, requirement, experiment, rule);
    });
}
///@}

#define MEMBRANE_PYTHON_SETTINGS(PREFIX, RULE)                                                                  \
    PREFIX membrane::TrialResult run_trial(const Scene&, const References&, const SolverOptions&, const RULE&); \
    PREFIX Choice choose_settings(const Scene&, const membrane::Requirement&, const Experiment&, const RULE&)

MEMBRANE_PYTHON_SETTINGS(extern template, membrane::BlockStep);
MEMBRANE_PYTHON_SETTINGS(extern template, membrane::SafeStep);
MEMBRANE_PYTHON_SETTINGS(extern template, membrane::MassStep);

}  // namespace membrane_python
