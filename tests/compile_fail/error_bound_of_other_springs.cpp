// SPDX-License-Identifier: MIT
// A bound for springs whose energy it knows nothing of.
// expect: the springs must follow LinearSpring
#include <membrane/certify/error_bound.hpp>

#ifdef CORRECT
using Law = membrane::LinearSpring;
#else
using Law = membrane::ExponentialSpring;
#endif

auto bound(const membrane::MassSpringNetwork<double, Law>& network) { return membrane::ErrorBound(network); }
