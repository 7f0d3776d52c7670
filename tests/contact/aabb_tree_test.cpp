// SPDX-License-Identifier: MIT
#include <membrane/contact/aabb_tree.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <type_traits>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/cgal.hpp"
#include "support/exact_crossing.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"
#include "support/tears.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

using Long = long double;

constexpr std::array<Index, 12> thresholds{1, 2, 3, 4, 5, 8, 11, 16, 24, 33, 48, 64};

template <class S>
test::Vector<Long> exact(const Vector3<S>& p) {
    return p.eigen().template cast<Long>();
}

/// A surface on the move, and a tree that follows it.
template <class S>
struct Scene {
    TriangleMesh<S> mesh;
    AabbTree<S> tree;
    Points<S> x;
    S size;
    std::vector<Index> moved;

    Scene(const TriangleMesh<S>& of, Index threshold) : mesh(of), tree(mesh, {threshold}), x(mesh.positions()) {
        size = (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).maxCoeff();
    }
    Triangle<S> triangle(Index f) const { return triangle_at(x, mesh.triangles().col(f)); }

    /// Pushes a few vertices, or all, and refits in one of the possible forms.
    void deform(Random& random) {
        const bool all = random.chance(0.2);
        moved.clear();
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (all || random.chance(0.1)) moved.push_back(v);
        }
        for (const Index v : moved) x.col(v) += size * random.vector<S>(S(-0.05), S(0.05));
        if (random.chance(0.5))
            tree.refit(x);
        else
            tree.refit(x, moved);
    }

    /// Near the surface, on it, on a vertex, inside, far away.
    Vector3<S> query(Random& random) const {
        const Vector3<S> on = point_at(triangle(random.index(mesh.triangle_count())), random.barycentric<S>());
        switch (random.index(5)) {
            case 0: return on;
            case 1: return point(x, random.index(mesh.vertex_count()));
            case 2: return on + size * random.vector<S>(-3, 3);
            default: return on + size * random.vector<S>(S(-0.1), S(0.1));
        }
    }
    /// Near the surface or far away, but not so near that roundings decide.
    Vector3<S> query_beside(Random& random) const { return query(random) + size * random.vector<S>(S(-0.2), S(0.2)); }

    /// How far roundings may move the nearest point of a triangle, over epsilon: the longest edge squared over the
    /// height.
    double sensitivity(Index f) const {
        const auto t = triangle(f);
        const double longest = std::max({norm<S>(t.b - t.a), norm<S>(t.c - t.b), norm<S>(t.a - t.c)});
        const double aspect = longest * longest / (2 * static_cast<double>(norm(area_vector(t))));
        return longest * std::min(aspect, 1 / std::sqrt(static_cast<double>(std::numeric_limits<S>::epsilon())));
    }

    /// How far roundings may decide whether something near `q` touches triangle `f` [m].
    Long rounding(Index f, const Vector3<S>& q) const {
        return 16 * std::numeric_limits<S>::epsilon() *
               (static_cast<Long>(scale(q)) + static_cast<Long>(sensitivity(f)));
    }
    test::BruteTriangle<Long> exact_triangle(Index f) const { return test::brute_triangle<Long>(triangle(f)); }

    S scale(const Vector3<S>& q) const { return x.cwiseAbs().maxCoeff() + norm(q) + size; }
};

template <class S>
Scene<S> random_scene(Random& random) {
    const auto surface = test::random_surface<S>(random);
    return {surface.mesh(), thresholds[static_cast<std::size_t>(random.index(thresholds.size()))]};
}

template <class S>
bool same_boxes(const AabbTree<S>& a, const AabbTree<S>& b) {
    for (Index i = 0; i < a.statistics().nodes; ++i) {
        if (!same_bits(a.box(i).low, b.box(i).low) || !same_bits(a.box(i).high, b.box(i).high)) return false;
    }
    return a.statistics().nodes == b.statistics().nodes;
}

/// The triangles a query reports, ascending, each once.
template <class Query>
std::vector<Index> visited(Query query) {
    std::vector<Index> found;
    query([&](Index f) { found.push_back(f); });
    std::sort(found.begin(), found.end());
    CHECK(std::adjacent_find(found.begin(), found.end()) == found.end());
    return found;
}

/// Fails unless both lists have the same triangles, but for those of which roundings decide.
template <class IsClose>
void compare(const std::vector<Index>& found, const std::vector<Index>& expected, IsClose is_close) {
    if (found == expected) return;
    std::vector<Index> differ;
    std::set_symmetric_difference(found.begin(), found.end(), expected.begin(), expected.end(),
                                  std::back_inserter(differ));
    for (const Index f : differ) {
        if (!is_close(f)) FAIL_CHECK(found.size() << " instead of " << expected.size() << ", by triangle " << f);
    }
}

template <class S>
constexpr bool online = [](AabbTree<S>* tree, const AabbTree<S>* const_tree, const ConstPointsRef<S>* x,
                           const Vector3<S>* p, std::span<const Index>* moved, void (*visit)(Index)) {
    return std::min({FollowsSplit<AabbTree<S>>, noexcept(tree->refit(*x)), noexcept(tree->refit(*x, *moved)),
                     noexcept(const_tree->closest_point(*x, *p)), noexcept(const_tree->first_hit(*x, *p, *p)),
                     noexcept(const_tree->overlap_sphere(*x, *p, S(1), visit)),
                     noexcept(const_tree->overlap_box(*x, *p, *p, visit)),
                     noexcept(const_tree->overlap_capsule(*x, *p, *p, S(1), visit))});
}(nullptr, nullptr, nullptr, nullptr, nullptr, nullptr);
static_assert(online<float> && online<double>);

/// Calls `query(scene, random, i)` so many times in each of so many scenes, once deformed.
template <class S, class Query>
void for_each_query(int scenes, int queries, Query query) {
    for (int seed = 1; seed <= scenes; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto scene = random_scene<S>(random);
        scene.deform(random);
        for (int i = 0; i < queries; ++i) query(scene, random, i);
    }
}

/// So many queries in each of so many rounds; in the long run in ten times as many scenes.
template <class S>
void compare_closest_points(int scenes, int rounds, int queries) {
    for (int seed = 1; seed <= cases(scenes, 10 * scenes); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto scene = random_scene<S>(random);
        for (int round = 0; round < rounds; ++round) {
            scene.deform(random);
            for (int i = 0; i < queries; ++i) {
                const auto q = scene.query(random);
                const auto found = scene.tree.closest_point(scene.x, q);
                const double distance = std::sqrt(static_cast<double>(found.squared_distance));
                const double least = std::sqrt(test::squared_distance_to_all(
                    scene.x, scene.mesh.triangles(), test::Vector<double>(q.template cast<double>())));
                const double slack =
                    std::numeric_limits<S>::epsilon() * (16.0 * scene.scale(q) + scene.sensitivity(found.triangle));
                if (!(std::abs(distance - least) <= slack)) FAIL_CHECK(distance << " instead of " << least);
                const auto there = closest_point(scene.triangle(found.triangle), q);
                if (there.point != found.point || there.barycentric != found.barycentric) FAIL_CHECK("another point");
            }
        }
    }
}

}  // namespace

// A million times in the long run.
TEST_CASE("the nearest point is as near as the nearest of all triangles", "[tree]") {
    compare_closest_points<double>(200, 5, 100);
}

TEST_CASE("the same in single precision", "[tree]") { compare_closest_points<float>(40, 5, 100); }

TEMPLATE_TEST_CASE("a sphere touches the triangles that are near enough", "[tree]", TEST_SCALARS) {
    using S = TestType;
    int touching = 0;
    for_each_query<S>(cases(1000), 20, [&](const Scene<S>& scene, Random& random, int) {
        const auto q = scene.query(random);
        const S radius = scene.size * random.number<S>(0, S(0.4));
        const auto found = visited([&](auto visit) { scene.tree.overlap_sphere(scene.x, q, radius, visit); });
        const auto expected = test::all_that<S>(scene.x, scene.mesh.triangles(), [&](const auto& t) {
            return test::squared_distance<S>(t, q) <= radius * radius;
        });
        compare(found, expected, [&](Index f) {
            const Long distance = std::sqrt(test::squared_distance_by_search(scene.exact_triangle(f), exact(q)));
            return std::abs(distance - Long(radius)) <= scene.rounding(f, q);
        });
        touching += static_cast<int>(found.size());
    });
    CHECK(touching > cases(100'000));
}

TEMPLATE_TEST_CASE("a box touches the triangles that it leaves something of", "[tree]", TEST_SCALARS) {
    using S = TestType;
    int touching = 0;
    for_each_query<S>(cases(400), 10, [&](const Scene<S>& scene, Random& random, int) {
        const auto low = scene.query_beside(random);
        const Vector3<S> high = low + scene.size * random.vector<S>(0, S(0.6));
        const auto found = visited([&](auto visit) { scene.tree.overlap_box(scene.x, low, high, visit); });
        const auto expected = test::all_that<Long>(
            scene.x, scene.mesh.triangles(), [&](const auto& t) { return test::meet_box(t, exact(low), exact(high)); });
        compare(found, expected, [&](Index f) {
            const auto t = scene.exact_triangle(f);
            const auto meets_box_grown = [&](Long by) {
                return test::meet_box<Long>(t, exact(low).array() - by, exact(high).array() + by);
            };
            return meets_box_grown(scene.rounding(f, high)) && !meets_box_grown(-scene.rounding(f, high));
        });
        touching += static_cast<int>(found.size());
    });
    CHECK(touching > cases(10'000));
}

TEMPLATE_TEST_CASE("a capsule touches the triangles that are near enough to its axis", "[tree]", TEST_SCALARS) {
    using S = TestType;
    int touching = 0;
    for_each_query<S>(cases(40), 4, [&](const Scene<S>& scene, Random& random, int i) {
        const auto p = scene.query(random), q = i == 0 ? p : scene.query(random);
        const S radius = scene.size * random.number<S>(S(0.001), S(0.2));
        const auto found = visited([&](auto visit) { scene.tree.overlap_capsule(scene.x, p, q, radius, visit); });
        const auto expected = test::all_that<Long>(scene.x, scene.mesh.triangles(), [&](const auto& t) {
            return std::sqrt(test::squared_distance_by_search(t, exact(p), exact(q))) <= Long(radius);
        });
        compare(found, expected, [&](Index f) {
            const auto t = scene.exact_triangle(f);
            const Long distance = std::sqrt(test::squared_distance_by_search(t, exact(p), exact(q)));
            return std::abs(distance - Long(radius)) <= scene.rounding(f, p) + scene.rounding(f, q);
        });
        touching += static_cast<int>(found.size());
    });
    CHECK(touching > cases(200));
}

TEMPLATE_TEST_CASE("a segment first hits what no other triangle is before", "[tree]", TEST_SCALARS) {
    using S = TestType;
    int hits = 0;
    for_each_query<S>(cases(1000), 20, [&](const Scene<S>& scene, Random& random, int) {
        const Vector3<S> from = scene.query_beside(random), to = from + 2 * (scene.query_beside(random) - from);
        const auto hit = scene.tree.first_hit(scene.x, from, to);
        const auto all = test::all_that<Long>(scene.x, scene.mesh.triangles(),
                                              [&](const auto& t) { return test::meet(t, exact(from), exact(to)); });
        if (hit.triangle == no_index) {
            CHECK(hit.fraction == 1);
            if (!all.empty()) FAIL_CHECK(all.size() << " are hit");
            return;
        }
        ++hits;
        const auto triangle = scene.triangle(hit.triangle);
        if (!test::ExactCrossing(triangle, from, to).may_hit_at(hit.fraction)) FAIL_CHECK(hit.triangle << " is missed");
        for (const Index f : all) {
            if (test::ExactCrossing(scene.triangle(f), from, to).is_before(hit.fraction)) FAIL_CHECK(f << " is before");
        }
        // The weights are those of the nearest point of the triangle.
        const auto at = from + hit.fraction * (to - from);
        const Long distance =
            std::sqrt(test::squared_distance_by_search(scene.exact_triangle(hit.triangle), exact(at)));
        const Long there = (exact(point_at(triangle, hit.barycentric)) - exact(at)).norm();
        if (!(there - distance <= scene.rounding(hit.triangle, at))) FAIL_CHECK(there << ", not " << distance);
    });
    CHECK(hits > cases(5000));
}

TEMPLATE_TEST_CASE("what touches only just, touches", "[tree]", TEST_SCALARS) {
    using S = TestType;
    // Squares of side 1; vertex v at (v % 9 - 4, v / 9 - 4), each inner one with six triangles.
    const auto mesh = sheet<S>({.width = 8, .height = 8, .columns = 8, .rows = 8});
    const auto& x = mesh.positions();
    for (const Index threshold : thresholds) {
        CAPTURE(threshold);
        const AabbTree<S> tree(mesh, {.balance_threshold = threshold});
        const auto around = [&](const Vector3<S>& corner) {
            return test::all_that<S>(x, mesh.triangles(),
                                     [&](const auto& t) { return t.a == corner || t.b == corner || t.c == corner; });
        };
        const Vector3<S> corner(1, -2, 0), above(1, -2, 3), below(1, -2, -1);
        const auto six = around(corner);
        REQUIRE(six.size() == 6);
        const auto hit = tree.first_hit(x, above, below);
        CHECK(hit.triangle == six.front());
        CHECK(hit.fraction == S(0.75));
        CHECK(hit.barycentric.maxCoeff() == 1);
        CHECK(tree.first_hit(x, above, corner).triangle == six.front());
        CHECK(tree.first_hit(x, corner, above).triangle == six.front());
        CHECK(tree.first_hit(x, corner, corner).triangle == six.front());
        CHECK(tree.first_hit(x, above, Vector3<S>(1, -2, S(1e-3))).triangle == no_index);

        CHECK(visited([&](auto visit) { tree.overlap_sphere(x, corner, S(0), visit); }) == six);
        CHECK(visited([&](auto visit) { tree.overlap_sphere(x, above, S(3), visit); }) == six);
        CHECK(visited([&](auto visit) { tree.overlap_sphere(x, above, S(2.999), visit); }).empty());
        CHECK(visited([&](auto visit) { tree.overlap_box(x, corner, above, visit); }) == six);
        CHECK(visited([&](auto visit) { tree.overlap_box(x, corner, corner, visit); }) == six);
        CHECK(visited([&](auto visit) { tree.overlap_capsule(x, above, corner, S(0), visit); }) == six);
        CHECK(visited([&](auto visit) { tree.overlap_capsule(x, above, Vector3<S>(1, -2, 1), S(1), visit); }) == six);

        // In the plane: from outside it enters at the border, from inside it hits at once.
        const auto border = tree.first_hit(x, Vector3<S>(-8, S(0.5), 0), Vector3<S>(8, S(0.5), 0));
        CHECK(border.fraction == Approx(0.25));
        CHECK(tree.first_hit(x, Vector3<S>(S(0.3), S(0.1), 0), Vector3<S>(8, 0, 0)).fraction == 0);
        CHECK(tree.first_hit(x, Vector3<S>(5, 5, 0), Vector3<S>(5, -5, 0)).triangle == no_index);
        CHECK(tree.closest_point(x, corner).squared_distance == 0);
        CHECK(tree.closest_point(x, above).squared_distance == 9);
        CHECK(tree.closest_point(x, above).barycentric.maxCoeff() == 1);
    }
}

TEMPLATE_TEST_CASE("a refit of what moved gives the bits of a refit of all", "[tree]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto scene = random_scene<S>(random);
        auto fresh = scene.tree;
        for (int round = 0; round < 20; ++round) {
            std::vector<Index> moved;
            const double part = std::array{0.0, 0.01, 0.1, 0.4, 0.7, 1.0}[static_cast<std::size_t>(random.index(6))];
            for (Index v = 0; v < scene.mesh.vertex_count(); ++v) {
                if (!random.chance(part)) continue;
                moved.push_back(v);
                if (random.chance(0.2)) moved.push_back(v);  // twice
                scene.x.col(v) += scene.size * random.vector<S>(S(-0.1), S(0.1));
                if (random.chance(0.1)) scene.x(random.index(3), v) = random.chance(0.5) ? S(0) : -S(0);
            }
            std::shuffle(moved.begin(), moved.end(), random.engine());
            scene.tree.refit(scene.x, moved);
            fresh.refit(scene.x);
            REQUIRE(same_boxes(scene.tree, fresh));
            const auto q = scene.query(random);
            CHECK(scene.tree.closest_point(scene.x, q).nodes_visited == fresh.closest_point(scene.x, q).nodes_visited);
        }
        for (Index v = 0; v < scene.mesh.vertex_count(); ++v) {  // each alone
            scene.x.col(v) += scene.size * random.vector<S>(S(-0.1), S(0.1));
            scene.tree.refit(scene.x, std::array{v});
        }
        fresh.refit(scene.x);
        CHECK(same_boxes(scene.tree, fresh));
    }
}

TEMPLATE_TEST_CASE("after random tears a tree equals one that is built anew", "[tree][tear]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<S> surface(test::random_surface<S>(random), 4 + random.index(60));
        const Index threshold = thresholds[static_cast<std::size_t>(random.index(thresholds.size()))];
        Scene<S> torn(surface.mesh(), threshold);
        const auto follow = [&](const VertexSplit& split) {
            torn.tree.split(split);
            torn.x.col(split.copy) = torn.x.col(split.vertex);
        };
        while (surface.tear(random, follow)) {
            Scene<S> fresh(surface.mesh(), threshold);
            torn.moved.clear();
            for (Index v = 0; v < surface.used(); ++v) {
                if (!random.chance(0.2)) continue;
                if (random.chance(0.8)) {
                    torn.moved.push_back(v);
                } else {
                    torn.tree.reshape({.vertex = v});  // by the tear: no step has moved it
                }
                torn.x.col(v) += torn.size * random.vector<S>(S(-0.1), S(0.1));
            }
            fresh.x = torn.x;
            fresh.tree.refit(fresh.x);
            torn.tree.refit(torn.x, torn.moved);
            REQUIRE(same_boxes(torn.tree, fresh.tree));
            torn.tree.refit(torn.x);
            REQUIRE(same_boxes(torn.tree, fresh.tree));
            for (int i = 0; i < 10; ++i) {
                const auto p = fresh.query(random), q = fresh.query_beside(random);
                const auto found = torn.tree.closest_point(torn.x, q), expected = fresh.tree.closest_point(fresh.x, q);
                REQUIRE(found.triangle == expected.triangle);
                REQUIRE(same_bits(found.point, expected.point));
                Long least = std::numeric_limits<Long>::infinity();
                for (Index f = 0; f < fresh.mesh.triangle_count(); ++f) {
                    least = std::min(least, test::squared_distance<Long>(fresh.exact_triangle(f), exact(q)));
                }
                REQUIRE(std::abs(std::sqrt(static_cast<Long>(found.squared_distance)) - std::sqrt(least)) <=
                        fresh.rounding(found.triangle, q));
                const auto hit = torn.tree.first_hit(torn.x, p, q), expected_hit = fresh.tree.first_hit(fresh.x, p, q);
                REQUIRE(hit.triangle == expected_hit.triangle);
                REQUIRE(hit.fraction == expected_hit.fraction);
                const S radius = torn.size * random.number<S>(0, S(0.3));
                REQUIRE(visited([&](auto visit) { torn.tree.overlap_capsule(torn.x, p, q, radius, visit); }) ==
                        visited([&](auto visit) { fresh.tree.overlap_capsule(fresh.x, p, q, radius, visit); }));
            }
        }
    }
}

TEST_CASE("a refit fits the vertices it is given, and nothing else", "[tree]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const AabbTree<double> before(mesh, {.balance_threshold = 4});
    auto tree = before;
    auto x = mesh.positions();
    x.col(7) *= 2;
    tree.refit(x, {});
    CHECK(same_boxes(tree, before));
    tree.refit(x, std::array{Index{8}});
    CHECK(tree.box(0).high == before.box(0).high);
    tree.refit(x, std::array{Index{7}});
    CHECK_FALSE(same_boxes(tree, before));
    CHECK(tree.box(0).low == x.rowwise().minCoeff());
    CHECK(tree.box(0).high == x.rowwise().maxCoeff());
}

TEST_CASE("copies give equal results, and are independent", "[tree]") {
    auto mesh = std::make_unique<TriangleMesh<double>>(icosphere({.radius = 1, .subdivisions = 2}));
    auto x = mesh->positions();
    auto original = std::make_unique<AabbTree<double>>(*mesh);
    mesh.reset();
    Random random(1);
    auto copy = *original;
    std::vector<Index> moved{3, 5, 8};
    for (const Index v : moved) x.col(v) *= 1.3;
    const auto moved_x = x;
    copy.refit(moved_x, moved);
    CHECK_FALSE(same_boxes(copy, *original));
    original->refit(moved_x, moved);
    CHECK(same_boxes(copy, *original));
    const auto queries = [&](const AabbTree<double>& tree) {
        Random same(7);
        std::vector<double> results;
        for (int i = 0; i < 100; ++i) {
            const auto q = same.vector<double>(-2, 2), p = same.vector<double>(-2, 2);
            const auto nearest = tree.closest_point(moved_x, q);
            const auto hit = tree.first_hit(moved_x, q, p);
            results.insert(results.end(),
                           {nearest.squared_distance, double(nearest.triangle), double(nearest.nodes_visited),
                            hit.fraction, double(hit.triangle), double(hit.nodes_visited)});
        }
        return results;
    };
    const auto expected = queries(*original);
    const auto elsewhere = std::move(*original);
    original.reset();
    CHECK(queries(copy) == expected);
    CHECK(queries(elsewhere) == expected);
    static_assert(std::is_nothrow_move_constructible_v<AabbTree<double>> &&
                  std::is_copy_assignable_v<AabbTree<double>>);
}

TEMPLATE_TEST_CASE("an engine's buffer is searched in place", "[tree]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 2});
    std::vector<S> buffer(static_cast<std::size_t>(8 * mesh.vertex_count()), S(99));
    Eigen::Map<Points<S>, 0, Eigen::OuterStride<>> x(buffer.data(), 3, mesh.vertex_count(), Eigen::OuterStride<>(8));
    x = mesh.positions();
    AabbTree<S> tree(mesh), same(mesh);
    tree.refit(x);
    CHECK(same_boxes(tree, same));
    const Vector3<S> q(S(0.3), S(1.2), S(-0.4));
    CHECK(tree.closest_point(x, q).point == same.closest_point(mesh.positions(), q).point);
    CHECK(tree.first_hit(x, q, -q).fraction == same.first_hit(mesh.positions(), q, -q).fraction);
}

TEST_CASE("each box holds those below it, the first the surface", "[tree]") {
    const auto mesh = spherical_cap({});
    for (const Index threshold : thresholds) {
        const AabbTree<double> tree(mesh, {.balance_threshold = threshold});
        const auto shape = tree_shape(mesh, threshold);
        const auto expected = statistics(shape);
        CHECK(tree.statistics().nodes == expected.nodes);
        CHECK(tree.statistics().depth == expected.depth);
        CHECK(tree.statistics().largest_leaf == expected.largest_leaf);
        for (Index i = 0; i < expected.nodes; ++i) {
            const auto& node = shape.nodes[static_cast<std::size_t>(i)];
            Aabb<double> around;
            for (Index k = 0; k < node.count; ++k) {
                const Index f = shape.triangles[static_cast<std::size_t>(node.first + k)];
                around.include(bounds(triangle_at(mesh.positions(), mesh.triangles().col(f))));
            }
            if (!node.is_leaf()) around = tree.box(node.first);
            if (!node.is_leaf()) around.include(tree.box(node.first + 1));
            CHECK(tree.box(i).low == around.low);
            CHECK(tree.box(i).high == around.high);
        }
    }
}

TEST_CASE("few boxes are visited near the surface", "[tree]") {
    Random random(1);
    double last = 0;
    for (Index subdivisions = 2; subdivisions <= 6; ++subdivisions) {
        const auto mesh = icosphere({.radius = 1, .subdivisions = subdivisions});
        const AabbTree<double> tree(mesh);
        double sum = 0;
        for (int i = 0; i < 1000; ++i) {
            const auto found = tree.closest_point(mesh.positions(), 1.01 * random.unit_vector());
            sum += found.nodes_visited;
        }
        CHECK(sum / 1000 < 100);
        CHECK(sum / 1000 < last + 25);  // for four times the triangles
        last = subdivisions == 2 ? sum / 1000 : std::max(last, sum / 1000);
        CHECK(tree.overlap_sphere(mesh.positions(), {9, 9, 9}, 1.0, [](Index) {}) == 1);
        CHECK(tree.first_hit(mesh.positions(), {9, 9, 9}, {9, 9, 8}).nodes_visited == 1);
    }
}

TEST_CASE("distances and intersections are those of CGAL's tree", "[tree][cgal]") {
    int hits = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto scene = random_scene<double>(random);
        scene.deform(random);
        const test::CgalTree cgal(scene.x, scene.mesh.triangles());
        for (int i = 0; i < 100; ++i) {
            const auto p = scene.query_beside(random), q = scene.query_beside(random);
            const auto nearest = scene.tree.closest_point(scene.x, p);
            CHECK(std::abs(std::sqrt(nearest.squared_distance) - cgal.distance(p)) <= 1e-13 * scene.scale(p));

            const bool hit = scene.tree.first_hit(scene.x, p, q).triangle != no_index;
            CHECK(hit == cgal.intersects(p, q));
            hits += hit ? 1 : 0;

            const Vector3<double> high = p + scene.size * random.vector<double>(0, 0.3);
            CHECK(visited([&](auto visit) { scene.tree.overlap_box(scene.x, p, high, visit); }).size() ==
                  cgal.count_in_box(p, high));
        }
    }
    CHECK(hits > cases(1000));
}

TEST_CASE("a tree as deep as can be gives the same results", "[tree]") {
    Points<double> x(3, 3 * 120);
    Triangles triangles(3, 120);
    for (Index f = 0; f < 120; ++f) {  // each half as large and half as far as the one before
        const double size = std::pow(0.5, f);
        x.col(3 * f) << size, 0, 0;
        x.col(3 * f + 1) << 1.2 * size, 0, 0.1 * size;
        x.col(3 * f + 2) << size, 0.2 * size, 0;
        triangles.col(f) << 3 * f, 3 * f + 1, 3 * f + 2;
    }
    const TriangleMesh<double> mesh(x, triangles);
    const AabbTree<double> tree(mesh, {.balance_threshold = 1});
    CHECK(tree.statistics().depth > 32);
    for (int seed = 1; seed <= 2000; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Vector3<double> q = std::pow(0.5, random.index(110)) * random.vector();
        const double least = test::squared_distance_to_all(x, triangles, q);
        CHECK(tree.closest_point(x, q).squared_distance == Approx(least).epsilon(1e-9));
        const double radius = 1.5 * std::sqrt(least);
        const auto near = test::all_that<double>(
            x, triangles, [&](const auto& t) { return test::squared_distance<double>(t, q) <= radius * radius; });
        CHECK(visited([&](auto visit) { tree.overlap_sphere(x, q, radius, visit); }) == near);
    }
}

TEST_CASE("a hundred thousand triangles in one place are no trouble", "[tree]") {
    Points<double> x(3, 300'000);
    Triangles triangles(3, 100'000);
    for (Index f = 0; f < 100'000; ++f) {
        x.middleCols(3 * f, 3) << 0, 1, 0,  //
            0, 0, 1,                        //
            0, 0, 0;
        triangles.col(f) << 3 * f, 3 * f + 1, 3 * f + 2;
    }
    const AabbTree<double> tree(TriangleMesh<double>(x, triangles));
    CHECK(tree.statistics().depth == 14);
    CHECK(tree.closest_point(x, {0.2, 0.2, 2}).squared_distance == 4);
    CHECK(tree.first_hit(x, {0.25, 0.25, 1}, {0.25, 0.25, -1}).triangle == 0);
    Index count = 0;
    tree.overlap_sphere(x, {0.2, 0.2, 1}, 1.0, [&](Index) { ++count; });
    CHECK(count == 100'000);
}

TEST_CASE("a single triangle is a tree", "[tree]") {
    const TriangleMesh<double> mesh(Points<double>::Identity(3, 3), Triangles{{0}, {1}, {2}});
    const AabbTree<double> tree(mesh);
    CHECK(tree.statistics().nodes == 1);
    CHECK(tree.closest_point(mesh.positions(), {1, 1, 1}).squared_distance == Approx(4.0 / 3));
    CHECK(tree.closest_point(mesh.positions(), {1, 1, 1}).nodes_visited == 2);  // around the surface, and the leaf
    CHECK(tree.first_hit(mesh.positions(), {0, 0, 0}, {1, 1, 1}).fraction == Approx(1.0 / 3));
}

TEST_CASE("a threshold below 1 is refused by name", "[tree][bad]") {
    const auto mesh = icosphere({.subdivisions = 0});
    CHECK(test::refusal([&] { AabbTree<double>(mesh, {.balance_threshold = 0}); }) ==
          "AabbTree: balance_threshold must be at least 1, got 0");
}

TEMPLATE_TEST_CASE("a query that makes no sense finds nothing", "[tree][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
    const auto& x = mesh.positions();
    const AabbTree<S> tree(mesh);
    const Vector3<S> good(0, 0, 2);
    const auto nothing = [&](auto query) {
        Index found = 0;
        const Index boxes = query([&](Index) { ++found; });
        return found == 0 && boxes == 0;
    };
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        for (int k = 0; k < 3; ++k) {
            Vector3<S> q = good;
            q[k] = bad;
            CAPTURE(q.transpose());
            const auto nearest = tree.closest_point(x, q);
            CHECK(nearest.triangle == no_index);
            CHECK(nearest.squared_distance == Limits::max());
            CHECK(nearest.nodes_visited == 0);
            CHECK(is_finite(nearest.point));
            for (const auto& hit : {tree.first_hit(x, q, good), tree.first_hit(x, good, q)}) {
                CHECK(hit.triangle == no_index);
                CHECK(hit.fraction == 1);
                CHECK(hit.nodes_visited == 0);
            }
            CHECK(nothing([&](auto visit) { return tree.overlap_sphere(x, q, S(9), visit); }));
            CHECK(nothing([&](auto visit) { return tree.overlap_box(x, q, good, visit); }));
            CHECK(nothing([&](auto visit) { return tree.overlap_box(x, -good, q, visit); }));
            CHECK(nothing([&](auto visit) { return tree.overlap_capsule(x, q, good, S(9), visit); }));
            CHECK(nothing([&](auto visit) { return tree.overlap_capsule(x, good, q, S(9), visit); }));
        }
        CHECK(nothing([&](auto visit) { return tree.overlap_sphere(x, good, bad, visit); }));
        CHECK(nothing([&](auto visit) { return tree.overlap_capsule(x, good, -good, bad, visit); }));
    }
    CHECK(nothing([&](auto visit) { return tree.overlap_sphere(x, good, S(-9), visit); }));
    CHECK(nothing([&](auto visit) { return tree.overlap_capsule(x, good, -good, S(-9), visit); }));
    CHECK(nothing([&](auto visit) { return tree.overlap_box(x, good, Vector3<S>(-good), visit); }));

    // Finite, but nothing that can be squared.
    const Vector3<S> far = Vector3<S>::Constant(Limits::max() / 2);
    CHECK(tree.closest_point(x, far).triangle == no_index);
    (void)tree.first_hit(x, far, Vector3<S>(-far));
    Index all = 0;
    tree.overlap_sphere(x, good, Limits::max(), [&](Index) { ++all; });
    CHECK(all == mesh.triangle_count());
}

TEMPLATE_TEST_CASE("positions that are not finite hide their own triangles at most", "[tree][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    for (int seed = 1; seed <= cases(400); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto scene = random_scene<S>(random);
        std::vector<Index> broken;
        const double part = random.chance(0.1) ? 1 : 0.1;
        for (Index v = 0; v < scene.mesh.vertex_count(); ++v) {
            if (!random.chance(part)) continue;
            broken.push_back(v);
            const std::array bad{Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max()};
            scene.x(random.index(3), v) = bad[static_cast<std::size_t>(random.index(4))];
        }
        scene.tree.refit(scene.x, broken);
        const auto valid = [&](Index f) {
            const auto t = scene.triangle(f);
            const S most = std::sqrt(std::sqrt(Limits::max())) / 4;
            return (t.a.eigen().array().abs() < most && t.b.eigen().array().abs() < most &&
                    t.c.eigen().array().abs() < most)
                .all();
        };
        for (int i = 0; i < 20; ++i) {
            const Vector3<S> q = point(scene.mesh.positions(), random.index(scene.mesh.vertex_count()));
            S least = Limits::infinity();
            std::vector<Index> near;
            const S radius = S(0.3) * scene.size;
            for (Index f = 0; f < scene.mesh.triangle_count(); ++f) {
                if (!valid(f)) continue;
                const S distance = closest_point(scene.triangle(f), q).squared_distance;
                least = std::min(least, distance);
                if (distance <= radius * radius) near.push_back(f);
            }
            const auto found = scene.tree.closest_point(scene.x, q);
            CHECK(found.squared_distance <= least);
            CHECK(is_finite(found.point));
            const auto touched = visited([&](auto visit) { scene.tree.overlap_sphere(scene.x, q, radius, visit); });
            CHECK(std::includes(touched.begin(), touched.end(), near.begin(), near.end()));
            (void)scene.tree.first_hit(scene.x, q, Vector3<S>(-q));
            (void)visited([&](auto visit) { scene.tree.overlap_capsule(scene.x, q, Vector3<S>(-q), radius, visit); });
            (void)visited([&](auto visit) { scene.tree.overlap_box(scene.x, q, q, visit); });
        }
    }
}

TEST_CASE("positions of another count are refused, and vertices that are not there ignored", "[tree][bad]") {
    const auto mesh = icosphere({.subdivisions = 0});
    AabbTree<double> tree(mesh);
    const Points<double> x = mesh.positions(), fewer = x.leftCols(11);
    const Eigen::MatrixXd rows = x.transpose();
    const Aabb<double> all = tree.box(0);
    const auto unchanged = [&] { return tree.box(0).low == all.low && tree.box(0).high == all.high; };
    CHECK(tree.refit(x));
    CHECK_FALSE(tree.refit(fewer));
    CHECK_FALSE(tree.refit(fewer, {}));
    CHECK_FALSE(tree.refit(rows));
    CHECK_FALSE(tree.refit(rows, std::array<Index, 1>{3}));
    CHECK(tree.refit(x, std::array<Index, 4>{12, -1, 1'000'000'000, 3}));
    CHECK(unchanged());
    for (const Index none : {-1, tree.statistics().nodes}) {
        CHECK(tree.box(none).low == Aabb<double>{}.low);
        CHECK(tree.box(none).high == Aabb<double>{}.high);
    }
    const Vector3<double> origin(0, 0, 0), far_off(0, 0, 9);
    const auto none = [](Index) { FAIL("nothing is there"); };
    for (const ConstPointsRef<double>& wrong : {ConstPointsRef<double>(fewer), ConstPointsRef<double>(rows)}) {
        CHECK(tree.closest_point(wrong, origin).triangle == no_index);
        CHECK(tree.first_hit(wrong, origin, far_off).triangle == no_index);
        tree.overlap_sphere(wrong, origin, 2, none);
        tree.overlap_box(wrong, -far_off, far_off, none);
        tree.overlap_capsule(wrong, origin, far_off, 1, none);
    }
}
