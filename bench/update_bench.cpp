// SPDX-License-Identifier: MIT
#include "support/scene.hpp"

// What does it save to update boxes and normals of the moved vertices only?

namespace {

using namespace bench;

// After every frame, once more, what moved in it or everything.
template <class Update>
void update(benchmark::State& state, Update update) {
    Loop loop = pressed(state.range(0));
    double moved = 0;
    for (auto _ : state) {
        loop.frame();
        state.SetIterationTime(seconds([&] { update(loop); }));
        moved += static_cast<double>(loop.report.moved.size());
    }
    loop.check();
    state.counters["moved"] = benchmark::Counter(moved, benchmark::Counter::kAvgIterations);
}
BENCHMARK_CAPTURE(update, refit_moved, [](Loop& l) { l.tree.refit(l.x, l.report.moved); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, refit_all, [](Loop& l) { l.tree.refit(l.x); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, normals_moved, [](Loop& l) { l.normals.update(l.x, l.report.moved); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, normals_all, [](Loop& l) { l.normals.update(l.x); })->Apply(sizes_around);

}  // namespace
