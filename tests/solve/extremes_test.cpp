// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/guarded_loop.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"

// Numbers at the ends of their ranges: nothing divides by zero, nothing overflows, nothing that is no number comes out.

using namespace membrane;
using test::GuardedLoop;
using test::Random;
using test::same_bits;

namespace {

template <class S>
TriangleMesh<S> unit_sphere(Index subdivisions) {
    return icosphere<S>({.radius = 1, .subdivisions = subdivisions});
}

/// `count` numbers over `decades` powers of ten around 1, some of them zero.
template <class S>
std::vector<S> over_decades(Index count, double decades, double none, Random& random) {
    std::vector<S> values(static_cast<std::size_t>(count));
    for (S& value : values) {
        value = random.chance(none) ? S(0) : static_cast<S>(std::pow(10, decades * random.number(-0.5, 0.5)));
    }
    return values;
}

/// The corners of triangle `f`.
template <class S>
std::array<Index, 3> corners_of(const TriangleMesh<S>& mesh, Index f) {
    const auto column = mesh.triangles().col(f);
    return {column[0], column[1], column[2]};
}

}  // namespace

// ---- stiffness ratio

namespace {

/// What springs and foundation store [J], and the size of what rounding the positions makes of it.
template <class Loop>
std::array<double, 2> energy_of(const Loop& loop) {
    double sum = 0, size = 0;
    const Points<double> x = loop.x.template cast<double>();
    const auto add = [&](double stiffness, double stretch, double length) {
        sum += stiffness * stretch * stretch / 2;
        size += stiffness * (1 + length) * (std::abs(stretch) + 1e-7);
    };
    for (const auto& spring : loop.network.springs()) {
        const double length = norm(edge_vector(spring, x)), rest = static_cast<double>(spring.rest_length);
        add(static_cast<double>(spring.stiffness), length - rest, length);
    }
    for (Index v = 0; v < loop.mesh.vertex_count(); ++v) {
        const double length = (x.col(v) - loop.foundation.anchors().col(v).template cast<double>()).norm();
        add(static_cast<double>(loop.foundation.stiffness(v)), length, length);
    }
    return {sum, size};
}

/// A tool slides, a vertex is held, a point is pulled, another loaded, two vertices are pinned; then all let go.
template <class S, class Rule>
void mistreat(int seed) {
    Random random(static_cast<std::uint64_t>(seed));
    static const auto mesh = unit_sphere<S>(1);
    const double decades = random.number(0.0, 12.0);
    GuardedLoop<S, Rule> loop(mesh, {.stiffness = over_decades<S>(120, decades, 0.05, random)},
                              {.stiffness = over_decades<S>(42, decades, random.chance(0.5) ? 0 : 0.5, random),
                               .damping = over_decades<S>(42, decades, 0.5, random)},
                              {.layers = random.index(6), .sweeps = 1 + random.index(3)},
                              Rule{.omega = random.number(0.1, 1.99)});
    const std::vector<Index> pins{random.index(42), random.index(42)};
    const Index v = random.index(42), held = random.index(80), loaded = random.index(80);
    const auto target = random.vector<S>(S(-1.2), S(1.2)), place = random.vector<S>(S(-1.2), S(1.2));
    const Vector3<S> force = static_cast<S>(std::pow(10, decades * random.number(-0.5, 0.5))) * random.vector<S>();
    const auto weights = random.barycentric<S>();
    Tool<S> tool{.position = S(1.4) * random.unit_vector<S>(), .radius = random.number<S>(0, S(0.3))};
    const Vector3<S> displacement = (S(0.8) * random.unit_vector<S>() - tool.position) / 10;
    for (int tick = 0; tick < 12; ++tick) {
        tool.position += displacement;
        (void)loop.tick(tool, pull(v, target), PointAttachment<S>{held, corners_of(mesh, held), weights, place},
                        load<S>(corners_of(mesh, loaded), weights, force), pin(pins));
    }
    (void)loop.step();  // the damping of what let go belongs to this tick
    double before = energy_of(loop)[0];
    for (int tick = 0; tick < 5; ++tick) {
        const double slack = 64 * static_cast<double>(std::numeric_limits<S>::epsilon()) * energy_of(loop)[1];
        REQUIRE(loop.step().status == StepStatus::advanced);
        const double now = energy_of(loop)[0];
        REQUIRE(now <= before + slack);
        before = now;
    }
}

}  // namespace

TEMPLATE_TEST_CASE("stiffnesses twelve powers of ten apart come to a safe outcome", "[extremes]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        mistreat<TestType, BlockStep>(seed);
        mistreat<TestType, SafeStep>(seed);
    }
}

// ---- dt of the rule as published

namespace {

/// The largest eigenvalue of any vertex's own 3 x 3 block at rest, with a foundation of stiffness `volume`.
template <class S>
double largest_block(const TriangleMesh<S>& mesh, const std::vector<S>& stiffness, double volume) {
    const Adjacency adjacency(mesh);
    const auto edges = adjacency.edges();
    std::vector<Eigen::Matrix3d> blocks(static_cast<std::size_t>(mesh.vertex_count()),
                                        volume * Eigen::Matrix3d::Identity());
    for (std::size_t s = 0; s < edges.size(); ++s) {
        const auto [a, b] = edges[s];
        const Eigen::Vector3d u =
            (mesh.positions().col(b) - mesh.positions().col(a)).template cast<double>().normalized();
        for (const Index v : {a, b}) {
            blocks[static_cast<std::size_t>(v)] += static_cast<double>(stiffness[s]) * u * u.transpose();
        }
    }
    double largest = 0;
    for (const auto& block : blocks) {
        largest = std::max(largest, test::eigenvalues_of(block)[2]);
    }
    return largest;
}

}  // namespace

TEMPLATE_TEST_CASE("for any dt the rule as published converges below two over the largest block, and is refused beyond",
                   "[extremes]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = unit_sphere<S>(1);
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto stiffness = over_decades<S>(120, 1, 0, random);
        const auto volume = random.number<S>(S(0.5), 5);
        const auto dt = static_cast<S>(std::pow(10, random.number(-6.0, 3.0)));
        const double limit = 2 / largest_block(mesh, stiffness, static_cast<double>(volume));
        const bool stable = random.chance(0.5);
        const double part = stable ? random.number(0.2, 0.98) : 1.02 * std::pow(10, random.number(0.0, 9.0));
        CAPTURE(dt, part);
        const NetworkOptions<S> springs{.stiffness = stiffness,
                                        .mass = static_cast<S>(static_cast<double>(dt * dt) / (part * limit))};
        const SolverOptions<S> options{.layers = unlimited, .sweeps = 10, .force_tolerance = S(1e-30)};
        GuardedLoop<S, MassStep> loop(mesh, springs, {.stiffness = volume}, options);
        // Near rest, so that the eigenvalues stay what they are there.
        const Points<S> start = test::jittered(mesh.positions(), S(1e-3), random);
        loop.x = start;
        loop.dt = dt;
        loop.solver.wake_all();
        auto report = loop.step();
        if (!stable) {
            REQUIRE(report.status == StepStatus::unstable);
            REQUIRE(same_bits(loop.x, start));
            loop.dt = dt * static_cast<S>(std::sqrt(0.9 / part));  // a smaller time step, and it goes on
            REQUIRE(loop.step().status == StepStatus::advanced);
            continue;
        }
        for (int i = 0; i < 50; ++i) {
            REQUIRE(report.status == StepStatus::advanced);
            report = loop.step();
        }
        REQUIRE((loop.x - mesh.positions()).cwiseAbs().maxCoeff() < (sizeof(S) == 4 ? S(1e-5) : S(1e-6)));
    }
}

TEMPLATE_TEST_CASE("without damping safe and block steps are the same to the bit for any dt", "[extremes]",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = unit_sphere<S>(1);
    const auto run = [&](int seed, S dt, auto rule) {
        Random random(static_cast<std::uint64_t>(seed));
        GuardedLoop<S, decltype(rule)> loop(mesh, {.stiffness = over_decades<S>(120, 4, 0, random), .mass = S(1)},
                                            {.stiffness = random.number<S>(0, 2)}, {}, rule);
        loop.dt = dt;
        const Index v = random.index(42);
        const auto target = random.vector<S>();
        for (int i = 0; i < 3; ++i) REQUIRE(loop.step(pull(v, target)).status == StepStatus::advanced);
        return loop.x;
    };
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto dt = static_cast<S>(std::pow(10, random.number(-6.0, 3.0)));
        REQUIRE(same_bits(run(seed, dt, SafeStep{}), run(seed, 1, SafeStep{})));
        REQUIRE(same_bits(run(seed, dt, BlockStep{}), run(seed, 1, BlockStep{})));
    }
}

// ---- a tool exactly somewhere

namespace {

/// A point that is exactly a vertex, in the middle of an edge, on a face, or an anchor.
template <class S>
Vector3<S> exact_place(const GuardedLoop<S>& loop, Random& random) {
    const auto triangle = triangle_at(loop.x, corners_of(loop.mesh, random.index(loop.mesh.triangle_count())));
    switch (random.index(4)) {
        case 0: return triangle.a;
        case 1: return (triangle.a + triangle.b) / 2;
        case 2: return point_at<S>(triangle, {S(0.25), S(0.25), S(0.5)});
        default: return point(loop.foundation.anchors(), random.index(loop.mesh.vertex_count()));
    }
}

}  // namespace

TEMPLATE_TEST_CASE("a tool that is at the end of the range for a tick presses again two ticks later", "[extremes][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    for (const Vector3<S>& axis : {Vector3<S>(0, 0, 0), Vector3<S>(1, 0, 0)}) {
        for (const S far : {std::numeric_limits<S>::max(), std::numeric_limits<S>::lowest()}) {
            const auto mesh = unit_sphere<S>(1);
            GuardedLoop<S> loop(mesh, {.stiffness = S(40)}, {.stiffness = S(8)}, {.layers = 4, .sweeps = 1});
            loop.traps = test::FloatingPointTraps::only_division;  // squares of such a distance are infinite
            Tool<S> tool{.position = {S(-0.2), S(-0.2), S(0.9)}, .axis = axis, .radius = S(0.15)};
            const auto tick = [&] { return loop.tick(tool).status; };
            for (int i = 0; i < 3; ++i) CHECK(tick() == StepStatus::advanced);
            const S near = std::exchange(tool.position[0], far);
            (void)tick();
            tool.position[0] = near;
            (void)tick();  // it sweeps whatever is between
            CHECK(tick() == StepStatus::advanced);
        }
    }
}

namespace {

enum class Drawn { vertex, point, load };

}  // namespace

// A tool that oscillates with growing amplitude takes what it holds along. A step from which the next one could not go
// on is refused, so that the membrane comes back however far it was drawn.
TEMPLATE_TEST_CASE("a membrane that is drawn off farther and farther comes back when it is released", "[extremes][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = unit_sphere<S>(2);
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = S(40)});
    const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(8), .damping = S(0.005)});
    const auto corners = corners_of(mesh, 0);
    const Vector3<S> middle(S(0.5), S(0.25), S(0.25)), from = point(mesh.positions(), 0);
    for (const Index layers : {Index(3), unlimited}) {
        for (const Drawn by : {Drawn::vertex, Drawn::point, Drawn::load}) {
            const S growth = layers == 3 ? S(-1.5) : S(2);
            CAPTURE(layers, static_cast<int>(by));
            QuasiStaticSolver<S> solver(network, {.layers = layers, .sweeps = 1});
            Points<S> x = mesh.positions();
            const auto draw = [&](const Vector3<S>& off) {
                const auto step = [&](const auto& tool) { return solver.step(x, S(1e-3), network, foundation, tool); };
                switch (by) {
                    case Drawn::vertex: return step(pull(0, from + off)).status;
                    case Drawn::point: return step(PointAttachment<S>{0, corners, middle, from + off}).status;
                    default: return step(load(corners, middle, S(40) * off)).status;
                }
            };
            int refused = 0;
            for (S distance = S(0.1); is_finite(distance); distance *= growth) {
                if (draw(distance * Vector3<S>(S(0.8), S(0.6), 0)) == StepStatus::advanced) continue;
                ++refused;
                REQUIRE(solver.step(x, S(1e-3), network, foundation).status == StepStatus::advanced);
            }
            CHECK(refused > 0);
            const auto is_back = [&] { return (x - mesh.positions()).cwiseAbs().maxCoeff() < S(1e-3); };
            int stopped = 0;
            for (int tick = 0; tick < 20'000 && !is_back(); ++tick) {
                solver.wake_all();
                stopped += solver.step(x, S(1e-3), network, foundation).status != StepStatus::advanced;
            }
            CHECK(stopped == 0);
            CHECK(is_back());
        }
    }
}

TEMPLATE_TEST_CASE("a tool exactly on a vertex, an edge, a face or an anchor divides nothing by zero", "[extremes]",
                   TEST_SCALARS) {
    using S = TestType;
    // On a sheet the coordinates are round: products that should vanish do.
    const auto sphere = unit_sphere<S>(1);
    const auto flat = sheet<S>({.width = 1, .height = 1, .columns = 4, .rows = 4});
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto& mesh = seed % 2 == 0 ? sphere : flat;
        GuardedLoop<S> loop(mesh, {.stiffness = S(1)},
                            {.stiffness = S(0.3), .damping = random.chance(0.5) ? S(0) : S(0.01)});
        Tool<S> tool;
        for (int tick = 0; tick < 12; ++tick) {
            if (tick % 3 == 0) {  // another tool, which stays for three ticks
                loop.tracker.reset();
                loop.solver.reset();
                tool = {.position = exact_place(loop, random), .radius = random.chance(0.5) ? S(0) : S(0.125)};
                if (random.chance(0.5)) tool.axis = exact_place(loop, random) - tool.position;
            }
            const Index v = random.index(mesh.vertex_count());
            const Vector3<S> anchor = point(loop.foundation.anchors(), v);
            REQUIRE(loop.tick(tool, pull(v, anchor)).status == StepStatus::advanced);
        }
    }
}

// ---- degenerate triangles, springs without length

namespace {

/// A sphere or a sheet, some vertices of which lie all but, or exactly, on a neighbour or on the line between two.
template <class S>
test::Surface<S> crushed_surface(Random& random) {
    auto surface = test::surface_of(random.chance(0.5) ? unit_sphere<S>(1)
                                                       : sheet<S>({.width = 1, .height = 1, .columns = 4, .rows = 4}));
    for (int i = 1 + random.index(6); i > 0; --i) {
        const Index f = random.index(surface.triangle_count());
        const Index a = surface.triangles(0, f), b = surface.triangles(1, f), c = surface.triangles(2, f);
        const S height = random.chance(0.2) ? S(0) : static_cast<S>(std::pow(10, random.number(-30.0, 0.0)));
        const S along = random.chance(0.5) ? S(0) : random.number<S>();
        const Vector3<S> base = (1 - along) * surface.x.col(a) + along * surface.x.col(b);
        surface.x.col(c) = base + height * (surface.x.col(c) - base);
    }
    return surface;
}

}  // namespace

TEMPLATE_TEST_CASE("triangles of next to no height and springs of no length divide nothing by zero", "[extremes]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = crushed_surface<S>(random).mesh();
        GuardedLoop<S> loop(mesh, {.stiffness = S(1)}, {.stiffness = S(0.3), .damping = S(0.01)},
                            {.sweeps = 1 + random.index(4)});
        VertexNormals<S> normals(mesh);
        Tool<S> tool{.position = {0, 0, 2}, .radius = random.chance(0.3) ? S(0) : random.number<S>(0, S(0.3))};
        if (random.chance(0.3)) tool.axis = random.vector<S>();
        const Index near = random.index(mesh.vertex_count()), f = random.index(mesh.triangle_count());
        for (int tick = 0; tick < 12; ++tick) {
            const S above = S(0.3) - S(0.05) * static_cast<S>(tick);
            tool.position = (1 + above) * point(mesh.positions(), near) + Vector3<S>(0, 0, above);
            const Vector3<S> place = point(mesh.positions(), corners_of(mesh, f)[1]) + Vector3<S>(0, 0, S(0.1));
            const auto report =
                loop.tick(tool, PointAttachment<S>{f, corners_of(mesh, f), random.barycentric<S>(), place},
                          load<S>(corners_of(mesh, random.index(mesh.triangle_count())), random.barycentric<S>(),
                                  S(0.1) * random.vector<S>()));
            REQUIRE(report.status == StepStatus::advanced);
            const test::FloatingPointTraps armed;
            normals.update(loop.x, report.moved);
        }
        REQUIRE(is_finite(normals.values()));
    }
}

TEMPLATE_TEST_CASE(
    "a surface whose every triangle has next to no height is refused by name, or divides nothing by zero", "[extremes]",
    TEST_SCALARS) {
    using S = TestType;
    int refused = 0, accepted = 0;
    for (int seed = 1; seed <= cases(240, 20'000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::surface_of(sheet<S>({.width = 1, .height = 1, .columns = 3, .rows = 3}));
        const double height = std::pow(10, random.number(-30.0, 0.0));
        surface.x.row(1) *= static_cast<S>(height);
        std::string message;
        {
            const test::FloatingPointTraps traps;
            message = test::refusal([&] { (void)surface.mesh(); });
        }
        if (!message.empty()) {
            ++refused;
            REQUIRE(message == "TriangleMesh: all vertices of each triangle are on one line, expected a surface");
            REQUIRE(height < 64 * static_cast<double>(std::numeric_limits<S>::epsilon()));
            continue;
        }
        ++accepted;
        GuardedLoop<S> loop(surface.mesh(), {.stiffness = S(1)}, {.stiffness = S(0.3), .damping = S(0.01)});
        Tool<S> tool{.position = {0, 0, S(0.3)}, .radius = random.chance(0.3) ? S(0) : S(0.1)};
        for (int tick = 0; tick < 8; ++tick) {
            tool.position += S(0.05) * random.vector<S>() - Vector3<S>(0, 0, S(0.05));
            REQUIRE(loop.tick(tool).status == StepStatus::advanced);
        }
    }
    CHECK(refused > 0);
    CHECK(accepted > 0);
}
