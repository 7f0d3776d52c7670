// SPDX-License-Identifier: MIT
// wrong: StaticConstraint: there must be describe(const C&, EquilibriumScene&) in the namespace of the constraint
#include <membrane/accuracy/equilibrium_scene.hpp>

struct Clamp {};
#if WRONG != 1
void describe(const Clamp&, membrane::EquilibriumScene&);
#endif

static_assert(membrane::CheckedStaticConstraint<Clamp>);
