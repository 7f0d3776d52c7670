// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <vector>

#include "support/rhexis.hpp"

/// What a capsulorhexis has opened.
namespace examples {

/// The opening, once the tear has met its beginning.
struct Opening {
    std::vector<bool> inside;  ///< for each triangle: it has come off
    double circularity = 0;    ///< 4 pi area / perimeter^2 at rest, seen along the axis; 0: it is not closed
};

/// The triangles that are not joined to `scene.pinned`, and the border that they leave.
[[nodiscard]] inline Opening opening_of(const RhexisScene& scene, const membrane::TornSurface<double>& surface) {
    using membrane::Index;
    const auto at = [](Index f) { return static_cast<std::size_t>(f); };
    const auto& adjacency = surface.adjacency();
    const membrane::TriangleAdjacency before(scene.mesh);
    Opening opening{std::vector<bool>(at(scene.mesh.triangle_count()), true)};
    std::vector<Index> left;
    for (const Index v : scene.pinned) {
        for (const Index f : adjacency.triangles_of(v)) left.push_back(f);
    }
    double area = 0, length = 0;
    while (!left.empty()) {
        const Index f = left.back();
        left.pop_back();
        if (!opening.inside[at(f)]) continue;
        opening.inside[at(f)] = false;
        const auto corners = surface.corners_at(surface.rest_positions(), f);
        for (std::size_t k = 0; k < 3; ++k) {
            const Index across = adjacency.triangle_neighbours(f)[k];
            if (across != membrane::no_index) left.push_back(across);
            if (across != membrane::no_index || before.triangle_neighbours(f)[k] == membrane::no_index) continue;
            const Vector from = corners[k] - scene.middle, to = corners[(k + 1) % 3] - scene.middle;
            area -= scene.axis.dot(from.cross(to)) / 2;
            length += scene.axis.cross(to - from).norm();
        }
    }
    const bool closed = std::find(opening.inside.begin(), opening.inside.end(), true) != opening.inside.end();
    if (closed) opening.circularity = 4 * std::numbers::pi * area / (length * length);
    return opening;
}

}  // namespace examples
