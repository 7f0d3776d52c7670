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

#include <membrane/core/executor.hpp>
#include <membrane/core/rigid_frame.hpp>
#include <membrane/solve/active_vertices.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/contact_state.hpp>
#include <membrane/solve/deadline.hpp>
#include <membrane/solve/packed_vertices.hpp>
#include <membrane/solve/predictor.hpp>
#include <membrane/solve/rigid_support.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/vertex_rows.hpp>
#include <membrane/surface/vertex_split.hpp>

/// The quasi-static solver: equilibrium positions of the membrane and its reactions.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
///     // report.reactions[0] [N], report.moved
namespace membrane {

namespace detail {

// Excludes the solver itself, so that a copy uses the copy constructor.
template <class Network, class Scalar>
concept NetworkOfSolver = !requires(Network & solver) {
    solver.wake_all();
}
&&ElasticNetwork<Network, Scalar>;

}  // namespace detail

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The quasi-static solver, [Liu07] 2.2: every step is assumed to be an equilibrium, and the vertices of the
/// propagation queue are updated one after the other by the step rule, nearest to the contact first, each with the new
/// positions of the others.
///
/// Beyond the paper: a step starts from an extrapolation of the last displacements, if the tools repeat their motion;
/// it may sweep the queue several times; after a contact has moved on, vertices stay active until their forces balance,
/// and then cost nothing; constraints keep their forces from step to step, so that the forces balance after few sweeps.
/// A step that is refused leaves the positions unchanged, to the bit: it works on a copy of the positions that it
/// loads, and writes back those that changed.
///
/// Positions, network and volume springs are arguments of each step, always those of one membrane; the solver's state
/// (queue, vertices awake, packed springs, contact forces) is a cache: `reset` it if constants of the network change.
/// One thread at a time for each solver.
template <Real Scalar, CheckedStepRule<Scalar> Rule = BlockStep>
class QuasiStaticSolver : public SplitCount {
  public:
    /// `executor` is for orders in which several threads may update vertices.
    /// @throws InvalidInput for options out of range, or a rule that needs masses the network does not have.
    /// Cost: O(V) memory.
    template <detail::NetworkOfSolver<Scalar> Network>
    explicit QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options = {}, const Rule& rule = {},
                               AnyExecutor executor = {});

    /// Brings `x` (3 x V [m]) nearer to equilibrium in a tick of `dt` [s] under up to 16 constraints. Online.
    /// Cost: `sweeps` + 1 evaluations of each active vertex; in layer 0, up to `sweeps` times `contact_iterations` + 1;
    /// one of each free vertex beside them, and one comparison of each pinned vertex. An evaluation costs the vertex's
    /// springs.
    template <ElasticNetwork<Scalar> Network, CheckedFoundationModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step(PointsRef<Scalar> x, Scalar dt, const Network& network, const Volume& volume,
                                          const Constraints&... constraints) noexcept {
        return step_in(TimeBudget(), x, dt, network, volume, refer_to(constraints...));
    }

    /// A step that stops at `deadline`. It may overrun by the error of its cost estimate, or by the minimum work: one
    /// contact iteration, 32 vertex updates, and the residual forces of all active vertices. One thread makes the
    /// updates. The next step continues where time ran out, so that a membrane reaches its equilibrium under any
    /// deadline.
    template <class Now, ElasticNetwork<Scalar> Network, CheckedFoundationModel<Scalar> Volume,
              CheckedConstraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step_until(const Deadline<Now>& deadline, PointsRef<Scalar> x, Scalar dt,
                                                const Network& network, const Volume& volume,
                                                const Constraints&... constraints) noexcept {
        return step_in(TimeBudget(deadline, costs_), x, dt, network, volume, refer_to(constraints...));
    }

    /// Wakes vertices that were moved, or whose anchors were moved, by other means than a step of this solver. Ignores
    /// an index that is no vertex. Not needed for the motion of a `MovingBody`, nor for vertices that its network pins:
    /// the next step compares their positions with those in the last step, and begins the queue beside those that have
    /// moved.
    void wake(std::span<const Index> vertices) noexcept;
    void wake_all() noexcept;  ///< `wake` for every vertex. Cost: O(V).

    ///@{
    /// The membrane has torn, and the network has followed: the copy goes on as the vertex; a vertex has moved at rest.
    /// Both wake, and the vertices around them; beyond the layers the membrane stays as it is until `wake_all`. The
    /// next report lists both as moved, if the solver was made for a network that `FollowsSplit`. Online. Cost: that of
    /// the contact points of the last step.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept;
    ///@}

    /// Resets the solver to a new one, to the bit: a membrane out of equilibrium does not move until woken. Cost: O(V).
    void reset() noexcept;

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.active_, self.rows_, self.contacts_, self.asleep_below_, self.splits_, self.predictor_,
              self.last_prescribed_, self.woken_, self.placed_, self.moved_, self.last_displacements_, self.pins_,
              self.fixed_at_, self.pins_known_, self.complete_, self.pose_, self.deformations_, self.resume_,
              self.costs_);
        if constexpr (Visit::restores) self.report_ = {};
    }

    /// The contact points of constraint number `i` in the last step that advanced, with the force on each [N], whose
    /// sum is its reaction. Empty for a constraint without contact points, and after a
    /// step with unstable or infinite forces. Valid until the next step.
    [[nodiscard]] std::span<const ContactPoint<Scalar>> contact_points(std::size_t i) const& noexcept {
        if (i >= contacts_.previous_ranges.size()) return {};
        return contacts_.previous_ranges[i].of(contacts_.previous_points.items());
    }
    void contact_points(std::size_t) && = delete;

    ///@{
    /// The propagation queue of the last step; the vertices whose positions constraints prescribed in the last one that
    /// advanced.
    [[nodiscard]] const PropagationQueue& queue() const& noexcept { return active_.queue(); }
    void queue() && = delete;
    [[nodiscard]] std::span<const Index> prescribed() const& noexcept { return last_prescribed_.items(); }
    void prescribed() && = delete;
    ///@}

  private:
    // Whether the volume springs are on a body that may move, see `on`.
    template <class Volume>
    static constexpr bool moves = requires(const Volume& volume) {
        volume.body();
    };

    using Constraints = std::span<const ConstraintRef<Scalar>>;
    template <class... C>
    [[nodiscard]] static std::array<ConstraintRef<Scalar>, sizeof...(C)> refer_to(const C&... constraints) noexcept {
        static_assert(sizeof...(C) <= max_constraints, "a step takes 16 constraints at most");
        return {ConstraintRef<Scalar>(constraints)...};
    }

    template <class Network, class Volume>
    [[nodiscard]] StepReport<Scalar> step_in(TimeBudget budget, PointsRef<Scalar>& x, Scalar dt, const Network& network,
                                             const Volume& volume, Constraints constraints) noexcept;
    // In the order of a step.
    template <class Volume>
    bool follow_body(const Volume& volume) noexcept;
    template <class Network, class Volume>
    [[nodiscard]] StepStatus begin_constraints(const ConstraintList<Scalar>& acting, ConstraintContext<Scalar>& context,
                                               const Network& network, const Volume& volume) noexcept;
    template <class Volume>
    void extrapolate(const ConstraintList<Scalar>& acting, ConstraintContext<Scalar>& context) noexcept;
    template <class Network>
    void seed_beside_moved_pins(const Network& network, ConstraintContext<Scalar>& context, bool with_body) noexcept;
    template <class Network>
    void select(const Network& network, const ConstraintContext<Scalar>& context) noexcept;
    template <class Scene>
    void load_and_pack(const Scene& scene) noexcept;
    template <class Scene>
    void load_packs(const Scene& scene, std::size_t first) noexcept;
    template <class Scene>
    void load_neighbours(const Scene& scene, Index v) noexcept;
    template <class Scene>
    void sweep(const Scene& scene, const ConstraintList<Scalar>& acting) noexcept;
    template <class Scene>
    bool iterate_contact(const Scene& scene, const ConstraintList<Scalar>& acting) noexcept;
    bool enforce(const ConstraintList<Scalar>& acting) noexcept;
    template <class Scene>
    bool update_beyond(const Scene& scene) noexcept;
    template <class Scene>
    bool add_layer(const Scene& scene) noexcept;
    template <class Scene>
    bool update_until_time_is_up(const Scene& scene, std::size_t begin, std::size_t end) noexcept;
    template <class Scene>
    std::size_t pack_spare(const Scene& scene, std::size_t begin, std::size_t end) noexcept;
    template <class Scene>
    bool update_packs(const Scene& scene, PackedVertices<Scalar>& packs, std::size_t p, std::size_t end,
                      Constrained constrained) noexcept;
    template <class Scene>
    [[nodiscard]] bool evaluate_residuals(const Scene& scene) noexcept;
    template <class Network>
    void write_back(PointsRef<Scalar>& x, const Network& network) noexcept;
    template <class Scene>
    void measure_beyond(const Scene& scene) noexcept;
    [[nodiscard]] bool has_moved(Index v) const noexcept {
        const auto moved = moved_.items();
        return std::find(moved.begin(), moved.end(), v) != moved.end();
    }
    void keep_fixed_positions(const PointsRef<Scalar>& x) noexcept;
    [[nodiscard]] StepReport<Scalar> refuse_step(StepStatus status) noexcept;

    [[nodiscard]] bool advances() const noexcept { return report_.status == StepStatus::advanced; }
    // Number of loaded vertices that this step does not update.
    [[nodiscard]] std::size_t beyond() const noexcept {
        return rows_.loaded.items().size() - active_.vertices().size();
    }
    void find_forces_beyond() noexcept;
    [[nodiscard]] bool goes_on(std::size_t i) noexcept;

    // How far the step has got.
    struct Progress {
        TimeBudget budget;
        std::size_t resume;                // number beyond layer 0 of the vertex at which time ran out, in the last
                                           // step or in this one
        std::size_t in_packs = 0;          // number of active vertices in packs
        std::size_t forces_seen = 0;       // number of vertices with a force of a constraint so far
        bool forced_beyond = false;        // a constraint adds a force beyond layer 0
        bool constraints_hold = false;     // the last enforcement found no violation, and nothing has moved since
        bool constraints_changed = false;  // by the final enforcement, or there was no time for it
        bool stopped = false;              // time ran out beyond layer 0
        Scalar queue_residual = 0;         // largest residual force in the queue [N]
    };

    [[no_unique_address]] Rule rule_;
    SolverOptions<Scalar> options_;
    AnyExecutor executor_;
    ActiveVertices active_;
    PackedVertices<Scalar> packed_, spare_;  // spare: beyond the capacity of the other
    VertexRows<Scalar> rows_;
    ContactState<Scalar> contacts_;
    IndexSet last_prescribed_;
    IndexSet woken_;                     // since the last step
    IndexSet placed_;                    // by a tear, since the last step that advanced
    FixedVector<Index> moved_;           // in the last step that advanced
    Points<Scalar> last_displacements_;  // of `moved_` [m]
    FixedVector<Index> pins_;            // the pinned vertices
    Points<Scalar> fixed_at_;            // of pinned and prescribed vertices in the last step that advanced [m]
    bool pins_known_ = false;            // whether there was one
    Predictor<Scalar, max_constraints> predictor_;
    std::array<Vector3<Scalar>, max_constraints> reactions_{};
    StepReport<Scalar> report_;
    Progress progress_;
    bool complete_ = false;           // the last step made all its vertex updates
    RigidFrame<Scalar> pose_;         // of the body at the last step
    std::uint64_t deformations_ = 0;  // of the body at the last step
    Scalar asleep_below_ = 0;         // no vertex that has moved is asleep under a larger force than this [N]
    std::size_t resume_ = 0;          // number beyond layer 0 of the vertex at which time ran out
    StepCosts costs_;
};

template <class Network, class Rule = BlockStep,
          bool = ElasticNetwork<Network, typename Network::Scalar>&& CheckedStepRule<Rule, typename Network::Scalar>>
QuasiStaticSolver(const Network&, const SolverOptions<typename Network::Scalar>& = {}, const Rule& = {},
                  AnyExecutor = {}) -> QuasiStaticSolver<typename Network::Scalar, Rule>;

}  // namespace MEMBRANE_INSTRUCTION_SET

namespace detail {

// The force below which a vertex is in equilibrium [N]: of the options, or above rounding.
template <class Scalar, class Network, class Volume>
[[nodiscard]] Scalar tolerance_of(const SolverOptions<Scalar>& options, const Network& network,
                                  [[maybe_unused]] const Volume& volume, [[maybe_unused]] Scalar dt) noexcept {
    if (options.force_tolerance > 0) return options.force_tolerance;
    if constexpr (requires { volume.force_tolerance(dt); }) {
        return (std::max)(network.force_tolerance(), 2 * volume.force_tolerance(dt));
    } else {
        return network.force_tolerance();
    }
}

// Number of pinned vertices; of all vertices if a tear may split those.
template <class Network>
[[nodiscard]] std::size_t max_pins(const Network& network) noexcept {
    std::size_t count = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) {
        if (FollowsSplit<Network> || network.pinned(v)) ++count;
    }
    return count;
}

}  // namespace detail

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <detail::NetworkOfSolver<Scalar> Network>
QuasiStaticSolver<Scalar, Rule>::QuasiStaticSolver(const Network& network, const SolverOptions<Scalar>& options,
                                                   const Rule& rule, AnyExecutor executor)
    : rule_(rule),
      options_((options.validate(), options)),
      executor_(std::move(executor)),
      active_(network.vertex_count()),
      packed_(network, options.max_packed_vertices),
      spare_(network, options.max_packed_vertices < network.vertex_count() ? static_cast<Index>(updates_in_batch) : 0),
      rows_(network.vertex_count()),
      contacts_(network.vertex_count(), options.max_contact_points),
      last_prescribed_(network.vertex_count()),
      woken_(last_prescribed_),
      placed_(FollowsSplit<Network> ? network.vertex_count() : 0),  // no memory where nothing tears
      moved_(static_cast<std::size_t>(network.vertex_count())),
      last_displacements_(Points<Scalar>::Zero(3, options.predict ? network.vertex_count() : 0)),
      pins_(detail::max_pins(network)),
      fixed_at_(Points<Scalar>::Zero(3, network.vertex_count())) {
    detail::define_made<QuasiStaticSolver>();
    if constexpr (requires { rule.validate(); }) rule.validate();
    if constexpr (requires { network.splits(); }) splits_ = network.splits();
    if constexpr (requires { requires Rule::needs_mass; }) {
        if (!network.has_masses()) refuse("QuasiStaticSolver", "the rule needs masses [kg], the network has none");
    }
    for (Index v = 0; v < network.vertex_count(); ++v) {
        if (network.pinned(v)) pins_.try_push_back(v);
    }
}

// One step, in temporal order.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network, class Volume>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::step_in(TimeBudget budget, PointsRef<Scalar>& x, Scalar dt,
                                                            const Network& network, const Volume& volume,
                                                            Constraints constraints) noexcept {
    detail::require_made<QuasiStaticSolver>();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_ = {.reactions = {reactions_.data(), constraints.size()}};
    const Index count = rows_.vertex_count();
    if (x.cols() != count || network.vertex_count() != count || !has_vertices(volume, count))
        return refuse_step(StepStatus::wrong_vertex_count);
    if (!is_finite(dt) || !(dt >= (std::numeric_limits<Scalar>::min)())) return refuse_step(StepStatus::bad_time_step);
    const bool body_moved = follow_body(volume);  // uses the vertices loaded by the last step
    rows_.begin_step();
    contacts_.begin_step();
    rows_.force_tolerance = detail::tolerance_of(options_, network, volume, dt);
    const ConstPointsRef<Scalar> start = x, now = rows_.positions();  // views: `now` shows each update
    ConstrainedStep<Scalar> constrained(start, rows_, contacts_, network, splits_);
    ConstraintContext<Scalar> context(constrained);
    const ConstraintList<Scalar> acting(constrained, constraints);
    const StepStatus begun = begin_constraints(acting, context, network, volume);
    if (begun != StepStatus::advanced) return refuse_step(begun);

    const StepInput<Scalar, Network, Volume> scene{start, now, dt, network, volume, rows_};
    set_supports(scene, contacts_, options_.rigid_stiffness, rows_.seeds.items());  // `begin` used the last ones
    seed_beside_moved_pins(network, context, body_moved);
    select(network, context);
    progress_ = {.budget = budget, .resume = resume_};
    load_and_pack(scene);
    sweep(scene, acting);
    if (advances() && !evaluate_residuals(scene)) {
        contacts_.reset_points();  // a force of the last step may have diverged
        rows_.restore(start);      // if they are not bounded there either, the input is invalid
        report_.status = evaluate_residuals(scene) ? StepStatus::unstable : StepStatus::invalid_input;
    }
    if (advances() && !acting.react(reactions_)) report_.status = StepStatus::unstable;
    if (!advances()) return refuse_step(report_.status);
    acting.find_violation(report_);
    acting.end();
    resume_ = progress_.resume;
    write_back(x, network);  // from here on `start` shows the new positions
    measure_beyond(scene);
    progress_.budget.end();
    return report_;
}

// If the body has moved since the last step, and the membrane with it, rotates the cached vectors and returns true.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Volume>
bool QuasiStaticSolver<Scalar, Rule>::follow_body([[maybe_unused]] const Volume& volume) noexcept {
    if constexpr (moves<Volume>) {
        const auto& body = volume.body();
        const bool deformed = std::exchange(deformations_, body.deformations()) != body.deformations();
        if (deformed) wake_all();
        if (body.pose().same_pose(pose_)) return deformed;
        const auto motion = motion_between(std::exchange(pose_, body.pose()), body.pose());
        rows_.rotate(motion.rotation);
        contacts_.rotate(motion.rotation);
        for (const Index v : options_.predict ? moved_.items() : std::span<Index>()) {
            last_displacements_.col(v) = motion.vector_to_world(point(last_displacements_, v));
        }
        return true;
    }
    return false;
}

// Extrapolates, and begins the constraints. Returns why the step is refused: an input is invalid, a part has missed a
// split of a tear, or there are too many contact points.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network, class Volume>
StepStatus QuasiStaticSolver<Scalar, Rule>::begin_constraints(const ConstraintList<Scalar>& acting,
                                                              ConstraintContext<Scalar>& context,
                                                              const Network& network, const Volume& volume) noexcept {
    report_.invalid_constraint = acting.first_invalid();
    if (report_.invalid_constraint != no_index) return StepStatus::invalid_input;
    extrapolate<Volume>(acting, context);
    const auto compare_splits = [&](const auto& part, StepStatus missed) {
        if constexpr (requires { part.splits(); }) context.step().compare_splits(part.splits(), missed);
    };
    compare_splits(volume, StepStatus::foundation_missed_split);
    compare_splits(network, StepStatus::network_missed_split);
    if (context.step().refusal() == StepStatus::advanced) acting.begin();
    const StepStatus refusal = context.step().refusal();
    if (refusal == StepStatus::invalid_input) report_.invalid_constraint = context.step().invalid_constraint();
    return refusal;
}

// Adds the extrapolated displacements to vertices of the queue that moved in the last step: those that a contact has
// left come to rest. An incomplete step is not extrapolated: on vertices without update the extrapolation would be
// extrapolated again, and grow from step to step.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Volume>
void QuasiStaticSolver<Scalar, Rule>::extrapolate(const ConstraintList<Scalar>& acting,
                                                  ConstraintContext<Scalar>& context) noexcept {
    if (!options_.predict) return;
    std::array<DrivingInput<Scalar>, max_constraints> inputs{};
    acting.collect_inputs(inputs);
    for (auto& input : inputs) {
        if (!input) continue;
        input->rounding = detail::rounding_at(input->at);
        if constexpr (moves<Volume>) {  // relative to the body, whose pose is rounded as well
            input->at = input->is_force ? pose_.vector_to_body(input->at) : pose_.point_to_body(input->at);
            input->rounding = 4 * input->rounding + detail::rounding_at(input->at);
        }
    }
    const Scalar factor = predictor_.extrapolation_factor(inputs);
    if (factor == 0 || !complete_) return;
    for (const Index v : moved_.items()) {
        if (context.fixed(v) || !active_.queue().contains(v)) continue;
        context.move(v, factor * point(last_displacements_, v));
        active_.wake(v);
    }
}

// A force enters the membrane beside vertices that the caller has moved: pinned by the network, or prescribed in the
// last step. With its body it moves without a force.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network>
void QuasiStaticSolver<Scalar, Rule>::seed_beside_moved_pins(const Network& network, ConstraintContext<Scalar>& context,
                                                             bool with_body) noexcept {
    if (!pins_known_ || with_body) return;
    const auto seed_beside_moved = [&](Index v) {
        if (context.start(v) == point(fixed_at_, v)) return;
        for (const auto& end : network.neighbours(v)) {
            if (!context.fixed(end.other)) context.seed(end.other);
        }
    };
    for (const Index v : last_prescribed_.items()) seed_beside_moved(v);
    for (const Index v : pins_.items()) {
        if (network.pinned(v)) seed_beside_moved(v);
    }
}

// Collects the active vertices of this step, including those prescribed only until the last step. After a tear the
// neighbours of those that were woken too: a split does not list the triangles that stay.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network>
void QuasiStaticSolver<Scalar, Rule>::select(const Network& network,
                                             const ConstraintContext<Scalar>& context) noexcept {
    for (const Index v : last_prescribed_.items()) {
        if (!context.fixed(v)) active_.wake(v);
    }
    for (const Index v : woken_.items()) {
        if (!network.pinned(v)) active_.wake(v);
        if (!active_.has_changed()) continue;
        for (const auto& end : network.neighbours(v)) {
            if (!network.pinned(end.other)) active_.wake(end.other);
        }
    }
    woken_.clear();
    active_.begin_step(network, rows_.seeds.items(), options_);
}

// Loads the positions of the active vertices and their neighbours. The first vertices, up to the capacity, are packed
// once in a step, the others for each update.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::load_and_pack(const Scene& scene) noexcept {
    const auto from_queue = active_.vertices().first(active_.from_queue());
    if (active_.take_new_queue() || packed_.assigned() != from_queue.size()) {
        packed_.assign(from_queue, active_.queue().colour_ends(), scene.network);
    }
    packed_.append(active_.vertices(), from_queue.size(), active_.colour_ends(), scene.network);
    load_packs(scene, 0);
    for (const auto vertices :
         {active_.vertices().subspan(progress_.in_packs), active_.frontier(), rows_.prescribed.items()}) {
        for (const Index v : vertices) load_neighbours(scene, v);
    }
    find_forces_beyond();
    progress_.budget.begin(active_.vertices().size() + active_.frontier().size(), beyond());
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::load_packs(const Scene& scene, std::size_t first) noexcept {
    for (const Index v : packed_.needed()) rows_.load(v, scene.start, scene.network);
    packed_.begin_step(scene, first);
    progress_.in_packs = packed_.size();
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::load_neighbours(const Scene& scene, Index v) noexcept {
    rows_.load(v, scene.start, scene.network);
    for (const auto& end : scene.network.neighbours(v)) rows_.load(end.other, scene.start, scene.network);
}

// Whether a constraint adds a force beyond layer 0: only then the forces there are read.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::find_forces_beyond() noexcept {
    const auto forced = rows_.forced.items();
    const auto unseen = forced.subspan(std::exchange(progress_.forces_seen, forced.size()));
    progress_.forced_beyond |=
        std::any_of(unseen.begin(), unseen.end(), [&](Index v) { return !rows_.seeds.contains(v); });
}

// Sweeps until no vertex moves, `sweeps` are done, or time is up. A sweep is contact iterations, each of which updates
// layer 0 and then enforces the constraints, and an update of each vertex beyond.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::sweep(const Scene& scene, const ConstraintList<Scalar>& acting) noexcept {
    bool changed = true;
    for (Index i = 0; i < options_.sweeps && changed && !report_.out_of_time; ++i) {
        changed = iterate_contact(scene, acting);
        if (!advances()) return;
        const bool moved = update_beyond(scene);
        if (!advances()) return;
        if (moved) progress_.constraints_hold = false;
        changed |= moved;
        // The queue needs no more. If vertices outside have waited for it, they are next, with its tolerance.
        if (!changed && rows_.outside_tolerance() > rows_.force_tolerance) {
            rows_.queue_residual = 0;
            changed = true;
        }
    }
    if ((changed || report_.out_of_time) && !progress_.constraints_hold) {
        if (!progress_.budget.has_time_to_enforce()) report_.out_of_time = true;
        progress_.constraints_changed = report_.out_of_time || enforce(acting);
    }
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::iterate_contact(const Scene& scene,
                                                      const ConstraintList<Scalar>& acting) noexcept {
    const auto layer = active_.contact_layer();
    bool changed = false;
    for (Index i = 0; i < options_.contact_iterations; ++i) {
        if (!progress_.budget.has_time_for_contact(layer.size())) {
            report_.out_of_time = true;
            break;
        }
        const std::size_t packed_count = (std::min)(layer.size(), progress_.in_packs);
        changed |= update_packs(scene, packed_, 0, packed_.pack_from(packed_count), Constrained::in_contact);
        for (std::size_t begin = packed_count, end; begin < layer.size(); begin = end) {
            end = pack_spare(scene, begin, layer.size());
            changed |= update_packs(scene, spare_, 0, spare_.count(), Constrained::in_contact);
        }
        progress_.budget.updated(layer.size());
        if (!advances()) break;
        if (!enforce(acting)) break;
        changed = true;
    }
    return changed;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
bool QuasiStaticSolver<Scalar, Rule>::enforce(const ConstraintList<Scalar>& acting) noexcept {
    progress_.constraints_hold = !acting.enforce();
    progress_.budget.enforced();
    find_forces_beyond();
    return !progress_.constraints_hold;
}

// Updates in a cycle from the vertex at which time ran out.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_beyond(const Scene& scene) noexcept {
    const std::size_t first = active_.contact_layer().size(), end = active_.vertices().size();
    const std::size_t begin = first + (std::min)(std::exchange(progress_.resume, 0), end - first);
    bool changed = update_until_time_is_up(scene, begin, end);
    changed |= update_until_time_is_up(scene, first, begin);
    while (add_layer(scene)) changed = true;
    return changed;
}

// With `adaptive_layers`: adds the next layer, and updates it, if a force on it is above the tolerance.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::add_layer(const Scene& scene) noexcept {
    const auto frontier = active_.frontier();
    if (frontier.empty() || progress_.stopped || !advances()) return false;
    if (!progress_.budget.has_time_for_batch()) {
        report_.out_of_time = true;
        return false;
    }
    report_.vertex_updates += static_cast<Index>(frontier.size());
    const bool needed = std::any_of(frontier.begin(), frontier.end(), [&](Index v) {
        return !rows_.is_fixed(v) && norm(total_force(scene, v).force) > rows_.force_tolerance;
    });
    progress_.budget.updated(frontier.size());
    if (!needed) return false;
    const std::size_t before = active_.vertices().size();
    active_.grow(scene.network, options_);
    const std::size_t first = packed_.count();
    packed_.extend(active_.vertices(), before, active_.colour_ends(), scene.network);
    load_packs(scene, first);
    for (const Index v : active_.vertices().subspan(progress_.in_packs)) load_neighbours(scene, v);
    for (const Index v : active_.frontier()) load_neighbours(scene, v);
    progress_.budget.set_residual_count(active_.vertices().size() + active_.frontier().size(), beyond());
    update_until_time_is_up(scene, before, active_.vertices().size());
    return true;
}

// Updates the active vertices number `begin` to `end`.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_until_time_is_up(const Scene& scene, std::size_t begin,
                                                              std::size_t end) noexcept {
    const std::size_t packed_end = std::clamp(progress_.in_packs, begin, end), last = packed_.pack_from(packed_end);
    const auto constrained = progress_.forced_beyond ? Constrained::by_force : Constrained::no;
    bool changed = false;
    const auto update = [&](PackedVertices<Scalar>& packs, std::size_t p, std::size_t next) {
        const Index before = report_.vertex_updates;
        changed |= update_packs(scene, packs, p, next, constrained);
        progress_.budget.updated(static_cast<std::size_t>(report_.vertex_updates - before));
    };
    for (std::size_t p = packed_.pack_from(begin), next; p < last && goes_on(packed_.first_of(p)); p = next) {
        next = progress_.budget.limited() ? (std::min)(p + updates_in_batch / Lanes<Scalar>::count, last) : last;
        update(packed_, p, next);
    }
    for (std::size_t i = packed_end, next; i < end && goes_on(i); i = next) {
        next = pack_spare(scene, i, end);
        update(spare_, 0, spare_.count());
    }
    return changed;
}

// Packs a batch of one group of the active vertices number `begin` to `end`. Returns its end.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
std::size_t QuasiStaticSolver<Scalar, Rule>::pack_spare(const Scene& scene, std::size_t begin,
                                                        std::size_t end) noexcept {
    const bool of_queue = begin < active_.from_queue();
    const auto ends = of_queue ? active_.queue().colour_ends() : active_.colour_ends();
    const std::size_t group_end = *std::upper_bound(ends.begin(), ends.end(), begin);
    end = (std::min)({end, group_end, begin + updates_in_batch, of_queue ? active_.from_queue() : end});
    const auto vertices = active_.vertices().subspan(begin, end - begin);
    const std::array<std::size_t, 1> one_group{vertices.size()};
    spare_.assign(of_queue ? vertices : std::span<const Index>(), one_group, scene.network);
    if (!of_queue) spare_.append(vertices, 0, one_group, scene.network);
    spare_.begin_step(scene);
    return end;
}

// Whether there is time for a batch that begins with active vertex number `i`.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
bool QuasiStaticSolver<Scalar, Rule>::goes_on(std::size_t i) noexcept {
    if (progress_.stopped || !advances()) return false;
    if (progress_.budget.has_time_for_batch()) return true;
    report_.out_of_time = progress_.stopped = true;
    progress_.resume = i - active_.contact_layer().size();
    return false;
}

// No spring joins the packs of a group: threads may share them. Under a deadline batches are too small to distribute.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::update_packs(const Scene& scene, PackedVertices<Scalar>& packs, std::size_t p,
                                                   std::size_t end, Constrained constrained) noexcept {
    bool changed = false;
    const AnyExecutor calling_thread;
    const AnyExecutor& distributor = progress_.budget.limited() ? calling_thread : executor_;
    while (p < end && advances()) {
        const std::size_t group_end = packs.end_of_group(p, end);
        packs.update(p, group_end, scene, rule_, constrained, distributor);
        for (; p < group_end && advances(); ++p) {
            using Outcome = typename PackedVertices<Scalar>::Outcome;
            report_.vertex_updates += packs.free_count(p);
            if (packs.outcome(p) == Outcome::unstable) report_.status = StepStatus::unstable;
            changed |= packs.outcome(p) == Outcome::moved;
        }
    }
    return changed;
}

// Evaluates the residual forces on all active vertices. Returns whether the next step can go on from there: the squares
// of positions and forces do not overflow, nor those of the forces without constraints, which may be gone then. As
// forces may increase once they are gone, a step with constraints has a margin.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
bool QuasiStaticSolver<Scalar, Rule>::evaluate_residuals(const Scene& scene) noexcept {
    const bool constrained = !rows_.forced.items().empty() || !rows_.prescribed.items().empty();
    const Scalar largest = detail::too_large<Scalar> / (constrained ? 100 : 1);
    Scalar squares = 0, largest_square = 0, square_in_queue = 0;  // of forces [N^2]
    const auto count = [&](Index v) {
        const Vector3<Scalar> force = rows_.residual_force(v);
        const Scalar square = squared_norm(force);
        ++report_.vertex_updates;
        if (!rows_.is_fixed(v)) {
            largest_square = (std::max)(largest_square, square);
            if (active_.queue().contains(v)) square_in_queue = (std::max)(square_in_queue, square);
        }
        squares +=
            square + squared_norm<Scalar>(force - rows_.constraint_force(v)) + squared_norm(rows_.position_of(v));
    };
    const auto evaluate = [&](Index v) {
        const Vector3<Scalar> force = total_force(scene, v).force;
        rows_.set_residual(v, force, norm(undamped_force(scene, v, force)));
        count(v);
    };
    const auto& prescribed = rows_.prescribed;
    for (std::size_t p = 0; p < packed_.count(); ++p) {
        packed_.evaluate_residual(p, scene);
        for (const Index v : packed_.vertices(p)) {
            if (!prescribed.contains(v)) count(v);
        }
    }
    for (const auto vertices : {active_.vertices().subspan(progress_.in_packs), active_.frontier()}) {
        for (const Index v : vertices) {
            if (!prescribed.contains(v)) evaluate(v);
        }
    }
    for (const Index v : prescribed.items()) evaluate(v);  // in packs or not
    report_.residual = std::sqrt(largest_square);
    progress_.queue_residual = std::sqrt(square_in_queue);
    return is_finite(squares) && squares < largest * largest;
}

// Writes the positions of moved vertices, and ends the step: which vertices stay awake, and whether it has converged.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Network>
void QuasiStaticSolver<Scalar, Rule>::write_back(PointsRef<Scalar>& x, const Network& network) noexcept {
    moved_.clear();
    for (const Index v : rows_.loaded.items()) {
        const Vector3<Scalar> now = rows_.position_of(v), before = point(x, v);
        if (now == before) continue;
        moved_.try_push_back(v);
        if (options_.predict) last_displacements_.col(v) = now - before;
        set_point(x, v, now);
    }
    for (const Index v : placed_.items()) {
        if (has_moved(v)) continue;
        moved_.try_push_back(v);
        if (options_.predict) last_displacements_.col(v).setZero();
    }
    placed_.clear();
    report_.moved = moved_.items();
    rows_.queue_residual = options_.adaptive_layers ? Scalar(0) : progress_.queue_residual;
    const Scalar tolerance = rows_.force_tolerance, outside = rows_.outside_tolerance();
    const auto is_balanced = [&](Index v) {
        const bool fixed = rows_.loaded.contains(v) ? rows_.is_fixed(v) : network.pinned(v);
        const Scalar largest = active_.queue().contains(v) ? tolerance : outside;
        return fixed || rows_.unbalanced_force(v) <= largest;
    };
    // Now and then, as this costs all that has moved since the last equilibrium.
    const bool recheck = outside < asleep_below_ && (outside == tolerance || outside < asleep_below_ / 4);
    asleep_below_ = recheck ? outside : (std::max)(asleep_below_, outside);
    report_.converged = active_.end_step(network, is_balanced, report_.moved, recheck) &&
                        !progress_.constraints_changed && report_.residual <= tolerance && asleep_below_ <= tolerance;
    if (options_.relative_tolerance > 0 && !report_.out_of_time && !active_.truncated()) {
        Scalar felt = 0;
        for (const auto& reaction : report_.reactions) felt += norm(reaction);
        const Scalar largest = (std::max)(report_.residual, asleep_below_);
        report_.converged = report_.converged || (felt > 0 && largest <= options_.relative_tolerance * felt);
    }
    complete_ = !report_.out_of_time && !active_.truncated();
    keep_fixed_positions(x);
    contacts_.end_step();
}

// For `seed_beside_moved_pins` in the next step.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::keep_fixed_positions(const PointsRef<Scalar>& x) noexcept {
    std::swap(last_prescribed_, rows_.prescribed);
    for (const auto fixed : {std::span<const Index>(pins_.items()), last_prescribed_.items()}) {
        for (const Index v : fixed) fixed_at_.col(v) = point(x, v);
    }
    pins_known_ = true;
}

// The forces on the free neighbours of the active vertices, which are among the vertices loaded: the caller's positions
// are the new ones.
template <Real Scalar, CheckedStepRule<Scalar> Rule>
template <class Scene>
void QuasiStaticSolver<Scalar, Rule>::measure_beyond(const Scene& scene) noexcept {
    for (const Index v : rows_.loaded.items()) {
        const auto around = scene.network.neighbours(v);
        const auto is_updated = [&](const auto& end) { return active_.updates(end.other); };
        if (active_.updates(v) || rows_.is_fixed(v) || std::none_of(around.begin(), around.end(), is_updated)) continue;
        const Vector3<Scalar> here = point(scene.start, v);
        const Vector3<Scalar> force = scene.network.force_on(v, scene.start).force +
                                      scene.volume.force_on(v, here, here, scene.dt).force + rows_.constraint_force(v);
        report_.residual_beyond = (std::max)(report_.residual_beyond, norm(force));
        report_.unsupported += force;
    }
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::refuse_step(StepStatus status) noexcept {
    if (status == StepStatus::unstable) contacts_.reset_points();  // a force of the last step may have diverged
    predictor_.reset();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_.residual = report_.violation = 0;
    report_.violated = no_index;
    report_.status = status;
    return report_;
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        if (v >= 0 && v < rows_.vertex_count()) woken_.insert(v);
    }
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake_all() noexcept {
    for (Index v = 0; v < rows_.vertex_count(); ++v) wake({&v, 1});
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::split(const VertexSplit& split) noexcept {
    ++splits_;
    rows_.split(split);
    contacts_.split(split);
    active_.network_changed();
    for (const auto& corners : split.corners) wake(corners);
    wake({&split.copy, 1});
    if (placed_.capacity() > 0) placed_.insert(split.copy);
    if (options_.predict) last_displacements_.col(split.copy) = last_displacements_.col(split.vertex);
    if (has_moved(split.vertex)) moved_.try_push_back(split.copy);
    const auto pins = pins_.items();
    if (std::find(pins.begin(), pins.end(), split.vertex) == pins.end()) return;
    if (pins_.try_push_back(split.copy)) fixed_at_.col(split.copy) = fixed_at_.col(split.vertex);
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::reshape(const MovedVertex<Scalar>& moved) noexcept {
    active_.network_changed();
    for (const auto& triangle : moved.triangles) wake(triangle.corners);
    if (placed_.capacity() > 0) placed_.insert(moved.vertex);
}

template <Real Scalar, CheckedStepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::reset() noexcept {
    active_.clear();
    rows_.reset();
    contacts_.reset();
    asleep_below_ = 0;
    predictor_.reset();
    complete_ = pins_known_ = false;
    fixed_at_.setZero();
    last_prescribed_.clear();
    woken_.clear();
    placed_.clear();
    pose_ = {};
    deformations_ = 0;
    resume_ = 0;
    costs_ = {};
}

}  // namespace membrane
