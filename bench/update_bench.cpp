// SPDX-License-Identifier: MIT
#include "support/scene.hpp"

// Updates of boxes and normals of the moved vertices against those of all, and of all against a plain loop.

namespace {

using namespace bench;

// After every frame, one more update, of the moved vertices or of all.
template <class Update>
void update(benchmark::State& state, Update update) {
    Loop loop = pressed(state.range(0));
    double moved = 0;
    for (auto _ : state) {
        loop.frame();
        state.SetIterationTime(seconds([&] { update(loop); }));
        moved += static_cast<double>(loop.report.moved.size());
    }
    loop.validate();
    state.counters["moved"] = benchmark::Counter(moved, benchmark::Counter::kAvgIterations);
}
BENCHMARK_CAPTURE(update, refit_moved, [](Loop& l) { l.tree.refit(l.x, l.report.moved); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, refit_all, [](Loop& l) { l.tree.refit(l.x); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, normals_moved, [](Loop& l) { l.normals.update(l.x, l.report.moved); })->Apply(sizes_around);
BENCHMARK_CAPTURE(update, normals_all, [](Loop& l) { l.normals.update(l.x); })->Apply(sizes_around);

// Each triangle's area to its three corners, then all to unit length.
void plain_normals(const Points& x, const membrane::Triangles& triangles, Points& normals) {
    normals.setZero();
    for (Index f = 0; f < triangles.cols(); ++f) {
        const Index a = triangles(0, f), b = triangles(1, f), c = triangles(2, f);
        const Vector3 start = membrane::point(x, a);
        const Vector3 area = membrane::cross<double>(membrane::point(x, b) - start, membrane::point(x, c) - start);
        for (const Index v : {a, b, c}) normals.col(v) += area;
    }
    for (Index v = 0; v < normals.cols(); ++v) {
        const Vector3 area = membrane::point(normals, v);
        normals.col(v) = area / membrane::norm(area);
    }
}

void normals_plain(benchmark::State& state) {
    const Loop& loop = pressed(state.range(0));
    Points normals(3, loop.x.cols());
    for (auto _ : state) {
        plain_normals(loop.x, loop.mesh.triangles(), normals);
        benchmark::ClobberMemory();
    }
    require((normals - loop.normals.values()).cwiseAbs().maxCoeff() < 1e-12, "normals of the plain loop");
}
BENCHMARK(normals_plain)->Apply(sizes);

template <membrane::Real Scalar>
void normals(benchmark::State& state) {
    const Loop& loop = pressed(state.range(0));
    const membrane::Points<Scalar> x = loop.x.cast<Scalar>();
    membrane::VertexNormals<Scalar> normals(sphere_of<Scalar>(state.range(0)));
    for (auto _ : state) {
        normals.update(x);
        benchmark::ClobberMemory();
    }
    require((normals.values().template cast<double>() - loop.normals.values()).cwiseAbs().maxCoeff() < 1e-4, "normals");
}
BENCHMARK_TEMPLATE(normals, double)->Apply(sizes);
BENCHMARK_TEMPLATE(normals, float)->Apply(sizes);

}  // namespace
