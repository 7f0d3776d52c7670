// SPDX-License-Identifier: MIT
#include <membrane/surface/triangle_adjacency.hpp>

#include <vector>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/tears.hpp"

using namespace membrane;
using test::Random;

namespace {

void check_equal(const TriangleAdjacency& found, const Adjacency& expected, Index vertex_count, Index triangle_count) {
    std::vector<Index> border;
    for (Index v = 0; v < vertex_count; ++v) {
        const auto of = found.triangles_of(v), all = expected.triangles_of(v);
        REQUIRE(std::vector(of.begin(), of.end()) == std::vector(all.begin(), all.end()));
        if (found.on_border(v)) border.push_back(v);
    }
    REQUIRE(border == std::vector(expected.border_vertices().begin(), expected.border_vertices().end()));
    for (Index f = 0; f < triangle_count; ++f) {
        REQUIRE(found.triangle_neighbours(f) == expected.triangle_neighbours(f));
    }
    REQUIRE(found.closed() == expected.closed());
}

}  // namespace

// `Adjacency` is compared with a search through all triangles in a test of its own.
TEMPLATE_TEST_CASE("after random tears the triangles are adjacent as in a mesh that is built anew", "[mesh][tear]",
                   TEST_SCALARS) {
    int tears = 0;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<TestType> surface(test::random_surface<TestType>(random), 4 + random.index(60));
        const auto mesh = surface.mesh();
        TriangleAdjacency adjacency(mesh);
        while (surface.tear(random, [&](const VertexSplit& split) { adjacency.split(split); })) {
            check_equal(adjacency, Adjacency(surface.mesh()), mesh.vertex_count(), mesh.triangle_count());
            ++tears;
        }
    }
    CHECK(tears > cases(100));
}

TEST_CASE("a tear across a strip parts it", "[mesh][tear]") {
    // 2--3
    // |\ |    vertex 1 becomes two, then 2; triangle 0 stays with the first ones
    // 0--1
    const test::Surface<double> whole{Points<double>{{0, 1, 0, 1, 0, 0}, {0, 0, 1, 1, 0, 0}, {0, 0, 0, 0, 0, 0}},
                                      Triangles{{0, 1}, {1, 3}, {2, 2}}};
    TriangleAdjacency adjacency(whole.mesh());
    CHECK(adjacency.triangle_neighbours(0) == std::array<Index, 3>{no_index, 1, no_index});
    const std::array<Index, 1> goes{1};
    const std::array<std::array<Index, 3>, 2> corners{{{1, 3, 2}, {4, 3, 2}}};
    adjacency.split({1, 4, goes, {&corners[0], 1}, 0.5});
    CHECK(adjacency.triangle_neighbours(0) == std::array<Index, 3>{no_index, no_index, no_index});
    CHECK(adjacency.triangle_neighbours(1) == std::array<Index, 3>{no_index, no_index, no_index});
    CHECK(adjacency.triangles_of(1).size() == 1);
    CHECK(adjacency.triangles_of(4)[0] == 1);
    CHECK(adjacency.triangles_of(2).size() == 2);
    adjacency.split({2, 5, goes, {&corners[1], 1}, 0.5});
    CHECK(adjacency.triangles_of(2)[0] == 0);
    CHECK(adjacency.triangles_of(5)[0] == 1);
    CHECK(adjacency.on_border(5));
    CHECK(!adjacency.closed());
}

#ifndef NDEBUG
TEST_CASE("whether a vertex that is not there is on the border is a broken precondition", "[mesh][bad]") {
    const TriangleAdjacency adjacency(icosphere({.subdivisions = 0}));
    for (const Index wrong : {-1, 12}) {
        CHECK(test::in_child([&] { (void)adjacency.on_border(wrong); }).signal == SIGABRT);
    }
}
#endif
