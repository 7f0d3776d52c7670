// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/accuracy/stiffness_operator.hpp>
#include <membrane/certify/contact_bounds.hpp>
#include <membrane/certify/convexity.hpp>
#include <membrane/certify/error_report.hpp>

/// A proven bound of the distance of a membrane from equilibrium.
///
///     membrane::ErrorBound bound(network);                                          // offline: allocates all it needs
///     const auto report = solver.step(x, dt, network, foundation, membrane::pull(7, target));
///     const auto error = bound.compute(x, network, foundation, membrane::pull(7, target));
///     if (error.certified()) {
///         error.position;                                             // no vertex is farther from its equilibrium [m]
///         error.reactions[0].max_distance_to(report.reactions[0]);    // error bound of a force [N]
///     }
/// With a tool in contact, from an equilibrium computed by Newton's method:
///
///     const auto rest = membrane::equilibrium(x, mesh, network, foundation, {}, press(tool, contact));
///     const auto error = bound.compute(rest, x, mesh, network, foundation, press(tool, contact));
namespace membrane {

/// Options of an `ErrorBound`.
struct ErrorBoundOptions {
    Index cg_iterations = 200;  ///< at most, over all Newton steps; soft foundations need more

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

/// Proves an upper bound of the distance of a membrane of linear springs from equilibrium. The state may come from any
/// solver, which may have moved all of its vertices or only some: the equilibrium is that of all free vertices.
///
/// The bound is max |y_v - x_v| + e. y is a state near `x`, r are its residual forces, and e bounds the distance from y
/// to the equilibrium. Without tools e = |r| / mu: mu > 0 is a lower bound, computed by `Convexity`, of the eigenvalues
/// of the stiffness at every state whose free vertices are within rho of `x`. C is the set of these states. The bound
/// is proven if it is at most rho. y comes from Newton's method with conjugate gradients (inexact, [Dembo82]), so that
/// near the equilibrium the bound is hardly larger than the distance. With tools, y is an equilibrium computed before,
/// and e includes the work of the contact forces, which `ContactBounds` bounds. Proof: README.md in this folder.
///
/// The proof includes rounding in IEEE double arithmetic. It does not hold with -ffast-math. The equilibrium has no
/// damping forces. A reaction in a step's report may include some; `max_distance_to` then includes them, and the bound
/// still holds. A press without contact, or a pull without a grasp, adds no force: its reaction is exactly zero.
///
/// A result does not depend on earlier calls. Each call invalidates the `reactions` of the last report. One thread at a
/// time for each instance.
template <CheckedConvexityModel Convexity = BlockConvexity>
class ErrorBound {
  public:
    /// @throws InvalidInput for an option out of its range. Cost: O(V + springs) memory.
    template <Real Scalar, class Law>
    explicit ErrorBound(const MassSpringNetwork<Scalar, Law>& network, const ErrorBoundOptions& options = {});

    /// Bounds the error of the state `x` (3 x V [m]) under the constraints of a step. Online. Cost: O(V + springs) for
    /// each CG iteration, and the cost of `Convexity`, usually two or three times.
    template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar>... Constraints>
    [[nodiscard]] ErrorReport compute(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                      const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                      const Constraints&... constraints) noexcept;

    /// Bounds the error with tools in contact; `rest` is the equilibrium under these constraints. The status is
    /// `not_convex` if a tool may touch a fixed or prescribed vertex, or one that another tool may touch, and
    /// `unsupported` with a point attachment. The status is `invalid_input` if a constraint is not valid. Offline.
    /// @throws InvalidInput if a valid constraint does not fit the mesh, such as a contact at a corner that is no
    /// vertex
    template <Real Scalar, class Law, LinearFoundation Volume, StaticConstraint... Constraints>
    [[nodiscard]] ErrorReport compute(const Equilibrium& rest, const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                      const TriangleMesh<Scalar>& mesh, const MassSpringNetwork<Scalar, Law>& network,
                                      const Volume& volume, const Constraints&... constraints);

  private:
    static constexpr int max_attempts = 4;

    void begin(std::size_t constraint_count) noexcept;
    template <class... Constraints>
    [[nodiscard]] ErrorReport report(const Constraints&... constraints) noexcept;
    void locate() noexcept;
    void enclose() noexcept;
    bool refine() noexcept;
    void evaluate_residuals() noexcept;
    bool convex_within(double radius) noexcept;
    [[nodiscard]] double enclosure() const noexcept;
    template <class C>
    [[nodiscard]] ForceEnclosure enclose_reaction(const C& constraint, std::size_t& tool) noexcept;

    ErrorBoundOptions options_;
    EquilibriumProblem problem_;
    StiffnessOperator stiffness_;
    Convexity convexity_;
    ContactBounds pressed_;
    Points<double> y_;             // a state near the equilibrium [m]
    Points<double> force_;         // of springs, foundation and loads, without contacts [N]
    Points<double> residual_;      // with contacts, on free vertices [N]
    Points<double> displacement_;  // a step of Newton's method [m]
    std::vector<double> magnitude_, weights_, slopes_;
    double distance_ = 0, unbalanced_ = 0;  // of y: distance from x [m], norm of the residual [N]
    double radius_ = -1;                    // rho of C [m]
    ErrorReport error_;
    std::array<ForceEnclosure, max_constraints> reactions_{};
};

template <Real Scalar, class Law>
ErrorBound(const MassSpringNetwork<Scalar, Law>&) -> ErrorBound<>;
template <Real Scalar, class Law>
ErrorBound(const MassSpringNetwork<Scalar, Law>&, const ErrorBoundOptions&) -> ErrorBound<>;

inline void ErrorBoundOptions::validate() const {
    if (cg_iterations < 1) refuse("ErrorBound", "cg_iterations must be at least 1, got ", cg_iterations);
}

template <CheckedConvexityModel Convexity>
template <Real Scalar, class Law>
ErrorBound<Convexity>::ErrorBound(const MassSpringNetwork<Scalar, Law>& network, const ErrorBoundOptions& options)
    : options_((options.validate(), options)),
      problem_(network),
      stiffness_(problem_),
      convexity_(problem_),
      pressed_(problem_),
      y_(Points<double>::Zero(3, network.vertex_count())),
      force_(y_),
      residual_(y_),
      displacement_(y_),
      magnitude_(static_cast<std::size_t>(network.vertex_count())),
      weights_(magnitude_),
      slopes_(magnitude_) {}

template <CheckedConvexityModel Convexity>
template <Real Scalar, class Law, LinearFoundation Volume, Constraint<Scalar>... Constraints>
ErrorReport ErrorBound<Convexity>::compute(const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                           const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                           const Constraints&... constraints) noexcept {
    begin(sizeof...(Constraints));
    switch (problem_.assign(x, network, volume, constraints...)) {
        case ProblemStatus::valid: locate(); break;
        case ProblemStatus::contact: error_.status = BoundStatus::contact; return error_;
        case ProblemStatus::unsupported: error_.status = BoundStatus::unsupported; return error_;
        default: return error_;
    }
    return report(constraints...);
}

template <CheckedConvexityModel Convexity>
template <Real Scalar, class Law, LinearFoundation Volume, StaticConstraint... Constraints>
ErrorReport ErrorBound<Convexity>::compute(const Equilibrium& rest,
                                           const std::type_identity_t<ConstPointsRef<Scalar>>& x,
                                           const TriangleMesh<Scalar>& mesh,
                                           const MassSpringNetwork<Scalar, Law>& network, const Volume& volume,
                                           const Constraints&... constraints) {
    begin(sizeof...(Constraints));
    const ProblemStatus status = problem_.assign(x, network, volume, constraints...);
    if (rest.x.cols() != x.cols() || mesh.vertex_count() != x.cols() || !is_finite(rest.x)) return error_;
    if (status == ProblemStatus::invalid_input) return error_;
    if (status == ProblemStatus::unsupported || !problem_.attachments().empty()) {
        error_.status = BoundStatus::unsupported;
        return error_;
    }
    EquilibriumScene scene(problem_.given(), std::vector<unsigned char>(magnitude_.size()));
    (describe(constraints, scene), ...);
    for (const auto& touch : rest.contacts) {
        if (touch.tool >= scene.tools().size()) return error_;
    }
    y_ = rest.x;
    pressed_.assign(problem_, mesh.triangles(), y_, scene.tools(), rest.contacts, detail::carriers_of(scene, mesh));
    evaluate_residuals();
    error_.estimate = distance_;
    enclose();
    return report(constraints...);
}

template <CheckedConvexityModel Convexity>
void ErrorBound<Convexity>::begin(std::size_t constraint_count) noexcept {
    error_ = {};
    reactions_.fill({});
    error_.reactions = {reactions_.data(), constraint_count};
    pressed_.clear();
    radius_ = -1;
}

template <CheckedConvexityModel Convexity>
template <class... Constraints>
ErrorReport ErrorBound<Convexity>::report(const Constraints&... constraints) noexcept {
    static_assert(sizeof...(Constraints) <= max_constraints, "16 constraints at most, as in a step");
    [[maybe_unused]] std::size_t i = 0, tool = 0;
    ((reactions_[i++] = enclose_reaction(constraints, tool)), ...);
    return error_;
}

// Approaches the equilibrium by Newton's method until e is small compared with the distance; then encloses it.
template <CheckedConvexityModel Convexity>
void ErrorBound<Convexity>::locate() noexcept {
    y_ = problem_.centre();
    problem_.attachments().project_positions(y_);
    evaluate_residuals();
    error_.status = BoundStatus::not_converged;
    for (double before = std::numeric_limits<double>::infinity(); unbalanced_ < before / 2;) {
        before = unbalanced_;
        const bool convex = refine();
        evaluate_residuals();
        if (!is_finite(unbalanced_ + distance_)) return;
        error_.estimate = distance_;
        const bool fits = distance_ <= radius_ && radius_ <= 1.1 * distance_;
        if (!convex || !(fits || convex_within(1.05 * distance_))) {
            error_.status = BoundStatus::not_convex;
            return;
        }
        if (enclosure() <= 0.01 * distance_ || error_.cg_iterations >= options_.cg_iterations) break;
    }
    enclose();
}

// Increases rho until the bound that C yields, |y - x| + e, is not above it.
template <CheckedConvexityModel Convexity>
void ErrorBound<Convexity>::enclose() noexcept {
    error_.status = BoundStatus::not_converged;
    if (radius_ < 0 && !convex_within(1.05 * distance_ + pressed_.penetration())) {
        error_.status = BoundStatus::not_convex;
        return;
    }
    for (int attempt = 0; !(distance_ + enclosure() <= radius_ && enclosure() <= pressed_.max_radius()); ++attempt) {
        if (attempt == max_attempts || !convex_within(1.125 * (distance_ + enclosure()))) return;
    }
    error_.status = BoundStatus::certified;
    error_.position = (1 + 1e-12) * (distance_ + enclosure());
}

// One step of Newton's method; false if the energy is not convex.
template <CheckedConvexityModel Convexity>
bool ErrorBound<Convexity>::refine() noexcept {
    stiffness_.at(problem_, y_);
    displacement_.setZero();
    const auto report =
        stiffness_.solve(problem_, residual_, displacement_,
                         {.tolerance = 1e-2, .iterations = options_.cg_iterations - error_.cg_iterations});
    error_.cg_iterations += report.iterations;
    y_ += displacement_;
    problem_.attachments().project_positions(y_);
    return report.convex;
}

// Computes the residual forces at y, and its distance from x, both rounded up.
template <CheckedConvexityModel Convexity>
void ErrorBound<Convexity>::evaluate_residuals() noexcept {
    problem_.forces(y_, force_, magnitude_);
    residual_ = force_;
    pressed_.add_force(residual_, magnitude_);
    problem_.project(residual_);
    double rounding = 0, farthest = 0;
    for (Index v = 0; v < problem_.vertex_count(); ++v) {
        farthest = (std::max)(farthest, norm<double>(point(y_, v) - point(problem_.given(), v)));
        const double magnitude = magnitude_[static_cast<std::size_t>(v)];
        if (!problem_.fixed(v)) rounding += magnitude * magnitude;
    }
    distance_ = (1 + 1e-12) * farthest;
    unbalanced_ = (1 + 1e-9) * std::sqrt(inner(residual_, residual_)) + problem_.rounding() * std::sqrt(rounding);
}

// Sets C to the states within `radius` of x; true if the energy is shown to be convex on it.
template <CheckedConvexityModel Convexity>
bool ErrorBound<Convexity>::convex_within(double radius) noexcept {
    radius_ = radius;
    error_.convexity = -std::numeric_limits<double>::infinity();
    if (!pressed_.bound_softening(problem_, force_, magnitude_, distance_ + radius)) return false;
    for (Index v = 0; v < problem_.vertex_count(); ++v) problem_.soften(v, pressed_.softening(v));
    error_.convexity = convexity_.eigenvalue_bound(problem_, radius * (1 + 1e-12));
    return error_.convexity > 0;
}

// The radius e of a ball around y that contains the equilibrium. If an attached point is off its target by rounding,
// the proof holds for the nearest state with all points at their targets; the radius includes the distance to it.
template <CheckedConvexityModel Convexity>
double ErrorBound<Convexity>::enclosure() const noexcept {
    const double violation = problem_.attachments().violation(y_);
    const double mu = error_.convexity;
    const double half = (unbalanced_ + (violation > 0 ? stiffness_.largest() * violation : 0.0)) / (2 * mu);
    const double radius = half + std::sqrt(half * half + pressed_.work() / mu);
    return (1 + 1e-9) * ((std::max)(radius, pressed_.min_radius()) + violation);
}

// The reaction is the sum of weight times force over all vertices. A spring between vertices of weights a and b changes
// it by (a - b) times the change of its force. `slopes_` bound its change by each vertex's displacement [N/m].
template <CheckedConvexityModel Convexity>
template <class C>
ForceEnclosure ErrorBound<Convexity>::enclose_reaction(const C& constraint, std::size_t& tool) noexcept {
    std::fill(weights_.begin(), weights_.end(), 0.0);
    ForceEnclosure result{Vector3<double>::Zero(), 0};
    bool varies = false;
    for_each_term(constraint, [&](const ConstraintTerm& term) {
        if (term.kind == ConstraintTerm::Kind::load) result.centre -= term.force;
        const bool presses = term.kind == ConstraintTerm::Kind::press && term.contact.touching();
        if (presses) pressed_.share(tool++, weights_);
        problem_.share(term, weights_);
        varies |= presses || term.prescribes();
    });
    if (!varies) return result;
    for (std::size_t v = 0; v < weights_.size(); ++v)
        slopes_[v] = weights_[v] * problem_.foundation(static_cast<Index>(v));
    for (const auto& spring : problem_.springs()) {
        const auto a = static_cast<std::size_t>(spring.first), b = static_cast<std::size_t>(spring.second);
        const double slope = spring.stiffness * std::abs(weights_[a] - weights_[b]);
        slopes_[a] += slope;
        slopes_[b] += slope;
    }
    double squares = 0, rounding = 0;
    for (Index v = 0; v < problem_.vertex_count(); ++v) {
        const auto i = static_cast<std::size_t>(v);
        result.centre += weights_[i] * force_.col(v);
        rounding += weights_[i] * magnitude_[i];
        if (!problem_.fixed(v)) squares += slopes_[i] * slopes_[i];
    }
    if (!is_finite(result.centre)) return {};
    const double moved = error_.certified() ? enclosure() : std::numeric_limits<double>::infinity();
    result.radius = (1 + 1e-9) * std::sqrt(squares) * moved + 2 * problem_.rounding() * rounding;
    return result;
}

}  // namespace membrane
