// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <membrane/accuracy/newton_system.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>

namespace membrane {

/// Forces and energy of springs and foundation at one state.
struct ElasticState {
    Points<double> x;  ///< 3 x V [m]
    ///@{
    /// Force on each vertex, of springs and elements and of the foundation, 3 x V [N].
    Points<double> springs, foundation;
    ///@}
    double energy = 0;         ///< of springs and elements [J]
    double largest_force = 0;  ///< of one spring, or of an element or the foundation on a vertex [N]
};

/// Static elasticity of a membrane, in double for any scalar: springs by their law, elements if it is a `Tissue`, and
/// the foundation after an infinite tick, without damping. A linear foundation that has anchors and, in double, a
/// `hessian` is evaluated from these; any other one in its own scalar.
///
///     membrane::Elasticity elasticity(network, foundation);
///     const auto state = elasticity.at(x);                    // state.springs + state.foundation [N]
///     elasticity.add_stiffness(state, system);
template <class Network, class Volume>
class Elasticity {
  public:
    using Scalar = typename Network::Scalar;  ///< that of the network; forces are evaluated in double

    /// Keeps a reference to both.
    Elasticity(const Network& network, const Volume& volume) : network_(network), volume_(volume) {}

    /// O(V + springs + elements).
    [[nodiscard]] ElasticState at(const Points<double>& x);

    /// Adds the Hessian of the energy to H. It is exact for springs and for a linear foundation, isotropic or with
    /// `hessian(v)`; for others it uses the foundation's stiffness bound.
    void add_stiffness(const ElasticState& state, NewtonSystem& system) const;

    /// Energy of `b` minus energy of `a` [J]; of the foundation by the trapezoidal rule, exact if it is linear.
    [[nodiscard]] double energy_change(const ElasticState& a, const ElasticState& b) const {
        return (b.energy - a.energy) - (a.foundation + b.foundation).cwiseProduct(b.x - a.x).sum() / 2;
    }

    /// The largest stiffness of springs, elements and foundation [N/m].
    [[nodiscard]] double largest_stiffness(const ElasticState& state) const;

  private:
    static constexpr bool is_linear = requires(const Volume& volume, Index v) {
        volume.anchors();
        volume.template hessian<double>(v);
    };
    /// Calls `act(instance, corners)` for each spring and each element.
    template <class Act>
    void for_each_element(const Points<double>& x, Act act) const {
        network_.for_each_element([&](const auto& instance) { act(instance, instance.where(x)); });
    }
    /// Linear model of the force of the foundation on a vertex: `force` - `stiffness` times the displacement from
    /// `position`.
    struct LinearForce {
        Vector3<double> position, force;  // [m], [N]
        Symmetric3<double> stiffness;     // [N/m]
    };
    void add_foundation(ElasticState& state);
    void evaluate_foundation(const Points<double>& x);
    [[nodiscard]] Symmetric3<double> foundation_hessian(Index v, Scalar bound) const noexcept;

    const Network& network_;
    const Volume& volume_;
    std::vector<LinearForce> foundation_;  // of each vertex, at its last evaluation
};

template <class Network, class Volume>
ElasticState Elasticity<Network, Volume>::at(const Points<double>& x) {
    ElasticState state{x, Points<double>::Zero(3, x.cols()), Points<double>::Zero(3, x.cols())};
    for_each_element(x, [&](const auto& instance, const auto& corners) {
        state.energy += instance.element.energy(corners);
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const Vector3<double> force = instance.element.force_on(corners, i).force;
            state.springs.col(instance.corners[i]) += force;
            state.largest_force = (std::max)(state.largest_force, norm(force));
        }
    });
    add_foundation(state);
    return state;
}

template <class Network, class Volume>
void Elasticity<Network, Volume>::add_foundation(ElasticState& state) {
    if (!is_linear || foundation_.empty()) evaluate_foundation(state.x);
    for (Index v = 0; v < state.x.cols(); ++v) {
        const auto& linear = foundation_[static_cast<std::size_t>(v)];
        const Vector3<double> displacement = point(state.x, v) - linear.position;
        const Vector3<double> force = linear.force - linear.stiffness * displacement;
        state.foundation.col(v) = force;
        state.largest_force = (std::max)(state.largest_force, norm(force));
    }
}

// A linear foundation is evaluated from its anchors. In float a new evaluation changes the force by rounding: there is
// none while x hardly moves.
template <class Network, class Volume>
void Elasticity<Network, Volume>::evaluate_foundation(const Points<double>& x) {
    const bool first = foundation_.empty();
    foundation_.resize(static_cast<std::size_t>(x.cols()));
    [[maybe_unused]] const double spacing =
        static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * x.cwiseAbs().maxCoeff();
    for (Index v = 0; v < x.cols(); ++v) {
        auto& linear = foundation_[static_cast<std::size_t>(v)];
        if constexpr (is_linear) {
            const Vector3<double> anchor = point(volume_.anchors(), v).template cast<double>();
            linear = {anchor, Vector3<double>::Zero(), volume_.template hessian<double>(v)};
        } else {
            const Vector3<double> here = point(x, v);
            if (!first && norm<double>(here - linear.position) <= 64 * spacing) continue;
            const Vector3<Scalar> position = here.template cast<Scalar>();
            const auto response = volume_.force_on(v, position, position, std::numeric_limits<Scalar>::infinity());
            linear = {position.template cast<double>(), response.force.template cast<double>(),
                      foundation_hessian(v, response.stiffness)};
        }
    }
}

template <class Network, class Volume>
Symmetric3<double> Elasticity<Network, Volume>::foundation_hessian(Index v, Scalar bound) const noexcept {
    if constexpr (requires { volume_.hessian(v); }) {
        const Symmetric3<Scalar> k = volume_.hessian(v);
        return {k.xx, k.yy, k.zz, k.xy, k.xz, k.yz};
    }
    return diagonal3<double>(bound);
}

template <class Network, class Volume>
void Elasticity<Network, Volume>::add_stiffness(const ElasticState& state, NewtonSystem& system) const {
    for_each_element(state.x, [&](const auto& instance, const auto& corners) {
        for (std::size_t i = 0; i < corners.size(); ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                system.add(instance.corners[i], instance.corners[j], instance.element.hessian_block(corners, i, j));
            }
        }
    });
    for (Index v = 0; v < state.x.cols(); ++v) {
        system.add(v, v, dense(foundation_[static_cast<std::size_t>(v)].stiffness));
    }
}

template <class Network, class Volume>
double Elasticity<Network, Volume>::largest_stiffness(const ElasticState& state) const {
    double largest = 0;
    for_each_element(state.x, [&](const auto& instance, const auto& corners) {
        for (std::size_t i = 0; i < corners.size(); ++i) {
            largest = (std::max)(largest, largest_eigenvalue(instance.element.force_on(corners, i).hessian));
        }
    });
    for (const auto& linear : foundation_) largest = (std::max)(largest, largest_eigenvalue(linear.stiffness));
    return largest;
}

}  // namespace membrane
