// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <membrane/accuracy/constraint_term.hpp>

namespace membrane {

/// Points of triangles attached to targets: each point is the weighted sum of three corners.
///
///     membrane::PointAttachments attachments;
///     attachments.add(membrane::ConstraintTerm::prescribe(corners, weights, target));
///     attachments.project_positions(y);             // every point is at its target
///     attachments.project(displacement);            // and stays there if y moves by this
class PointAttachments {
  public:
    /// Adds a point. False if there are 16 already.
    bool add(const ConstraintTerm& term) noexcept {
        if (count_ == terms_.size()) return false;
        terms_[count_++] = term;
        return true;
    }

    /// Removes all points.
    void clear() noexcept { count_ = 0; }

    /// Whether there is no point.
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

    /// Whether no corner with a weight belongs to two points, or is `fixed(v)`. The functions below require this.
    template <class IsFixed>
    [[nodiscard]] bool independent(IsFixed fixed) const noexcept;

    /// Removes from `f` the components that move a point: the orthogonal projection.
    void project(Points<double>& f) const noexcept;

    /// Moves the points to their targets, by the shortest displacement of y.
    void project_positions(Points<double>& y) const noexcept;

    /// Upper bound of the distance to the nearest state with all points at their targets, rounding included [m].
    [[nodiscard]] double violation(const Points<double>& y) const noexcept;

  private:
    [[nodiscard]] std::span<const ConstraintTerm> terms() const noexcept { return {terms_.data(), count_}; }
    static void shift(const ConstraintTerm& term, const Vector3<double>& displacement, Points<double>& y) noexcept {
        for (std::size_t k = 0; k < 3; ++k) y.col(term.corners[k]) += term.share(k) * displacement;
    }

    std::array<ConstraintTerm, 16> terms_{};
    std::size_t count_ = 0;
};

template <class IsFixed>
bool PointAttachments::independent(IsFixed fixed) const noexcept {
    const auto owners = [&](Index v) {
        int count = 0;
        for (const auto& term : terms()) {
            for (std::size_t k = 0; k < 3; ++k) {
                if (term.corners[k] == v && term.weight(k) != 0) ++count;
            }
        }
        return count;
    };
    for (const auto& term : terms()) {
        for (const Index v : term.corners) {
            if (owners(v) + (fixed(v) ? 1 : 0) > 1) return false;
        }
    }
    return true;
}

inline void PointAttachments::project(Points<double>& f) const noexcept {
    for (const auto& term : terms()) shift(term, -term.point_in(f), f);
}

inline void PointAttachments::project_positions(Points<double>& y) const noexcept {
    for (const auto& term : terms()) shift(term, term.target - term.point_in(y), y);
}

inline double PointAttachments::violation(const Points<double>& y) const noexcept {
    double squares = 0;
    for (const auto& term : terms()) {
        double size = norm(term.target);
        for (std::size_t k = 0; k < 3; ++k) size += std::abs(term.weight(k)) * norm(point(y, term.corners[k]));
        const double left =
            norm<double>(term.target - term.point_in(y)) + 8 * std::numeric_limits<double>::epsilon() * size;
        squares += left * left / squared_norm(term.weights);
    }
    return (1 + 1e-9) * std::sqrt(squares);
}

}  // namespace membrane
