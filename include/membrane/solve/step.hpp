// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <string_view>

#include <membrane/core/check.hpp>

/// Options of the solver, and the report of a step.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
///     const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
///     if (report.status != membrane::StepStatus::advanced) return;  // nothing has moved
namespace membrane {

/// The largest number of constraints of one step.
inline constexpr std::size_t max_constraints = 16;

/// Order of the vertex updates: the layers from the contact outward, and in each layer
enum class UpdateOrder {
    breadth_first,  ///< as one by one in the order of the breadth-first search, [Liu07] 2.2
    colour_layers,  ///< in groups that no spring joins: several vertices are updated at once (SIMD)
    colour_all,  ///< groups across all layers: few and large, for several threads; changes spread more slowly. With a
                 ///< limit of vertex updates: as `colour_layers`
};

/// Options of the solver. More layers, sweeps and iterations are more accurate, and cost more.
template <Real Scalar>
struct SolverOptions {
    Index layers = 6;  ///< of the queue beyond layer 0; `unlimited`: all vertices connected to the seeds. The default
        ///< suits a foundation of a fifth of the springs: `choose_settings` finds the number for a scene,
        ///< `recommended_layers` for a material; they leave out `StepReport::residual_beyond`
    bool adaptive_layers = false;  ///< adds a layer, up to `layers`, while a force on it exceeds `force_tolerance`
    Index sweeps = 2;              ///< passes over the queue in each step
    Index contact_iterations = 3;  ///< updates of layer 0 in each sweep at most: vertices in contact converge last
    UpdateOrder order = UpdateOrder::colour_layers;  ///< of the vertices in a sweep
    bool predict = true;  ///< a step extrapolates the last displacements, if the last step was complete
    Index max_vertex_updates = unlimited;  ///< in a step; layer 0, prescribed vertices and one more are always updated
    Scalar force_tolerance = 0;            ///< residual force of a vertex in equilibrium [N]; 0: above rounding
    /// A step has also converged if no residual force exceeds this part of the reactions' sizes together, as 1e-3 of
    /// what the hand feels; 0: does not count.
    Scalar relative_tolerance = 0;
    Scalar rigid_stiffness = 0;  ///< of a fixed vertex against constraints [N/m]; 0: 4 times the stiffest beside it
    Index max_contact_points = 4096;     ///< capacity in contact points; it determines the memory, not the time
    Index max_packed_vertices = 32'768;  ///< that stay packed during a step, others are packed for each update: memory
                                         ///< of 260 bytes each, 460 in double

    /// @throws InvalidInput for an option out of its range
    void validate() const;
};

/// Whether a step advanced, or why it was refused.
enum class StepStatus {
    advanced,       ///< the positions are the new ones
    bad_time_step,  ///< dt is not finite, positive and a normal number: nothing has moved
    invalid_input,  ///< a tool, target, load, anchor, index or position is not valid, or too far off: nothing has moved
    unstable,       ///< the rule may diverge for this dt, or a force is unbounded: nothing has moved
    too_many_contact_points,  ///< more contact points than the capacity: nothing has moved
    wrong_vertex_count,       ///< `x`, network or foundation is not of the solver's vertices: nothing has moved
    network_missed_split,     ///< of a tear: pass this part to `follow` for each event. Nothing has moved
    foundation_missed_split,  ///< of a tear: pass this part to `follow` for each event. Nothing has moved
    solver_missed_split,      ///< of a tear: pass this part to `follow` for each event. Nothing has moved
    contact_missed_split,     ///< of a tear: pass tracker and tree to `follow` for each event. Nothing has moved
};

/// The name of the status, as above.
[[nodiscard]] constexpr std::string_view to_string(StepStatus status) noexcept {
    switch (status) {
        case StepStatus::advanced: return "advanced";
        case StepStatus::bad_time_step: return "bad_time_step";
        case StepStatus::invalid_input: return "invalid_input";
        case StepStatus::unstable: return "unstable";
        case StepStatus::too_many_contact_points: return "too_many_contact_points";
        case StepStatus::wrong_vertex_count: return "wrong_vertex_count";
        case StepStatus::network_missed_split: return "network_missed_split";
        case StepStatus::foundation_missed_split: return "foundation_missed_split";
        case StepStatus::solver_missed_split: return "solver_missed_split";
        case StepStatus::contact_missed_split: return "contact_missed_split";
    }
    return "";
}

/// The report of a step. The spans are the solver's and valid until its next step.
template <Real Scalar>
struct StepReport {
    StepStatus status = StepStatus::advanced;  ///< whether the step advanced
    /// With `invalid_input`, the number of the constraint at fault; `no_index`: `x` is, or the foundation.
    Index invalid_constraint = no_index;
    /// No residual force exceeds `force_tolerance` on the vertices that the step may move: those of the queue, and with
    /// `adaptive_layers` those of the whole membrane. Or none exceeds `relative_tolerance` of the reactions. Whether
    /// the layers are enough, only `residual_beyond` shows.
    bool converged = false;
    /// The deadline ended the step early: without it more vertex updates would have been made, even if none moved a
    /// vertex.
    bool out_of_time = false;
    Scalar residual = 0;  ///< largest residual force on a free active vertex [N]; 0 if refused
    ///@{
    /// What the layers leave out: the largest residual force on a free vertex that this step did not update, beside one
    /// that it did, and the sum of these forces [N]. While the tools move, the sum is the part of their force on the
    /// membrane that reaches neither foundation nor pinned vertices; beside vertices that have come to rest nothing is
    /// counted. Both are 0 while the queue has all vertices. Once a contact has ended it has none: then the forces on
    /// vertices at rest remain, below the tolerance.
    Scalar residual_beyond = 0;
    Vector3<Scalar> unsupported = Vector3<Scalar>::Zero();
    ///@}
    /// Constraints that cannot all hold share the violation, see `rigid_support.hpp`: the largest distance by which one
    /// does not hold at a point, as a tool that penetrates between another tool and the membrane, or at a pin [m].
    Scalar violation = 0;
    Index violated = no_index;                   ///< number of that constraint; `no_index`: all hold
    Index vertex_updates = 0;                    ///< including evaluations of forces without an update
    std::span<const Index> moved = {};           ///< vertices whose position changed, or that a tear has placed since
    std::span<const Vector3<Scalar>> reactions;  ///< for each constraint, in order, the membrane's force on it [N]

    /// The membrane's force on all constraints together [N].
    [[nodiscard]] Vector3<Scalar> total_reaction() const noexcept {
        Vector3<Scalar> sum = Vector3<Scalar>::Zero();
        for (const auto& reaction : reactions) sum += reaction;
        return sum;
    }
};

template <Real Scalar>
void SolverOptions<Scalar>::validate() const {
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
    detail::check_option(component, relative_tolerance, "relative_tolerance", "1");
    detail::check_option(component, rigid_stiffness, "rigid_stiffness", "N/m");
}

}  // namespace membrane
