// SPDX-License-Identifier: MIT
#include <membrane/surface/vertex_split.hpp>

#include <array>

#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;

TEST_CASE("triangles that get the copy are found by number or by their other corners", "[mesh][tear]") {
    const std::array<Index, 2> goes{3, 7};
    const std::array<std::array<Index, 3>, 2> corners{{{0, 1, 2}, {2, 5, 0}}};
    const VertexSplit split{0, 9, goes, corners, 0.25};
    for (Index f = -1; f < 10; ++f) CHECK(split.takes(f) == (f == 3 || f == 7));
    CHECK(split.takes(1, 2));
    CHECK(split.takes(2, 1));
    CHECK(split.takes(5, 2));
    CHECK(!split.takes(1, 5));
    std::array<Index, 3> replaced = corners[1];
    split.replace_in(replaced);
    CHECK(replaced == std::array<Index, 3>{2, 5, 9});
    Triangles triangles{{4, 0}, {5, 1}, {6, 2}};
    split.replace_in(triangles.col(1));
    CHECK(triangles == Triangles{{4, 9}, {5, 1}, {6, 2}});
}

TEMPLATE_TEST_CASE("a constant is divided, and none of it is lost", "[tear]", TEST_SCALARS) {
    TestType vertex = 12, copy = 1;
    divide(vertex, copy, 0.25);
    CHECK(copy == 3);
    CHECK(vertex == 9);
}

TEST_CASE("the reserve is the vertices without triangles", "[mesh][tear]") {
    auto surface = test::surface_of(icosphere<double>({.radius = 1, .subdivisions = 1}));
    CHECK(reserve_of(surface.mesh()) == 0);
    surface.add({0, 0, 0});
    surface.add({0, 0, 0});
    CHECK(reserve_of(surface.mesh()) == 2);
}
