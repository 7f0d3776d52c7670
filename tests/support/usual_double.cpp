// SPDX-License-Identifier: MIT
#include "usual_types.hpp"

MEMBRANE_USUAL_TYPES_IN_DOUBLE(template);
