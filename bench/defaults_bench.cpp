// SPDX-License-Identifier: MIT
#include <algorithm>
#include <initializer_list>
#include <limits>
#include <string>

#include "support/strokes.hpp"

// Effect of the solver's defaults: each option is varied alone, the others at their defaults. A tool slides along
// spheres of three sizes; forceps draw out one of them. A tool touches many vertices; forceps hold one triangle, and
// the motion of the rest depends on the layers. The foundation is a tenth of the springs.

namespace {

using namespace bench;

template <Real Scalar>
using Options = membrane::SolverOptions<Scalar>;

constexpr Options<double> defaults;
static_assert(defaults.layers == 6 && defaults.sweeps == 2 && defaults.contact_iterations == 3,
              "the plot rings these, and the tables name them");
static_assert(defaults.order == membrane::UpdateOrder::colour_layers && defaults.predict);

std::string mesh_of(const Place& place) { return "/vertices:" + std::to_string(place.vertices); }

/// `play()` returns the outcome. One run of a small scene is short, and other processes only slow it down: the shortest
/// time so far counts.
template <class Play>
void add(const std::string& name, Play play) {
    constexpr int repetitions = 3;
    const auto run = [play, min_time = std::numeric_limits<double>::infinity()](benchmark::State& state) mutable {
        for (auto _ : state) {
            membrane::TrialResult outcome = play();
            outcome.time = min_time = std::min(min_time, outcome.time);
            record(state, outcome);
        }
    };
    benchmark::RegisterBenchmark(name.c_str(), run)->Iterations(repetitions)->UseManualTime();
}

/// Sets one integer option to each of these numbers.
void vary(const Place& place, const std::string& option, Index Options<double>::*member,
          std::initializer_list<Index> numbers) {
    for (const Index number : numbers) {
        Options<double> options;
        options.*member = number;
        add("scene:" + place.scene + mesh_of(place) + "/" + option + ":" + std::to_string(number),
            [place, options] { return play(place, options, membrane::BlockStep{}); });
    }
}

template <Real Scalar, class Rule = membrane::BlockStep>
void choose(const Place& place, const std::string& choice, const Options<Scalar>& options, const Rule& rule = {}) {
    add("scene:" + place.scene + "/" + choice + mesh_of(place), [=] { return play(place, options, rule); });
}

void choose_each(const Place& place) {
    constexpr auto breadth_first = membrane::UpdateOrder::breadth_first;
    choose<double>(place, "default", {});
    choose<double>(place, "breadth_first", {.order = breadth_first});
    choose<float>(place, "float", {});
    choose<float>(place, "breadth_first_float", {.order = breadth_first});
    choose<double>(place, "unpredicted", {.predict = false});
    choose<double>(place, "safe", {}, membrane::SafeStep{});
    add("scene:" + place.scene + "/published" + mesh_of(place),
        [place, part = 0.5]() mutable { return play_published(place, defaults, part); });
}

const bool added = [] {
    constexpr double part = 0.1;
    for (const Place& place :
         {Place{"slide", 162, part}, {"slide", 642, part}, {"slide", 2562, part}, {"draw_out", 642, part}}) {
        choose_each(place);
        vary(place, "layers", &Options<double>::layers, {1, 2, 3, 4, 6, 8, 12});
        vary(place, "sweeps", &Options<double>::sweeps, {1, 2, 3, 4, 6, 8});
        vary(place, "contact_iterations", &Options<double>::contact_iterations, {1, 2, 3, 4, 6, 8});
    }
    return true;
}();

}  // namespace
