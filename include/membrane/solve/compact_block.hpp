// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>
#include <vector>

#include <membrane/network/volume_springs.hpp>
#include <membrane/solve/curvature.hpp>
#include <membrane/solve/spring_packs.hpp>
#include <membrane/solve/step_rule.hpp>

/// Visits of several vertices at once.
///
///     block.packs().follow(queue, network);              // where the queue has changed
///     block.open(scene, is_fixed);                       // once a step
///     block.packs().load(x);
///     for (std::size_t p = 0; p < block.packs().count(); ++p) static_cast<void>(block.visit(p, scene, rule));
///     block.packs().store(x);
namespace membrane {

/// Whether the visits of a rule may be made in lanes: the network is of springs, their law and the rule reckon with
/// `Lanes`, the backing hands out its springs, and no visit has to look at the energy.
template <class Scalar, class Rule, class Network, class Volume>
concept VisitsInLanes = (Network::never_stiffens ||
                         !is_safe_rule<Rule>)&&requires(const Rule& rule, const Network& network,
                                                        const SpringState<Lanes<Scalar>>& spring,
                                                        const VertexState<Lanes<Scalar>>& vertex) {
    network.law()(spring);
    rule.compliance(vertex);
}
&&(std::same_as<Volume, NoVolumeSprings> || requires(const Volume& volume, const Vector3<Scalar>& start, Scalar dt) {
    { volume.spring(Index(0), start, dt) } -> std::same_as<VolumeSpring<Scalar>>;
});

inline namespace MEMBRANE_INSTRUCTION_SET {

/// Packs of vertices, and all that a step knows of them.
template <Real Scalar>
class CompactBlock {
  public:
    using Several = Lanes<Scalar>;

    /// Has room for `most` vertices.
    template <ElasticNetwork<Scalar> Network>
    explicit CompactBlock(const Network& network, Index most = unlimited)
        : packs_(network, most), ties_(packs_.room()), answers_(packs_.room()), outcomes_(packs_.room()) {}

    [[nodiscard]] SpringPacks<Scalar>& packs() noexcept { return packs_; }
    [[nodiscard]] const SpringPacks<Scalar>& packs() const noexcept { return packs_; }

    /// Begins a step: its volume springs, its masses, and who is fixed.
    template <class Scene, class IsFixed>
    void open(const Scene& scene, IsFixed is_fixed) noexcept;

    /// How many of pack `p` may move.
    [[nodiscard]] Index free_count(std::size_t p) const noexcept { return ties_[p].free_count; }

    enum class Visit : unsigned char { still, moved, too_far };

    /// Moves the vertices of pack `p` as `rule` says. Where that may be beyond what is stable, it is `too_far`, and nothing
    /// moves, unless the move is `allowed`.
    template <class Scene, class Rule>
    Visit visit(std::size_t p, const Scene& scene, const Rule& rule, bool allowed = false) noexcept;

    /// The same for so many packs from number `begin` on that no spring joins, some by each thread; then what came of each.
    template <class Scene, class Rule, Executor Threads>
    void visit(std::size_t begin, std::size_t count, const Scene& scene, const Rule& rule,
               const Threads& executor) noexcept {
        constexpr std::size_t packs_in_task = 32;
        share_out(executor, count, packs_in_task, [&](std::size_t first, std::size_t last) {
            for (std::size_t p = begin + first; p < begin + last; ++p) outcomes_[p] = visit(p, scene, rule);
        });
    }
    [[nodiscard]] Visit outcome(std::size_t p) const noexcept { return outcomes_[p]; }

    /// The forces on the vertices of pack `p`, each in the lane of its number there [N].
    template <class Scene>
    [[nodiscard]] Vector3<Several> forces(std::size_t p, const Scene& scene) const noexcept {
        return pull<Pull<Several>>(p, packs_.positions(p), scene).force;
    }

    /// What they answered at their last visit, at least [m/N].
    [[nodiscard]] const Several& compliance(std::size_t p) const noexcept { return answers_[p].compliance; }

  private:
    // They lie in memory alike for every instruction set.
    struct alignas(32) Ties {
        VolumeSpring<Several> spring;
        Several mass = 1;
        Several free = 0;  // 1 where it may move
        Index free_count = 0;
        bool damps = false;
    };
    struct alignas(32) Answer {
        Several compliance;
    };

    template <class Sum, class Scene>
    [[gnu::always_inline, nodiscard]] inline Sum pull(std::size_t p, const Vector3<Several>& here,
                                                      const Scene& scene) const noexcept;

    SpringPacks<Scalar> packs_;
    std::vector<Ties> ties_;
    std::vector<Answer> answers_;
    std::vector<Visit> outcomes_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

template <Real Scalar>
template <class Scene, class IsFixed>
void CompactBlock<Scalar>::open(const Scene& scene, IsFixed is_fixed) noexcept {
    for (std::size_t p = 0; p < packs_.count(); ++p) {
        Ties& ties = ties_[p] = {};
        const auto vertices = packs_.vertices(p);
        for (std::size_t i = 0; i < vertices.size(); ++i) {
            const Index v = vertices[i];
            answers_[p].compliance.set(i, scene.work.compliance[static_cast<std::size_t>(v)]);
            if (!is_fixed(v)) {
                ties.free.set(i, 1);
                ++ties.free_count;
            }
            if (scene.network.has_masses()) ties.mass.set(i, scene.network.mass(v));
            if constexpr (requires { scene.volume.spring(v, point(scene.work.start, v), scene.dt); }) {
                const auto spring = scene.volume.spring(v, point(scene.work.start, v), scene.dt);
                for (Eigen::Index k = 0; k < 3; ++k) ties.spring.anchor[k].set(i, spring.anchor[k]);
                ties.spring.stiffness.set(i, spring.stiffness);
                ties.spring.rate.set(i, spring.rate);
                ties.damps = ties.damps || spring.rate != 0;
                ties.spring.before.set(i, spring.before);
            }
        }
    }
}

template <Real Scalar>
template <class Sum, class Scene>
Sum CompactBlock<Scalar>::pull(std::size_t p, const Vector3<Several>& here, const Scene& scene) const noexcept {
    Sum sum{};
    packs_.for_each_spring(p, [&](const Vector3<Several>& there, const Several& stiffness, const Several& rest_length) {
        const Vector3<Several> reach = there - here;
        add(sum, pull_of<Several>(scene.network.law(), reach, stiffness, rest_length));
    });
    if constexpr (!std::same_as<std::remove_cvref_t<decltype(scene.volume)>, NoVolumeSprings>) {
        const auto& spring = ties_[p].spring;
        const auto backing = ties_[p].damps ? spring.pull(here) : spring.elastic_pull(here);
        sum.force += backing.force;
        sum.stiffness += backing.stiffness;
    }
    return sum;
}

template <Real Scalar>
template <class Scene, class Rule>
auto CompactBlock<Scalar>::visit(std::size_t p, const Scene& scene, const Rule& rule,
                                 [[maybe_unused]] bool allowed) noexcept -> Visit {
    const Vector3<Several> here = packs_.positions(p);
    VertexState<Several> state;
    if constexpr (requires { requires Rule::needs_relief; }) {
        static_cast<CurvedPull<Several>&>(state) = pull<CurvedPull<Several>>(p, here, scene);
    } else {
        const auto sum = pull<Pull<Several>>(p, here, scene);
        state.force = sum.force;
        state.stiffness = sum.stiffness;
    }
    state.mass = ties_[p].mass;
    state.dt = scene.dt;
    const auto may_move = ties_[p].free != 0;
    const auto compliance = rule.compliance(state);
    if constexpr (moves_along_force<Rule, Scalar>) {
        if constexpr (!is_safe_rule<Rule>) {
            if (!allowed && any((compliance * state.stiffness >= 2) & may_move)) {
                const auto bound = curvature_bound(pull<CurvedPull<Several>>(p, here, scene));
                if (any((compliance * bound >= 2) & may_move)) return Visit::too_far;
            }
        }
        answers_[p].compliance = compliance;
    } else {
        const auto resists = state.stiffness > 0;
        answers_[p].compliance = select(resists, 1 / select(resists, state.stiffness, Several(1)), Several(0));
    }
    const auto moves = (norm(state.force) > Several(scene.work.negligible_force)) & may_move;
    if (!any(moves)) return Visit::still;
    const Vector3<Several> there = here + compliance * state.force;
    Vector3<Several> now;
    for (Eigen::Index k = 0; k < 3; ++k) now[k] = select(moves, there[k], here[k]);
    packs_.move(p, now);
    return Visit::moved;
}

}  // namespace membrane
