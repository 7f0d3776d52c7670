// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <membrane/membrane.hpp>

namespace bench {

/// A suction cup: the vertices under its mouth share a force along its axis. An example of a user's constraint.
///
///     const auto report = solver.step(x, dt, network, foundation, Suction<double>{under, mouth, force});
template <membrane::Real Scalar>
struct Suction {
    std::span<const membrane::Index> vertices;  ///< under the mouth; the caller owns them
    membrane::Vector3<Scalar> mouth;            ///< its centre [m]
    membrane::Vector3<Scalar> force;            ///< the sum over all vertices [N]

    [[nodiscard]] bool valid() const noexcept { return membrane::is_finite(mouth) && membrane::is_finite(force); }
    [[nodiscard]] membrane::DrivingInput<Scalar> driving_input() const noexcept {
        return vertices.empty() ? membrane::DrivingInput<Scalar>() : membrane::InputSample<Scalar>{mouth};
    }
    void begin(membrane::ConstraintContext<Scalar>& context) const noexcept {
        for (const membrane::Index v : vertices) {
            if (!context.validate(v)) return;
            context.seed(v);
            context.add_force(v, force / static_cast<Scalar>(vertices.size()));
        }
    }
    bool enforce(membrane::ConstraintContext<Scalar>&) const noexcept { return false; }
    [[nodiscard]] membrane::Vector3<Scalar> reaction(const membrane::ConstraintContext<Scalar>&) const noexcept {
        return vertices.empty() ? membrane::Vector3<Scalar>(membrane::Vector3<Scalar>::Zero())
                                : membrane::Vector3<Scalar>(-force);
    }
};
static_assert(membrane::Constraint<Suction<double>, double>);

}  // namespace bench
