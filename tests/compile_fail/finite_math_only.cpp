// SPDX-License-Identifier: MIT
// -ffast-math, which sets this macro, lets the compiler remove every check for NaN.
// expect: add -fno-finite-math-only
#ifndef CORRECT
#undef __FINITE_MATH_ONLY__
#define __FINITE_MATH_ONLY__ 1
#endif
#include <membrane/core/types.hpp>

membrane::Index v = membrane::no_index;
