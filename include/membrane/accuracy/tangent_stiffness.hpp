// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/accuracy/stiffness_operator.hpp>

/// How stiff a membrane feels to whoever holds it.
///
///     membrane::TangentStiffness tangent(network);                                  // offline: allocates all it needs
///     const auto feel = tangent.of(solver.queue().vertices(), x, network, foundation, membrane::pull(7, target));
///     if (feel.status == TangentStatus::found) largest_eigenvalue(feel.stiffness);  // [N/m]
namespace membrane {

struct TangentOptions {
    double tolerance = 1e-7;  ///< of forces on free vertices, in parts of what a shift begins with
    Index iterations = 300;   ///< products with the stiffness of all springs, at the most, for each of three directions

    /// @throws InvalidInput for an option out of its range
    void check() const;
};

enum class TangentStatus {
    found,
    not_stable,     ///< the energy has a direction in which it does not grow: what is free would snap away
    not_converged,  ///< more iterations are needed
    contact,        ///< a tool touches: not treated
    unsupported,  ///< a constraint that does not `describe` itself, or held points with a corner that is held otherwise
    invalid_input,  ///< a number is not finite, an index names no vertex, counts do not agree
};

struct TangentReport {
    TangentStatus status = TangentStatus::invalid_input;
    Symmetric3<double> stiffness;  ///< the reaction of the first constraint changes by -`stiffness` d [N/m]
    Index iterations = 0;          ///< in all three directions
};

/// The derivative of a reaction by a rigid shift d of what its constraint holds (a vertex, a point of a triangle,
/// pins), the free vertices following to where they balance: T = H_hh - H_hf H_ff^-1 H_fh, H the second derivative of
/// the energy at the state, f what is free, h what is held (the Schur complement; in statics, condensation [Guyan65]).
/// At an equilibrium that is the slope of the force over the way; elsewhere it is as good as the state is near one.
///
/// Remembers nothing from call to call. One thread at a time for each.
class TangentStiffness {
  public:
    /// @throws InvalidInput for an option out of its range. Cost: O(V + springs) memory.
    template <Real Scalar, class Law>
    explicit TangentStiffness(const MassSpringNetwork<Scalar, Law>& network, const TangentOptions& options = {});

    /// For `held`, one of the constraints of a step (pins name each vertex once), the others staying where they are,
    /// and all vertices free that none of them holds. Damping is left out. Online.
    /// Cost: O(V + springs) for each iteration.
    template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Held, Constraint<Scalar>... Others>
    [[nodiscard]] TangentReport of(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                   const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                   const Held& held, const Others&... others) noexcept;

    /// The same with only the vertices in `free` free, as a solver has it whose queue this is.
    template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Held, Constraint<Scalar>... Others>
    [[nodiscard]] TangentReport of(std::span<const Index> free, const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                   const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                   const Held& held, const Others&... others) noexcept;

  private:
    [[nodiscard]] static TangentStatus status_of(ProblemStatus status) noexcept;
    template <class Held>
    [[nodiscard]] TangentReport condense(ProblemStatus status, const Held& held) noexcept;
    [[nodiscard]] Vector3<double> answer(int direction) noexcept;

    TangentOptions options_;
    EquilibriumProblem problem_;
    StiffnessOperator stiffness_;
    Points<double> shift_, force_, displacement_;
    std::vector<double> shares_;  // of each vertex in the reaction
    TangentReport report_;
};

inline void TangentOptions::check() const {
    constexpr std::string_view component = "TangentStiffness";
    if (!is_finite(tolerance) || !(tolerance > 0 && tolerance < 1)) {
        refuse(component, "tolerance must lie between 0 and 1, got ", tolerance);
    }
    if (iterations < 1) refuse(component, "iterations must be at least 1, got ", iterations);
}

template <Real Scalar, class Law>
TangentStiffness::TangentStiffness(const MassSpringNetwork<Scalar, Law>& network, const TangentOptions& options)
    : options_((options.check(), options)),
      problem_(network),
      stiffness_(problem_),
      shift_(Points<double>::Zero(3, network.vertex_count())),
      force_(shift_),
      displacement_(shift_),
      shares_(static_cast<std::size_t>(network.vertex_count())) {}

template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Held, Constraint<Scalar>... Others>
TangentReport TangentStiffness::of(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                   const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                   const Held& held, const Others&... others) noexcept {
    return condense(problem_.take(x, network, volume, held, others...), held);
}

template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Held, Constraint<Scalar>... Others>
TangentReport TangentStiffness::of(std::span<const Index> free, const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                   const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                   const Held& held, const Others&... others) noexcept {
    const auto status = problem_.take(x, network, volume, held, others...);
    return condense(status == ProblemStatus::valid ? problem_.fix_all_but(free) : status, held);
}

inline TangentStatus TangentStiffness::status_of(ProblemStatus status) noexcept {
    switch (status) {
        case ProblemStatus::valid: return TangentStatus::found;
        case ProblemStatus::contact: return TangentStatus::contact;
        case ProblemStatus::unsupported: return TangentStatus::unsupported;
        default: return TangentStatus::invalid_input;
    }
}

template <class Held>
TangentReport TangentStiffness::condense(ProblemStatus status, const Held& held) noexcept {
    report_ = {};
    report_.status = status_of(status);
    if (report_.status != TangentStatus::found) return report_;
    stiffness_.at(problem_, problem_.centre());
    std::fill(shares_.begin(), shares_.end(), 0.0);
    for_each_term(held, [&](const ConstraintTerm& term) { problem_.share(term, shares_); });
    const Vector3<double> x = answer(0), y = answer(1), z = answer(2);
    report_.stiffness = {x[0], y[1], z[2], (x[1] + y[0]) / 2, (x[2] + z[0]) / 2, (y[2] + z[1]) / 2};
    return report_;
}

// The change of force, the other way round, for a shift by one metre along an axis.
inline Vector3<double> TangentStiffness::answer(int direction) noexcept {
    shift_.setZero();
    for (Index v = 0; v < problem_.vertex_count(); ++v) shift_(direction, v) = shares_[static_cast<std::size_t>(v)];
    stiffness_.multiply(problem_, shift_, force_);
    displacement_.setZero();
    const auto solved = stiffness_.solve(problem_, force_, displacement_, {options_.tolerance, options_.iterations});
    report_.iterations += solved.iterations;
    if (!solved.convex) report_.status = TangentStatus::not_stable;
    if (!solved.converged && report_.status == TangentStatus::found) report_.status = TangentStatus::not_converged;
    shift_ -= displacement_;
    stiffness_.multiply(problem_, shift_, force_);
    Vector3<double> sum = Vector3<double>::Zero();
    for (Index v = 0; v < problem_.vertex_count(); ++v) sum += shares_[static_cast<std::size_t>(v)] * point(force_, v);
    return sum;
}

}  // namespace membrane
