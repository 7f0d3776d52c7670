// SPDX-License-Identifier: MIT
#include <membrane/solve/packed_vertices.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include <malloc.h>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/core/thread_pool.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/spring_law_check.hpp"
#include "support/vertex_oracle.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

// A foundation, law, rule and element of one's own, of numbers alone: asked for one vertex after the other.
template <class Volume>
struct OneByOneFoundation {
    Volume volume;

    template <Real S>
    VertexForce<S> force_on(Index v, const Vector3<S>& position, const Vector3<S>& start, S dt) const noexcept {
        return volume.force_on(v, position, start, dt);
    }
};
static_assert(!SpringsInLanes<OneByOneFoundation<VirtualVolumeSprings<double>>, double>);

template <class Law>
struct OneByOneLaw {
    static constexpr bool never_stiffens = membrane::never_stiffens<Law>();
    Law law;

    template <Real S>
    SpringResponse<S> operator()(const SpringState<S>& spring) const noexcept {
        return law(spring);
    }
};

template <class Rule>
struct OneByOneRule : Rule {
    template <Real S>
    auto compliance(const VertexState<S>& vertex) const noexcept {
        return Rule::compliance(vertex);
    }
};

template <class E>
struct OneByOneElement : E {
    OneByOneElement() = default;
    OneByOneElement(const E& element) : E(element) {}  // NOLINT(google-explicit-constructor): `in_order` returns an E
};
static_assert(!ElementInLanes<OneByOneElement<TriangularSpring<double>>, double>);

template <class S, class E>
auto one_by_one(const TriangleMesh<S>& mesh, const Elements<S, E>& elements) {
    std::vector<ElementInstance<OneByOneElement<E>>> all;
    for (const auto& instance : elements.all()) all.push_back({instance.corners, instance.element});
    return Elements<S, OneByOneElement<E>>(mesh, std::move(all));
}

/// A linear spring that counts how often a force on one vertex needs it, and how often a pack does.
struct CountedSpring {
    static constexpr bool never_stiffens = true;
    int *alone, *in_packs;

    template <Number N>
    SpringResponse<N> operator()(const SpringState<N>& spring) const noexcept {
        ++*(std::same_as<N, Each<N>> ? alone : in_packs);
        return LinearSpring{}(spring);
    }
};

/// A mesh with holes, springs and foundation of all kinds, some left out.
template <Real S>
struct Membrane {
    explicit Membrane(Random& random)
        : mesh(test::with_holes(surface(random), random).mesh()),
          options(springs(random)),
          network(mesh, {}, options),
          foundation(mesh, volume(random)) {}

    /// Now and then with many springs at one vertex.
    static test::Surface<S> surface(Random& random) {
        return random.chance(0.2) ? test::fan<S>(3 + random.index(20)) : test::random_surface<S>(random);
    }
    NetworkOptions<S> springs(Random& random) const {
        std::vector<S> stiffness(edges(mesh).size());
        for (S& k : stiffness) k = random.chance(0.1) ? S(0) : random.number(S(1), S(10));
        std::vector<S> mass(static_cast<std::size_t>(mesh.vertex_count()));
        // Near to what is stable at 1 ms, on either side.
        for (S& m : mass) m = S(1e-6) * random.number(S(20), S(80));
        return {.stiffness = stiffness, .mass = mass, .pinned = {random.index(mesh.vertex_count())}};
    }
    VolumeSpringOptions<S> volume(Random& random) const {
        std::vector<S> stiffness(static_cast<std::size_t>(mesh.vertex_count()));
        for (S& k : stiffness) k = random.number(S(0.1), S(2));
        return {.stiffness = stiffness, .damping = random.chance(0.5) ? S(0) : random.number(S(1e-4), S(1e-2))};
    }

    TriangleMesh<S> mesh;
    NetworkOptions<S> options;
    MassSpringNetwork<S, LinearSpring> network;
    VirtualVolumeSprings<S> foundation;
};

/// A membrane whose vertices are off their places, with forces on some.
template <Real S, class Law, class Rule>
void check_alone(const Law& law, const Rule& rule) {
    int moved = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane<S> membrane(random);
        const MassSpringNetwork network(membrane.mesh, law, membrane.options);
        const Index vertices = membrane.mesh.vertex_count(), first = random.index(vertices);
        PropagationQueue queue(vertices);
        queue.build(network, {&first, 1}, 4);
        queue.group(network, random.chance(0.5), random.chance(0.5));
        PackedVertices<S> packed(network);
        packed.assign(queue.vertices(), queue.colour_ends(), network);
        const Points<S> start_points = membrane.mesh.positions();
        const ConstPointsRef<S> start = start_points;
        VertexRows<S> rows(vertices);
        rows.begin_step();
        rows.force_tolerance = random.chance(0.5) ? S(0) : S(0.1);
        for (Index v = 0; v < vertices; ++v) {
            rows.load(v, start, network);
            rows.set_position(v, point(start, v) + random.vector(S(-0.1), S(0.1)));
            if (random.chance(0.3)) rows.row(rows.force, v).set(random.vector<S>(), random.number(S(0), S(2)));
        }
        const bool in_contact = random.chance(0.5);
        for (const Index v : in_contact ? queue.vertices() : std::span<const Index>()) rows.seeds.insert(v);
        VertexRows<S> other = rows;
        const auto scene_of = [&](auto& of, const auto& now) {
            return StepInput<S, std::remove_cvref_t<decltype(network)>, VirtualVolumeSprings<S>>{
                start, now, S(1e-3), network, membrane.foundation, of};
        };
        const ConstPointsRef<S> now = rows.positions(), alone_now = other.positions();
        const auto scene = scene_of(rows, now), alone = scene_of(other, alone_now);
        packed.begin_step(scene);
        for (std::size_t p = 0, end = 0; p < packed.count(); p = end) {
            end = packed.end_of_group(p, packed.count());
            const auto constrained = in_contact ? Constrained::in_contact : Constrained::by_force;
            packed.update(p, end, scene, rule, constrained, OneThread());
        }
        for (const Index v : queue.vertices()) moved += test::update(alone, v, rule, rows.force_tolerance);
        for (Index v = 0; v < vertices; ++v) REQUIRE(rows.position_of(v) == other.position_of(v));
    }
    CHECK(moved > cases(60));
}

/// Does its tasks in any order.
struct AnyOrder {
    template <class Task>
    void operator()(Index count, const Task& task) const {
        std::vector<Index> order(static_cast<std::size_t>(count));
        std::iota(order.begin(), order.end(), 0);
        std::shuffle(order.begin(), order.end(), Random(static_cast<std::uint64_t>(count)).engine());
        for (const Index i : order) task(i);
    }
};

/// Ten ticks in which a vertex is pulled about, another held, a third loaded; what the steps said is added to `log`.
template <Real S, class Network, class Rule, class Volume>
Points<S> play(const TriangleMesh<S>& mesh, const Network& network, const Rule& rule, const Volume& volume,
               const SolverOptions<S>& options, int seed, std::vector<double>& log, const AnyExecutor& executor = {}) {
    Random random(static_cast<std::uint64_t>(seed));
    const Index vertices = mesh.vertex_count();
    QuasiStaticSolver<S, Rule> solver(network, options, rule, executor);
    Points<S> x = mesh.positions();
    Index v = random.index(vertices);
    const Index still = random.index(vertices), f = random.index(mesh.triangle_count());
    const auto corners = mesh.triangles().col(f);
    for (int tick = 0; tick < 10; ++tick) {
        if (random.chance(0.3)) v = random.index(vertices);
        const Vector3<S> target = point(x, v) + S(0.1) * random.vector<S>();
        const auto report = solver.step(
            x, S(1e-3), network, volume, pull(v, target), pin({&still, 1}),
            load<S>({corners[0], corners[1], corners[2]}, random.barycentric<S>(), S(0.1) * random.vector<S>()));
        log.insert(log.end(), {static_cast<double>(report.status),
                               report.status == StepStatus::advanced ? static_cast<double>(report.vertex_updates) : 0.0,
                               static_cast<double>(report.residual), static_cast<double>(report.moved.size()),
                               static_cast<double>(norm(report.total_reaction()))});
    }
    return x;
}

template <Real S>
SolverOptions<S> random_options(Random& random) {
    constexpr std::array orders{UpdateOrder::breadth_first, UpdateOrder::colour_layers, UpdateOrder::colour_all};
    return {.layers = random.chance(0.2) ? unlimited : random.index(8),
            .adaptive_layers = random.chance(0.2),
            .sweeps = 1 + random.index(4),
            .contact_iterations = 1 + random.index(3),
            .order = orders[static_cast<std::size_t>(random.index(3))],
            .max_vertex_updates = random.chance(0.2) ? random.index(200) + 1 : unlimited};
}

/// With parts that take lanes, and with some that do not, and with a small capacity for packs.
template <Real S, bool every_foundation = false, class Law, class Rule>
void check_same(const Law& law, const Rule& rule) {
    int advanced = 0, refused = 0;
    for (int seed = 1; seed <= cases(150); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane<S> membrane(random);
        const auto options = random_options<S>(random);
        auto other = options;
        other.max_packed_vertices = random.index(2 * membrane.mesh.vertex_count());
        const MassSpringNetwork network(membrane.mesh, law, membrane.options);
        const MassSpringNetwork of_numbers(membrane.mesh, OneByOneLaw<Law>{law}, membrane.options);
        const OneByOneFoundation<VirtualVolumeSprings<S>> alone{membrane.foundation};
        std::vector<double> in_lanes, one_by_one;
        const auto run = [&](const auto& springs, const auto& by, const auto& under, const auto& with, auto& log) {
            return play(membrane.mesh, springs, by, under, with, seed, log);
        };
        const double which = random.number();
        if constexpr (every_foundation) {  // which a rule or a law knows nothing of
            if (which < 0.2) {
                const auto x = run(network, rule, NoFoundation{}, options, in_lanes);
                REQUIRE(same_bits(x, run(network, rule, OneByOneFoundation<NoFoundation>{}, other, one_by_one)));
            } else if (which < 0.4) {
                const auto x = run(network, rule, membrane.foundation, options, in_lanes);
                REQUIRE(same_bits(x, run(network, rule, alone, other, one_by_one)));
            }
        }
        if (!every_foundation || which >= 0.4) {
            const auto x = run(network, rule, membrane.foundation, options, in_lanes);
            const auto y = which < 0.6 ? run(network, rule, membrane.foundation, other, one_by_one)
                                       : run(of_numbers, OneByOneRule<Rule>{rule}, alone, other, one_by_one);
            REQUIRE(same_bits(x, y));
        }
        REQUIRE(in_lanes == one_by_one);
        for (std::size_t i = 0; i < in_lanes.size(); i += 5) ++(in_lanes[i] == 0 ? advanced : refused);
    }
    CHECK(advanced > refused);
    if constexpr (std::same_as<Rule, MassStep>) CHECK((refused > 0 || cases(150) < 150));
}

/// A tissue that is pulled so far that some updates need the line search, on a foundation with two stiffnesses.
template <Real S, class Rule>
void check_same_tissue(const Rule& rule) {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane<S> membrane(random);
        const auto& mesh = membrane.mesh;
        const Material material{
            .young_modulus = random.number(0.1, 20.0), .poisson_ratio = random.number(0.0, 0.45), .thickness = 1};
        const auto triangles = triangular_springs(mesh, material, random.number(0.9, 1.1));
        const auto hinges = bending_springs(mesh, random.number(0.0, 0.1));
        const auto inside = pressure(mesh, random.number(-1.0, 1.0));
        const Tissue tissue(membrane.network, triangles, hinges, inside);
        const Tissue one_kind_alone(membrane.network, triangles, one_by_one(mesh, hinges), inside);
        const Tissue all_alone(membrane.network, one_by_one(mesh, triangles), one_by_one(mesh, hinges),
                               one_by_one(mesh, inside));
        const FoundationSprings<S> foundation(mesh, {.normal = random.number(S(0), S(2)),
                                                     .tangential = random.number(S(0), S(2)),
                                                     .recovery_time = random.chance(0.5) ? S(0) : S(1e-3)});
        const auto options = random_options<S>(random);
        auto other = options;
        other.max_packed_vertices = random.index(2 * mesh.vertex_count());
        std::vector<double> in_lanes, alone;
        const auto x = play(mesh, tissue, rule, foundation, options, seed, in_lanes);
        const auto y =
            random.chance(0.5)
                ? play(mesh, one_kind_alone, rule, foundation, other, seed, alone)
                : play(mesh, all_alone, rule, OneByOneFoundation<FoundationSprings<S>>{foundation}, other, seed, alone);
        REQUIRE(same_bits(x, y));
        REQUIRE(in_lanes == alone);
    }
}

/// With everything that a step can do at the same time shared out, however it is.
template <Real S, class Rule>
void check_same_shared_out(const Rule& rule) {
    const ThreadPool pool(3);
    int advanced = 0;
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane<S> membrane(random);
        const SolverOptions<S> options{
            .layers = random.chance(0.5) ? unlimited : random.index(8),
            .sweeps = 1 + random.index(4),
            .order = random.chance(0.7) ? UpdateOrder::colour_all : UpdateOrder::colour_layers};
        std::vector<double> alone, in_any_order, in_threads;
        const auto x = play(membrane.mesh, membrane.network, rule, membrane.foundation, options, seed, alone);
        REQUIRE(same_bits(x, play(membrane.mesh, membrane.network, rule, membrane.foundation, options, seed,
                                  in_any_order, AnyOrder{})));
        REQUIRE(same_bits(x, play(membrane.mesh, membrane.network, rule, membrane.foundation, options, seed, in_threads,
                                  pool.executor())));
        REQUIRE(alone == in_any_order);
        REQUIRE(alone == in_threads);
        for (std::size_t i = 0; i < alone.size(); i += 5) advanced += alone[i] == 0 ? 1 : 0;
    }
    CHECK(advanced > 0);
}

}  // namespace

TEMPLATE_TEST_CASE("whatever does not take lanes, and what exceeds the capacity for packs, ends in the same bits",
                   "[packed]", TEST_SCALARS) {
    SECTION("block, over-relaxed") { check_same<TestType, all_types>(LinearSpring{}, BlockStep{.omega = 1.3}); }
    if constexpr (all_types) {
        SECTION("safe") { check_same<TestType>(LinearSpring{}, SafeStep{}); }
        SECTION("as published") { check_same<TestType>(LinearSpring{}, MassStep{}); }
        SECTION("springs that stiffen, block") { check_same<TestType>(test::CubicSpring{}, BlockStep{}); }
    }
}

TEMPLATE_TEST_CASE("elements that do not take lanes end in the same bits", "[packed][tissue]", TEST_SCALARS) {
    check_same_tissue<TestType>(BlockStep{.omega = 1.7});
}

TEMPLATE_TEST_CASE("an update of a pack is that of each of its vertices alone, to the bit", "[packed]", TEST_SCALARS) {
    SECTION("linear springs, block") { check_alone<TestType>(LinearSpring{}, BlockStep{.omega = 1.3}); }
    SECTION("springs that stiffen, safe") { check_alone<TestType>(ExponentialSpring{}, SafeStep{}); }
    if constexpr (all_types) {
        SECTION("linear springs, safe") { check_alone<TestType>(LinearSpring{}, SafeStep{}); }
        SECTION("springs that stiffen, block") { check_alone<TestType>(test::CubicSpring{}, BlockStep{}); }
    }
}

TEMPLATE_TEST_CASE(
    "a tool on vertices that a constraint fixes meets the same resistance if these are in packs, to the bit",
    "[packed]", float, double) {
    using S = TestType;
    int pressed = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = sheet<S>({.width = 1, .height = 1, .columns = 8, .rows = 8});
        std::vector<Index> fixed;  // of pinned ones none would be in packs
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (random.chance(0.5)) fixed.push_back(v);
        }
        const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(10)});
        const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(1)});
        SolverOptions<S> options{.layers = 2, .force_tolerance = random.number(S(0), S(0.05))};
        QuasiStaticSolver<S> in_packs(network, options);
        options.max_packed_vertices = 0;
        QuasiStaticSolver<S> one_by_one(network, options);
        Points<S> x = mesh.positions(), y = x;
        AabbTree<S> tree(mesh);
        ContactTracker<S> tracker(mesh);
        Tool<S> tool{.position = {random.number(S(-0.4), S(0.4)), random.number(S(-0.4), S(0.4)), S(0.1)},
                     .radius = S(0.1)};
        for (int tick = 0; tick < 8; ++tick) {
            tool.position[2] -= random.number(S(0), S(0.005));
            const auto contact = tracker.update(tree, x, tool);
            const auto report = in_packs.step(x, S(1e-3), network, foundation, pin(fixed), press(tool, contact));
            const auto other = one_by_one.step(y, S(1e-3), network, foundation, pin(fixed), press(tool, contact));
            REQUIRE(report.status == StepStatus::advanced);
            REQUIRE(other.status == StepStatus::advanced);
            REQUIRE(same_bits(x, y));
            REQUIRE(report.total_reaction() == other.total_reaction());
            if (norm(report.total_reaction()) > 0) ++pressed;
            tree.refit(x, report.moved);
        }
    }
    CHECK(pressed > 0);
}

TEMPLATE_TEST_CASE("it is all the same in what order an executor does its tasks, or in how many threads", "[packed]",
                   TEST_SCALARS) {
    SECTION("block") { check_same_shared_out<TestType>(BlockStep{}); }
    if constexpr (all_types) {
        SECTION("safe") { check_same_shared_out<TestType>(SafeStep{}); }
        SECTION("as published") { check_same_shared_out<TestType>(MassStep{}); }
    }
}

TEMPLATE_TEST_CASE("there are as many groups as the capacity allows, in packs", "[packed]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(1)});
        const Index vertices = mesh.vertex_count(), capacity = random.index(vertices + 1);
        const Index start = random.index(vertices);
        PropagationQueue queue(vertices);
        queue.build(network, {&start, 1}, random.index(6));
        queue.group(network);
        // A step with more vertices than its budget allows takes the first of the queue.
        const auto all = static_cast<Index>(queue.vertices().size());
        const Index count = random.chance(0.5) ? all : random.index(all + 1);
        const auto given = queue.vertices().first(static_cast<std::size_t>(count));
        IndexSet active(vertices);
        for (const Index v : given) active.insert(v);
        for (Index v = 0; v < vertices; ++v) {
            if (random.chance(0.5)) active.insert(v);
        }
        VertexColouring others(vertices);
        others.add(network, active, given.size(), active.items().size());
        PackedVertices<S> packed(network, capacity);
        for (int again = 0; again < 2; ++again) {
            packed.assign(given, queue.colour_ends(), network);
            REQUIRE(packed.assigned() == given.size());
            const std::size_t of_queue = packed.size();
            const bool is_whole = of_queue == given.size();
            packed.append(active.items(), given.size(), others.ends(), network);
            REQUIRE(packed.size() <= static_cast<std::size_t>(capacity));
            if (capacity == vertices) REQUIRE(packed.size() == active.items().size());
            if (!is_whole) REQUIRE(packed.size() == of_queue);
            std::vector<std::size_t> ends(queue.colour_ends().begin(), queue.colour_ends().end());
            for (std::size_t& end : ends) end = std::min(end, given.size());
            if (is_whole) ends.insert(ends.end(), others.ends().begin(), others.ends().end());
            std::size_t number = 0, pack = 0;
            IndexSet expected(vertices);
            for (const std::size_t end : ends) {
                for (; number < end && pack < packed.count(); ++pack) {
                    REQUIRE(packed.first_of(pack) == number);
                    REQUIRE(packed.pack_from(number) == pack);
                    REQUIRE(packed.vertices(pack).size() == std::min(end - number, Lanes<S>::count));
                    for (const Index v : packed.vertices(pack)) {
                        REQUIRE(v == active.items()[number++]);
                        expected.insert(v);
                        for (const auto& end_of : network.neighbours(v)) expected.insert(end_of.other);
                    }
                }
            }
            REQUIRE(pack == packed.count());
            REQUIRE(number == packed.size());
            for (std::size_t p = 0; p < packed.count(); ++p) {
                const std::size_t of_group = *std::upper_bound(ends.begin(), ends.end(), packed.first_of(p));
                for (std::size_t end = p + 1; end <= packed.count(); ++end)
                    REQUIRE(packed.end_of_group(p, end) == std::min(end, packed.pack_from(of_group)));
            }
            REQUIRE(packed.pack_from(packed.size()) == packed.count());
            REQUIRE(packed.needed().size() == expected.items().size());
            for (const Index v : packed.needed()) REQUIRE(expected.contains(v));
        }
    }
}

TEST_CASE("memory for packs grows with the springs, however many meet at one vertex", "[packed]") {
    const auto mesh = test::fan<double>(2000).mesh();
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 1.0});
    const auto in_use = [] {
        const auto memory = mallinfo2();
        return static_cast<double>(memory.uordblks + memory.hblkhd);
    };
    const double before = in_use();
    const PackedVertices<double> packed(network);
    CHECK(in_use() - before < 2000 * 2e4);  // bytes
}

TEMPLATE_TEST_CASE("all vertices of a membrane fit into packs", "[packed]", float, double) {
    using S = TestType;
    for (const auto& mesh : {icosphere<S>({.radius = 1, .subdivisions = 4}), test::fan<S>(2000).mesh()}) {
        const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(1)});
        PropagationQueue queue(mesh.vertex_count());
        const Index start = 0;
        queue.build(network, {&start, 1}, unlimited);
        queue.group(network);
        PackedVertices<S> packed(network);
        packed.assign(queue.vertices(), queue.colour_ends(), network);
        CHECK(packed.size() == static_cast<std::size_t>(mesh.vertex_count()));
    }
}

TEMPLATE_TEST_CASE("a membrane that no tool has touched is updated in packs, whatever moves it", "[packed]", float,
                   double) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 3});
    int alone = 0, in_packs = 0;
    const MassSpringNetwork<S, CountedSpring> network(mesh, {&alone, &in_packs}, {.stiffness = S(1)});
    const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(0.2)});
    const auto check = [&](const auto& move) {
        for (const bool touched : {false, true}) {
            CAPTURE(touched);
            QuasiStaticSolver<S> solver(network);
            Points<S> x = mesh.positions();
            if (touched)
                CHECK(solver.step(x, S(1e-3), network, foundation, pull(7, Vector3<S>(S(1.01) * point(x, 7)))).status ==
                      StepStatus::advanced);
            MovingBody<S> body(mesh);
            for (int tick = 0; tick < 3; ++tick) {
                move(solver, body, x, tick);
                alone = in_packs = 0;
                CHECK(solver.step(x, S(1e-3), network, on(body, foundation)).moved.size() > 600);
                CHECK(alone == 0);
                CHECK(in_packs > 600 * 2 * 3 / static_cast<int>(Lanes<S>::count));
            }
        }
    };
    SECTION("a body that deforms") {
        check([&](auto&, auto& body, auto& x, int tick) {
            REQUIRE(body.move_to(Points<S>(S(1.01 + 0.01 * tick) * mesh.positions()), S(1e-3), x));
        });
    }
    SECTION("its user") {
        check([&](auto& solver, auto&, auto& x, int) {
            x *= S(1.01);
            solver.wake_all();
        });
    }
}

TEMPLATE_TEST_CASE("the residual forces of packs are those of their vertices, to the bit", "[packed]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Membrane<S> membrane(random);
        const Index vertices = membrane.mesh.vertex_count(), first = random.index(vertices);
        PropagationQueue queue(vertices);
        queue.build(membrane.network, {&first, 1}, 4);
        queue.group(membrane.network);
        PackedVertices<S> packed(membrane.network);
        packed.assign(queue.vertices(), queue.colour_ends(), membrane.network);
        const Points<S> start_points = membrane.mesh.positions();
        const ConstPointsRef<S> start = start_points;
        VertexRows<S> rows(vertices);
        rows.begin_step();
        for (Index v = 0; v < vertices; ++v) {
            rows.load(v, start, membrane.network);
            rows.set_position(v, point(start, v) + random.vector(S(-0.1), S(0.1)));
        }
        if (!queue.vertices().empty()) {
            const Index v = queue.vertices()[0];
            rows.row(rows.force, v).set(random.vector<S>(), S(0));
        }
        const ConstPointsRef<S> now = rows.positions();
        const StepInput<S, decltype(membrane.network), decltype(membrane.foundation)> scene{
            start, now, S(1e-3), membrane.network, membrane.foundation, rows};
        packed.begin_step(scene);
        for (std::size_t p = 0; p < packed.count(); ++p) {
            packed.evaluate_residual(p, scene);
            for (const Index v : packed.vertices(p)) {
                const Vector3<S> force = total_force(scene, v).force;
                REQUIRE(rows.residual_force(v) == force);
                REQUIRE(rows.unbalanced_force(v) == norm(undamped_force(scene, v, force)));
            }
        }
    }
}
