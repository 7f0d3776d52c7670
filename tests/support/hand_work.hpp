// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/core/types.hpp>
#include <membrane/core/vector3.hpp>

/// The work of a hand that displaces vertices, for the balance of energies.
///
///     const auto work = test::hand_work(displacement, before, halfway, alone, after);
///     given += work.smooth;
///     relaxed += energy_before_the_steps - energy_after_them - work.excess();
namespace test {

/// Of one displacement. The vertices move first, then steps move the membrane to its equilibrium and take energy. The
/// excess of the work is not energy that a jump of the membrane releases: it vanishes with the displacement.
struct HandWork {
    double smooth = 0;  ///< if the membrane follows all the time: trapezoidal rule [J]
    double alone = 0;   ///< if it follows only after the displacement: Simpson's rule [J]

    [[nodiscard]] double excess() const { return alone - smooth; }
};

/// Forces of the hand [N]: at the equilibrium before, where the vertices have moved by half of the displacement alone
/// and by all of it, and at the equilibrium after.
template <membrane::Real Scalar>
[[nodiscard]] HandWork hand_work(const membrane::Vector3<Scalar>& displacement, const membrane::Vector3<Scalar>& before,
                                 const membrane::Vector3<Scalar>& halfway, const membrane::Vector3<Scalar>& alone,
                                 const membrane::Vector3<Scalar>& after) {
    const auto along = [&](const membrane::Vector3<Scalar>& force) {
        return static_cast<double>(dot<Scalar>(force, displacement));
    };
    return {(along(before) + along(after)) / 2, (along(before) + 4 * along(halfway) + along(alone)) / 6};
}

}  // namespace test
