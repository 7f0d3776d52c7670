// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <span>
#include <string_view>

#include <membrane/core/types.hpp>

/// The bound of the distance of a membrane from equilibrium.
///
///     const membrane::ErrorReport error = bound.compute(x, network, foundation, membrane::pull(7, target));
///     if (error.certified()) error.position; error.reactions[0].max_distance_to(report.reactions[0]);   // [m], [N]
namespace membrane {

/// Whether there is a bound, or why not.
enum class BoundStatus {
    certified,      ///< the bound is proven
    not_convex,     ///< convexity could not be shown up to the estimated equilibrium
    not_converged,  ///< the iteration ended too far from the equilibrium for a bound
    contact,        ///< a tool touches: the bound needs the `Equilibrium` as an argument
    unsupported,    ///< a constraint without `describe`, or an attached point that shares a corner with another one
    invalid_input,  ///< a number is not finite, an index is not a vertex, or counts do not match
};

/// The name of the status, as above.
[[nodiscard]] constexpr std::string_view to_string(BoundStatus status) noexcept {
    switch (status) {
        case BoundStatus::certified: return "certified";
        case BoundStatus::not_convex: return "not_convex";
        case BoundStatus::not_converged: return "not_converged";
        case BoundStatus::contact: return "contact";
        case BoundStatus::unsupported: return "unsupported";
        case BoundStatus::invalid_input: return "invalid_input";
    }
    return "";
}

/// An enclosure of a force: within `radius` of `centre` [N].
struct ForceEnclosure {
    Vector3<double> centre = Vector3<double>::Zero();         ///< [N]
    double radius = std::numeric_limits<double>::infinity();  ///< [N]; infinite: not enclosed

    /// Upper bound of the distance to `force` [N].
    template <class Force>
    [[nodiscard]] double max_distance_to(const Force& force) const noexcept {
        return norm<double>(force.template cast<double>() - centre) * (1 + 1e-15) + radius;
    }
};

/// The bound at a state. The span belongs to the `ErrorBound` and is valid until its next call.
struct ErrorReport {
    BoundStatus status = BoundStatus::invalid_input;  ///< the bounds below are proven only if this is `certified`

    /// If certified: exactly one equilibrium has every vertex within `position` of its current position; else infinite
    /// [m].
    double position = std::numeric_limits<double>::infinity();

    /// If certified: enclosures of the reactions at that equilibrium, for each constraint in order.
    std::span<const ForceEnclosure> reactions;

    /// If there is no bound, an estimate of the distance to the equilibrium [m]; not proven. The centres of `reactions`
    /// are then estimates too.
    double estimate = std::numeric_limits<double>::infinity();

    double convexity = 0;     ///< lower bound of the smallest eigenvalue of the stiffness [N/m], if positive
    Index cg_iterations = 0;  ///< performed

    /// Whether the bounds are proven.
    [[nodiscard]] bool certified() const noexcept { return status == BoundStatus::certified; }
};

}  // namespace membrane
