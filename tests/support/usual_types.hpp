// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>
#include <membrane/model/foundation_layer.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/surface/moving_body.hpp>

// What most programs here are made of, compiled once, in a library: a file that includes this first leaves it to the
// library, but for functions that are inline. Nothing of accuracy/ is here: its inline functions would have every file
// instantiate Eigen's sparse solvers.

namespace usual {

template <class Scalar>
using Springs = membrane::MassSpringNetwork<Scalar, membrane::LinearSpring>;

}  // namespace usual

#define MEMBRANE_USUAL_STEP(PREFIX, SCALAR, RULE, ...)                                                                 \
    PREFIX membrane::StepReport<SCALAR> membrane::QuasiStaticSolver<SCALAR, membrane::RULE>::step_in(                  \
        membrane::TimeBudget, membrane::PointsRef<SCALAR>&, SCALAR, const usual::Springs<SCALAR>&, const __VA_ARGS__&, \
        std::span<const membrane::ConstraintRef<SCALAR>>) noexcept

#define MEMBRANE_USUAL_SOLVER(PREFIX, SCALAR, RULE)                                                   \
    PREFIX class membrane::QuasiStaticSolver<SCALAR, membrane::RULE>;                                 \
    PREFIX membrane::QuasiStaticSolver<SCALAR, membrane::RULE>::QuasiStaticSolver(                    \
        const usual::Springs<SCALAR>&, const membrane::SolverOptions<SCALAR>&, const membrane::RULE&, \
        membrane::AnyExecutor);                                                                       \
    MEMBRANE_USUAL_STEP(PREFIX, SCALAR, RULE, membrane::VirtualVolumeSprings<SCALAR>)

/// `PREFIX` is `template` where they are compiled, and `extern template` everywhere else.
#define MEMBRANE_USUAL_TYPES(PREFIX, SCALAR)                                                                     \
    PREFIX class membrane::TriangleMesh<SCALAR>;                                                                 \
    PREFIX membrane::TriangleMesh<SCALAR>::TriangleMesh(const Eigen::MatrixBase<membrane::Points<SCALAR>>&,      \
                                                        const Eigen::MatrixBase<membrane::Triangles>&);          \
    PREFIX membrane::Adjacency::Adjacency(const membrane::TriangleMesh<SCALAR>&);                                \
    PREFIX class membrane::ScriptedDevice<SCALAR>;                                                               \
    PREFIX class membrane::VertexNormals<SCALAR>;                                                                \
    PREFIX class membrane::MovingBody<SCALAR>;                                                                   \
    PREFIX class membrane::LocalSurface<SCALAR>;                                                                 \
    PREFIX class membrane::WideBvh<SCALAR>;                                                                      \
    PREFIX class membrane::AabbTree<SCALAR>;                                                                     \
    PREFIX class membrane::ContactTracker<SCALAR>;                                                               \
    PREFIX class membrane::Grasper<SCALAR>;                                                                      \
    PREFIX class membrane::SmoothContact<SCALAR>;                                                                \
    PREFIX class membrane::MassSpringNetwork<SCALAR, membrane::LinearSpring>;                                    \
    PREFIX class membrane::MassSpringNetwork<SCALAR, membrane::ExponentialSpring>;                               \
    PREFIX class membrane::VirtualVolumeSprings<SCALAR>;                                                         \
    PREFIX class membrane::FoundationSprings<SCALAR>;                                                            \
    PREFIX class membrane::PackedVertices<SCALAR>;                                                               \
    PREFIX class membrane::ContactPacks<SCALAR>;                                                                 \
    PREFIX struct membrane::StepState<SCALAR>;                                                                   \
    PREFIX class membrane::ConstraintContext<SCALAR>;                                                            \
    PREFIX struct membrane::ToolContact<SCALAR>;                                                                 \
    PREFIX struct membrane::PointAttachment<SCALAR>;                                                             \
    PREFIX struct membrane::SolverOptions<SCALAR>;                                                               \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::icosphere<SCALAR>(const membrane::IcosphereOptions&);        \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::sheet<SCALAR>(const membrane::SheetOptions&);                \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::disc<SCALAR>(const membrane::DiscOptions&);                  \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::spherical_cap<SCALAR>(const membrane::SphericalCapOptions&); \
    MEMBRANE_USUAL_SOLVER(PREFIX, SCALAR, BlockStep);                                                            \
    MEMBRANE_USUAL_SOLVER(PREFIX, SCALAR, MassStep);                                                             \
    MEMBRANE_USUAL_SOLVER(PREFIX, SCALAR, SafeStep);                                                             \
    MEMBRANE_USUAL_STEP(PREFIX, SCALAR, BlockStep, membrane::NoFoundation);                                      \
    MEMBRANE_USUAL_STEP(PREFIX, SCALAR, BlockStep,                                                               \
                        membrane::MovingFoundation<membrane::VirtualVolumeSprings<SCALAR>, SCALAR>)

MEMBRANE_USUAL_TYPES(extern template, double);
MEMBRANE_USUAL_TYPES(extern template, float);
