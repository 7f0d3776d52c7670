// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/core/executor.hpp>
#include <membrane/solve/active_vertices.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/deadline.hpp>
#include <membrane/solve/packed_vertices.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/vertex_update.hpp>

namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The sweeps of one step over its active vertices: in each sweep contact iterations, which update layer 0 and then
/// enforce the constraints, and then an update of each vertex beyond. The first vertices, up to the capacity, are
/// packed once in a step, the others for each update.
///
///     sweeps.load_and_pack();
///     sweeps.run();
///     const bool bounded = sweeps.evaluate_residuals();
template <class Scalar, class Rule, class Network, class Volume>
struct Sweeps {
    ///@{
    /// Parts of the step, all but the budget the caller's.
    const StepInput<Scalar, Network, Volume>& scene;
    const Rule& rule;
    const SolverOptions<Scalar>& options;
    const AnyExecutor& executor;
    ActiveVertices& active;
    PackedVertices<Scalar>&packed, &spare;
    const ConstraintList<Scalar>& constraints;
    StepReport<Scalar>& report;
    TimeBudget budget;
    ///@}

    std::size_t resume;  ///< number beyond layer 0 of the vertex at which time ran out, in the last step or in this one

    std::size_t in_packs = 0;          ///< number of active vertices in packs
    std::size_t forces_seen = 0;       ///< number of vertices with a force of a constraint so far
    bool forced_beyond = false;        ///< a constraint adds a force beyond layer 0
    Scalar queue_residual = 0;         ///< largest residual force in the queue [N]
    bool constraints_hold = false;     ///< the last enforcement found no violation, and nothing has moved since
    bool constraints_changed = false;  ///< by the final enforcement, or there was no time for it
    bool stopped = false;              ///< time ran out beyond layer 0

    /// Loads the positions of the active vertices and their neighbours.
    void load_and_pack() noexcept {
        const auto from_queue = active.vertices().first(active.from_queue());
        if (active.take_new_queue() || packed.assigned() != from_queue.size()) {
            packed.assign(from_queue, active.queue().colour_ends(), scene.network);
        }
        packed.append(active.vertices(), from_queue.size(), active.colour_ends(), scene.network);
        load_packs(0);
        for (const auto vertices :
             {active.vertices().subspan(in_packs), active.frontier(), scene.state.prescribed.items()}) {
            for (const Index v : vertices) load_neighbours(v);
        }
        find_forces_beyond();
        budget.begin(active.vertices().size() + active.frontier().size(), beyond());
    }

    /// Sweeps until no vertex moves, `sweeps` are done, or time is up.
    void run() noexcept {
        bool changed = true;
        for (Index i = 0; i < options.sweeps && changed && !report.out_of_time; ++i) {
            changed = iterate_contact();
            if (!advances()) return;
            const bool moved = update_beyond();
            if (!advances()) return;
            if (moved) constraints_hold = false;
            changed |= moved;
            // The queue needs no more. If vertices outside have waited for it, they are next.
            if (!changed && scene.state.outside_tolerance() > scene.state.force_tolerance) {
                scene.state.queue_residual = 0;
                changed = true;
            }
        }
        if ((changed || report.out_of_time) && !constraints_hold) {
            if (!budget.has_time_to_enforce()) report.out_of_time = true;
            constraints_changed = report.out_of_time || enforce();
        }
    }

    /// Evaluates the residual forces on all active vertices. Returns whether the next step can go on from there: the
    /// squares of positions and forces do not overflow, nor those of the forces without constraints, which may be gone
    /// then. As forces may increase once they are gone, a step with constraints has a margin.
    [[nodiscard]] bool evaluate_residuals() noexcept {
        const bool constrained = !scene.state.forced.items().empty() || !scene.state.prescribed.items().empty();
        const Scalar largest = detail::too_large<Scalar> / (constrained ? 100 : 1);
        Scalar squares = 0;
        const auto count = [&](Index v) {
            const Vector3<Scalar> force = scene.state.residual_force(v);
            ++report.vertex_updates;
            if (!scene.state.is_fixed(v)) {
                report.residual = (std::max)(report.residual, norm(force));
                if (active.queue().contains(v)) queue_residual = (std::max)(queue_residual, norm(force));
            }
            squares += squared_norm(force) + squared_norm<Scalar>(force - scene.state.constraint_force(v)) +
                       squared_norm(scene.state.position_of(v));
        };
        const auto evaluate = [&](Index v) {
            const Vector3<Scalar> force = total_force(scene, v).force;
            scene.state.set_residual(v, force, norm(undamped_force(scene, v, force)));
            count(v);
        };
        const auto& prescribed = scene.state.prescribed;
        for (std::size_t p = 0; p < packed.count(); ++p) {
            packed.evaluate_residual(p, scene);
            for (const Index v : packed.vertices(p)) {
                if (!prescribed.contains(v)) count(v);
            }
        }
        for (const auto vertices : {active.vertices().subspan(in_packs), active.frontier()}) {
            for (const Index v : vertices) {
                if (!prescribed.contains(v)) evaluate(v);
            }
        }
        for (const Index v : prescribed.items()) evaluate(v);
        return is_finite(squares) && squares < largest * largest;
    }

  private:
    [[nodiscard]] bool advances() const noexcept { return report.status == StepStatus::advanced; }

    // Number of vertices that this step does not update, beside those that it does.
    [[nodiscard]] std::size_t beyond() const noexcept {
        return scene.state.loaded.items().size() - active.vertices().size();
    }

    void load_packs(std::size_t first) noexcept {
        for (const Index v : packed.needed()) scene.state.load(v, scene.start, scene.network);
        packed.begin_step(scene, first);
        in_packs = packed.size();
    }

    // Whether a constraint adds a force beyond layer 0: only then the forces there are read.
    void find_forces_beyond() noexcept {
        const auto forced = scene.state.forced.items();
        const auto unseen = forced.subspan(std::exchange(forces_seen, forced.size()));
        forced_beyond |=
            std::any_of(unseen.begin(), unseen.end(), [&](Index v) { return !scene.state.seeds.contains(v); });
    }

    void load_neighbours(Index v) noexcept {
        scene.state.load(v, scene.start, scene.network);
        for (const auto& end : scene.network.neighbours(v)) scene.state.load(end.other, scene.start, scene.network);
    }

    bool iterate_contact() noexcept {
        const auto layer = active.contact_layer();
        bool changed = false;
        for (Index i = 0; i < options.contact_iterations; ++i) {
            if (!budget.has_time_for_contact(layer.size())) {
                report.out_of_time = true;
                break;
            }
            const std::size_t packed_count = (std::min)(layer.size(), in_packs);
            changed |= update_packs<true>(packed, 0, packed.pack_from(packed_count));
            for (std::size_t begin = packed_count, end; begin < layer.size(); begin = end) {
                end = pack_spare(begin, layer.size());
                changed |= update_packs<true>(spare, 0, spare.count());
            }
            budget.updated(layer.size());
            if (!advances()) break;
            if (!enforce()) break;
            changed = true;
        }
        return changed;
    }

    bool enforce() noexcept {
        constraints_hold = !constraints.enforce();
        budget.enforced();
        find_forces_beyond();
        return !constraints_hold;
    }

    // Updates in a cycle from the vertex at which time ran out.
    bool update_beyond() noexcept {
        const std::size_t first = active.contact_layer().size(), end = active.vertices().size();
        const std::size_t begin = first + (std::min)(std::exchange(resume, 0), end - first);
        bool changed = update_until_time_is_up(begin, end);
        changed |= update_until_time_is_up(first, begin);
        while (add_layer()) changed = true;
        return changed;
    }

    // With `adaptive_layers`: adds the next layer, and updates it, if a force on it is above the tolerance.
    bool add_layer() noexcept {
        const auto frontier = active.frontier();
        if (frontier.empty() || stopped || !advances()) return false;
        if (!budget.has_time_for_batch()) {
            report.out_of_time = true;
            return false;
        }
        report.vertex_updates += static_cast<Index>(frontier.size());
        const bool needed = std::any_of(frontier.begin(), frontier.end(), [&](Index v) {
            return !scene.state.is_fixed(v) && norm(total_force(scene, v).force) > scene.state.force_tolerance;
        });
        budget.updated(frontier.size());
        if (!needed) return false;
        const std::size_t before = active.vertices().size();
        active.grow(scene.network, options);
        const std::size_t first = packed.count();
        packed.extend(active.vertices(), before, active.colour_ends(), scene.network);
        load_packs(first);
        for (const Index v : active.vertices().subspan(in_packs)) load_neighbours(v);
        for (const Index v : active.frontier()) load_neighbours(v);
        budget.set_residual_count(active.vertices().size() + active.frontier().size(), beyond());
        update_until_time_is_up(before, active.vertices().size());
        return true;
    }

    // Updates the active vertices number `begin` to `end`.
    bool update_until_time_is_up(std::size_t begin, std::size_t end) noexcept {
        const std::size_t packed_end = std::clamp(in_packs, begin, end), last = packed.pack_from(packed_end);
        bool changed = false;
        for (std::size_t p = packed.pack_from(begin), next; p < last && goes_on(packed.first_of(p)); p = next) {
            next = budget.limited() ? (std::min)(p + updates_in_batch / Lanes<Scalar>::count, last) : last;
            changed |= update_batch(packed, p, next);
        }
        for (std::size_t i = packed_end, next; i < end && goes_on(i); i = next) {
            next = pack_spare(i, end);
            changed |= update_batch(spare, 0, spare.count());
        }
        return changed;
    }

    bool update_batch(PackedVertices<Scalar>& packs, std::size_t p, std::size_t end) noexcept {
        const Index before = report.vertex_updates;
        const bool changed = update_packs<false>(packs, p, end);
        budget.updated(static_cast<std::size_t>(report.vertex_updates - before));
        return changed;
    }

    // Packs a batch of one group of the active vertices number `begin` to `end`. Returns its end.
    std::size_t pack_spare(std::size_t begin, std::size_t end) noexcept {
        const bool of_queue = begin < active.from_queue();
        const auto ends = of_queue ? active.queue().colour_ends() : active.colour_ends();
        const std::size_t group_end = *std::upper_bound(ends.begin(), ends.end(), begin);
        end = (std::min)({end, group_end, begin + updates_in_batch, of_queue ? active.from_queue() : end});
        const auto vertices = active.vertices().subspan(begin, end - begin);
        const std::array<std::size_t, 1> one_group{vertices.size()};
        spare.assign(of_queue ? vertices : std::span<const Index>(), one_group, scene.network);
        if (!of_queue) spare.append(vertices, 0, one_group, scene.network);
        spare.begin_step(scene);
        return end;
    }

    // Whether there is time for a batch that begins with active vertex number `i`.
    [[nodiscard]] bool goes_on(std::size_t i) noexcept {
        if (stopped || !advances()) return false;
        if (budget.has_time_for_batch()) return true;
        report.out_of_time = stopped = true;
        resume = i - active.contact_layer().size();
        return false;
    }

    // No spring joins the packs of a group: threads may share them. Under a deadline batches are too small to
    // distribute.
    template <bool in_contact>
    bool update_packs(PackedVertices<Scalar>& packs, std::size_t p, std::size_t end) noexcept {
        bool changed = false;
        const AnyExecutor calling_thread;
        const AnyExecutor& distributor = budget.limited() ? calling_thread : executor;
        while (p < end && advances()) {
            const std::size_t group_end = packs.end_of_group(p, end);
            packs.template update<in_contact>(p, group_end, scene, rule, forced_beyond, distributor);
            for (; p < group_end && advances(); ++p) {
                using Outcome = typename PackedVertices<Scalar>::Outcome;
                report.vertex_updates += packs.free_count(p);
                if (packs.outcome(p) == Outcome::unstable) report.status = StepStatus::unstable;
                changed |= packs.outcome(p) == Outcome::moved;
            }
        }
        return changed;
    }
};

}  // namespace MEMBRANE_INSTRUCTION_SET

}  // namespace membrane
