// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include <membrane/accuracy/elasticity.hpp>
#include <membrane/accuracy/equilibrium_scene.hpp>
#include <membrane/accuracy/newton_system.hpp>
#include <membrane/accuracy/tool_points.hpp>

namespace membrane {

/// Newton's method on one scene, see `equilibrium`. Combines the other components.
///
///     membrane::EquilibriumSolver(x, mesh.triangles(), elasticity, scene, fixed, options).run(constraint_count);
template <class ElasticModel>
class EquilibriumSolver {
  public:
    /// Starts from `x` (3 x V [m]). `fixed[v]` is not 0 if vertex v moves only to its target in the scene; `carriers`
    /// are as for `tool_points`. Triangles and scene must outlive the solver.
    EquilibriumSolver(const Points<double>& x, const Triangles& triangles, const ElasticModel& elasticity,
                      const EquilibriumScene& scene, std::vector<unsigned char> fixed,
                      const EquilibriumOptions& options, std::vector<ContactVertices> carriers = {});

    /// Solves all increments. May be called once.
    [[nodiscard]] Equilibrium run(std::size_t constraint_count);

  private:
    struct State {
        ElasticState elastic;
        std::vector<ToolPoint> contacts;
        double penetration = 0;
    };

    [[nodiscard]] EquilibriumStatus solve_increment();
    [[nodiscard]] State state_at(const Points<double>& x);
    [[nodiscard]] Points<double> newton_step();
    void add_rows();
    [[nodiscard]] EquilibriumStatus status() const;
    [[nodiscard]] bool targets_reached() const;
    void advance(const Points<double>& step);
    [[nodiscard]] Points<double> applied(const State& state) const;
    [[nodiscard]] Points<double> unbalanced(const State& state) const;
    [[nodiscard]] double residual(const State& state) const;
    [[nodiscard]] std::vector<Vector3<double>> reactions(std::size_t count) const;
    [[nodiscard]] double negligible_length() const noexcept { return (std::max)(options_.tolerance * edge_, spacing_); }
    [[nodiscard]] bool is_free(Index v) const noexcept { return fixed_[static_cast<std::size_t>(v)] == 0; }
    [[nodiscard]] bool can_move(const std::array<Index, 3>& corners, const Vector3<double>& weights) const noexcept;
    [[nodiscard]] Vector3<double> off_target(std::size_t i) const noexcept;

    const Triangles& triangles_;
    ElasticModel elasticity_;
    const EquilibriumScene& scene_;
    std::vector<unsigned char> fixed_;
    EquilibriumOptions options_;
    double edge_, spacing_;  // mean edge; rounding of a length [m]
    NewtonSystem system_;

    LoadStep goals_;  // of this increment
    State here_;
    std::vector<Vector3<double>> attachment_forces_;  // force on each attached point [N]
    double stiffness_ = 0;                            // of the stiffest spring [N/m]
    double penalty_ = 0;                              // weight of the penetration [N]
    std::vector<ContactVertices> carriers_;           // for each tool
    Index iterations_ = 0;
};

namespace detail {

/// Mean length of the triangles' sides [m].
[[nodiscard]] inline double mean_side(const Points<double>& x, const Triangles& triangles) {
    double sum = 0;
    for (const auto& corners : triangles.colwise()) {
        const auto t = triangle_at(x, corners);
        sum += norm<double>(t.b - t.a) + norm<double>(t.c - t.b) + norm<double>(t.a - t.c);
    }
    return sum / (3 * static_cast<double>(triangles.cols()));
}

}  // namespace detail

template <class ElasticModel>
EquilibriumSolver<ElasticModel>::EquilibriumSolver(const Points<double>& x, const Triangles& triangles,
                                                   const ElasticModel& elasticity, const EquilibriumScene& scene,
                                                   std::vector<unsigned char> fixed, const EquilibriumOptions& options,
                                                   std::vector<ContactVertices> carriers)
    : triangles_(triangles),
      elasticity_(elasticity),
      scene_(scene),
      fixed_(std::move(fixed)),
      options_(options),
      edge_(detail::mean_side(x, triangles)),
      spacing_(64 * std::numeric_limits<double>::epsilon() * x.cwiseAbs().maxCoeff()),
      system_(fixed_),
      attachment_forces_(scene.point_attachments().size(), Vector3<double>::Zero()),
      carriers_(std::move(carriers)) {
    here_.elastic.x = x;
}

template <class ElasticModel>
Equilibrium EquilibriumSolver<ElasticModel>::run(std::size_t constraint_count) {
    double increments = options_.increments;
    for (const auto& pressing : scene_.tools()) {
        increments = (std::max)(increments, std::ceil(2 * norm(pressing.exit_displacement) / pressing.tool.radius));
    }
    Equilibrium result;
    for (double i = 1; i <= increments; ++i) {
        goals_ = scene_.goals(i / increments);
        here_ = state_at(here_.elastic.x);
        result.status = solve_increment();
    }
    result.converged = result.status == EquilibriumStatus::found;
    result.x = here_.elastic.x;
    result.reactions = reactions(constraint_count);
    std::copy_if(here_.contacts.begin(), here_.contacts.end(), std::back_inserter(result.contacts),
                 [](const ToolPoint& point) { return point.multiplier > 0; });
    for (auto& point : result.contacts) point.force = -point.multiplier * point.normal;
    result.residual = residual(here_);
    result.penetration = here_.penetration;
    result.iterations = iterations_;
    return result;
}

template <class ElasticModel>
EquilibriumStatus EquilibriumSolver<ElasticModel>::solve_increment() {
    constexpr auto found = EquilibriumStatus::found;
    for (Index i = 0; i < options_.max_iterations; ++i) {
        ++iterations_;
        const Points<double> step = newton_step();
        if (status() == found) return found;
        if (!is_finite(step)) return EquilibriumStatus::not_finite;
        advance(step);
        // With the multipliers of this step: where contact points are nearly dependent, new ones would amplify the
        // rounding of gaps.
        if (status() == found) return found;
    }
    return status();
}

template <class ElasticModel>
auto EquilibriumSolver<ElasticModel>::state_at(const Points<double>& x) -> State {
    State state{elasticity_.at(x), tool_points(triangles_, x, goals_.tools, edge_ / 2, carriers_)};
    std::erase_if(state.contacts, [&](const ToolPoint& point) { return !can_move(point.corners, point.weights); });
    for (auto& point : state.contacts) {
        state.penetration = (std::max)(state.penetration, -point.gap);
        const auto before = std::lower_bound(here_.contacts.begin(), here_.contacts.end(), point, is_before);
        if (before != here_.contacts.end() && !is_before(point, *before)) point.multiplier = before->multiplier;
    }
    for (const auto& tool : goals_.tools) {
        if (is_pierced(triangles_, x, tool, fixed_)) state.penetration = (std::max)(state.penetration, tool.radius);
    }
    return state;
}

// The step from the current state, and the forces of attachments and contacts.
template <class ElasticModel>
Points<double> EquilibriumSolver<ElasticModel>::newton_step() {
    const auto& x = here_.elastic.x;
    system_.open(goals_.targets - x);
    elasticity_.add_stiffness(here_.elastic, system_);
    const Points<double> forces = applied(here_);
    for (Index v = 0; v < forces.cols(); ++v) system_.add_force(v, forces.col(v));
    stiffness_ = elasticity_.largest_stiffness(here_.elastic);
    add_rows();
    const auto solution = system_.solve(stiffness_);
    Eigen::Index row = 0;
    for (auto& force : attachment_forces_) {
        force = solution.multipliers.segment<3>(row);
        row += 3;
    }
    for (auto& point : here_.contacts) point.multiplier = solution.multipliers[row++];
    return solution.step;
}

// Attached points are expected to reach their targets, and active contacts to remain. With added stiffness along these
// gradients, H is positive definite wherever the equilibrium is stable.
template <class ElasticModel>
void EquilibriumSolver<ElasticModel>::add_rows() {
    for (std::size_t i = 0; i < attachment_forces_.size(); ++i) {
        const auto& term = scene_.point_attachments()[i];
        const Vector3<double> off = off_target(i);
        for (Eigen::Index c = 0; c < 3; ++c) {
            ConstraintRow row{term.corners, {}, off[c], true, stiffness_};
            for (std::size_t k = 0; k < 3; ++k) {
                row.gradient[k] = term.weight(k) * Vector3<double>::Unit(c);
            }
            system_.add(row);
        }
    }
    for (const auto& point : here_.contacts) {
        const auto& v = point.corners;
        const double stiffening = point.multiplier > 0 ? stiffness_ : 0;
        system_.add({v, {point.gradient(0), point.gradient(1), point.gradient(2)}, point.gap, false, stiffening});
        if (point.multiplier == 0) continue;
        const Eigen::Matrix<double, 9, 9> hessian = gap_hessian(point, here_.elastic.x, goals_.tools[point.tool]);
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t l = 0; l <= k; ++l) {
                const auto i = static_cast<Eigen::Index>(3 * k), j = static_cast<Eigen::Index>(3 * l);
                system_.add(v[k], v[l], -point.multiplier * hessian.block<3, 3>(i, j));
            }
        }
    }
}

template <class ElasticModel>
EquilibriumStatus EquilibriumSolver<ElasticModel>::status() const {
    if (!targets_reached()) return EquilibriumStatus::target_missed;
    if (!(here_.penetration <= negligible_length())) return EquilibriumStatus::penetrated;
    const double largest = (std::max)(here_.elastic.largest_force, goals_.loads.colwise().norm().maxCoeff());
    if (!(residual(here_) <= (std::max)(options_.tolerance * largest, stiffness_ * spacing_)))
        return EquilibriumStatus::unbalanced;
    const auto closed = [&](const ToolPoint& p) { return p.multiplier == 0 || p.gap <= negligible_length(); };
    return std::all_of(here_.contacts.begin(), here_.contacts.end(), closed) ? EquilibriumStatus::found
                                                                             : EquilibriumStatus::contact_open;
}

template <class ElasticModel>
bool EquilibriumSolver<ElasticModel>::targets_reached() const {
    for (std::size_t i = 0; i < attachment_forces_.size(); ++i) {
        const auto& term = scene_.point_attachments()[i];
        if (can_move(term.corners, term.weights) && norm(off_target(i)) > negligible_length()) return false;
    }
    for (Index v = 0; v < here_.elastic.x.cols(); ++v) {
        if (!is_free(v) && point(here_.elastic.x, v) != point(goals_.targets, v)) return false;
    }
    return true;
}

// Limits the step so that no tool passes through the surface. Once all targets are reached, a line search limits it
// further. Far from equilibrium its merit is the energy plus the weighted penetration. Close to equilibrium, where the
// curved paths of the contacts would reject full steps, a reduction of the residual is accepted as well.
template <class ElasticModel>
void EquilibriumSolver<ElasticModel>::advance(const Points<double>& step) {
    constexpr int max_halvings = 12;
    const auto after = [&](double part) {
        Points<double> x = here_.elastic.x + part * step;
        for (Index v = 0; v < x.cols(); ++v) {
            if (part == 1 && !is_free(v)) x.col(v) = goals_.targets.col(v);
        }
        return state_at(x);
    };
    const auto merit = [&](const State& state) { return residual(state) + stiffness_ * state.penetration; };
    double part = collision_free_step(triangles_, here_.elastic.x, step, goals_.tools);
    State there = after(part);
    if (targets_reached()) {
        double multipliers = 0;
        for (const auto& point : here_.contacts) multipliers += point.multiplier;
        penalty_ = (std::max)(penalty_, 2 * multipliers);
        const double slope = -applied(here_).cwiseProduct(step).sum() - penalty_ * here_.penetration;
        const auto improves = [&] {
            const double work = goals_.loads.cwiseProduct(there.elastic.x - here_.elastic.x).sum();
            const double energy = elasticity_.energy_change(here_.elastic, there.elastic) - work;
            const double noise = 1e-13 * (here_.elastic.energy + there.elastic.energy);
            const double change = energy + penalty_ * (there.penetration - here_.penetration);
            return change <= 1e-4 * part * slope + noise || merit(there) <= merit(here_) / 2;
        };
        for (int i = 0; i < max_halvings && !improves(); ++i) {
            part /= 2;
            there = after(part);
        }
    }
    here_ = std::move(there);
}

// Forces of springs, foundation and loads.
template <class ElasticModel>
Points<double> EquilibriumSolver<ElasticModel>::applied(const State& state) const {
    return state.elastic.springs + state.elastic.foundation + goals_.loads;
}

// The applied forces plus those of attachments and contacts, also on fixed vertices.
template <class ElasticModel>
Points<double> EquilibriumSolver<ElasticModel>::unbalanced(const State& state) const {
    Points<double> forces = applied(state);
    for (const auto& point : state.contacts) {
        for (std::size_t k = 0; k < 3; ++k) forces.col(point.corners[k]) += point.multiplier * point.gradient(k);
    }
    for (std::size_t i = 0; i < attachment_forces_.size(); ++i) {
        const auto& term = scene_.point_attachments()[i];
        for (std::size_t k = 0; k < 3; ++k) {
            forces.col(term.corners[k]) += term.weight(k) * attachment_forces_[i];
        }
    }
    return forces;
}

template <class ElasticModel>
double EquilibriumSolver<ElasticModel>::residual(const State& state) const {
    const Points<double> forces = unbalanced(state);
    double largest = 0;
    for (Index v = 0; v < forces.cols(); ++v) {
        if (is_free(v)) largest = (std::max)(largest, norm(point(forces, v)));
    }
    return largest;
}

template <class ElasticModel>
std::vector<Vector3<double>> EquilibriumSolver<ElasticModel>::reactions(std::size_t count) const {
    std::vector<Vector3<double>> sums(count, Vector3<double>::Zero());
    const Points<double> forces = unbalanced(here_);
    for (const auto& [constraint, v] : scene_.prescribed_vertices()) sums[constraint] += forces.col(v);
    for (const auto& term : scene_.loads()) sums[term.constraint] -= term.force;
    for (std::size_t i = 0; i < attachment_forces_.size(); ++i)
        sums[scene_.point_attachments()[i].constraint] -= attachment_forces_[i];
    for (const auto& point : here_.contacts)
        sums[scene_.tools()[point.tool].constraint] += point.multiplier * point.normal;
    return sums;
}

template <class ElasticModel>
bool EquilibriumSolver<ElasticModel>::can_move(const std::array<Index, 3>& corners,
                                               const Vector3<double>& weights) const noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        if (weights[static_cast<Eigen::Index>(k)] > 0 && is_free(corners[k])) return true;
    }
    return false;
}

template <class ElasticModel>
Vector3<double> EquilibriumSolver<ElasticModel>::off_target(std::size_t i) const noexcept {
    return scene_.point_attachments()[i].point_in(here_.elastic.x) - goals_.attached_points[i];
}

}  // namespace membrane
