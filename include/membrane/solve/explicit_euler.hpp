// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>

/// Explicit time integration of masses and springs, the reference for the quasi-static solver.
///
///     auto euler = membrane::ExplicitEuler(network);
///     auto v = membrane::Points<double>::Zero(3, network.vertex_count()).eval();
///     const bool finite = euler.step(x, v, dt, network, foundation);
namespace membrane {

/// Explicit Euler, [Liu07] (2) and (3): all vertices at once, the velocity by the force, then the position by the *new*
/// velocity. It is stable at most for dt sqrt(largest eigenvalue of M^-1 H) < 2, H the stiffness of all springs.
/// The caller owns positions and velocities; this keeps only the forces of a step.
template <Real Scalar>
class ExplicitEuler {
  public:
    /// @throws InvalidInput for a network without masses
    template <ElasticNetwork<Scalar> Network>
    explicit ExplicitEuler(const Network& network)
        : force_(Points<Scalar>::Zero(3, network.vertex_count())), previous_(force_), previous_velocity_(force_) {
        if (!network.has_masses()) refuse("ExplicitEuler", "the network must have masses [kg]");
    }

    /// One step of `dt` [s] under the springs, the viscosity and the foundation. `x` [m] and `velocity` [m/s] are 3 x
    /// V; pinned vertices stay. If the result is not finite, dt is not positive or V is not that of the network at
    /// construction, returns false with both unchanged.
    /// Online. Cost: all springs.
    template <ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume>
    [[nodiscard]] bool step(PointsRef<Scalar> x, PointsRef<Scalar> velocity, Scalar dt, const Network& network,
                            const Volume& volume) noexcept {
        force_.setZero();
        return advance(x, velocity, dt, network, volume);
    }

    /// One step with an external force on each vertex, F^ext of (1), 3 x V [N].
    template <ElasticNetwork<Scalar> Network, FoundationModel<Scalar> Volume>
    [[nodiscard]] bool step(PointsRef<Scalar> x, PointsRef<Scalar> velocity, Scalar dt, const Network& network,
                            const Volume& volume, const ConstPointsRef<Scalar>& external) noexcept {
        if (external.cols() != force_.cols()) return false;
        force_ = external;
        return advance(x, velocity, dt, network, volume);
    }

    /// Largest residual force on a vertex in the last step, without viscosity [N].
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
    const Eigen::Index count = force_.cols();
    if (x.cols() != count || velocity.cols() != count || network.vertex_count() != count) return false;
    if (!has_vertices(volume, count)) return false;
    if (!is_finite(dt) || !(dt > 0)) return false;
    previous_ = x;
    previous_velocity_ = velocity;
    const ConstPointsRef<Scalar> here(x);
    for (Index v = 0; v < network.vertex_count(); ++v) {
        // The velocity of the vertex damps the foundation: it gives the position at the start of the tick.
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
