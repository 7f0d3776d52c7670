// SPDX-License-Identifier: MIT
// wrong: StepRule: must be copyable
// wrong: StepRule: compliance(const VertexState<Scalar>&) const noexcept must return Scalar or Symmetric3<Scalar>
// wrong: StepRule: compliance(const VertexState<Scalar>&) const noexcept must return Scalar or Symmetric3<Scalar>
// wrong: StepRule: compliance(const VertexState<Scalar>&) const noexcept must return Scalar or Symmetric3<Scalar>
#include <type_traits>

#include <membrane/solve/quasi_static.hpp>

struct Damped {
    Damped();
    Damped(const Damped&)
#if WRONG == 1
        = delete
#endif
        ;
    Damped& operator=(const Damped&);
#if WRONG != 4
    std::conditional_t<WRONG == 3, membrane::Vector3<double>, double> compliance(
        const membrane::VertexState<double>&) const noexcept(WRONG != 2);
#endif
};

auto solver(const membrane::MassSpringNetwork<double, membrane::LinearSpring>& network) {
    membrane::QuasiStaticSolver solver(network, {}, Damped{});
    return solver.queue().layer_count();
}
