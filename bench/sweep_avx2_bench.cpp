// SPDX-License-Identifier: MIT

// The same with 32 bytes in a register; without, there are 16.
#include "sweep_bench.cpp"
