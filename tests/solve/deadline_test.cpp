// SPDX-License-Identifier: MIT
#include <membrane/solve/deadline.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <thread>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr double radius = 0.01, stiffness = 40, dt = 1e-3;

/// Time that passes only where work is done: with each evaluation of the foundation of a vertex, of which a visit takes
/// one, and with each turn of the tool's touches. No two take the same time, and some ticks are slower than others.
struct WorkClock {
    explicit WorkClock(std::uint64_t seed) : random(seed) {}

    void work(double amount) { time += speed * amount * random.number(0.5, 1.5); }

    Random random;
    double time = 0, speed = 1;
};

struct CostlyBacking {
    VirtualVolumeSprings<double> inner;
    WorkClock* clock;

    [[nodiscard]] VertexForce<double> force_on(Index v, const Vector3<double>& position, const Vector3<double>& start,
                                               double tick) const noexcept {
        clock->work(1);
        return inner.force_on(v, position, start, tick);
    }
};

struct CostlyPress {
    ToolContact<double> inner;
    WorkClock* clock;

    [[nodiscard]] bool valid() const noexcept { return inner.valid(); }
    void begin(ConstraintContext<double>& context) const noexcept {
        inner.begin(context);
        clock->work(0.5 * static_cast<double>(context.points().size()));
    }
    bool enforce(ConstraintContext<double>& context) const noexcept {
        clock->work(0.5 * static_cast<double>(context.points().size()));
        return inner.enforce(context);
    }
    [[nodiscard]] Vector3<double> reaction(const ConstraintContext<double>& context) const noexcept {
        return inner.reaction(context);
    }
};

/// A force on the first hundred vertices, whose enforcement takes long.
struct LongEnforcement {
    Vector3<double> force;  // on each
    double time;
    WorkClock* clock;

    [[nodiscard]] bool valid() const noexcept { return true; }
    void begin(ConstraintContext<double>& context) const noexcept {
        for (Index v = 0; v < 100; ++v) {
            context.seed(v);
            context.add_force(v, force);
        }
    }
    bool enforce(ConstraintContext<double>&) const noexcept {
        clock->time += time;
        return true;
    }
    [[nodiscard]] Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return -100 * force; }
};

/// A tool that always moves on a sphere whose steps have a deadline.
struct Rush {
    Rush(std::uint64_t seed, Index subdivisions, const SolverOptions<double>& options)
        : random(seed),
          clock(seed + 1),
          mesh(icosphere({.radius = radius, .subdivisions = subdivisions})),
          solver(network, options) {}

    /// One tick with so much time for the step; returns what is left of it at the end, as a part.
    double tick(double time) {
        angle += random.number(0.0, 0.02);
        clock.speed = random.number(1.0, 3.0);
        const Vector3<double> from(std::sin(angle), 0.3 * std::sin(0.7 * angle), std::cos(angle));
        const Tool<double> tool{
            .position = (radius + random.number(0.0, 0.5e-3)) * from, .radius = 1e-3, .time = dt * ++ticks};
        const auto contact = tracker.update(tree, x, tool);
        const double until = clock.time + clock.speed * time;
        const Deadline deadline([this] { return clock.time; }, until);
        report = solver.step_until(deadline, x, dt, network, foundation, CostlyPress{press(tool, contact), &clock});
        tree.refit(x, report.moved);
        return (until - clock.time) / clock.speed;
    }

    Random random;
    WorkClock clock;
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{},
                                                    NetworkOptions<double>{.stiffness = stiffness}};
    CostlyBacking foundation{VirtualVolumeSprings<double>(mesh, {.stiffness = 4.0}), &clock};
    QuasiStaticSolver<double> solver;
    AabbTree<double> tree{mesh};
    ContactTracker<double> tracker{mesh};
    Points<double> x = mesh.positions();
    StepReport<double> report;
    double angle = 0;
    int ticks = 0;
};

}  // namespace

TEST_CASE("a deadline is given in seconds, whatever the clock", "[deadline]") {
    CHECK(Deadline([] { return 2.5; }, 3.0).left() == 0.5);
    CHECK(Deadline([] { return 3.5F; }, 3.0F).left() == -0.5);
    CHECK(Deadline([] { return std::uint64_t(10); }, std::uint64_t(9)).left() == -1);
    using Clock = std::chrono::steady_clock;
    using namespace std::chrono_literals;
    const Clock::time_point start{};
    CHECK(Deadline([=] { return start + 100us; }, start + 350us).left() == Approx(250e-6).epsilon(1e-12));
    CHECK(Deadline([=] { return start + 3s; }, Clock::time_point(start + 1s)).left() == Approx(-2).epsilon(1e-12));

    const Deadline soon([] { return Clock::now(); }, Clock::now() + 5ms);
    CHECK(soon.left() <= 5e-3);
    std::this_thread::sleep_for(6ms);
    CHECK(soon.left() < 0);
}

TEST_CASE("costs are measured in updates, whether one takes a nanosecond or a minute", "[deadline]") {
    for (const double unit : {1e-9, 1e-3, 60.0}) {
        CAPTURE(unit);
        double time = 0;
        const Deadline deadline([&] { return time; }, 1000 * unit);
        StepCosts costs;
        TimeBudget budget(deadline, costs);
        budget.begin(5);
        time += 20 * unit;
        budget.updated(10);
        time += 6 * unit;
        budget.enforced();
        time += 60 * unit;
        budget.end();
        CHECK(costs.update == Approx(2 * unit));
        CHECK(costs.enforcement == Approx(3));
        CHECK(costs.residual == Approx(6));
    }
}

TEST_CASE("a step is over at its deadline, and has used the time", "[solver][deadline]") {
    Index unconverged = 0;
    const int runs = 20;
    for (int seed = 1; seed <= runs; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Index subdivisions = 1;
        Rush rush(static_cast<std::uint64_t>(seed), subdivisions,
                  {.layers = unlimited, .adaptive_layers = random.chance(0.3), .sweeps = 1'000'000});
        const int ticks = cases(300, 50'000);
        for (int tick = 0; tick < ticks; ++tick) {
            const double time = random.number(600.0, 1500.0);  // updates
            const double left = rush.tick(time);
            REQUIRE(rush.report.status == StepStatus::advanced);
            REQUIRE(-left <= 32);
            if (tick == 0 || rush.report.residual <= rush.network.force_tolerance()) continue;
            ++unconverged;
            REQUIRE(left <= 0.1 * time);
        }
    }
    CHECK(unconverged > runs * cases(300, 50'000) / 2);
}

TEST_CASE("time that the last enforcement took is not kept for residual forces", "[solver][deadline]") {
    WorkClock clock(1);
    const auto mesh = icosphere<double>({.radius = radius, .subdivisions = 2});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = stiffness});
    const CostlyBacking foundation{VirtualVolumeSprings<double>(mesh, {.stiffness = 4.0}), &clock};
    QuasiStaticSolver<double> solver(network, {.layers = unlimited, .sweeps = 1, .contact_iterations = 1});
    Points<double> x = mesh.positions();
    const double enforcement = 5000, rest = 2000;  // updates and residual forces take a thousand
    for (int tick = 0; tick < 40; ++tick) {
        CAPTURE(tick);
        const Vector3<double> force(1e-3 * (1 + tick % 2), 0, 0);
        const Deadline deadline([&] { return clock.time; }, clock.time + 2 * enforcement + rest);
        const auto report =
            solver.step_until(deadline, x, dt, network, foundation, LongEnforcement{force, enforcement, &clock});
        REQUIRE(report.status == StepStatus::advanced);
        if (tick > 1) CHECK_FALSE(report.out_of_time);  // the first steps find out what things cost
    }
}
