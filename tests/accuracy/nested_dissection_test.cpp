// SPDX-License-Identifier: MIT
#include <membrane/accuracy/nested_dissection.hpp>

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

using Edges = std::vector<std::pair<Index, Index>>;

CompressedRows<Index> neighbours_of(Index vertices, const Edges& edges) {
    return CompressedRows<Index>(vertices, [&](auto put) {
        for (const auto& [v, w] : edges) put(v, w), put(w, v);
    });
}

/// All vertices, each once.
std::vector<Index> order_of(const std::vector<std::vector<Index>>& parts, Index vertices) {
    std::vector<Index> order;
    for (const auto& part : parts) {
        CHECK(!part.empty());
        order.insert(order.end(), part.begin(), part.end());
    }
    std::vector<Index> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    REQUIRE(std::ssize(sorted) == vertices);
    for (Index v = 0; v < vertices; ++v) REQUIRE(sorted[static_cast<std::size_t>(v)] == v);
    return order;
}

/// Pairs that are linked at some time while the vertices are eliminated one by one, the edges included.
std::size_t fill(const std::vector<Index>& order, Index vertices, const Edges& edges) {
    std::vector<std::set<Index>> linked(static_cast<std::size_t>(vertices));
    const auto link = [&](Index v, Index w) {
        linked[static_cast<std::size_t>(v)].insert(w);
        linked[static_cast<std::size_t>(w)].insert(v);
    };
    for (const auto& [v, w] : edges) link(v, w);
    std::size_t pairs = 0;
    for (const Index v : order) {
        const auto others = linked[static_cast<std::size_t>(v)];
        pairs += others.size();
        for (const Index a : others) {
            linked[static_cast<std::size_t>(a)].erase(v);
            for (const Index b : others) {
                if (a < b) link(a, b);
            }
        }
    }
    return pairs;
}

}  // namespace

TEST_CASE("an order has every vertex of a random graph once, and twice the same", "[nested_dissection]") {
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index vertices = 1 + random.index(60);
        const double density = random.chance(0.5) ? 2.0 / vertices : random.number();
        Edges edges;
        for (Index v = 0; v < vertices; ++v) {
            for (Index w = 0; w < v; ++w) {
                if (random.chance(density)) edges.emplace_back(v, w);
            }
        }
        const auto parts = nested_dissection(neighbours_of(vertices, edges));
        order_of(parts, vertices);
        CHECK(parts == nested_dissection(neighbours_of(vertices, edges)));
    }
}

TEST_CASE("an order of a mesh has less than half the fill of the order of its numbers", "[nested_dissection]") {
    for (const auto& mesh :
         {icosphere<double>({.radius = 1, .subdivisions = 2}), disc<double>({.radius = 1, .rings = 10})}) {
        const Adjacency adjacency(mesh);
        Edges edges;
        for (const auto& [v, w] : adjacency.edges()) edges.emplace_back(v, w);
        const auto order = order_of(nested_dissection(neighbours_of(mesh.vertex_count(), edges)), mesh.vertex_count());
        std::vector<Index> by_number(order);
        std::sort(by_number.begin(), by_number.end());
        CHECK(2 * fill(order, mesh.vertex_count(), edges) < fill(by_number, mesh.vertex_count(), edges));
    }
}

TEST_CASE("a graph without edges and a star are ordered without fill, a line with little", "[nested_dissection]") {
    const Index vertices = 3000;
    Edges line, star;
    for (Index v = 1; v < vertices; ++v) {
        line.emplace_back(v - 1, v);
        star.emplace_back(0, v);
    }
    const auto fill_of = [&](const Edges& edges) {
        return fill(order_of(nested_dissection(neighbours_of(vertices, edges)), vertices), vertices, edges);
    };
    CHECK(fill_of({}) == 0);
    CHECK(fill_of(star) == star.size());
    CHECK(fill_of(line) <= 2 * line.size());
    CHECK(nested_dissection(neighbours_of(0, {})).empty());
}
