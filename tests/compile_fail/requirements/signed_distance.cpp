// SPDX-License-Identifier: MIT
// wrong: SignedDistance: distance(const Vector3<double>&) const must give a double [m]
#include <membrane/meshing/distmesh.hpp>

struct Pot {
    double operator()(const membrane::Vector3<double>&)
#if WRONG != 1
        const
#endif
        ;
};

auto mesh() { return membrane::distmesh(Pot{}, {.edge_length = 1e-3}).triangle_count(); }
