// SPDX-License-Identifier: MIT
#include <membrane/surface/mesh_defect.hpp>

#include <set>
#include <string_view>

#include "support/catch.hpp"

using namespace membrane;

TEST_CASE("every kind of defect has a name of its own and says what to do", "[mesh]") {
    std::set<std::string_view> names;
    for (std::size_t i = 0; i < mesh_defect_count; ++i) {
        const auto defect = static_cast<MeshDefect>(i);
        CAPTURE(i);
        CHECK(!name(defect).empty());
        CHECK(!remedy(defect).empty());
        names.insert(name(defect));
    }
    CHECK(names.size() == mesh_defect_count);
    // Each text stands where its kind does.
    CHECK(name(MeshDefect::no_vertices) == "no vertices");
    CHECK(name(MeshDefect::double_sided_triangle) == "double-sided triangle");
    CHECK(name(MeshDefect::non_manifold_vertex) == "non-manifold vertex");
    CHECK(name(MeshDefect::t_junction) == "T-junction");
    CHECK(name(MeshDefect::self_intersection) == "self-intersection");
    CHECK(severity(MeshDefect::no_vertices) == Severity::error);
    CHECK(severity(MeshDefect::non_manifold_vertex) == Severity::error);
    CHECK(severity(MeshDefect::coincident_vertices) == Severity::warning);
    CHECK(severity(MeshDefect::self_intersection) == Severity::warning);
}
