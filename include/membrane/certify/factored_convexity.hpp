// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include <membrane/accuracy/block_cholesky.hpp>
#include <membrane/certify/convexity.hpp>

/// The sharper of two bounds of the convexity of a membrane's energy, for soft foundations.
///
///     #include <membrane/certify/factored_convexity.hpp>
///     membrane::ErrorBound<membrane::FactoredConvexity> bound(network);
namespace membrane {

/// Assembles the bounds of all springs in one matrix and factorises it. Springs in tension stabilise those in
/// compression: it shows convexity where the foundation alone does not suffice, and takes a few times as
/// long as `BlockConvexity`. After a tear construct another one: until then it finds no bound.
class FactoredConvexity {
  public:
    /// Offline. Cost for a mesh: O(V log V) memory.
    explicit FactoredConvexity(const EquilibriumProblem& problem)
        : factors_(problem.vertex_count(), problem.springs()),
          springs_(problem.springs().begin(), problem.springs().end()) {}

    /// Online. Cost for a mesh: O(V^1.5), up to five times.
    [[nodiscard]] double eigenvalue_bound(const EquilibriumProblem& problem, double radius) noexcept;

  private:
    bool gather(const EquilibriumProblem& problem, double radius) noexcept;

    BlockCholesky factors_;
    std::vector<Spring<double>> springs_;  // whose ends the factors are ordered for
    double even_ = 0;  // Rayleigh quotient of a uniform displacement: an upper bound of the smallest eigenvalue
};
static_assert(ConvexityModel<FactoredConvexity>);

inline double FactoredConvexity::eigenvalue_bound(const EquilibriumProblem& problem, double radius) noexcept {
    constexpr double none = -std::numeric_limits<double>::infinity();
    if (!gather(problem, radius)) return none;
    for (const double part : {0.5, 0.125, 0.01, 1e-4}) {
        if (factors_.definite_above(part * even_)) return part * even_;
    }
    return none;
}

// False if the springs join other vertices, or one may become too short to bound its stiffness.
inline bool FactoredConvexity::gather(const EquilibriumProblem& problem, double radius) noexcept {
    const auto joins_same = [](const Spring<double>& a, const Spring<double>& b) {
        return a.first == b.first && a.second == b.second;
    };
    const auto springs = problem.springs();
    if (!std::equal(springs.begin(), springs.end(), springs_.begin(), springs_.end(), joins_same)) return false;
    factors_.open();
    double sum = 0;
    Index free = 0;
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        if (problem.fixed(v)) continue;
        factors_.add(v, diagonal3(problem.support(v)));
        sum += 3 * problem.support(v);
        ++free;
    }
    for (std::size_t s = 0; s < springs.size(); ++s) {
        const auto& spring = springs[s];
        const int ends = problem.free_ends(spring);
        if (ends == 0) continue;
        const auto least = min_stiffness(spring, edge_vector(spring, problem.centre()), ends * radius);
        if (!least) return false;
        const auto block = block_of(*least);
        for (const Index v : {spring.first, spring.second}) {
            if (!problem.fixed(v)) factors_.add(v, block);
        }
        if (ends == 2) factors_.subtract(s, block);
        if (ends == 1) sum += block.trace();
    }
    even_ = sum / (3 * static_cast<double>((std::max)(free, Index(1))));
    // A fixed vertex has a row of its own, which must not have the smallest eigenvalue.
    for (Index v = 0; v < problem.vertex_count(); ++v) {
        if (problem.fixed(v)) factors_.add(v, diagonal3(2 * even_));
    }
    return even_ > 0;
}

}  // namespace membrane
