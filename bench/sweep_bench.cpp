// SPDX-License-Identifier: MIT
#include <array>
#include <random>
#include <vector>

#include "support/sweep.hpp"

// Time of one vertex update in a sweep over the whole mesh: packs against a plain loop, and against the same arithmetic
// on contiguous numbers, which is a lower bound for every order of the vertices.

namespace {

using namespace bench;

void sizes_in_cache(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {642, 2562, 10242}) measured->Arg(vertices);
}

BENCHMARK(plain<double, PlainMass>)->Name("plain/double/mass")->Apply(sizes_in_cache);
BENCHMARK(plain<double, PlainNewton>)->Name("plain/double/newton")->Apply(sizes_in_cache);
BENCHMARK(plain<float, PlainMass>)->Name("plain/float/mass")->Apply(sizes_in_cache);
BENCHMARK(plain<float, PlainNewton>)->Name("plain/float/newton")->Apply(sizes_in_cache);
BENCHMARK(packs<double, membrane::MassStep>)->Name("lanes/double/mass")->Apply(sizes_in_cache);
BENCHMARK(packs<double, membrane::SafeStep>)->Name("lanes/double/safe")->Apply(sizes_in_cache);
BENCHMARK(packs<double, membrane::BlockStep>)->Name("lanes/double/newton")->Apply(sizes_in_cache);
BENCHMARK(packs<float, membrane::MassStep>)->Name("lanes/float/mass")->Apply(sizes_in_cache);
BENCHMARK(packs<float, membrane::SafeStep>)->Name("lanes/float/safe")->Apply(sizes_in_cache);
BENCHMARK(packs<float, membrane::BlockStep>)->Name("lanes/float/newton")->Apply(sizes_in_cache);

/// Six springs and a volume spring for each vertex, all numbers contiguous in the order of their use.
template <Real Scalar>
void contiguous(benchmark::State& state) {
    using Wide = Lanes<Scalar>;
    struct Slot {
        membrane::Vector3<Wide> there;
        Wide stiffness, rest_length;
    };
    struct Group {
        membrane::Vector3<Wide> here, anchor;
        std::array<Slot, 6> slots;
    };
    std::vector<Group> groups((static_cast<std::size_t>(state.range(0)) + Wide::count - 1) / Wide::count);
    std::mt19937_64 random(1);
    const auto number = [&] {
        Wide lanes;
        for (std::size_t i = 0; i < Wide::count; ++i)
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
    const Wide step = Scalar(1e-3);
    for (auto _ : state) {
        for (Group& group : groups) {
            membrane::Vector3<Wide> force = Wide(Scalar(foundation)) * (group.anchor - group.here);
            for (const Slot& slot : group.slots) {
                const membrane::Vector3<Wide> edge = slot.there - group.here;
                const Wide length = membrane::norm(edge);
                force += (slot.stiffness * (length - slot.rest_length) / length) * edge;
            }
            group.here += step * force;
        }
        benchmark::DoNotOptimize(groups.data());
    }
    count_updates(state);
}
BENCHMARK(contiguous<double>)->Name("contiguous/double")->Apply(sizes_in_cache);
BENCHMARK(contiguous<float>)->Name("contiguous/float")->Apply(sizes_in_cache);

}  // namespace
