// SPDX-License-Identifier: MIT

// The same with 32 bytes in a register; without, there are 16. Bullet comes compiled, and is the same.
#include "tick_bench.cpp"
