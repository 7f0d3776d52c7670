// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

// After `reset` a part is as a new one: what it does is the same to the bit, whatever it did before.

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

/// Does the last task first.
struct LastFirst {
    template <class Task>
    void operator()(Index count, const Task& task) const noexcept {
        while (count-- > 0) task(count);
    }
};

template <Real S>
struct Sphere {
    TriangleMesh<S> mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
    MassSpringNetwork<S, LinearSpring> network{mesh, {}, {.stiffness = S(40), .mass = S(1e-3), .pinned = {7, 8}}};
    VirtualVolumeSprings<S> foundation{mesh, {.stiffness = S(8), .damping = S(0.02)}};
};

/// A sphere in a user's loop.
template <Real S, class Rule>
struct Loop {
    static inline const Sphere<S> sphere;

    Loop(const SolverOptions<S>& options, const AnyExecutor& executor)
        : solver(sphere.network, options, Rule{}, executor) {}

    /// One tick of what `random` thinks of, and what came of it.
    struct Outcome {
        Contact<S> contact;
        Grasp<S> grasp;
        StepReport<S> report;
        Index full_query_count;
    };
    Outcome tick(Random& random) {
        place = direction<double>(place + 0.15 * random.vector(), place);
        if (random.chance(0.05)) place = -place;
        height = std::clamp(height + random.number(-0.08, 0.08), 0.9, 1.25);
        if (random.chance(0.1)) tool.grasping = !tool.grasping;
        tool.position = (height * place).cast<S>();
        if (random.chance(0.3)) tool.axis = S(0.2) * random.vector<S>();
        const S nothing = std::numeric_limits<S>::quiet_NaN();
        const S dt = random.chance(0.03) ? nothing : S(1e-3);
        const std::vector<Index> woken{random.index(162), random.index(162)};
        const auto weight = random.vector<S>(S(-0.1), S(0.1));
        const Index held = random.chance(0.5) ? 20 : 21;
        const Vector3<S> target = random.number<S>(S(0.95), S(1.05)) * point(sphere.mesh.positions(), held);
        const int max_reads = random.index(12);
        const bool hurries = random.chance(0.3);

        Outcome now{.contact = tracker.update(tree, x, tool), .grasp = {}, .report = {}, .full_query_count = 0};
        now.full_query_count = tracker.full_query_count();
        now.grasp = grasper.update(now.contact, x, tool);
        solver.wake(woken);
        const auto step = [&](auto take) {
            return take(press(tool, now.contact, now.grasp), pull(tool, now.grasp), pull(held, target), pin(pins),
                        load<S>({0, 1, 2}, {S(0.5), S(0.25), S(0.25)}, weight));
        };
        int reads = 0;
        const Deadline deadline([&reads] { return ++reads; }, max_reads);
        now.report = hurries ? step([&](const auto&... all) {
            return solver.step_until(deadline, x, dt, sphere.network, sphere.foundation, all...);
        })
                             : step([&](const auto&... all) {
                                   return solver.step(x, dt, sphere.network, sphere.foundation, all...);
                               });
        tree.refit(x, now.report.moved);
        return now;
    }

    void reset() {
        x = sphere.mesh.positions();
        solver.reset();
        tracker.reset();
        grasper.reset();
        tree.refit(x);
        place = {0, 0, 1};
        height = 1.2;
        tool = {.radius = S(0.1)};
    }

    QuasiStaticSolver<S, Rule> solver;
    AabbTree<S> tree{sphere.mesh};
    ContactTracker<S> tracker{sphere.mesh, {.full_query_interval = 3}};
    Grasper<S> grasper{sphere.mesh};
    Points<S> x = sphere.mesh.positions();
    std::vector<Index> pins{30, 31};
    Vector3<double> place{0, 0, 1};
    double height = 1.2;
    Tool<S> tool{.radius = S(0.1)};
};

template <Real S>
bool same(const Contact<S>& a, const Contact<S>& b) {
    const auto listed = [](const ContactTriangle& f, const ContactTriangle& g) { return f.triangle == g.triangle; };
    const auto same_point = [](const ContactPoint<S>& p, const ContactPoint<S>& q) {
        return p.triangle == q.triangle && p.feature == q.feature && p.gap == q.gap && same_bits(p.normal, q.normal);
    };
    return a.phase == b.phase && a.triangle == b.triangle && a.gap == b.gap && a.depth == b.depth &&
           a.patch.tunnelled == b.patch.tunnelled && same_bits(a.point, b.point) && same_bits(a.normal, b.normal) &&
           std::equal(a.patch.triangles.begin(), a.patch.triangles.end(), b.patch.triangles.begin(),
                      b.patch.triangles.end(), listed) &&
           std::equal(a.patch.candidates.begin(), a.patch.candidates.end(), b.patch.candidates.begin(),
                      b.patch.candidates.end(), listed) &&
           std::equal(a.patch.points.begin(), a.patch.points.end(), b.patch.points.begin(), b.patch.points.end(),
                      same_point);
}

template <Real S>
bool same(const StepReport<S>& a, const StepReport<S>& b) {
    return a.status == b.status && a.converged == b.converged && a.out_of_time == b.out_of_time &&
           a.residual == b.residual && a.vertex_updates == b.vertex_updates &&
           std::equal(a.moved.begin(), a.moved.end(), b.moved.begin(), b.moved.end()) &&
           std::equal(a.reactions.begin(), a.reactions.end(), b.reactions.begin(), b.reactions.end(),
                      [](const auto& one, const auto& other) { return same_bits(one, other); });
}

template <Real S>
SolverOptions<S> some_options(Random& random) {
    return {.layers = random.index(4),
            .adaptive_layers = random.chance(0.25),
            .sweeps = 1 + random.index(3),
            .order = static_cast<UpdateOrder>(random.index(3)),
            .predict = random.chance(0.7),
            .max_vertex_updates = random.chance(0.3) ? 100 + random.index(300) : unlimited};
}

template <Real S, class Rule>
void check_resets(const AnyExecutor& executor = {}) {
    int touching = 0, holding = 0, refused = 0, late = 0;
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto options = some_options<S>(random);
        Loop<S, Rule> used(options, executor), fresh(options, executor);
        for (int tick = random.index(100); tick > 0; --tick) static_cast<void>(used.tick(random));
        used.reset();
        const Index checks = used.tracker.full_query_count();
        Random other = random;
        for (int tick = 0; tick < 60; ++tick) {
            CAPTURE(tick);
            const auto a = used.tick(random), b = fresh.tick(other);
            REQUIRE(same(a.contact, b.contact));
            REQUIRE(a.full_query_count - checks == b.full_query_count);
            REQUIRE(a.grasp.triangle == b.grasp.triangle);
            REQUIRE(same(a.report, b.report));
            REQUIRE(same_bits(used.x, fresh.x));
            touching += b.contact.touching();
            holding += b.grasp.holding();
            refused += b.report.status != StepStatus::advanced;
            late += b.report.out_of_time;
        }
    }
    CHECK(touching > 0);
    CHECK(holding > 0);
    CHECK(refused > 0);
    CHECK(late > 0);
}

}  // namespace

TEMPLATE_TEST_CASE("what is reset does what is new does, to the bit", "[reset]", TEST_SCALARS) {
    SECTION("block") { check_resets<TestType, BlockStep>(); }
    SECTION("safe") { check_resets<TestType, SafeStep>(); }
    SECTION("as published") { check_resets<TestType, MassStep>(); }
    SECTION("block, shared out") { check_resets<TestType, BlockStep>(LastFirst{}); }
    SECTION("as published, shared out") { check_resets<TestType, MassStep>(LastFirst{}); }
}
