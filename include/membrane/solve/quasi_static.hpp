// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <membrane/core/executor.hpp>
#include <membrane/core/rigid_frame.hpp>
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

namespace detail {

// A solver that is copied is no network that lacks something.
template <class Network, class Scalar>
concept NetworkOfSolver = !requires(Network & solver) {
    solver.wake_all();
}
&&CheckedElasticNetwork<Network, Scalar>;

}  // namespace detail

inline namespace MEMBRANE_INSTRUCTION_SET {

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
template <Real Scalar, CheckedStepRule<Scalar> Rule = BlockStep, CheckedExecutor Threads = OneThread>
class QuasiStaticSolver {
  public:
    /// @throws InvalidInput for options out of range, or a rule that needs masses the network does not have.
    /// Cost: O(V) memory.
    template <detail::NetworkOfSolver<Scalar> Network>
    explicit QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options = {}, const Rule& rule = {},
                               const Threads& executor = {});

    /// Brings `x` (3 x V [m]) nearer to rest in a tick of `dt` [s] under up to 16 constraints. Online.
    /// Cost: `sweeps` + 1 visits for each vertex in the queue or still restless, in layer 0 `contact_visits` in each
    /// sweep; a visit costs the vertex's springs. @pre `x` and `network` are of the solver's vertices (asserted)
    template <CheckedElasticNetwork<Scalar> Network, CheckedVolumeModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                          const Constraints&... constraints) noexcept {
        return step_in(NoHurry{}, x, dt, network, volume, refer_to(constraints...));
    }

    /// The same, over at `deadline`, or later by what it misjudged its end by; or by what comes in any case, one round
    /// over layer 0, 32 vertices beyond, and a look at all that are at work. One thread visits. The next step goes on
    /// where time ran out, so that a membrane comes to rest however little time its steps have.
    template <class Now, CheckedElasticNetwork<Scalar> Network, CheckedVolumeModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step_until(const Deadline<Now>& deadline, PointsRef<Scalar> x, Scalar dt,
                                                const Network& network, const Volume& volume,
                                                const Constraints&... constraints) noexcept {
        return step_in(Hurry(deadline, costs_), x, dt, network, volume, refer_to(constraints...));
    }

    /// Has a look at these vertices in the next steps: what moved them, or their anchors, was not a step of this solver.
    /// An index that is no vertex is passed over. A `MovingBody` says by itself what it moves.
    void wake(std::span<const Index> vertices) noexcept;
    void wake_all() noexcept;

    /// Forgets everything that was remembered: a membrane that is not at rest stays as it is until woken. From here on
    /// what a new solver does is done, to the bit. Cost: O(V).
    void reset() noexcept;

    /// The propagation queue of the last step.
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return active_.queue(); }

  private:
    // What the membrane is on may have moved: `on(body, volume)`.
    template <class Volume>
    static constexpr bool moves = requires(const Volume& volume) {
        volume.body();
    };

    using ConstraintRefs = std::span<const ConstraintRef<Scalar>>;
    template <class... Constraints>
    [[nodiscard]] static std::array<ConstraintRef<Scalar>, sizeof...(Constraints)> refer_to(
        const Constraints&... constraints) noexcept {
        static_assert(sizeof...(Constraints) <= Workspace<Scalar>::most_constraints,
                      "a step takes 16 constraints at most");
        return {ConstraintRef<Scalar>(constraints)...};
    }

    template <class Pace, class Network, class Volume>
    [[nodiscard]] StepReport<Scalar> step_in(Pace pace, PointsRef<Scalar>& x, Scalar dt, const Network& network,
                                             const Volume& volume, ConstraintRefs constraints) noexcept;
    void open(std::size_t constraint_count) noexcept;
    template <class Volume>
    void go_along(const Volume& volume) noexcept;
    template <class Volume>
    void predict(const ConstraintSet<Scalar>& acting, Region<Scalar>& region) noexcept;
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
    IndexSet woken_;            // since the last step
    BoundedList<Index> moved_;  // in the last step that advanced, and how far [m]
    Points<Scalar> ways_;
    Predictor<Scalar, Workspace<Scalar>::most_constraints> predictor_;
    std::array<Vector3<Scalar>, Workspace<Scalar>::most_constraints> reactions_{};
    StepReport<Scalar> report_;
    bool complete_ = false;    // the last step visited all that were at work, as often as it should
    RigidFrame<Scalar> pose_;  // of the body, and how often it was deformed, at the last step
    std::uint64_t deformations_ = 0;
    std::size_t resume_ = 0;  // the vertex beyond layer 0 at which the last sweep ran out of time
    StepCosts costs_;
};

template <class Network, class Rule = BlockStep, class Threads = OneThread,
          bool = CheckedElasticNetwork<Network, typename Network::Scalar>&&
              CheckedStepRule<Rule, typename Network::Scalar>&& CheckedExecutor<Threads>>
QuasiStaticSolver(const Network&, const SolverOptions<typename Network::Scalar>& = {}, const Rule& = {},
                  const Threads& = {}) -> QuasiStaticSolver<typename Network::Scalar, Rule, Threads>;

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <detail::NetworkOfSolver<Scalar> Network>
QuasiStaticSolver<Scalar, Rule, Threads>::QuasiStaticSolver(const Network& network,
                                                            const SolverOptions<Scalar>& options, const Rule& rule,
                                                            const Threads& executor)
    : method_{rule, (options.check(), options), executor},
      active_(network.vertex_count()),
      block_(network, detail::most_in_lanes<Scalar, Rule, Network>(options)),
      work_(network.vertex_count(), options.most_touches),
      last_held_(network.vertex_count()),
      woken_(network.vertex_count()),
      moved_(static_cast<std::size_t>(network.vertex_count())),
      ways_(Points<Scalar>::Zero(3, options.predict ? network.vertex_count() : 0)) {
    detail::define_made<QuasiStaticSolver>();
    if constexpr (requires { rule.check(); }) rule.check();
    if constexpr (requires { requires Rule::needs_mass; }) {
        if (!network.has_masses()) refuse("QuasiStaticSolver", "the rule needs masses [kg], the network has none");
    }
    if constexpr (!moves_along_force<Rule, Scalar>) {
        work_.block_compliance.resize(static_cast<std::size_t>(network.vertex_count()));
    }
    work_.negligible_force = options.negligible_force > 0 ? options.negligible_force : network.negligible_force();
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <class Pace, class Network, class Volume>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule, Threads>::step_in(Pace pace, PointsRef<Scalar>& x, Scalar dt,
                                                                     const Network& network, const Volume& volume,
                                                                     ConstraintRefs constraints) noexcept {
    MEMBRANE_ASSERT(x.cols() == work_.vertex_count() && network.vertex_count() == work_.vertex_count());
    detail::require_made<QuasiStaticSolver>();
    open(constraints.size());
    go_along(volume);
    if (!is_finite(dt) || !(dt >= (std::numeric_limits<Scalar>::min)())) {
        return refuse_step(StepStatus::bad_time_step, x);
    }

    Region<Scalar> region(x, work_, network);
    const ConstraintSet<Scalar> acting(region, constraints);
    if (!acting.sound()) return refuse_step(StepStatus::bad_input, x);
    predict<Volume>(acting, region);
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
    complete_ = !report_.out_of_time && !active_.truncated();
    work_.close();
    pace.done();
    return report_;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::open(std::size_t constraint_count) noexcept {
    work_.open();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_ = {};
    report_.reactions = {reactions_.data(), constraint_count};
}

// The body has moved since the last step, and the membrane with it: what is remembered goes along.
template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <class Volume>
void QuasiStaticSolver<Scalar, Rule, Threads>::go_along([[maybe_unused]] const Volume& volume) noexcept {
    if constexpr (moves<Volume>) {
        const auto& body = volume.body();
        if (std::exchange(deformations_, body.deformations()) != body.deformations()) wake_all();
        if (body.pose().same_pose(pose_)) return;
        const auto motion = motion_between(std::exchange(pose_, body.pose()), body.pose());
        work_.turn(motion.rotation);
        if (!method_.options.predict) return;
        for (const Index v : moved_.items()) ways_.col(v) = motion.direction_out(point(ways_, v));
    }
}

// Those that moved go on, as far as what leads them does. They are to be visited, wherever they are now. A step that was
// cut short is not expected again: where vertices were not visited, what was predicted for them would be predicted anew,
// and grow from step to step.
template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <class Volume>
void QuasiStaticSolver<Scalar, Rule, Threads>::predict(const ConstraintSet<Scalar>& acting,
                                                       Region<Scalar>& region) noexcept {
    if (!method_.options.predict) return;
    std::array<Lead<Scalar>, Workspace<Scalar>::most_constraints> leads{};
    acting.tell(leads);
    if constexpr (moves<Volume>) {  // as they go on the body
        for (auto& lead : leads) {
            if (lead) lead->at = lead->is_force ? pose_.direction_in(lead->at) : pose_.point_in(lead->at);
        }
    }
    const Scalar part = predictor_.expect(leads);
    if (part == 0 || !complete_) return;
    for (const Index v : moved_.items()) {
        if (region.fixed(v)) continue;
        region.shift(v, part * point(ways_, v));
        active_.wake(v);
    }
}

// Who is at work in this step, what has been let go of as well.
template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <class Network>
void QuasiStaticSolver<Scalar, Rule, Threads>::line_up(const Network& network, Region<Scalar>& region) noexcept {
    for (const Index v : last_held_.items()) {
        if (!region.fixed(v)) active_.wake(v);
    }
    for (const Index v : woken_.items()) {
        if (!network.pinned(v)) active_.wake(v);
    }
    woken_.clear();
    active_.arrange(network, work_.seeds.items(), method_.options);
    for (const auto vertices : {active_.vertices(), active_.frontier()}) {
        for (const Index v : vertices) region.save(v);
    }
}

// Who has moved, and who has to be looked at again.
template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
template <class Handed>
void QuasiStaticSolver<Scalar, Rule, Threads>::settle(const Handed& scene, bool mended) noexcept {
    moved_.clear();
    active_.settle([&](Index v) {
        return work_.held.contains(v) || scene.network.pinned(v) ||
               norm(lasting_force(scene, v)) <= work_.negligible_force;
    });
    for (const Index v : work_.saved.items()) {
        const Vector3<Scalar> way = point(scene.x, v) - point(work_.start, v);
        if (way.isZero(0)) continue;
        moved_.push(v);
        if (method_.options.predict) ways_.col(v) = way;
        active_.stir_neighbours(scene.network, v);
    }
    report_.moved = moved_.items();
    report_.converged = active_.close() && !mended && report_.residual <= work_.negligible_force;
    std::swap(last_held_, work_.held);
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule, Threads>::refuse_step(StepStatus status,
                                                                         PointsRef<Scalar>& x) noexcept {
    for (const Index v : work_.saved.items()) x.col(v) = work_.start.col(v);
    if (status == StepStatus::unstable) work_.forget();  // what ran away may be a force from the step before
    predictor_.forget();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_.status = status;
    return report_;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::wake(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (v >= 0 && v < work_.vertex_count()) woken_.insert(v);
    }
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::wake_all() noexcept {
    for (Index v = 0; v < work_.vertex_count(); ++v) wake({&v, 1});
}

template <Real Scalar, CheckedStepRule<Scalar> Rule, CheckedExecutor Threads>
void QuasiStaticSolver<Scalar, Rule, Threads>::reset() noexcept {
    active_.clear();
    work_.clear();
    predictor_.forget();
    complete_ = false;
    last_held_.clear();
    woken_.clear();
    pose_ = {};
    deformations_ = 0;
    resume_ = 0;
    costs_ = {};
}

}  // namespace membrane
