// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/executor.hpp>
#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/active_vertices.hpp>
#include <membrane/solve/compact_block.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/deadline.hpp>
#include <membrane/solve/predictor.hpp>
#include <membrane/solve/region.hpp>
#include <membrane/solve/rigid_support.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/sweeps.hpp>
#include <membrane/solve/visit.hpp>

/// Where the membrane comes to rest, and what it pushes back with.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
///     const auto report = solver.step(x, dt, network, backing, press(tool, contact));
///     // report.reactions[0] [N], report.moved
namespace membrane {

/// The quasi-static solver, [Liu07] 2.2: every step is taken to be at rest, and the vertices of the propagation queue
/// move one after the other, nearest to the contact first, by (4) or another rule, each seeing those that have moved.
///
/// Beyond the paper: a step begins where the last one leads to, if what acts goes on; it may sweep the queue several
/// times; what a contact leaves behind stays at work until it is at rest, and then costs nothing; constraints keep the
/// forces they act with from step to step, so that a sweep ends with forces that balance. A step that is refused leaves
/// the positions as they were, to the bit: it keeps the positions of the vertices it works on, three numbers for each.
///
/// Positions, network and backing are handed in at each step, always those of one membrane; what is remembered (queue,
/// restless vertices, contact forces) is a cache. One thread at a time for each solver.
template <Real Scalar, StepRule<Scalar> Rule = BlockStep, Executor Threads = OneThread>
class QuasiStaticSolver {
  public:
    /// @throws InvalidInput for options out of range, or a rule that needs masses the network does not have.
    /// Cost: O(V) memory.
    template <ElasticNetwork<Scalar> Network>
    explicit QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options = {}, const Rule& rule = {},
                               const Threads& executor = {});

    /// Brings `x` (3 x V [m]) nearer to rest in a tick of `dt` [s] under up to 16 constraints. Online.
    /// Cost: `sweeps` + 1 visits for each vertex in the queue or still restless, in layer 0 `contact_visits` in each
    /// sweep; a visit costs the vertex's springs. @pre `x` and `network` are of the solver's vertices (asserted)
    template <ElasticNetwork<Scalar> Network, VolumeModel<Scalar> Volume, Constraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                          const Constraints&... constraints) noexcept {
        return step_in(NoHurry{}, x, dt, network, volume, constraints...);
    }

    /// The same, over at `deadline`, or later by what it misjudged its end by; or by what comes in any case, one round
    /// over layer 0, 32 vertices beyond, and a look at all that are at work. One thread visits. The next step goes on
    /// where time ran out, so that a membrane comes to rest however little time its steps have.
    template <class Now, ElasticNetwork<Scalar> Network, VolumeModel<Scalar> Volume, Constraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step_until(const Deadline<Now>& deadline, PointsRef<Scalar> x, Scalar dt,
                                                const Network& network, const Volume& volume,
                                                const Constraints&... constraints) noexcept {
        return step_in(Hurry<Now>(deadline, costs_), x, dt, network, volume, constraints...);
    }

    /// Has a look at these vertices in the next steps: what moved them, or their anchors, was not a step of this solver.
    /// An index that is no vertex is passed over.
    void wake(std::span<const Index> vertices) noexcept;
    void wake_all() noexcept;

    /// Forgets everything that was remembered: a membrane that is not at rest stays as it is until woken. From here on
    /// what a new solver does is done, to the bit. Cost: O(V).
    void reset() noexcept;

    /// The propagation queue of the last step.
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return active_.queue(); }

  private:
    template <class Pace, class Network, class Volume, class... Constraints>
    [[nodiscard]] StepReport<Scalar> step_in(Pace pace, PointsRef<Scalar>& x, Scalar dt, const Network& network,
                                             const Volume& volume, const Constraints&... constraints) noexcept;
    void open(std::size_t constraint_count) noexcept;
    template <class Acting>
    void predict(const Acting& acting, Region<Scalar>& region) noexcept;
    template <class Network>
    void line_up(const Network& network, Region<Scalar>& region) noexcept;
    template <class Handed>
    void settle(const Handed& scene, bool mended) noexcept;
    [[nodiscard]] StepReport<Scalar> refuse_step(StepStatus status, PointsRef<Scalar>& x) noexcept;

    Method<Rule, Scalar, Threads> method_;
    ActiveVertices active_;
    CompactBlock<Scalar> block_;
    Workspace<Scalar> work_;
    IndexSet last_held_;
    BoundedList<Index> moved_;  // in the last step that advanced, and how far [m]
    Points<Scalar> ways_;
    Predictor<Scalar, Workspace<Scalar>::most_constraints> predictor_;
    std::array<Vector3<Scalar>, Workspace<Scalar>::most_constraints> reactions_{};
    StepReport<Scalar> report_;
    std::size_t resume_ = 0;  // the vertex beyond layer 0 at which the last sweep ran out of time
    StepCosts costs_;
};

template <class Network, class Rule = BlockStep, class Threads = OneThread>
    requires ElasticNetwork<Network, typename Network::Scalar> QuasiStaticSolver(
        const Network&, const SolverOptions<typename Network::Scalar>& = {}, const Rule& = {}, const Threads& = {})
->QuasiStaticSolver<typename Network::Scalar, Rule, Threads>;

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
template <ElasticNetwork<Scalar> Network>
QuasiStaticSolver<Scalar, Rule, Threads>::QuasiStaticSolver(const Network& network,
                                                            const SolverOptions<Scalar>& options, const Rule& rule,
                                                            const Threads& executor)
    : method_{rule, (options.check(), options), executor},
      active_(network.vertex_count()),
      block_(network, detail::most_in_lanes<Scalar, Rule, Network>(options)),
      work_(
          network.vertex_count(), [&](Index v) { return network.pinned(v); }, options.most_touches),
      last_held_(network.vertex_count()),
      moved_(static_cast<std::size_t>(network.vertex_count())),
      ways_(Points<Scalar>::Zero(3, options.predict ? network.vertex_count() : 0)) {
    if constexpr (requires { rule.check(); }) rule.check();
    if constexpr (requires { requires Rule::needs_mass; }) {
        if (!network.has_masses()) refuse("QuasiStaticSolver", "the rule needs masses [kg], the network has none");
    }
    if constexpr (!moves_along_force<Rule, Scalar>) {
        work_.block_compliance.resize(static_cast<std::size_t>(network.vertex_count()));
    }
    work_.negligible_force = options.negligible_force > 0 ? options.negligible_force : network.negligible_force();
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
template <class Pace, class Network, class Volume, class... Constraints>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule, Threads>::step_in(Pace pace, PointsRef<Scalar>& x, Scalar dt,
                                                                     const Network& network, const Volume& volume,
                                                                     const Constraints&... constraints) noexcept {
    static_assert(sizeof...(Constraints) <= Workspace<Scalar>::most_constraints, "a step takes 16 constraints at most");
    MEMBRANE_ASSERT(x.cols() == work_.vertex_count() && network.vertex_count() == work_.vertex_count());
    open(sizeof...(Constraints));
    if (!is_finite(dt) || !(dt >= (std::numeric_limits<Scalar>::min)())) {
        return refuse_step(StepStatus::bad_time_step, x);
    }

    Region<Scalar> region(x, work_);
    const ConstraintSet<Scalar, Constraints...> acting(region, constraints...);
    if (!acting.sound()) return refuse_step(StepStatus::bad_input, x);
    predict(acting, region);
    acting.begin();
    if (work_.invalid) return refuse_step(StepStatus::bad_input, x);
    if (work_.full) return refuse_step(StepStatus::too_many_touches, x);

    set_supports(network, volume, method_.options.rigid_stiffness, region, work_.seeds.items());
    line_up(network, region);
    const StepInput<Scalar, Network, Volume> scene{x, dt, network, volume, work_};
    std::size_t resume = resume_;
    Sweeps sweeps(method_, scene, region, acting, active_, block_, pace, report_);
    StepStatus status = sweeps.run(resume);
    if (status == StepStatus::advanced && !acting.react(reactions_)) status = StepStatus::unstable;
    if (status != StepStatus::advanced) {
        active_.cancel(network);
        return refuse_step(status, x);
    }
    resume_ = resume;
    settle(scene, sweeps.mended());
    work_.close();
    pace.done();
    return report_;
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::open(std::size_t constraint_count) noexcept {
    work_.open();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_ = {};
    report_.reactions = {reactions_.data(), constraint_count};
}

// Those that moved go on, as far as what leads them does. They are to be visited, wherever they are now.
template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
template <class Acting>
void QuasiStaticSolver<Scalar, Rule, Threads>::predict(const Acting& acting, Region<Scalar>& region) noexcept {
    if (!method_.options.predict) return;
    std::array<Lead<Scalar>, Workspace<Scalar>::most_constraints> leads{};
    acting.tell(leads);
    const Scalar part = predictor_.expect(leads);
    if (part == 0) return;
    for (const Index v : moved_.items()) {
        region.shift(v, part * point(ways_, v));
        active_.wake(v);
    }
}

// Who is at work in this step, what has been let go of as well.
template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
template <class Network>
void QuasiStaticSolver<Scalar, Rule, Threads>::line_up(const Network& network, Region<Scalar>& region) noexcept {
    for (const Index v : last_held_.items()) {
        if (!region.fixed(v)) active_.wake(v);
    }
    active_.arrange(network, work_.seeds.items(), method_.options);
    for (const auto vertices : {active_.vertices(), active_.frontier()}) {
        for (const Index v : vertices) region.save(v);
    }
}

// Who has moved, and who has to be looked at again.
template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
template <class Handed>
void QuasiStaticSolver<Scalar, Rule, Threads>::settle(const Handed& scene, bool mended) noexcept {
    moved_.clear();
    active_.settle(
        [&](Index v) { return work_.held.contains(v) || norm(lasting_force(scene, v)) <= work_.negligible_force; });
    for (const Index v : work_.saved.items()) {
        const Vector3<Scalar> way = point(scene.x, v) - point(work_.start, v);
        if (way.isZero(0)) continue;
        moved_.push(v);
        if (method_.options.predict) ways_.col(v) = way;
        const Scalar compliance = work_.compliance[static_cast<std::size_t>(v)];
        const Scalar negligible = method_.options.layers_as_needed ? Scalar(0) : compliance * work_.negligible_force;
        if (norm(way) > negligible) active_.stir_neighbours(scene.network, v);
    }
    report_.moved = moved_.items();
    report_.converged = active_.close() && !mended && report_.residual <= work_.negligible_force;
    std::swap(last_held_, work_.held);
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule, Threads>::refuse_step(StepStatus status,
                                                                         PointsRef<Scalar>& x) noexcept {
    Region<Scalar>(x, work_).put_back([](Index) { return true; });
    if (status == StepStatus::unstable) work_.forget();  // what ran away may be a force from the step before
    predictor_.forget();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_.status = status;
    return report_;
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::wake(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (v >= 0 && v < work_.vertex_count() && work_.pinned[static_cast<std::size_t>(v)] == 0) active_.wake(v);
    }
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::wake_all() noexcept {
    for (Index v = 0; v < work_.vertex_count(); ++v) wake({&v, 1});
}

template <Real Scalar, StepRule<Scalar> Rule, Executor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::reset() noexcept {
    active_.clear();
    work_.clear();
    predictor_.forget();
    last_held_.clear();
    resume_ = 0;
    costs_ = {};
}

}  // namespace membrane
