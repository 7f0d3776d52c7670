// SPDX-License-Identifier: MIT
#include <membrane/instantiated.hpp>
#include <membrane/surface/moving_body.hpp>

MEMBRANE_INSTANTIATE(template, float);
