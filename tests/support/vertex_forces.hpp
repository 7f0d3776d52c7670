// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>

#include <membrane/coarse/element_forces.hpp>

#include "support/catch.hpp"

/// The forces of all elements at once, beside those on each vertex.
namespace test {

/// Positions as `ElementForces` take them.
template <membrane::Real S>
typename membrane::ElementForces<S>::Rows rows_of(const membrane::Points<S>& x) {
    typename membrane::ElementForces<S>::Rows rows(static_cast<std::size_t>(x.cols()) + 1);
    for (membrane::Index v = 0; v < x.cols(); ++v) rows[static_cast<std::size_t>(v)].set(membrane::point(x, v));
    return rows;
}

/// The forces on the vertices of a membrane on a foundation at rest.
template <membrane::Real S, class Network, class Volume>
membrane::Points<S> forces_at(const membrane::Points<S>& x, const Network& network, const Volume& foundation) {
    membrane::Points<S> forces(3, x.cols());
    for (membrane::Index v = 0; v < x.cols(); ++v) {
        const membrane::Vector3<S> here = membrane::point(x, v);
        forces.col(v) = network.force_on(v, x).force + foundation.force_on(v, here, here, S(1e-3)).force;
    }
    return forces;
}

/// All kinds of elements have these forces; `tolerance` is in parts of the largest.
template <membrane::Real S, class Kinds, class Network, class Volume>
void check_forces(const Kinds& kinds, const membrane::Points<S>& x, const Network& network, const Volume& foundation,
                  S tolerance) {
    const auto rows = rows_of<S>(x);
    typename membrane::ElementForces<S>::Rows forces(rows.size());
    for (const auto& kind : kinds) kind->add_forces(rows, forces);
    const membrane::Points<S> expected = forces_at<S>(x, network, foundation);
    S worst = 0;
    for (membrane::Index v = 0; v < x.cols(); ++v) {
        const auto found = forces[static_cast<std::size_t>(v)].point();
        worst = (std::max)(worst, norm<S>(membrane::point(expected, v) - found));
    }
    CHECK(worst <= tolerance * expected.colwise().norm().maxCoeff());
}

}  // namespace test
