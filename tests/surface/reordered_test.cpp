// SPDX-License-Identifier: MIT
#include <membrane/surface/reordered.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

std::vector<Index> shuffled(Index count, Random& random) {
    std::vector<Index> order(static_cast<std::size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = order.size(); i > 1; --i) {
        std::swap(order[i - 1], order[static_cast<std::size_t>(random.index(static_cast<Index>(i)))]);
    }
    return order;
}

/// The same surface in no order at all.
template <Real S>
TriangleMesh<S> shuffled(const TriangleMesh<S>& mesh, Random& random) {
    const auto vertices = shuffled(mesh.vertex_count(), random), triangles = shuffled(mesh.triangle_count(), random);
    std::vector<Index> now(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v)
        now[static_cast<std::size_t>(vertices[v])] = static_cast<Index>(v);
    Triangles renamed = mesh.triangles()(Eigen::all, triangles);
    for (Index& v : renamed.reshaped()) v = now[static_cast<std::size_t>(v)];
    return TriangleMesh<S>(mesh.positions()(Eigen::all, vertices), renamed);
}

/// How far apart in memory the ends of an edge are, half of all at least.
template <Real S>
Index median_distance(const TriangleMesh<S>& mesh) {
    std::vector<Index> distances;
    for (const auto& corner : mesh.triangles().colwise()) distances.push_back(std::abs(corner[1] - corner[0]));
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

}  // namespace

TEMPLATE_TEST_CASE("a reordered mesh is the same surface, each vertex and triangle once", "[reordered]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const auto [near, source_vertex, source_triangle] = reordered(mesh);
        const auto is_permutation = [](std::vector<Index> order, Index count) {
            std::sort(order.begin(), order.end());
            std::vector<Index> all(static_cast<std::size_t>(count));
            std::iota(all.begin(), all.end(), 0);
            return order == all;
        };
        REQUIRE(is_permutation(source_vertex, mesh.vertex_count()));
        REQUIRE(is_permutation(source_triangle, mesh.triangle_count()));
        REQUIRE(test::same_bits(near.positions(), Points<S>(mesh.positions()(Eigen::all, source_vertex))));
        Triangles back = near.triangles();
        for (Index& v : back.reshaped()) v = source_vertex[static_cast<std::size_t>(v)];
        REQUIRE(back == mesh.triangles()(Eigen::all, source_triangle));

        // It is in order now, and comes to it from any other.
        const auto again = reordered(near);
        REQUIRE(std::is_sorted(again.source_vertex.begin(), again.source_vertex.end()));
        REQUIRE(std::is_sorted(again.source_triangle.begin(), again.source_triangle.end()));
        REQUIRE(test::same_bits(reordered(shuffled(mesh, random)).mesh.positions(), near.positions()));
    }
}

TEMPLATE_TEST_CASE("triangles are in the order of the first of their vertices", "[reordered]", TEST_SCALARS) {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto near = reordered(test::random_surface<TestType>(random).mesh()).mesh;
        std::vector<Index> first;
        for (const auto& corners : near.triangles().colwise()) first.push_back(corners.minCoeff());
        REQUIRE(std::is_sorted(first.begin(), first.end()));
    }
}

TEMPLATE_TEST_CASE("the curve fills cubes of the longest side, also of a surface without thickness", "[reordered]",
                   TEST_SCALARS) {
    using S = TestType;
    Random random(1);
    // Of eight cubes the curve goes through one after the other, along x first; a sheet this low is in two of them.
    const auto low = shuffled(sheet<S>({.width = 1, .height = S(0.4), .columns = 15, .rows = 6}), random);
    const auto x = reordered(low).mesh.positions().row(0).eval();
    const auto middle = S(0.5) * (x.minCoeff() + x.maxCoeff());
    CHECK(std::is_partitioned(x.begin(), x.end(), [&](S along) { return along < middle; }));
    // A square is in four: both halves of the lower one, then of the upper one.
    const auto square = shuffled(sheet<S>({.width = 1, .height = 1, .columns = 15, .rows = 15}), random);
    const Points<S> y = reordered(square).mesh.positions();
    const Vector3<S> centre = S(0.5) * (y.rowwise().minCoeff() + y.rowwise().maxCoeff());
    std::vector<int> quarters;
    for (const auto& p : y.colwise()) quarters.push_back((p.y() < centre.y() ? 0 : 2) + (p.x() < centre.x() ? 0 : 1));
    CHECK(std::is_sorted(quarters.begin(), quarters.end()));
}

TEST_CASE("what is near in space is near in memory", "[reordered]") {
    Random random(1);
    const auto sphere = icosphere<double>({.subdivisions = 5});  // 10,242 vertices
    const auto mesh = shuffled(sphere, random);
    REQUIRE(median_distance(mesh) > 1000);
    CHECK(median_distance(reordered(mesh).mesh) < 20);
    CHECK(median_distance(reordered(sphere).mesh) < median_distance(sphere));
}

TEST_CASE("bits are spread, and none is lost", "[reordered]") {
    for (int bit = 0; bit < 21; ++bit)
        REQUIRE(detail::spread_bits(std::uint64_t{1} << bit) == std::uint64_t{1} << 3 * bit);
    CHECK(detail::spread_bits(std::uint64_t{1} << 21) == 0);
    CHECK(detail::spread_bits(0x1fffff) == 0x1249249249249249);
}
