// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium.hpp>

#include "support/scene.hpp"

// What does accuracy cost? A tool of 3 mm presses 1.5 mm deep into a sphere of 10 mm and slides along it at 50 mm/s, the
// membrane starting each tick from where it was. The error of each tick's force is against the equilibrium there.

namespace {

using namespace bench;

constexpr double soft = 0.1 * stiffness;  // backing [N/m]
constexpr Index ticks_in = 30, ticks_along = 60, ticks = ticks_in + ticks_along;

struct Scene {
    explicit Scene(std::int64_t vertices, double mass = 1)
        : mesh(sphere(vertices)), network(mesh, {}, {.stiffness = stiffness, .mass = mass}) {}

    [[nodiscard]] static membrane::Tool<double> tool_at(Index t) {
        constexpr double tool_radius = 3e-3, deep = 1.5e-3, speed = 0.05;
        const Vector3 start = Vector3(0.3, 0.2, 0.93).normalized(), across(0, 0.93, -0.2);
        const Vector3 along = membrane::cross<double>(start, across.normalized());
        const double way = speed * tick * std::max(t - ticks_in, 0) / radius;
        const double from_centre = radius + tool_radius - deep * std::min(t, ticks_in) / ticks_in;
        return {.position = from_centre * (std::cos(way) * start + std::sin(way) * along),
                .radius = tool_radius,
                .time = tick * t};
    }

    membrane::TriangleMesh<double> mesh;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<double> volume{mesh, {.stiffness = soft}};
};

/// The reaction at the equilibrium of each tick, by Newton's method.
const std::vector<Vector3>& equilibrium_forces(std::int64_t vertices) {
    static std::map<std::int64_t, std::vector<Vector3>> known;
    auto& forces = known[vertices];
    if (!forces.empty()) return forces;
    const Scene scene(vertices);
    membrane::AabbTree<double> tree(scene.mesh);
    membrane::ContactTracker<double> tracker(scene.mesh);
    Points x = scene.mesh.positions();
    for (Index t = 1; t <= ticks; ++t) {
        const auto tool = Scene::tool_at(t);
        const auto contact = tracker.update(tree, x, tool);
        const auto rest = equilibrium(x, scene.mesh, scene.network, scene.volume, {}, press(tool, contact));
        require(rest.converged, "every tick must have its equilibrium");
        x = rest.x;
        tree.refit(x);
        forces.push_back(rest.reactions[0]);
    }
    return forces;
}

/// What a run of the scene comes to: the time of a tick (contact, solve, refit) and the error of the force while the tool
/// slides, root of the mean square, as a part of it.
struct Outcome {
    double time = 0;  ///< [s]
    double error = 0;
    bool stable = true;
};

template <class Rule>
Outcome slide(std::int64_t vertices, const Rule& rule, Index sweeps, Index contact_visits, double mass) {
    const auto& exact = equilibrium_forces(vertices);
    const Scene scene(vertices, mass);
    membrane::QuasiStaticSolver<double, Rule> solver(
        scene.network, {.layers = 3, .sweeps = sweeps, .contact_visits = contact_visits}, rule);
    membrane::AabbTree<double> tree(scene.mesh);
    membrane::ContactTracker<double> tracker(scene.mesh);
    Points x = scene.mesh.positions();
    Outcome outcome;
    double errors = 0, squares = 0;
    for (Index t = 1; t <= ticks; ++t) {
        const auto tool = Scene::tool_at(t);
        membrane::StepReport<double> report;
        outcome.time += seconds([&] {
            const auto contact = tracker.update(tree, x, tool);
            report = solver.step(x, tick, scene.network, scene.volume, press(tool, contact));
            tree.refit(x, report.moved);
        });
        if (report.status != membrane::StepStatus::advanced) return {0, 0, false};
        if (t <= ticks_in) continue;
        const Vector3& force = exact[static_cast<std::size_t>(t) - 1];
        errors += membrane::squared_norm<double>(report.reactions[0] - force);
        squares += membrane::squared_norm(force);
    }
    return {outcome.time / ticks, std::sqrt(errors / squares), true};
}

template <class Rule>
void measure(benchmark::State& state, const Rule& rule, Index contact_visits, double mass = 1) {
    Outcome outcome;
    for (auto _ : state) {
        outcome = slide(state.range(0), rule, static_cast<Index>(state.range(1)), contact_visits, mass);
        require(outcome.stable, "no step may be refused");
        state.SetIterationTime(outcome.time);
    }
    state.counters["force_error"] = 100 * outcome.error;
}

/// (4) with its mass as light as is stable for all of the scene, to a fortieth.
void measure_published(benchmark::State& state, Index contact_visits) {
    const auto sweeps = static_cast<Index>(state.range(1));
    double part = 0.5;  // dt^2 stiffness / mass
    const auto mass = [&] { return tick * tick * stiffness / part; };
    while (!slide(state.range(0), membrane::MassStep{}, sweeps, contact_visits, mass()).stable) part -= 0.01;
    measure(state, membrane::MassStep{}, contact_visits, mass());
    state.counters["part"] = part;
}

void published(benchmark::State& state) { measure_published(state, 1); }
void published_contact(benchmark::State& state) { measure_published(state, 4); }
void safe(benchmark::State& state) { measure(state, membrane::SafeStep{}, 4); }
void block(benchmark::State& state) { measure(state, membrane::BlockStep{}, 4); }

void settings(benchmark::internal::Benchmark* measured) {
    measured->ArgNames({"vertices", "sweeps"})->Iterations(1)->UseManualTime();
    for (const int vertices : {162, 642}) {
        for (const int sweeps : {1, 2, 4, 8, 16}) measured->Args({vertices, sweeps});
    }
}
BENCHMARK(published)->Apply(settings);
BENCHMARK(published_contact)->Apply(settings);
BENCHMARK(safe)->Apply(settings);
BENCHMARK(block)->Apply(settings);

}  // namespace
