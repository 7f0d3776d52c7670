// SPDX-License-Identifier: MIT
#include <membrane/contact/tree_topology.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// The triangles below node `i`.
std::set<Index> below(const TreeTopology& shape, Index i) {
    const auto& node = shape.nodes[at(i)];
    if (node.is_leaf()) {
        const auto begin = shape.triangles.begin() + node.first;
        return {begin, begin + node.count};
    }
    auto all = below(shape, node.first);
    all.merge(below(shape, node.first + 1));
    return all;
}

/// What [Liu07] 2.3 and the text of `tree_shape` make of one set: the triangles of the left part.
template <class S>
std::set<Index> expected_left(const TriangleMesh<S>& mesh, const std::set<Index>& set, bool evenly) {
    const auto corners = [&](Index f) { return triangle_at(mesh.positions(), mesh.triangles().col(f)); };
    const auto centroid = [&](Index f) { return Vector3<S>((corners(f).a + corners(f).b + corners(f).c) / 3); };
    Vector3<S> low = corners(*set.begin()).a, high = low;
    for (const Index f : set) {
        const auto t = corners(f);
        low = low.cwiseMin(t.a).cwiseMin(t.b).cwiseMin(t.c);
        high = high.cwiseMax(t.a).cwiseMax(t.b).cwiseMax(t.c);
    }
    int axis = 0;
    (high - low).eigen().maxCoeff(&axis);
    std::set<Index> left;
    const S middle = (low[axis] + high[axis]) / 2;
    for (const Index f : set) {
        if (centroid(f)[axis] < middle) left.insert(f);
    }
    if (!evenly && !left.empty() && left.size() < set.size()) return left;
    std::vector<Index> order(set.begin(), set.end());
    std::stable_sort(order.begin(), order.end(),
                     [&](Index f, Index g) { return centroid(f)[axis] < centroid(g)[axis]; });
    return {order.begin(), order.begin() + static_cast<std::ptrdiff_t>(order.size() / 2)};
}

/// Everything that `tree_shape` promises.
template <class S>
void check_rule(const TriangleMesh<S>& mesh, Index threshold) {
    CAPTURE(threshold);
    const TreeTopology shape = tree_shape(mesh, threshold);
    CHECK(below(shape, 0).size() == at(mesh.triangle_count()));
    CHECK(shape.triangles.size() == at(mesh.triangle_count()));
    CHECK(shape.nodes[0].parent == no_index);
    std::vector<Index> depth(shape.nodes.size(), 0);
    Index next_child = 1, next_triangle = 0;
    std::vector<Index> leaf_firsts;
    for (Index i = 0; i < static_cast<Index>(shape.nodes.size()); ++i) {
        const auto& node = shape.nodes[at(i)];
        const auto set = below(shape, i);
        if (node.is_leaf()) {
            leaf_firsts.push_back(node.first);
            const auto begin = shape.triangles.begin() + node.first;
            CHECK(std::is_sorted(begin, begin + node.count));
            const bool shared_out = i > 0 && below(shape, node.parent).size() < at(threshold);
            CHECK((set.size() == 1 || shared_out));
            next_triangle += node.count;
            continue;
        }
        REQUIRE(node.first > i);
        next_child += 2;
        for (const Index child : {node.first, node.first + 1}) {
            CHECK(shape.nodes[at(child)].parent == i);
            depth[at(child)] = depth[at(i)] + 1;
        }
        const bool shared_out = set.size() < at(threshold);
        CHECK(below(shape, node.first) == expected_left(mesh, set, shared_out || depth[at(i)] >= 32));
        if (shared_out) CHECK((shape.nodes[at(node.first)].is_leaf() && shape.nodes[at(node.first + 1)].is_leaf()));
    }
    CHECK(next_child == static_cast<Index>(shape.nodes.size()));
    CHECK(next_triangle == mesh.triangle_count());
    const auto tree = statistics(shape);
    CHECK(tree.depth == *std::max_element(depth.begin(), depth.end()));
    CHECK(tree.depth <= TreeTopology::max_depth);
    CHECK(tree.nodes == 2 * tree.leaves - 1);
    CHECK(tree.leaves == static_cast<Index>(leaf_firsts.size()));
    CHECK(tree.mean_leaf * tree.leaves == Approx(mesh.triangle_count()));
}

/// `count` triangles beside each other, each with vertices of its own; triangle f is `place(f)`.
template <class Place>
TriangleMesh<double> separate(Index count, Place place) {
    Points<double> x(3, 3 * count);
    Triangles triangles(3, count);
    for (Index f = 0; f < count; ++f) {
        const Triangle<double> t = place(f);
        x.col(3 * f) = t.a;
        x.col(3 * f + 1) = t.b;
        x.col(3 * f + 2) = t.c;
        triangles.col(f) << 3 * f, 3 * f + 1, 3 * f + 2;
    }
    return {x, triangles};
}

}  // namespace

TEMPLATE_TEST_CASE("sets are split at the middle, or shared out evenly", "[tree_topology]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::with_holes(test::random_surface<S>(random), random).mesh();
        for (const Index threshold : {1, 2, 3, 4, 7, 16, 64, 1000}) check_rule(mesh, threshold);
    }
}

TEST_CASE("a set below the threshold becomes two leaves of half the size", "[tree_topology]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});  // 20 triangles
    const auto whole = statistics(tree_shape(mesh, 21));
    CHECK(whole.nodes == 3);
    CHECK(whole.leaves == 2);
    CHECK(whole.depth == 1);
    CHECK(whole.smallest_leaf == 10);
    CHECK(whole.largest_leaf == 10);
    CHECK(whole.mean_leaf == 10);
    CHECK(statistics(tree_shape(mesh, 20)).depth > 1);  // 20 is not fewer than 20
    CHECK(statistics(tree_shape(mesh, unlimited)).leaves == 2);
    const auto single = statistics(tree_shape(mesh, 1));
    CHECK(single.leaves == 20);
    CHECK(single.largest_leaf == 1);

    const auto odd = separate(7, [](Index f) {
        const double x = f;
        return Triangle<double>{{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}};
    });
    const auto halves = statistics(tree_shape(odd, 8));
    CHECK(halves.smallest_leaf == 3);
    CHECK(halves.largest_leaf == 4);

    const auto one = separate(1, [](Index) { return Triangle<double>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}; });
    const auto alone = statistics(tree_shape(one, 16));
    CHECK(alone.nodes == 1);
    CHECK(alone.leaves == 1);
    CHECK(alone.depth == 0);
    CHECK(alone.mean_leaf == 1);
}

TEST_CASE("triangles that lie all in one place are halved", "[tree_topology]") {
    const Triangle<double> same{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    check_rule(separate(37, [&](Index) { return same; }), 1);
    check_rule(separate(37, [&](Index) { return same; }), 8);
    const auto many = separate(100'000, [&](Index) { return same; });
    CHECK(statistics(tree_shape(many, 1)).depth == 17);
    CHECK(statistics(tree_shape(many, 16)).depth == 14);
}

TEST_CASE("no spacing of the triangles makes the tree too deep", "[tree_topology]") {
    const auto spaced = [](Index count, double ratio) {  // each split by position takes away a few triangles only
        return separate(count, [=](Index f) {
            const double x = std::pow(ratio, f);
            return Triangle<double>{{x, 0, 0}, {x * (1 + 1e-3), 0, 0}, {x, 1e-3 * x, 0}};
        });
    };
    check_rule(spaced(120, 0.5), 1);
    check_rule(spaced(120, 0.5), 16);
    const auto halved = statistics(tree_shape(spaced(900, 0.5), 1));
    CHECK(halved.depth > 32);
    CHECK(halved.depth <= 32 + 10);
    const auto slower = statistics(tree_shape(spaced(100'000, 0.999), 1));
    CHECK(slower.depth <= TreeTopology::max_depth);
    CHECK(slower.leaves == 100'000);
}

TEST_CASE("the numbers of the vertices do not matter", "[tree_topology]") {
    Random random(5);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const auto number = test::random_order(mesh.vertex_count(), random);
    Points<double> x(3, mesh.vertex_count());
    for (Index v = 0; v < mesh.vertex_count(); ++v) x.col(number[at(v)]) = mesh.positions().col(v);
    const Triangles triangles = mesh.triangles().unaryExpr([&](Index v) { return number[at(v)]; });
    const auto shape = tree_shape(mesh, 8), same = tree_shape(TriangleMesh(x, triangles), 8);
    CHECK(shape.triangles == same.triangles);
    REQUIRE(shape.nodes.size() == same.nodes.size());
    for (std::size_t i = 0; i < shape.nodes.size(); ++i) {
        CHECK(shape.nodes[i].first == same.nodes[i].first);
        CHECK(shape.nodes[i].count == same.nodes[i].count);
    }
}

TEST_CASE("a threshold below 1 is refused", "[tree_topology][bad]") {
    const auto mesh = icosphere({.subdivisions = 0});
    CHECK(test::refusal([&] { (void)tree_shape(mesh, 0); }) == "AabbTree: balance_threshold must be at least 1, got 0");
    CHECK(test::refusal([&] { (void)tree_shape(mesh, -7); }) ==
          "AabbTree: balance_threshold must be at least 1, got -7");
}

namespace {

/// Everything that `folded` promises.
template <std::size_t width>
void check_folded(const TreeTopology& shape) {
    const auto wide = folded<width>(shape);
    REQUIRE(wide.children.size() == wide.nodes.size());
    REQUIRE(wide.nodes[0] == 0);
    std::set<Index> kept(wide.nodes.begin(), wide.nodes.end()), named;
    CHECK(kept.size() == wide.nodes.size());
    for (std::size_t n = 0; n < wide.nodes.size(); ++n) {
        const auto& children = wide.children[n];
        const auto end = std::find(children.begin(), children.end(), no_index);
        CHECK(std::all_of(end, children.end(), [](Index i) { return i == no_index; }));
        std::set<Index> triangles;
        bool only_leaves = true;
        for (auto child = children.begin(); child != end; ++child) {
            CHECK(named.insert(*child).second);
            auto of_child = below(shape, *child);
            triangles.merge(of_child);
            CHECK(of_child.empty());  // no triangle is below two of them
            if (shape.nodes[at(*child)].is_leaf()) continue;
            only_leaves = false;
            const auto place = std::find(wide.nodes.begin(), wide.nodes.end(), *child);
            CHECK(place > wide.nodes.begin() + static_cast<std::ptrdiff_t>(n));
            CHECK(place != wide.nodes.end());
        }
        CHECK(triangles == below(shape, wide.nodes[n]));
        if (end != children.end()) CHECK(only_leaves);  // there is a free slot only where nothing more can be folded in
    }
    for (std::size_t i = 0; i < shape.nodes.size(); ++i) {
        if (shape.nodes[i].is_leaf()) CHECK(named.count(static_cast<Index>(i)) == 1);
    }
}

}  // namespace

TEST_CASE("a folded tree has the same leaves, each below the same triangles' nodes", "[tree]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto shape = tree_shape(test::random_surface<double>(random).mesh(), 1 + random.index(20));
        check_folded<2>(shape);
        check_folded<4>(shape);
        check_folded<8>(shape);
    }
}
