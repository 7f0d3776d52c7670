// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

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
    std::array<Index, 6> path{};  // allocates nothing
    std::size_t count = 0;
    Index f = random.index(static_cast<Index>(surface.triangles().cols()));
    path[count++] = surface.corners(f)[static_cast<std::size_t>(random.index(3))];
    const auto length = static_cast<std::size_t>(2 + random.index(4));
    for (Index n = 0; n < 20 && count < length; ++n) {
        const Index last = path[count - 1];
        const auto around = surface.adjacency().triangles_of(last);
        f = around[static_cast<std::size_t>(random.index(static_cast<Index>(around.size())))];
        const Index next = surface.corners(f)[static_cast<std::size_t>(random.index(3))];
        const auto end = path.begin() + static_cast<std::ptrdiff_t>(count);
        if (std::find(path.begin(), end, next) != end || !surface.has_inner_edge(last, next)) continue;
        path[count++] = next;
        if (surface.adjacency().on_border(next)) break;
    }
    return tear.cut_along(std::span(path).first(count), x);
}

}  // namespace test
