// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/accuracy/stiffness_operator.hpp>

/// The stiffness that a membrane presents to a constraint that holds it.
///
///     membrane::TangentStiffness tangent(network);                                  // offline: allocates all it needs
///     const auto feel = tangent.compute(solver.queue().vertices(), x, network, foundation, membrane::pull(7, target));
///     if (feel.status == membrane::TangentStatus::found) largest_eigenvalue(feel.stiffness);  // [N/m]
namespace membrane {

/// Options of a `TangentStiffness`.
struct TangentOptions {
    double tolerance = 1e-7;  ///< of residual forces on free vertices, relative to those at first
    Index iterations = 300;   ///< maximum number of products with the stiffness, for each of three directions

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

/// Whether the stiffness was found, or why not.
enum class TangentStatus {
    found,          ///< to the tolerance
    not_stable,     ///< the energy does not grow in some direction: free vertices would snap away
    not_converged,  ///< more iterations are needed
    contact,        ///< a tool touches: not supported
    unsupported,    ///< a constraint without `describe`, or an attached point that shares a corner with another one
    invalid_input,  ///< a number is not finite, an index is not a vertex, or counts do not match
};

/// The name of the status, as above.
[[nodiscard]] constexpr std::string_view to_string(TangentStatus status) noexcept {
    switch (status) {
        case TangentStatus::found: return "found";
        case TangentStatus::not_stable: return "not_stable";
        case TangentStatus::not_converged: return "not_converged";
        case TangentStatus::contact: return "contact";
        case TangentStatus::unsupported: return "unsupported";
        case TangentStatus::invalid_input: return "invalid_input";
    }
    return "";
}

/// Result of `compute`.
struct TangentReport {
    TangentStatus status = TangentStatus::invalid_input;  ///< the stiffness is valid only if this is `found`
    Symmetric3<double> stiffness;  ///< the reaction of the first constraint changes by -`stiffness` d [N/m]
    Index iterations = 0;          ///< in all three directions
};

/// The derivative of a reaction by a rigid displacement d of the vertices that its constraint holds (a vertex, a point
/// of a triangle, pins), while the free vertices follow in equilibrium: T = H_hh - H_hf H_ff^-1 H_fh. H is the Hessian
/// of the energy at the state, f are the free vertices, h the prescribed ones (the Schur complement; in statics,
/// condensation [Guyan65]). At an equilibrium T is the derivative of the force by the displacement; elsewhere its error
/// depends on the distance from an equilibrium.
///
/// Calls are independent of each other. One thread at a time for each instance.
class TangentStiffness {
  public:
    /// @throws InvalidInput for an option out of its range. Cost: O(V + springs) memory.
    template <Real Scalar, class Law>
    explicit TangentStiffness(const MassSpringNetwork<Scalar, Law>& network, const TangentOptions& options = {});

    /// The stiffness at `prescribed`, one of the constraints of a step (pins name each vertex once). The other
    /// constraints do not move; all vertices that no constraint fixes are free. Damping is left out. Online. Cost: O(V
    /// + springs) for each iteration.
    template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Prescribed,
              Constraint<Scalar>... Others>
    [[nodiscard]] TangentReport compute(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                        const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                        const Prescribed& prescribed, const Others&... others) noexcept;

    /// The stiffness with only the vertices in `free` free, as in a solver with this queue.
    template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Prescribed,
              Constraint<Scalar>... Others>
    [[nodiscard]] TangentReport compute(std::span<const Index> free,
                                        const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                        const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                        const Prescribed& prescribed, const Others&... others) noexcept;

  private:
    [[nodiscard]] static TangentStatus status_of(ProblemStatus status) noexcept;
    template <class Prescribed>
    [[nodiscard]] TangentReport condense(ProblemStatus status, const Prescribed& prescribed) noexcept;
    [[nodiscard]] Vector3<double> stiffness_column(int direction) noexcept;

    TangentOptions options_;
    EquilibriumProblem problem_;
    StiffnessOperator stiffness_;
    Points<double> shift_, force_, displacement_;
    std::vector<double> shares_;  // of each vertex in the reaction
    TangentReport report_;
};

inline void TangentOptions::validate() const {
    constexpr std::string_view component = "TangentStiffness";
    if (!is_finite(tolerance) || !(tolerance > 0 && tolerance < 1)) {
        refuse(component, "tolerance must lie between 0 and 1, got ", tolerance);
    }
    if (iterations < 1) refuse(component, "iterations must be at least 1, got ", iterations);
}

template <Real Scalar, class Law>
TangentStiffness::TangentStiffness(const MassSpringNetwork<Scalar, Law>& network, const TangentOptions& options)
    : options_((options.validate(), options)),
      problem_(network),
      stiffness_(problem_),
      shift_(Points<double>::Zero(3, network.vertex_count())),
      force_(shift_),
      displacement_(shift_),
      shares_(static_cast<std::size_t>(network.vertex_count())) {}

template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Prescribed, Constraint<Scalar>... Others>
TangentReport TangentStiffness::compute(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                        const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                        const Prescribed& prescribed, const Others&... others) noexcept {
    return condense(problem_.assign(x, network, volume, prescribed, others...), prescribed);
}

template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar> Prescribed, Constraint<Scalar>... Others>
TangentReport TangentStiffness::compute(std::span<const Index> free,
                                        const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                        const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                        const Prescribed& prescribed, const Others&... others) noexcept {
    const auto status = problem_.assign(x, network, volume, prescribed, others...);
    return condense(status == ProblemStatus::valid ? problem_.fix_all_but(free) : status, prescribed);
}

inline TangentStatus TangentStiffness::status_of(ProblemStatus status) noexcept {
    switch (status) {
        case ProblemStatus::valid: return TangentStatus::found;
        case ProblemStatus::contact: return TangentStatus::contact;
        case ProblemStatus::unsupported: return TangentStatus::unsupported;
        default: return TangentStatus::invalid_input;
    }
}

template <class Prescribed>
TangentReport TangentStiffness::condense(ProblemStatus status, const Prescribed& prescribed) noexcept {
    report_ = {};
    report_.status = status_of(status);
    if (report_.status != TangentStatus::found) return report_;
    stiffness_.at(problem_, problem_.centre());
    std::fill(shares_.begin(), shares_.end(), 0.0);
    for_each_term(prescribed, [&](const ConstraintTerm& term) { problem_.share(term, shares_); });
    const Vector3<double> x = stiffness_column(0), y = stiffness_column(1), z = stiffness_column(2);
    report_.stiffness = {x[0], y[1], z[2], (x[1] + y[0]) / 2, (x[2] + z[0]) / 2, (y[2] + z[1]) / 2};
    return report_;
}

// The change of the reaction, with opposite sign, for a displacement by one metre along an axis.
inline Vector3<double> TangentStiffness::stiffness_column(int direction) noexcept {
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
