// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/meshing/remesh.hpp>

/// Edges as short as load and foundation need, and as long as allowed elsewhere: a size function for `distmesh`.
///
///     const auto length = membrane::graded_edge_length({.longest = 0.4e-3,                            // [m]
///                                                       .loads = {{.centre = {0, 0, 0}, .radius = 0.5e-3}},
///                                                       .tension = 1.8, .foundation = 2e7});          // [N/m], [Pa/m]
///     const auto mesh = membrane::distmesh(body, {.edge_length = length});
namespace membrane {

/// Where a tool or a patch presses.
struct GradedLoad {
    Vector3<double> centre = Vector3<double>::Zero();  ///< [m]
    double radius = 0;                                 ///< of the area that it touches [m]
};

/// Options of `graded_edge_length`.
struct GradedLengthOptions {
    double longest = 0;                  ///< Edge length away from the loads [m]. Required.
    std::vector<GradedLoad> loads = {};  ///< At least one.
    double tension = 0;                  ///< T of the membrane [N/m]; needed with a foundation.
    double foundation = 0;               ///< Its normal stiffness per area c [Pa/m]; 0: none.
    double resolution = 4;               ///< Edges per radius of a load, and per decay length beside it [1].
    double growth = 0.2;                 ///< Difference of edge lengths over the distance between them, 0 to 1 [1].
};

/// The distance sqrt(T / c) over which a dent in a membrane of tension `tension` [N/m] on a foundation of stiffness
/// `foundation` per area [Pa/m] falls by e [m]; infinite without a foundation.
/// @throws InvalidInput for numbers that are negative or not finite, or a tension of 0 on a foundation
[[nodiscard]] inline double decay_length(double tension, double foundation);

/// At each load edges are a `resolution`-th of its radius or of the decay length, whichever is less. Away from its area
/// they grow by `growth` times the distance, up to `longest`. With several loads the shortest length counts. The
/// function is Lipschitz continuous with the constant `growth`.
///
/// A dent is steepest at the rim of the load, where its curvature falls off with the distance from the rim and from the
/// centre: edges that grow with the distance share the error out evenly.
/// @throws InvalidInput for a length, resolution or growth out of its range, and without loads
[[nodiscard]] inline EdgeLength graded_edge_length(GradedLengthOptions options);

namespace detail {

inline constexpr std::string_view graded_length_name = "graded_edge_length";

inline void check_graded_length(const GradedLengthOptions& options) {
    constexpr auto name = graded_length_name;
    check_option(name, options.longest, "longest", "m", false);
    check_option(name, options.resolution, "resolution", "1", false);
    if (!(options.growth > 0 && options.growth <= 1)) {
        refuse(name, "growth must be above 0 and at most 1, got ", options.growth);
    }
    if (options.loads.empty()) refuse(name, "loads must have at least one load, got none");
    for (std::size_t i = 0; i < options.loads.size(); ++i) {
        const auto& load = options.loads[i];
        if (!is_finite(load.centre)) refuse(name, "centre of load ", i, " must be finite [m], got one that is not");
        if (is_finite(load.radius) && load.radius > 0) continue;
        refuse(name, "radius of load ", i, " must be finite and positive [m], got ", load.radius);
    }
}

}  // namespace detail

inline double decay_length(double tension, double foundation) {
    detail::check_option("decay_length", foundation, "foundation", "Pa/m");
    detail::check_option("decay_length", tension, "tension", "N/m", foundation == 0);
    return foundation > 0 ? std::sqrt(tension / foundation) : std::numeric_limits<double>::infinity();
}

inline EdgeLength graded_edge_length(GradedLengthOptions options) {
    detail::check_graded_length(options);
    const double decay = decay_length(options.tension, options.foundation);
    return [options = std::move(options), decay](const Vector3<double>& p) {
        double length = options.longest;
        for (const auto& load : options.loads) {
            const double outside = (std::max)(norm<double>(p - load.centre) - load.radius, 0.0);
            const double shortest = (std::min)(load.radius, decay) / options.resolution;
            length = (std::min)(length, shortest + options.growth * outside);
        }
        return length;
    };
}

}  // namespace membrane
