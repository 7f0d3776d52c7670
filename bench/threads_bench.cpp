// SPDX-License-Identifier: MIT
#include <membrane/core/thread_pool.hpp>

#include "support/scene.hpp"

// Update orders and threads on a whole mesh. A vertex is pulled out by 0.3 R, and all others follow: 16 sweeps a step.
// This program may use every processor.

namespace {

using namespace bench;
using membrane::UpdateOrder;

template <membrane::Real Scalar>
void step(benchmark::State& state, UpdateOrder order, const membrane::AnyExecutor& executor) {
    const auto mesh = sphere_of<Scalar>(state.range(0));
    const auto network =
        membrane::MassSpringNetwork<Scalar, membrane::LinearSpring>(mesh, {}, {.stiffness = Scalar(stiffness)});
    const auto volume = membrane::VirtualVolumeSprings<Scalar>(mesh, {.stiffness = Scalar(foundation / 100)});
    const membrane::SolverOptions<Scalar> options{.layers = membrane::unlimited,
                                                  .sweeps = 16,
                                                  .order = order,
                                                  .predict = false,
                                                  .max_packed_vertices = membrane::unlimited};
    membrane::QuasiStaticSolver<Scalar> solver(network, options, {}, executor);
    auto x = mesh.positions();
    const membrane::Vector3<Scalar> out = Scalar(1.3) * membrane::point(x, 0);
    double vertex_updates = 0, residual = 0;
    for (auto _ : state) {
        const auto report = solver.step(x, Scalar(tick), network, volume, membrane::pull(Index(0), out));
        require(report.status == membrane::StepStatus::advanced && report.residual > 0, "the membrane must follow");
        vertex_updates += report.vertex_updates;
        residual = report.residual;
    }
    state.counters["vertex_updates"] = benchmark::Counter(vertex_updates, benchmark::Counter::kAvgIterations);
    state.counters["residual"] = residual;
}

void sizes_of_whole(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {2562, 10242, 40962, 163842}) measured->Arg(vertices);
    measured->Iterations(5)->UseRealTime()->Unit(benchmark::kMillisecond);
}

template <membrane::Real Scalar>
void breadth_first(benchmark::State& state) {
    step<Scalar>(state, UpdateOrder::breadth_first, {});
}
template <membrane::Real Scalar>
void colour_layers(benchmark::State& state) {
    step<Scalar>(state, UpdateOrder::colour_layers, {});
}
template <membrane::Real Scalar>
void colour_all(benchmark::State& state) {
    step<Scalar>(state, UpdateOrder::colour_all, {});
}
template <membrane::Real Scalar>
void threads(benchmark::State& state) {
    const membrane::ThreadPool pool;
    step<Scalar>(state, UpdateOrder::colour_all, pool.executor());
    state.counters["threads"] = pool.threads();
}
BENCHMARK_TEMPLATE(breadth_first, double)->Name("breadth_first/double")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(colour_layers, double)->Name("colour_layers/double")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(colour_all, double)->Name("colour_all/double")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(threads, double)->Name("threads/double")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(colour_layers, float)->Name("colour_layers/float")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(colour_all, float)->Name("colour_all/float")->Apply(sizes_of_whole);
BENCHMARK_TEMPLATE(threads, float)->Name("threads/float")->Apply(sizes_of_whole);

}  // namespace
