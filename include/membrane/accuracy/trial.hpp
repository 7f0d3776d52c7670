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
    /// A tool for each tick of `dt` [s], in the coordinates of the mesh; `tracker` are the options of its tracker.
    /// @throws InvalidInput for no tools, an invalid one, a `dt` not finite and positive, or an option out of range
    ToolTrajectory(const TriangleMesh<Scalar>& mesh, const std::type_identity_t<std::span<const Tool<Scalar>>>& tools,
                   std::type_identity_t<Scalar> dt, const TrackerOptions& tracker = {});

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
/// left out. Equilibria are static: with a damped foundation the error of a setting includes the viscous force, see
/// `exact_steps`.
/// @throws InvalidInput for arguments that `equilibrium` refuses, a history without ticks or with a `dt` that is not
/// finite and positive, or a `tick_stride` below 1. Offline. Cost: an `equilibrium` for each `tick_stride`-th tick, and
/// a step for each other tick.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History>
[[nodiscard]] std::vector<ReferenceTick> equilibria(const TriangleMesh<Scalar>& mesh, const Network& network,
                                                    const Volume& volume, History history, Index tick_stride = 1);

/// The exact step of every tick, or of every `tick_stride`-th, in place of the equilibrium: with the damping of the
/// foundation, each step solved to the end from the exact positions of the tick before. Against these references the
/// error of a setting is that of its solver alone. A tick is left out if its step was refused or its residual exceeds
/// 1e-6 of the largest force so far.
/// @throws InvalidInput as `equilibria`. Offline. Cost: usually 30 to 400 sweeps over all vertices in each tick, at
/// most 4,000.
template <Real Scalar, ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume,
          CheckedLoadHistory<Scalar> History>
[[nodiscard]] std::vector<ReferenceTick> exact_steps(const TriangleMesh<Scalar>& mesh, const Network& network,
                                                     const Volume& volume, History history, Index tick_stride = 1);

/// What damping adds to the force: rms over the ticks that both have of the difference of their reactions, over the rms
/// of the equilibria's. All reactions count.
/// @throws InvalidInput if the two have no tick with a force in common, or other numbers of reactions. O(ticks).
[[nodiscard]] inline double viscous_difference(std::span<const ReferenceTick> exact,
                                               std::span<const ReferenceTick> equilibria);

/// Cost and error of a setting, and the motion for which they were measured. A reaction is felt if its constraint has a
/// term other than loads and pins, or has no description.
struct TrialResult {
    double force_error = 0;       ///< rms over the ticks of the felt reactions' error, over the rms of the reactions
    double position_error = 0;    ///< largest error of a vertex, root mean square over the ticks [m]
    double time = 0;              ///< mean of history and step over ticks with a felt force [s]
    Index layers_reached = 0;     ///< by the queue; below `layers` where no vertex was left to add
    Index ticks_compared = 0;     ///< ticks with a reference
    bool advanced = true;         ///< no step was refused; otherwise errors and time are infinite
    double max_force_error = 0;   ///< the largest of a tick, over the rms of the reactions
    double max_speed = 0;         ///< of a tool or an attachment with a felt force, from tick to tick [m/s]
    double max_displacement = 0;  ///< of a vertex from the undeformed mesh: about the depth of the tool [m]
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
void check_history(std::string_view component, const History& history, Index tick_stride = 1) {
    if (history.ticks() < 1) refuse(component, "the history must have a tick, got ", history.ticks());
    if (!is_finite(history.dt()) || !(history.dt() > 0)) {
        refuse(component, "dt of the history must be finite and positive [s], got ", history.dt());
    }
    if (tick_stride < 1) refuse(component, "tick_stride must be at least 1, got ", tick_stride);
}

/// Sums over the ticks of a trial.
struct TrialSums {
    double errors = 0, squares = 0;      // squared errors of forces, squared forces [N^2]
    double largest_error = 0;            // squared, of a tick [N^2]
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
        const double error = sum_of_felt(constraints, [&](std::size_t i) {
            return (reactions[i].template cast<double>() - reference.reactions[i]).squaredNorm();
        });
        errors += error;
        largest_error = (std::max)(largest_error, error);
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
                .ticks_compared = ticks_compared,
                .max_force_error = std::sqrt(part(largest_error * ticks_compared, squares))};
    }
};

/// How fast and how far a history moves the membrane.
class MotionRange {
  public:
    explicit MotionRange(const Points<double>& undeformed) : undeformed_(undeformed) {}

    /// One more tick, of length `dt` [s], which has moved the vertices `moved` to `x`.
    template <class Constraints, class Reactions, class Positions>
    void add(const Constraints& constraints, const Reactions& reactions, double dt, const Positions& x,
             std::span<const Index> moved) {
        std::vector<Pusher> now;
        std::size_t i = 0;
        const auto add_terms = [&](const auto& constraint) {
            const bool felt = squared_norm(reactions[i++]) > 0 && is_felt(constraint);
            for_each_term(constraint, [&](const ConstraintTerm& term) {
                const bool presses = term.kind == ConstraintTerm::Kind::press;
                now.push_back({term.kind, felt, presses ? term.tool.position : term.target});
            });
        };
        std::apply([&](const auto&... each) { (add_terms(each), ...); }, constraints);
        for (std::size_t k = 0; k < now.size() && now.size() == before_.size(); ++k) {
            if (!now[k].felt || !before_[k].felt || now[k].kind != before_[k].kind) continue;
            max_speed_ = (std::max)(max_speed_, norm<double>(now[k].position - before_[k].position) / dt);
        }
        before_ = std::move(now);
        for (const Index v : moved) {
            const Vector3<double> there = point(x, v).template cast<double>();
            max_displacement_ = (std::max)(max_displacement_, norm<double>(there - point(undeformed_, v)));
        }
    }

    /// Of a tool or an attachment that was felt in the tick and in the one before [m/s].
    [[nodiscard]] double max_speed() const noexcept { return max_speed_; }

    /// Of a vertex [m].
    [[nodiscard]] double max_displacement() const noexcept { return max_displacement_; }

  private:
    struct Pusher {
        ConstraintTerm::Kind kind;
        bool felt;
        Vector3<double> position;  // [m]
    };

    Points<double> undeformed_;
    std::vector<Pusher> before_;
    double max_speed_ = 0, max_displacement_ = 0;
};

}  // namespace detail

template <Real Scalar>
ToolTrajectory<Scalar>::ToolTrajectory(const TriangleMesh<Scalar>& mesh,
                                       const std::type_identity_t<std::span<const Tool<Scalar>>>& tools,
                                       std::type_identity_t<Scalar> dt, const TrackerOptions& tracker)
    : tools_(tools.begin(), tools.end()), dt_(dt), tree_(mesh), tracker_(mesh, tracker), grasper_(mesh) {
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
    detail::check_history<Scalar>("equilibria", history, tick_stride);
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
          CheckedLoadHistory<Scalar> History>
std::vector<ReferenceTick> exact_steps(const TriangleMesh<Scalar>& mesh, const Network& network, const Volume& volume,
                                       History history, Index tick_stride) {
    detail::check_history<Scalar>("exact_steps", history, tick_stride);
    QuasiStaticSolver<Scalar> solver(network, {.layers = unlimited, .sweeps = 4000});
    std::vector<Index> all(static_cast<std::size_t>(mesh.vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    constexpr double max_residual = 1e-6;  // over the largest force so far
    double largest_force = 0;              // [N]
    std::vector<ReferenceTick> references;
    Points<Scalar> x = mesh.positions();
    for (Index tick = 0; tick < history.ticks(); ++tick) {
        const auto constraints = history(tick, x, all);
        solver.wake_all();
        const auto report = std::apply(
            [&](const auto&... each) { return solver.step(x, history.dt(), network, volume, each...); }, constraints);
        if ((tick + 1) % tick_stride != 0 || report.status != StepStatus::advanced) continue;
        std::vector<Vector3<double>> reactions;
        for (const auto& reaction : report.reactions) reactions.push_back(reaction.template cast<double>());
        const double force =
            std::sqrt(detail::sum_of_felt(constraints, [&](std::size_t i) { return squared_norm(reactions[i]); }));
        largest_force = (std::max)(largest_force, force);
        if (static_cast<double>(report.residual) > max_residual * largest_force) continue;
        references.push_back({tick, x.template cast<double>(), std::move(reactions), force});
    }
    return references;
}

inline double viscous_difference(std::span<const ReferenceTick> exact, std::span<const ReferenceTick> equilibria) {
    double difference = 0, squares = 0;
    auto other = equilibria.begin();
    for (const auto& step : exact) {
        other = std::find_if(other, equilibria.end(), [&](const auto& each) { return each.tick >= step.tick; });
        if (other == equilibria.end()) break;
        if (other->tick != step.tick) continue;
        if (other->reactions.size() != step.reactions.size()) {
            refuse("viscous_difference", "tick ", step.tick, " must have as many reactions in both, got ",
                   step.reactions.size(), " and ", other->reactions.size());
        }
        for (std::size_t i = 0; i < step.reactions.size(); ++i) {
            difference += squared_norm<double>(step.reactions[i] - other->reactions[i]);
            squares += squared_norm(other->reactions[i]);
        }
    }
    if (!(squares > 0)) refuse("viscous_difference", "both must have a tick with a force in common, got none");
    return std::sqrt(difference / squares);
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
    detail::MotionRange range(mesh.positions().template cast<double>());
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
        range.add(constraints, report.reactions, static_cast<double>(history.dt()), x, report.moved);
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
    TrialResult result = sums.result(layers);
    result.max_speed = range.max_speed();
    result.max_displacement = range.max_displacement();
    return result;
}

}  // namespace membrane
