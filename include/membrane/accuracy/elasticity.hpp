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

/// Springs and foundation where the membrane is.
struct ElasticState {
    Points<double> x;  ///< 3 x V [m]
    Points<double> springs,
        foundation;            ///< force on each vertex, by springs and elements and by the foundation, 3 x V [N]
    double energy = 0;         ///< of springs and elements [J]
    double largest_force = 0;  ///< of a single spring, or on a vertex by an element or the foundation [N]
};

/// A membrane without time, in double whatever its scalar: its springs by their law, its elements, if it is a `Tissue`, its
/// foundation as it pulls in a tick without end, in which no damping is left. A linear foundation that says its anchors and, in
/// double, its `curvature` is evaluated by these; any other one in its own scalar.
///
///     Elasticity elasticity(network, volume);
///     const auto state = elasticity.at(x);                    // state.springs + state.foundation [N]
///     elasticity.add_stiffness(state, system);
template <class Network, class Volume>
class Elasticity {
  public:
    using Scalar = typename Network::Scalar;

    /// Keeps a reference to both.
    Elasticity(const Network& network, const Volume& volume) : network_(network), volume_(volume) {}

    /// O(V + springs + elements).
    [[nodiscard]] ElasticState at(const Points<double>& x);

    /// Adds the second derivative of the energy to H, exact for springs and for a foundation that is linear: alike in all
    /// directions, or as its `curvature(v)` says. Else as much as the foundation says its curvature is at the most.
    void add_stiffness(const ElasticState& state, NewtonSystem& system) const;

    /// How much more energy `b` holds than `a` [J]; of the foundation by the trapezium rule, exact where it is linear.
    [[nodiscard]] double energy_change(const ElasticState& a, const ElasticState& b) const {
        return (b.energy - a.energy) - (a.foundation + b.foundation).cwiseProduct(b.x - a.x).sum() / 2;
    }

    /// The largest of the springs' stiffnesses, and the foundation's [N/m].
    [[nodiscard]] double largest_stiffness(const ElasticState& state) const;

  private:
    static constexpr bool is_linear = requires(const Volume& volume, Index v) {
        volume.anchors();
        volume.template curvature<double>(v);
    };
    /// Calls `act(placed, corners)` for each spring and each element.
    template <class Act>
    void for_each_element(const Points<double>& x, Act act) const {
        network_.for_each_element([&](const auto& placed) { act(placed, placed.where(x)); });
    }
    /// What the foundation does to a vertex near `place`: its force changes by `stiffness` times the way from there.
    struct LinearPull {
        Vector3<double> place, force;  // [m], [N]
        Symmetric3<double> stiffness;  // [N/m]
    };
    void pull_back(ElasticState& state);
    void ask_backing(const Points<double>& x);
    [[nodiscard]] Symmetric3<double> curvature(Index v, Scalar most) const noexcept;

    const Network& network_;
    const Volume& volume_;
    std::vector<LinearPull> backing_;  // of each vertex, where it was asked last
};

template <class Network, class Volume>
ElasticState Elasticity<Network, Volume>::at(const Points<double>& x) {
    ElasticState state{x, Points<double>::Zero(3, x.cols()), Points<double>::Zero(3, x.cols())};
    for_each_element(x, [&](const auto& placed, const auto& corners) {
        state.energy += placed.element.energy(corners);
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const Vector3<double> force = placed.element.force_on(corners, i).force;
            state.springs.col(placed.corners[i]) += force;
            state.largest_force = (std::max)(state.largest_force, norm(force));
        }
    });
    pull_back(state);
    return state;
}

template <class Network, class Volume>
void Elasticity<Network, Volume>::pull_back(ElasticState& state) {
    if (!is_linear || backing_.empty()) ask_backing(state.x);
    for (Index v = 0; v < state.x.cols(); ++v) {
        const auto& pull = backing_[static_cast<std::size_t>(v)];
        const Vector3<double> displacement = point(state.x, v) - pull.place;
        const Vector3<double> force = pull.force - pull.stiffness * displacement;
        state.foundation.col(v) = force;
        state.largest_force = (std::max)(state.largest_force, norm(force));
    }
}

// One that is linear is known from its anchors. Where a float is asked anew its rounding changes the answer: it is not, as
// long as x hardly moves.
template <class Network, class Volume>
void Elasticity<Network, Volume>::ask_backing(const Points<double>& x) {
    const bool first = backing_.empty();
    backing_.resize(static_cast<std::size_t>(x.cols()));
    [[maybe_unused]] const double spacing =
        static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * x.cwiseAbs().maxCoeff();
    for (Index v = 0; v < x.cols(); ++v) {
        auto& pull = backing_[static_cast<std::size_t>(v)];
        if constexpr (is_linear) {
            const Vector3<double> anchor = point(volume_.anchors(), v).template cast<double>();
            pull = {anchor, Vector3<double>::Zero(), volume_.template curvature<double>(v)};
        } else {
            const Vector3<double> here = point(x, v);
            if (!first && norm<double>(here - pull.place) <= 64 * spacing) continue;
            const Vector3<Scalar> place = here.template cast<Scalar>();
            const auto answer = volume_.force_on(v, place, place, std::numeric_limits<Scalar>::infinity());
            pull = {place.template cast<double>(), answer.force.template cast<double>(),
                    curvature(v, answer.stiffness)};
        }
    }
}

template <class Network, class Volume>
Symmetric3<double> Elasticity<Network, Volume>::curvature(Index v, Scalar most) const noexcept {
    if constexpr (requires { volume_.curvature(v); }) {
        const Symmetric3<Scalar> k = volume_.curvature(v);
        return {k.xx, k.yy, k.zz, k.xy, k.xz, k.yz};
    }
    return diagonal3<double>(most);
}

template <class Network, class Volume>
void Elasticity<Network, Volume>::add_stiffness(const ElasticState& state, NewtonSystem& system) const {
    for_each_element(state.x, [&](const auto& placed, const auto& corners) {
        for (std::size_t i = 0; i < corners.size(); ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                system.add(placed.corners[i], placed.corners[j], placed.element.hessian_block(corners, i, j));
            }
        }
    });
    for (Index v = 0; v < state.x.cols(); ++v) {
        system.add(v, v, dense(backing_[static_cast<std::size_t>(v)].stiffness));
    }
}

template <class Network, class Volume>
double Elasticity<Network, Volume>::largest_stiffness(const ElasticState& state) const {
    double largest = 0;
    for_each_element(state.x, [&](const auto& placed, const auto& corners) {
        for (std::size_t i = 0; i < corners.size(); ++i) {
            largest = (std::max)(largest, largest_eigenvalue(placed.element.force_on(corners, i).curvature));
        }
    });
    for (const auto& pull : backing_) largest = (std::max)(largest, largest_eigenvalue(pull.stiffness));
    return largest;
}

}  // namespace membrane
