// SPDX-License-Identifier: MIT
#include <membrane/solve/explicit_euler.hpp>

#include <optional>

#include "support/scene.hpp"

// Stability limits of the time step. 200 spheres of 162 vertices, jittered, each with its own stiffness and a
// foundation of a hundredth to ten times the springs, start with small displacements; a run diverges if these grow a
// hundredfold, or the solver refuses a step. dt is in hundredths of sqrt(mass / stiffness), or of each scene's own
// limit.

namespace {

using namespace bench;

constexpr int scene_count = 200, steps = 400;
constexpr double start_displacement = 1e-4 * radius;

struct Scene {
    explicit Scene(std::mt19937_64& engine)
        : rest(sphere(162).positions()), spring(std::pow(10, number(engine, 0, 2))), start(162 * 3) {
        for (double& coordinate : rest.reshaped()) coordinate += 0.02 * radius * number(engine, -1, 1);
        for (double& coordinate : start) coordinate = start_displacement * number(engine, -1, 1);
        volume.emplace(mesh(), membrane::VolumeSpringOptions<double>{spring * std::pow(10, number(engine, -2, 1))});
        network.emplace(mesh(), membrane::LinearSpring{},
                        membrane::NetworkOptions<double>{.stiffness = spring, .mass = 1.0});
        for (Index v = 0; v < 162; ++v) {
            largest_block = std::max(largest_block, membrane::largest_eigenvalue(network->hessian(v, rest)));
        }
        largest_block += volume->stiffness(0);
        find_largest();
    }

    static double number(std::mt19937_64& engine, double low, double high) {
        return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
    }
    [[nodiscard]] membrane::TriangleMesh<double> mesh() const { return {rest, sphere(162).triangles()}; }

    /// The largest eigenvalue of the Hessian at rest, where no spring has a tension, by power iteration.
    void find_largest() {
        Points displacement = Eigen::Map<const Points>(start.data(), 3, 162), next;
        for (int i = 0; i < 1000; ++i) {
            next = volume->stiffness(0) * displacement;
            for (const auto& s : network->springs()) {
                const Vector3 u = (rest.col(s.second) - rest.col(s.first)).normalized();
                const Vector3 force = s.stiffness * u.dot(displacement.col(s.second) - displacement.col(s.first)) * u;
                next.col(s.first) -= force;
                next.col(s.second) += force;
            }
            largest = next.norm();
            displacement = next / largest;
        }
    }

    [[nodiscard]] Vector3 force(Index v, const Points& x) const {
        const Vector3 here = membrane::point(x, v);
        return network->force_on(v, x).force + volume->force_on(v, here, here, 1.0).force;
    }

    Points rest;
    double spring;  // stiffness [N/m]; the mass of a vertex is 1 kg
    std::vector<double> start;
    std::optional<membrane::MassSpringNetwork<double, membrane::LinearSpring>> network;
    std::optional<membrane::VirtualVolumeSprings<double>> volume;
    double largest = 0, largest_block = 0;  // eigenvalues of the Hessian and of any vertex's own block [N/m]
};

const std::vector<Scene>& scenes() {
    static const auto made = [] {
        std::mt19937_64 engine(20071101);
        std::vector<Scene> all;
        for (int i = 0; i < scene_count; ++i) all.emplace_back(engine);
        return all;
    }();
    return made;
}

/// Whether repeated `move(x)` diverges; `move` returns whether its step advanced.
template <class Move>
bool diverges(const Scene& scene, Move move) {
    Points x = scene.rest + Eigen::Map<const Points>(scene.start.data(), 3, 162);
    for (int i = 0; i < steps; ++i) {
        if (!move(x) || !((x - scene.rest).cwiseAbs().maxCoeff() < 100 * start_displacement)) return true;
    }
    return false;
}

struct ExplicitEuler {
    static double limit(const Scene& scene) { return 2 / std::sqrt(scene.largest); }
    static bool diverges_at(const Scene& scene, double dt) {
        membrane::ExplicitEuler euler(*scene.network);
        Points velocity = Points::Zero(3, 162);
        return diverges(scene, [&](Points& x) { return euler.step(x, velocity, dt, *scene.network, *scene.volume); });
    }
};

/// dx = F dt^2 / m of all vertices at once.
struct AllAtOnce {
    static double limit(const Scene& scene) { return std::sqrt(2 / scene.largest); }
    static bool diverges_at(const Scene& scene, double dt) {
        Points before;
        return diverges(scene, [&](Points& x) {
            before = x;
            for (Index v = 0; v < 162; ++v) x.col(v) += dt * dt * scene.force(v, before);
            return true;
        });
    }
};

/// (4), vertex by vertex, without a check of stability.
struct OneByOne {
    static double limit(const Scene& scene) { return std::sqrt(2 / scene.largest_block); }
    static bool diverges_at(const Scene& scene, double dt) {
        return diverges(scene, [&](Points& x) {
            for (Index v = 0; v < 162; ++v) x.col(v) += dt * dt * scene.force(v, x);
            return true;
        });
    }
};

/// The library's solver.
template <class Rule>
struct Solver {
    static double limit(const Scene& scene) { return OneByOne::limit(scene); }
    static bool diverges_at(const Scene& scene, double dt) {
        membrane::QuasiStaticSolver<double, Rule> solver(*scene.network, {.layers = membrane::unlimited, .sweeps = 1});
        solver.wake_all();
        return diverges(scene, [&](Points& x) {
            const auto report = solver.step(x, dt, *scene.network, *scene.volume);
            return report.status == membrane::StepStatus::advanced;
        });
    }
};

/// The part of the scenes that diverge [%] at dt = `part(scene)`.
template <class Method, class Part>
void measure(benchmark::State& state, Part dt) {
    int diverging = 0;
    for (auto _ : state) {
        for (const Scene& scene : scenes()) diverging += Method::diverges_at(scene, dt(scene));
    }
    state.counters["diverging"] = 100.0 * diverging / scene_count;
}

template <class Method>
void by_dt(benchmark::State& state) {
    const double part = static_cast<double>(state.range(0)) / 100;
    measure<Method>(state, [&](const Scene& scene) { return part / std::sqrt(scene.spring); });
}

template <class Method>
void by_limit(benchmark::State& state) {
    const double part = static_cast<double>(state.range(0)) / 100;
    measure<Method>(state, [&](const Scene& scene) { return part * Method::limit(scene); });
}

void settings_dt(benchmark::internal::Benchmark* measured) {
    measured->ArgName("dt")->Iterations(1)->Repetitions(1)->Unit(benchmark::kMillisecond);
    for (const int dt : {20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 90, 100, 200, 500, 1000})
        measured->Arg(dt);
}
void settings_limit(benchmark::internal::Benchmark* measured) {
    measured->ArgName("limit")->Iterations(1)->Repetitions(1)->Unit(benchmark::kMillisecond);
    for (const int part : {80, 85, 90, 95, 98, 99, 100, 101, 102, 105, 110, 115, 120, 125, 130}) measured->Arg(part);
}

BENCHMARK(by_dt<ExplicitEuler>)->Name("dt/euler")->Apply(settings_dt);
BENCHMARK(by_dt<AllAtOnce>)->Name("dt/at_once")->Apply(settings_dt);
BENCHMARK(by_dt<OneByOne>)->Name("dt/one_by_one")->Apply(settings_dt);
BENCHMARK(by_dt<Solver<membrane::MassStep>>)->Name("dt/published")->Apply(settings_dt);
BENCHMARK(by_dt<Solver<membrane::SafeStep>>)->Name("dt/safe")->Apply(settings_dt);
BENCHMARK(by_dt<Solver<membrane::BlockStep>>)->Name("dt/block")->Apply(settings_dt);
BENCHMARK(by_limit<ExplicitEuler>)->Name("limit/euler")->Apply(settings_limit);
BENCHMARK(by_limit<AllAtOnce>)->Name("limit/at_once")->Apply(settings_limit);
BENCHMARK(by_limit<OneByOne>)->Name("limit/one_by_one")->Apply(settings_limit);
BENCHMARK(by_limit<Solver<membrane::MassStep>>)->Name("limit/published")->Apply(settings_limit);

}  // namespace
