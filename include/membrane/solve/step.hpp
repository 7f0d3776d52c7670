// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <string_view>

#include <membrane/core/check.hpp>

/// What a step of the solver may cost, and what it says of itself.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
///     if (report.status != membrane::StepStatus::advanced) { /* nothing has moved */ }
namespace membrane {

/// In what order vertices are visited: the layers from the contact outward, and in each
enum class UpdateOrder {
    breadth_first,  ///< as the breadth-first search came to them, [Liu07] 2.2
    colour_layers,  ///< those together that no spring joins: the processor moves several of them at once
    colour_all,     ///< groups of all layers together: few and large, for several threads; changes spread more slowly.
                    ///< Where there is a limit of visits: as `colour_layers`
};

/// What a step may cost. More of everything is more accurate.
template <Real Scalar>
struct SolverOptions {
    Index layers = 6;              ///< the queue's threshold; `unlimited` moves all that the seeds are joined to
    bool adaptive_layers = false;  ///< a layer, up to `layers`, only while a force on it is not negligible
    Index sweeps = 2;              ///< passes over the queue in each step
    Index contact_iterations = 3;  ///< visits of layer 0 in each sweep at most: what touches the tool converges last
    UpdateOrder order = UpdateOrder::colour_layers;
    bool predict = true;  ///< a step starts from the last displacements again, if the last step was not cut short
    Index max_vertex_updates =
        unlimited;  ///< visits of vertices in a step; layer 0, what is held and one vertex get theirs anyway
    Scalar force_tolerance = 0;       ///< with less on it a vertex is at rest [N]; 0: the network's, above rounding
    Scalar rigid_stiffness = 0;       ///< a tool's of a pinned or held vertex [N/m]; 0: 4 times the stiffest beside it
    Index max_contact_points = 4096;  ///< room for touched triangles; it decides the memory, not the time
    Index max_packed_vertices = 32'768;  ///< room for vertices moved several at once: each 260 bytes, 460 in double

    /// @throws InvalidInput for an option out of its range
    void check() const;
};

enum class StepStatus {
    advanced,                 ///< the positions are the new ones
    bad_time_step,            ///< dt is not finite, positive and a normal number: nothing has moved
    invalid_input,            ///< a tool, target, load, anchor, index or position is not valid: nothing has moved
    unstable,                 ///< the rule may diverge for this dt, or a force has no bound: nothing has moved
    too_many_contact_points,  ///< more touched triangles than there is room for: nothing has moved
};

/// What a step did. The spans are the solver's and valid until its next step.
template <Real Scalar>
struct StepReport {
    StepStatus status = StepStatus::advanced;
    /// No force above the negligible one is left on any vertex that the step may move: those of the queue, and with
    /// `adaptive_layers` the whole membrane.
    bool converged = false;
    /// The deadline cut the step short: without it more vertices would have been visited, if only to look.
    bool out_of_time = false;
    Scalar residual = 0;                         ///< largest unbalanced force on a free active vertex, at the end [N]
    Index vertex_updates = 0;                    ///< of vertices, those that only look included
    std::span<const Index> moved;                ///< vertices whose position changed
    std::span<const Vector3<Scalar>> reactions;  ///< for each constraint in turn, the membrane's force on it [N]

    /// The membrane's force on all constraints together [N].
    [[nodiscard]] Vector3<Scalar> total_reaction() const noexcept {
        Vector3<Scalar> sum = Vector3<Scalar>::Zero();
        for (const auto& reaction : reactions) sum += reaction;
        return sum;
    }
};

template <Real Scalar>
void SolverOptions<Scalar>::check() const {
    constexpr std::string_view component = "QuasiStaticSolver";
    const auto at_least = [&](Index number, Index least, std::string_view name) {
        if (number < least) refuse(component, name, " must be at least ", least, ", got ", number);
    };
    at_least(layers, 0, "layers");
    at_least(sweeps, 1, "sweeps");
    at_least(contact_iterations, 1, "contact_iterations");
    at_least(max_vertex_updates, 1, "max_vertex_updates");
    at_least(max_contact_points, 0, "max_contact_points");
    at_least(max_packed_vertices, 0, "max_packed_vertices");
    detail::check_option(component, force_tolerance, "force_tolerance", "N");
    detail::check_option(component, rigid_stiffness, "rigid_stiffness", "N/m");
}

}  // namespace membrane
