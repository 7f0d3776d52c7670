// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/checked_mesh.hpp>

#include <limits>
#include <vector>

#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;

TEST_CASE("what cannot be worked with is left out, and the rest keeps its numbers", "[mesh][bad]") {
    auto surface = test::surface_of(icosphere<float>({.radius = 1, .subdivisions = 1}));
    surface.triangles(1, 3) = 42;
    surface.triangles.col(8).setConstant(5);
    surface.x(2, 7) = std::numeric_limits<float>::quiet_NaN();
    std::vector<MeshDefect> found;
    const auto mesh = detail::workable(surface.x, surface.triangles,
                                       [&](MeshDefect defect, const std::vector<Index>&, const std::vector<Index>&,
                                           const auto&...) { found.push_back(defect); });
    CHECK(found ==
          std::vector{MeshDefect::coordinate_not_finite, MeshDefect::index_out_of_range, MeshDefect::repeated_vertex});
    CHECK(mesh.has_size);
    CHECK(mesh.referenced.size() == 78);
    CHECK(mesh.sides.size() == 3 * 78);
    CHECK(mesh.points.size() == 41);
    for (Index f = 0; f < 80; ++f) {
        const auto corners = surface.triangles.col(f);
        const bool left_out = f == 3 || f == 8;
        CHECK((mesh.triangles(0, f) == no_index) == left_out);
        CHECK(mesh.finite[static_cast<std::size_t>(f)] == (!left_out && (corners.array() != 7).all()));
        if (!left_out) CHECK(mesh.triangles.col(f) == corners);
    }
    for (const HalfEdge& side : mesh.sides) {
        CHECK(mesh.triangles((side.side + 2) % 3, side.triangle) == side.apex);
    }
}
