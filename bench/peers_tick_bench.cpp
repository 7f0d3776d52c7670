// SPDX-License-Identifier: MIT
#include "support/bullet_scene.hpp"

// How long does a tick take on meshes from 162 to 655,362 vertices while a tool slides, ours (contact, 4 sweeps over 8
// layers, boxes, normals, force) and that of Bullet's soft body (4 position iterations, contact, normals, its own shape
// matching for a foundation)? Bullet moves every node in every tick, and gives no force.

namespace {

using namespace bench;

constexpr Index ticks_before = Path::ticks_in + ticks_around / 6;

void sizes_between(benchmark::internal::Benchmark* measured, int least, int most) {
    measured->ArgName("vertices");
    for (int vertices = least; vertices <= most; vertices = 4 * vertices - 6) measured->Arg(vertices);
    measured->Iterations(50);
}
void sizes_of_same(benchmark::internal::Benchmark* measured) { sizes_between(measured, 162, 40962); }
void sizes_of_fine(benchmark::internal::Benchmark* measured) { sizes_between(measured, 642, 655362); }

/// The same tool on all meshes: on finer ones it touches more triangles.
Path same(std::int64_t) { return {}; }

/// A tool that is as many edges wide, goes as deep and as far on all meshes as the usual one does on 642 vertices.
Path fine(std::int64_t vertices) { return {.scale = std::sqrt(640 / static_cast<double>(vertices - 2))}; }

using Way = Path (*)(std::int64_t vertices);

/// The loop with the tool pressed in; kept until another one is requested.
template <membrane::Real Scalar, class Rule>
const LoopOf<Scalar, Rule>& sliding(std::int64_t vertices, const Path& path) {
    static std::unique_ptr<LoopOf<Scalar, Rule>> loop;
    if (!loop || loop->mesh.vertex_count() != vertices || loop->path != path) {
        const membrane::SolverOptions<Scalar> options{.layers = 8, .sweeps = 4};
        loop = std::make_unique<LoopOf<Scalar, Rule>>(vertices, path, options, ticks_before);
    }
    return *loop;
}

template <membrane::Real Scalar, class Rule, Way displacement>
void ours(benchmark::State& state) {
    auto loop = sliding<Scalar, Rule>(state.range(0), displacement(state.range(0)));
    double moved = 0;
    for (auto _ : state) {
        loop.frame();
        moved += static_cast<double>(loop.report.moved.size());
    }
    loop.validate();
    state.counters["moved"] = benchmark::Counter(moved, benchmark::Counter::kAvgIterations);
}
BENCHMARK(ours<double, membrane::BlockStep, same>)->Name("same/double/block")->Apply(sizes_of_same);
BENCHMARK(ours<double, membrane::SafeStep, same>)->Name("same/double/safe")->Apply(sizes_of_same);
BENCHMARK(ours<float, membrane::BlockStep, same>)->Name("same/float/block")->Apply(sizes_of_same);
BENCHMARK(ours<float, membrane::SafeStep, same>)->Name("same/float/safe")->Apply(sizes_of_same);
BENCHMARK(ours<double, membrane::BlockStep, fine>)->Name("fine/double/block")->Apply(sizes_of_fine);
BENCHMARK(ours<double, membrane::SafeStep, fine>)->Name("fine/double/safe")->Apply(sizes_of_fine);
BENCHMARK(ours<float, membrane::BlockStep, fine>)->Name("fine/float/block")->Apply(sizes_of_fine);
BENCHMARK(ours<float, membrane::SafeStep, fine>)->Name("fine/float/safe")->Apply(sizes_of_fine);

/// Bullet's body under a tool that follows its path from tick to tick.
struct BulletSlide {
    BulletSlide(std::int64_t vertices, const Path& displacement)
        : path(displacement), scene(vertices, displacement.scale * displacement.tool_radius) {
        for (Index t = 0; t < ticks_before; ++t) frame();
    }
    void frame() { scene.frame(path.at<double>(now++).position); }

    Path path;
    BulletScene scene;
    Index now = 0;  // ticks
};

/// With the tool pressed in; continues from the end of the last measurement, until another size is requested.
template <Way displacement>
BulletSlide& bullet_sliding(std::int64_t vertices) {
    static std::unique_ptr<BulletSlide> slide;
    static std::int64_t made = 0;
    if (made == vertices) return *slide;
    made = vertices;
    slide = std::make_unique<BulletSlide>(vertices, displacement(vertices));
    return *slide;
}

template <Way displacement>
void bullet(benchmark::State& state) {
    auto& slide = bullet_sliding<displacement>(state.range(0));
    int touched = 0;
    for (auto _ : state) {
        slide.frame();
        touched += slide.scene.touched();
    }
    require(slide.scene.finite() && touched > 0, "the tool must press on Bullet's body");
    require(slide.scene.penetration() < slide.path.scale * depth / 2, "Bullet's nodes must not penetrate the tool");
    state.counters["touched"] = benchmark::Counter(touched, benchmark::Counter::kAvgIterations);
}
BENCHMARK(bullet<same>)->Name("same/bullet")->Apply(sizes_of_same);
BENCHMARK(bullet<fine>)->Name("fine/bullet")->Apply([](auto* b) { sizes_between(b, 642, 40962); });

}  // namespace
