// SPDX-License-Identifier: MIT
// Cost of a part that a scene leaves out. Each pair of functions computes the same for every vertex of a sphere: ours
// leaves a part out by the library's means (no foundation, volume springs without damping, a law of whose result only
// the tension is used, a membrane that may tear and does not), the other has no such part; that of `by_hand` is a loop
// of springs alone, written by hand. Their results must have the same bits. The last pair cuts two meshes, of which one
// has four times as many vertices. `left_out` counts their instructions.
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <type_traits>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/tissue.hpp>

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

/// A volume spring that knows no damping.
template <membrane::Number N>
struct StillSpring {
    membrane::Vector3<N> anchor;
    N k;

    [[nodiscard]] membrane::VertexForce<N> elastic_force(const membrane::Vector3<N>& position) const noexcept {
        return {-k * (position - anchor), k};
    }
    [[nodiscard]] membrane::VertexForce<N> force_on(const membrane::Vector3<N>& position) const noexcept {
        return elastic_force(position);
    }
    [[nodiscard]] membrane::Vector3<N> damping_force(const membrane::Vector3<N>&) const noexcept { return {0, 0, 0}; }
    [[nodiscard]] bool damps() const noexcept { return false; }
};

/// Such springs at all vertices.
struct NoDamping {
    const Points* anchors;
    const std::vector<S>* stiffness;

    template <class V>
    [[nodiscard]] StillSpring<S> spring(Index v, const V&, S) const noexcept {
        return {membrane::point(*anchors, v), (*stiffness)[static_cast<std::size_t>(v)]};
    }
    template <class V>
    [[nodiscard]] membrane::VertexForce<S> force_on(Index v, const V& position, const V& start, S tick) const noexcept {
        return spring(v, start, tick).force_on(position);
    }
};
static_assert(membrane::FoundationModel<NoDamping, S> && membrane::SpringsInLanes<NoDamping, S>);

template <class Volume>
using SceneOf = membrane::StepInput<S, Network, Volume>;
using Packed = membrane::PackedVertices<S>;

/// All vertices by the rule, in groups.
template <class Scene>
[[gnu::always_inline]] inline void update_all(Packed& packed, const Scene& scene) noexcept {
    for (std::size_t p = 0, end = 0; p < packed.count(); p = end) {
        end = packed.end_of_group(p, packed.count());
        packed.update(p, end, scene, Rule{}, membrane::Constrained::no, membrane::OneThread());
    }
}

using Wide = membrane::Lanes<S>;
using Begins = std::array<Index, Wide::count>;
struct Slot {
    Wide stiffness, rest_length;
    Begins other;
};

/// Springs and masses as a loop written by hand has them, for the vertices of each pack.
struct Rows {
    Rows(const Network& network, const Packed& packed) {
        const Index unused = membrane::numbers_in_point * network.vertex_count();
        for (std::size_t p = 0; p < packed.count(); ++p) {
            const auto vertices = packed.vertices(p);
            Begins own;
            own.fill(unused);
            Wide mass = 1;
            std::size_t longest = 0;
            for (std::size_t i = 0; i < vertices.size(); ++i) {
                own[i] = membrane::numbers_in_point * vertices[i];
                mass.set(i, network.mass(vertices[i]));
                longest = std::max(longest, network.springs_of(vertices[i]).size());
            }
            const std::size_t first = slots.size();
            slots.resize(first + longest, {0, 0, own});
            for (std::size_t i = 0; i < vertices.size(); ++i) {
                Slot* slot = &slots[first];
                for (const auto& spring : network.springs_of(vertices[i])) {
                    slot->stiffness.set(i, spring.stiffness);
                    slot->rest_length.set(i, spring.rest_length);
                    (slot++)->other[i] = membrane::numbers_in_point * spring.other;
                }
            }
            owns.push_back(own);
            ends.push_back(slots.size());
            masses.push_back(mass);
        }
    }
    std::vector<Begins> owns;
    std::vector<std::size_t> ends;
    std::vector<Slot> slots;
    std::vector<Wide> masses;
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

COUNTED void damping_ours(Packed& packed, const SceneOf<membrane::VirtualVolumeSprings<S>>& scene) {
    update_all(packed, scene);
}
COUNTED void damping_bare(Packed& packed, const SceneOf<NoDamping>& scene) { update_all(packed, scene); }

COUNTED void energy_ours(const Network& network, const membrane::ConstPointsRef<S>& x, Points& force) {
    for (Index v = 0; v < force.cols(); ++v) force.col(v) = network.force_on(v, x).force;
}
COUNTED void energy_bare(const membrane::MassSpringNetwork<S, NoEnergy>& network, const membrane::ConstPointsRef<S>& x,
                         Points& force) {
    for (Index v = 0; v < force.cols(); ++v) force.col(v) = network.force_on(v, x).force;
}

COUNTED void by_hand_ours(Packed& packed, const SceneOf<membrane::NoFoundation>& scene) { update_all(packed, scene); }
COUNTED void by_hand_bare(const Rows& rows, membrane::PaddedPoint<S>* x) {
    const Slot* slot = rows.slots.data();
    for (std::size_t p = 0; p < rows.owns.size(); ++p) {
        const Index* own = rows.owns[p].data();
        const membrane::Vector3<Wide> here = membrane::gather(x, own);
        membrane::Vector3<Wide> force(0, 0, 0);
        Wide sum = 0;
        for (; slot != rows.slots.data() + rows.ends[p]; ++slot) {
            const membrane::Vector3<Wide> edge = membrane::gather(x, slot->other.data()) - here;
            const Wide length = norm(edge);
            const auto has_length = length != 0;
            const Wide tension = slot->stiffness * (length - slot->rest_length);
            const Wide across =
                select<Wide>(has_length, tension * (1 / select<Wide>(has_length, length, 1)), slot->stiffness);
            force += across * edge;
            sum += larger(slot->stiffness, across);
        }
        const Wide step = dt * dt / rows.masses[p];
        if (any(step * sum >= 2)) std::abort();
        const auto moves = norm(force) > 0;
        membrane::PaddedLanes<S> there{here + step * force, step};
        for (Eigen::Index k = 0; k < 3; ++k) there.point[k] = select<Wide>(moves, there.point[k], here[k]);
        membrane::scatter_padded(there, x, own);
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
    membrane::VertexRows<S> of_vertices(mesh.vertex_count());

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
    membrane::PropagationQueue queue(mesh.vertex_count());
    const Index first = 0;
    queue.build(network, {&first, 1}, membrane::unlimited);
    queue.group(network, true);
    Packed packed(network);
    packed.assign(queue.vertices(), queue.colour_ends(), network);
    const auto in_state = [&](const auto& volume, const auto& act) {
        return [&](Points& x) {
            const membrane::ConstPointsRef<S> begin = start, now = of_vertices.positions();
            of_vertices.begin_step();
            for (Index v = 0; v < x.cols(); ++v) of_vertices.load(v, begin, network);
            const SceneOf<std::remove_cvref_t<decltype(volume)>> scene{begin, now, dt, network, volume, of_vertices};
            packed.begin_step(scene);
            act(packed, scene);
            x = now;
        };
    };
    compare("damping", in_state(springs, damping_ours), in_state(undamped, damping_bare));
    compare(
        "energy", [&](Points& x) { energy_ours(network, start, x); },
        [&](Points& x) { energy_bare(network_without_energy, start, x); });
    const Rows rows(network, packed);
    compare("by_hand", in_state(none, by_hand_ours),
            in_state(none, [&](Packed&, const auto& scene) { by_hand_bare(rows, scene.rows.position.data()); }));
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
