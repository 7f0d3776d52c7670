// SPDX-License-Identifier: MIT
#include <membrane/solve/spring_packs.hpp>

#include <algorithm>
#include <cstdint>
#include <vector>

#include <membrane/mesh/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

TEMPLATE_TEST_CASE("there are as many groups as there is room for, in packs", "[packs]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = S(1)});
        const Index vertices = mesh.vertex_count(), most = random.index(vertices + 1);
        const Index start = random.index(vertices);
        PropagationQueue queue(vertices);
        queue.build(network, {&start, 1}, random.index(6));
        queue.group(network);
        const std::size_t seeds = queue.layer_count() > 0 ? queue.layer(0).size() : 0;
        IndexSet visited(vertices);
        for (const Index v : queue.vertices()) visited.insert(v);
        for (Index v = 0; v < vertices; ++v) {
            if (random.chance(0.5)) visited.insert(v);
        }
        VertexGroups others(vertices);
        others.add(network, visited, queue.vertices().size(), visited.items().size());
        SpringPacks<S> packs(network, most);
        for (int again = 0; again < 2; ++again) {
            packs.follow(queue, network);
            const bool is_whole = packs.size() == queue.vertices().size() - seeds;
            const std::size_t of_queue = packs.size();
            packs.append(visited.items(), queue.vertices().size(), others.ends(), network);
            REQUIRE(packs.size() <= static_cast<std::size_t>(most));
            if (most == vertices) REQUIRE(packs.size() == visited.items().size() - seeds);
            if (!is_whole) REQUIRE(packs.size() == of_queue);
            std::vector<std::size_t> ends(queue.group_ends().begin(), queue.group_ends().end());
            if (is_whole) ends.insert(ends.end(), others.ends().begin(), others.ends().end());
            std::size_t place = seeds, pack = 0;
            for (const std::size_t end : ends) {
                for (; place < end && pack < packs.count(); ++pack) {
                    REQUIRE(packs.place_of(pack) == place - seeds);
                    REQUIRE(packs.pack_from(packs.place_of(pack)) == pack);
                    REQUIRE(packs.vertices(pack).size() == std::min(end - place, Lanes<S>::count));
                    for (const Index v : packs.vertices(pack)) REQUIRE(v == visited.items()[place++]);
                }
            }
            REQUIRE(pack == packs.count());
            REQUIRE(place == seeds + packs.size());
            REQUIRE(packs.pack_from(packs.size()) == packs.count());
        }
    }
}

TEMPLATE_TEST_CASE("packs have the springs and the positions of their vertices", "[packs]", float, double) {
    using S = TestType;
    using Several = Lanes<S>;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const MassSpringNetwork<S, LinearSpring> network(mesh, {}, {.stiffness = random.number(S(1), S(2))});
        const Index start = random.index(mesh.vertex_count());
        PropagationQueue queue(mesh.vertex_count());
        queue.build(network, {&start, 1}, 4);
        queue.group(network);
        SpringPacks<S> packs(network, mesh.vertex_count());
        packs.follow(queue, network);
        Points<S> x = mesh.positions();
        packs.load(x);
        for (std::size_t p = 0; p < packs.count(); ++p) {
            const auto vertices = packs.vertices(p);
            const auto positions = packs.positions(p);
            std::vector<std::size_t> seen(vertices.size(), 0);
            packs.for_each_spring(p, [&](const Vector3<Several>& there, const Several& stiffness, const Several& rest) {
                for (std::size_t i = 0; i < Several::count; ++i) {
                    const auto springs =
                        i < vertices.size() ? network.springs_of(vertices[i]) : std::span<const SpringEnd<S>>();
                    const auto lane = [i](const Vector3<Several>& points) {
                        return Vector3<S>(points[0][i], points[1][i], points[2][i]);
                    };
                    if (i >= vertices.size() || seen[i] == springs.size()) {
                        REQUIRE(stiffness[i] == 0);
                        REQUIRE(lane(there) == lane(positions));
                        continue;
                    }
                    const auto& spring = springs[seen[i]++];
                    REQUIRE(stiffness[i] == spring.stiffness);
                    REQUIRE(rest[i] == spring.rest_length);
                    REQUIRE(lane(there) == point(x, spring.other));
                    REQUIRE(lane(positions) == point(x, vertices[i]));
                }
            });
            for (std::size_t i = 0; i < vertices.size(); ++i)
                REQUIRE(seen[i] == network.springs_of(vertices[i]).size());
        }

        // What is moved is stored, and nobody else.
        Points<S> expected = x;
        for (std::size_t p = 0; p < packs.count(); ++p) {
            packs.move(p, packs.positions(p) + packs.positions(p));
            for (const Index v : packs.vertices(p)) expected.col(v) *= 2;
        }
        PointsRef<S> all = x;
        packs.store(all);
        REQUIRE(test::same_bits(x, expected));
    }
}
