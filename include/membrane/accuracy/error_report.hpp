// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <span>

#include <membrane/core/types.hpp>

/// What is known of how far a membrane is from rest.
///
///     const membrane::ErrorReport error = bound.of(x, network, foundation, membrane::pull(7, target));
///     if (error.certified()) error.position; error.reactions[0].max_distance_to(report.reactions[0]);   // [m], [N]
namespace membrane {

enum class BoundStatus {
    certified,
    not_convex,     ///< the energy could not be shown to be convex as far as the equilibrium seems to be
    not_converged,  ///< the equilibrium was not neared enough to say anything
    contact,        ///< a tool touches: it takes the equilibrium to say more
    unsupported,  ///< a constraint that does not `describe` itself, or held points with a corner that something else holds too
    invalid_input,  ///< a number is not finite, an index names no vertex, counts do not agree
};

/// A force that is not known exactly: within `radius` of `centre` [N].
struct ForceEnclosure {
    Vector3<double> centre = Vector3<double>::Zero();
    double radius = std::numeric_limits<double>::infinity();

    /// Upper bound of the distance to `force` [N].
    template <class Force>
    [[nodiscard]] double max_distance_to(const Force& force) const noexcept {
        return norm<double>(force.template cast<double>() - centre) * (1 + 1e-15) + radius;
    }
};

/// What is known of the equilibrium near a state. The span is the `ErrorBound`'s and valid until its next call.
struct ErrorReport {
    BoundStatus status = BoundStatus::invalid_input;

    /// If certified: exactly one equilibrium has every vertex within `position` of where it is now; else infinite [m].
    double position = std::numeric_limits<double>::infinity();

    /// If certified: the reaction of each constraint in turn at that equilibrium.
    std::span<const ForceEnclosure> reactions;

    /// Where no bound is known, how far the equilibrium seems to be [m]; not proven. The centres of `reactions` are
    /// then estimates too.
    double estimate = std::numeric_limits<double>::infinity();

    double convexity = 0;     ///< lower bound of the smallest eigenvalue of the stiffness around [N/m], where positive
    Index cg_iterations = 0;  ///< that were done

    [[nodiscard]] bool certified() const noexcept { return status == BoundStatus::certified; }
};

}  // namespace membrane
