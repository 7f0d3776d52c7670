// SPDX-License-Identifier: MIT
// Float positions for a solver of doubles.
// expect: points must be of the scalar of the part
#include <membrane/solve/quasi_static.hpp>

#ifdef CORRECT
using Positions = Eigen::Matrix3Xd;
#else
using Positions = Eigen::Matrix3Xf;
#endif

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

auto step(membrane::QuasiStaticSolver<double>& solver, Positions& x, const Network& network) {
    return solver.step(x, 1e-3, network, membrane::NoFoundation{}).residual;
}
