// SPDX-License-Identifier: MIT
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "support/strokes.hpp"

// Time against accuracy. A tool of 3 mm on a sphere of 10 mm, 1.5 mm deep: sliding along it at 50 mm/s, or put down at
// several points; by rule, layers, sweeps and contact iterations. The error is against the equilibrium of the tick; on
// a damped foundation also against the exact step, solved to the end, beside what viscosity adds.
//
// With MEMBRANE_FULL_GRID set, all combinations; without, those that tables and plot show and some more.

namespace {

using namespace bench;

struct Setting {
    Place place;
    std::string rule, scalar;
    bool predicted;
    Index layers, sweeps, contact_iterations;
};

template <Real Scalar>
membrane::SolverOptions<Scalar> options_of(const Setting& setting) {
    return {.layers = setting.layers,
            .sweeps = setting.sweeps,
            .contact_iterations = setting.contact_iterations,
            .predict = setting.predicted};
}

/// dt^2 stiffness / mass for (4), with the lightest mass that is stable in the whole scene, in steps of 0.01.
double& stable_part(const Setting& setting) {
    using Key = std::tuple<Place, std::string, bool, Index, Index, Index>;
    static std::map<Key, double> known;
    return known
        .try_emplace({setting.place, setting.scalar, setting.predicted, setting.layers, setting.sweeps,
                      setting.contact_iterations},
                     0.5)
        .first->second;
}

template <Real Scalar>
membrane::TrialResult play_by(const Setting& setting) {
    const auto options = options_of<Scalar>(setting);
    if (setting.rule == "published") return play_published<Scalar>(setting.place, options, stable_part(setting));
    if (setting.rule == "safe") return play<Scalar>(setting.place, options, membrane::SafeStep{});
    return play<Scalar>(setting.place, options, membrane::BlockStep{});
}

void measure(benchmark::State& state, const Setting& setting) {
    for (auto _ : state) record(state, setting.scalar == "float" ? play_by<float>(setting) : play_by<double>(setting));
    if (setting.rule == "published") state.counters["part"] = stable_part(setting);
    if (!setting.place.is_damped()) return;
    const auto exact = play(setting.place, options_of<double>(setting), membrane::BlockStep{}, 1, true);
    state.counters["exact_error"] = exact.force_error;
    state.counters["viscous"] = viscous_difference(references_of(setting.place, true), references_of(setting.place));
}

/// Without the full grid: all rules where the plot compares them; without prediction only settings near the paper or
/// the default; floats and the other scenes by the default rule.
bool is_shown(const Setting& setting) {
    const auto& place = setting.place;
    if (setting.layers == 12 && place.vertices != 642) return false;
    const bool plain = setting.scalar == "double" && place.scene == "slide";
    if (setting.rule == "block" && setting.predicted) {
        return place.part == 0.1 ? setting.scalar == "double" || place.vertices == 642 : plain && place.vertices == 642;
    }
    const bool compared =
        setting.predicted || setting.rule == "published" || (setting.rule == "block" && setting.layers == 3);
    return compared && plain && place.part == 0.1 && place.vertices != 2562;
}

void add(const Setting& setting) {
    char part[16];
    std::snprintf(part, sizeof part, "%g", setting.place.part);
    const auto number = [](Index n) { return std::to_string(n); };
    const std::string name = "scene:" + setting.place.scene + "/foundation:" + part + "/scalar:" + setting.scalar +
                             "/rule:" + setting.rule + "/predicted:" + (setting.predicted ? "1" : "0") +
                             "/layers:" + number(setting.layers) +
                             "/contact_iterations:" + number(setting.contact_iterations) +
                             "/vertices:" + number(setting.place.vertices) + "/sweeps:" + number(setting.sweeps);
    benchmark::RegisterBenchmark(name.c_str(), [setting](benchmark::State& state) { measure(state, setting); })
        ->Iterations(1)
        ->UseManualTime();
}

const bool added = [] {
    const bool all = std::getenv("MEMBRANE_FULL_GRID") != nullptr;
    std::vector<Setting> settings;
    for (const std::string scene : {"slide", "put_down"}) {
        for (const int vertices : {162, 642, 2562}) {
            for (const double part : {0.01, 0.1, 1.0, 10.0}) {
                for (const std::string scalar : {"double", "float"}) {
                    for (const std::string rule : {"published", "safe", "block"}) {
                        for (const bool predicted : {false, true}) {
                            for (const Index layers : {1, 3, 6, 12}) {
                                for (const Index iterations : {1, 3}) {
                                    for (const Index sweeps : {1, 2, 4, 8, 16}) {
                                        settings.push_back({{scene, vertices, part},
                                                            rule,
                                                            scalar,
                                                            predicted,
                                                            layers,
                                                            sweeps,
                                                            iterations});
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    for (const auto& setting : settings) {
        if (all || is_shown(setting)) add(setting);
    }
    for (const int vertices : {162, 642, 2562}) {
        for (const Index sweeps : {1, 2, 4, 8, 16}) {
            add({{"slide_damped", vertices, 0.2}, "block", "double", true, 3, sweeps, 3});
        }
    }
    return true;
}();

}  // namespace
