// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <membrane/accuracy/trial.hpp>

#include "scene.hpp"

/// A tool of 3 mm on a sphere of 10 mm, 1.5 mm deep, run with one setting of the solver after the other: the time of a
/// tick, and the error of its force against that of the tick's equilibrium. Faces carry the contact on coarse and fine
/// meshes alike, so that these differ in their size alone.
///
///     const auto outcome = play<double>({"slide", 642, 0.1}, {.layers = 3}, membrane::BlockStep{});
///     record(state, outcome);
namespace bench {

using membrane::Real;

inline constexpr double wide_tool = 3e-3, deep = 1.5e-3;  // radius and depth [m]

/// A scene by its name, `slide`, `slide_damped`, `put_down` or `draw_out`, its number of vertices, and its foundation
/// stiffness over the spring stiffness, `part`.
struct Place {
    std::string scene;
    int vertices;
    double part;

    [[nodiscard]] bool is_damped() const { return scene == "slide_damped"; }

    friend auto operator<=>(const Place&, const Place&) = default;
};

[[nodiscard]] inline membrane::Tool<double> wide_tool_at(const Vector3& position) {
    return {.position = position, .radius = wide_tool};
}

/// Straight in within 30 ticks, then along at 50 mm/s.
[[nodiscard]] inline std::vector<membrane::Tool<double>> slide() {
    constexpr Index ticks_in = 30, ticks_along = 60;
    constexpr double speed = 0.05;  // [m/s]
    const Vector3 start = Vector3(0.3, 0.2, 0.93).normalized(), across = Vector3(0, 0.93, -0.2).normalized();
    const Vector3 along = membrane::cross<double>(start, across);
    std::vector<membrane::Tool<double>> tools;
    for (Index t = 1; t <= ticks_in + ticks_along; ++t) {
        const double angle = speed * tick * std::max(t - ticks_in, 0) / radius;
        const double from_centre = radius + wide_tool - deep * std::min(t, ticks_in) / ticks_in;
        tools.push_back(wide_tool_at(from_centre * (std::cos(angle) * start + std::sin(angle) * along)));
    }
    return tools;
}

/// At full depth in the first tick, at eight points, for three ticks each.
[[nodiscard]] inline std::vector<membrane::Tool<double>> put_down() {
    constexpr int presses = 8, ticks_each = 3;
    std::vector<membrane::Tool<double>> tools;
    for (int i = 0; i < presses; ++i) {
        const Vector3 there = Vector3(std::cos(i), std::sin(i), 0.3 * i).normalized();
        for (int t = 0; t < ticks_each; ++t) tools.push_back(wide_tool_at(2 * radius * there));
        for (int t = 0; t < ticks_each; ++t) tools.push_back(wide_tool_at((radius + wide_tool - deep) * there));
    }
    return tools;
}

/// Forceps grasp the surface, draw it out by 1.5 mm within 30 ticks, and move along at 25 mm/s.
[[nodiscard]] inline std::vector<membrane::Tool<double>> draw_out() {
    constexpr Index ticks_out = 30, ticks_along = 60;
    constexpr double tip = 5e-4, out = 1.5e-3, speed = 0.025;  // [m], [m/s]
    const Vector3 start = Vector3(0.3, 0.2, 0.93).normalized(), along = Vector3(0, 0.93, -0.2).normalized();
    std::vector<membrane::Tool<double>> tools;
    for (Index t = 1; t <= ticks_out + ticks_along; ++t) {
        const double from_centre = radius + out * std::min(t, ticks_out) / ticks_out;
        const double displacement = speed * tick * std::max(t - ticks_out, 0);
        tools.push_back({.position = from_centre * start + displacement * along, .radius = tip, .grasping = true});
    }
    return tools;
}

/// Membrane and stroke of a scene.
template <Real Scalar>
struct StrokeScene {
    explicit StrokeScene(const Place& place, double mass = 1)
        : mesh(sphere_of<Scalar>(place.vertices)),
          network(mesh, {}, {.stiffness = Scalar(stiffness), .mass = static_cast<Scalar>(mass)}),
          volume(mesh, {.stiffness = static_cast<Scalar>(place.part * stiffness),
                        .damping = place.is_damped() ? Scalar(0.02) : Scalar(0)}),  // [N s/m]
          stroke(mesh, tools_of(place), Scalar(tick), {.fine_triangles = 0}) {}

    [[nodiscard]] static std::vector<membrane::Tool<Scalar>> tools_of(const Place& place) {
        std::vector<membrane::Tool<Scalar>> tools;
        const auto stroke = place.scene == "draw_out" ? draw_out() : place.scene == "put_down" ? put_down() : slide();
        for (const auto& tool : stroke) {
            tools.push_back({.position = tool.position.template cast<Scalar>(),
                             .radius = static_cast<Scalar>(tool.radius),
                             .grasping = tool.grasping});
        }
        return tools;
    }

    membrane::TriangleMesh<Scalar> mesh;
    membrane::MassSpringNetwork<Scalar, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<Scalar> volume;
    membrane::ToolTrajectory<Scalar> stroke;
};

using References = std::vector<membrane::ReferenceTick>;

/// The equilibria of every sixth tick, in `put_down` the last of each press; or the exact steps, with the damping.
/// Computed once.
[[nodiscard]] inline const References& references_of(const Place& place, bool with_damping = false) {
    static std::map<std::pair<Place, bool>, References> known;
    auto& references = known[{place, with_damping}];
    if (!references.empty()) return references;
    const StrokeScene<double> scene(place);
    constexpr Index tick_stride = 6;
    references = with_damping ? exact_steps(scene.mesh, scene.network, scene.volume, scene.stroke, tick_stride)
                              : equilibria(scene.mesh, scene.network, scene.volume, scene.stroke, tick_stride);
    require(references.size() == static_cast<std::size_t>(scene.stroke.ticks() / tick_stride),
            "all ticks have a reference");
    return references;
}

template <Real Scalar, class Rule>
[[nodiscard]] membrane::TrialResult play(const Place& place, const membrane::SolverOptions<Scalar>& options,
                                         const Rule& rule, double mass = 1, bool with_damping = false) {
    const StrokeScene<Scalar> scene(place, mass);
    return run_trial(scene.mesh, scene.network, scene.volume, scene.stroke, references_of(place, with_damping), options,
                     rule, ProcessorSeconds{});
}

/// By (4), with the lightest mass that is stable in the whole scene: reduces `part`, dt^2 stiffness / mass, from 0.5 in
/// steps of 0.01 until it is.
template <Real Scalar>
[[nodiscard]] membrane::TrialResult play_published(const Place& place, const membrane::SolverOptions<Scalar>& options,
                                                   double& part) {
    for (;; part -= 0.01) {
        const auto outcome = play<Scalar>(place, options, membrane::MassStep{}, tick * tick * stiffness / part);
        if (outcome.advanced || part < 0.02) return outcome;
    }
}

/// Sets the benchmark's iteration time to that of a tick, and its counters to the errors.
inline void record(benchmark::State& state, const membrane::TrialResult& outcome) {
    require(outcome.advanced, "no step may be refused");
    state.SetIterationTime(outcome.time);
    state.counters["force_error"] = outcome.force_error;
    state.counters["position_error"] = outcome.position_error / deep;
}

}  // namespace bench
