// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/core/symmetric3.hpp>

/// The change of a membrane's forces under small displacements.
///
///     membrane::StiffnessOperator stiffness(problem);                       // offline
///     stiffness.at(problem, y);
///     stiffness.multiply(problem, displacement, force);                       // force = H displacement
///     stiffness.solve(problem, force, displacement, {.tolerance = 1e-3});     // displacement = H^-1 force
namespace membrane {

/// Options of `solve`.
struct SolveOptions {
    double tolerance = 1e-3;  ///< of the residual, relative to the force
    Index iterations = 100;   ///< at the most, each a product with H
};

/// Result of `solve`.
struct SolveReport {
    bool convex = true;      ///< no direction was found in which the energy does not grow
    bool converged = false;  ///< to the tolerance
    Index iterations = 0;    ///< performed
};

/// Sum of a_v . b_v over all columns, always in the same order.
[[nodiscard]] inline double inner(const Points<double>& a, const Points<double>& b) noexcept {
    double sum = 0;
    for (Index v = 0; v < a.cols(); ++v) sum += dot<double>(point(a, v), point(b, v));
    return sum;
}

/// The stiffness H of a membrane at one state: the Hessian of its energy, a symmetric 3 x 3 block for each spring and a
/// scalar for each vertex.
class StiffnessOperator {
  public:
    /// Cost: O(V + springs) memory.
    explicit StiffnessOperator(const EquilibriumProblem& problem);

    /// Assembles H at `y`. Online. Cost: O(V + springs).
    void at(const EquilibriumProblem& problem, const Points<double>& y) noexcept;

    /// `force` = H `displacement`, on every vertex. Online. Cost: O(V + springs).
    void multiply(const EquilibriumProblem& problem, const Points<double>& displacement,
                  Points<double>& force) const noexcept;

    /// Solves H `displacement` = `force` on the free vertices by conjugate gradients [Hestenes52], each vertex scaled
    /// by its springs. On entry `displacement` is zero, or a guess that moves no fixed vertex or attached point.
    /// `force` is overwritten. If H is found to be indefinite, ends early, not `convex`. Online. Cost: a product for
    /// each iteration.
    SolveReport solve(const EquilibriumProblem& problem, Points<double>& force, Points<double>& displacement,
                      const SolveOptions& options) noexcept;

    /// Upper bound of all eigenvalues while no spring is stiffer in any direction than its own stiffness [N/m].
    [[nodiscard]] double largest() const noexcept { return 2 * *std::max_element(scale_.begin(), scale_.end()); }

  private:
    void scale(const EquilibriumProblem& problem, const Points<double>& force) noexcept;

    std::vector<Symmetric3<double>> blocks_;  // of each spring
    std::vector<double> scale_;               // of each vertex [N/m]
    Points<double> scaled_, direction_, product_;
};

inline StiffnessOperator::StiffnessOperator(const EquilibriumProblem& problem)
    : blocks_(problem.spring_capacity()),
      scale_(static_cast<std::size_t>(problem.vertex_count())),
      scaled_(Points<double>::Zero(3, problem.vertex_count())),
      direction_(scaled_),
      product_(scaled_) {}

inline void StiffnessOperator::at(const EquilibriumProblem& problem, const Points<double>& y) noexcept {
    for (std::size_t v = 0; v < scale_.size(); ++v) scale_[v] = problem.foundation(static_cast<Index>(v));
    for (std::size_t s = 0; s < problem.springs().size(); ++s) {
        const auto& spring = problem.springs()[s];
        blocks_[s] = block_of<double>(
            spring_force(LinearSpring{}, edge_vector(spring, y), spring.stiffness, spring.rest_length));
        scale_[static_cast<std::size_t>(spring.first)] += spring.stiffness;
        scale_[static_cast<std::size_t>(spring.second)] += spring.stiffness;
    }
}

inline void StiffnessOperator::multiply(const EquilibriumProblem& problem, const Points<double>& displacement,
                                        Points<double>& force) const noexcept {
    for (Index v = 0; v < problem.vertex_count(); ++v) force.col(v) = problem.foundation(v) * displacement.col(v);
    for (std::size_t s = 0; s < problem.springs().size(); ++s) {
        const auto& spring = problem.springs()[s];
        const Vector3<double> pull = blocks_[s] * edge_vector(spring, displacement);
        force.col(spring.first) -= pull;
        force.col(spring.second) += pull;
    }
}

inline void StiffnessOperator::scale(const EquilibriumProblem& problem, const Points<double>& force) noexcept {
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        const double scale = scale_[static_cast<std::size_t>(v)];
        scaled_.col(v) = force.col(v) / (scale > 0 ? scale : 1);
    }
    problem.project(scaled_);
}

inline SolveReport StiffnessOperator::solve(const EquilibriumProblem& problem, Points<double>& force,
                                            Points<double>& displacement, const SolveOptions& options) noexcept {
    SolveReport report;
    problem.project(force);
    const double enough = options.tolerance * options.tolerance * inner(force, force);
    multiply(problem, displacement, product_);
    force -= product_;
    problem.project(force);
    direction_.setZero();
    double before = 0;
    while (!(report.converged = inner(force, force) <= enough) && report.iterations < options.iterations) {
        ++report.iterations;
        scale(problem, force);
        const double now = inner(force, scaled_);
        if (before > 0) direction_ *= now / before;
        direction_ += scaled_;
        multiply(problem, direction_, product_);
        problem.project(product_);
        const double energy_growth = inner(direction_, product_);
        if (!(report.convex = energy_growth > 0)) break;
        displacement += (now / energy_growth) * direction_;
        force -= (now / energy_growth) * product_;
        before = now;
    }
    return report;
}

}  // namespace membrane
