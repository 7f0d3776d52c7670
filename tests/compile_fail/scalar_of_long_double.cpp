// SPDX-License-Identifier: MIT
// A scalar that is neither float nor double.
// expect: Real
#include <membrane/surface/triangle_mesh.hpp>

#ifdef CORRECT
using Scalar = double;
#else
using Scalar = long double;
#endif

auto triangles_of(const membrane::TriangleMesh<Scalar>& mesh) { return mesh.triangle_count(); }
