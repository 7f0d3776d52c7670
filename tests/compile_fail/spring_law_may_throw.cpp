// SPDX-License-Identifier: MIT
// A law that is not noexcept, though it is called online.
// expect: SpringLaw<.*Cubic
// expect: (may throw|is not .*noexcept)
#include <membrane/model/mass_spring_network.hpp>

struct Cubic {
    template <membrane::Real Scalar>
    membrane::SpringResponse<Scalar> operator()(const membrane::SpringState<Scalar>& spring) const
#ifdef CORRECT
        noexcept
#endif
    {
        return membrane::LinearSpring{}(spring);
    }
};

auto network(const membrane::TriangleMesh<double>& mesh) {
    return membrane::MassSpringNetwork<double, Cubic>(mesh, Cubic{}, {.stiffness = 40.0});
}
