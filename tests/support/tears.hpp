// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include <membrane/surface/vertex_split.hpp>

#include "support/meshes.hpp"
#include "support/random.hpp"

/// Surfaces that tear at random.
///
///     test::TearingSurface surface(test::random_surface<double>(random), 40);      // 40 vertices to double others
///     auto tree = membrane::AabbTree(surface.mesh());
///     while (surface.tear(random, [&](const auto& split) { tree.split(split); })) {
///         const auto expected = membrane::AabbTree(surface.mesh());
namespace test {

template <membrane::Real Scalar>
class TearingSurface {
  public:
    using Index = membrane::Index;

    TearingSurface(const Surface<Scalar>& whole, Index reserve) : now_(whole), next_copy_(whole.vertex_count()) {
        for (Index n = 0; n < reserve; ++n) now_.add(membrane::point(whole.x, 0));
    }

    /// At rest, as it is torn by now.
    membrane::TriangleMesh<Scalar> mesh() const { return now_.mesh(); }
    const membrane::Triangles& triangles() const { return now_.triangles; }

    /// The present number of vertices with triangles: all but the last ones.
    Index used() const { return next_copy_; }

    /// Doubles a vertex, with any part of the triangles around it that are next to each other; then those that have two
    /// fans of triangles by then. Calls `follow(split)` after each. False if there might be too few vertices left.
    template <class Follow>
    bool tear(Random& random, Follow follow) {
        constexpr Index most = 4;
        if (now_.vertex_count() - next_copy_ < most) return false;
        std::vector<Index> fan;
        Index v = 0;
        for (int tries = 0; fan.size() < 2; ++tries) {
            if (tries == 1000) return false;
            v = random.index(next_copy_);
            fan = fans_of(v)[0];
        }
        const auto size = static_cast<Index>(fan.size());
        std::rotate(fan.begin(), fan.begin() + (is_closed(v, fan) ? random.index(size) : 0), fan.end());
        const Index first = random.index(size), count = 1 + random.index(std::min(size - 1, size - first));
        split(v, {fan.begin() + first, fan.begin() + first + count}, follow);
        for (Index w = 0; w < next_copy_; ++w) {
            for (auto fans = fans_of(w); fans.size() > 1; fans = fans_of(w)) {
                split(w, fans[static_cast<std::size_t>(random.index(static_cast<Index>(fans.size())))], follow);
            }
        }
        return true;
    }

  private:
    // The two other corners of triangle f, counter-clockwise from `v`.
    std::array<Index, 2> others(Index f, Index v) const {
        const auto corners = now_.triangles.col(f);
        const Index k = corners[0] == v ? 0 : corners[1] == v ? 1 : 2;
        return {corners[(k + 1) % 3], corners[(k + 2) % 3]};
    }
    bool is_closed(Index v, const std::vector<Index>& fan) const {
        return others(fan.front(), v)[0] == others(fan.back(), v)[1];
    }

    // The triangles around `v`, each set that sides connect in order.
    std::vector<std::vector<Index>> fans_of(Index v) const {
        std::vector<Index> left;
        for (Index f = 0; f < now_.triangle_count(); ++f) {
            const auto corners = now_.triangles.col(f);
            if (std::find(corners.begin(), corners.end(), v) != corners.end()) left.push_back(f);
        }
        std::vector<std::vector<Index>> fans;
        while (!left.empty()) {
            const auto is_first = [&](Index f) {
                return std::none_of(left.begin(), left.end(),
                                    [&](Index g) { return others(g, v)[1] == others(f, v)[0]; });
            };
            auto next = std::find_if(left.begin(), left.end(), is_first);
            if (next == left.end()) next = left.begin();
            std::vector<Index> fan;
            while (next != left.end()) {
                fan.push_back(*next);
                left.erase(next);
                next = std::find_if(left.begin(), left.end(),
                                    [&](Index f) { return others(f, v)[0] == others(fan.back(), v)[1]; });
            }
            fans.push_back(fan);
        }
        return fans.empty() ? std::vector<std::vector<Index>>(1) : fans;
    }

    template <class Follow>
    void split(Index v, const std::vector<Index>& goes, Follow& follow) {
        std::vector<std::array<Index, 3>> corners;
        for (const Index f : goes) {
            const auto of = now_.triangles.col(f);
            corners.push_back({of[0], of[1], of[2]});
        }
        const membrane::VertexSplit split{v, next_copy_++, goes, corners, 0.5};
        for (const Index f : goes) {
            for (Index& corner : now_.triangles.col(f)) corner = corner == v ? split.copy : corner;
        }
        now_.x.col(split.copy) = now_.x.col(v);
        follow(split);
    }

    Surface<Scalar> now_;
    Index next_copy_;
};

}  // namespace test
