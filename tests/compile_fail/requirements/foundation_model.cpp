// SPDX-License-Identifier: MIT
// wrong: FoundationModel: force_on(Index, const Vector3<Scalar>& position, const Vector3<Scalar>& start, Scalar dt)
// const noexcept must wrong: FoundationModel: force_on(Index, const Vector3<Scalar>& position, const Vector3<Scalar>&
// start, Scalar dt) const noexcept must wrong: FoundationModel: force_on(Index, const Vector3<Scalar>& position, const
// Vector3<Scalar>& start, Scalar dt) const noexcept must wrong: FoundationModel: force_on(Index, const Vector3<Scalar>&
// position, const Vector3<Scalar>& start, Scalar dt) const noexcept must
#include <type_traits>

#include <membrane/solve/quasi_static.hpp>

struct Body {
#if WRONG == 4  // where the vertex was at the tick's beginning is left out
    membrane::VertexForce<double> force_on(membrane::Index, const membrane::Vector3<double>&, double) const noexcept;
#elif WRONG != 3
    std::conditional_t<WRONG == 2, double, membrane::VertexForce<double>> force_on(membrane::Index,
                                                                                   const membrane::Vector3<double>&,
                                                                                   const membrane::Vector3<double>&,
                                                                                   double) const noexcept(WRONG != 1);
#endif
};

using Network = membrane::MassSpringNetwork<double, membrane::LinearSpring>;

auto step(membrane::QuasiStaticSolver<double>& solver, Eigen::Matrix3Xd& x, const Network& network, const Body& body) {
    return solver.step(x, 1e-3, network, body).residual;
}
