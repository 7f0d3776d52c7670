// SPDX-License-Identifier: MIT
#include "support/scene.hpp"

// Time of a frame and of its stages.

namespace {

using namespace bench;

void whole(benchmark::State& state) {
    Loop loop = pressed(state.range(0));
    for (auto _ : state) loop.frame();
    loop.validate();
}
BENCHMARK(whole)->Apply(sizes);

void part(benchmark::State& state, Stage stage) { measure_stage(state, pressed(state.range(0)), stage); }
BENCHMARK_CAPTURE(part, contact, Stage::contact)->Apply(sizes_around);
BENCHMARK_CAPTURE(part, solve, Stage::solve)->Apply(sizes_around);
BENCHMARK_CAPTURE(part, refit, Stage::refit)->Apply(sizes_around);
BENCHMARK_CAPTURE(part, normals, Stage::normals)->Apply(sizes_around);
BENCHMARK_CAPTURE(part, force, Stage::force)->Apply(sizes_around);

}  // namespace
