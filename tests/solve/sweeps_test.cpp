// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <type_traits>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"

using namespace membrane;
using test::same_bits;

namespace {

/// A foundation that does not take lanes: it is asked for one vertex after the other.
template <Real S>
struct Opaque {
    VirtualVolumeSprings<S> volume;

    VertexForce<S> force_on(Index v, const Vector3<S>& position, const Vector3<S>& start, S dt) const noexcept {
        return volume.force_on(v, position, start, dt);
    }
};

/// Draws at one vertex, and at another whenever it is enforced, which it did not name when the step began.
template <Real S>
struct LatePull {
    Index first, later;
    Vector3<S> force;

    bool valid() const noexcept { return true; }
    void begin(ConstraintContext<S>& context) const noexcept {
        context.seed(first);
        context.add_force(first, force);
    }
    bool enforce(ConstraintContext<S>& context) const noexcept {
        context.add_force(later, force);
        context.add_stiffness(later, S(0.5));
        return true;
    }
    Vector3<S> reaction(const ConstraintContext<S>&) const noexcept { return -force; }
};

/// A force on one vertex, and how often it was enforced.
struct CountedLoad {
    Index at;
    Vector3<double> force;
    int* enforcements;

    bool valid() const noexcept { return true; }
    void begin(ConstraintContext<double>& context) const noexcept {
        context.seed(at);
        context.add_force(at, force);
    }
    bool enforce(ConstraintContext<double>&) const noexcept {
        ++*enforcements;
        return true;
    }
    Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return -force; }
};

/// Finds the costs among what a solver keeps.
struct FindCosts {
    static constexpr bool restores = false;
    StepCosts* found;

    template <class... Part>
    void operator()(const Part&... part) const {
        const auto keep_costs = [this](const auto& one) {
            if constexpr (std::is_same_v<std::remove_cvref_t<decltype(one)>, StepCosts>) *found = one;
        };
        (keep_costs(part), ...);
    }
};

StepCosts costs_of(const QuasiStaticSolver<double>& solver) {
    StepCosts costs;
    QuasiStaticSolver<double>::visit_state(solver, FindCosts{&costs});
    return costs;
}

}  // namespace

TEST_CASE("under a deadline the cost of an update is the time of all over their number", "[solver][deadline]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 3});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 1.0});
    const VirtualVolumeSprings<double> springs(mesh, {.stiffness = 0.1});
    const auto check = [&](const auto& foundation, const SolverOptions<double>& options) {
        QuasiStaticSolver<double> solver(network, options);
        Points<double> x = mesh.positions();
        int readings = 0, enforcements = 0;  // each reading of the clock takes a second
        const Deadline deadline([&] { return double(readings++); }, 1e9);
        const CountedLoad load{7, 0.01 * point(x, 7), &enforcements};
        const auto report = solver.step_until(deadline, x, 1e-3, network, foundation, load);
        // Beside the updates: the residual forces at the end.
        const auto updates = report.vertex_updates - static_cast<Index>(solver.queue().vertices().size());
        const int batches = readings - 2 - enforcements;  // the clock is read as the step begins and ends, too
        CHECK(batches > 10);
        CHECK(costs_of(solver).update * static_cast<double>(updates) == Approx(batches));
    };
    check(springs, {.layers = 6, .sweeps = 3, .order = UpdateOrder::colour_layers});
    check(springs, {.layers = 6, .sweeps = 3, .order = UpdateOrder::colour_all});
    check(Opaque<double>{springs}, {.layers = 6, .sweeps = 3});
    check(Opaque<double>{springs}, {.layers = 6, .adaptive_layers = true, .sweeps = 3});
}

TEMPLATE_TEST_CASE("a force that comes beyond layer 0 while constraints are enforced moves what is in a pack",
                   "[solver]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 3});
    const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(1)});
    const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(0.1)});
    const Opaque<S> opaque{foundation};
    for (const UpdateOrder order : {UpdateOrder::colour_layers, UpdateOrder::colour_all}) {
        QuasiStaticSolver<S> in_lanes(network, {.layers = 6, .order = order}), one_by_one = in_lanes;
        Points<S> x = mesh.positions(), y = x;
        PropagationQueue queue(mesh.vertex_count());
        const Index first = 7;
        queue.build(network, {&first, 1}, 6);
        const Index later = queue.layer(4).front();
        const LatePull<S> late{first, later, S(0.01) * point(x, later)};
        for (int tick = 0; tick < 5; ++tick) {
            const auto report = in_lanes.step(x, S(1e-3), network, foundation, late);
            REQUIRE(report.status == StepStatus::advanced);
            REQUIRE(one_by_one.step(y, S(1e-3), network, opaque, late).vertex_updates == report.vertex_updates);
            REQUIRE(same_bits(x, y));
        }
        CHECK(norm(point(x, later)) > S(1.001));
    }
}
