// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium.hpp>

#include "support/sparse_newton.hpp"

// Time from the rest shape to a force within 1 % of the equilibrium's, with a vertex prescribed 0.2 R inside: our steps
// by the default rule and by (4) with its best mass, both over the same layers, and Newton's method with the sparse
// factors of Eigen, on the whole mesh or on these layers.

namespace {

using namespace bench;

constexpr double max_error = 0.01;  // of the force, relative
constexpr Index held = 0;
constexpr int max_iterations = 1000;

struct Problem {
    explicit Problem(double mass = 1)
        : mesh(sphere(642)),
          network(mesh, {}, {.stiffness = stiffness, .mass = mass}),
          volume(mesh, {.stiffness = foundation}),
          target(0.8 * membrane::point(mesh.positions(), held)) {
        static const Vector3 known = equilibrium();
        expected = known;
    }

    [[nodiscard]] Vector3 equilibrium() const {
        const auto rest =
            membrane::equilibrium(mesh.positions(), mesh, network, volume, {}, membrane::pull(held, target));
        require(rest.converged, "the equilibrium must converge");
        return rest.reactions[0];
    }

    /// Relative error of a reaction against the equilibrium's.
    [[nodiscard]] double error(const Vector3& reaction) const {
        return membrane::norm<double>(reaction - expected) / membrane::norm(expected);
    }

    membrane::TriangleMesh<double> mesh;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<double> volume;
    Vector3 target, expected;
};

/// Number of iterations until the error of the reaction is at most `max_error`.
template <class Method>
int iterations_of(Method& method, const Problem& problem) {
    method.reset();
    for (int i = 1; i < max_iterations; ++i) {
        method.iterate();
        if (problem.error(method.reaction()) <= max_error) return i;
    }
    return max_iterations;
}

/// Measures this number of iterations, without computing the error in between.
template <class Method>
void measure(benchmark::State& state, Method& method, const Problem& problem) {
    const int iterations = iterations_of(method, problem);
    for (auto _ : state) {
        method.reset();
        for (int i = 0; i < iterations; ++i) method.iterate();
        benchmark::DoNotOptimize(method.reaction());
    }
    require(problem.error(method.reaction()) <= max_error, "the force must be near the equilibrium's");
    state.counters["iterations"] = iterations;
    state.counters["force_error"] = problem.error(method.reaction());
}

/// Our solver; an iteration is a step of one sweep.
template <class Rule>
struct Steps {
    Steps(const Problem& described, std::int64_t layers)
        : problem(described), solver(problem.network, {.layers = static_cast<Index>(layers), .sweeps = 1}) {}

    void reset() {
        x = problem.mesh.positions();
        solver.reset();
    }
    void iterate() {
        report = solver.step(x, tick, problem.network, problem.volume, membrane::pull(held, problem.target));
    }
    [[nodiscard]] Vector3 reaction() const {
        return report.status == membrane::StepStatus::advanced ? report.reactions[0] : Vector3::Zero();
    }

    const Problem& problem;
    membrane::QuasiStaticSolver<double, Rule> solver;
    Points x;
    membrane::StepReport<double> report;
};

void by_layers(benchmark::internal::Benchmark* measured) { measured->ArgName("layers")->DenseRange(2, 4)->Arg(6); }

template <class Rule>
void steps(benchmark::State& state) {
    const Problem problem;
    Steps<Rule> ours(problem, state.range(0));
    measure(state, ours, problem);
}
BENCHMARK(steps<membrane::BlockStep>)->Name("steps/block")->Apply(by_layers);
BENCHMARK(steps<membrane::SafeStep>)->Name("steps/safe")->Apply(by_layers);

/// The part dt^2 k / m for which (4) takes the fewest steps.
double best_part(std::int64_t layers) {
    double best = 0;
    int fewest = max_iterations;
    for (double part = 0.02; part < 1; part += 0.02) {
        const Problem problem(tick * tick * stiffness / part);
        Steps<membrane::MassStep> ours(problem, layers);
        const int iterations = iterations_of(ours, problem);
        if (iterations < fewest) {
            fewest = iterations;
            best = part;
        }
    }
    require(best > 0, "(4) comes to rest with some mass");
    return best;
}

void published(benchmark::State& state) {
    static std::map<std::int64_t, double> known;
    auto& part = known[state.range(0)];
    if (part == 0) part = best_part(state.range(0));
    const Problem problem(tick * tick * stiffness / part);
    Steps<membrane::MassStep> ours(problem, state.range(0));
    measure(state, ours, problem);
    state.counters["part"] = part;
}
BENCHMARK(published)->Name("steps/published")->Apply(by_layers);

enum class Pattern { anew, kept };

/// Newton's method on the vertices up to this layer.
struct Newton {
    Newton(const Problem& described, Index max_layers, Pattern known)
        : problem(described), pattern(known), newton(problem.network, problem.volume, vertices_in(max_layers)) {}

    [[nodiscard]] std::vector<Index> vertices_in(Index max_layers) const {
        membrane::PropagationQueue queue(problem.mesh.vertex_count());
        queue.build(problem.network, std::span(&held, 1), max_layers);
        std::vector<Index> found;
        for (Index v = 0; v < problem.mesh.vertex_count(); ++v) {
            if (v != held && queue.contains(v)) found.push_back(v);
        }
        return found;
    }

    void reset() {
        x = problem.mesh.positions();
        x.col(held) = problem.target;
        if (pattern == Pattern::anew) newton.analyse();
    }
    void iterate() { newton.step(x); }
    [[nodiscard]] Vector3 reaction() const {
        const Vector3 at = problem.target;
        return problem.network.force_on(held, x).force + problem.volume.force_on(held, at, at, tick).force;
    }

    const Problem& problem;
    Pattern pattern;
    SparseNewton newton;
    Points x;
};

void newton(benchmark::State& state, bool whole, Pattern pattern) {
    const Problem problem;
    Newton theirs(problem, whole ? membrane::unlimited : static_cast<Index>(state.range(0)), pattern);
    measure(state, theirs, problem);
}
BENCHMARK_CAPTURE(newton, layers, false, Pattern::kept)->Apply(by_layers);
BENCHMARK_CAPTURE(newton, whole, true, Pattern::kept)->Apply(by_layers);
BENCHMARK_CAPTURE(newton, whole_anew, true, Pattern::anew)->Apply(by_layers);

}  // namespace
