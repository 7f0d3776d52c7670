// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include <membrane/accuracy/rest_problem.hpp>
#include <membrane/core/symmetric3.hpp>

/// How convex the energy of a membrane is, not only where it is but in a whole neighbourhood.
///
///     membrane::BlockConvexity convexity(problem);                  // offline
///     const double mu = convexity.around(problem, 1e-5);            // [N/m]; not convex, as far as one can see: <= 0
namespace membrane {

/// Gives a lower bound of the smallest eigenvalue of the stiffness at every state in which each free vertex is within
/// `radius` [m] of the problem's centre and what is held is in its place; not above zero where it knows none. Where it
/// is above, each spring has a `least_stiffness` there. What the compiler cannot see: the bound holds, with rounding.
template <class Model>
concept ConvexityModel = std::copyable<Model> && std::constructible_from<Model, const RestProblem&> &&
    requires(Model& model, const RestProblem& problem, double radius) {
    { model.around(problem, radius) }
    noexcept->std::same_as<double>;
};

namespace detail {

template <class Model>
consteval bool check_convexity_model() noexcept {
    static_assert(std::copyable<Model>, "ConvexityModel: must be copyable");
    static_assert(std::constructible_from<Model, const RestProblem&>,
                  "ConvexityModel: must have a constructor from const RestProblem&");
    static_assert(ConvexityModel<Model>,
                  "ConvexityModel: around(const RestProblem&, double radius) noexcept must return double");
    return ConvexityModel<Model>;
}

}  // namespace detail

/// A `ConvexityModel`; where it is none, the error says what is missing.
template <class Model>
concept CheckedConvexityModel = detail::check_convexity_model<Model>();

/// A lower bound of a spring's stiffness, the second derivative of its energy by the reach from one end to the other:
/// `along` u u^T + `across` (I - u u^T) [N/m].
struct SpringBound {
    double along, across;
    Vector3<double> u;
};

[[nodiscard]] inline Symmetric3<double> stiffness_of(const SpringBound& bound) noexcept {
    Symmetric3<double> stiffness = diagonal3(bound.across);
    stiffness += outer(bound.along - bound.across, bound.u);
    return stiffness;
}

/// Of all reaches that are at most `way` from `reach`; with none of them, then, is the spring stiffer in any direction
/// than its own stiffness. None where it may get too short for that.
///
/// At a reach d of length l and direction u the second derivative of k (|d| - r)^2 / 2 is k I - k r/l (I - u u^T). Let
/// d' be at most s l away from d. In the plane of d and d', at an angle a from u, it is no shorter than
/// l' = l (cos a - sqrt(s^2 - sin^2 a)), and with q = r / (l - s l)
///
///     r/l' (I - u' u'^T)  <=  q (I - u u^T) + 2 s q u u^T,                                                     (*)
///
/// so that the stiffness is at least k (1 - q) across u and k (1 - 2 s q) along u. (*) is plain at right angles to the
/// plane, where l' >= l - s l. Within it the left side is r/l' n n^T, n at right angles to u', and so (*) says that
/// r/l' (sin^2 a / (2 s q) + cos^2 a / q) <= 1, or with z = sin^2 a that
/// sqrt(1 - z) - sqrt(s^2 - z) >= (1 - s) (1 - z + z / (2 s)). At z = 0 both sides are 1 - s; up to z = s^2 the left
/// one is convex, the right one is a line, and at z = 0 the left one is the steeper by 1 - s.
[[nodiscard]] inline std::optional<SpringBound> least_stiffness(const Spring<double>& spring,
                                                                const Vector3<double>& reach, double way) noexcept;

/// A block for each vertex, at no more cost than a few sums of forces.
///
/// The springs that may push take away p (I - u u^T), p > 0, of the difference of their ends a and b; for any weights
/// w > 0 of the vertices, |a - b|^2 <= (1 + w_b / w_a) |a|^2 + (1 + w_a / w_b) |b|^2. With that a 3 x 3 block for each
/// vertex is left, and no eigenvalue of the whole is below the smallest of theirs. The weights that make the blocks
/// even are the best; some rounds of the power method come near them (Collatz and Wielandt [Varga62]), and the bound
/// holds for all. What springs that pull do for others is left out: where the backing is soft beside the springs,
/// `FactoredConvexity` finds more.
class BlockConvexity {
  public:
    /// Cost: O(V + springs) memory.
    explicit BlockConvexity(const RestProblem& problem);

    /// Online. Cost: O(V + springs) for each of at most 24 rounds.
    [[nodiscard]] double around(const RestProblem& problem, double radius) noexcept;

  private:
    struct Push {  // of a spring between free vertices
        std::size_t first, second;
        Symmetric3<double> block;
    };
    static constexpr int most_rounds = 24;

    bool gather(const RestProblem& problem, double radius) noexcept;
    double sum_up(const RestProblem& problem) noexcept;
    void balance(double least) noexcept;

    std::vector<Push> pushes_;
    std::size_t push_count_ = 0;
    std::vector<Symmetric3<double>> own_, blocks_;  // of each vertex: backing and springs to what is fixed; minus all
    std::vector<double> own_sizes_, sizes_;         // of each vertex, the numbers that make up its block
    std::vector<double> weights_, least_;           // of each vertex: w, its eigenvalue
    double most_ = 0;                               // of the backing
};
static_assert(ConvexityModel<BlockConvexity>);

inline std::optional<SpringBound> least_stiffness(const Spring<double>& spring, const Vector3<double>& reach,
                                                  double way) noexcept {
    constexpr double rounding = 1e-14;  // more than what is lost here
    const double length = norm(reach);
    if (!(2 * way < length)) return std::nullopt;
    const double q = (1 + rounding) * spring.rest_length / (length - way), s = way / length;
    if (!(q <= 2 && 2 * s * q <= 1)) return std::nullopt;
    return SpringBound{spring.stiffness * (1 - rounding - 2 * s * q), spring.stiffness * (1 - rounding - q),
                       reach / length};
}

inline BlockConvexity::BlockConvexity(const RestProblem& problem)
    : pushes_(problem.springs().size()),
      own_(static_cast<std::size_t>(problem.vertex_count())),
      blocks_(own_),
      own_sizes_(own_.size()),
      sizes_(own_.size()),
      weights_(own_.size()),
      least_(own_.size()) {}

inline double BlockConvexity::around(const RestProblem& problem, double radius) noexcept {
    if (!gather(problem, radius)) return -std::numeric_limits<double>::infinity();
    std::fill(weights_.begin(), weights_.end(), 1.0);
    double best = sum_up(problem);
    for (int round = 1; round < most_rounds && push_count_ > 0; ++round) {
        balance(best);
        const double now = sum_up(problem);
        if (!(now > best + 0.01 * std::abs(best))) return (std::max)(best, now);
        best = now;
    }
    return best;
}

// False where a spring may become too short.
inline bool BlockConvexity::gather(const RestProblem& problem, double radius) noexcept {
    push_count_ = 0;
    most_ = 0;
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        own_[static_cast<std::size_t>(v)] = diagonal3(problem.support(v));
        own_sizes_[static_cast<std::size_t>(v)] = 3 * (problem.backing(v) + std::abs(problem.support(v)));
        most_ = (std::max)(most_, problem.backing(v));
    }
    for (const auto& spring : problem.springs()) {
        const int ends = problem.free_ends(spring);
        if (ends == 0) continue;
        const auto least = least_stiffness(spring, reach_of(spring, problem.centre()), ends * radius);
        if (!least) return false;
        const auto first = static_cast<std::size_t>(spring.first), second = static_cast<std::size_t>(spring.second);
        if (ends == 1) {
            const std::size_t v = problem.fixed(spring.first) ? second : first;
            own_[v] += stiffness_of(*least);
            own_sizes_[v] += 3 * spring.stiffness;
        } else if (least->across < 0) {
            pushes_[push_count_++] = {first, second, stiffness_of({0, -least->across, least->u})};
        }
    }
    return true;
}

// The smallest eigenvalue of any vertex.
inline double BlockConvexity::sum_up(const RestProblem& problem) noexcept {
    constexpr double rounding = 1e-7;  // of an eigenvalue in closed form, twice
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
        least_[v] = -largest_eigenvalue(blocks_[v]) - rounding * sizes_[v];
        if (!problem.fixed(static_cast<Index>(v))) least = (std::min)(least, least_[v]);
    }
    return least;
}

// New weights: less for vertices that have more than the `least` one, nothing being below zero in what is multiplied.
inline void BlockConvexity::balance(double least) noexcept {
    constexpr double smallest = 0.05;
    for (std::size_t v = 0; v < own_.size(); ++v) {
        const double part = (most_ - least_[v]) / (most_ - least);
        weights_[v] *= part > smallest ? (std::min)(part, 1.0) : smallest;
    }
}

}  // namespace membrane
