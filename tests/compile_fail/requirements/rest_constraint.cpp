// SPDX-License-Identifier: MIT
// wrong: RestConstraint: there must be describe(const C&, RestScene&) in the namespace of the constraint
#include <membrane/accuracy/rest_scene.hpp>

struct Clamp {};
#if WRONG != 1
void describe(const Clamp&, membrane::RestScene&);
#endif

static_assert(membrane::CheckedRestConstraint<Clamp>);
