// SPDX-License-Identifier: MIT
#include "solver.hpp"

namespace membrane_python {

MEMBRANE_PYTHON_STEPS(template, membrane::MassStep);

}  // namespace membrane_python
