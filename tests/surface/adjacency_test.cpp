// SPDX-License-Identifier: MIT
#include <membrane/surface/adjacency.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;

namespace {

/// All that `Adjacency` says, found by looking at every triangle for every question.
struct BruteForce {
    std::vector<std::vector<Index>> neighbours, triangles_of;
    std::vector<std::array<Index, 3>> triangle_neighbours;
    std::vector<std::array<Index, 2>> edges;
    std::vector<Index> border;

    BruteForce(Index vertex_count, const Triangles& t) {
        const auto has_side = [&](Index f, Index from, Index to) {
            for (Index k = 0; k < 3; ++k) {
                if (t(k, f) == from && t((k + 1) % 3, f) == to) return true;
            }
            return false;
        };
        std::set<Index> on_border;
        for (Index f = 0; f < t.cols(); ++f) {
            triangle_neighbours.push_back({no_index, no_index, no_index});
            for (Index k = 0; k < 3; ++k) {
                const Index from = t(k, f), to = t((k + 1) % 3, f);
                for (Index g = 0; g < t.cols(); ++g) {
                    if (has_side(g, to, from)) triangle_neighbours.back()[static_cast<std::size_t>(k)] = g;
                }
                if (triangle_neighbours.back()[static_cast<std::size_t>(k)] == no_index) on_border.insert({from, to});
            }
        }
        border.assign(on_border.begin(), on_border.end());
        std::set<std::array<Index, 2>> all_edges;
        for (Index v = 0; v < vertex_count; ++v) {
            std::set<Index> others, triangles;
            for (Index f = 0; f < t.cols(); ++f) {
                if (t(0, f) != v && t(1, f) != v && t(2, f) != v) continue;
                triangles.insert(f);
                others.insert({t(0, f), t(1, f), t(2, f)});
            }
            others.erase(v);
            for (const Index w : others) all_edges.insert({std::min(v, w), std::max(v, w)});
            neighbours.emplace_back(others.begin(), others.end());
            triangles_of.emplace_back(triangles.begin(), triangles.end());
        }
        edges.assign(all_edges.begin(), all_edges.end());
    }
};

template <class Row>
auto as_vector(const Row& row) {
    return std::vector(row.begin(), row.end());
}

void check_against_brute_force(const Adjacency& adjacency, Index vertex_count, const Triangles& triangles) {
    const BruteForce expected(vertex_count, triangles);
    for (Index v = 0; v < vertex_count; ++v) {
        REQUIRE(as_vector(adjacency.neighbours(v)) == expected.neighbours[static_cast<std::size_t>(v)]);
        REQUIRE(as_vector(adjacency.triangles_of(v)) == expected.triangles_of[static_cast<std::size_t>(v)]);
    }
    for (Index f = 0; f < triangles.cols(); ++f) {
        REQUIRE(adjacency.triangle_neighbours(f) == expected.triangle_neighbours[static_cast<std::size_t>(f)]);
    }
    REQUIRE(as_vector(adjacency.edges()) == expected.edges);
    REQUIRE(as_vector(adjacency.border_vertices()) == expected.border);
    REQUIRE(adjacency.closed() == expected.border.empty());
}

}  // namespace

TEMPLATE_TEST_CASE("adjacency of random surfaces is that of a search through all triangles", "[mesh]", TEST_SCALARS) {
    int closed = 0;
    for (int seed = 1; seed <= cases(120); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<TestType>(random);
        if (random.chance(0.5)) surface = test::with_holes(surface, random);
        if (random.chance(0.3)) surface.add(test::random_surface<TestType>(random));
        if (random.chance(0.3)) surface.add(random.vector<TestType>());
        const Adjacency adjacency(surface.mesh());
        check_against_brute_force(adjacency, surface.vertex_count(), surface.triangles);
        if (adjacency.closed()) ++closed;
    }
    CHECK(closed < cases(120));
}

TEST_CASE("adjacency of the stock shapes is that of a search through all triangles", "[mesh]") {
    const auto check = [](const TriangleMesh<double>& mesh, bool closed) {
        const Adjacency adjacency(mesh);
        check_against_brute_force(adjacency, mesh.vertex_count(), mesh.triangles());
        CHECK(adjacency.closed() == closed);
    };
    check(icosphere({.subdivisions = 0}), true);
    check(icosphere({.subdivisions = 2}), true);
    check(icosphere({.subdivisions = 3}), true);
    check(sheet({.columns = 1, .rows = 1}), false);
    check(sheet({.columns = 9, .rows = 4}), false);
    check(disc({.rings = 1}), false);
    check(disc({.rings = 7}), false);
    check(spherical_cap(), false);
}

TEST_CASE("adjacency of one triangle", "[mesh]") {
    Eigen::Matrix3d x = Eigen::Matrix3d::Identity();
    const Adjacency adjacency(TriangleMesh(x, Eigen::Vector3i(2, 0, 1)));
    CHECK(as_vector(adjacency.neighbours(0)) == std::vector<Index>{1, 2});
    CHECK(as_vector(adjacency.neighbours(1)) == std::vector<Index>{0, 2});
    CHECK(as_vector(adjacency.triangles_of(2)) == std::vector<Index>{0});
    CHECK(adjacency.triangle_neighbours(0) == std::array{no_index, no_index, no_index});
    CHECK(as_vector(adjacency.edges()) == std::vector<std::array<Index, 2>>{{0, 1}, {0, 2}, {1, 2}});
    CHECK(as_vector(adjacency.border_vertices()) == std::vector<Index>{0, 1, 2});
    CHECK_FALSE(adjacency.closed());
}

TEST_CASE("adjacency outlives the mesh and what it was copied from", "[mesh]") {
    Random random(3);
    const auto surface = test::random_surface<double>(random);
    auto mesh = std::make_unique<TriangleMesh<double>>(surface.mesh());
    auto first = std::make_unique<Adjacency>(*mesh);
    mesh.reset();
    const Adjacency copy = *first;
    const Adjacency moved = std::move(*first);
    first.reset();
    check_against_brute_force(copy, surface.vertex_count(), surface.triangles);
    check_against_brute_force(moved, surface.vertex_count(), surface.triangles);
}

TEST_CASE("a vertex may have a hundred thousand neighbours", "[mesh]") {
    const Adjacency adjacency(test::fan<double>(100'000).mesh());
    CHECK(adjacency.neighbours(0).size() == 100'000);
    CHECK(adjacency.triangles_of(0).size() == 100'000);
    CHECK(adjacency.edges().size() == 200'000);
    CHECK(adjacency.border_vertices().size() == 100'000);
    CHECK(as_vector(adjacency.neighbours(5)) == std::vector<Index>{0, 4, 6});
}

TEST_CASE("the edges of a mesh are those of its adjacency, and views of a temporary are not to be had", "[mesh]") {
    const auto mesh = sheet({.columns = 3, .rows = 2});
    const Adjacency adjacency(mesh);
    const auto all = edges(mesh);
    CHECK(std::equal(all.begin(), all.end(), adjacency.edges().begin(), adjacency.edges().end()));
    const auto has_views = []<class A>(A&& a) {
        return requires { std::forward<A>(a).neighbours(0); };
    };
    CHECK(has_views(adjacency));
    CHECK_FALSE(has_views(Adjacency(mesh)));
    const auto& positions = sheet({.columns = 3, .rows = 2}).positions();  // moved out of the temporary
    CHECK(positions == mesh.positions());
}

#ifndef NDEBUG
TEST_CASE("asking for a vertex or triangle that is not there is a broken precondition", "[mesh][bad]") {
    const Adjacency adjacency(icosphere({.subdivisions = 0}));
    for (const Index wrong : {-1, 12, 1000}) {
        CHECK(test::in_child([&] { (void)adjacency.neighbours(wrong); }).signal == SIGABRT);
        CHECK(test::in_child([&] { (void)adjacency.triangles_of(wrong); }).signal == SIGABRT);
    }
    for (const Index wrong : {-1, 20}) {
        CHECK(test::in_child([&] { (void)adjacency.triangle_neighbours(wrong); }).signal == SIGABRT);
    }
}
#endif
