// SPDX-License-Identifier: MIT
// The edges of an adjacency that is gone at the end of the line.
// expect: (use of|call to) deleted (function|member function)
#include <membrane/surface/adjacency.hpp>

auto count(const membrane::TriangleMesh<double>& mesh) {
#ifdef CORRECT
    const auto edges = membrane::edges(mesh);
#else
    const auto edges = membrane::Adjacency(mesh).edges();
#endif
    return edges.size();
}
