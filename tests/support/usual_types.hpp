// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/SVD>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/instantiated.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tissue/bending_triangles.hpp>
#include <membrane/tissue/foundation_layer.hpp>

// What most tests are made of beside the types of `membrane::instantiated`. Nothing of accuracy/ is here: its inline
// functions would have every file instantiate Eigen's sparse solvers.
#define MEMBRANE_USUAL_TYPES(PREFIX, SCALAR)                                       \
    PREFIX class membrane::MovingBody<SCALAR>;                                     \
    PREFIX class membrane::SmoothContact<SCALAR>;                                  \
    PREFIX class membrane::MassSpringNetwork<SCALAR, membrane::ExponentialSpring>; \
    PREFIX class membrane::FoundationSprings<SCALAR>;                              \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, SCALAR, BlockStep,                           \
                              membrane::MovingFoundation<membrane::VirtualVolumeSprings<SCALAR>, SCALAR>)

// In float few tests have them.
#define MEMBRANE_USUAL_TYPES_IN_DOUBLE(PREFIX)                                                             \
    MEMBRANE_USUAL_TYPES(PREFIX, double);                                                                  \
    PREFIX class membrane::detail::BendingMesh<double>;                                                    \
    PREFIX class Eigen::JacobiSVD<Eigen::MatrixXd>;                                                        \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, double, BlockStep, membrane::FoundationSprings<double>);             \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, double, BlockStep, membrane::CohesiveSprings<double>);               \
    PREFIX membrane::StepReport<double> membrane::QuasiStaticSolver<double, membrane::BlockStep>::step_in( \
        membrane::TimeBudget, membrane::PointsRef<double>&, double,                                        \
        const membrane::TearableSprings<double, membrane::LinearSpring>&,                                  \
        const membrane::VirtualVolumeSprings<double>&, std::span<const membrane::ConstraintRef<double>>) noexcept

MEMBRANE_USUAL_TYPES_IN_DOUBLE(extern template);
MEMBRANE_USUAL_TYPES(extern template, float);
