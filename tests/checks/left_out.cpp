// SPDX-License-Identifier: MIT
// Cost of a part that a scene leaves out. Each pair of functions computes the same for every vertex of a sphere: ours
// leaves a part out by the library's means (no foundation, volume springs without damping, a law of whose result only
// the tension is used, a membrane that may tear and does not), the other has no such part; that of `by_hand` is a loop
// written by hand. Their results must have the same bits. The last pair cuts two meshes, of which one has four times as
// many vertices. `left_out` counts their instructions.
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <type_traits>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/tearable_springs.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/tear/tearing.hpp>

namespace {

using membrane::Index;
using S = SCALAR;
using Network = membrane::MassSpringNetwork<S, membrane::LinearSpring>;
using Points = membrane::Points<S>;
using PointsRef = membrane::PointsRef<S>;
using Rule = membrane::MassStep;

constexpr S dt = S(1e-3), stiffness = 40, mass = S(1e-3), foundation = 8;

/// A linear law that knows no energy.
struct NoEnergy {
    template <membrane::Number N>
    membrane::SpringResponse<N> operator()(const membrane::SpringState<N>& spring) const noexcept {
        return {spring.stiffness * (spring.length - spring.rest_length), spring.stiffness, N(0)};
    }
};

/// Volume springs that know no damping.
struct NoDamping {
    const Points* anchors;
    const std::vector<S>* stiffness;

    template <class V>
    membrane::VertexForce<S> force_on(Index v, const V& position, const V&, S) const noexcept {
        const S k = (*stiffness)[static_cast<std::size_t>(v)];
        return {-k * (position - membrane::point(*anchors, v)), k};
    }
};
static_assert(membrane::FoundationModel<NoDamping, S>);

/// What the solver does with a vertex that it updates alone, by a rule that moves it along the force.
template <class Scene>
[[gnu::always_inline]] inline void visit(const Scene& scene, Index v, const membrane::VertexState<S>& state) noexcept {
    const S compliance = Rule{}.compliance(state);
    if (compliance * state.stiffness >= 2) std::abort();
    const auto by = membrane::backtracked<Rule>(scene, v, state, compliance * state.force);
    scene.state.set_position(v, membrane::point(scene.x, v) + by);
}

template <class Volume>
using SceneOf = membrane::StepInput<S, Network, Volume>;

/// `state_of` without a foundation.
membrane::VertexState<S> bare_state(const SceneOf<membrane::NoFoundation>& scene, Index v) noexcept {
    membrane::VertexState<S> state;
    const auto springs = scene.network.force_on(v, scene.x);
    state.force = springs.force;
    state.stiffness = springs.stiffness;
    const membrane::VertexForce<S> constraints{
        scene.state.constraint_force(v),
        scene.state.contact_stiffness(v) + scene.state.added_stiffness[static_cast<std::size_t>(v)]};
    state.force += constraints.force;
    state.stiffness += constraints.stiffness;
    state.mass = scene.network.has_masses() ? scene.network.mass(v) : S(0);
    state.dt = scene.dt;
    state.constrained = scene.state.seeds.contains(v);
    if (state.constrained) {
        state.contact_stiffness = scene.state.contact_stiffness(v);
        state.contact_normal = membrane::direction_or_zero(scene.state.constraint_force(v));
    }
    return state;
}

struct End {
    Index other;
    S stiffness, rest_length;
};

/// Springs and masses as a loop written by hand has them.
struct Rows {
    explicit Rows(const Network& network) {
        for (Index v = 0; v < network.vertex_count(); ++v) {
            for (const auto& end : network.springs_of(v)) ends.push_back({end.other, end.stiffness, end.rest_length});
            begins.push_back(ends.size());
            masses.push_back(network.mass(v));
        }
    }
    std::vector<std::size_t> begins{0};
    std::vector<End> ends;
    std::vector<S> masses;
};

using Tearable = membrane::Tissue<membrane::TearableSprings<S, membrane::LinearSpring>>;
using Foundation = membrane::VirtualVolumeSprings<S>;

Tearable tearable(const membrane::TriangleMesh<S>& mesh) {
    return Tearable(membrane::TearableSprings(mesh, Network(mesh, {}, {.stiffness = stiffness})));
}

/// Drags a vertex aside, a tick of the solver at a time.
template <class Springs, class... Constraints>
void drag(Points& x, const Springs& springs, const Foundation& volume, membrane::QuasiStaticSolver<S>& solver,
          const Constraints&... constraints) {
    constexpr Index held = 5;
    membrane::Vector3<S> target = membrane::point(x, held);
    for (int tick = 0; tick < 20; ++tick) {
        target[0] += S(1e-5);
        const auto report = solver.step(x, dt, springs, volume, membrane::pull(held, target), constraints...);
        if (report.moved.empty()) std::abort();
    }
}

/// A membrane, parts that follow a tear, and a path of 16 edges.
struct Cutting {
    explicit Cutting(Index rings)
        : mesh(membrane::with_reserve(membrane::disc<S>({.radius = S(0.01), .rings = rings}), 40)) {
        while (path.size() < 17) {
            path.push_back(tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
        }
    }
    membrane::TriangleMesh<S> mesh;
    Tearable springs = tearable(mesh);
    Foundation volume{mesh, {.stiffness = foundation}};
    membrane::QuasiStaticSolver<S> solver{springs};
    membrane::AabbTree<S> tree{mesh};
    membrane::ContactTracker<S> tracker{mesh};
    membrane::VertexNormals<S> normals{mesh};
    membrane::Tearing<S> tear{mesh, membrane::EnergyRelease{.toughness = 1e3, .thickness = 1e-5}};
    Points x = mesh.positions();
    std::vector<Index> path{0};
};

void cut(Cutting& membrane) {
    for (const auto& event : membrane.tear.cut_along(membrane.path, membrane.x)) {
        follow(event, membrane.springs, membrane.volume, membrane.solver, membrane.tree, membrane.tracker,
               membrane.normals);
    }
}

}  // namespace

// All that is called is inlined: what is left is what the parts need, not what a compiler makes of their number.
#define COUNTED [[gnu::noinline, gnu::flatten]]

extern "C" {

COUNTED void foundation_ours(const SceneOf<membrane::NoFoundation>& scene) {
    for (Index v = 0, count = scene.network.vertex_count(); v < count; ++v)
        visit(scene, v, membrane::state_of<Rule>(scene, v));
}
COUNTED void foundation_bare(const SceneOf<membrane::NoFoundation>& scene) {
    for (Index v = 0, count = scene.network.vertex_count(); v < count; ++v) visit(scene, v, bare_state(scene, v));
}

COUNTED void damping_ours(const SceneOf<membrane::VirtualVolumeSprings<S>>& scene) {
    for (Index v = 0, count = scene.network.vertex_count(); v < count; ++v)
        visit(scene, v, membrane::state_of<Rule>(scene, v));
}
COUNTED void damping_bare(const SceneOf<NoDamping>& scene) {
    for (Index v = 0, count = scene.network.vertex_count(); v < count; ++v)
        visit(scene, v, membrane::state_of<Rule>(scene, v));
}

COUNTED void energy_ours(const Network& network, const membrane::ConstPointsRef<S>& x, Points& force) {
    for (Index v = 0; v < force.cols(); ++v) force.col(v) = network.force_on(v, x).force;
}
COUNTED void energy_bare(const membrane::MassSpringNetwork<S, NoEnergy>& network, const membrane::ConstPointsRef<S>& x,
                         Points& force) {
    for (Index v = 0; v < force.cols(); ++v) force.col(v) = network.force_on(v, x).force;
}

COUNTED void by_hand_bare(const Rows& rows, S* x, const S* external, const S* contacts) {
    for (std::size_t v = 0; v < rows.masses.size(); ++v) {
        S* here = x + 3 * v;
        S force_x = 0, force_y = 0, force_z = 0, sum = 0;
        for (std::size_t e = rows.begins[v]; e < rows.begins[v + 1]; ++e) {
            const End& end = rows.ends[e];
            const S* there = x + 3 * static_cast<std::size_t>(end.other);
            const S dx = there[0] - here[0], dy = there[1] - here[1], dz = there[2] - here[2];
            const S length = std::sqrt(dx * dx + dy * dy + dz * dz);
            const S across = length != 0 ? end.stiffness * (length - end.rest_length) * (1 / length) : end.stiffness;
            force_x += across * dx;
            force_y += across * dy;
            force_z += across * dz;
            sum += end.stiffness < across ? across : end.stiffness;
        }
        sum += contacts[v] < 0 ? 0 : contacts[v];
        const S step = dt * dt / rows.masses[v];
        if (step * sum >= 2) std::abort();
        here[0] += step * (force_x + external[3 * v]);
        here[1] += step * (force_y + external[3 * v + 1]);
        here[2] += step * (force_z + external[3 * v + 2]);
    }
}

[[gnu::noinline]] void tear_ours(Points& x, const Tearable& springs, const Foundation& volume,
                                 membrane::QuasiStaticSolver<S>& solver, const membrane::Tearing<S>& tear) {
    drag(x, springs, volume, solver, tear.ligaments());
}
[[gnu::noinline]] void tear_bare(Points& x, const Network& springs, const Foundation& volume,
                                 membrane::QuasiStaticSolver<S>& solver) {
    drag(x, springs, volume, solver);
}

[[gnu::noinline]] void split_ours(Cutting& large) { cut(large); }
[[gnu::noinline]] void split_bare(Cutting& small) { cut(small); }

}  // extern "C"

int main(int argc, char** argv) {
    const auto mesh = membrane::icosphere<S>({.radius = S(0.01), .subdivisions = 3});
    const Network network(mesh, {}, {.stiffness = stiffness, .mass = mass});
    const membrane::MassSpringNetwork<S, NoEnergy> network_without_energy(mesh, {}, {.stiffness = stiffness});
    const membrane::VirtualVolumeSprings<S> springs(mesh, {.stiffness = foundation});
    const membrane::NoFoundation none;
    const std::vector<S> stiffnesses(static_cast<std::size_t>(mesh.vertex_count()), foundation);
    const NoDamping undamped{&springs.anchors(), &stiffnesses};
    membrane::StepState<S> state(mesh.vertex_count(), 0);

    Points start = mesh.positions();
    std::mt19937_64 random(1);
    for (Index v = 0; v < start.cols(); ++v) {
        for (int k = 0; k < 3; ++k) {
            start(k, v) += static_cast<S>(1e-4 * (static_cast<double>(random() % 2001) / 1000 - 1));
        }
    }

    bool same = true;
    const auto compare = [&](const char* name, const auto& ours, const auto& bare) {
        if (argc > 1 && std::strcmp(argv[1], name) != 0) return;
        Points x = start, y = start;
        ours(x);
        bare(y);
        if (x == y && x != start) return;
        std::printf("%s: not the same\n", name);
        same = false;
    };
    const auto visited = [&](const auto& visit, const auto& volume) {
        return [&](Points& x) {
            const membrane::ConstPointsRef<S> begin = start, now = state.positions();
            state.begin_step();
            for (Index v = 0; v < x.cols(); ++v) state.load(v, begin, network);
            visit(SceneOf<std::remove_cvref_t<decltype(volume)>>{begin, now, dt, network, volume, state});
            x = now;
        };
    };
    compare("foundation", visited(foundation_ours, none), visited(foundation_bare, none));
    compare("damping", visited(damping_ours, springs), visited(damping_bare, undamped));
    compare(
        "energy", [&](Points& x) { energy_ours(network, start, x); },
        [&](Points& x) { energy_bare(network_without_energy, start, x); });
    const Rows rows(network);
    const Points no_forces = Points::Zero(3, mesh.vertex_count());
    const std::vector<S> no_stiffness(static_cast<std::size_t>(mesh.vertex_count()), S(0));
    compare("by_hand", visited(foundation_ours, none),
            [&](Points& x) { by_hand_bare(rows, x.data(), no_forces.data(), no_stiffness.data()); });
    const Tearable tissue = tearable(mesh);
    const membrane::Tearing<S> tear(mesh, membrane::EnergyRelease{.toughness = 1e3, .thickness = 1e-5});
    compare(
        "tear",
        [&](Points& x) {
            membrane::QuasiStaticSolver<S> solver(tissue);
            tear_ours(x, tissue, springs, solver, tear);
        },
        [&](Points& x) {
            membrane::QuasiStaticSolver<S> solver(network);
            tear_bare(x, network, springs, solver);
        });
    if (argc < 2 || std::strcmp(argv[1], "split") == 0) {
        Cutting large(50), small(25);
        split_ours(large);
        split_bare(small);
        if (large.tear.tips().size() != 2 || small.tear.tips().size() != 2) {
            std::printf("split: not cut\n");
            same = false;
        }
    }
    return same ? 0 : 1;
}
