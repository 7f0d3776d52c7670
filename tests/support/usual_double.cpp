// SPDX-License-Identifier: MIT
#include "usual_types.hpp"

MEMBRANE_USUAL_TYPES(template, double);
