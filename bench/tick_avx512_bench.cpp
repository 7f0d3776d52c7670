// SPDX-License-Identifier: MIT

// The same, compiled for AVX-512. Bullet comes compiled, and is the same.
#include "tick_bench.cpp"
