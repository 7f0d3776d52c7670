// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"
#include "support/run_to_equilibrium.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

// A rule that has nothing to remember takes no memory.
static_assert(sizeof(QuasiStaticSolver<double, MassStep>) + sizeof(double) ==
              sizeof(QuasiStaticSolver<double, SafeStep>));

template <class S>
using Linear = MassSpringNetwork<S, LinearSpring>;

std::set<Index> set_of(std::span<const Index> vertices) { return {vertices.begin(), vertices.end()}; }

/// A unit sphere of 162 vertices with its foundation.
template <class S>
struct Sphere {
    TriangleMesh<S> mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
    Linear<S> network{mesh, LinearSpring{}, NetworkOptions<S>{.stiffness = S(1), .mass = S(1)}};
    VirtualVolumeSprings<S> foundation{mesh, VolumeSpringOptions<S>{.stiffness = S(0.5)}};

    Vector3<S> raised(Index v, S by) const { return (1 + by) * point(mesh.positions(), v); }
    /// Largest force on a vertex that is not in `held`.
    S residual(const Points<S>& x, const std::set<Index>& held = {}) const {
        S largest = 0;
        for (Index v = 0; v < 162; ++v) {
            if (held.count(v) > 0) continue;
            const auto springs = network.force_on(v, x).force;
            largest =
                std::max(largest, norm<S>(springs + foundation.force_on(v, point(x, v), point(x, v), S(1)).force));
        }
        return largest;
    }
};

}  // namespace

// ---- (4) is (4)

TEST_CASE("one sweep moves a chain as (4) says, vertex by vertex in the queue's order", "[solver]") {
    // Of a strip of triangles only the springs along its lower side are there: 0 - 1 - 2 - 3 - 4.
    const auto mesh = sheet({.width = 4, .height = 1, .columns = 4, .rows = 1});
    const Adjacency adjacency(mesh);
    const std::array<double, 4> stiffness{30, 20, 50, 40};  // of spring v - (v + 1)
    std::vector<double> all;
    for (const auto& [first, second] : adjacency.edges()) {
        all.push_back(second == first + 1 && second < 5 ? stiffness[static_cast<std::size_t>(first)] : 0);
    }
    std::vector<double> mass(10, 1.0);
    const std::array<double, 5> chain_mass{2, 3, 4, 5, 6};
    std::copy(chain_mass.begin(), chain_mass.end(), mass.begin());
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = all, .mass = mass});
    REQUIRE(network.springs().size() == 4);

    const double dt = 0.2;
    Points<double> x = mesh.positions();  // one unit apart along x
    QuasiStaticSolver solver(network, {.layers = 3, .sweeps = 1, .force_tolerance = 1e-300}, MassStep{});
    // Vertex 0 is held half a unit along the chain: spring 0 - 1 pushes.
    const Vector3<double> target = point(x, 0) + Vector3<double>(0.5, 0, 0);
    const auto report = solver.step(x, dt, network, NoFoundation{}, pull(0, target));
    CHECK(set_of(solver.queue().vertices()) == std::set<Index>{0, 1, 2, 3});

    // Vertex 1 sees 0 where it is held and 2 at rest: F = 30 * 0.5. Each next one sees what came before it.
    const double d1 = dt * dt / 3 * (30 * 0.5);
    const double d2 = dt * dt / 4 * (20 * d1);
    const double d3 = dt * dt / 5 * (50 * d2);
    CHECK(d1 == Approx(0.2));
    CHECK(d2 == Approx(0.04));
    CHECK(d3 == Approx(0.016));
    const std::array<double, 5> expected{0.5, d1, d2, d3, 0};
    for (Index v = 0; v < 5; ++v) {
        CAPTURE(v);
        CHECK(x(0, v) - mesh.positions()(0, v) ==
              Approx(expected[static_cast<std::size_t>(v)]).epsilon(1e-14).margin(1e-15));
        CHECK(x(1, v) == mesh.positions()(1, v));
        CHECK(x(2, v) == 0);
    }
    for (Index v = 4; v < 10; ++v) CHECK(point(x, v) == point(mesh.positions(), v));
    CHECK(report.status == StepStatus::advanced);
    CHECK_FALSE(report.converged);
    CHECK(set_of(report.moved) == std::set<Index>{0, 1, 2, 3});
    CHECK(report.vertex_updates == 3 + 4);  // the free three, and the final residuals of all four
    // What is left: 0 - 1 is short by 0.3, 1 - 2 by 0.16, 2 - 3 by 0.024, and 3 - 4 by 0.016.
    CHECK(report.reactions[0].x() == Approx(-30 * (0.5 - d1)));
    CHECK(report.residual == Approx(std::max({30 * (0.5 - d1) - 20 * (d1 - d2), 20 * (d1 - d2) - 50 * (d2 - d3),
                                              50 * (d2 - d3) - 40 * d3})));
}

namespace {

/// The published method written down once more: one vertex after the other, `sweeps` times, by F times what
/// `compliance(v, pull)` says.
template <class S, class Volume, class Compliance>
void sweep_by_hand(Points<S>& x, S dt, const Linear<S>& network, const Volume& volume, std::span<const Index> order,
                   const std::set<Index>& held, int sweeps, Compliance compliance) {
    const Points<S> start = x;
    for (int i = 0; i < sweeps; ++i) {
        for (const Index v : order) {
            if (held.count(v) > 0) continue;
            Vector3<S> force(0, 0, 0);
            S stiffness = 0;
            for (const auto& end : network.springs_of(v)) {
                const Vector3<S> edge = point(x, end.other) - point(x, v);
                const S length = norm(edge), tension = end.stiffness * (length - end.rest_length);
                force += tension / length * edge;
                stiffness += std::max(end.stiffness, tension / length);
            }
            const auto foundation = volume.force_on(v, point(x, v), point(start, v), dt);
            x.col(v) += compliance(v, stiffness + foundation.stiffness) * (force + foundation.force);
        }
    }
}

}  // namespace

TEMPLATE_TEST_CASE("a step is the sweeps over the queue, with either rule", "[solver]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
        std::vector<S> mass(162);
        for (S& m : mass) m = random.number<S>(4, 6);
        const Linear<S> network(mesh, LinearSpring{}, {.stiffness = S(1), .mass = mass, .pinned = {random.index(162)}});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = S(0.5), .damping = S(0.2)});
        const S dt = S(0.8), omega = random.number<S>(S(0.5), S(1.9));
        const Index layers = 1 + random.index(5), sweeps = 1 + random.index(4);
        const Index v = random.index(162), w = random.index(162);
        if (network.pinned(v) || network.pinned(w)) continue;
        const SolverOptions<S> options{.layers = layers, .sweeps = sweeps, .force_tolerance = S(1e-30)};
        const Points<S> x0 = test::jittered(mesh.positions(), S(0.02), random);
        const Vector3<S> target = point(x0, v) + S(0.2) * random.vector<S>();
        const Vector3<S> other = point(x0, w) + S(0.2) * random.vector<S>();
        const auto check = [&](auto solver, auto compliance) {
            Points<S> x = x0, expected = x0;
            const auto report = solver.step(x, dt, network, foundation, pull(v, target), pull(w, other));
            REQUIRE(report.status == StepStatus::advanced);
            expected.col(v) = target;
            expected.col(w) = other;
            std::vector<Index> order;
            for (const Index u : solver.queue().vertices()) order.push_back(u);
            // The damping is measured from where vertices were before the step: for the held ones, too, but they do
            // not move in a sweep.
            sweep_by_hand<S>(expected, dt, network, foundation, order, {v, w}, sweeps, compliance);
            REQUIRE((x - expected).cwiseAbs().maxCoeff() <= 100 * std::numeric_limits<S>::epsilon());
        };
        check(QuasiStaticSolver(network, options, MassStep{}), [&](Index u, S) { return dt * dt / network.mass(u); });
        check(QuasiStaticSolver(network, options, SafeStep{.omega = static_cast<double>(omega)}),
              [&](Index, S stiffness) { return omega / stiffness; });
    }
}

// ---- the queue at work

TEST_CASE("in a step from rest nothing outside the queue moves by a bit", "[solver][queue]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<double>(random);
        const auto mesh = surface.mesh();
        std::vector<double> stiffness(edges(mesh).size(), 1.0);
        for (double& k : stiffness) {
            if (random.chance(0.1)) k = 0;
        }
        const Linear<double> network(mesh, LinearSpring{}, {.stiffness = stiffness});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5});
        QuasiStaticSolver solver(network, {.layers = random.index(4), .sweeps = 1 + random.index(5)});
        const Index v = random.index(mesh.vertex_count()), w = random.index(mesh.vertex_count());
        const double size = (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();
        Points<double> x = mesh.positions();
        const auto report =
            solver.step(x, 1e-3, network, foundation, pull(v, point(x, v) + 0.1 * size * random.vector()),
                        pull(w, point(x, w) + 0.1 * size * random.vector()));
        REQUIRE(report.status == StepStatus::advanced);
        // Two seeds in one queue; what is said to have moved is what has.
        const auto seeds = solver.queue().layer(0);
        REQUIRE(set_of(seeds) == std::set<Index>{v, w});
        const auto moved = set_of(report.moved);
        REQUIRE(moved.size() == report.moved.size());
        for (Index u = 0; u < mesh.vertex_count(); ++u) {
            const bool same = std::memcmp(x.data() + 3 * u, mesh.positions().data() + 3 * u, 3 * sizeof(double)) == 0;
            REQUIRE(same == (moved.count(u) == 0));
            if (!solver.queue().contains(u)) REQUIRE(same);
        }
    }
}

TEST_CASE("at rest nothing is visited and nothing moves", "[solver][queue]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network, {.layers = 4, .sweeps = 4});
    Points<double> x = sphere.mesh.positions();
    const auto untouched = solver.step(x, 1e-3, sphere.network, sphere.foundation);
    CHECK(untouched.converged);
    CHECK(untouched.vertex_updates == 0);
    CHECK(untouched.residual == 0);

    const Vector3<double> target = sphere.raised(7, 0.2);
    REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation, pull(7, target)).converged);
    // Held still, the queue is evaluated and nothing moves.
    Points<double> before = x;
    for (int i = 0; i < 10; ++i) {
        const auto held = solver.step(x, 1e-3, sphere.network, sphere.foundation, pull(7, target));
        CHECK(held.converged);
        CHECK(held.moved.empty());
        CHECK(held.vertex_updates <= 2 * static_cast<Index>(solver.queue().vertices().size()));
        CHECK(same_bits(x, before));
    }
    // Let go, it comes back to rest, and then costs nothing.
    CHECK_FALSE(solver.step(x, 1e-3, sphere.network, sphere.foundation).converged);
    REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation).converged);
    CHECK(sphere.residual(x) <= sphere.network.force_tolerance());
    before = x;
    for (int i = 0; i < 10; ++i) {
        const auto rest = solver.step(x, 1e-3, sphere.network, sphere.foundation);
        CHECK(rest.converged);
        CHECK(rest.vertex_updates == 0);
        CHECK(rest.moved.empty());
        CHECK(same_bits(x, before));
    }
}

TEST_CASE("what a moving seed leaves behind relaxes completely", "[solver][queue]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere<double> sphere;
        const Index max_vertex_updates = random.chance(0.5) ? unlimited : 200 + random.index(500);
        CAPTURE(max_vertex_updates);
        QuasiStaticSolver solver(
            sphere.network,
            {.layers = random.index(5), .sweeps = 1 + random.index(4), .max_vertex_updates = max_vertex_updates},
            SafeStep{.omega = random.number(0.8, 1.8)});
        Points<double> x = sphere.mesh.positions();
        // A path over the mesh, from neighbour to neighbour, a few ticks at each vertex.
        Index v = random.index(162);
        for (int i = 0; i < 40; ++i) {
            for (int tick = random.index(3); tick >= 0; --tick) {
                const auto report =
                    solver.step(x, 1e-3, sphere.network, sphere.foundation, pull(v, sphere.raised(v, -0.2)));
                REQUIRE(report.status == StepStatus::advanced);
            }
            const auto ends = sphere.network.springs_of(v);
            v = ends[static_cast<std::size_t>(random.index(static_cast<Index>(ends.size())))].other;
        }
        const auto report = test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation);
        REQUIRE(report.converged);
        // A vertex that no layer ever reached may have a little from each of its neighbours.
        REQUIRE(sphere.residual(x) <= 6 * sphere.network.force_tolerance());
        REQUIRE((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-7);
        REQUIRE(solver.step(x, 1e-3, sphere.network, sphere.foundation).vertex_updates == 0);
    }
}

TEST_CASE("a load or a held point that is taken away leaves nothing behind", "[solver][queue]") {
    const Sphere<double> sphere;
    const std::array<Index, 3> corners{sphere.mesh.triangles()(0, 5), sphere.mesh.triangles()(1, 5),
                                       sphere.mesh.triangles()(2, 5)};
    const Vector3<double> weights(0.2, 0.3, 0.5);
    const auto place = point_at(triangle_at(sphere.mesh.positions(), corners), weights);
    const auto check = [&](const auto& constraint) {
        QuasiStaticSolver solver(sphere.network, {.layers = 3, .sweeps = 4});
        Points<double> x = sphere.mesh.positions();
        REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation, constraint).converged);
        REQUIRE((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() > 0.01);
        REQUIRE_FALSE(solver.step(x, 1e-3, sphere.network, sphere.foundation).converged);
        REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation).converged);
        REQUIRE((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-7);
    };
    check(load<double>(corners, weights, 0.2 * place));
    check(PointAttachment<double>{5, corners, weights, 1.2 * place});
}

TEST_CASE("a step updates no more than it may, and its seeds in any case", "[solver][queue]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere<double> sphere;
        const Index sweeps = 1 + random.index(5), most = 1 + random.index(300);
        QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = sweeps, .max_vertex_updates = most});
        Points<double> x = sphere.mesh.positions();
        for (int i = 0; i < 30; ++i) {
            const Index v = random.index(162), w = random.index(162);
            const auto report = solver.step(x, 1e-3, sphere.network, sphere.foundation, pull(v, sphere.raised(v, 0.1)),
                                            pull(w, sphere.raised(w, -0.1)));
            REQUIRE(report.status == StepStatus::advanced);
            REQUIRE(report.vertex_updates <= std::max(most, 3 * (sweeps + 1)));
            REQUIRE(point(x, w) == sphere.raised(w, -0.1));
        }
        int ticks = 0;
        for (bool done = false; !done; ++ticks) {
            REQUIRE(ticks < 1'000'000);
            const auto report = solver.step(x, 1e-3, sphere.network, sphere.foundation);
            REQUIRE(report.vertex_updates <= std::max(most, sweeps + 1));
            done = report.converged;
        }
        REQUIRE((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-7);
    }
}

TEST_CASE("what layer 0 is visited more often is taken off the rest", "[solver][queue]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere<double> sphere;
        const Index sweeps = 1 + random.index(5), iterations = 1 + random.index(6), most = 1 + random.index(500);
        QuasiStaticSolver solver(
            sphere.network,
            {.layers = unlimited, .sweeps = sweeps, .contact_iterations = iterations, .max_vertex_updates = most});
        Points<double> x = sphere.mesh.positions();
        const auto triangle = sphere.mesh.triangles().col(random.index(320));
        const std::array<Index, 3> corners{triangle[0], triangle[1], triangle[2]};
        for (int i = 0; i < 30; ++i) {
            const auto report = solver.step(x, 1e-3, sphere.network, sphere.foundation,
                                            load<double>(corners, random.barycentric(), 0.1 * random.vector()));
            REQUIRE(report.status == StepStatus::advanced);
            REQUIRE(report.vertex_updates <= std::max(most, 3 * (sweeps * iterations + 1) + sweeps + 1));
        }
    }
}

TEST_CASE("a step that may not visit all of its queue does not call it converged", "[solver][queue]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 4, .max_vertex_updates = 100});
    Points<double> x = sphere.mesh.positions();
    for (int i = 0; i < 2000; ++i) {
        const auto report = solver.step(x, 1e-3, sphere.network, sphere.foundation, pull(3, sphere.raised(3, 0.2)));
        if (report.converged) REQUIRE(sphere.residual(x, {3}) <= sphere.network.force_tolerance());
    }
    // What it left undone is not forgotten when the seed goes.
    REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation).converged);
    CHECK((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-7);
}

TEST_CASE("converged says that no vertex that may move is out of balance", "[solver]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere<double> sphere;
        QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 1 + random.index(20)},
                                 SafeStep{.omega = random.number(0.5, 1.9)});
        Points<double> x = sphere.mesh.positions();
        for (int i = 0; i < 400; ++i) {
            const Index v = (i / 200) * 50;
            const auto report = solver.step(x, 1e-3, sphere.network, sphere.foundation, pull(v, sphere.raised(v, 0.2)));
            const double residual = sphere.residual(x, {v});
            REQUIRE(report.residual == Approx(residual).margin(1e-15));
            if (report.converged) REQUIRE(residual <= sphere.network.force_tolerance());
        }
        const auto hold = pull(50, sphere.raised(50, 0.2));
        REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation, hold).converged);
        for (int i = 0; i < 10; ++i) {
            REQUIRE(solver.step(x, 1e-3, sphere.network, sphere.foundation, hold).converged);
        }
    }
}

TEST_CASE("vertices are woken by name, or all at once", "[solver]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network, {.layers = 0, .sweeps = 4});
    Points<double> x = sphere.mesh.positions();
    x.col(9) *= 1.1;
    CHECK(solver.step(x, 1e-3, sphere.network, sphere.foundation).vertex_updates == 0);  // it has not been woken
    const std::vector<Index> moved{9};
    solver.wake(moved);
    CHECK(solver.step(x, 1e-3, sphere.network, sphere.foundation).vertex_updates > 0);
    // Its neighbours were never evaluated; to have them follow, wake them.
    solver.wake_all();
    REQUIRE(test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation).converged);
    CHECK((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-7);
    x.col(9) *= 1.1;
    solver.wake_all();
    solver.reset();
    CHECK(solver.step(x, 1e-3, sphere.network, sphere.foundation).vertex_updates == 0);
    CHECK(solver.queue().vertices().empty());
}

TEST_CASE("what is remembered is a cache: to drop it changes no equilibrium", "[solver]") {
    const Sphere<double> sphere;
    const SolverOptions<double> options{.layers = unlimited, .sweeps = 10, .force_tolerance = 1e-13};
    QuasiStaticSolver first(sphere.network, options), second(sphere.network, options);
    Points<double> x = sphere.mesh.positions(), y = x;
    const std::array<Index, 3> corners{sphere.mesh.triangles()(0, 5), sphere.mesh.triangles()(1, 5),
                                       sphere.mesh.triangles()(2, 5)};
    const PointAttachment<double> held{
        5, corners, {0.2, 0.3, 0.5}, 1.2 * point_at(triangle_at(x, corners), {0.2, 0.3, 0.5})};
    const auto report = test::run_to_equilibrium(first, x, 1e-3, sphere.network, sphere.foundation, held);
    REQUIRE(report.converged);
    StepReport<double> other;
    for (int i = 0; i < 2000; ++i) {
        if (i < 500 && i % 7 == 0) second.reset();
        other = second.step(y, 1e-3, sphere.network, sphere.foundation, held);
    }
    REQUIRE(other.converged);
    CHECK((x - y).cwiseAbs().maxCoeff() < 1e-11);
    CHECK(norm<double>(report.reactions[0] - other.reactions[0]) < 1e-11);
}

// ---- time

TEST_CASE("a single vertex recovers in the time k_d / k_v, whatever the number of sweeps", "[solver][damping]") {
    const double k = 8, d = 0.02, dt = 1e-3;
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const Linear<double> network(mesh, LinearSpring{}, {.stiffness = 0.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = k, .damping = d});
    const Vector3<double> displacement(0.03, -0.05, 0.08);
    for (const double omega : {1.0, 1.5}) {
        for (const Index sweeps : {1, 2, 5, 50}) {
            if (omega != 1 && sweeps < 50) continue;  // only the exact step needs no second one
            CAPTURE(omega, sweeps);
            QuasiStaticSolver solver(network, {.layers = 2, .sweeps = sweeps, .force_tolerance = 1e-15},
                                     SafeStep{.omega = omega});
            Points<double> x = mesh.positions();
            x.col(5) += displacement;
            solver.wake_all();
            double expected = 1;
            for (int tick = 0; tick < 20; ++tick) {
                (void)solver.step(x, dt, network, foundation);
                expected /= 1 + k * dt / d;  // the closed form of implicit Euler
                const Vector3<double> left = point(x, 5) - point(mesh.positions(), 5);
                REQUIRE(norm<double>(left - expected * displacement) < 1e-12);
            }
        }
    }
}

TEST_CASE("a whole membrane recovers in that time, too, and completely", "[solver][damping]") {
    // All vertices are off by the same displacement: no spring has a tension. The damping of (5) leaves them free to
    // turn about their anchors, so that within a tick the sweeps come near to this and no further.
    const double k = 8, d = 0.02, dt = 1e-3;
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const Linear<double> network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = k, .damping = d});
    const Vector3<double> displacement(0.03, -0.05, 0.08);
    QuasiStaticSolver solver(network, {.layers = 2, .sweeps = 100, .force_tolerance = 1e-12});
    Points<double> x = mesh.positions().colwise() + displacement.eigen();
    solver.wake_all();
    double expected = 1;
    for (int tick = 0; tick < 40; ++tick) {
        (void)solver.step(x, dt, network, foundation);
        expected /= 1 + k * dt / d;
        REQUIRE((x - (mesh.positions().colwise() + (expected * displacement).eigen())).cwiseAbs().maxCoeff() <
                2e-3 * norm(displacement));
    }
    const auto report = test::run_to_equilibrium(solver, x, dt, network, foundation);
    REQUIRE(report.converged);
    CHECK((x - mesh.positions()).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("damping delays what is left behind, and does not keep it from coming back", "[solver][damping]") {
    for (const Index sweeps : {2, 50}) {
        CAPTURE(sweeps);
        const Sphere<double> sphere;
        const VirtualVolumeSprings damped(sphere.mesh, {.stiffness = 0.5, .damping = 0.05});
        QuasiStaticSolver solver(sphere.network, {.layers = 3, .sweeps = sweeps});
        Points<double> x = sphere.mesh.positions();
        for (int i = 0; i < 100; ++i) {
            (void)solver.step(x, 1e-3, sphere.network, damped, pull(7, sphere.raised(7, 0.2)));
        }
        double displacement = 1;
        for (int i = 0; i < 20'000; ++i) {
            const auto report = solver.step(x, 1e-3, sphere.network, damped);
            const double now = (x - sphere.mesh.positions()).norm();
            REQUIRE(now <= displacement + 1e-12);
            displacement = now;
            if (report.converged) break;
        }
        CHECK(displacement < 1e-6);
    }
}

// ---- refusals

namespace {

/// Runs a step on a membrane that is being deformed, beside another that is spared it: the positions stay as they were,
/// and both go on to the same bits.
template <class S, class Rule, class Step>
StepStatus status_of_refused(const Sphere<S>& sphere, QuasiStaticSolver<S, Rule> solver, Step bad_step) {
    Points<S> x = sphere.mesh.positions();
    const auto good_step = [&](auto& the_solver, Points<S>& at) {
        return the_solver.step(at, S(0.1), sphere.network, sphere.foundation, pull(7, sphere.raised(7, S(0.1))));
    };
    for (int i = 0; i < 5; ++i) REQUIRE(good_step(solver, x).status == StepStatus::advanced);
    auto spared = solver;
    Points<S> y = x;
    const StepReport<S> report = bad_step(solver, x);
    REQUIRE(same_bits(x, y));
    REQUIRE(report.moved.empty());
    REQUIRE_FALSE(report.converged);
    for (const auto& reaction : report.reactions) REQUIRE(reaction == Vector3<S>(0, 0, 0));
    for (int i = 0; i < 5; ++i) {
        REQUIRE(good_step(solver, x).status == StepStatus::advanced);
        REQUIRE(good_step(spared, y).status == StepStatus::advanced);
        REQUIRE(same_bits(x, y));
    }
    return report.status;
}

/// A constraint of each kind that makes sense; all in one step, so that a step is compiled once for them.
template <class S>
struct OneOfEach {
    VertexAttachment<S> pulled = pull(20, Vector3<S>(1, 1, 1));
    PinnedVertices pinned = pin({});
    PointLoad<S> loaded = load({3, 4, 5}, Vector3<S>(S(0.2), S(0.3), S(0.5)), Vector3<S>(0, 0, S(0.01)));
    PointAttachment<S> held{};
    ToolContact<S> pressed = press(Tool<S>{.position = {0, 0, 2}, .radius = S(0.1)}, Contact<S>::none());

    void take(const VertexAttachment<S>& other) { pulled = other; }
    void take(const PinnedVertices& other) { pinned = other; }
    void take(const PointLoad<S>& other) { loaded = other; }
    void take(const PointAttachment<S>& other) { held = other; }
    void take(const ToolContact<S>& other) { pressed = other; }
};

}  // namespace

TEMPLATE_TEST_CASE("a bad time step is refused, and nothing has moved", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const Sphere<S> sphere;
    for (const S dt : {S(0), -S(0), S(-1e-3), Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        CAPTURE(dt);
        CHECK(status_of_refused(sphere, QuasiStaticSolver(sphere.network), [&](auto& solver, Points<S>& x) {
                  return solver.step(x, dt, sphere.network, sphere.foundation, pull(3, sphere.raised(3, S(0.1))));
              }) == StepStatus::bad_time_step);
    }
}

TEMPLATE_TEST_CASE("a step whose residual force is beyond the range of numbers is refused, and nothing has moved",
                   "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    const Sphere<S> sphere;
    const VirtualVolumeSprings<S> damped(sphere.mesh, {.stiffness = S(8), .damping = S(0.02)});
    int refused = 0;
    for (S dt = (std::numeric_limits<S>::min)(); dt < S(1e-3); dt *= 10) {
        CAPTURE(dt);
        QuasiStaticSolver solver(sphere.network);
        AabbTree<S> tree(sphere.mesh);
        ContactTracker<S> tracker(sphere.mesh);
        Points<S> x = sphere.mesh.positions();
        for (int i = 1; i <= 5; ++i) {
            const Points<S> before = x;
            const Tool<S> tool{.position = S(1 - 0.02 * i) * point(sphere.mesh.positions(), 5), .radius = S(0.05)};
            const auto report = solver.step(x, dt, sphere.network, damped, press(tool, tracker.update(tree, x, tool)));
            tree.refit(x);
            REQUIRE(std::isfinite(report.residual));
            REQUIRE(is_finite(report.reactions[0]));
            REQUIRE(is_finite(x));
            if (report.status == StepStatus::advanced) continue;
            REQUIRE(report.status == StepStatus::unstable);
            REQUIRE(x == before);
            ++refused;
        }
    }
    CHECK(refused > 0);
}

TEMPLATE_TEST_CASE("constraints that make no sense are refused, and nothing has moved", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const Sphere<S> sphere;
    const auto step = [&](auto& solver, Points<S>& x, const OneOfEach<S>& all) {
        return solver.step(x, S(0.1), sphere.network, sphere.foundation, pull(3, sphere.raised(3, S(0.1))), all.pulled,
                           all.pinned, all.loaded, all.held, all.pressed);
    };
    QuasiStaticSolver spared(sphere.network);
    Points<S> y = sphere.mesh.positions();
    REQUIRE(step(spared, y, OneOfEach<S>()).status == StepStatus::advanced);
    const auto refused = [&](const auto& constraint) {
        OneOfEach<S> all;
        all.take(constraint);
        return status_of_refused(sphere, QuasiStaticSolver(sphere.network), [&](auto& solver, Points<S>& x) {
                   return step(solver, x, all);
               }) == StepStatus::invalid_input;
    };
    const Vector3<S> inside(S(0.2), S(0.3), S(0.5)), somewhere(1, 1, 1);
    for (const Index wrong :
         {-1, 162, 1'000'000, (std::numeric_limits<Index>::max)(), (std::numeric_limits<Index>::min)()}) {
        CAPTURE(wrong);
        const std::vector<Index> list{5, wrong};
        CHECK(refused(pull(wrong, somewhere)));
        CHECK(refused(pin(list)));
        CHECK(refused(load({3, 4, wrong}, inside, somewhere)));
        CHECK(refused(PointAttachment<S>{0, {wrong, 3, 4}, inside, somewhere}));
    }
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        CAPTURE(bad);
        const Vector3<S> wrong(0, bad, 0);
        CHECK(refused(pull(5, wrong)));
        CHECK(refused(load({3, 4, 5}, inside, wrong)));
        CHECK(refused(load({3, 4, 5}, wrong, somewhere)));
        CHECK(refused(PointAttachment<S>{0, {3, 4, 5}, inside, wrong}));
        CHECK(refused(PointAttachment<S>{0, {3, 4, 5}, wrong, somewhere}));
        CHECK(refused(press(Tool<S>{.position = wrong}, Contact<S>::none())));
        CHECK(refused(press(Tool<S>{.position = somewhere, .velocity = wrong}, Contact<S>::none())));
    }
    CHECK(refused(press(Tool<S>{.position = somewhere, .radius = S(-0.1)}, Contact<S>::none())));
    const Tool<S> tool{.position = {0, 0, S(1.05)}, .radius = S(0.1)};
    ContactTracker<S> tracker(sphere.mesh);
    const auto contact = tracker.update(AabbTree<S>(sphere.mesh), sphere.mesh.positions(), tool);
    REQUIRE(contact.touching());
    const auto refused_with = [&](auto change) {
        auto changed = contact;
        change(changed);
        return refused(press(tool, changed));
    };
    CHECK(refused_with([](auto& c) { c.corners[1] = no_index; }));
    CHECK(refused_with([](auto& c) { c.corners[2] = 162; }));
    CHECK(refused_with([](auto& c) { c.gap = Limits::quiet_NaN(); }));
    CHECK(refused_with([](auto& c) { c.patch.axis_point.x() = Limits::infinity(); }));
    CHECK(refused_with([](auto& c) { c.patch.radius = 0; }));
    const std::vector<ContactTriangle> elsewhere{{0, {0, 1, 162}}};
    CHECK(refused_with([&](auto& c) { c.patch.triangles = elsewhere; }));
    CHECK(refused_with([&](auto& c) { c.patch.candidates = elsewhere; }));
    const std::vector<ContactPoint<S>> points_elsewhere{{0, 0, {0, 1, 162}}};
    CHECK(refused_with([&](auto& c) { c.patch.points = points_elsewhere; }));
    Contact<S> made_up;
    made_up.phase = ContactPhase::ongoing;
    CHECK(refused(press(tool, made_up)));
    CHECK(refused(load({3, 4, 5}, Vector3<S>(S(-0.5), S(1), S(0.5)), somewhere)));
    CHECK(refused(PointAttachment<S>{0, {3, 4, 5}, Vector3<S>(S(0.5), S(0.5), S(0.5)), somewhere}));
}

TEMPLATE_TEST_CASE("positions that are no numbers are refused, and nothing has moved", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const Sphere<S> sphere;
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        for (const Index v : {3, 40, 161}) {
            CAPTURE(bad, v);
            Points<S> x = sphere.mesh.positions();
            x(1, v) = bad;
            const Points<S> before = x;
            QuasiStaticSolver solver(sphere.network, {.layers = unlimited});
            const auto report =
                solver.step(x, S(0.1), sphere.network, sphere.foundation, pull(7, sphere.raised(7, S(0.1))));
            CHECK(report.status == StepStatus::invalid_input);
            CHECK(same_bits(x, before));
        }
    }
}

TEMPLATE_TEST_CASE("a target so far off that forces are no numbers is bad input", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    const Sphere<S> sphere;
    const Vector3<S> far(0, (std::numeric_limits<S>::max)(), 0);
    CHECK(status_of_refused(sphere, QuasiStaticSolver(sphere.network), [&](auto& solver, Points<S>& x) {
              return solver.step(x, S(0.1), sphere.network, sphere.foundation, pull(3, far));
          }) == StepStatus::invalid_input);
}

namespace {

/// A law that a rule takes for soft and that is not: its forces soon leave the range of numbers.
struct Runaway {
    template <Real S>
    [[nodiscard]] SpringResponse<S> operator()(const SpringState<S>& spring) const noexcept {
        const S stretch = spring.length / spring.rest_length - 1;
        const S force = spring.stiffness * std::exp(400 * std::abs(stretch)) * stretch;
        return {force, spring.stiffness, S(0)};
    }
};

}  // namespace

TEMPLATE_TEST_CASE("a rule that runs away is called unstable, and nothing has moved", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    const Sphere<S> sphere;
    const MassSpringNetwork network(sphere.mesh, Runaway{}, NetworkOptions<S>{.stiffness = S(1)});
    QuasiStaticSolver runs_away(network, {.sweeps = 50}, SafeStep{});
    CHECK(status_of_refused(sphere, runs_away, [&](auto& solver, Points<S>& x) {
              return solver.step(x, S(0.1), network, sphere.foundation, pull(3, sphere.raised(3, S(0.02))));
          }) == StepStatus::unstable);
}

namespace {

/// A load whose reaction is made up.
struct Reacting {
    Vector3<double> force;

    bool valid() const noexcept { return true; }
    void begin(ConstraintContext<double>& context) const noexcept { context.seed(3); }
    bool enforce(ConstraintContext<double>&) const noexcept { return false; }
    Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return force; }
};

}  // namespace

TEST_CASE("a reaction that is no number refuses the step, and no reaction is reported", "[solver][bad]") {
    const Sphere<double> sphere;
    const Reacting finite{{1, 2, 3}}, broken{{0, std::numeric_limits<double>::quiet_NaN(), 0}};
    CHECK(status_of_refused(sphere, QuasiStaticSolver(sphere.network), [&](auto& solver, Points<double>& x) {
              const auto report = solver.step(x, 0.1, sphere.network, sphere.foundation, finite, broken);
              REQUIRE(report.reactions.size() == 2);
              for (const auto& reaction : report.reactions) CHECK(reaction == Vector3<double>(0, 0, 0));
              return report;
          }) == StepStatus::unstable);
}

TEST_CASE("waking what is no vertex wakes no vertex", "[solver][bad]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network);
    solver.wake(std::vector<Index>{-1, 162, std::numeric_limits<Index>::max(), std::numeric_limits<Index>::min()});
    Points<double> x = sphere.mesh.positions();
    CHECK(solver.step(x, 1e-3, sphere.network, sphere.foundation).vertex_updates == 0);
}

TEMPLATE_TEST_CASE("more contact points than the capacity are refused, and nothing has moved", "[solver][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    const Sphere<S> sphere;
    const PointAttachment<S> first{0, {3, 4, 5}, {S(0.2), S(0.3), S(0.5)}, {0, 0, 1}};
    const PointAttachment<S> second{1, {6, 7, 8}, {S(0.2), S(0.3), S(0.5)}, {0, 1, 0}};
    CHECK(status_of_refused(sphere, QuasiStaticSolver(sphere.network, {.max_contact_points = 1}),
                            [&](auto& solver, Points<S>& x) {
                                return solver.step(x, S(0.1), sphere.network, sphere.foundation, first, second);
                            }) == StepStatus::too_many_contact_points);
    QuasiStaticSolver roomy(sphere.network, {.max_contact_points = 2});
    Points<S> x = sphere.mesh.positions();
    CHECK(roomy.step(x, S(0.1), sphere.network, sphere.foundation, first, second).status == StepStatus::advanced);
}

TEMPLATE_TEST_CASE("wild targets come to a safe outcome", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    const Sphere<S> sphere;
    for (const S far :
         {S(1e3), S(1e6), S(1e12), std::sqrt(std::numeric_limits<S>::max()), std::numeric_limits<S>::max()}) {
        CAPTURE(far);
        QuasiStaticSolver solver(sphere.network, {.layers = 4});
        Points<S> x = sphere.mesh.positions();
        for (int i = 0; i < 20; ++i) {
            const Points<S> before = x;
            const auto report =
                solver.step(x, S(0.1), sphere.network, sphere.foundation, pull(7, Vector3<S>(far, 0, far)));
            REQUIRE(is_finite(x));
            REQUIRE(is_finite(report.residual));
            REQUIRE(is_finite(report.reactions[0]));
            if (report.status != StepStatus::advanced) REQUIRE(same_bits(x, before));
        }
        // Let go, it comes back: the foundation is half as stiff as a spring.
        const auto report = test::run_to_equilibrium(solver, x, S(0.1), sphere.network, sphere.foundation);
        REQUIRE(report.status == StepStatus::advanced);
        REQUIRE(is_finite(x));
    }
}

TEMPLATE_TEST_CASE("options out of range are refused by name", "[solver][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const auto mesh = icosphere<S>({.subdivisions = 0});
    const Linear<S> network(mesh, LinearSpring{}, {.stiffness = S(1)});
    const auto refused = [&](const SolverOptions<S>& options) {
        return test::refusal([&] { QuasiStaticSolver solver(network, options); });
    };
    const std::string name = "QuasiStaticSolver: ";
    CHECK(refused({}) == "");
    CHECK(refused({.layers = 0, .sweeps = 1, .max_vertex_updates = 1, .force_tolerance = 0, .max_contact_points = 0}) ==
          "");
    CHECK(refused({.layers = unlimited, .sweeps = 1000, .max_vertex_updates = unlimited}) == "");
    CHECK(refused({.layers = -1}) == name + "layers must be at least 0, got -1");
    CHECK(refused({.sweeps = 0}) == name + "sweeps must be at least 1, got 0");
    CHECK(refused({.sweeps = -4}) == name + "sweeps must be at least 1, got -4");
    CHECK(refused({.max_vertex_updates = 0}) == name + "max_vertex_updates must be at least 1, got 0");
    CHECK(refused({.max_contact_points = -1}) == name + "max_contact_points must be at least 0, got -1");
    const std::string force = name + "force_tolerance must be finite and not negative [N], got ";
    CHECK(refused({.force_tolerance = -1}) == force + "-1");
    CHECK(refused({.force_tolerance = Limits::quiet_NaN()}) == force + "nan");
    CHECK(refused({.force_tolerance = Limits::infinity()}) == force + "inf");
    CHECK(test::refusal([&] { QuasiStaticSolver solver(network, {}, MassStep{}); }) ==
          name + "the rule needs masses [kg], the network has none");
    CHECK(test::refusal([&] { QuasiStaticSolver solver(network, {}, SafeStep{.omega = 2}); }) ==
          "SafeStep: omega must lie between 0 and 2, got 2");
}

TEST_CASE("points, networks and foundations of another count are refused, and the next step is right",
          "[solver][bad]") {
    const Sphere<double> sphere;
    const auto small = icosphere({.subdivisions = 1});
    const Linear<double> other(small, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings under_other(small, {.stiffness = 1.0});
    MovingBody body(small);
    QuasiStaticSolver solver(sphere.network), fresh(sphere.network);
    Points<double> x = sphere.mesh.positions(), fewer = x.leftCols(161), same = x;
    Eigen::MatrixXd rows = x.transpose();
    const auto target = sphere.raised(3, 0.1);
    const auto status = [&](auto&& at, const auto& network, const auto& foundation) {
        const auto report = solver.step(at, 0.1, network, foundation, pull(3, target));
        CHECK(report.moved.empty());
        CHECK(report.reactions[0] == Vector3<double>(0, 0, 0));
        return report.status;
    };
    CHECK(status(fewer, sphere.network, NoFoundation{}) == StepStatus::wrong_vertex_count);
    CHECK(status(rows, sphere.network, NoFoundation{}) == StepStatus::wrong_vertex_count);
    CHECK(status(x, other, NoFoundation{}) == StepStatus::wrong_vertex_count);
    CHECK(status(x, sphere.network, under_other) == StepStatus::wrong_vertex_count);
    CHECK(status(x, sphere.network, on(body, under_other)) == StepStatus::wrong_vertex_count);
    CHECK(rows == sphere.mesh.positions().transpose());
    CHECK(solver.step(x, 0.1, sphere.network, sphere.foundation, pull(3, target)).status == StepStatus::advanced);
    CHECK(fresh.step(same, 0.1, sphere.network, sphere.foundation, pull(3, target)).status == StepStatus::advanced);
    CHECK(same_bits(x, same));
}

TEST_CASE("the report names the constraint at fault", "[solver][bad]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network);
    Points<double> x = sphere.mesh.positions(), wild = x;
    wild(1, 3) = std::nan("");
    const auto good = pull(3, sphere.raised(3, 0.1)), far_away = pull(7, sphere.raised(7, 0.1));
    const auto nowhere = pull(3, Vector3<double>(std::nan(""), 0, 0)), not_there = pull(162, Vector3<double>(0, 0, 1));
    const std::array<Index, 2> vertices{4, -1};
    const auto at_fault = [&](Points<double>& at, const auto&... constraints) {
        const auto report = solver.step(at, 0.1, sphere.network, sphere.foundation, constraints...);
        CHECK((report.status == StepStatus::advanced || report.status == StepStatus::invalid_input));
        return report.invalid_constraint;
    };
    CHECK(at_fault(x, good, far_away) == no_index);
    CHECK(at_fault(x, nowhere, good) == 0);
    CHECK(at_fault(x, good, nowhere) == 1);
    CHECK(at_fault(x, good, far_away, not_there) == 2);
    CHECK(at_fault(x, good, pin(vertices), far_away) == 1);
    CHECK(at_fault(x, good, not_there, nowhere) == 2);  // numbers before vertices
    CHECK(at_fault(wild, good, far_away) == no_index);
}

TEST_CASE("a tolerance in parts of the reactions says converged while a tool moves, and changes nothing else",
          "[solver]") {
    const Sphere<double> sphere;
    const auto run = [&](double relative, int& converged, int& small) {
        QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 4, .relative_tolerance = relative});
        Points<double> x = sphere.mesh.positions();
        for (int i = 1; i <= 60; ++i) {
            const auto report = solver.step(x, 0.1, sphere.network, sphere.foundation,
                                            pull(3, sphere.raised(3, 0.005 * i)), pull(90, sphere.raised(90, -0.1)));
            const double felt = norm(report.reactions[0]) + norm(report.reactions[1]);
            converged += report.converged ? 1 : 0;
            small += report.residual <= 1e-3 * felt ? 1 : 0;
            if (relative > 0) REQUIRE(report.converged == (report.residual <= relative * felt));
        }
        return x;
    };
    int strictly = 0, relatively = 0, small = 0, same_small = 0;
    const auto x = run(0, strictly, small);
    CHECK(same_bits(x, run(1e-3, relatively, same_small)));
    CHECK(strictly == 0);
    CHECK(relatively > 50);
    CHECK(relatively == small);
    CHECK(test::refusal([&] { QuasiStaticSolver(sphere.network, {.relative_tolerance = -1}); }) ==
          "QuasiStaticSolver: relative_tolerance must be finite and not negative [1], got -1");
}

// ---- scale

namespace {

template <class S>
struct Outcome {
    Points<S> x;  // over the mesh's size
    Vector3<S> reaction, other_reaction;
    S residual;
};

/// A membrane of radius `size` whose stiffnesses, dampings and masses are all times `factor`, pulled and loaded.
template <class S, class Rule>
Outcome<S> scaled_run(S factor, S size, const Rule& rule) {
    const auto mesh = icosphere<S>({.radius = static_cast<double>(size), .subdivisions = 2});
    const Linear<S> network(mesh, LinearSpring{}, {.stiffness = factor, .mass = factor / 10});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = S(0.5) * factor, .damping = S(0.05) * factor});
    QuasiStaticSolver solver(network, {.layers = 4, .sweeps = 4}, rule);
    Points<S> x = mesh.positions();
    const Vector3<S> target = S(1.2) * point(x, 7), force = factor * size * Vector3<S>(0, S(0.3), S(0.1));
    const std::array<Index, 3> corners{mesh.triangles()(0, 99), mesh.triangles()(1, 99), mesh.triangles()(2, 99)};
    StepReport<S> report;
    for (int i = 0; i < 40; ++i) {
        report = solver.step(x, S(0.1), network, foundation, pull(7, target),
                             load(corners, Vector3<S>(S(0.25), S(0.25), S(0.5)), force));
        REQUIRE(report.status == StepStatus::advanced);
    }
    return {x / size, report.reactions[0] / (factor * size), report.reactions[1] / (factor * size),
            report.residual / (factor * size)};
}

template <class S, class Rule>
void check_scales(const Rule& rule) {
    const S tolerance = sizeof(S) == 4 ? S(1e-4) : S(1e-9);
    const auto expected = scaled_run<S>(1, 1, rule);
    const auto check = [&](S factor, S size) {
        CAPTURE(factor, size);
        const auto found = scaled_run(factor, size, rule);
        CHECK((found.x - expected.x).cwiseAbs().maxCoeff() <= tolerance);
        CHECK(norm<S>(found.reaction - expected.reaction) <= tolerance * norm(expected.reaction));
        CHECK(norm<S>(found.other_reaction - expected.other_reaction) <= tolerance * norm(expected.other_reaction));
        CHECK(std::abs(found.residual - expected.residual) <= tolerance);
    };
    for (const S factor : {S(1e-12), S(1e-6), S(1e-3), S(7), S(1e3), S(1e6), S(1e12)}) check(factor, 1);
    for (const S size : {S(1e-6), S(1e-3), S(0.013), S(1e3), S(1e6)}) check(1, size);
}

}  // namespace

TEMPLATE_TEST_CASE("stiffer or larger, it is the same membrane", "[solver]", TEST_SCALARS) {
    SECTION("safe steps") { check_scales<TestType>(SafeStep{.omega = 1.3}); }
    SECTION("the rule as published") { check_scales<TestType>(MassStep{}); }
}

// ---- copies

namespace {

/// All of a user's parts.
struct Parts {
    Sphere<double> sphere;
    VirtualVolumeSprings<double> damped{sphere.mesh, VolumeSpringOptions<double>{.stiffness = 0.5, .damping = 0.05}};
    QuasiStaticSolver<double> solver{sphere.network, SolverOptions<double>{.layers = 3, .sweeps = 3}};
    Points<double> x = sphere.mesh.positions();
    Index at = 0;

    void tick() {
        const std::array<Index, 3> corners{sphere.mesh.triangles()(0, at % 320), sphere.mesh.triangles()(1, at % 320),
                                           sphere.mesh.triangles()(2, at % 320)};
        const Vector3<double> weights(0.2, 0.3, 0.5);
        const auto place = point_at(triangle_at(sphere.mesh.positions(), corners), weights);
        const PointAttachment<double> held{at % 320, corners, weights, 1.1 * place};
        const Index v = (7 * at) % 162;
        (void)solver.step(x, 1e-3, sphere.network, damped, held, pull(v, sphere.raised(v, -0.1)));
        ++at;
    }
};

}  // namespace

TEST_CASE("parts that are copied and moved run on to the same bits", "[solver]") {
    auto original = std::make_unique<Parts>();
    Parts reference;
    for (int i = 0; i < 20; ++i) original->tick(), reference.tick();
    Parts copy = *original;
    Parts moved = std::move(*original);
    original.reset();
    Parts assigned;
    assigned = copy;
    for (int i = 0; i < 50; ++i) {
        for (Parts* scene : {&reference, &copy, &moved, &assigned}) scene->tick();
        REQUIRE(same_bits(copy.x, reference.x));
        REQUIRE(same_bits(moved.x, reference.x));
        REQUIRE(same_bits(assigned.x, reference.x));
    }
}

TEST_CASE("two membranes share nothing", "[solver]") {
    Parts alone, other_alone;
    other_alone.at = 55;
    for (int i = 0; i < 60; ++i) alone.tick();
    for (int i = 0; i < 60; ++i) other_alone.tick();
    Parts first, second;
    second.at = 55;
    for (int i = 0; i < 60; ++i) first.tick(), second.tick();
    CHECK(same_bits(first.x, alone.x));
    CHECK(same_bits(second.x, other_alone.x));
}

TEST_CASE("a step works in anybody's memory and touches nothing else there", "[solver]") {
    const Sphere<float> sphere;
    std::vector<float> buffer(8 * 162, -7.0F);
    Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> y(buffer.data(), 3, 162, Eigen::OuterStride<>(8));
    y = sphere.mesh.positions();
    Points<float> x = sphere.mesh.positions();
    QuasiStaticSolver first(sphere.network), second(sphere.network);
    for (int i = 0; i < 20; ++i) {
        (void)first.step(x, 0.1F, sphere.network, sphere.foundation, pull(7, sphere.raised(7, 0.1F)));
        (void)second.step(y, 0.1F, sphere.network, sphere.foundation, pull(7, sphere.raised(7, 0.1F)));
    }
    CHECK(same_bits(x, Points<float>(y)));
    for (std::size_t i = 0; i < buffer.size(); ++i) {
        if (i % 8 >= 3) REQUIRE(buffer[i] == -7.0F);
    }
}

TEST_CASE("sixteen constraints act in one step", "[solver]") {
    const Sphere<double> sphere;
    QuasiStaticSolver solver(sphere.network, {.layers = 1});
    Points<double> x = sphere.mesh.positions();
    const auto at = [&](Index v) { return pull(v, sphere.raised(v, 0.1)); };
    const auto report = solver.step(x, 0.1, sphere.network, sphere.foundation, at(0), at(1), at(2), at(3), at(4), at(5),
                                    at(6), at(7), at(8), at(9), at(10), at(11), at(20), at(30), at(40), at(50));
    CHECK(report.status == StepStatus::advanced);
    REQUIRE(report.reactions.size() == 16);
    for (const auto& reaction : report.reactions) CHECK(norm(reaction) > 0);
}
