// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/instantiated.hpp>
#include <membrane/model/foundation_layer.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/surface/moving_body.hpp>

// What most tests are made of beside the types of `membrane::instantiated`. Nothing of accuracy/ is here: its inline
// functions would have every file instantiate Eigen's sparse solvers.
#define MEMBRANE_USUAL_TYPES(PREFIX, SCALAR)                                       \
    PREFIX class membrane::MovingBody<SCALAR>;                                     \
    PREFIX class membrane::SmoothContact<SCALAR>;                                  \
    PREFIX class membrane::MassSpringNetwork<SCALAR, membrane::ExponentialSpring>; \
    PREFIX class membrane::FoundationSprings<SCALAR>;                              \
    MEMBRANE_INSTANTIATE_STEP(PREFIX, SCALAR, BlockStep,                           \
                              membrane::MovingFoundation<membrane::VirtualVolumeSprings<SCALAR>, SCALAR>)

MEMBRANE_USUAL_TYPES(extern template, double);
MEMBRANE_USUAL_TYPES(extern template, float);
