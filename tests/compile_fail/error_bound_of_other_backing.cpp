// SPDX-License-Identifier: MIT
// A bound for a backing that may not be linear.
// expect: LinearBacking
#include <membrane/accuracy/error_bound.hpp>

struct Tether {
    template <membrane::Real Scalar>
    membrane::Pull<Scalar> pull(membrane::Index, const membrane::Vector3<Scalar>& position,
                                const membrane::Vector3<Scalar>&, Scalar) const noexcept {
        return {-membrane::norm(position) * position, 2 * membrane::norm(position)};
    }
};
static_assert(membrane::VolumeModel<Tether, double>);
#ifdef CORRECT
using Backing = membrane::NoVolumeSprings;
#else
using Backing = Tether;
#endif

auto error(membrane::ErrorBound<>& bound, const membrane::Points<double>& x,
           const membrane::MassSpringNetwork<double, membrane::LinearSpring>& network) {
    return bound.of(x, network, Backing{});
}
