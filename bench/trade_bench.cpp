// SPDX-License-Identifier: MIT
#include <cstdlib>
#include <string>
#include <tuple>

#include <membrane/accuracy/trial.hpp>

#include "support/scene.hpp"

// What does accuracy cost? A tool of 3 mm on a sphere of 10 mm, 1.5 mm deep: sliding along it at 50 mm/s, or put down here
// and there; by rule, layers, sweeps and visits of the contact. The error is against the equilibrium of the tick.
//
// With MEMBRANE_FULL_GRID set, everything with everything; without, what the tables and the plot show and some more.

namespace {

using namespace bench;
using membrane::Real;

constexpr double tool_radius = 3e-3, deep = 1.5e-3;  // [m]

/// A scene by its name, on so many vertices, its backing a part of the springs.
struct Place {
    std::string scene;
    int vertices;
    double part;

    friend auto operator<=>(const Place&, const Place&) = default;
};

struct Setting {
    Place place;
    std::string rule, scalar;
    bool predicted;
    Index layers, sweeps, contact_visits;
};

membrane::Tool<double> tool_at(const Vector3& position) { return {.position = position, .radius = tool_radius}; }

/// Straight in within 30 ticks, then along.
std::vector<membrane::Tool<double>> slide() {
    constexpr Index ticks_in = 30, ticks_along = 60;
    constexpr double speed = 0.05;  // [m/s]
    const Vector3 start = Vector3(0.3, 0.2, 0.93).normalized(), across = Vector3(0, 0.93, -0.2).normalized();
    const Vector3 along = membrane::cross<double>(start, across);
    std::vector<membrane::Tool<double>> tools;
    for (Index t = 1; t <= ticks_in + ticks_along; ++t) {
        const double way = speed * tick * std::max(t - ticks_in, 0) / radius;
        const double from_centre = radius + tool_radius - deep * std::min(t, ticks_in) / ticks_in;
        tools.push_back(tool_at(from_centre * (std::cos(way) * start + std::sin(way) * along)));
    }
    return tools;
}

/// All the way in at once, for three ticks each time.
std::vector<membrane::Tool<double>> put_down() {
    constexpr int presses = 8, ticks_each = 3;
    std::vector<membrane::Tool<double>> tools;
    for (int i = 0; i < presses; ++i) {
        const Vector3 there = Vector3(std::cos(i), std::sin(i), 0.3 * i).normalized();
        for (int t = 0; t < ticks_each; ++t) tools.push_back(tool_at(2 * radius * there));
        for (int t = 0; t < ticks_each; ++t) tools.push_back(tool_at((radius + tool_radius - deep) * there));
    }
    return tools;
}

template <Real Scalar>
struct Scene {
    explicit Scene(const Place& place, double mass = 1)
        : mesh(sphere(place.vertices).positions().cast<Scalar>(), sphere(place.vertices).triangles()),
          network(mesh, {}, {.stiffness = Scalar(stiffness), .mass = static_cast<Scalar>(mass)}),
          volume(mesh, {.stiffness = static_cast<Scalar>(place.part * stiffness)}),
          stroke(mesh, tools_of(place), Scalar(tick)) {}

    static std::vector<membrane::Tool<Scalar>> tools_of(const Place& place) {
        std::vector<membrane::Tool<Scalar>> tools;
        for (const auto& tool : place.scene == "slide" ? slide() : put_down()) {
            tools.push_back({.position = tool.position.template cast<Scalar>(), .radius = Scalar(tool_radius)});
        }
        return tools;
    }

    membrane::TriangleMesh<Scalar> mesh;
    membrane::MassSpringNetwork<Scalar, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<Scalar> volume;
    membrane::Stroke<Scalar> stroke;
};

/// Of every sixth tick: of those down, the last ones.
const std::vector<membrane::TickAtRest>& rests_of(const Place& place) {
    static std::map<Place, std::vector<membrane::TickAtRest>> known;
    auto& rests = known[place];
    if (!rests.empty()) return rests;
    const Scene<double> scene(place);
    constexpr Index every = 6;
    rests = equilibria(scene.mesh, scene.network, scene.volume, scene.stroke, every);
    require(rests.size() == static_cast<std::size_t>(scene.stroke.ticks() / every), "all ticks have an equilibrium");
    return rests;
}

template <Real Scalar, class Rule>
membrane::Outcome play(const Setting& setting, const Rule& rule, double mass = 1) {
    const Scene<Scalar> scene(setting.place, mass);
    return trial(scene.mesh, scene.network, scene.volume, scene.stroke, rests_of(setting.place),
                 {.layers = setting.layers,
                  .sweeps = setting.sweeps,
                  .contact_visits = setting.contact_visits,
                  .predict = setting.predicted},
                 rule, ProcessorSeconds{});
}

/// dt^2 stiffness / mass for (4), with the lightest mass that is stable for all of the scene, to a fiftieth.
double& stable_part(const Setting& setting) {
    using Key = std::tuple<Place, std::string, bool, Index, Index, Index>;
    static std::map<Key, double> known;
    return known
        .try_emplace(
            {setting.place, setting.scalar, setting.predicted, setting.layers, setting.sweeps, setting.contact_visits},
            0.5)
        .first->second;
}

template <Real Scalar>
membrane::Outcome play_published(const Setting& setting) {
    for (double& part = stable_part(setting);; part -= 0.01) {
        const auto outcome = play<Scalar>(setting, membrane::MassStep{}, tick * tick * stiffness / part);
        if (outcome.advanced || part < 0.02) return outcome;
    }
}

template <Real Scalar>
membrane::Outcome play_by(const Setting& setting) {
    if (setting.rule == "published") return play_published<Scalar>(setting);
    if (setting.rule == "safe") return play<Scalar>(setting, membrane::SafeStep{});
    return play<Scalar>(setting, membrane::BlockStep{});
}

void measure(benchmark::State& state, const Setting& setting) {
    membrane::Outcome outcome;
    for (auto _ : state) {
        outcome = setting.scalar == "float" ? play_by<float>(setting) : play_by<double>(setting);
        require(outcome.advanced, "no step may be refused");
        state.SetIterationTime(outcome.time);
    }
    state.counters["force_error"] = outcome.force_error;
    state.counters["position_error"] = outcome.position_error / deep;
    if (setting.rule == "published") state.counters["part"] = stable_part(setting);
}

/// Without the full grid: all rules where the plot sets them against each other, without a prediction what is near to the
/// paper or to the default; floats and the other scenes by the default rule.
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
    const std::string name = "scene:" + setting.place.scene + "/backing:" + part + "/scalar:" + setting.scalar +
                             "/rule:" + setting.rule + "/predicted:" + (setting.predicted ? "1" : "0") +
                             "/layers:" + number(setting.layers) + "/contact_visits:" + number(setting.contact_visits) +
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
                                for (const Index visits : {1, 4}) {
                                    for (const Index sweeps : {1, 2, 4, 8, 16}) {
                                        settings.push_back(
                                            {{scene, vertices, part}, rule, scalar, predicted, layers, sweeps, visits});
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
    return true;
}();

}  // namespace
