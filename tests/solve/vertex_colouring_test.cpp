// SPDX-License-Identifier: MIT
#include <membrane/solve/propagation_queue.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/replay/snapshot.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

/// Calls `check(random, network, set, list)` with vertices of a network in any order, in a set and in a list.
template <class Check>
void for_random_vertices(const Check& check) {
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<double>(random).mesh();
        const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 1.0});
        IndexSet set(mesh.vertex_count());
        for (Index i = random.index(2 * mesh.vertex_count()); i > 0; --i) set.insert(random.index(mesh.vertex_count()));
        check(random, network, set, std::vector<Index>(set.items().begin(), set.items().end()));
    }
}

}  // namespace

TEST_CASE("each vertex is in the first group that holds no neighbour of it", "[vertex_colouring]") {
    for_random_vertices([&](Random& random, const auto& network, IndexSet& set, const std::vector<Index>& before) {
        // In two parts, after a first that stays as it is.
        const auto somewhere = [&] { return static_cast<std::size_t>(random.index(set.count() + 1)); };
        const auto [begin, middle] = std::minmax({somewhere(), somewhere()});

        std::vector<Index> expected(before.begin(), before.begin() + static_cast<std::ptrdiff_t>(begin));
        std::vector<std::size_t> ends;
        const auto joined = [&](Index v, Index w) {
            return std::ranges::any_of(network.springs_of(v), [&](const auto& end) { return end.other == w; });
        };
        const auto order = [&](std::size_t from, std::size_t to) {
            std::vector<std::vector<Index>> groups;
            for (std::size_t i = from; i < to; ++i) {
                const auto holds_none = [&](const std::vector<Index>& group) {
                    return std::ranges::none_of(group, [&](Index w) { return joined(before[i], w); });
                };
                auto group = std::ranges::find_if(groups, holds_none);
                if (group == groups.end()) group = groups.insert(groups.end(), std::vector<Index>());
                group->push_back(before[i]);
            }
            for (const auto& group : groups) {
                expected.insert(expected.end(), group.begin(), group.end());
                ends.push_back(expected.size());
            }
        };
        order(begin, middle);
        order(middle, before.size());

        VertexColouring groups(network.vertex_count());
        for (int again = 0; again < 2; ++again) {
            for (std::size_t i = 0; i < before.size(); ++i) set.reorder(i, {&before[i], 1});
            groups.clear();
            REQUIRE(groups.ends().empty());
            groups.add(network, set, begin, middle);
            groups.add(network, set, middle, before.size());
            REQUIRE(std::ranges::equal(set.items(), expected));
            REQUIRE(std::ranges::equal(groups.ends(), ends));
        }
    });
}

// So that each vertex is updated where its neighbours are as in the given order.
TEST_CASE("groups with the same results hold a vertex after all neighbours before it, and before all after it",
          "[vertex_colouring]") {
    for_random_vertices([&](Random&, const auto& network, IndexSet& set, const std::vector<Index>& before) {
        VertexColouring groups(network.vertex_count());
        groups.add(network, set, 0, before.size(), true);
        REQUIRE(std::ranges::is_permutation(set.items(), before));
        const auto group_of = [&](Index v) {
            const auto at = std::ranges::find(set.items(), v) - set.items().begin();
            return std::ranges::upper_bound(groups.ends(), static_cast<std::size_t>(at)) - groups.ends().begin();
        };
        for (std::size_t i = 0; i < before.size(); ++i) {
            for (const auto& end : network.springs_of(before[i])) {
                const auto j = static_cast<std::size_t>(std::ranges::find(before, end.other) - before.begin());
                if (j < i) REQUIRE(group_of(before[j]) < group_of(before[i]));
            }
        }
    });
}

TEST_CASE("a snapshot holds the groups", "[vertex_colouring]") {
    Random random(1);
    const auto mesh = test::random_surface<double>(random).mesh();
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 1.0});
    IndexSet set(mesh.vertex_count());
    for (Index v = 0; v < mesh.vertex_count(); ++v) set.insert(v);
    VertexColouring groups(mesh.vertex_count()), restored = groups;
    groups.add(network, set, 0, static_cast<std::size_t>(set.count()));
    REQUIRE(groups.ends().size() > 1);
    std::vector<std::byte> buffer(snapshot_capacity(groups));
    buffer.resize(save_snapshot(buffer, groups));
    REQUIRE(restore_snapshot(buffer, restored));
    CHECK(std::ranges::equal(restored.ends(), groups.ends()));
}
