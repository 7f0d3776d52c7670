// SPDX-License-Identifier: MIT
#include <array>
#include <random>
#include <span>
#include <vector>

#include <membrane/solve/compact_block.hpp>

#include "support/scene.hpp"

// What does one visit of a vertex cost, in a sweep over all of the mesh? The compact block against the loop one would
// write, and against the same arithmetic on numbers that lie side by side, which no order of vertices can beat.

namespace {

using namespace bench;
using membrane::Lanes;
using membrane::Real;

/// A sphere out of balance, every vertex joined to vertex 0.
template <Real Scalar>
struct Field {
    explicit Field(std::int64_t vertices)
        : mesh(sphere(vertices).positions().cast<Scalar>(), sphere(vertices).triangles()),
          network(mesh, {}, {.stiffness = Scalar(stiffness), .mass = Scalar(4e-4)}),
          volume(mesh, {.stiffness = Scalar(backing)}),
          work(
              mesh.vertex_count(), [](Index) { return false; }, 0) {
        std::mt19937_64 random(1);
        for (Index v = 0; v < x.cols(); ++v) {
            for (int k = 0; k < 3; ++k)
                x(k, v) += static_cast<Scalar>(0.05 * radius * (static_cast<double>(random() % 2001) / 1000 - 1));
        }
        work.start = x;
    }

    membrane::TriangleMesh<Scalar> mesh;
    membrane::MassSpringNetwork<Scalar, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<Scalar> volume;
    membrane::Workspace<Scalar> work;
    membrane::Points<Scalar> x = mesh.positions();
};

void sizes_in_cache(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {642, 2562, 10242}) measured->Arg(vertices);
}

void count_visits(benchmark::State& state) { state.counters["visits"] = static_cast<double>(state.range(0)); }

/// Vertex by vertex, as one would write it.
template <Real Scalar>
void plain(benchmark::State& state) {
    struct End {
        Index other;
        Scalar stiffness, rest_length;
    };
    Field<Scalar> field(state.range(0));
    std::vector<std::size_t> row{0};
    std::vector<End> ends;
    for (Index v = 0; v < field.x.cols(); ++v) {
        for (const auto& end : field.network.springs_of(v)) ends.push_back({end.other, end.stiffness, end.rest_length});
        row.push_back(ends.size());
    }
    auto& x = field.x;
    const membrane::Points<Scalar> anchor = field.mesh.positions();
    const auto step = static_cast<Scalar>(tick * tick / 4e-4);
    for (auto _ : state) {
        for (Index v = 0; v < x.cols(); ++v) {
            const auto at = static_cast<std::size_t>(v);
            membrane::Vector3<Scalar> force = -Scalar(backing) * (x.col(v) - anchor.col(v));
            for (std::size_t e = row[at]; e < row[at + 1]; ++e) {
                const membrane::Vector3<Scalar> reach = x.col(ends[e].other) - x.col(v);
                const Scalar length = reach.norm();
                force += ends[e].stiffness * (length - ends[e].rest_length) / length * reach;
            }
            x.col(v) += step * force;
        }
        benchmark::DoNotOptimize(x.data());
    }
    require(membrane::is_finite(x), "the plain loop must not diverge");
    count_visits(state);
}
BENCHMARK(plain<double>)->Name("plain/double")->Apply(sizes_in_cache);
BENCHMARK(plain<float>)->Name("plain/float")->Apply(sizes_in_cache);

/// The compact block, positions brought and fetched in every sweep.
template <Real Scalar, class Rule>
void block(benchmark::State& state) {
    Field<Scalar> field(state.range(0));
    membrane::PointsRef<Scalar> x = field.x;
    const membrane::StepInput<Scalar, decltype(field.network), decltype(field.volume)> scene{
        x, Scalar(tick), field.network, field.volume, field.work};
    const Index seed = 0;
    membrane::PropagationQueue queue(field.mesh.vertex_count());
    queue.build(field.network, std::span(&seed, 1), membrane::unlimited);
    queue.group(field.network);
    membrane::CompactBlock<Scalar> compact(field.network);
    compact.packs().follow(queue, field.network);
    require(compact.packs().size() + 1 == static_cast<std::size_t>(state.range(0)),
            "all vertices have room in the block");
    compact.open(scene, [](Index) { return false; });
    for (auto _ : state) {
        compact.packs().load(x);
        for (std::size_t p = 0; p < compact.packs().count(); ++p) {
            benchmark::DoNotOptimize(compact.visit(p, scene, Rule{}, true));
        }
        compact.packs().store(x);
    }
    require(membrane::is_finite(field.x), "the block must not diverge");
    count_visits(state);
    state.counters["filled"] = static_cast<double>(compact.packs().size()) /
                               static_cast<double>(compact.packs().count() * Lanes<Scalar>::count);
}
BENCHMARK(block<double, membrane::MassStep>)->Name("lanes/double/mass")->Apply(sizes_in_cache);
BENCHMARK(block<double, membrane::SafeStep>)->Name("lanes/double/safe")->Apply(sizes_in_cache);
BENCHMARK(block<double, membrane::BlockStep>)->Name("lanes/double/newton")->Apply(sizes_in_cache);
BENCHMARK(block<float, membrane::MassStep>)->Name("lanes/float/mass")->Apply(sizes_in_cache);
BENCHMARK(block<float, membrane::SafeStep>)->Name("lanes/float/safe")->Apply(sizes_in_cache);
BENCHMARK(block<float, membrane::BlockStep>)->Name("lanes/float/newton")->Apply(sizes_in_cache);

/// Six springs and a volume spring for each vertex, all numbers in the order of their use.
template <Real Scalar>
void contiguous(benchmark::State& state) {
    using Several = Lanes<Scalar>;
    struct Slot {
        membrane::Vector3<Several> there;
        Several stiffness, rest_length;
    };
    struct Group {
        membrane::Vector3<Several> here, anchor;
        std::array<Slot, 6> slots;
    };
    std::vector<Group> groups((static_cast<std::size_t>(state.range(0)) + Several::count - 1) / Several::count);
    std::mt19937_64 random(1);
    const auto number = [&] {
        Several lanes;
        for (std::size_t i = 0; i < Several::count; ++i)
            lanes.set(i, static_cast<Scalar>(1 + static_cast<double>(random() % 1000) / 1000));
        return lanes;
    };
    for (Group& group : groups) {
        for (Eigen::Index k = 0; k < 3; ++k) group.here[k] = group.anchor[k] = number();
        for (Slot& slot : group.slots) {
            for (Eigen::Index k = 0; k < 3; ++k) slot.there[k] = number();
            slot.stiffness = slot.rest_length = number();
        }
    }
    const Several step = Scalar(1e-3);
    for (auto _ : state) {
        for (Group& group : groups) {
            membrane::Vector3<Several> force = Several(Scalar(backing)) * (group.anchor - group.here);
            for (const Slot& slot : group.slots) {
                const membrane::Vector3<Several> reach = slot.there - group.here;
                const Several length = membrane::norm(reach);
                force += (slot.stiffness * (length - slot.rest_length) / length) * reach;
            }
            group.here += step * force;
        }
        benchmark::DoNotOptimize(groups.data());
    }
    count_visits(state);
}
BENCHMARK(contiguous<double>)->Name("contiguous/double")->Apply(sizes_in_cache);
BENCHMARK(contiguous<float>)->Name("contiguous/float")->Apply(sizes_in_cache);

}  // namespace
