// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>

/// The usual way to move masses and springs, against which the quasi-static solver is measured.
///
///     auto euler = membrane::ExplicitEuler(network);
///     auto v = membrane::Points<double>::Zero(3, network.vertex_count()).eval();
///     const bool finite = euler.step(x, v, dt, network, foundation);
namespace membrane {

/// Explicit Euler, [Liu07] (2) and (3): all vertices at once, the velocity by the force, then the position by the *new*
/// velocity. It is stable for dt sqrt(largest eigenvalue of M^-1 H) < 2 at the most, H the stiffness of all springs.
/// Positions and velocities are the caller's; the forces within a step are the one thing it keeps.
template <Real Scalar>
class ExplicitEuler {
  public:
    /// @throws InvalidInput for a network without masses
    template <ElasticNetwork<Scalar> Network>
    explicit ExplicitEuler(const Network& network)
        : force_(Points<Scalar>::Zero(3, network.vertex_count())), previous_(force_), previous_velocity_(force_) {
        if (!network.has_masses()) refuse("ExplicitEuler", "the network must have masses [kg]");
    }

    /// One step of `dt` [s] under the springs, the viscosity and the foundation. `x` [m] and `velocity` [m/s] are 3 x V;
    /// pinned vertices stay. False, with both as they were, where the result would not be finite or dt is not positive.
    /// Online. Cost: all springs.
    template <ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume>
    [[nodiscard]] bool step(PointsRef<Scalar> x, PointsRef<Scalar> velocity, Scalar dt, const Network& network,
                            const Volume& volume) noexcept {
        force_.setZero();
        return advance(x, velocity, dt, network, volume);
    }

    /// The same with an external force on each vertex, F^ext of (1), 3 x V [N].
    template <ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume>
    [[nodiscard]] bool step(PointsRef<Scalar> x, PointsRef<Scalar> velocity, Scalar dt, const Network& network,
                            const Volume& volume, const ConstPointsRef<Scalar>& external) noexcept {
        force_ = external;
        return advance(x, velocity, dt, network, volume);
    }

    /// Largest unbalanced force on a vertex in the last step, viscosity left out [N].
    [[nodiscard]] Scalar residual() const noexcept { return residual_; }

  private:
    template <class Network, class Volume>
    bool advance(PointsRef<Scalar>& x, PointsRef<Scalar>& velocity, Scalar dt, const Network& network,
                 const Volume& volume) noexcept;

    Points<Scalar> force_, previous_, previous_velocity_;
    Scalar residual_ = 0;
};

template <class Network>
ExplicitEuler(const Network&) -> ExplicitEuler<typename Network::Scalar>;

template <Real Scalar>
template <class Network, class Volume>
bool ExplicitEuler<Scalar>::advance(PointsRef<Scalar>& x, PointsRef<Scalar>& velocity, Scalar dt,
                                    const Network& network, const Volume& volume) noexcept {
    MEMBRANE_ASSERT(x.cols() == network.vertex_count() && velocity.cols() == network.vertex_count());
    if (!is_finite(dt) || !(dt > 0)) return false;
    previous_ = x;
    previous_velocity_ = velocity;
    const ConstPointsRef<Scalar> here(x);
    for (Index v = 0; v < network.vertex_count(); ++v) {
        // The foundation is damped by the vertex's velocity: over a tick it would have come from here.
        const Vector3<Scalar> start = point(x, v) - dt * point(velocity, v);
        force_.col(v) += network.force_on(v, here).force + volume.force_on(v, point(x, v), start, dt).force;
    }
    residual_ = 0;
    for (Index v = 0; v < network.vertex_count(); ++v) {
        if (network.pinned(v)) continue;
        residual_ = (std::max)(residual_, norm(point(force_, v)));
        velocity.col(v) += (dt / network.mass(v)) * (force_.col(v) - network.viscosity(v) * velocity.col(v));
        x.col(v) += dt * velocity.col(v);
    }
    if (is_finite(x) && is_finite(velocity)) return true;
    x = previous_;
    velocity = previous_velocity_;
    return false;
}

}  // namespace membrane
