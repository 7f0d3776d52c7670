// SPDX-License-Identifier: MIT
#include <membrane/contact/aabb_tree.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/traps.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
Aabb<S> box_of(const TriangleMesh<S>& mesh, Index f) {
    return bounds(triangle_at(mesh.positions(), mesh.triangles().col(f)));
}

}  // namespace

TEMPLATE_TEST_CASE("a search examines the triangles whose key is below the limit", "[tree]", float, double) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const AabbTree<S> tree(mesh, {.balance_threshold = 1 + random.index(20)});
        const Vector3<S> q = point(mesh.positions(), random.index(mesh.vertex_count())) + random.vector<S>();
        const auto key = [&]<Number N>(const Aabb<N>& box) { return squared_distance(box, q); };
        std::vector<S> keys;
        for (Index f = 0; f < mesh.triangle_count(); ++f) keys.push_back(key(box_of(mesh, f)));
        const S limit =
            keys[static_cast<std::size_t>(random.index(mesh.triangle_count()))];  // one is at the limit: not below

        std::vector<Index> found, expected;
        const Index visited = tree.search(mesh.positions(), key, limit, [&](Index f, const Triangle<S>& triangle) {
            found.push_back(f);
            CHECK(triangle.a == point(mesh.positions(), mesh.triangles()(0, f)));
            CHECK(triangle.c == point(mesh.positions(), mesh.triangles()(2, f)));
        });
        std::sort(found.begin(), found.end());
        for (Index f = 0; f < mesh.triangle_count(); ++f) {
            if (keys[static_cast<std::size_t>(f)] < limit) expected.push_back(f);
        }
        CHECK(found == expected);
        CHECK((visited >= 1 && visited <= tree.statistics().nodes + 1));  // a root that is a leaf, twice
    }
}

TEMPLATE_TEST_CASE("a limit that is lowered ends with the least key, soon", "[tree]", float, double) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 4});
    const AabbTree<S> tree(mesh);
    for (int seed = 1; seed <= cases(500); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<S> q = random.vector<S>(-2, 2);
        const auto key = [&]<Number N>(const Aabb<N>& box) { return squared_distance(box, q); };
        S least = (std::numeric_limits<S>::max)(), expected = least;
        int examined = 0;
        (void)tree.search(mesh.positions(), key, least, [&](Index f, const Triangle<S>& triangle) {
            CHECK(key(bounds(triangle)) == key(box_of(mesh, f)));
            least = (std::min)(least, key(bounds(triangle)));
            ++examined;
        });
        for (Index f = 0; f < mesh.triangle_count(); ++f) expected = (std::min)(expected, key(box_of(mesh, f)));
        CHECK(least == expected);
        CHECK(examined <= mesh.triangle_count() / 10);
    }
}

TEMPLATE_TEST_CASE("a query may have its own key of triangles", "[tree]", float, double) {
    using S = TestType;
    struct Key {
        Lanes<S> operator()(const Aabb<Lanes<S>>&) const { return 0; }
        S operator()(const Aabb<S>&) const { return 0; }
        Lanes<S> operator()(const Triangle<Lanes<S>>& triangles) const {
            return select(triangles.a[2] > 0, Lanes<S>(0), Lanes<S>(1));
        }
    };
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
    const AabbTree<S> tree(mesh);
    std::set<Index> found, expected;
    (void)tree.search(mesh.positions(), Key{}, S(1), [&](Index f, const auto&) { found.insert(f); });
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        if (mesh.positions()(2, mesh.triangles()(0, f)) > 0) expected.insert(f);
    }
    CHECK(found == expected);
}

// Nodes that are not full have places without a child.
TEMPLATE_TEST_CASE("no key is computed from numbers that are NaN", "[tree][bad-input]", float, double) {
    using S = TestType;
    const S far = std::sqrt((std::numeric_limits<S>::max)()) / 100;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        AabbTree<S> tree(mesh, {.balance_threshold = 1 + random.index(20)});
        Points<S> x = mesh.positions().array() + far;
        Index examined = 0;
        const test::FloatingPointTraps traps;
        tree.refit(x);
        const Vector3<S> q = point(x, 0) - Vector3<S>::Constant(far / 2);
        const auto key = [&]<Number N>(const Aabb<N>& box) { return squared_distance(box, q); };
        (void)tree.search(x, key, (std::numeric_limits<S>::max)(), [&](Index, const auto&) { ++examined; });
        CHECK(examined == mesh.triangle_count());
    }
}
