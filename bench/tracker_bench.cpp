// SPDX-License-Identifier: MIT
#include "support/scene.hpp"

// The tracker against tree queries in every frame. The tool presses and slides. The queries are the triangles within
// the detection distance and the nearest of them; the tracker's time includes side, depth and normal.

namespace {

using namespace bench;

const Path sphere_2mm{.tool_radius = 2e-3}, sphere_4mm{.tool_radius = 4e-3},
    capsule_2mm{.tool_radius = 2e-3, .shaft = 0.02};

void tracker(benchmark::State& state, const Path& path) {
    measure_stage(state, pressed(state.range(0), path), Stage::contact);
}
BENCHMARK_CAPTURE(tracker, sphere_2mm, sphere_2mm)->Apply(sizes_around);
BENCHMARK_CAPTURE(tracker, sphere_4mm, sphere_4mm)->Apply(sizes_around);
BENCHMARK_CAPTURE(tracker, capsule_2mm, capsule_2mm)->Apply(sizes_around);

void tree(benchmark::State& state, const Path& path) {
    Loop loop = pressed(state.range(0), path);
    membrane::FixedVector<Index> touched(static_cast<std::size_t>(loop.mesh.triangle_count()));
    const auto ask = [&] {
        touched.clear();
        benchmark::DoNotOptimize(loop.tree.closest_point(loop.x, loop.tool.position));
        loop.tree.overlap_capsule(loop.x, loop.tool.position, loop.tool.position + loop.tool.axis,
                                  loop.contact.patch.detection_distance, [&](Index f) { touched.try_push_back(f); });
    };
    for (auto _ : state) {
        loop.frame();
        state.SetIterationTime(seconds(ask));
    }
    loop.validate();

    loop.contact = loop.tracker.update(loop.tree, loop.x, loop.tool);
    ask();
    for (const Index f : touched.items()) {
        const auto is_f = [&](const auto& seen) { return seen.triangle == f; };
        require(std::any_of(loop.contact.patch.triangles.begin(), loop.contact.patch.triangles.end(), is_f),
                "the tracker must find the triangles of the tree");
    }
}
BENCHMARK_CAPTURE(tree, sphere_2mm, sphere_2mm)->Apply(sizes_around);
BENCHMARK_CAPTURE(tree, sphere_4mm, sphere_4mm)->Apply(sizes_around);
BENCHMARK_CAPTURE(tree, capsule_2mm, capsule_2mm)->Apply(sizes_around);

}  // namespace
