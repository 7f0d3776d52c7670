// SPDX-License-Identifier: MIT
// A bound for a foundation that may not be linear.
// expect: LinearFoundation
#include <membrane/certify/error_bound.hpp>

struct Tether {
    template <membrane::Real Scalar>
    membrane::VertexForce<Scalar> force_on(membrane::Index, const membrane::Vector3<Scalar>& position,
                                           const membrane::Vector3<Scalar>&, Scalar) const noexcept {
        return {-membrane::norm(position) * position, 2 * membrane::norm(position)};
    }
};
static_assert(membrane::FoundationModel<Tether, double>);
#ifdef CORRECT
using Backing = membrane::NoFoundation;
#else
using Backing = Tether;
#endif

auto error(membrane::ErrorBound<>& bound, const membrane::Points<double>& x,
           const membrane::MassSpringNetwork<double, membrane::LinearSpring>& network) {
    return bound.compute(x, network, Backing{});
}
