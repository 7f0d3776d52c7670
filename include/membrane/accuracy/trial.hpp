// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/solve/quasi_static.hpp>

/// Cost and error of a solver setting in a recorded scene.
///
///     #include <membrane/accuracy/trial.hpp>
///     const auto trajectory = membrane::ToolTrajectory(mesh, tools, 1e-3);  // recorded: one tool for each tick
///     const auto references = membrane::equilibria(mesh, network, foundation, trajectory);
///     const auto result =
///         membrane::run_trial(mesh, network, foundation, trajectory, references, {.layers = 6, .sweeps = 2});
///     result.force_error;                                                   // relative to the force
///     result.time;                                                          // of a tick [s]
namespace membrane {

namespace detail {

template <class Constraints, class Scalar>
inline constexpr bool are_constraints = false;
template <class... Each, class Scalar>
inline constexpr bool are_constraints<std::tuple<Each...>, Scalar> = ((Constraint<Each, Scalar> &&
                                                                       StaticConstraint<Each>)&&...);

}  // namespace detail

/// The constraints on a membrane over the ticks of a scene. A history is called once for each tick in order, with the
/// present positions (3 x V [m]) and a list of vertices, which has every vertex moved since the last call and may have
/// others. It returns the constraints of the tick in a std::tuple. Not checked by the compiler: a copy of a history
/// that has not been called starts at tick 0, and the same sequence of calls returns the same constraints.
template <class History, class Scalar>
concept LoadHistory = Real<Scalar> && std::copyable<History> &&
    requires(History& history, const History& idle, Index tick, const ConstPointsRef<Scalar>& x,
             std::span<const Index> moved) {
    { idle.ticks() } -> std::same_as<Index>;
    { idle.dt() } -> std::same_as<Scalar>;  // [s]
    requires detail::are_constraints<std::remove_cvref_t<decltype(history(tick, x, moved))>, Scalar>;
};

namespace detail {

template <class History, class Scalar>
consteval bool check_load_history() noexcept {
    static_assert(std::copyable<History>, "LoadHistory: must be copyable");
    static_assert(
        requires(const History& idle) {
            { idle.ticks() } -> std::same_as<Index>;
        },
        "LoadHistory: ticks() const must return Index");
    static_assert(
        requires(const History& idle) {
            { idle.dt() } -> std::same_as<Scalar>;
        },
        "LoadHistory: dt() const must return Scalar [s]");
    static_assert(LoadHistory<History, Scalar>,
                  "LoadHistory: history(Index tick, const ConstPointsRef<Scalar>& x, std::span<const Index> moved) "
                  "must return a std::tuple of what is a Constraint and a StaticConstraint");
    return LoadHistory<History, Scalar>;
}

}  // namespace detail

/// A `LoadHistory`; if a type is not one, the compile error names the missing requirement.
template <class History, class Scalar>
concept CheckedLoadHistory = detail::check_load_history<History, Scalar>();

/// A tool that presses, slides, grasps and pulls along a recorded trajectory.
template <Real Scalar>
class ToolTrajectory {
  public:
    /// A tool for each tick of `dt` [s], in the coordinates of the mesh.
    /// @throws InvalidInput for no tools, one that is not valid, or a `dt` that is not finite and positive
    ToolTrajectory(const TriangleMesh<Scalar>& mesh, const std::type_identity_t<std::span<const Tool<Scalar>>>& tools,
                   std::type_identity_t<Scalar> dt);

    /// Number of tools.
    [[nodiscard]] Index ticks() const noexcept { return static_cast<Index>(tools_.size()); }

    /// Length of a tick [s].
    [[nodiscard]] Scalar dt() const noexcept { return dt_; }

    /// The contact of the tick, and the attachment of the forceps. The contact is valid until the next call.
    [[nodiscard]] std::tuple<ToolContact<Scalar>, PointAttachment<Scalar>> operator()(
        Index tick, const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;

  private:
    std::vector<Tool<Scalar>> tools_;
    Scalar dt_;
    AabbTree<Scalar> tree_;
    ContactTracker<Scalar> tracker_;
    Grasper<Scalar> grasper_;
};
static_assert(LoadHistory<ToolTrajectory<float>, float> && LoadHistory<ToolTrajectory<double>, double>);

/// The equilibrium in one tick, with its reactions.
struct ReferenceTick {
    Index tick;                              ///< number of the tick
    Points<double> x;                        ///< 3 x V [m]
    std::vector<Vector3<double>> reactions;  ///< for each constraint in order [N]
    double force;                            ///< root of the sum of squares over the felt reactions [N]
};

/// The equilibrium of every tick, or of every `tick_stride`-th, each started from the positions of the tick before. In
/// a tick without one the solver takes a step with all layers and 16 sweeps. A tick without a converged equilibrium is
/// left out. Equilibria are static: with a damped foundation the error of a setting includes the viscous lag.
/// @throws InvalidInput for arguments that `equilibrium` refuses, a history without ticks or with a `dt` that is not
/// finite and positive, or a `tick_stride` below 1. Offline. Cost: an `equilibrium` for each `tick_stride`-th tick, and
/// a step for each other tick.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History>
[[nodiscard]] std::vector<ReferenceTick> equilibria(const TriangleMesh<Scalar>& mesh, const Network& network,
                                                    const Volume& volume, History history, Index tick_stride = 1);

/// Cost and error of a setting. A reaction is felt if its constraint has a term other than loads and pins, or has no
/// description.
struct TrialResult {
    double force_error = 0;     ///< rms over the ticks of the felt reactions' error, over the rms of the reactions
    double position_error = 0;  ///< largest error of a vertex, root mean square over the ticks [m]
    double time = 0;            ///< mean of history and step over ticks with a felt force [s]
    Index layers_reached = 0;   ///< by the queue; below `layers` where no vertex was left to add
    Index ticks_compared = 0;   ///< ticks with a reference
    bool advanced = true;       ///< no step was refused; otherwise errors and time are infinite
};

/// Seconds of the steady clock. On a busy machine a clock of processor time is more reproducible.
struct SteadySeconds {
    /// Time since an arbitrary origin [s].
    [[nodiscard]] double operator()() const noexcept {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    }
};

/// Runs `history` with a solver of these options from the undeformed mesh, each step from the positions of the one
/// before, and compares it with `references`. `clock()` returns the time [s].
/// @throws InvalidInput for a history without ticks, options that the solver refuses, and `references` that are empty,
/// not in order, or of another number of vertices or constraints. Offline.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule = BlockStep, class Clock = SteadySeconds>
[[nodiscard]] TrialResult run_trial(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                    History history, std::span<const ReferenceTick> references,
                                    const SolverOptions<Scalar>& options, const Rule& rule = {},
                                    const Clock& clock = {});

namespace detail {

/// Whether the force of a constraint is felt: false if it has only loads and pins.
template <class C>
[[nodiscard]] bool is_felt(const C& constraint) {
    bool felt = !DescribedConstraint<C>;
    for_each_term(constraint, [&](const ConstraintTerm& term) {
        felt |= term.kind != ConstraintTerm::Kind::pin && term.kind != ConstraintTerm::Kind::load;
    });
    return felt;
}

/// The sum of `square(i)` over the constraints with a felt force.
template <class Constraints, class Square>
[[nodiscard]] double sum_of_felt(const Constraints& constraints, Square square) {
    double sum = 0;
    std::size_t i = 0;
    const auto add = [&](const auto& constraint) {
        if (is_felt(constraint)) sum += square(i);
        ++i;
    };
    std::apply([&](const auto&... each) { (add(each), ...); }, constraints);
    return sum;
}

template <Real Scalar, CheckedLoadHistory<Scalar> History>
void check_history(std::string_view component, const History& history) {
    if (history.ticks() < 1) refuse(component, "the history must have a tick, got ", history.ticks());
    if (!is_finite(history.dt()) || !(history.dt() > 0)) {
        refuse(component, "dt of the history must be finite and positive [s], got ", history.dt());
    }
}

/// Sums over the ticks of a trial.
struct TrialSums {
    double errors = 0, squares = 0;      // squared errors of forces, squared forces [N^2]
    double position_errors = 0;          // of the vertex with the largest error [m^2]
    double time = 0;                     // of the ticks with a felt force [s]
    Index ticks_compared = 0, felt = 0;  // ticks

    template <class Constraints, class Reactions, class Positions>
    void compare(const ReferenceTick& reference, const Constraints& constraints, const Reactions& reactions,
                 const Positions& x) {
        if (reference.x.cols() != x.cols() || reference.reactions.size() != reactions.size()) {
            refuse("run_trial", "the reference of tick ", reference.tick, " must have ", x.cols(), " vertices and ",
                   reactions.size(), " reactions, got ", reference.x.cols(), " and ", reference.reactions.size());
        }
        errors += sum_of_felt(constraints, [&](std::size_t i) {
            return (reactions[i].template cast<double>() - reference.reactions[i]).squaredNorm();
        });
        squares += reference.force * reference.force;
        position_errors += (x.template cast<double>() - reference.x).colwise().squaredNorm().maxCoeff();
        ++ticks_compared;
    }

    [[nodiscard]] TrialResult result(Index layers) const {
        const auto part = [](double sum, double count) { return sum == 0 ? 0.0 : sum / count; };
        return {.force_error = std::sqrt(part(errors, squares)),
                .position_error = std::sqrt(part(position_errors, ticks_compared)),
                .time = part(time, felt),
                .layers_reached = layers,
                .ticks_compared = ticks_compared};
    }
};

}  // namespace detail

template <Real Scalar>
ToolTrajectory<Scalar>::ToolTrajectory(const TriangleMesh<Scalar>& mesh,
                                       const std::type_identity_t<std::span<const Tool<Scalar>>>& tools,
                                       std::type_identity_t<Scalar> dt)
    : tools_(tools.begin(), tools.end()), dt_(dt), tree_(mesh), tracker_(mesh), grasper_(mesh) {
    detail::check_history<Scalar>("ToolTrajectory", *this);
    for (std::size_t tick = 0; tick < tools_.size(); ++tick) {
        if (!is_valid(tools_[tick])) {
            refuse("ToolTrajectory", "the tool of tick ", tick,
                   " must be finite, its radius not negative, got one that is not");
        }
    }
}

template <Real Scalar>
std::tuple<ToolContact<Scalar>, PointAttachment<Scalar>> ToolTrajectory<Scalar>::operator()(
    Index tick, const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
    const auto& tool = tools_[static_cast<std::size_t>(tick)];
    tree_.refit(x, moved);
    const auto contact = tracker_.update(tree_, x, tool);
    const auto grasp = grasper_.update(contact, x, tool);
    return {press(tool, contact, grasp), pull(tool, grasp)};
}

template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History>
std::vector<ReferenceTick> equilibria(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                      History history, Index tick_stride) {
    detail::check_history<Scalar>("equilibria", history);
    if (tick_stride < 1) refuse("equilibria", "tick_stride must be at least 1, got ", tick_stride);
    std::vector<Index> all(static_cast<std::size_t>(mesh.vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    QuasiStaticSolver<Scalar> between(network, {.layers = unlimited, .sweeps = 16});
    std::vector<ReferenceTick> references;
    Points<Scalar> x = mesh.positions();
    for (Index tick = 0; tick < history.ticks(); ++tick) {
        const auto constraints = history(tick, x, all);
        const auto apply = [&](auto act) { return std::apply(act, constraints); };
        if ((tick + 1) % tick_stride == 0) {
            auto found = apply([&](const auto&... each) { return equilibrium(x, mesh, network, volume, {}, each...); });
            if (found.converged) {
                const double force = std::sqrt(
                    detail::sum_of_felt(constraints, [&](std::size_t i) { return found.reactions[i].squaredNorm(); }));
                x = found.x.template cast<Scalar>();
                between.wake_all();
                references.push_back({tick, std::move(found.x), std::move(found.reactions), force});
                continue;
            }
        }
        apply([&](const auto&... each) { static_cast<void>(between.step(x, history.dt(), network, volume, each...)); });
    }
    return references;
}

template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History, StepRule<Scalar> Rule, class Clock>
TrialResult run_trial(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume, History history,
                      std::span<const ReferenceTick> references, const SolverOptions<Scalar>& options, const Rule& rule,
                      const Clock& clock) {
    detail::check_history<Scalar>("run_trial", history);
    QuasiStaticSolver<Scalar, Rule> solver(network, options, rule);
    Points<Scalar> x = mesh.positions();
    std::vector<Index> moved;
    detail::TrialSums sums;
    Index layers = 0;
    auto reference = references.begin();
    for (Index tick = 0; tick < history.ticks(); ++tick) {
        const double begin = clock();
        const auto constraints = history(tick, x, moved);
        const auto report = std::apply(
            [&](const auto&... each) { return solver.step(x, history.dt(), network, volume, each...); }, constraints);
        const double end = clock();
        if (report.status != StepStatus::advanced) {
            constexpr double infinite = std::numeric_limits<double>::infinity();
            return {.force_error = infinite, .position_error = infinite, .time = infinite, .advanced = false};
        }
        moved.assign(report.moved.begin(), report.moved.end());
        layers = (std::max)(layers, solver.queue().layer_count() - 1);
        const auto square = [&](std::size_t i) { return static_cast<double>(squared_norm(report.reactions[i])); };
        if (detail::sum_of_felt(constraints, square) > 0) {
            sums.time += end - begin;
            ++sums.felt;
        }
        if (reference == references.end() || reference->tick != tick) continue;
        sums.compare(*reference++, constraints, report.reactions, x);
    }
    if (sums.ticks_compared == 0 || reference != references.end()) {
        refuse("run_trial", "references must be of ticks of the history, in order, at least one; got others");
    }
    return sums.result(layers);
}

}  // namespace membrane
