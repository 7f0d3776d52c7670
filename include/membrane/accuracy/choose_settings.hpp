// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/accuracy/trial.hpp>

/// How many layers and sweeps? The experiment that answers it for one's own network and load.
///
///     #include <membrane/accuracy/choose_settings.hpp>
///     const auto stroke = membrane::Stroke(mesh, tools, 1e-3);                // recorded: a tool for each tick of 1 ms
///     const auto choice = membrane::choose_settings(mesh, network, foundation, stroke, {.force_error = 0.01});
///     if (!choice.met) ...                                                    // nothing that was tried is enough
///     auto solver = membrane::QuasiStaticSolver(network, choice.options);
namespace membrane {

/// What is wanted, one of the two.
struct Requirement {
    double force_error = 0;  ///< at the most, see `Outcome`: the cheapest setting that keeps it
    double time = 0;         ///< of a tick, at the most [s]: the most accurate setting that keeps it
};

/// What is tried: every number of layers with every number of sweeps and of contact visits.
template <Real Scalar>
struct GridSearchOptions {
    std::vector<Index> layers = {1, 2, 3, 4, 6, 8, 12, 16};
    std::vector<Index> sweeps = {1, 2, 3, 4, 6, 8, 12, 16};
    std::vector<Index> contact_iterations = {1, 2, 4, 8};
    SolverOptions<Scalar> others = {};  ///< the options besides these
    double margin = 1.8;                ///< the error in the experiment is below the wanted one by this factor
    Index every = 1;                    ///< errors are taken in every so many ticks: fewer equilibria
    Index repetitions = 3;              ///< of each setting; the shortest time counts

    /// @throws InvalidInput for an option out of its range
    void check() const;
};

/// The chosen setting, and what the experiment has measured of it.
template <Real Scalar>
struct ChosenSettings : Outcome {
    SolverOptions<Scalar> options;
    bool met = false;  ///< what was wanted is kept; if not, this is what came nearest to it
};

/// The best setting of the solver for this membrane and this history of loads, found by experiment ([Liu07] finds the
/// threshold of the queue so): the equilibria once, then one setting after the other, those left out of which the ones
/// before tell that they cannot be the best: less of everything is cheaper, and farther off.
///
/// The history stands for what is to come: it should last, press at many places, and be as fast as the hand will be; most
/// errors come with the change from one tick to the next. Other histories of the same kind are off by somewhat more or
/// less: hence `margin`. In 500 random scenes, spheres, ellipsoids and caps of 42 to 642 vertices on backings of 0.01 to
/// 10 times the springs, under 12 presses, 374 could be judged: under 12 other presses elsewhere 96 % kept the wanted
/// error, of 0.1 to 10 %, and 82 % took no more than 1.5 times the time of the cheapest setting that does. A wanted time
/// has no margin.
///
/// @throws InvalidInput for a wanted error or time that is not positive, none or both of them, an option out of its range,
/// a history in which no force is felt or that has no equilibrium, and for what `trial` and `equilibria` refuse. Offline.
/// Cost: an `equilibrium` for each tick that is judged, and some 30 to 300 times the history.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule = BlockStep, class Clock = SteadySeconds>
[[nodiscard]] ChosenSettings<Scalar> choose_settings(
    const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume, const History& history,
    const Requirement& wanted, const std::type_identity_t<GridSearchOptions<Scalar>>& experiment = {},
    const Rule& rule = {}, const Clock& clock = {});

/// The same by any trial: `attempt(options)` gives the `Outcome` of these options.
template <Real Scalar, class Attempt>
[[nodiscard]] ChosenSettings<Scalar> choose_settings(const GridSearchOptions<Scalar>& experiment,
                                                     const Requirement& wanted, Attempt attempt);

namespace detail {

inline constexpr std::string_view choose_name = "choose_settings";

inline void check(const Requirement& wanted) {
    if ((wanted.force_error != 0) == (wanted.time != 0)) {
        refuse(choose_name, "either a force_error or a time must be wanted, got ", wanted.force_error, " and ",
               wanted.time, " s");
    }
    const double number = wanted.time != 0 ? wanted.time : wanted.force_error;
    if (is_finite(number) && number > 0) return;
    refuse(choose_name, "the wanted ", wanted.time != 0 ? "time" : "force_error", " must be finite and positive",
           wanted.time != 0 ? " [s]" : "", ", got ", number);
}

/// Whether `setting` has no less of anything than `other`.
template <Real Scalar>
[[nodiscard]] bool covers(const SolverOptions<Scalar>& setting, const SolverOptions<Scalar>& other) noexcept {
    return setting.layers >= other.layers && setting.sweeps >= other.sweeps &&
           setting.contact_iterations >= other.contact_iterations;
}

/// All settings of the experiment, roughly from the cheapest to the dearest.
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
    const auto work = [](const SolverOptions<Scalar>& setting) {  // rings grow evenly in a mesh of triangles
        const double rings = setting.layers;
        return setting.sweeps * (4.0 * setting.contact_iterations + 3 * rings * (rings + 2));
    };
    std::stable_sort(settings.begin(), settings.end(), [&](const auto& a, const auto& b) { return work(a) < work(b); });
    return settings;
}

/// The settings that were tried, and the best of them.
template <Real Scalar>
class Search {
  public:
    Search(const GridSearchOptions<Scalar>& experiment, const Requirement& wanted)
        : layers_(experiment.layers),
          time_wanted_(wanted.time > 0),
          max_error_(wanted.force_error / experiment.margin),
          max_time_(time_wanted_ ? wanted.time : std::numeric_limits<double>::infinity()) {}

    /// Whether the ones before tell that this cannot be better: fewer layers are all there are, less of everything was
    /// too dear, more of everything not enough, or enough for the time.
    [[nodiscard]] bool is_needless(const SolverOptions<Scalar>& setting) const noexcept {
        return std::any_of(layers_.begin(), layers_.end(),
                           [&](Index fewer) { return fewer < setting.layers && fewer >= all_layers_; }) ||
               std::any_of(tried_.begin(), tried_.end(), [&](const ChosenSettings<Scalar>& other) {
                   if (!other.advanced) return false;
                   return (covers(setting, other.options) && other.time >= max_time_) ||
                          (covers(other.options, setting) && other.met == time_wanted_);
               });
    }

    void add(const SolverOptions<Scalar>& setting, const Outcome& outcome) {
        ChosenSettings<Scalar> now{outcome, setting, false};
        now.met = now.advanced && (time_wanted_ ? now.time <= max_time_ : now.force_error <= max_error_);
        if (tried_.empty() || is_better(now, best_)) best_ = now;
        if (!time_wanted_ && now.met) max_time_ = best_.time;
        if (now.layers_reached < setting.layers) all_layers_ = now.layers_reached;
        tried_.push_back(now);
    }

    [[nodiscard]] const ChosenSettings<Scalar>& best() const noexcept { return best_; }

  private:
    // What is wanted before all, then the error if time is no matter, or the time if the error is none.
    [[nodiscard]] bool is_better(const ChosenSettings<Scalar>& now,
                                 const ChosenSettings<Scalar>& other) const noexcept {
        if (now.met != other.met) return now.met;
        const bool by_error = time_wanted_ == now.met;
        return by_error ? now.force_error < other.force_error : now.time < other.time;
    }

    std::vector<Index> layers_;  // to be tried
    Index all_layers_ = unlimited;
    std::vector<ChosenSettings<Scalar>> tried_;
    ChosenSettings<Scalar> best_;
    bool time_wanted_;
    double max_error_, max_time_;  // max_time_ [s]: wanted, or that of the best
};

}  // namespace detail

template <Real Scalar>
void GridSearchOptions<Scalar>::check() const {
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
    others.check();
    if (!is_finite(margin) || !(margin >= 1)) {
        refuse(detail::choose_name, "margin must be finite and at least 1, got ", margin);
    }
    if (every < 1) refuse(detail::choose_name, "every must be at least 1, got ", every);
    if (repetitions < 1) refuse(detail::choose_name, "repetitions must be at least 1, got ", repetitions);
}

template <Real Scalar, class Attempt>
ChosenSettings<Scalar> choose_settings(const GridSearchOptions<Scalar>& experiment, const Requirement& wanted,
                                       Attempt attempt) {
    detail::check(wanted);
    experiment.check();
    const auto settings = detail::settings_of(experiment);
    detail::Search<Scalar> search(experiment, wanted);
    if (wanted.force_error > 0) {  // first with how many sweeps it can be done at all
        const auto most = settings.back();
        for (const auto& setting : settings) {
            if (setting.layers != most.layers || setting.contact_iterations != most.contact_iterations) continue;
            search.add(setting, attempt(setting));
            if (search.best().met) break;
        }
        if (!search.best().met) return search.best();
    }
    for (const auto& setting : settings) {
        if (!search.is_needless(setting)) search.add(setting, attempt(setting));
    }
    return search.best();
}

template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule, class Clock>
ChosenSettings<Scalar> choose_settings(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                       const History& history, const Requirement& wanted,
                                       const std::type_identity_t<GridSearchOptions<Scalar>>& experiment,
                                       const Rule& rule, const Clock& clock) {
    detail::check(wanted);
    experiment.check();
    const auto references = equilibria(mesh, network, volume, history, experiment.every);
    if (std::none_of(references.begin(), references.end(), [](const ReferenceTick& rest) { return rest.force > 0; })) {
        refuse(detail::choose_name, "the history must have a tick with a force that is felt, got none in equilibrium");
    }
    return choose_settings(experiment, wanted, [&](const SolverOptions<Scalar>& options) {
        auto outcome = trial(mesh, network, volume, history, references, options, rule, clock);
        for (Index play = 1; play < experiment.repetitions && outcome.advanced; ++play) {
            const double time = trial(mesh, network, volume, history, references, options, rule, clock).time;
            outcome.time = (std::min)(outcome.time, time);
        }
        return outcome;
    });
}

}  // namespace membrane
