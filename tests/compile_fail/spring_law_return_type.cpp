// SPDX-License-Identifier: MIT
// A law that returns the tension alone.
// expect: SpringLaw<.*Cubic
// expect: (return-type-requirement|type constraint)
#include <membrane/model/mass_spring_network.hpp>

struct Cubic {
    template <membrane::Real Scalar>
    auto operator()(const membrane::SpringState<Scalar>& spring) const noexcept {
        const Scalar elongation = spring.length - spring.rest_length;
        const Scalar tension = spring.stiffness * elongation;
#ifdef CORRECT
        return membrane::SpringResponse<Scalar>{tension, spring.stiffness, tension * elongation / 2};
#else
        return tension;
#endif
    }
};

auto network(const membrane::TriangleMesh<double>& mesh) {
    return membrane::MassSpringNetwork<double, Cubic>(mesh, Cubic{}, {.stiffness = 40.0});
}
