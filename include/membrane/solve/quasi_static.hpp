// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include <membrane/core/executor.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/active_vertices.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/deadline.hpp>
#include <membrane/solve/packed_vertices.hpp>
#include <membrane/solve/predictor.hpp>
#include <membrane/solve/rigid_support.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/step_state.hpp>
#include <membrane/solve/vertex_update.hpp>

/// Where the membrane comes to rest, and what it pushes back with.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
///     const auto report = solver.step(x, dt, network, backing, press(tool, contact));
///     // report.reactions[0] [N], report.moved
namespace membrane {

namespace detail {

// Keeps the constructor from a network out of the way of the copy constructor.
template <class Network, class Scalar>
concept NetworkOfSolver = !requires(Network & solver) {
    solver.wake_all();
}
&&CheckedElasticNetwork<Network, Scalar>;

}  // namespace detail

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The quasi-static solver, [Liu07] 2.2: every step is taken to be at rest, and the vertices of the propagation queue
/// move one after the other, nearest to the contact first, by the step rule, each seeing those that have moved.
///
/// Beyond the paper: a step starts from an extrapolation of the last one, if the tools move on as they did; it may sweep the queue
/// several times; what a contact leaves behind stays at work until it is at rest, and then costs nothing; constraints keep
/// their forces from step to step, so that a sweep ends with forces that balance. A step that is refused leaves the
/// positions as they were, to the bit: it works on a copy of those that it loads, and writes back what has moved.
///
/// Positions, network and volume springs are arguments of each step, always those of one membrane; what is remembered
/// (queue, vertices awake, packed springs, contact forces) is a cache: `reset` it where constants of the network have changed. One thread at a time for each solver.
template <Real Scalar, CheckedStepRule<Scalar> Rule = BlockStep>
class QuasiStaticSolver {
  public:
    /// `executor` is for orders in which several threads may move vertices.
    /// @throws InvalidInput for options out of range, or a rule that needs masses the network does not have.
    /// Cost: O(V) memory.
    template <detail::NetworkOfSolver<Scalar> Network>
    explicit QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options = {}, const Rule& rule = {},
                               const AnyExecutor& executor = {});

    /// Brings `x` (3 x V [m]) nearer to rest in a tick of `dt` [s] under up to 16 constraints. Online.
    /// Cost: `sweeps` + 1 updates for each vertex in the queue or awake, in layer 0 `contact_visits` in each sweep; an
    /// update costs the vertex's springs. @pre `x` and `network` are of the solver's vertices (asserted)
    template <CheckedElasticNetwork<Scalar> Network, CheckedVolumeModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                          const Constraints&... constraints) noexcept {
        return step_in(TimeBudget(), x, dt, network, volume, refer_to(constraints...));
    }

    /// The same, but stops at `deadline`. It may overrun by the error of its cost estimate, or by the minimum work: one
    /// contact iteration, 32 updates beyond, and the residual forces of all at work. One thread does the updates. The next
    /// step goes on where time ran out, so that a membrane comes to rest however little time its steps have.
    template <class Now, CheckedElasticNetwork<Scalar> Network, CheckedVolumeModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step_until(const Deadline<Now>& deadline, PointsRef<Scalar> x, Scalar dt,
                                                const Network& network, const Volume& volume,
                                                const Constraints&... constraints) noexcept {
        return step_in(TimeBudget(deadline, costs_), x, dt, network, volume, refer_to(constraints...));
    }

    /// Has the next steps update these vertices: what moved them, or their anchors, was not a step of this solver.
    /// An index that is no vertex is passed over. A `MovingBody` says by itself what it moves.
    void wake(std::span<const Index> vertices) noexcept;
    void wake_all() noexcept;

    /// Forgets everything that was remembered: a membrane that is not at rest stays as it is until woken. From here on
    /// what a new solver does is done, to the bit. Cost: O(V).
    void reset() noexcept;

    /// The contact points of constraint number `i` in the last step that advanced, with the force on each [N]: how its reaction
    /// is distributed. None for a constraint that has none. Valid until the next step.
    [[nodiscard]] std::span<const ContactPoint<Scalar>> contact_points(std::size_t i) const noexcept {
        if (i >= state_.previous_ranges.size()) return {};
        return state_.previous_ranges[i].of(state_.previous_points.items());
    }

    /// The propagation queue of the last step.
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return active_.queue(); }

  private:
    // Whether the volume springs are on a body that may move, see `on`.
    template <class Volume>
    static constexpr bool moves = requires(const Volume& volume) {
        volume.body();
    };

    using Constraints = std::span<const ConstraintRef<Scalar>>;
    template <class... C>
    [[nodiscard]] static std::array<ConstraintRef<Scalar>, sizeof...(C)> refer_to(const C&... constraints) noexcept {
        static_assert(sizeof...(C) <= StepState<Scalar>::max_constraints, "a step takes 16 constraints at most");
        return {ConstraintRef<Scalar>(constraints)...};
    }

    // How far a step has come.
    struct Progress {
        TimeBudget budget;
        bool in_lanes = false;             // packs hold the vertices at work, as many of the first as there is room for
        bool constraints_hold = false;     // when they were last enforced, and nothing has moved since
        bool constraints_changed = false;  // by the last enforcement, or that had no time
        std::size_t resume = 0;            // where the next step is to begin beyond layer 0
        const Index* next = nullptr;       // the vertex beyond layer 0 at which time ran out
    };

    template <class Network, class Volume>
    [[nodiscard]] StepReport<Scalar> step_in(TimeBudget budget, PointsRef<Scalar>& x, Scalar dt, const Network& network,
                                             const Volume& volume, Constraints constraints) noexcept;
    void begin_report(std::size_t constraint_count) noexcept;
    template <class Volume>
    void follow_body(const Volume& volume) noexcept;
    template <class Volume>
    void extrapolate(const ConstraintList<Scalar>& acting, ConstraintContext<Scalar>& context) noexcept;
    template <class Network>
    void select(const Network& network, const ConstraintContext<Scalar>& context) noexcept;
    template <class Scene>
    void load_and_pack(const Scene& scene, Progress& progress) noexcept;
    template <class Scene>
    void sweep(const Scene& scene, const ConstraintList<Scalar>& acting, Progress& progress) noexcept;
    template <class Scene>
    bool iterate_contact(const Scene& scene, const ConstraintList<Scalar>& acting, Progress& progress) noexcept;
    template <class Scene>
    bool update_beyond(const Scene& scene, std::span<const Index> vertices, Progress& progress) noexcept;
    template <class Scene>
    bool update_packs_beyond(const Scene& scene, std::size_t begin, std::size_t end, Progress& progress) noexcept;
    template <bool in_contact, class Scene>
    bool update_packs(const Scene& scene, std::size_t begin, std::size_t end, bool serial) noexcept;
    template <bool in_contact, class Scene>
    bool finish_update(const Scene& scene, std::size_t p, typename PackedVertices<Scalar>::Outcome outcome) noexcept;
    template <class Scene>
    bool add_layer(const Scene& scene, Progress& progress) noexcept;
    template <class Scene>
    bool update(const Scene& scene, Index v) noexcept;
    [[nodiscard]] std::size_t end_of_group(std::size_t p, std::size_t last) const noexcept;
    template <class Scene>
    [[nodiscard]] bool evaluate_residuals(const Scene& scene, const Progress& progress) noexcept;
    template <class Scene>
    void load_neighbours(const Scene& scene, Index v) noexcept;
    template <class Scene>
    void write_back(const Scene& scene, PointsRef<Scalar>& x, const Progress& progress) noexcept;
    [[nodiscard]] StepReport<Scalar> refuse_step(StepStatus status) noexcept;

    template <class Scene>
    static constexpr bool can_use_lanes =
        UpdatesInLanes<Scalar, Rule, std::remove_cvref_t<decltype(std::declval<Scene>().network)>,
                       std::remove_cvref_t<decltype(std::declval<Scene>().volume)>>;

    [[no_unique_address]] Rule rule_;
    SolverOptions<Scalar> options_;
    AnyExecutor executor_;
    ActiveVertices active_;
    PackedVertices<Scalar> packed_;
    StepState<Scalar> state_;
    IndexSet last_prescribed_;
    IndexSet woken_;            // since the last step
    BoundedList<Index> moved_;  // in the last step that advanced, and by how much [m]
    Points<Scalar> last_displacements_;
    Predictor<Scalar, StepState<Scalar>::max_constraints> predictor_;
    std::array<Vector3<Scalar>, StepState<Scalar>::max_constraints> reactions_{};
    StepReport<Scalar> report_;
    bool complete_ = false;           // the last step updated all that were at work, as often as it should
    RigidFrame<Scalar> pose_;         // of the body at the last step
    std::uint64_t deformations_ = 0;  // of the body by then
    std::size_t resume_ = 0;          // the number beyond layer 0 of the vertex at which the last sweep ran out of time
    StepCosts costs_;
};

template <
    class Network, class Rule = BlockStep,
    bool = CheckedElasticNetwork<Network, typename Network::Scalar>&& CheckedStepRule<Rule, typename Network::Scalar>>
QuasiStaticSolver(const Network&, const SolverOptions<typename Network::Scalar>& = {}, const Rule& = {},
                  const AnyExecutor& = {}) -> QuasiStaticSolver<typename Network::Scalar, Rule>;

}  // namespace MEMBRANE_INSTRUCTION_SET

namespace detail {

// Room for packed vertices: none where no volume model allows updates in lanes.
template <class Scalar, class Rule, class Network>
[[nodiscard]] Index most_in_lanes(const SolverOptions<Scalar>& options) noexcept {
    constexpr bool possible = UpdatesInLanes<Scalar, Rule, Network, NoVolumeSprings>;
    return possible && options.order != VisitOrder::arrival && !options.layers_as_needed ? options.most_in_groups : 0;
}

}  // namespace detail

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <detail::NetworkOfSolver<Scalar> Network>
QuasiStaticSolver<Scalar, Rule>::QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options,
                                                   const Rule& rule, const AnyExecutor& executor)
    : rule_(rule),
      options_((options.check(), options)),
      executor_(executor),
      active_(network.vertex_count()),
      packed_(network, detail::most_in_lanes<Scalar, Rule, Network>(options)),
      state_(network.vertex_count(), options.most_touches),
      last_prescribed_(network.vertex_count()),
      woken_(network.vertex_count()),
      moved_(static_cast<std::size_t>(network.vertex_count())),
      last_displacements_(Points<Scalar>::Zero(3, options.predict ? network.vertex_count() : 0)) {
    detail::define_made<QuasiStaticSolver>();
    if constexpr (requires { rule.check(); }) rule.check();
    if constexpr (requires { requires Rule::needs_mass; }) {
        if (!network.has_masses()) refuse("QuasiStaticSolver", "the rule needs masses [kg], the network has none");
    }
    state_.force_tolerance = options.negligible_force > 0 ? options.negligible_force : network.negligible_force();
}

// A step, in the order in which it happens.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network, class Volume>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::step_in(TimeBudget budget, PointsRef<Scalar>& x, Scalar dt,
                                                            const Network& network, const Volume& volume,
                                                            Constraints constraints) noexcept {
    MEMBRANE_ASSERT(x.cols() == state_.vertex_count() && network.vertex_count() == state_.vertex_count());
    detail::require_made<QuasiStaticSolver>();
    begin_report(constraints.size());
    if (!is_finite(dt) || !(dt >= (std::numeric_limits<Scalar>::min)())) return refuse_step(StepStatus::bad_time_step);
    follow_body(volume);  // with what the last step has loaded
    state_.begin_step();

    // Views: nothing writes to `x` before the step is over, and `now` shows each move.
    const ConstPointsRef<Scalar> start = x, now = state_.positions();
    ConstraintContext<Scalar> context(start, state_, network);
    const ConstraintList<Scalar> acting(context, constraints);
    if (!acting.sound()) return refuse_step(StepStatus::bad_input);
    extrapolate<Volume>(acting, context);
    acting.begin();
    if (state_.invalid) return refuse_step(StepStatus::bad_input);
    if (state_.full) return refuse_step(StepStatus::too_many_touches);

    const StepInput<Scalar, Network, Volume> scene{start, now, dt, network, volume, state_};
    Progress progress{.budget = budget};
    set_supports(scene, options_.rigid_stiffness, state_.seeds.items());
    select(network, context);
    load_and_pack(scene, progress);
    sweep(scene, acting, progress);
    if (report_.status == StepStatus::advanced && !evaluate_residuals(scene, progress)) {
        state_.forget_points();  // what ran away may be a force from the step before
        state_.restore(start);   // not finite there either: then the input is not valid
        report_.status = evaluate_residuals(scene, progress) ? StepStatus::unstable : StepStatus::bad_input;
    }
    if (report_.status == StepStatus::advanced && !acting.react(reactions_)) report_.status = StepStatus::unstable;
    if (report_.status != StepStatus::advanced) return refuse_step(report_.status);
    write_back(scene, x, progress);
    progress.budget.end();
    return report_;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::begin_report(std::size_t constraint_count) noexcept {
    reactions_.fill(Vector3<Scalar>::Zero());
    report_ = {};
    report_.reactions = {reactions_.data(), constraint_count};
}

// The body has moved since the last step, and the membrane with it: what is remembered goes along.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Volume>
void QuasiStaticSolver<Scalar, Rule>::follow_body([[maybe_unused]] const Volume& volume) noexcept {
    if constexpr (moves<Volume>) {
        const auto& body = volume.body();
        if (std::exchange(deformations_, body.deformations()) != body.deformations()) wake_all();
        if (body.pose().same_pose(pose_)) return;
        const auto motion = motion_between(std::exchange(pose_, body.pose()), body.pose());
        state_.rotate(motion.rotation);
        if (!options_.predict) return;
        for (const Index v : moved_.items()) {
            last_displacements_.col(v) = motion.direction_out(point(last_displacements_, v));
        }
    }
}

// Vertices that moved in the last step go on, as far as what drives them does. A step that was cut short is not
// extrapolated: where vertices were not updated, the extrapolation would be extrapolated again, and grow from step to step.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Volume>
void QuasiStaticSolver<Scalar, Rule>::extrapolate(const ConstraintList<Scalar>& acting,
                                                  ConstraintContext<Scalar>& context) noexcept {
    if (!options_.predict) return;
    std::array<Lead<Scalar>, StepState<Scalar>::max_constraints> leads{};
    acting.collect_leads(leads);
    if constexpr (moves<Volume>) {  // as they go on the body
        for (auto& lead : leads) {
            if (lead) lead->at = lead->is_force ? pose_.direction_in(lead->at) : pose_.point_in(lead->at);
        }
    }
    const Scalar part = predictor_.expect(leads);
    if (part == 0 || !complete_) return;
    for (const Index v : moved_.items()) {
        if (context.fixed(v)) continue;
        context.move(v, part * point(last_displacements_, v));
        active_.wake(v);
    }
}

// The vertices at work in this step, those that were prescribed until now as well.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network>
void QuasiStaticSolver<Scalar, Rule>::select(const Network& network,
                                             const ConstraintContext<Scalar>& context) noexcept {
    for (const Index v : last_prescribed_.items()) {
        if (!context.fixed(v)) active_.wake(v);
    }
    for (const Index v : woken_.items()) {
        if (!network.pinned(v)) active_.wake(v);
    }
    woken_.clear();
    active_.arrange(network, state_.seeds.items(), options_);
}

// Loads the vertices at work and their neighbours. Those at work are packed if the whole queue is at work and no constraint
// adds a force beyond layer 0.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::load_and_pack(const Scene& scene, Progress& progress) noexcept {
    std::size_t packed = 0;
    if constexpr (can_use_lanes<Scene>) {
        const auto& queue = active_.queue();
        if (active_.take_new_queue()) packed_.assign(queue.vertices(), queue.group_ends(), scene.network);
        const auto forced = state_.forced.items();
        progress.in_lanes =
            active_.from_queue() == queue.vertices().size() &&
            std::all_of(forced.begin(), forced.end(), [&](Index v) { return state_.seeds.contains(v); });
        if (progress.in_lanes) {
            packed_.append(active_.vertices(), active_.from_queue(), active_.group_ends(), scene.network);
            for (const Index v : packed_.needed()) state_.load(v, scene.start, scene.network);
            packed_.begin_step(scene);
            packed = packed_.size();
        }
    }
    for (const auto vertices : {active_.vertices().subspan(packed), active_.frontier(), state_.prescribed.items()}) {
        for (const Index v : vertices) load_neighbours(scene, v);
    }
    progress.budget.begin(active_.vertices().size() + active_.frontier().size());
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::load_neighbours(const Scene& scene, Index v) noexcept {
    state_.load(v, scene.start, scene.network);
    for (const auto& end : scene.network.neighbours(v)) state_.load(end.other, scene.start, scene.network);
}

// Sweeps until nothing changes, they are done, or time is up.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::sweep(const Scene& scene, const ConstraintList<Scalar>& acting,
                                            Progress& progress) noexcept {
    bool changed = true;
    std::size_t resume = resume_;
    for (Index i = 0; i < options_.sweeps && changed && !report_.out_of_time; ++i) {
        changed = iterate_contact(scene, acting, progress);
        if (report_.status != StepStatus::advanced) return;
        const auto beyond = active_.beyond();
        const std::size_t begin = (std::min)(std::exchange(resume, 0), beyond.size());
        bool moved = update_beyond(scene, beyond.subspan(begin), progress);
        moved |= update_beyond(scene, beyond.first(begin), progress);
        while (add_layer(scene, progress)) moved = true;
        if (report_.status != StepStatus::advanced) return;
        if (moved) progress.constraints_hold = false;
        if (progress.next != nullptr) resume = static_cast<std::size_t>(progress.next - beyond.data());
        changed |= moved;
    }
    if (changed && !progress.constraints_hold) {
        if (!progress.budget.has_time_to_enforce()) report_.out_of_time = true;
        progress.constraints_changed = report_.out_of_time || acting.enforce();
    }
    progress.resume = resume;
}

// Updates of layer 0 in turn with its constraints.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::iterate_contact(const Scene& scene, const ConstraintList<Scalar>& acting,
                                                      Progress& progress) noexcept {
    const auto layer = active_.touched();
    const std::size_t packs = progress.in_lanes ? packed_.pack_from(layer.size()) : 0;
    const std::size_t packed = packs > 0 ? (std::min)(layer.size(), packed_.size()) : 0;
    bool changed = false;
    for (Index i = 0; i < options_.contact_visits; ++i) {
        if (!progress.budget.has_time_for_contact(layer.size())) {
            report_.out_of_time = true;
            break;
        }
        changed |= update_packs<true>(scene, 0, packs, true);
        for (const Index v : layer.subspan(packed)) changed |= update(scene, v);
        progress.budget.updated(layer.size());
        if (report_.status != StepStatus::advanced) break;
        progress.constraints_hold = !acting.enforce();
        progress.budget.enforced();
        if (progress.constraints_hold) break;
        changed = true;
    }
    return changed;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_beyond(const Scene& scene, std::span<const Index> vertices,
                                                    Progress& progress) noexcept {
    bool changed = false;
    const auto begin = static_cast<std::size_t>(vertices.data() - active_.vertices().data());
    if (progress.in_lanes && begin < packed_.size()) {
        const std::size_t end = (std::min)(begin + vertices.size(), packed_.size());
        changed = update_packs_beyond(scene, begin, end, progress);
        vertices = vertices.subspan(end - begin);
    }
    while (!vertices.empty() && progress.next == nullptr && report_.status == StepStatus::advanced) {
        if (!progress.budget.has_time_for_batch()) {
            report_.out_of_time = true;
            progress.next = vertices.data();
            break;
        }
        const auto batch = vertices.first((std::min)(updates_in_batch, vertices.size()));
        for (const Index v : batch) changed |= update(scene, v);
        progress.budget.updated(batch.size());
        vertices = vertices.subspan(batch.size());
    }
    return changed;
}

// The packs of vertices number `begin` to `end`.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_packs_beyond(const Scene& scene, std::size_t begin, std::size_t end,
                                                          Progress& progress) noexcept {
    // Under a deadline batches are too small to distribute over threads.
    const bool serial = progress.budget.limited() || executor_.is_serial();
    bool changed = false;
    std::size_t p = packed_.pack_from(begin);
    const std::size_t last = packed_.pack_from(end);
    while (p < last && progress.next == nullptr && report_.status == StepStatus::advanced) {
        if (!progress.budget.has_time_for_batch()) {
            report_.out_of_time = true;
            progress.next = active_.vertices().data() + packed_.first_of(p);
            break;
        }
        const Index before = report_.visits;
        const std::size_t next =
            serial ? (std::min)(p + updates_in_batch / Lanes<Scalar>::count, last) : end_of_group(p, last);
        changed |= update_packs<false>(scene, p, next, serial);
        progress.budget.updated(static_cast<std::size_t>(report_.visits - before));
        p = next;
    }
    return changed;
}

// The pack at which the group of pack `p` ends.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
std::size_t QuasiStaticSolver<Scalar, Rule>::end_of_group(std::size_t p, std::size_t last) const noexcept {
    const std::size_t first = packed_.first_of(p);
    for (const auto ends : {active_.queue().group_ends(), active_.group_ends()}) {
        const auto end = std::upper_bound(ends.begin(), ends.end(), first);
        if (end != ends.end()) return (std::min)(packed_.pack_from(*end), last);
    }
    return last;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <bool in_contact, class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_packs([[maybe_unused]] const Scene& scene, std::size_t begin,
                                                   std::size_t end, [[maybe_unused]] bool serial) noexcept {
    bool changed = false;
    if constexpr (can_use_lanes<Scene>) {
        if constexpr (!in_contact) {
            if (!serial) packed_.update(begin, end, scene, rule_, executor_);
        }
        for (std::size_t p = begin; p < end && report_.status == StepStatus::advanced;) {
            const std::size_t next = serial ? packed_.template update_next<in_contact>(p, end, scene, rule_) : p + 1;
            for (; p < next; ++p) changed |= finish_update<in_contact>(scene, p, packed_.outcome(p));
        }
    }
    return changed;
}

// Where the stiffness bound does not prove that a move is stable, the largest eigenvalue of the block does or does not.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <bool in_contact, class Scene>
bool QuasiStaticSolver<Scalar, Rule>::finish_update(const Scene& scene, std::size_t p,
                                                    typename PackedVertices<Scalar>::Outcome outcome) noexcept {
    using Outcome = typename PackedVertices<Scalar>::Outcome;
    report_.visits += packed_.free_count(p);
    if constexpr (moves_along_force<Rule, Scalar> && !is_safe_rule<Rule>) {
        if (outcome == Outcome::too_far) {
            for (const Index v : packed_.vertices(p)) {
                if (state_.is_fixed(v) || !diverges(scene, v, rule_.compliance(state_of<Rule>(scene, v)))) continue;
                report_.status = StepStatus::unstable;
                return false;
            }
            outcome = packed_.template update<in_contact>(p, scene, rule_, true);
        }
    }
    return outcome == Outcome::moved;
}

// With `layers_as_needed`: adds the next layer, and updates it, if a force on it is above the tolerance.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::add_layer(const Scene& scene, Progress& progress) noexcept {
    const auto frontier = active_.frontier();
    if (frontier.empty() || progress.next != nullptr || report_.status != StepStatus::advanced) return false;
    if (!progress.budget.has_time_for_batch()) {
        report_.out_of_time = true;
        return false;
    }
    report_.visits += static_cast<Index>(frontier.size());
    const bool needed = std::any_of(frontier.begin(), frontier.end(), [&](Index v) {
        return !state_.is_fixed(v) && norm(pull_on(scene, v).force) > state_.force_tolerance;
    });
    progress.budget.updated(frontier.size());
    const std::size_t before = active_.vertices().size();
    if (!needed) return false;
    active_.grow(scene.network, options_);
    for (const Index v : active_.frontier()) load_neighbours(scene, v);
    progress.budget.set_residual_count(active_.vertices().size() + active_.frontier().size());
    update_beyond(scene, active_.vertices().subspan(before), progress);
    return true;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update(const Scene& scene, Index v) noexcept {
    if (state_.is_fixed(v) || report_.status != StepStatus::advanced) return false;
    ++report_.visits;
    const auto vertex = state_of<Rule>(scene, v);
    const auto move = move_of(rule_, vertex, state_.force_tolerance);
    if constexpr (moves_along_force<Rule, Scalar> && !is_safe_rule<Rule>) {
        if (move.may_overshoot && diverges(scene, v, move.compliance)) {
            report_.status = StepStatus::unstable;
            return false;
        }
    }
    state_.set_compliance(v, as_block<Scalar>(move.compliance), move.least);
    if (vertex.touched) {
        state_.set_internal(v, norm<Scalar>(vertex.force - state_.constraint_force(v)),
                            vertex.stiffness - vertex.contact_stiffness);
    }
    if (!move.moves) return false;
    state_.set_position(v, point(scene.x, v) + backtracked<Rule>(scene, v, move.displacement));
    return true;
}

// The forces at the end on all vertices at work; false if any is not finite.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::evaluate_residuals(const Scene& scene, const Progress& progress) noexcept {
    bool finite = true;
    const auto count = [&](Index v) {
        const Vector3<Scalar> force = state_.residual_force(v);
        ++report_.visits;
        if (!state_.is_fixed(v)) report_.residual = (std::max)(report_.residual, norm(force));
        finite &= is_finite(force);
    };
    const auto evaluate = [&](Index v) {
        const Vector3<Scalar> force = pull_on(scene, v).force;
        state_.set_residual(v, force, norm(undamped_force(scene, v, force)));
        count(v);
    };
    std::size_t packed = 0;
    if constexpr (can_use_lanes<Scene>) {
        packed = progress.in_lanes ? packed_.size() : 0;
        for (std::size_t p = 0; p < (packed > 0 ? packed_.count() : 0); ++p) {
            packed_.evaluate_residual(p, scene);
            for (const Index v : packed_.vertices(p)) {
                if (!state_.prescribed.contains(v)) count(v);
            }
        }
    }
    for (const auto vertices : {active_.vertices().subspan(packed), active_.frontier()}) {
        for (const Index v : vertices) {
            if (!state_.prescribed.contains(v)) evaluate(v);
        }
    }
    for (const Index v : state_.prescribed.items()) evaluate(v);
    return finite;
}

// Vertices that have moved get their new positions, and wake their neighbours.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::write_back(const Scene& scene, PointsRef<Scalar>& x,
                                                 const Progress& progress) noexcept {
    moved_.clear();
    for (const Index v : state_.loaded.items()) {
        const Vector3<Scalar> now = state_.position_of(v), before = point(x, v);
        if (now == before) continue;
        moved_.push(v);
        if (options_.predict) last_displacements_.col(v) = now - before;
        x.col(v) = now;
    }
    report_.moved = moved_.items();
    const auto is_balanced = [&](Index v) {
        return state_.is_fixed(v) || state_.unbalanced_force(v) <= state_.force_tolerance;
    };
    report_.converged = active_.finish(scene.network, is_balanced, report_.moved) && !progress.constraints_changed &&
                        report_.residual <= state_.force_tolerance;
    complete_ = !report_.out_of_time && !active_.truncated();
    std::swap(last_prescribed_, state_.prescribed);
    resume_ = progress.resume;
    state_.end_step();
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::refuse_step(StepStatus status) noexcept {
    if (status == StepStatus::unstable) state_.forget_points();  // what ran away may be a force from the step before
    predictor_.forget();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_.status = status;
    return report_;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (v >= 0 && v < state_.vertex_count()) woken_.insert(v);
    }
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake_all() noexcept {
    for (Index v = 0; v < state_.vertex_count(); ++v) wake({&v, 1});
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::reset() noexcept {
    active_.clear();
    state_.reset();
    predictor_.forget();
    complete_ = false;
    last_prescribed_.clear();
    woken_.clear();
    pose_ = {};
    deformations_ = 0;
    resume_ = 0;
    costs_ = {};
}

}  // namespace membrane
