// SPDX-License-Identifier: MIT
// A force policy that gives the size of the force and not its direction.
// expect: ForcePolicy
// expect: (return-type-requirement|type constraint)
#include <membrane/haptics/force_policy.hpp>

struct Stiff {
#ifdef CORRECT
    membrane::Vector3<double> operator()(const membrane::HapticState<double>& state) const noexcept {
        return 100 * state.contact.depth * state.contact.normal;
    }
#else
    double operator()(const membrane::HapticState<double>& state) const noexcept { return 100 * state.contact.depth; }
#endif
};

static_assert(membrane::ForcePolicy<Stiff, double>);
