// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <membrane/network/mass_spring_network.hpp>
#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/curvature.hpp>
#include <membrane/solve/propagation_queue.hpp>
#include <membrane/solve/region.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/step_rule.hpp>

/// Where the membrane comes to rest, and what it pushes back with.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 4});
///     const auto report = solver.step(x, dt, network, backing, press(tool, contact));
///     // report.reactions[0] [N], report.moved
namespace membrane {

/// The quasi-static solver, [Liu07] 2.2: every step is taken to be at rest, and the vertices of the propagation queue
/// move one after the other, nearest to the contact first, by (4) or another rule, each seeing those that have moved.
///
/// Beyond the paper: a step may sweep the queue several times; what a contact leaves behind stays at work until it is
/// at rest, and then costs nothing; constraints keep the forces they act with from step to step, so that a sweep ends
/// with forces that balance. A step that is refused leaves the positions as they were, to the bit: it keeps the
/// positions of the vertices it works on, three numbers for each.
///
/// Positions, network and backing are handed in at each step, always those of one membrane; what is remembered (queue,
/// restless vertices, contact forces) is a cache. One thread at a time for each solver.
template <Real Scalar, StepRule<Scalar> Rule = SafeStep>
class QuasiStaticSolver {
  public:
    /// @throws InvalidInput for options out of range, or a rule that needs masses the network does not have.
    /// Cost: O(V) memory.
    template <class Law>
    explicit QuasiStaticSolver(const MassSpringNetwork<Scalar, Law>& network, const SolverOptions<Scalar>& options = {},
                               const Rule& rule = {});

    /// Brings `x` (3 x V [m]) nearer to rest in a tick of `dt` [s] under up to 16 constraints. Online.
    /// Cost: `sweeps` + 1 visits for each vertex in the queue or still restless, each of its springs.
    template <class Law, VolumeModel<Scalar> Volume, Constraint<Scalar>... Constraints>
    [[nodiscard]] StepReport<Scalar> step(PointsRef<Scalar> x, Scalar dt, const MassSpringNetwork<Scalar, Law>& network,
                                          const Volume& volume, const Constraints&... constraints) noexcept;

    /// Has a look at these vertices in the next steps: what moved them, or their anchors, was not a step of this solver.
    void wake(std::span<const Index> vertices) noexcept;
    void wake_all() noexcept;

    /// Forgets everything that was remembered: a membrane that is not at rest stays as it is until woken.
    void reset() noexcept;

    /// The propagation queue of the last step.
    [[nodiscard]] const PropagationQueue& queue() const noexcept { return queue_; }

  private:
    void open(std::size_t constraint_count) noexcept;
    template <class Network>
    void arrange(const Network& network) noexcept;
    template <class Handed, class Enforce>
    bool sweep(const Handed& scene, Region<Scalar>& region, bool first, Enforce enforce) noexcept;
    template <class Handed>
    bool visit(Index v, const Handed& scene, Region<Scalar>& region, bool first) noexcept;
    template <class Handed>
    [[nodiscard]] Pull<Scalar> pull_on(Index v, const Handed& scene) const noexcept;
    template <class Handed>
    [[nodiscard]] bool diverges(Index v, const Handed& scene, Scalar compliance) const noexcept;
    template <class Handed>
    bool look(const Handed& scene) noexcept;
    template <class Handed>
    void settle(const Handed& scene) noexcept;
    [[nodiscard]] StepReport<Scalar> refuse_step(StepStatus status, PointsRef<Scalar>& x) noexcept;

    Rule rule_;
    SolverOptions<Scalar> options_;
    PropagationQueue queue_;
    Workspace<Scalar> work_;
    IndexSet visited_;                   // this step's vertices, in the order of their visits
    IndexSet restless_, next_restless_;  // outside the queue, not at rest
    IndexSet stirred_;                   // visited since the membrane was last at rest as a whole
    IndexSet last_seeds_, last_held_;
    BoundedList<Index> moved_;
    std::array<Vector3<Scalar>, Workspace<Scalar>::most_constraints> reactions_{};
    StepReport<Scalar> report_;
};

template <Real Scalar, StepRule<Scalar> Rule>
template <class Law>
QuasiStaticSolver<Scalar, Rule>::QuasiStaticSolver(const MassSpringNetwork<Scalar, Law>& network,
                                                   const SolverOptions<Scalar>& options, const Rule& rule)
    : rule_(rule),
      options_((options.check(), options)),
      queue_(network.vertex_count()),
      work_(
          network.vertex_count(), [&](Index v) { return network.pinned(v); }, options.most_touches),
      visited_(network.vertex_count()),
      restless_(network.vertex_count()),
      next_restless_(restless_),
      stirred_(restless_),
      last_seeds_(restless_),
      last_held_(restless_),
      moved_(static_cast<std::size_t>(network.vertex_count())) {
    if constexpr (requires { rule.check(); }) rule.check();
    if constexpr (requires { requires Rule::needs_mass; }) {
        if (!network.has_masses()) refuse("QuasiStaticSolver", "the rule needs masses [kg], the network has none");
    }
    work_.negligible_force = options.negligible_force > 0 ? options.negligible_force : network.negligible_force();
}

template <Real Scalar, StepRule<Scalar> Rule>
template <class Law, VolumeModel<Scalar> Volume, Constraint<Scalar>... Constraints>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::step(PointsRef<Scalar> x, Scalar dt,
                                                         const MassSpringNetwork<Scalar, Law>& network,
                                                         const Volume& volume,
                                                         const Constraints&... constraints) noexcept {
    static_assert(sizeof...(Constraints) <= Workspace<Scalar>::most_constraints, "a step takes 16 constraints at most");
    MEMBRANE_ASSERT(x.cols() == work_.vertex_count() && network.vertex_count() == work_.vertex_count());
    open(sizeof...(Constraints));
    if (!is_finite(dt) || !(dt > 0)) return refuse_step(StepStatus::bad_time_step, x);
    if (!(constraints.sound() && ...)) return refuse_step(StepStatus::bad_input, x);

    Region<Scalar> region(x, work_);
    const StepInput<Scalar, MassSpringNetwork<Scalar, Law>, Volume> scene{x, dt, network, volume};
    const auto for_each = [&]([[maybe_unused]] auto act) {  // there may be none
        std::size_t i = 0;
        ((region.turn_to(i), act(constraints, i), ++i), ...);
    };
    for_each([&](const auto& constraint, std::size_t) {
        region.open();
        constraint.begin(region);
    });
    if (work_.invalid) return refuse_step(StepStatus::bad_input, x);
    if (work_.full) return refuse_step(StepStatus::too_many_touches, x);

    arrange(network);
    for (const Index v : visited_.items()) region.save(v);
    const auto enforce = [&] {
        bool mended = false;
        for_each([&](const auto& constraint, std::size_t) { mended |= constraint.enforce(region); });
        return mended;
    };
    bool changed = true;
    for (Index i = 0; i < options_.sweeps && changed; ++i) {
        changed = sweep(scene, region, i == 0, enforce);
        if (report_.status != StepStatus::advanced) return refuse_step(report_.status, x);
    }
    if (changed) enforce();
    if (!look(scene)) return refuse_step(StepStatus::unstable, x);
    for_each(
        [&](const auto& constraint, std::size_t i) { reactions_[i] = constraint.reaction(std::as_const(region)); });
    settle(scene);
    work_.close();
    std::swap(last_held_, work_.held);
    return report_;
}

template <Real Scalar, StepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::open(std::size_t constraint_count) noexcept {
    work_.open();
    moved_.clear();
    reactions_.fill(Vector3<Scalar>::Zero());
    report_ = {};
    report_.reactions = {reactions_.data(), constraint_count};
}

// The vertices of this step, in the order of their visits: the queue, then what is still restless outside it.
template <Real Scalar, StepRule<Scalar> Rule>
template <class Network>
void QuasiStaticSolver<Scalar, Rule>::arrange(const Network& network) noexcept {
    for (const Index v : last_held_.items()) {
        if (!work_.held.contains(v)) restless_.insert(v);
    }
    const auto seeds = work_.seeds.items(), before = last_seeds_.items();
    if (!std::equal(seeds.begin(), seeds.end(), before.begin(), before.end())) {
        for (const Index v : queue_.vertices()) restless_.insert(v);
        queue_.build(network, seeds, options_.layers);
    }
    std::swap(last_seeds_, work_.seeds);
    const Index touched = queue_.layer_count() > 0 ? static_cast<Index>(queue_.layer(0).size()) : 0;
    const Index room = (std::max)({touched, Index(1), options_.most_visits / (options_.sweeps + 1)});
    visited_.clear();
    for (const auto vertices : {queue_.vertices(), restless_.items()}) {
        for (const Index v : vertices) {
            if (visited_.count() == room) return;
            if (!network.pinned(v)) visited_.insert(v);
        }
    }
}

template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed, class Enforce>
bool QuasiStaticSolver<Scalar, Rule>::sweep(const Handed& scene, Region<Scalar>& region, bool first,
                                            Enforce enforce) noexcept {
    const auto vertices = visited_.items();
    const std::size_t touched = queue_.layer_count() > 0 ? queue_.layer(0).size() : 0;
    bool changed = false;
    for (const Index v : vertices.first(touched)) changed |= visit(v, scene, region, first);
    changed |= enforce();
    for (const Index v : vertices.subspan(touched)) changed |= visit(v, scene, region, first);
    return changed;
}

template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed>
bool QuasiStaticSolver<Scalar, Rule>::visit(Index v, const Handed& scene, Region<Scalar>& region, bool first) noexcept {
    if (region.fixed(v)) return false;
    ++report_.visits;
    const auto pull = pull_on(v, scene);
    const Scalar mass = scene.network.has_masses() ? scene.network.mass(v) : Scalar(0);
    const Scalar compliance = rule_.compliance(VertexState<Scalar>{pull.stiffness, mass, scene.dt});
    if (first && compliance * pull.stiffness >= 2 && diverges(v, scene, compliance)) {
        report_.status = StepStatus::unstable;
        return false;
    }
    region.set_compliance(v, compliance);
    if (!(norm(pull.force) > work_.negligible_force)) return false;
    scene.x.col(v) += compliance * pull.force;
    return true;
}

template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed>
bool QuasiStaticSolver<Scalar, Rule>::diverges(Index v, const Handed& scene, Scalar compliance) const noexcept {
    const Scalar bound = pull_on(v, scene).stiffness, springs = scene.network.pull(v, scene.x).stiffness;
    return compliance * (largest_curvature<Scalar>(scene.network, v, scene.x) + (bound - springs)) >= 2;
}

template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed>
Pull<Scalar> QuasiStaticSolver<Scalar, Rule>::pull_on(Index v, const Handed& scene) const noexcept {
    const auto springs = scene.network.pull(v, scene.x);
    const auto backing = scene.volume.pull(v, point(scene.x, v), point(work_.start, v), scene.dt);
    const Scalar touches = (std::max)(work_.stiffness[static_cast<std::size_t>(v)], Scalar(0));
    return {springs.force + backing.force + point(work_.external, v), springs.stiffness + backing.stiffness + touches};
}

// The forces at the end; false if any is not finite.
template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed>
bool QuasiStaticSolver<Scalar, Rule>::look(const Handed& scene) noexcept {
    const auto look_at = [&](Index v, bool free) {
        const auto force = pull_on(v, scene).force;
        work_.unbalanced.col(v) = force;
        ++report_.visits;
        if (free) report_.residual = (std::max)(report_.residual, norm(force));
        return is_finite(force);
    };
    bool finite = true;
    for (const Index v : visited_.items()) {
        if (!work_.held.contains(v)) finite &= look_at(v, true);
    }
    for (const Index v : work_.held.items()) finite &= look_at(v, false);
    return finite;
}

// Who has moved, and who has to be looked at again.
template <Real Scalar, StepRule<Scalar> Rule>
template <class Handed>
void QuasiStaticSolver<Scalar, Rule>::settle(const Handed& scene) noexcept {
    next_restless_.clear();
    for (const Index v : restless_.items()) {
        if (!visited_.contains(v) && !scene.network.pinned(v)) next_restless_.insert(v);
    }
    bool at_rest = next_restless_.empty() && visited_.count() >= static_cast<Index>(queue_.vertices().size());
    for (const Index v : visited_.items()) {
        stirred_.insert(v);
        if (work_.held.contains(v)) continue;
        // Damping may hold in balance, for the length of a tick, what is not at rest.
        const Vector3<Scalar> here = point(scene.x, v), start = point(work_.start, v);
        const Vector3<Scalar> still = scene.volume.pull(v, here, here, scene.dt).force;
        const Vector3<Scalar> moving = scene.volume.pull(v, here, start, scene.dt).force;
        const Vector3<Scalar> lasting = point(work_.unbalanced, v) + (still - moving);
        if (norm(lasting) <= work_.negligible_force) continue;
        at_rest = false;
        if (!queue_.contains(v)) next_restless_.insert(v);
    }
    for (const Index v : work_.saved.items()) {
        const Vector3<Scalar> way = point(scene.x, v) - point(work_.start, v);
        if (way.isZero(0)) continue;
        moved_.push(v);
        if (norm(way) <= work_.compliance[static_cast<std::size_t>(v)] * work_.negligible_force) continue;
        for (const auto& end : scene.network.springs_of(v)) {
            if (!stirred_.contains(end.other) || visited_.contains(end.other)) continue;
            next_restless_.insert(end.other);
            at_rest = false;
        }
    }
    std::swap(restless_, next_restless_);
    report_.converged = at_rest && report_.residual <= work_.negligible_force;
    if (restless_.empty() && last_seeds_.empty()) stirred_.clear();
    report_.moved = moved_.items();
}

template <Real Scalar, StepRule<Scalar> Rule>
StepReport<Scalar> QuasiStaticSolver<Scalar, Rule>::refuse_step(StepStatus status, PointsRef<Scalar>& x) noexcept {
    for (const Index v : work_.saved.items()) x.col(v) = work_.start.col(v);
    report_.status = status;
    if (status == StepStatus::unstable && !is_finite(x)) report_.status = StepStatus::bad_input;
    return report_;
}

template <Real Scalar, StepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake(std::span<const Index> vertices) noexcept {
    for (const Index v : vertices) {
        restless_.insert(v);
        stirred_.insert(v);
    }
}

template <Real Scalar, StepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::wake_all() noexcept {
    for (Index v = 0; v < work_.vertex_count(); ++v) wake({&v, 1});
}

template <Real Scalar, StepRule<Scalar> Rule>
void QuasiStaticSolver<Scalar, Rule>::reset() noexcept {
    queue_.clear();
    work_.forget();
    for (IndexSet* set : {&visited_, &restless_, &stirred_, &last_seeds_, &last_held_}) set->clear();
}

}  // namespace membrane
