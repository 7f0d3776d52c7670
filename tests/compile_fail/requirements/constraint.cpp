// SPDX-License-Identifier: MIT
// wrong: Constraint: valid() const noexcept must return bool
// wrong: Constraint: there must be begin(ConstraintContext<Scalar>&) const noexcept
// wrong: Constraint: enforce(ConstraintContext<Scalar>&) const noexcept must return bool
// wrong: Constraint: reaction(const ConstraintContext<Scalar>&) const noexcept must return Vector3<Scalar>
// wrong: Constraint: valid() const noexcept must return bool
// wrong: Constraint: reaction(const ConstraintContext<Scalar>&) const noexcept must return Vector3<Scalar>
#include <type_traits>

#include <membrane/solve/quasi_static.hpp>

struct Magnet {
    std::conditional_t<WRONG == 5, int, bool> valid() const noexcept(WRONG != 1);
    void begin(membrane::ConstraintContext<double>&) const noexcept(WRONG != 2);
    bool enforce(membrane::ConstraintContext<double>&) const noexcept(WRONG != 3);
#if WRONG != 6
    membrane::Vector3<double> reaction(const membrane::ConstraintContext<double>&) const noexcept(WRONG != 4);
#endif
};

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

auto step(membrane::QuasiStaticSolver<double>& solver, Eigen::Matrix3Xd& x, const Network& network) {
    return solver.step(x, 1e-3, network, membrane::NoFoundation{}, Magnet{}).residual;
}
