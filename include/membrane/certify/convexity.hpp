// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <vector>

#include <membrane/accuracy/equilibrium_problem.hpp>
#include <membrane/core/symmetric3.hpp>

/// A lower bound of the convexity of a membrane's energy in a whole neighbourhood of a state.
///
///     membrane::BlockConvexity convexity(problem);                            // offline
///     const double mu = convexity.eigenvalue_bound(problem, 1e-5);  // [N/m]; <= 0 if not shown to be convex
namespace membrane {

/// Computes a lower bound of the smallest eigenvalue of the stiffness over all states in which each free vertex is
/// within `radius` [m] of the problem's centre and point attachments are at their targets; not above 0 if it finds
/// none. If the bound is positive, each spring has a `min_stiffness` there. The compiler cannot check: the bound holds,
/// rounding included.
template <class Model>
concept ConvexityModel = std::copyable<Model> && std::constructible_from<Model, const EquilibriumProblem&> &&
    requires(Model& model, const EquilibriumProblem& problem, double radius) {
    { model.eigenvalue_bound(problem, radius) }
    noexcept->std::same_as<double>;
};

namespace detail {

template <class Model>
consteval bool check_convexity_model() noexcept {
    static_assert(std::copyable<Model>, "ConvexityModel: must be copyable");
    static_assert(std::constructible_from<Model, const EquilibriumProblem&>,
                  "ConvexityModel: must have a constructor from const EquilibriumProblem&");
    static_assert(
        ConvexityModel<Model>,
        "ConvexityModel: eigenvalue_bound(const EquilibriumProblem&, double radius) noexcept must return double");
    return ConvexityModel<Model>;
}

}  // namespace detail

/// A `ConvexityModel`; if a type is not one, the compile error names the missing requirement.
template <class Model>
concept CheckedConvexityModel = detail::check_convexity_model<Model>();

/// Bounds the stiffness by one block for each vertex, at the cost of a few sums of forces.
///
/// Springs that may be compressed subtract p (I - u u^T), p > 0, from the stiffness between their ends a and b. For any
/// weights w > 0 of the vertices, |a - b|^2 <= (1 + w_b / w_a) |a|^2 + (1 + w_a / w_b) |b|^2. This leaves a 3 x 3 block
/// for each vertex, and no eigenvalue of the whole matrix is below the smallest eigenvalue of a block. The best weights
/// make the blocks equal; some iterations of the power method approximate them (Collatz and Wielandt [Varga62]), and
/// the bound holds for any weights. Springs in tension between free vertices are neglected: if the foundation is soft
/// compared with the springs, `FactoredConvexity` finds a larger bound.
class BlockConvexity {
  public:
    /// Cost: O(V + springs) memory.
    explicit BlockConvexity(const EquilibriumProblem& problem);

    /// Online. Cost: O(V + springs) for each of at most 24 rounds.
    [[nodiscard]] double eigenvalue_bound(const EquilibriumProblem& problem, double radius) noexcept;

  private:
    struct Push {  // of a spring between free vertices
        std::size_t first, second;
        Symmetric3<double> block;
    };
    static constexpr int max_rounds = 24;

    bool gather(const EquilibriumProblem& problem, double radius) noexcept;
    double sum_up(const EquilibriumProblem& problem) noexcept;
    void balance(double least) noexcept;

    std::vector<Push> pushes_;
    std::size_t push_count_ = 0;
    std::vector<Symmetric3<double>> own_;            // of each vertex: foundation and springs to fixed vertices
    std::vector<Symmetric3<double>> blocks_;         // of each vertex: minus its block
    std::vector<double> own_sizes_, sizes_;          // of each vertex: sum of the magnitudes in its block
    std::vector<double> weights_, min_eigenvalues_;  // of each vertex: w, its smallest eigenvalue
    double max_foundation_ = 0;                      // largest stiffness of the foundation [N/m]
};
static_assert(ConvexityModel<BlockConvexity>);

inline BlockConvexity::BlockConvexity(const EquilibriumProblem& problem)
    : pushes_(problem.spring_capacity()),
      own_(static_cast<std::size_t>(problem.vertex_count())),
      blocks_(own_),
      own_sizes_(own_.size()),
      sizes_(own_.size()),
      weights_(own_.size()),
      min_eigenvalues_(own_.size()) {}

inline double BlockConvexity::eigenvalue_bound(const EquilibriumProblem& problem, double radius) noexcept {
    if (!gather(problem, radius)) return -std::numeric_limits<double>::infinity();
    std::fill(weights_.begin(), weights_.end(), 1.0);
    double best = sum_up(problem);
    for (int round = 1; round < max_rounds && push_count_ > 0; ++round) {
        balance(best);
        const double now = sum_up(problem);
        if (!(now > best + 0.01 * std::abs(best))) break;
        best = now;
    }
    return best;
}

// False if a spring may become too short to bound its stiffness.
inline bool BlockConvexity::gather(const EquilibriumProblem& problem, double radius) noexcept {
    push_count_ = 0;
    max_foundation_ = 0;
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        own_[static_cast<std::size_t>(v)] = diagonal3(problem.support(v));
        own_sizes_[static_cast<std::size_t>(v)] = 3 * (problem.foundation(v) + std::abs(problem.support(v)));
        max_foundation_ = (std::max)(max_foundation_, problem.foundation(v));
    }
    for (const auto& spring : problem.springs()) {
        const int ends = problem.free_ends(spring);
        if (ends == 0) continue;
        const auto least = min_stiffness(spring, edge_vector(spring, problem.centre()), ends * radius);
        if (!least) return false;
        const auto first = static_cast<std::size_t>(spring.first), second = static_cast<std::size_t>(spring.second);
        if (ends == 1) {
            const std::size_t v = problem.fixed(spring.first) ? second : first;
            own_[v] += block_of(*least);
            own_sizes_[v] += 3 * spring.stiffness;
        } else if (least->across < 0) {
            pushes_[push_count_++] = {first, second, block_of<double>({0, -least->across, least->direction})};
        }
    }
    return true;
}

// The smallest eigenvalue of any block.
inline double BlockConvexity::sum_up(const EquilibriumProblem& problem) noexcept {
    constexpr double rounding = 1e-7;  // twice that of a closed-form eigenvalue
    for (std::size_t v = 0; v < own_.size(); ++v) {
        blocks_[v] = -1.0 * own_[v];
        sizes_[v] = own_sizes_[v];
    }
    for (std::size_t i = 0; i < push_count_; ++i) {
        const auto& push = pushes_[i];
        const double to_first = 1 + weights_[push.second] / weights_[push.first];
        const double to_second = 1 + weights_[push.first] / weights_[push.second];
        blocks_[push.first] += to_first * push.block;
        blocks_[push.second] += to_second * push.block;
        sizes_[push.first] += to_first * push.block.trace();
        sizes_[push.second] += to_second * push.block.trace();
    }
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t v = 0; v < own_.size(); ++v) {
        min_eigenvalues_[v] = -largest_eigenvalue(blocks_[v]) - rounding * sizes_[v];
        if (!problem.fixed(static_cast<Index>(v))) least = (std::min)(least, min_eigenvalues_[v]);
    }
    return least;
}

// New weights: smaller for vertices with an eigenvalue above `least`; the shifted blocks are not negative.
inline void BlockConvexity::balance(double least) noexcept {
    constexpr double smallest = 0.05;
    for (std::size_t v = 0; v < own_.size(); ++v) {
        const double part = (max_foundation_ - min_eigenvalues_[v]) / (max_foundation_ - least);
        weights_[v] *= part > smallest ? (std::min)(part, 1.0) : smallest;
    }
}

}  // namespace membrane
