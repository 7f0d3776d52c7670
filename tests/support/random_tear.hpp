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

/// Splits a vertex of `surface` where an edge, or two, can open, and those at the ends of these on a border; or moves
/// one in the plane, if `moves`. There may be no event.
template <membrane::Real Scalar>
void change_at_random(Random& random, membrane::TornSurface<Scalar>& surface, membrane::Points<Scalar>& positions,
                      bool moves) {
    using membrane::Index, membrane::Vector3, membrane::no_index;
    membrane::PointsRef<Scalar> x = positions;
    surface.begin();
    const auto& adjacency = surface.adjacency();
    const Index v = surface.corners(
        random.index(static_cast<Index>(surface.triangles().cols())))[static_cast<std::size_t>(random.index(3))];
    if (moves && random.chance(0.5)) {
        if (adjacency.on_border(v)) return;
        const Scalar far = surface.mean_edge(v) / 3;
        const auto by = random.template vector<Scalar>(-far, far);
        surface.move_vertex(x, v, membrane::point(surface.rest_positions(), v) + Vector3<Scalar>(by[0], by[1], 0),
                            Scalar(0.3));
        return;
    }
    std::array<Index, 2> ends{no_index, no_index};
    for (Index& end : ends) {
        const auto around = adjacency.triangles_of(v);
        const Index f = around[static_cast<std::size_t>(random.index(static_cast<Index>(around.size())))];
        const Index w = surface.corners(f)[static_cast<std::size_t>(random.index(3))];
        if (w != v && surface.has_inner_edge(v, w)) end = w;
    }
    if (adjacency.on_border(v)) ends[1] = no_index;
    if (ends[0] == no_index || ends[0] == ends[1] || surface.reserve() < 3) return;
    if (!adjacency.on_border(v) && ends[1] == no_index) return;
    const bool parts_first = adjacency.on_border(ends[0]);
    const bool parts_second = ends[1] != no_index && adjacency.on_border(ends[1]);
    const Index copy = surface.split(x, v, ends[0], ends[1]);
    if (copy == no_index) return;
    if (parts_first) surface.split(x, ends[0], v);
    if (parts_second) surface.split(x, ends[1], copy);
}

}  // namespace test
