// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <membrane/membrane.hpp>

/// The usual types of the loop, for float and double, are compiled once, by the library `membrane::instantiated`,
/// instead of in each file that uses them. `membrane/membrane.hpp` includes this where MEMBRANE_INSTANTIATED is
/// defined, as it is in targets that link the library. Other types (own laws, own foundations) are compiled as ever.
///
/// The library and the files that use it must be compiled for the same instruction set (-march, -mavx2): otherwise they
/// do not link.

// The arguments are types and keywords, which take no parentheses.
// NOLINTBEGIN(bugprone-macro-parentheses)

/// The step of a solver with a network of linear springs and this foundation.
#define MEMBRANE_INSTANTIATE_STEP(PREFIX, SCALAR, RULE, ...)                                          \
    PREFIX membrane::StepReport<SCALAR> membrane::QuasiStaticSolver<SCALAR, membrane::RULE>::step_in( \
        membrane::TimeBudget, membrane::PointsRef<SCALAR>&, SCALAR,                                   \
        const membrane::MassSpringNetwork<SCALAR, membrane::LinearSpring>&, const __VA_ARGS__&,       \
        std::span<const membrane::ConstraintRef<SCALAR>>) noexcept

/// A solver for a network of linear springs.
#define MEMBRANE_INSTANTIATE_SOLVER(PREFIX, SCALAR, RULE)                                                           \
    PREFIX class membrane::QuasiStaticSolver<SCALAR, membrane::RULE>;                                               \
    PREFIX membrane::QuasiStaticSolver<SCALAR, membrane::RULE>::QuasiStaticSolver(                                  \
        const membrane::MassSpringNetwork<SCALAR, membrane::LinearSpring>&, const membrane::SolverOptions<SCALAR>&, \
        const membrane::RULE&, membrane::AnyExecutor);                                                              \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, SCALAR, RULE, membrane::VirtualVolumeSprings<SCALAR>)

/// `PREFIX` is `template` in the library, and `extern template` everywhere else.
#define MEMBRANE_INSTANTIATE(PREFIX, SCALAR)                                                                     \
    PREFIX class membrane::TriangleMesh<SCALAR>;                                                                 \
    PREFIX membrane::TriangleMesh<SCALAR>::TriangleMesh(const Eigen::MatrixBase<membrane::Points<SCALAR>>&,      \
                                                        const Eigen::MatrixBase<membrane::Triangles>&);          \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::icosphere<SCALAR>(const membrane::IcosphereOptions&);        \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::sheet<SCALAR>(const membrane::SheetOptions&);                \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::disc<SCALAR>(const membrane::DiscOptions&);                  \
    PREFIX membrane::TriangleMesh<SCALAR> membrane::spherical_cap<SCALAR>(const membrane::SphericalCapOptions&); \
    PREFIX membrane::Adjacency::Adjacency(const membrane::TriangleMesh<SCALAR>&);                                \
    PREFIX class membrane::VertexNormals<SCALAR>;                                                                \
    PREFIX class membrane::MassSpringNetwork<SCALAR, membrane::LinearSpring>;                                    \
    PREFIX class membrane::VirtualVolumeSprings<SCALAR>;                                                         \
    PREFIX class membrane::LocalSurface<SCALAR>;                                                                 \
    PREFIX class membrane::AabbTree<SCALAR>;                                                                     \
    PREFIX class membrane::ContactTracker<SCALAR>;                                                               \
    PREFIX class membrane::Grasper<SCALAR>;                                                                      \
    PREFIX struct membrane::SolverOptions<SCALAR>;                                                               \
    PREFIX class membrane::PackedVertices<SCALAR>;                                                               \
    PREFIX class membrane::ContactPacks<SCALAR>;                                                                 \
    PREFIX struct membrane::VertexRows<SCALAR>;                                                                  \
    PREFIX struct membrane::ContactState<SCALAR>;                                                                \
    PREFIX class membrane::ConstraintContext<SCALAR>;                                                            \
    PREFIX struct membrane::ToolContact<SCALAR>;                                                                 \
    PREFIX struct membrane::PointAttachment<SCALAR>;                                                             \
    PREFIX class membrane::ScriptedDevice<SCALAR>;                                                               \
    MEMBRANE_INSTANTIATE_SOLVER(PREFIX, SCALAR, BlockStep);                                                      \
    MEMBRANE_INSTANTIATE_SOLVER(PREFIX, SCALAR, MassStep);                                                       \
    MEMBRANE_INSTANTIATE_SOLVER(PREFIX, SCALAR, SafeStep);                                                       \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, SCALAR, BlockStep, membrane::NoFoundation)

// NOLINTEND(bugprone-macro-parentheses)

MEMBRANE_INSTANTIATE(extern template, double);
MEMBRANE_INSTANTIATE(extern template, float);
