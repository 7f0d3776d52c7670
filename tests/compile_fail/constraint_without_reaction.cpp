// SPDX-License-Identifier: MIT
// A constraint that does not say what it is pushed with.
// expect: Constraint<.*Magnet
#include <membrane/solve/quasi_static.hpp>

struct Magnet {
    bool sound() const noexcept;
    void begin(membrane::Region<double>&) const noexcept;
    bool enforce(membrane::Region<double>&) const noexcept;
#ifdef CORRECT
    membrane::Vector3<double> reaction(const membrane::Region<double>&) const noexcept;
#endif
};

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

auto step(membrane::QuasiStaticSolver<double>& solver, Eigen::Matrix3Xd& x, const Network& network) {
    return solver.step(x, 1e-3, network, membrane::NoVolumeSprings{}, Magnet{}).residual;
}
