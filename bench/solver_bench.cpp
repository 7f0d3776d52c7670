// SPDX-License-Identifier: MIT
#include <membrane/solve/explicit_euler.hpp>

#include "support/scene.hpp"

// Time to equilibrium: the quasi-static step against explicit Euler, on the same problem to the same residual. A vertex
// is prescribed 0.2 R inside; all others start at their rest positions.

namespace {

using namespace bench;

constexpr double press = 0.2 * radius;                 // [m]
constexpr double residual = 1e-6 * stiffness * press;  // [N]
constexpr double weight = 6e-4;                        // of the membrane, half a millimetre thick [kg]
constexpr Index held = 0;

struct Problem {
    explicit Problem(const membrane::TriangleMesh<double>& mesh, double viscosity = 0)
        : network(mesh, membrane::LinearSpring{},
                  {.stiffness = stiffness, .mass = mass_of(mesh), .viscosity = viscosity, .pinned = {held}}),
          volume(mesh, {.stiffness = foundation}),
          start(mesh.positions()),
          target((1 - press / radius) * start.col(held)) {}

    [[nodiscard]] static double mass_of(const membrane::TriangleMesh<double>& mesh) {
        return weight / mesh.vertex_count();
    }

    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;  // the prescribed vertex pinned
    membrane::VirtualVolumeSprings<double> volume;
    Points start;
    Vector3 target;
};

// Quasi-static, up to the solver's layers; returns the number of vertex updates.
template <class Network>
std::int64_t run_to_equilibrium(Points& x, membrane::QuasiStaticSolver<double>& solver, const Network& network,
                                const Problem& problem) {
    x = problem.start;
    solver.reset();
    std::int64_t vertex_updates = 0;
    for (int step = 0; step < 1000; ++step) {
        const auto report = solver.step(x, tick, network, problem.volume, membrane::pull(held, problem.target));
        vertex_updates += report.vertex_updates;
        if (report.converged) return vertex_updates;
    }
    require(false, "the quasi-static solver must converge");
    return 0;
}

struct EulerChoice {
    double dt = 0, viscosity = 0;  // [s], [N s/m]
    int steps = 2000;
};

// Explicit Euler; returns the number of steps, or `max_steps` if they do not suffice.
int run_to_equilibrium(Points& x, double dt, membrane::ExplicitEuler<double>& euler, const Problem& problem,
                       int max_steps) {
    x = problem.start;
    x.col(held) = problem.target;
    Points velocity = Points::Zero(3, x.cols());
    for (int step = 1; step < max_steps; ++step) {
        if (!euler.step(x, velocity, dt, problem.network, problem.volume)) return max_steps;
        if (euler.residual() <= residual) return step;
    }
    return max_steps;
}

// The time step and viscosity with which Euler needs the fewest steps: a coarse sweep, then a finer around its best.
EulerChoice sweep_euler(const membrane::TriangleMesh<double>& mesh) {
    const double mass = Problem::mass_of(mesh), time = std::sqrt(mass / stiffness);
    EulerChoice best{0.6 * time, 0.8 * mass / time};
    Points x;
    for (const double width : {0.75, 0.15}) {
        const EulerChoice middle = best;
        for (int i = -4; i <= 4; ++i) {
            for (int j = -4; j <= 4; ++j) {
                const double dt = middle.dt * (1 + width * i / 4), viscosity = middle.viscosity * (1 + width * j / 4);
                const Problem problem(mesh, viscosity);
                membrane::ExplicitEuler<double> euler(problem.network);
                const int steps = run_to_equilibrium(x, dt, euler, problem, best.steps);
                if (steps < best.steps) best = {dt, viscosity, steps};
            }
        }
    }
    return best;
}

const EulerChoice& best_euler(std::int64_t vertices) {
    static std::map<std::int64_t, EulerChoice> known;
    const auto found = known.find(vertices);
    return found != known.end() ? found->second : known[vertices] = sweep_euler(sphere(vertices));
}

void quasi_static(benchmark::State& state, Index layers, double omega) {
    const auto mesh = sphere(state.range(0));
    const Problem problem(mesh);
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{}, {.stiffness = stiffness});
    membrane::QuasiStaticSolver solver(network, {.layers = layers, .sweeps = 16, .force_tolerance = residual},
                                       membrane::BlockStep{.omega = omega});
    Points x;
    std::int64_t vertex_updates = 0;
    for (auto _ : state) vertex_updates = run_to_equilibrium(x, solver, network, problem);
    state.counters["vertex_updates"] = static_cast<double>(vertex_updates);
    if (layers != membrane::unlimited) return;

    const EulerChoice& best = best_euler(state.range(0));
    const Problem moving(mesh, best.viscosity);
    membrane::ExplicitEuler<double> euler(moving.network);
    Points y;
    run_to_equilibrium(y, best.dt, euler, moving, best.steps + 1);
    require((x - y).cwiseAbs().maxCoeff() < 1e-4 * press, "both must converge to one equilibrium");
}
BENCHMARK_CAPTURE(quasi_static, all_layers, membrane::unlimited, 1)->Apply(sizes);
BENCHMARK_CAPTURE(quasi_static, omega_1_4, membrane::unlimited, 1.4)->Apply(sizes);
BENCHMARK_CAPTURE(quasi_static, six_layers, 6, 1)->Apply(sizes);

void explicit_euler(benchmark::State& state) {
    const EulerChoice& best = best_euler(state.range(0));
    const Problem problem(sphere(state.range(0)), best.viscosity);
    membrane::ExplicitEuler<double> euler(problem.network);
    Points x;
    int steps = 0;
    for (auto _ : state) steps = run_to_equilibrium(x, best.dt, euler, problem, 2 * best.steps);
    require(steps == best.steps, "explicit Euler must take the same number of steps");
    state.counters["dt"] = best.dt;
    state.counters["viscosity"] = best.viscosity;
    state.counters["steps"] = steps;
    state.counters["vertex_updates"] = static_cast<double>(steps) * static_cast<double>(state.range(0));
}
BENCHMARK(explicit_euler)->Apply(sizes);

}  // namespace
