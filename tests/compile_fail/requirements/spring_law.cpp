// SPDX-License-Identifier: MIT
// wrong: SpringLaw: must be copyable
// wrong: SpringLaw: law(const SpringState<Scalar>&) const noexcept must return SpringResponse<Scalar>
// wrong: SpringLaw: law(const SpringState<Scalar>&) const noexcept must return SpringResponse<Scalar>
#include <type_traits>

#include <membrane/model/mass_spring_network.hpp>

struct Cubic {
    Cubic();
    Cubic(const Cubic&)
#if WRONG == 1
        = delete
#endif
        ;
    Cubic& operator=(const Cubic&);
    template <membrane::Real Scalar>
    std::conditional_t<WRONG == 3, Scalar, membrane::SpringResponse<Scalar>> operator()(
        const membrane::SpringState<Scalar>&) const noexcept(WRONG != 2);
};

void network(const membrane::TriangleMesh<double>& mesh) {
    const membrane::MassSpringNetwork network(mesh, Cubic{}, {.stiffness = 40.0});
    static_cast<void>(network);
}
