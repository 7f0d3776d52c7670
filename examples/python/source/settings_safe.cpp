// SPDX-License-Identifier: MIT
#include "settings.hpp"

namespace membrane_python {

MEMBRANE_PYTHON_SETTINGS(template, membrane::SafeStep);

}  // namespace membrane_python
