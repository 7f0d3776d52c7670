// SPDX-License-Identifier: MIT
#include <membrane/solve/explicit_euler.hpp>

#include "support/scene.hpp"

// How long until the membrane is at rest: the quasi-static step against explicit Euler, on the same problem to the same
// residual? A vertex is held 0.2 R inside; the membrane starts at rest everywhere else.

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

    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;  // the held vertex pinned
    membrane::VirtualVolumeSprings<double> volume;
    Points start;
    Vector3 target;
};

// Quasi-static, no further than `layers`; returns the visits of vertices it took.
template <class Network>
std::int64_t come_to_rest(Points& x, membrane::QuasiStaticSolver<double>& solver, const Network& network,
                          const Problem& problem) {
    x = problem.start;
    solver.reset();
    std::int64_t visits = 0;
    for (int step = 0; step < 1000; ++step) {
        const auto report = solver.step(x, tick, network, problem.volume, membrane::pull(held, problem.target));
        visits += report.vertex_updates;
        if (report.converged) return visits;
    }
    require(false, "the quasi-static solver does not come to rest");
    return 0;
}

struct EulerChoice {
    double dt = 0, viscosity = 0;  // [s], [N s/m]
    int steps = 2000;
};

// Explicit Euler; returns the steps it took, `most` where they are not enough.
int come_to_rest(Points& x, double dt, membrane::ExplicitEuler<double>& euler, const Problem& problem, int most) {
    x = problem.start;
    x.col(held) = problem.target;
    Points velocity = Points::Zero(3, x.cols());
    for (int step = 1; step < most; ++step) {
        if (!euler.step(x, velocity, dt, problem.network, problem.volume)) return most;
        if (euler.residual() <= residual) return step;
    }
    return most;
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
                const int steps = come_to_rest(x, dt, euler, problem, best.steps);
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
    std::int64_t visits = 0;
    for (auto _ : state) visits = come_to_rest(x, solver, network, problem);
    state.counters["visits"] = static_cast<double>(visits);
    if (layers != membrane::unlimited) return;

    const EulerChoice& best = best_euler(state.range(0));
    const Problem moving(mesh, best.viscosity);
    membrane::ExplicitEuler<double> euler(moving.network);
    Points y;
    come_to_rest(y, best.dt, euler, moving, best.steps + 1);
    require((x - y).cwiseAbs().maxCoeff() < 1e-4 * press, "both must come to rest in the same place");
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
    for (auto _ : state) steps = come_to_rest(x, best.dt, euler, problem, 2 * best.steps);
    require(steps == best.steps, "explicit Euler must do the same every time");
    state.counters["dt"] = best.dt;
    state.counters["viscosity"] = best.viscosity;
    state.counters["steps"] = steps;
    state.counters["visits"] = static_cast<double>(steps) * static_cast<double>(state.range(0));
}
BENCHMARK(explicit_euler)->Apply(sizes);

}  // namespace
