// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <vector>

#include <membrane/tear/tearing.hpp>

#include "support/random.hpp"

/// Cuts along random paths.
///
///     for (const auto& event : test::cut_at_random(random, tear, x)) follow(event, tissue);
namespace test {

/// Cuts along a random walk over inner edges. No event if that is no path for a cut.
template <membrane::Real Scalar>
typename membrane::Tearing<Scalar>::Events cut_at_random(Random& random, membrane::Tearing<Scalar>& tear,
                                                         membrane::Points<Scalar>& x) {
    using membrane::Index;
    const auto& surface = tear.surface();
    std::vector<Index> path;
    Index f = random.index(static_cast<Index>(surface.triangles().cols()));
    path.push_back(surface.corners(f)[static_cast<std::size_t>(random.index(3))]);
    const Index length = 2 + random.index(4);
    for (Index n = 0; n < 20 && static_cast<Index>(path.size()) < length; ++n) {
        const auto around = surface.adjacency().triangles_of(path.back());
        f = around[static_cast<std::size_t>(random.index(static_cast<Index>(around.size())))];
        const Index next = surface.corners(f)[static_cast<std::size_t>(random.index(3))];
        const bool is_new = std::find(path.begin(), path.end(), next) == path.end();
        if (!is_new || !surface.has_inner_edge(path.back(), next)) continue;
        path.push_back(next);
        if (surface.adjacency().on_border(next)) break;
    }
    return tear.cut_along(path, x);
}

}  // namespace test
