// SPDX-License-Identifier: MIT
// A body under the membrane that is not told where the vertex was when the tick began.
// expect: VolumeModel<.*Body
// expect: volume.pull
#include <membrane/solve/quasi_static.hpp>

struct Body {
    membrane::Pull<double> pull(membrane::Index, const membrane::Vector3<double>&,
#ifdef CORRECT
                                const membrane::Vector3<double>&,
#endif
                                double) const noexcept;
};

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

auto step(membrane::QuasiStaticSolver<double>& solver, Eigen::Matrix3Xd& x, const Network& network, const Body& body) {
    return solver.step(x, 1e-3, network, body).residual;
}
