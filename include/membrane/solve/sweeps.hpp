// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

#include <membrane/solve/active_vertices.hpp>
#include <membrane/solve/compact_block.hpp>
#include <membrane/solve/constraints.hpp>
#include <membrane/solve/deadline.hpp>
#include <membrane/solve/region.hpp>
#include <membrane/solve/step.hpp>
#include <membrane/solve/step_rule.hpp>
#include <membrane/solve/visit.hpp>

/// What a step spends its time with.
///
///     membrane::Sweeps sweeps(method, scene, region, acting, active, block, pace, report);
///     if (sweeps.run(resume) == membrane::StepStatus::advanced) ...      // positions moved, forces looked at
namespace membrane {

namespace detail {

// Nothing where the visits cannot be in lanes whatever the backing.
template <class Scalar, class Rule, class Network>
[[nodiscard]] Index most_in_lanes(const SolverOptions<Scalar>& options) noexcept {
    constexpr bool possible = VisitsInLanes<Scalar, Rule, Network, NoVolumeSprings>;
    return possible && options.order != VisitOrder::arrival && !options.layers_as_needed ? options.most_in_groups : 0;
}

}  // namespace detail

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The visits of one step: layer 0 and what the constraints then mend, in rounds, and all the vertices beyond; again until
/// nothing changes, the sweeps are done, or time is up. In the end a look at the forces on all of them.
template <class Method, class Scalar, class Scene, class Pace>
class Sweeps {
  public:
    Sweeps(const Method& method, const Scene& scene, Region<Scalar>& region, const ConstraintSet<Scalar>& acting,
           ActiveVertices& active, CompactBlock<Scalar>& block, Pace& pace, StepReport<Scalar>& report) noexcept
        : method_(method),
          scene_(scene),
          region_(region),
          acting_(acting),
          active_(active),
          block_(block),
          pace_(pace),
          report_(report) {}

    /// All of it, and what came of it. The first sweep begins at place `resume` of the vertices beyond layer 0; there the
    /// next step is to go on. Where it is not `advanced`, positions are to be put back.
    [[nodiscard]] StepStatus run(std::size_t& resume) noexcept;

    /// Whether the constraints had something to mend, or may have had, at the very end.
    [[nodiscard]] bool mended() const noexcept { return mended_; }

  private:
    using Rule = decltype(Method::rule);
    // Somebody in a hurry has no time for as much as is worth sharing.
    static constexpr bool alone =
        std::is_same_v<decltype(Method::executor), OneThread> || !std::is_same_v<Pace, NoHurry>;
    static constexpr bool can_use_lanes =
        VisitsInLanes<Scalar, Rule, std::remove_cvref_t<decltype(std::declval<Scene>().network)>,
                      std::remove_cvref_t<decltype(std::declval<Scene>().volume)>>;

    void open_block() noexcept;
    bool sweep(std::size_t& resume) noexcept;
    bool rounds() noexcept;
    bool pass(std::span<const Index> vertices) noexcept;
    bool pass_in_lanes(std::size_t begin, std::size_t end) noexcept;
    [[nodiscard]] std::size_t batch_from(std::size_t p, std::size_t last) const noexcept;
    bool visit_packs(std::size_t begin, std::size_t end) noexcept;
    bool take(std::size_t p, typename CompactBlock<Scalar>::Visit visit) noexcept;
    bool grow() noexcept;
    bool visit(Index v) noexcept;
    bool look() noexcept;
    bool look_at(Index v, const Vector3<Scalar>& force) noexcept;

    const Method& method_;
    const Scene& scene_;
    Region<Scalar>& region_;
    const ConstraintSet<Scalar>& acting_;
    ActiveVertices& active_;
    CompactBlock<Scalar>& block_;
    Pace& pace_;
    StepReport<Scalar>& report_;
    const Index* next_ = nullptr;    // the vertex beyond layer 0 at which time ran out, if it did there
    bool constraints_hold_ = false;  // seen when they were last enforced, and nothing has moved since
    bool mended_ = false;
    bool in_lanes_ = false;  // the groups of the block are visited all at once
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <class Method, class Scalar, class Scene, class Pace>
StepStatus Sweeps<Method, Scalar, Scene, Pace>::run(std::size_t& resume) noexcept {
    pace_.begin(active_.vertices().size() + active_.frontier().size());
    open_block();
    bool changed = true;
    for (Index i = 0; i < method_.options.sweeps && changed && !report_.out_of_time; ++i) {
        changed = sweep(resume);
        if (report_.status != StepStatus::advanced) return report_.status;
    }
    if (changed && !constraints_hold_) {
        if (!pace_.has_time_to_enforce()) report_.out_of_time = true;
        mended_ = report_.out_of_time || acting_.enforce();
    }
    if (look()) return StepStatus::advanced;
    region_.put_back([&](Index v) { return !region_.held(v); });
    return look() ? StepStatus::unstable : StepStatus::bad_input;  // no better: what was handed in is to blame
}

// Groups are visited in lanes, if all of the queue's are lined up, and forces of constraints act on layer 0 alone.
template <class Method, class Scalar, class Scene, class Pace>
void Sweeps<Method, Scalar, Scene, Pace>::open_block() noexcept {
    if constexpr (can_use_lanes) {
        if (active_.has_new_queue()) block_.packs().follow(active_.queue(), scene_.network);
        const auto pushed = scene_.work.pushed.items();
        in_lanes_ = active_.from_queue() == active_.queue().vertices().size() &&
                    std::all_of(pushed.begin(), pushed.end(), [&](Index v) { return scene_.work.seeds.contains(v); });
        if (!in_lanes_) return;
        block_.packs().append(active_.vertices(), active_.from_queue(), active_.group_ends(), scene_.network);
        block_.open(scene_, [&](Index v) { return region_.fixed(v); });
    }
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::sweep(std::size_t& resume) noexcept {
    bool changed = rounds();
    if (report_.status != StepStatus::advanced) return changed;
    const auto beyond = active_.beyond();
    const std::size_t begin = (std::min)(std::exchange(resume, 0), beyond.size());
    bool moved = pass(beyond.subspan(begin));
    moved |= pass(beyond.first(begin));
    while (grow()) moved = true;
    if (moved) constraints_hold_ = false;
    if (next_ != nullptr) resume = static_cast<std::size_t>(next_ - beyond.data());
    return changed || moved;
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::rounds() noexcept {
    const auto touched = active_.touched();
    bool changed = false;
    for (Index i = 0; i < method_.options.contact_visits; ++i) {
        if (!pace_.has_time_for_round(touched.size())) {
            report_.out_of_time = true;
            break;
        }
        for (const Index v : touched) changed |= visit(v);
        pace_.visited(touched.size());
        if (report_.status != StepStatus::advanced) break;
        constraints_hold_ = !acting_.enforce();
        pace_.enforced();
        if (constraints_hold_) break;
        changed = true;
    }
    return changed;
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::pass(std::span<const Index> vertices) noexcept {
    bool changed = false;
    const auto begin = static_cast<std::size_t>(vertices.data() - active_.beyond().data());
    if (in_lanes_ && begin < block_.packs().size()) {
        const std::size_t end = (std::min)(begin + vertices.size(), block_.packs().size());
        changed = pass_in_lanes(begin, end);
        vertices = vertices.subspan(end - begin);
    }
    while (!vertices.empty() && next_ == nullptr) {
        if (!pace_.has_time_for_batch()) {
            report_.out_of_time = true;
            next_ = vertices.data();
            break;
        }
        const auto batch = vertices.first((std::min)(visits_in_batch, vertices.size()));
        for (const Index v : batch) changed |= visit(v);
        pace_.visited(batch.size());
        vertices = vertices.subspan(batch.size());
    }
    return changed;
}

// Vertices number `begin` to `end` beyond layer 0, in whole groups.
template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::pass_in_lanes(std::size_t begin, std::size_t end) noexcept {
    bool changed = false;
    if constexpr (can_use_lanes) {
        auto& packs = block_.packs();
        packs.load(scene_.x, method_.executor);
        std::size_t p = packs.pack_from(begin);
        const std::size_t last = packs.pack_from(end);
        while (p < last && next_ == nullptr && report_.status == StepStatus::advanced) {
            if (!pace_.has_time_for_batch()) {
                report_.out_of_time = true;
                next_ = active_.beyond().data() + packs.place_of(p);
                break;
            }
            const Index before = report_.visits;
            const std::size_t next = batch_from(p, last);
            changed |= visit_packs(p, next);
            pace_.visited(static_cast<std::size_t>(report_.visits - before));
            p = next;
        }
        if (changed) packs.store(scene_.x, method_.executor);
    }
    return changed;
}

// Where a batch of packs ends that begins with `p`: with helpers, where the group does.
template <class Method, class Scalar, class Scene, class Pace>
std::size_t Sweeps<Method, Scalar, Scene, Pace>::batch_from(std::size_t p, std::size_t last) const noexcept {
    if constexpr (alone) return (std::min)(p + visits_in_batch / Lanes<Scalar>::count, last);
    const std::size_t touched = active_.touched().size(), place = touched + block_.packs().place_of(p);
    for (const auto ends : {active_.queue().group_ends(), active_.group_ends()}) {
        const auto end = std::upper_bound(ends.begin(), ends.end(), place);
        if (end != ends.end()) return (std::min)(block_.packs().pack_from(*end - touched), last);
    }
    return last;
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::visit_packs(std::size_t begin, std::size_t end) noexcept {
    bool changed = false;
    if constexpr (!alone) block_.visit(begin, end - begin, scene_, method_.rule, method_.executor);
    for (std::size_t p = begin; p < end && report_.status == StepStatus::advanced; ++p) {
        changed |= take(p, alone ? block_.visit(p, scene_, method_.rule) : block_.outcome(p));
    }
    return changed;
}

// What came of a visit. Beyond a limit that costs nothing it is looked at closely whether a move is stable.
template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::take(std::size_t p, typename CompactBlock<Scalar>::Visit visit) noexcept {
    using Visit = typename CompactBlock<Scalar>::Visit;
    report_.visits += block_.free_count(p);
    if constexpr (moves_along_force<Rule, Scalar> && !is_safe_rule<Rule>) {
        if (visit == Visit::too_far) {
            block_.packs().store(scene_.x);
            for (const Index v : block_.packs().vertices(p)) {
                if (region_.fixed(v) || !diverges(scene_, v, method_.rule.compliance(state_of<Rule>(scene_, v))))
                    continue;
                report_.status = StepStatus::unstable;
                return false;
            }
            visit = block_.visit(p, scene_, method_.rule, true);
        }
    }
    return visit == Visit::moved;
}

// Where layers are added as needed: adds the next one, and visits it, if a force on it is not negligible.
template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::grow() noexcept {
    const auto frontier = active_.frontier();
    if (frontier.empty() || next_ != nullptr) return false;
    if (!pace_.has_time_for_batch()) {
        report_.out_of_time = true;
        return false;
    }
    report_.visits += static_cast<Index>(frontier.size());
    const bool needed = std::any_of(frontier.begin(), frontier.end(), [&](Index v) {
        return !region_.fixed(v) && norm(pull_on(scene_, v).force) > scene_.work.negligible_force;
    });
    pace_.visited(frontier.size());
    const std::size_t before = active_.vertices().size();
    if (!needed) return false;
    active_.grow(scene_.network, method_.options);
    for (const Index v : active_.frontier()) region_.save(v);
    pace_.looks_at(active_.vertices().size() + active_.frontier().size());
    pass(active_.vertices().subspan(before));
    return true;
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::visit(Index v) noexcept {
    if (region_.fixed(v)) return false;
    ++report_.visits;
    const auto state = state_of<Rule>(scene_, v);
    if (state.touched) {
        const Scalar touches = scene_.work.stiffness[static_cast<std::size_t>(v)];
        region_.set_resistance(v, norm<Scalar>(state.force - point(scene_.work.external, v)),
                               state.stiffness - (std::max)(touches, Scalar(0)));
    }
    const auto compliance = method_.rule.compliance(state);
    if constexpr (moves_along_force<Rule, Scalar>) {
        if (!is_safe_rule<Rule> && compliance * state.stiffness >= 2 && diverges(scene_, v, compliance)) {
            report_.status = StepStatus::unstable;
            return false;
        }
        region_.set_compliance(v, compliance);
    } else {
        region_.set_compliance(v, compliance, state.stiffness > 0 ? 1 / state.stiffness : Scalar(0));
    }
    if (!(norm(state.force) > scene_.work.negligible_force)) return false;
    scene_.x.col(v) += held_back<Rule>(scene_, v, compliance * state.force);
    return true;
}

// The forces at the end; false if any is not finite.
template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::look() noexcept {
    bool finite = true;
    std::size_t seen = 0;  // beyond layer 0
    if constexpr (can_use_lanes) {
        if (in_lanes_) {
            block_.packs().load(scene_.x, method_.executor);
            for (std::size_t p = 0; p < block_.packs().count(); ++p) {
                const auto forces = block_.forces(p, scene_);
                const auto vertices = block_.packs().vertices(p);
                for (std::size_t i = 0; i < vertices.size(); ++i) {
                    if (region_.held(vertices[i])) continue;
                    region_.set_compliance(vertices[i], block_.compliance(p)[i]);
                    finite &= look_at(vertices[i], {forces[0][i], forces[1][i], forces[2][i]});
                }
            }
            seen = block_.packs().size();
        }
    }
    for (const auto vertices : {active_.touched(), active_.beyond().subspan(seen), active_.frontier()}) {
        for (const Index v : vertices) {
            if (!region_.held(v)) finite &= look_at(v, pull_on(scene_, v).force);
        }
    }
    for (const Index v : scene_.work.held.items()) finite &= look_at(v, pull_on(scene_, v).force);
    return finite;
}

template <class Method, class Scalar, class Scene, class Pace>
bool Sweeps<Method, Scalar, Scene, Pace>::look_at(Index v, const Vector3<Scalar>& force) noexcept {
    ++report_.visits;
    region_.set_unbalanced(v, force);
    if (!region_.fixed(v)) report_.residual = (std::max)(report_.residual, norm(force));
    return is_finite(force);
}

}  // namespace membrane
