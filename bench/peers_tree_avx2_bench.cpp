// SPDX-License-Identifier: MIT

// The same with 32 bytes in a register; without, there are 16. The others come compiled, and are the same, but CGAL.
#include "peers_tree_bench.cpp"
