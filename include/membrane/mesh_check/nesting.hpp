// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include <membrane/core/compressed_rows.hpp>
#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/surface/triangle.hpp>

/// Closed components inside others.
///
///     const bool all = for_each_nested(x, triangles, parts, effort,
///                                      [&](membrane::Index outer, membrane::Index inner) { ... });
namespace membrane {

/// Winding number of the triangles `some` about the point `q`: 1 inside a closed surface, -1 if it faces inward, 0
/// outside [Oosterom83].
[[nodiscard]] inline double winding_number(const Points<double>& x, const Triangles& triangles,
                                           std::span<const Index> some, const Vector3<double>& q) noexcept;

/// Calls `visit(outer, inner)` for each pair of closed components of which one is inside the other; they must not
/// intersect. Each pair and each triangle tested subtracts 1 from `effort`. If `effort` falls below 0, the search stops
/// and returns false; if it completes, returns true.
template <class Visit>
[[nodiscard]] bool for_each_nested(const Points<double>& x, const Triangles& triangles, const SurfaceParts& parts,
                                   std::int64_t& effort, Visit visit);

inline double winding_number(const Points<double>& x, const Triangles& triangles, std::span<const Index> some,
                             const Vector3<double>& q) noexcept {
    double half_angles = 0;
    for (const Index f : some) {
        const auto t = triangle_at(x, triangles.col(f));
        const Vector3<double> a = t.a - q, b = t.b - q, c = t.c - q;
        const double product = norm(a) * norm(b) * norm(c);
        half_angles += std::atan2(dot<double>(a, cross(b, c)),
                                  product + dot(a, b) * norm(c) + dot(b, c) * norm(a) + dot(c, a) * norm(b));
    }
    return half_angles / (2 * std::numbers::pi);
}

template <class Visit>
bool for_each_nested(const Points<double>& x, const Triangles& triangles, const SurfaceParts& parts,
                     std::int64_t& effort, Visit visit) {
    const auto part = [&](Index p) -> const SurfaceComponent& { return parts.parts[static_cast<std::size_t>(p)]; };
    std::vector<Index> closed;
    for (Index p = 0; p < static_cast<Index>(parts.parts.size()); ++p) {
        if (part(p).closed) closed.push_back(p);
    }
    if (closed.size() < 2) return true;
    const auto low = [&](Index p) { return part(p).extent.low[0]; };
    const auto high = [&](Index p) { return part(p).extent.high[0]; };
    std::sort(closed.begin(), closed.end(),
              [&](Index p, Index q) { return low(p) != low(q) ? low(p) < low(q) : high(p) > high(q); });
    const CompressedRows<Index> triangles_of(static_cast<Index>(parts.parts.size()), [&](auto put) {
        for (std::size_t f = 0; f < parts.part_of.size(); ++f) {
            if (parts.part_of[f] != no_index) put(parts.part_of[f], static_cast<Index>(f));
        }
    });
    for (std::size_t i = 0; i < closed.size(); ++i) {
        const SurfaceComponent& outer = part(closed[i]);
        for (std::size_t j = i + 1; j < closed.size() && low(closed[j]) <= outer.extent.high[0]; ++j) {
            if (--effort < 0) return false;
            const SurfaceComponent& inner = part(closed[j]);
            if (!contains(outer.extent, inner.extent)) continue;
            effort -= outer.triangle_count;
            const auto q = point(x, triangles(0, inner.first_triangle));
            // The winding number is 1/2 if the components touch at q.
            if (std::abs(winding_number(x, triangles, triangles_of[closed[i]], q)) > 0.75) visit(closed[i], closed[j]);
        }
    }
    return true;
}

}  // namespace membrane
