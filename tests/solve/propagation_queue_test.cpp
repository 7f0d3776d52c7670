// SPDX-License-Identifier: MIT
#include <membrane/solve/propagation_queue.hpp>

#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr Index far_away = 1'000'000;

std::set<Index> set_of(std::span<const Index> vertices) { return {vertices.begin(), vertices.end()}; }

/// A mesh with holes, springs left out, and pinned vertices.
MassSpringNetwork<double, LinearSpring> random_network(Random& random) {
    const auto mesh = test::with_holes(test::random_surface<double>(random), random).mesh();
    std::vector<double> stiffness(edges(mesh).size(), 1.0);
    for (double& k : stiffness) {
        if (random.chance(0.1)) k = 0;
    }
    std::vector<Index> pinned;
    for (Index n = random.index(4); n > 0; --n) pinned.push_back(random.index(mesh.vertex_count()));
    return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = stiffness, .pinned = pinned});
}

/// How many springs lie between each vertex and the nearest seed: not a search, but distances that are lowered along
/// one spring after the other until none can be.
std::vector<Index> distances(const MassSpringNetwork<double, LinearSpring>& network, const std::vector<Index>& seeds) {
    std::vector<Index> distance(static_cast<std::size_t>(network.vertex_count()), far_away);
    const auto at = [&](Index v) -> Index& { return distance[static_cast<std::size_t>(v)]; };
    for (const Index v : seeds) {
        if (!network.pinned(v)) at(v) = 0;
    }
    for (bool lowered = true; lowered;) {
        lowered = false;
        for (const auto& spring : network.springs()) {
            if (network.pinned(spring.first) || network.pinned(spring.second)) continue;
            for (const auto& [v, w] : {std::pair(spring.first, spring.second), {spring.second, spring.first}}) {
                if (at(v) + 1 >= at(w)) continue;
                at(w) = at(v) + 1;
                lowered = true;
            }
        }
    }
    return distance;
}

}  // namespace

TEST_CASE("layers are distances in springs from the seeds", "[queue]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto network = random_network(random);
        PropagationQueue queue(network.vertex_count());
        for (int again = 0; again < 3; ++again) {
            std::vector<Index> seeds;
            for (Index n = random.index(4); n >= 0; --n) seeds.push_back(random.index(network.vertex_count()));
            if (random.chance(0.3)) seeds.push_back(seeds.front());  // named twice
            const Index layers = random.chance(0.2) ? unlimited : random.index(7);
            queue.build(network, seeds, layers);

            const auto distance = distances(network, seeds);
            std::vector<std::set<Index>> expected;
            for (Index v = 0; v < network.vertex_count(); ++v) {
                const Index k = distance[static_cast<std::size_t>(v)];
                const bool reached = k <= layers && k < far_away;
                REQUIRE(queue.contains(v) == reached);
                if (!reached) continue;
                expected.resize(std::max(expected.size(), static_cast<std::size_t>(k) + 1));
                expected[static_cast<std::size_t>(k)].insert(v);
            }
            REQUIRE(queue.layer_count() == static_cast<Index>(expected.size()));
            std::size_t before = 0;
            for (Index k = 0; k < queue.layer_count(); ++k) {
                REQUIRE(set_of(queue.layer(k)) == expected[static_cast<std::size_t>(k)]);
                REQUIRE(queue.layer(k).size() == expected[static_cast<std::size_t>(k)].size());
                REQUIRE(queue.layer(k).data() == queue.vertices().data() + before);  // nearest to the contact first
                before += queue.layer(k).size();
            }
            REQUIRE(queue.vertices().size() == before);
        }
    }
}

TEST_CASE("within a layer vertices stand in the order of arrival", "[queue]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto network = random_network(random);
        const std::vector<Index> seeds{random.index(network.vertex_count()), random.index(network.vertex_count())};
        PropagationQueue queue(network.vertex_count());
        queue.build(network, seeds, unlimited);
        const auto vertices = queue.vertices();
        std::vector<std::size_t> place(static_cast<std::size_t>(network.vertex_count()), vertices.size());
        for (std::size_t i = 0; i < vertices.size(); ++i) place[static_cast<std::size_t>(vertices[i])] = i;
        // Each was added by the first of its neighbours in the queue; the first in adds first.
        std::size_t last = 0;
        for (const Index v : vertices.subspan(queue.layer_count() > 0 ? queue.layer(0).size() : 0)) {
            std::size_t first = vertices.size();
            for (const auto& end : network.springs_of(v)) {
                first = std::min(first, place[static_cast<std::size_t>(end.other)]);
            }
            REQUIRE(first < place[static_cast<std::size_t>(v)]);
            REQUIRE(last <= first);
            last = first;
        }
    }
}

TEST_CASE("a queue by hand", "[queue]") {
    // 6 - 7 - 8
    // | / | / |     vertices row by row, diagonals from lower left to upper right
    // 3 - 4 - 5
    // | / | / |
    // 0 - 1 - 2
    const auto mesh = sheet({.columns = 2, .rows = 2});
    const auto vertices = [](const auto& span) { return std::vector<Index>(span.begin(), span.end()); };
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    PropagationQueue queue(9);
    CHECK(queue.layer_count() == 0);
    CHECK(queue.vertices().empty());
    queue.build(network, std::vector<Index>{2}, 1);
    CHECK(vertices(queue.vertices()) == std::vector<Index>{2, 1, 5});
    queue.build(network, std::vector<Index>{2}, unlimited);
    CHECK(queue.layer_count() == 5);
    CHECK(vertices(queue.vertices()) == std::vector<Index>{2, 1, 5, 0, 4, 8, 3, 7, 6});
    queue.build(network, std::vector<Index>{8, 0}, 0);
    CHECK(vertices(queue.vertices()) == std::vector<Index>{8, 0});
    CHECK(queue.layer_count() == 1);
    queue.build(network, std::vector<Index>{}, 3);
    CHECK(queue.layer_count() == 0);
    CHECK_FALSE(queue.contains(8));
    queue.build(network, std::vector<Index>{4}, 3);
    queue.clear();
    CHECK(queue.vertices().empty());
    CHECK(queue.layer_count() == 0);

    // Pinned vertices obstruct no other vertex but stop the force.
    const MassSpringNetwork wall(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = {3, 4, 5}});
    queue.build(wall, std::vector<Index>{4, 1}, unlimited);
    CHECK(vertices(queue.vertices()) == std::vector<Index>{1, 0, 2});
    queue.build(wall, std::vector<Index>{4}, unlimited);
    CHECK(queue.layer_count() == 0);
}

TEST_CASE("a queue is copied and moved with all it holds", "[queue]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    auto first = std::make_unique<PropagationQueue>(mesh.vertex_count());
    first->build(network, std::vector<Index>{5}, 2);
    PropagationQueue copy = *first;
    PropagationQueue moved = std::move(*first);
    first.reset();
    CHECK(set_of(copy.vertices()) == set_of(moved.vertices()));
    CHECK(copy.layer_count() == 3);
    copy.build(network, std::vector<Index>{5}, unlimited);
    CHECK(copy.vertices().size() == 162);
    CHECK(moved.vertices().size() == 1 + 5 + 10);
    STATIC_REQUIRE(noexcept(copy.build(network, std::span<const Index>{}, 0)));
}

TEST_CASE("a layer that there is not is empty", "[queue][bad]") {
    const MassSpringNetwork network(sheet({.columns = 2, .rows = 2}), LinearSpring{}, {.stiffness = 1.0});
    PropagationQueue queue(9);
    queue.build(network, std::vector<Index>{2}, 1);
    CHECK_FALSE(queue.layer(1).empty());
    CHECK(queue.layer(2).empty());
    CHECK(queue.layer(-1).empty());
}

TEST_CASE("every layer is ordered in groups, whatever was there before", "[queue]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto network = random_network(random);
        const Index vertices = network.vertex_count(), layers = random.index(20);
        const std::vector<Index> seeds{random.index(vertices), random.index(vertices)};
        PropagationQueue queue(vertices), plain(vertices);
        queue.build(network, {&seeds[0], 1}, 3);
        queue.group(network);
        queue.build(network, seeds, layers);
        plain.build(network, seeds, layers);
        REQUIRE(queue.colour_ends().empty());
        queue.group(network);

        IndexSet expected(vertices);
        VertexColouring groups(vertices);
        for (const Index v : plain.vertices()) expected.insert(v);
        std::size_t begin = 0;
        for (Index k = 0; k < plain.layer_count(); begin += plain.layer(k++).size()) {
            groups.add(network, expected, begin, begin + plain.layer(k).size());
        }
        REQUIRE(std::ranges::equal(queue.vertices(), expected.items()));
        REQUIRE(std::ranges::equal(queue.colour_ends(), groups.ends()));
    }
}

TEST_CASE("or all beyond the first together, which makes one layer of them", "[queue]") {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto network = random_network(random);
        const Index vertices = network.vertex_count(), layers = random.index(20);
        const std::vector<Index> seeds{random.index(vertices), random.index(vertices)};
        PropagationQueue queue(vertices), plain(vertices);
        queue.build(network, seeds, layers);
        plain.build(network, seeds, layers);
        queue.group(network, true);
        REQUIRE(queue.layer_count() == std::min(plain.layer_count(), Index(2)));
        if (queue.layer_count() == 0) continue;
        REQUIRE(std::ranges::is_permutation(queue.layer(0), plain.layer(0)));
        REQUIRE(std::ranges::is_permutation(queue.vertices(), plain.vertices()));
        REQUIRE(std::ranges::count(queue.colour_ends(), queue.layer(0).size()) == 1);
        std::size_t begin = 0;
        for (const std::size_t end : queue.colour_ends()) {
            const auto group = queue.vertices().subspan(begin, end - begin);
            for (const Index v : group) {
                for (const auto& spring : network.springs_of(v)) {
                    CHECK(std::ranges::find(group, spring.other) == group.end());
                }
            }
            begin = end;
        }
        REQUIRE(begin == queue.vertices().size());
    }
}

TEST_CASE("layers of a tissue are counted along edges, also where hinges couple vertices beyond them", "[queue]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<double>(random).mesh();
        const Material material{.young_modulus = 1e5, .poisson_ratio = 0.3, .thickness = 1e-4};
        const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0});
        const auto none = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 0.0});
        const Tissue tissue(none, triangular_springs(mesh, material), bending_springs(mesh, 1e-6));
        const std::vector<Index> seeds{random.index(mesh.vertex_count()), random.index(mesh.vertex_count())};
        const Index layers = random.index(6);
        PropagationQueue along_springs(mesh.vertex_count()), of_tissue(mesh.vertex_count());
        along_springs.build(springs, seeds, layers);
        of_tissue.build(tissue, seeds, layers);
        REQUIRE(of_tissue.layer_count() == along_springs.layer_count());
        for (Index k = 0; k < of_tissue.layer_count(); ++k) {
            REQUIRE(set_of(of_tissue.layer(k)) == set_of(along_springs.layer(k)));
        }
        of_tissue.group(tissue);
        std::size_t begin = 0;
        for (const std::size_t end : of_tissue.colour_ends()) {
            const auto group = set_of(of_tissue.vertices().subspan(begin, end - begin));
            for (const Index v : group) {
                for (const auto& coupled : tissue.neighbours(v)) REQUIRE(!group.contains(coupled.other));
            }
            begin = end;
        }
    }
}
