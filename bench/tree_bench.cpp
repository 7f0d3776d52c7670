// SPDX-License-Identifier: MIT
#include "support/scene.hpp"

// The tree against brute force over all triangles, and the effect of its balance threshold. The surface is pressed in,
// the tree refitted to it; queries are near the surface.

namespace {

using namespace bench;
using Tree = membrane::AabbTree<double>;

constexpr double range = 1e-3;  // radius of the spheres, length of the segments [m]

// Each query by the tree and by brute force. Both return numbers that must be equal.
struct ClosestPoint {
    static double by_tree(const Tree& tree, const Loop& loop, const Vector3& q) {
        return tree.closest_point(loop.x, q).squared_distance;
    }
    static double of_all(const Loop& loop, const Vector3& q) {
        return closest_of_all(loop.mesh, loop.x, q).squared_distance;
    }
};

struct TouchingSphere {
    static double by_tree(const Tree& tree, const Loop& loop, const Vector3& q) {
        int touched = 0;
        tree.overlap_sphere(loop.x, q, range, [&](Index) { ++touched; });
        return touched;
    }
    static double of_all(const Loop& loop, const Vector3& q) {
        int touched = 0;
        for (const auto& corners : loop.mesh.triangles().colwise()) {
            const auto triangle = membrane::triangle_at(loop.x, corners);
            if (membrane::closest_point(triangle, q).squared_distance <= range * range) ++touched;
        }
        return touched;
    }
};

struct FirstHit {
    static Vector3 end(const Vector3& q) { return (1 - range / membrane::norm(q)) * q; }
    static double by_tree(const Tree& tree, const Loop& loop, const Vector3& q) {
        const auto hit = tree.first_hit(loop.x, q, end(q));
        return hit.triangle == membrane::no_index ? 2 : hit.fraction;
    }
    static double of_all(const Loop& loop, const Vector3& q) {
        double along = 2;
        for (const auto& corners : loop.mesh.triangles().colwise()) {
            const auto hit = membrane::first_hit(membrane::triangle_at(loop.x, corners), q, end(q));
            if (hit) along = std::min(along, hit->fraction);
        }
        return along;
    }
};

// Each query has another point.
template <class Query>
void ask(benchmark::State& state, Query query) {
    const auto points = points_near(4096);
    std::size_t i = 0;
    for (auto _ : state) benchmark::DoNotOptimize(query(points[i++ % points.size()]));
}

template <class Query>
void ask_tree(benchmark::State& state, const Tree& tree, const Loop& loop) {
    for (const auto& q : points_near(16)) {
        const double expected = Query::of_all(loop, q), found = Query::by_tree(tree, loop, q);
        require(std::abs(found - expected) <= 1e-12 * expected, "the result of the tree");
    }
    ask(state, [&](const Vector3& q) { return Query::by_tree(tree, loop, q); });
}

template <class Query>
void tree(benchmark::State& state) {
    const Loop& loop = pressed(state.range(0));
    ask_tree<Query>(state, loop.tree, loop);
}
BENCHMARK(tree<ClosestPoint>)->Name("tree/closest")->Apply(sizes);
BENCHMARK(tree<TouchingSphere>)->Name("tree/sphere")->Apply(sizes);
BENCHMARK(tree<FirstHit>)->Name("tree/segment")->Apply(sizes);

template <class Query>
void all_triangles(benchmark::State& state) {
    const Loop& loop = pressed(state.range(0));
    ask(state, [&](const Vector3& q) { return Query::of_all(loop, q); });
}
BENCHMARK(all_triangles<ClosestPoint>)->Name("all_triangles/closest")->Apply(sizes);
BENCHMARK(all_triangles<TouchingSphere>)->Name("all_triangles/sphere")->Apply(sizes);
BENCHMARK(all_triangles<FirstHit>)->Name("all_triangles/segment")->Apply(sizes);

void build(benchmark::State& state) {
    const auto mesh = sphere(state.range(0));
    for (auto _ : state) benchmark::DoNotOptimize(Tree(mesh));
}
BENCHMARK(build)->Name("tree/build")->Apply(sizes);

// The tree with other thresholds.

void thresholds(benchmark::internal::Benchmark* measured) {
    measured->ArgNames({"vertices", "threshold"})->ArgsProduct({{642, 10242}, {1, 2, 4, 8, 16, 32, 64}});
}

membrane::TreeOptions threshold(const benchmark::State& state) {
    return {.balance_threshold = static_cast<Index>(state.range(1))};
}

void threshold_build(benchmark::State& state) {
    const auto mesh = sphere(state.range(0));
    for (auto _ : state) benchmark::DoNotOptimize(Tree(mesh, threshold(state)));
    state.counters["leaf"] = Tree(mesh, threshold(state)).statistics().mean_leaf;
}
BENCHMARK(threshold_build)->Name("threshold/build")->Apply(thresholds);

template <class Query>
void threshold_query(benchmark::State& state) {
    const Loop& loop = pressed(state.range(0));
    Tree tree(loop.mesh, threshold(state));
    tree.refit(loop.x);
    ask_tree<Query>(state, tree, loop);
}
BENCHMARK(threshold_query<ClosestPoint>)->Name("threshold/closest")->Apply(thresholds);
BENCHMARK(threshold_query<TouchingSphere>)->Name("threshold/sphere")->Apply(thresholds);
BENCHMARK(threshold_query<FirstHit>)->Name("threshold/segment")->Apply(thresholds);

void threshold_refit(benchmark::State& state) {
    Loop loop = pressed(state.range(0));
    loop.tree = Tree(loop.mesh, threshold(state));
    loop.tree.refit(loop.x);
    for (auto _ : state) {
        loop.frame();
        state.SetIterationTime(seconds([&] { loop.tree.refit(loop.x, loop.report.moved); }));
    }
    loop.validate();
}
BENCHMARK(threshold_refit)->Name("threshold/refit")->Apply(thresholds)->Iterations(100)->UseManualTime();

}  // namespace
