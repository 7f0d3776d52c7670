// SPDX-License-Identifier: MIT
#include <membrane/solve/active_vertices.hpp>

#include <algorithm>
#include <set>
#include <vector>

#include <membrane/solve/step.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Random;
using List = std::vector<Index>;
using Options = SolverOptions<double>;

namespace {

List list_of(std::span<const Index> vertices) { return {vertices.begin(), vertices.end()}; }

const auto balanced = [](Index) { return true; };
const auto unbalanced = [](Index) { return false; };

/// 0 - 1 - 2 - 3 - 4 - 5: of a strip of triangles only the springs along its lower side.
struct Chain {
    TriangleMesh<double> mesh = sheet({.width = 5, .height = 1, .columns = 5, .rows = 1});
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{},
                                                    NetworkOptions<double>{.stiffness = only_along()}};

    std::vector<double> only_along() const {
        std::vector<double> all;
        const Adjacency adjacency(mesh);
        for (const auto& [first, second] : adjacency.edges()) {
            all.push_back(second == first + 1 && second < 6 ? 1.0 : 0.0);
        }
        return all;
    }
};

}  // namespace

TEST_CASE("updates go through the queue, then to what an earlier contact has left out of balance", "[active]") {
    const Chain chain;
    ActiveVertices active(12);
    active.begin_step(chain.network, List{1}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{1, 0, 2});
    CHECK(list_of(active.contact_layer()) == List{1});
    CHECK(list_of(active.vertices()) == List{1, 0, 2});
    CHECK(active.end_step(chain.network, balanced, {}));

    // The contact moves on: who was in the queue and is no longer is visited once more.
    active.begin_step(chain.network, List{4}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{4, 3, 5, 1, 0, 2});
    CHECK_FALSE(active.end_step(chain.network, [](Index v) { return v != 2; }, {}));
    active.begin_step(chain.network, List{4}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{4, 3, 5, 2});
    CHECK_FALSE(active.end_step(chain.network, balanced, List{2}));  // 3 is being visited, 1 is not
    active.begin_step(chain.network, List{4}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{4, 3, 5, 1});
    CHECK(active.end_step(chain.network, balanced, {}));

    // Nothing left of the contact: once all is at rest there is nothing to do.
    active.begin_step(chain.network, List{}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{4, 3, 5});
    CHECK(active.contact_layer().empty());
    CHECK(active.end_step(chain.network, balanced, {}));
    active.begin_step(chain.network, List{}, Options{.layers = 1});
    CHECK(active.vertices().empty());
}

TEST_CASE("in groups, what is beyond the queue is ordered so that no two that are joined follow one another",
          "[active]") {
    const Chain chain;
    ActiveVertices active(12);
    for (const Index v : {2, 3, 4, 5}) active.wake(v);
    active.begin_step(chain.network, List{0}, Options{.layers = 1});
    CHECK(list_of(active.vertices()) == List{0, 1, 2, 4, 3, 5});
    CHECK(std::ranges::equal(active.colour_ends(), std::vector<std::size_t>{4, 6}));

    active.clear();
    for (const Index v : {2, 3, 4, 5}) active.wake(v);
    active.begin_step(chain.network, List{0}, Options{.layers = 1, .order = UpdateOrder::breadth_first});
    CHECK(list_of(active.vertices()) == List{0, 1, 2, 3, 4, 5});
    CHECK(std::ranges::equal(active.colour_ends(), std::vector<std::size_t>{3, 4, 5, 6}));
}

TEST_CASE("beyond the layers no vertex wakes, however far the frontier moves", "[active]") {
    const Chain chain;
    ActiveVertices active(12);
    for (int i = 0; i < 3; ++i) {
        active.begin_step(chain.network, List{0}, Options{.layers = 2});
        CHECK(list_of(active.vertices()) == List{0, 1, 2});
        CHECK(active.end_step(chain.network, balanced, List{0, 1, 2}));
    }
}

TEST_CASE("who is woken is visited until balanced, and feels its neighbours from then on", "[active]") {
    const Chain chain;
    ActiveVertices active(12);
    active.wake(3);
    for (int i = 0; i < 3; ++i) {
        active.begin_step(chain.network, List{0}, Options{.layers = 0});
        CHECK(list_of(active.vertices()) == List{0, 3});
        CHECK(active.end_step(chain.network, [&](Index v) { return v != 3 || i == 2; }, {}) == (i == 2));
    }
    active.begin_step(chain.network, List{2}, Options{.layers = 0});
    CHECK_FALSE(active.end_step(chain.network, balanced, List{2}));
    active.begin_step(chain.network, List{2}, Options{.layers = 0});
    CHECK(list_of(active.vertices()) == List{2, 3});

    active.clear();
    CHECK(active.vertices().empty());
    CHECK(active.queue().vertices().empty());
    active.begin_step(chain.network, List{}, Options{});
    CHECK(active.vertices().empty());
}

TEST_CASE("a step that is not finished was never arranged", "[active]") {
    const Chain chain;
    ActiveVertices active(12);
    active.wake(5);
    active.begin_step(chain.network, List{0}, Options{.layers = 1});
    CHECK_FALSE(active.end_step(chain.network, unbalanced, {}));
    ActiveVertices spared = active;
    for (const List& seeds : {List{3}, List{}, List{0}, List{0, 3}}) {
        active.begin_step(chain.network, seeds, Options{.layers = 1});
        ActiveVertices other = active, like = spared;
        other.begin_step(chain.network, List{2}, Options{.layers = 1});
        like.begin_step(chain.network, List{2}, Options{.layers = 1});
        CHECK(list_of(other.vertices()) == list_of(like.vertices()));
        CHECK(list_of(other.queue().vertices()) == list_of(like.queue().vertices()));
    }
}

TEST_CASE("layers as needed: one after the other, and nothing stands still", "[active]") {
    const Chain chain;
    const Options options{.layers = 3, .adaptive_layers = true};
    ActiveVertices active(12);
    active.begin_step(chain.network, List{1}, options);
    CHECK(list_of(active.vertices()) == List{1});
    CHECK(list_of(active.frontier()) == List{0, 2});
    active.grow(chain.network, options);
    CHECK(list_of(active.vertices()) == List{1, 0, 2});
    CHECK(list_of(active.frontier()) == List{3});
    CHECK_FALSE(active.end_step(
        chain.network, [](Index v) { return v != 0; }, List{1, 0, 2}));  // all of them are evaluated

    // What was not in balance is visited, and the seed that is none any more; the layers begin anew.
    active.begin_step(chain.network, List{4}, options);
    CHECK(list_of(active.vertices()) == List{4, 0, 1});
    CHECK(list_of(active.frontier()) == List{3, 5});
    CHECK_FALSE(active.end_step(
        chain.network, [](Index v) { return v != 5; }, List{1}));  // 2 has not been seen
    ActiveVertices spared = active;
    active.begin_step(chain.network, List{2}, options);
    active.grow(chain.network, options);
    active.begin_step(chain.network, List{}, options);
    spared.begin_step(chain.network, List{}, options);
    CHECK(list_of(active.queue().vertices()) == list_of(spared.queue().vertices()));
    CHECK(list_of(active.vertices()) == List{5, 2, 4});
    CHECK(active.frontier().empty());
    CHECK(active.end_step(chain.network, balanced, {}));

    // Up to the threshold, and to the end of what the springs join.
    for (const Index layers : {0, 1, 2, 9}) {
        const Options few{.layers = layers, .adaptive_layers = true};
        active.begin_step(chain.network, List{0}, few);
        while (!active.frontier().empty()) active.grow(chain.network, few);
        CHECK(active.vertices().size() == static_cast<std::size_t>(std::min(layers, 5) + 1));
        CHECK(active.end_step(chain.network, balanced, {}));
    }
}

TEST_CASE("layers as needed: a vertex beyond the capacity keeps a turn", "[active]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    for (Index most = 1; most <= 600; most += 7) {
        CAPTURE(most);
        const Options options{.layers = unlimited,
                              .adaptive_layers = true,
                              .sweeps = 1,
                              .contact_iterations = 1,
                              .max_vertex_updates = most};
        ActiveVertices active(162);
        std::set<Index> seen;
        for (int i = 0; i < 2000 && seen.size() < 162; ++i) {
            active.begin_step(network, List{3}, options);
            while (!active.frontier().empty()) active.grow(network, options);
            REQUIRE(static_cast<Index>(active.vertices().size()) <= 1 + std::max((most - 2) / 4, 1));
            seen.insert(active.vertices().begin(), active.vertices().end());
            REQUIRE_FALSE(active.end_step(
                network, [&](Index v) { return i > 0 && v != 3; }, active.vertices()));
        }
        if (most >= 30) REQUIRE(seen.size() == 162);
    }
}

TEST_CASE("with little capacity layer 0 comes first, and those awake keep a turn", "[active]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
        ActiveVertices active(162);
        List seeds;
        for (Index n = 1 + random.index(3); n > 0; --n) seeds.push_back(random.index(162));
        const std::set<Index> layer0(seeds.begin(), seeds.end());
        const Options options{
            .layers = unlimited, .sweeps = 1 + random.index(6), .max_vertex_updates = 1 + random.index(1000)};
        const Index own = static_cast<Index>(layer0.size()) * (options.sweeps * options.contact_iterations + 1);
        const Index spare = std::max((options.max_vertex_updates - own) / (options.sweeps + 1), 1);
        const std::size_t capacity = layer0.size() + static_cast<std::size_t>(spare);
        active.begin_step(network, seeds, options);
        (void)active.end_step(network, unbalanced, {});
        std::set<Index> left;
        while (left.size() < 20) left.insert(random.index(162));
        for (const Index v : left) active.wake(v);

        std::set<Index> seen;
        for (int i = 0; i < 200; ++i) {
            active.begin_step(network, seeds, options);
            REQUIRE(active.vertices().size() <= capacity);
            REQUIRE(active.vertices().size() >= std::min(capacity - capacity / 4, std::size_t(162)));
            REQUIRE(active.contact_layer().size() == layer0.size());
            const auto updated = list_of(active.vertices());
            REQUIRE(std::set<Index>(updated.begin(), updated.end()).size() == updated.size());
            for (const Index v : active.contact_layer()) REQUIRE(layer0.count(v) == 1);
            seen.insert(updated.begin(), updated.end());
            REQUIRE_FALSE(active.end_step(network, unbalanced, {}));
        }
        for (const Index v : left) REQUIRE(seen.count(v) == 1);
    }
}

TEST_CASE("to wake what is no vertex is ignored", "[active][bad]") {
    for (const Index v : {12, -1, 11}) CHECK(test::in_child([&] { ActiveVertices(12).wake(v); }).signal == 0);
}
