// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/accuracy/trial.hpp>

/// Finds by experiment how many layers and sweeps a network needs under a given load.
///
///     #include <membrane/accuracy/choose_settings.hpp>
///     const auto trajectory = membrane::ToolTrajectory(mesh, tools, 1e-3);  // recorded: one tool for each tick
///     const auto choice = membrane::choose_settings(mesh, network, foundation, trajectory, {.force_error = 0.01});
///     if (!choice.satisfied) ...                                               // no setting of the grid is sufficient
///     choice.force_error, choice.max_force_error;                              // rms of the ticks, and the largest
///     choice.max_speed, choice.max_displacement;                               // for motion up to these [m/s], [m]
///     auto solver = membrane::QuasiStaticSolver(network, choice.options);
namespace membrane {

/// The requirement: an error, a time, or both.
struct Requirement {
    double force_error = 0;  ///< upper bound, see `TrialResult`; the cheapest setting within it is chosen
    double time = 0;         ///< upper bound of the mean tick [s]; alone, the most accurate setting within it is chosen
    /// Relative error of the force by the mesh, from `estimated_mesh_error`; its sign does not count. If it is not 0,
    /// `force_error` is that of mesh and solver together: the solver gets what the mesh leaves, and at least half.
    double mesh_error = 0;
};

/// The grid: every number of layers with every number of sweeps and of contact iterations.
template <Real Scalar>
struct GridSearchOptions {
    ///@{
    /// Values to try of the solver's option of this name.
    std::vector<Index> layers = {1, 2, 3, 4, 6, 8, 12, 16};
    std::vector<Index> sweeps = {1, 2, 3, 4, 6, 8, 12, 16};
    std::vector<Index> contact_iterations = {1, 2, 4, 8};
    ///@}

    SolverOptions<Scalar> others = {};  ///< all other options
    /// A setting satisfies a required error if its measured error is at most the required one divided by this, >= 1.
    double safety_factor = 1.8;
    Index tick_stride = 1;  ///< errors are taken in every `tick_stride`-th tick; more than 1 needs fewer equilibria
    Index repetitions = 3;  ///< of each setting; the shortest time counts
    /// Errors are against the equilibria, and contain the viscous force of a damped foundation; or against the exact
    /// steps, see `exact_steps`, without it.
    bool count_viscosity = true;

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

/// The chosen setting, with its measured cost and error.
template <Real Scalar>
struct ChosenSettings : TrialResult {
    SolverOptions<Scalar> options;  ///< of the chosen setting
    /// Whether `time` is at most the required time, and `force_error` at most the required error of the solver over
    /// `safety_factor`. If no setting satisfies this, the chosen one comes closest; if both are required, it is
    /// the most accurate that keeps the time, or the one with the shortest.
    bool satisfied = false;
    ///@{
    /// Which of the two the chosen setting keeps; true for one that is not required.
    bool keeps_error = true, keeps_time = true;
    ///@}
    /// Estimate of the factor by which all edges must be multiplied for the required error of mesh and solver, if the
    /// mesh's error is proportional to the square of its edges; 1 if the mesh is fine enough or `mesh_error` is 0. On
    /// the finer mesh the settings are to be chosen again.
    double edge_factor = 1;
};

/// The best solver setting for this membrane and load history, found by experiment, as [Liu07] finds the threshold of
/// the propagation queue. Computes the equilibria once, then tries one setting after the other. A setting is skipped if
/// earlier ones show that it cannot be the best, assuming that fewer layers, sweeps or iterations take no longer and
/// are no more accurate.
///
/// The history must represent later use: it should be long, press at many positions, and be as fast as the user's hand;
/// most errors come with changes between ticks. Errors under other histories of the same kind differ somewhat: hence
/// `safety_factor`. It was tried in 500 random scenes (spheres, ellipsoids and caps of 42 to 642 vertices, foundations
/// of 0.01 to 10 times the springs, 12 presses, required errors of 0.1 to 10 %), of which 374 had a setting that
/// satisfies the requirement. Under 12 other presses at other positions, 96 % of the choices kept the required error,
/// and 82 % took at most 1.5 times the time of the cheapest setting that keeps it. A required time has no safety
/// factor.
///
/// The required error is that of the rms: single ticks are off by up to `max_force_error`. It holds for motion like
/// that of the history, up to its `max_speed` and `max_displacement`: a faster or deeper tool has larger errors.
///
/// @throws InvalidInput for a required error or time that is not positive, neither of them, a `mesh_error` that is not
/// finite or without a required error, an option out of its range, a history without a felt force or without an
/// equilibrium, and for arguments that `run_trial` and `equilibria` refuse. Offline. Cost: an `equilibrium` for each
/// compared tick, and about 30 to 300 runs of the history, repetitions included; up to twice as many for both.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule = BlockStep, class Clock = SteadySeconds>
[[nodiscard]] ChosenSettings<Scalar> choose_settings(
    const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume, const History& history,
    const Requirement& requirement, const std::type_identity_t<GridSearchOptions<Scalar>>& experiment = {},
    const Rule& rule = {}, const Clock& clock = {});

/// The best setting by a user-defined trial: `attempt(options)` returns the `TrialResult` of these options.
template <Real Scalar, class Attempt>
[[nodiscard]] ChosenSettings<Scalar> choose_settings(const GridSearchOptions<Scalar>& experiment,
                                                     const Requirement& requirement, Attempt attempt);

namespace detail {

inline constexpr std::string_view choose_name = "choose_settings";

inline void validate(const Requirement& requirement) {
    const auto [error, time, mesh_error] = requirement;
    if (error == 0 && time == 0) refuse(choose_name, "a force_error or a time must be required, got none");
    if (!is_finite(error) || error < 0) {
        refuse(choose_name, "the required force_error must be finite and positive, got ", error);
    }
    if (!is_finite(time) || time < 0) {
        refuse(choose_name, "the required time must be finite and positive [s], got ", time);
    }
    if (!is_finite(mesh_error) || (mesh_error != 0 && error == 0)) {
        refuse(choose_name, "mesh_error must be finite and come with a required force_error, got ", mesh_error);
    }
}

/// The required error of the solver: what the mesh leaves, and at least half.
[[nodiscard]] inline double solver_error(const Requirement& requirement) noexcept {
    return requirement.force_error - (std::min)(std::abs(requirement.mesh_error), requirement.force_error / 2);
}

/// Whether `setting` has at least the layers, sweeps and contact iterations of `other`.
template <Real Scalar>
[[nodiscard]] bool covers(const SolverOptions<Scalar>& setting, const SolverOptions<Scalar>& other) noexcept {
    return setting.layers >= other.layers && setting.sweeps >= other.sweeps &&
           setting.contact_iterations >= other.contact_iterations;
}

/// All settings of the grid, in ascending order of estimated work.
template <Real Scalar>
[[nodiscard]] std::vector<SolverOptions<Scalar>> settings_of(const GridSearchOptions<Scalar>& experiment) {
    std::vector<SolverOptions<Scalar>> settings;
    for (const Index layers : experiment.layers) {
        for (const Index sweeps : experiment.sweeps) {
            for (const Index contact_iterations : experiment.contact_iterations) {
                settings.push_back(experiment.others);
                settings.back().layers = layers;
                settings.back().sweeps = sweeps;
                settings.back().contact_iterations = contact_iterations;
            }
        }
    }
    const auto work = [](const SolverOptions<Scalar>& setting) {  // layer k of a mesh has about 6 k vertices
        const double rings = setting.layers;
        return setting.sweeps * (4.0 * setting.contact_iterations + 3 * rings * (rings + 2));
    };
    std::stable_sort(settings.begin(), settings.end(), [&](const auto& a, const auto& b) { return work(a) < work(b); });
    return settings;
}

/// The settings tried so far, and the best of them.
template <Real Scalar>
class Search {
  public:
    /// By the error or the time, one of which is positive.
    Search(const GridSearchOptions<Scalar>& experiment, const Requirement& requirement)
        : layers_(experiment.layers),
          time_required_(requirement.time > 0),
          max_error_(requirement.force_error / experiment.safety_factor),
          max_time_(time_required_ ? requirement.time : std::numeric_limits<double>::infinity()) {}

    /// Whether earlier settings show that this one cannot be better: fewer layers contain all that the queue reaches; a
    /// setting with no more of anything was too slow, or slower than the best; or a setting with no less of anything
    /// missed the required error, or met the required time.
    [[nodiscard]] bool is_needless(const SolverOptions<Scalar>& setting) const noexcept {
        return std::any_of(layers_.begin(), layers_.end(),
                           [&](Index fewer) { return fewer < setting.layers && fewer >= all_layers_; }) ||
               std::any_of(tried_.begin(), tried_.end(), [&](const ChosenSettings<Scalar>& other) {
                   if (!other.advanced) return false;
                   return (covers(setting, other.options) && other.time >= max_time_) ||
                          (covers(other.options, setting) && other.satisfied == time_required_);
               });
    }

    void add(const SolverOptions<Scalar>& setting, const TrialResult& result) {
        ChosenSettings<Scalar> now{result, setting};
        now.satisfied = now.advanced && (time_required_ ? now.time <= max_time_ : now.force_error <= max_error_);
        if (tried_.empty() || is_better(now, best_)) best_ = now;
        if (!time_required_ && now.satisfied) max_time_ = best_.time;
        if (now.layers_reached < setting.layers) all_layers_ = now.layers_reached;
        tried_.push_back(now);
    }

    [[nodiscard]] const ChosenSettings<Scalar>& best() const noexcept { return best_; }

  private:
    // A satisfied setting is better than one that is not. Among satisfied ones the time decides if an error is
    // required, and the error if a time is required; among others the required quantity decides.
    [[nodiscard]] bool is_better(const ChosenSettings<Scalar>& now,
                                 const ChosenSettings<Scalar>& other) const noexcept {
        if (now.satisfied != other.satisfied) return now.satisfied;
        const bool by_error = time_required_ == now.satisfied;
        return by_error ? now.force_error < other.force_error : now.time < other.time;
    }

    std::vector<Index> layers_;  // to be tried
    Index all_layers_ = unlimited;
    std::vector<ChosenSettings<Scalar>> tried_;
    ChosenSettings<Scalar> best_;
    bool time_required_;
    double max_error_, max_time_;  // max_time_ [s]: required, or that of the best
};

/// The best setting for a required error or a required time.
template <Real Scalar, class Attempt>
[[nodiscard]] ChosenSettings<Scalar> choose_one(const GridSearchOptions<Scalar>& experiment,
                                                const Requirement& requirement, Attempt& attempt) {
    const auto settings = settings_of(experiment);
    Search<Scalar> search(experiment, requirement);
    if (requirement.force_error > 0) {  // first finds the sweeps needed, with all else at its maximum
        const auto most = settings.back();
        for (const auto& setting : settings) {
            if (setting.layers != most.layers || setting.contact_iterations != most.contact_iterations) continue;
            search.add(setting, attempt(setting));
            if (search.best().satisfied) break;
        }
        if (!search.best().satisfied) return search.best();
    }
    for (const auto& setting : settings) {
        if (!search.is_needless(setting)) search.add(setting, attempt(setting));
    }
    return search.best();
}

}  // namespace detail

template <Real Scalar>
void GridSearchOptions<Scalar>::validate() const {
    const auto check_numbers = [](const std::vector<Index>& numbers, Index least, std::string_view name) {
        if (numbers.empty()) refuse(detail::choose_name, name, " must hold a number to try, got none");
        for (const Index number : numbers) {
            if (number < least) {
                refuse(detail::choose_name, name, " must be at least ", least, ", got ", number);
            }
        }
    };
    check_numbers(layers, 0, "layers");
    check_numbers(sweeps, 1, "sweeps");
    check_numbers(contact_iterations, 1, "contact_iterations");
    others.validate();
    if (!is_finite(safety_factor) || !(safety_factor >= 1)) {
        refuse(detail::choose_name, "safety_factor must be finite and at least 1, got ", safety_factor);
    }
    if (tick_stride < 1) refuse(detail::choose_name, "tick_stride must be at least 1, got ", tick_stride);
    if (repetitions < 1) refuse(detail::choose_name, "repetitions must be at least 1, got ", repetitions);
}

template <Real Scalar, class Attempt>
ChosenSettings<Scalar> choose_settings(const GridSearchOptions<Scalar>& experiment, const Requirement& requirement,
                                       Attempt attempt) {
    detail::validate(requirement);
    experiment.validate();
    const double error = detail::solver_error(requirement), time = requirement.time;
    ChosenSettings<Scalar> choice = error > 0 ? detail::choose_one(experiment, {.force_error = error}, attempt)
                                              : detail::choose_one(experiment, {.time = time}, attempt);
    const bool both = error > 0 && time > 0;
    if (both && !(choice.satisfied && choice.time <= time)) {
        choice = detail::choose_one(experiment, {.time = time}, attempt);
    }
    choice.keeps_error = error == 0 || choice.force_error <= error / experiment.safety_factor;
    choice.keeps_time = time == 0 || choice.time <= time;
    choice.satisfied = choice.advanced && choice.keeps_error && choice.keeps_time;
    const double mesh_error = std::abs(requirement.mesh_error), allowed = requirement.force_error - error;
    if (mesh_error > allowed) choice.edge_factor = std::sqrt(allowed / mesh_error);
    return choice;
}

template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule, class Clock>
ChosenSettings<Scalar> choose_settings(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                       const History& history, const Requirement& requirement,
                                       const std::type_identity_t<GridSearchOptions<Scalar>>& experiment,
                                       const Rule& rule, const Clock& clock) {
    detail::validate(requirement);
    experiment.validate();
    const auto references = experiment.count_viscosity
                                ? equilibria(mesh, network, volume, history, experiment.tick_stride)
                                : exact_steps(mesh, network, volume, history, experiment.tick_stride);
    if (std::none_of(references.begin(), references.end(),
                     [](const ReferenceTick& reference) { return reference.force > 0; })) {
        refuse(detail::choose_name, "the history must have a tick with a felt force at equilibrium, got none");
    }
    return choose_settings(experiment, requirement, [&](const SolverOptions<Scalar>& options) {
        auto result = run_trial(mesh, network, volume, history, references, options, rule, clock);
        for (Index play = 1; play < experiment.repetitions && result.advanced; ++play) {
            const double time = run_trial(mesh, network, volume, history, references, options, rule, clock).time;
            result.time = (std::min)(result.time, time);
        }
        return result;
    });
}

}  // namespace membrane
