// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/accuracy/equilibrium.hpp>

#include "types.hpp"

/// Equilibria, for several source files.
namespace membrane_python {

using membrane::Equilibrium;
using membrane::EquilibriumOptions;

/// The equilibrium, with as many reactions as there are constraints. Does not need Python's lock.
[[nodiscard]] Equilibrium equilibrium_of(const membrane::ConstPointsRef<double>& x, const Mesh& mesh,
                                         const Network& network, const Foundation& foundation,
                                         const EquilibriumOptions& options, const Constraints& constraints);

}  // namespace membrane_python
