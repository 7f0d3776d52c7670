// SPDX-License-Identifier: MIT
#include "support/bullet_body.hpp"
#include "support/sweep.hpp"

// Time for a vertex in one sweep over the whole mesh: ours, a plain loop, and one position iteration of Bullet's soft
// body, which corrects the lengths of the same edges' links one after the other.

namespace {

using namespace bench;

void two_sizes(benchmark::internal::Benchmark* measured) {
    measured->ArgName("vertices");
    for (const int vertices : {642, 2562}) measured->Arg(vertices);
}

BENCHMARK(plain<double, PlainMass>)->Name("plain/double")->Apply(two_sizes);
BENCHMARK(packs<double, membrane::MassStep>)->Name("ours/double/mass")->Apply(two_sizes);
BENCHMARK(packs<double, membrane::SafeStep>)->Name("ours/double/safe")->Apply(two_sizes);
BENCHMARK(packs<float, membrane::MassStep>)->Name("ours/float/mass")->Apply(two_sizes);
BENCHMARK(packs<float, membrane::SafeStep>)->Name("ours/float/safe")->Apply(two_sizes);

/// Largest absolute strain of a link.
btScalar worst_stretch(const btSoftBody& body) {
    btScalar worst = 0;
    for (int i = 0; i < body.m_links.size(); ++i) {
        const auto& link = body.m_links[i];
        worst = std::max(worst, std::abs((link.m_n[1]->m_x - link.m_n[0]->m_x).length() / link.m_rl - 1));
    }
    return worst;
}

void bullet(benchmark::State& state) {
    BulletBody body(state.range(0));
    const Field<double> field(state.range(0));
    for (Index v = 0; v < field.x.cols(); ++v) body->m_nodes[v].m_x = bullet_point(membrane::point(field.x, v));
    const btScalar stretch = worst_stretch(*body);
    for (auto _ : state) {
        btSoftBody::PSolve_Links(&*body, 1, 0);
        benchmark::ClobberMemory();
    }
    require(body.finite() && worst_stretch(*body) < stretch, "the largest strain must decrease");
    count_updates(state);
}
BENCHMARK(bullet)->Apply(two_sizes);

}  // namespace
