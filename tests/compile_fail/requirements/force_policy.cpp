// SPDX-License-Identifier: MIT
// wrong: ForcePolicy: policy(const HapticState<Scalar>&) noexcept must return Vector3<Scalar>
// wrong: ForcePolicy: policy(const HapticState<Scalar>&) noexcept must return Vector3<Scalar>
// wrong: ForcePolicy: policy(const HapticState<Scalar>&) noexcept must return Vector3<Scalar>
#include <type_traits>

#include <membrane/haptics/force_policy.hpp>

struct Stiff {
    std::conditional_t<WRONG == 2, double, membrane::Vector3<double>> operator()(
        std::conditional_t<WRONG == 3, double, const membrane::HapticState<double>&>) const noexcept(WRONG != 1);
};

static_assert(membrane::CheckedForcePolicy<Stiff, double>);
