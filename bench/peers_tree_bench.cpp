// SPDX-License-Identifier: MIT
#include "support/tree_peers.hpp"

// Our tree against those of others, on the same spheres, with the same queries, whose results must agree: Embree 3
// (float; it takes what the processor has, AVX-512 too), CGAL (double), FCL (double, up to 81,920 triangles: it is
// too slow for larger ones) and Bullet (float). And the tracker, which tracks a contact without tree queries.

namespace {

using namespace bench;

constexpr double range = 3e-4;           // radius of the spheres [m]
constexpr double segment_length = 1e-3;  // towards the centre [m]
constexpr std::size_t asked = 4096;

const Mesh& mesh_of(std::int64_t triangles) {
    static std::map<std::int64_t, std::unique_ptr<Mesh>> made;
    auto& mesh = made[triangles];
    if (!mesh) mesh = std::make_unique<Mesh>(sphere(triangles / 2 + 2));
    return *mesh;
}

template <class Tree>
Tree& tree_over(std::int64_t triangles) {
    static std::map<std::int64_t, Tree> made;
    return made.try_emplace(triangles, mesh_of(triangles)).first->second;
}

/// A path near the surface, 0.05 mm from each point to the next, as a tool moves in a tick.
std::vector<Vector3> points_along(std::size_t count) {
    const Vector3 u(1, 0, 0), v = Vector3(0, 0.8, 0.6), w(0, -0.6, 0.8);
    std::vector<Vector3> points;
    for (std::size_t i = 0; i < count; ++i) {
        const double turn = 5e-5 / radius * static_cast<double>(i);
        const Vector3 around = std::cos(turn) * u + std::sin(turn) * v + 0.3 * std::sin(0.37 * turn) * w;
        points.push_back(radius * (1 + 0.03 * std::sin(9 * turn)) * around.normalized());
    }
    return points;
}

// Queries of a tree. Each returns one number.
struct Closest {
    static double of(auto& tree, const Vector3& q) { return tree.closest(q); }
};
struct Touching {
    static double of(auto& tree, const Vector3& q) { return tree.touching(q, range); }
};
struct Hit {
    static double of(auto& tree, const Vector3& q) {
        return tree.first_hit(q, (1 - segment_length / membrane::norm(q)) * q);
    }
};

/// Requires the results of our tree in double, up to rounding, which decides about triangles that are barely touched.
template <class Query, class Tree>
void compare(Tree& tree, std::int64_t triangles, const std::vector<Vector3>& points) {
    auto& ours = tree_over<Ours<double>>(triangles);
    std::size_t compared = 0, same = 0;
    for (std::size_t i = 0; i < points.size(); i += 7, ++compared) {
        const double expected = Query::of(ours, points[i]), found = Query::of(tree, points[i]);
        const double rounding = std::is_same_v<Query, Hit> ? 1e-3 : 1e-6 * radius;
        if (std::abs(found - expected) <= rounding) ++same;
    }
    require(100 * same >= 98 * compared, "all trees must give the same results");
}

template <class Tree, class Query, std::vector<Vector3> (*points_of)(std::size_t)>
void ask(benchmark::State& state) {
    auto& tree = tree_over<Tree>(state.range(0));
    const auto points = points_of(asked);
    compare<Query>(tree, state.range(0), points);
    std::size_t i = 0;
    for (auto _ : state) benchmark::DoNotOptimize(Query::of(tree, points[i++ % asked]));
}

template <class Tree>
void build(benchmark::State& state) {
    auto& tree = tree_over<Tree>(state.range(0));
    for (auto _ : state) tree.build();
    compare<Closest>(tree, state.range(0), points_near(asked));
}

/// Alternates between the sphere and a sphere with one half drawn in.
template <class Tree>
void refit(benchmark::State& state) {
    auto& tree = tree_over<Tree>(state.range(0));
    const Mesh& mesh = mesh_of(state.range(0));
    Points drawn = mesh.positions();
    for (auto p : drawn.colwise()) p.x() = std::min(p.x(), 0.5 * radius);
    bool in = false;
    for (auto _ : state) {
        in = !in;
        tree.refit(in ? drawn : mesh.positions());
    }
    tree.refit(mesh.positions());
    compare<Closest>(tree, state.range(0), points_near(asked));
}

void sizes_up_to(benchmark::internal::Benchmark* measured, int max_triangles) {
    measured->ArgName("triangles");
    for (const int triangles : {1'280, 81'920, 1'310'720}) {
        if (triangles <= max_triangles) measured->Arg(triangles);
    }
}

template <class Tree>
void add(const std::string& name, int max_triangles = 1'310'720) {
    const auto add_one = [&](const char* what, void (*measure)(benchmark::State&)) {
        sizes_up_to(benchmark::RegisterBenchmark((what + ("/" + name)).c_str(), measure), max_triangles);
    };
    if constexpr (requires(Tree tree, Vector3 q) { tree.closest(q); }) {
        add_one("path", ask<Tree, Closest, points_along>);
        add_one("random", ask<Tree, Closest, points_near>);
        add_one("sphere", ask<Tree, Touching, points_near>);
    }
    if constexpr (requires(Tree tree, Vector3 q) { tree.first_hit(q, q); })
        add_one("segment", ask<Tree, Hit, points_near>);
    if constexpr (requires(Tree tree, Points x) { tree.refit(x); }) add_one("refit", refit<Tree>);
    // Last, because Embree does not refit after it.
    if constexpr (requires(Tree tree) { tree.build(); }) add_one("build", build<Tree>);
}

const bool added = [] {
    add<Ours<double>>("double");
    add<Ours<float>>("float");
    add<Embree>("embree");
    add<Cgal>("cgal");
    add<Fcl>("fcl", 81'920);
    add<Bullet>("bullet");
    return true;
}();

void ask_tree(const Loop& loop) {
    benchmark::DoNotOptimize(loop.tree.closest_point(loop.x, loop.tool.position));
    loop.tree.overlap_sphere(loop.x, loop.tool.position, loop.contact.patch.detection_distance,
                             [](Index f) { benchmark::DoNotOptimize(f); });
}

/// The contact while the tool of the scene slides: by the tracker, or by its tree queries in each tick.
void contact(benchmark::State& state, bool tracked) {
    Loop loop = pressed(state.range(0) / 2 + 2);
    double touched = 0;
    for (auto _ : state) {
        double time = 0;
        loop.frame([&](Stage stage, auto work) {
            const double taken = seconds(work);
            if (stage == Stage::contact) time = taken;
        });
        if (!tracked) time = seconds([&] { ask_tree(loop); });
        state.SetIterationTime(time);
        touched += static_cast<double>(loop.contact.patch.triangles.size());
    }
    loop.validate();
    state.counters["touched"] = benchmark::Counter(touched, benchmark::Counter::kAvgIterations);
}
void sizes_of_contact(benchmark::internal::Benchmark* measured) {
    sizes_up_to(measured, 81'920);
    measured->Iterations(100)->UseManualTime();
}
BENCHMARK_CAPTURE(contact, tracker, true)->Apply(sizes_of_contact);
BENCHMARK_CAPTURE(contact, tree, false)->Apply(sizes_of_contact);

}  // namespace
