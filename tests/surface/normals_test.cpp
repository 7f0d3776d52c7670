// SPDX-License-Identifier: MIT
#include <membrane/surface/normals.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <set>
#include <span>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/cgal.hpp"
#include "support/meshes.hpp"
#include "support/tears.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

/// Sum over all triangles, in long double; zero where there is no area.
template <class S>
Eigen::Matrix<long double, 3, Eigen::Dynamic> expected_normals(const Points<S>& x, const Triangles& triangles) {
    using Long = Eigen::Matrix<long double, 3, 1>;
    Eigen::Matrix<long double, 3, Eigen::Dynamic> sum(3, x.cols());
    sum.setZero();
    for (const auto& corner : triangles.colwise()) {
        const Long a = x.col(corner[0]).template cast<long double>();
        const Long ab = x.col(corner[1]).template cast<long double>() - a;
        const Long ac = x.col(corner[2]).template cast<long double>() - a;
        const Long area(ab.y() * ac.z() - ab.z() * ac.y(), ab.z() * ac.x() - ab.x() * ac.z(),
                        ab.x() * ac.y() - ab.y() * ac.x());
        for (const Index v : corner) sum.col(v) += area;
    }
    for (Eigen::Index v = 0; v < sum.cols(); ++v) {
        const long double length = sum.col(v).norm();
        if (length > 0) sum.col(v) /= length;
    }
    return sum;
}

template <class S>
S largest_error(const Points<S>& normals, const Eigen::Matrix<long double, 3, Eigen::Dynamic>& expected) {
    return static_cast<S>((normals.template cast<long double>() - expected).colwise().norm().maxCoeff());
}

template <class S>
bool all_unit(const Points<S>& normals) {
    for (Index v = 0; v < normals.cols(); ++v) {
        const S length = norm(point(normals, v));
        if (!(std::abs(length - 1) <= 4 * std::numeric_limits<S>::epsilon())) return false;
    }
    return true;
}

}  // namespace

TEMPLATE_TEST_CASE("normals of closed forms", "[normals]", TEST_SCALARS) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon();
    const VertexNormals<S> flat(sheet<S>({.columns = 5, .rows = 3}));
    CHECK(flat.values() == Vector3<S>(0, 0, 1).eigen().replicate(1, 24));

    // An icosahedron's stars are regular: each normal is the vertex's own direction.
    const auto icosahedron = icosphere<S>({.radius = 1, .subdivisions = 0});
    CHECK((VertexNormals(icosahedron).values() - icosahedron.positions()).colwise().norm().maxCoeff() < 8 * epsilon);

    // A cube's corner of three squares, one of them cut in two: equal areas, whatever the number of triangles.
    Points<S> x(3, 7);
    x << 0, 1, 0, 0, 1, 1, 0,  //
        0, 0, 1, 0, 1, 0, 1,   //
        0, 0, 0, 1, 0, 1, 1;
    Triangles triangles(3, 6);
    triangles << 0, 0, 0, 0, 0, 0,  //
        2, 4, 1, 5, 3, 6,           //
        4, 1, 5, 3, 6, 2;
    const VertexNormals<S> corner(TriangleMesh<S>(x, triangles));
    const Vector3<S> expected = -Vector3<S>::Ones() / std::sqrt(S(3));
    CHECK(norm<S>(point(corner.values(), 0) - expected) < 4 * epsilon);
}

TEMPLATE_TEST_CASE("normals are the area-weighted mean of the triangles'", "[normals]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<S>(random);
        if (random.chance(0.3)) surface = test::with_holes(surface, random);
        surface.x.colwise() -= surface.x.rowwise().mean().eval();
        bool isolated = false;
        for (Index v = 0; v < surface.vertex_count(); ++v) isolated |= (surface.triangles.array() != v).all();
        VertexNormals<S> normals(surface.mesh());
        REQUIRE(all_unit(normals.values()));
        if (isolated) continue;
        const S tolerance = 100 * std::numeric_limits<S>::epsilon();
        REQUIRE(largest_error(normals.values(), expected_normals(surface.x, surface.triangles)) < tolerance);

        const Eigen::Matrix<S, 3, 3> rotation = random.rotation<S>();
        const Points<S> before = normals.values(), turned = rotation * surface.x;
        normals.update(turned);
        REQUIRE((normals.values() - rotation * before).colwise().norm().maxCoeff() < tolerance);
    }
}

TEMPLATE_TEST_CASE("an update of the moved vertices equals one of all, bit for bit", "[normals]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<S>(random);
        if (random.chance(0.3)) surface = test::with_holes(surface, random);
        const TriangleMesh<S> mesh = surface.mesh();
        const S size = (surface.x.rowwise().maxCoeff() - surface.x.rowwise().minCoeff()).maxCoeff();
        VertexNormals<S> partial(mesh), full(mesh);
        REQUIRE(same_bits(partial.values(), full.values()));
        Points<S> x = mesh.positions();
        for (int step = 0; step < 20; ++step) {
            std::vector<Index> moved;
            for (Index n = random.index(8); n > 0; --n) {
                const Index v = random.index(mesh.vertex_count());
                moved.push_back(v);
                if (random.chance(0.2)) moved.push_back(v);  // named twice
                x.col(v) += S(0.1) * size * random.vector<S>();
            }
            partial.update(x, moved);
            full.update(x);
            REQUIRE(same_bits(partial.values(), full.values()));
        }
        REQUIRE(same_bits(VertexNormals<S>(TriangleMesh<S>(x, mesh.triangles())).values(), full.values()));
    }
}

TEST_CASE("an update of the moved vertices changes these and their neighbours only", "[normals]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 3});
    const Adjacency adjacency(mesh);
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        VertexNormals<double> normals(mesh);
        const Points<double> before = normals.values();
        const std::vector<Index> moved{random.index(642), random.index(642), random.index(642)};
        std::set<Index> near(moved.begin(), moved.end());
        for (const Index v : moved) near.insert(adjacency.neighbours(v).begin(), adjacency.neighbours(v).end());
        const auto updated = normals.update(test::jittered(mesh.positions(), 0.01, random), moved);  // all move
        REQUIRE(updated.size() == near.size());
        REQUIRE(std::set<Index>(updated.begin(), updated.end()) == near);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE((point(normals.values(), v) == point(before, v)) == (near.count(v) == 0));
        }
    }
}

TEMPLATE_TEST_CASE("a vertex of any number of triangles has their normal, closed around it or not", "[normals]",
                   TEST_SCALARS) {
    using S = TestType;
    for (const Index count : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 100, 1001}) {
        for (const bool closed : {false, true}) {
            if (closed && count < 3) continue;
            CAPTURE(count, closed);
            Random random(static_cast<std::uint64_t>(count));
            const Index around = closed ? count : count + 1;
            Points<S> x(3, around + 1);
            Triangles triangles(3, count);
            const S turn = (closed ? 2 : 1) * std::numbers::pi_v<S> / static_cast<S>(count);
            for (Index i = 0; i < around; ++i) {
                const S angle = turn * static_cast<S>(i);
                x.col(i) = random.number(S(0.5), S(1)) * Vector3<S>(std::cos(angle), std::sin(angle), S(0.3));
            }
            x.col(around) = random.template vector<S>(S(-0.2), S(0.2));  // the vertex
            for (Index f = 0; f < count; ++f) triangles.col(f) << f, (f + 1) % around, around;
            const TriangleMesh<S> mesh(x, triangles);
            VertexNormals<S> full(mesh), partial(mesh);
            const S tolerance = 100 * std::numeric_limits<S>::epsilon();
            REQUIRE(largest_error(full.values(), expected_normals(x, triangles)) < tolerance);

            x.col(0) *= S(1.2);  // a neighbour, then the vertex
            x.col(around) *= S(0.5);
            full.update(x);
            REQUIRE(largest_error(full.values(), expected_normals(x, triangles)) < tolerance);
            REQUIRE(partial.update(x, std::array{Index{0}, around}).size() == static_cast<std::size_t>(around + 1));
            REQUIRE(same_bits(partial.values(), full.values()));
        }
    }
}

TEMPLATE_TEST_CASE("normals read no number behind the last position", "[normals]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
    const auto memory = std::make_unique<S[]>(3 * 42);  // whose end the address sanitizer watches
    Eigen::Map<Points<S>> x(memory.get(), 3, 42);
    x = mesh.positions();
    VertexNormals<S> normals(mesh);
    const Points<S> at_rest = normals.values();
    normals.update(x);
    CHECK(same_bits(normals.values(), at_rest));
    normals.update(x, std::array<Index, 1>{41});
    CHECK(same_bits(normals.values(), at_rest));
}

TEST_CASE("normals take positions from anybody's memory", "[normals]") {
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 2});
    VertexNormals<float> normals(mesh);
    std::vector<float> buffer(8 * 162, std::nanf(""));
    Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> x(buffer.data(), 3, 162, Eigen::OuterStride<>(8));
    x = mesh.positions();
    const std::vector<Index> moved{4, 100};
    x.col(4) *= 1.3F;
    normals.update(x, moved);
    VertexNormals<float> other(mesh);
    other.update(x);
    CHECK(same_bits(normals.values(), other.values()));
}

TEMPLATE_TEST_CASE("a vertex without a measurable area gets its normal at rest, never a NaN", "[normals][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    const auto mesh = icosphere<S>({.radius = 0.01, .subdivisions = 2});
    const Adjacency adjacency(mesh);
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        VertexNormals<S> normals(mesh);
        const Points<S> at_rest = normals.values();
        const Index v = random.index(mesh.vertex_count());
        const std::vector<Index> moved{v};
        Points<S> x = mesh.positions();
        for (const S large : {Limits::max(), Limits::lowest(), std::sqrt(Limits::max())}) {
            x(random.index(3), v) = large;
            normals.update(x, moved);
            REQUIRE(all_unit(normals.values()));
        }
        for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
            x = mesh.positions();
            x(random.index(3), v) = bad;
            normals.update(x, moved);
            REQUIRE(all_unit(normals.values()));
            REQUIRE(point(normals.values(), v) == point(at_rest, v));
            for (const Index w : adjacency.neighbours(v)) REQUIRE(point(normals.values(), w) == point(at_rest, w));
            normals.update(x);
            REQUIRE(all_unit(normals.values()));
        }
        x = mesh.positions();
        for (const Index w : adjacency.neighbours(v)) x.col(w) = x.col(v);  // the star shrinks to a point
        normals.update(x);
        REQUIRE(all_unit(normals.values()));
        REQUIRE(point(normals.values(), v) == point(at_rest, v));
        normals.update(mesh.positions());  // and comes back
        REQUIRE(same_bits(normals.values(), at_rest));
        S scale = 1;
        do {  // through all sizes that area and its square can have, down to nothing
            scale *= random.number(S(0.1), S(0.9));
            normals.update(Points<S>(scale * mesh.positions()));
            REQUIRE(all_unit(normals.values()));
        } while (scale > 0);
    }
    Points<S> x(3, 7);         // vertex 3 is isolated; 4, 5 and 6 are in line
    x << 0, 1, 0, 5, 2, 3, 4,  //
        0, 0, 1, 5, 0, 0, 0,   //
        0, 0, 0, 5, 0, 0, 0;
    Triangles triangles(3, 2);
    triangles << 0, 4,  //
        2, 5,           //
        1, 6;
    const VertexNormals<S> normals(TriangleMesh<S>(x, triangles));
    CHECK(point(normals.values(), 0) == Vector3<S>(0, 0, -1));
    for (const Index v : {3, 4, 5, 6}) CHECK(point(normals.values(), v) == Vector3<S>(0, 0, 1));
}

TEST_CASE("normals outlive the mesh and what they were copied from, to the same bits", "[normals]") {
    Random random(7);
    auto mesh = std::make_unique<TriangleMesh<double>>(test::random_surface<double>(random).mesh());
    VertexNormals<double> original(*mesh);
    auto first = std::make_unique<VertexNormals<double>>(*mesh);
    Points<double> x = mesh->positions();
    mesh.reset();
    first->update(x, std::array<Index, 2>{0, 3});
    VertexNormals<double> copy = *first;
    VertexNormals<double> moved = std::move(*first);
    first.reset();
    for (int step = 0; step < 100; ++step) {
        const std::vector<Index> changed{random.index(static_cast<Index>(x.cols()))};
        x.col(changed[0]) *= 1.1;
        original.update(x, changed);
        copy.update(x, changed);
        moved.update(x, changed);
        REQUIRE(same_bits(original.values(), copy.values()));
        REQUIRE(same_bits(original.values(), moved.values()));
    }
    STATIC_REQUIRE(noexcept(copy.update(std::declval<const ConstPointsRef<double>&>())));
    STATIC_REQUIRE(noexcept(copy.update(std::declval<const ConstPointsRef<double>&>(), std::span<const Index>{})));
    STATIC_REQUIRE(noexcept(copy.values()));
}

TEMPLATE_TEST_CASE("pseudo-normals of face, edge and corner", "[normals]", TEST_SCALARS) {
    using S = TestType;
    const S epsilon = std::numeric_limits<S>::epsilon();
    // A pyramid's corner with three triangles at right angles; angle weights ignore how large they are.
    Points<S> x(3, 4);
    x << 0, 1, 0, 0,  //
        0, 0, 2, 0,   //
        0, 0, 0, 3;
    Triangles triangles(3, 3);
    triangles << 0, 0, 0,  //
        2, 1, 3,           //
        1, 3, 2;
    const TriangleMesh<S> mesh(x, triangles);
    const Adjacency adjacency(mesh);
    const auto at = [&](Index f, S a, S b, S c) {
        return pseudo_normal(x, triangles, adjacency, f, Vector3<S>(a, b, c));
    };
    const auto near = [&](const Vector3<S>& a, const Vector3<S>& b) { return norm<S>(a - b) < 4 * epsilon; };
    CHECK(near(at(0, S(0.2), S(0.3), S(0.5)), {0, 0, -1}));
    CHECK(near(at(1, S(0.2), S(0.3), S(0.5)), {0, -1, 0}));
    CHECK(near(at(0, S(0.5), 0, S(0.5)), Vector3<S>(0, -1, -1) / std::sqrt(S(2))));  // edge 0-1, shared with triangle 1
    CHECK(near(at(1, S(0.1), S(0.9), 0), Vector3<S>(0, -1, -1) / std::sqrt(S(2))));  // the same edge
    CHECK(near(at(0, S(0.5), S(0.5), 0), Vector3<S>(-1, 0, -1) / std::sqrt(S(2))));  // edge 0-2, shared with triangle 2
    CHECK(near(at(0, 0, S(0.5), S(0.5)), {0, 0, -1}));                               // edge 1-2, at the border
    for (const Index f : {0, 1, 2}) CHECK(near(at(f, 1, 0, 0), -Vector3<S>::Ones() / std::sqrt(S(3))));
    CHECK(near(at(0, 0, 0, 1), at(1, 0, 1, 0)));  // vertex 1, seen from both its triangles

    // The first face in two halves: weights are angles, not triangles or areas.
    Points<S> x_halved(3, 5);
    x_halved << x, Vector3<S>(4, 4, 0);
    Triangles halved(3, 4);
    halved << 0, 0, triangles.rightCols(2).row(0),  //
        2, 4, triangles.rightCols(2).row(1),        //
        4, 1, triangles.rightCols(2).row(2);
    const Adjacency of_halved(TriangleMesh<S>(x_halved, halved));
    for (const Index f : {0, 1, 2, 3}) {
        const Vector3<S> corner = pseudo_normal(x_halved, halved, of_halved, f, Vector3<S>(1, 0, 0));
        CHECK(near(corner, -Vector3<S>::Ones() / std::sqrt(S(3))));
    }

    x.setZero();
    for (const auto& barycentric :
         {Vector3<S>(1, 0, 0), Vector3<S>(0, S(0.5), S(0.5)), Vector3<S>(S(0.2), S(0.3), S(0.5))}) {
        CHECK(pseudo_normal(x, triangles, adjacency, 0, barycentric) == Vector3<S>(0, 0, 0));
    }
    x.setConstant(std::numeric_limits<S>::quiet_NaN());
    CHECK(at(0, 1, 0, 0) == Vector3<S>(0, 0, 0));
}

TEMPLATE_TEST_CASE("after random tears the normals are those of a mesh that is built anew, bit for bit",
                   "[normals][tear]", TEST_SCALARS) {
    using S = TestType;
    const S tolerance = 100 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto whole = random.chance(0.1) ? test::fan<S>(3 + random.index(40)) : test::random_surface<S>(random);
        whole.x.colwise() -= whole.x.rowwise().mean().eval();
        test::TearingSurface<S> surface(whole, 4 + random.index(60));
        VertexNormals<S> normals(surface.mesh());
        TriangleAdjacency adjacency(surface.mesh());
        Points<S> x = surface.mesh().positions();
        const auto follow = [&](const VertexSplit& split) {
            adjacency.split(split);
            normals.split(split);
            x.col(split.copy) = x.col(split.vertex);
            REQUIRE(same_bits(point(normals.values(), split.copy), point(normals.values(), split.vertex)));
            normals.update(x, std::span<const Index>());  // none but those of the tear
            // Here a vertex may have two fans of triangles, which no mesh is accepted with.
            const auto expected = expected_normals<S>(x, surface.triangles());
            REQUIRE(largest_error<S>(normals.values().leftCols(surface.used()), expected.leftCols(surface.used())) <
                    tolerance);
        };
        while (surface.tear(random, follow)) {
            const auto mesh = surface.mesh();
            VertexNormals<S> fresh(mesh);
            std::vector<Index> moved;
            for (Index v = 0; v < surface.used(); ++v) {
                if (!random.chance(0.3)) continue;
                moved.push_back(v);
                x.col(v) += S(0.02) * x.cwiseAbs().maxCoeff() * random.vector<S>();
            }
            fresh.update(x);
            normals.update(x, moved);
            REQUIRE(same_bits(normals.values(), fresh.values()));
            normals.update(x);
            REQUIRE(same_bits(normals.values(), fresh.values()));

            const Adjacency expected(mesh);
            for (int i = 0; i < 20; ++i) {
                const Index f = random.index(mesh.triangle_count());
                Vector3<S> weights = random.barycentric<S>();
                if (random.chance(0.6)) weights[random.index(3)] = 0;
                if (random.chance(0.3)) weights = Vector3<S>::Unit(random.index(3));
                REQUIRE(same_bits(pseudo_normal(x, mesh.triangles(), adjacency, f, weights),
                                  pseudo_normal(x, mesh.triangles(), expected, f, weights)));
            }
        }
    }
}

TEST_CASE("the pseudo-normal at the nearest point distinguishes inside from outside as CGAL does", "[normals][cgal]") {
    int at_face = 0, at_edge = 0, at_corner = 0;
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::surface_of(icosphere({.radius = 1, .subdivisions = 1 + random.index(2)}));
        for (Index v = 0; v < surface.vertex_count(); ++v) surface.x.col(v) *= random.number(0.75, 1.25);  // not convex
        const Adjacency adjacency(surface.mesh());
        const test::CgalTree cgal(surface.x, surface.triangles);
        for (int query = 0; query < 500; ++query) {
            Vector3<double> q = random.vector<double>(-1.3, 1.3);
            if (query % 2 == 0) {  // close to a vertex
                q = point(surface.x, random.index(surface.vertex_count())) + 0.02 * random.unit_vector();
            }
            TrianglePoint<double> nearest{{}, {}, std::numeric_limits<double>::infinity()};
            Index triangle = no_index;
            for (Index f = 0; f < surface.triangle_count(); ++f) {
                const auto candidate = closest_point(triangle_at(surface.x, surface.triangles.col(f)), q);
                if (!(candidate.squared_distance < nearest.squared_distance)) continue;
                nearest = candidate;
                triangle = f;
            }
            if (nearest.squared_distance < 1e-12) continue;
            const auto zeros = (nearest.barycentric.eigen().array() == 0).count();
            ++(zeros == 0 ? at_face : zeros == 1 ? at_edge : at_corner);
            const auto normal = pseudo_normal(surface.x, surface.triangles, adjacency, triangle, nearest.barycentric);
            CHECK(norm(normal) == Approx(1));
            const bool outside = dot<double>(normal, q - nearest.point) > 0;
            CHECK(outside == cgal.is_outside(q));
        }
    }
    CHECK(at_face > 0);
    CHECK(at_edge > cases(40) * 10);
    CHECK(at_corner > cases(40) * 10);
}

TEST_CASE("positions of another count are refused, and vertices that are not there ignored", "[normals][bad]") {
    VertexNormals<double> normals(icosphere({.subdivisions = 0}));
    const Points<double> x = icosphere({.subdivisions = 0}).positions(), fewer = x.leftCols(11);
    const Eigen::MatrixXd rows = x.transpose();
    const Points<double> before = normals.values();
    CHECK(normals.update(x));
    CHECK_FALSE(normals.update(fewer));
    CHECK_FALSE(normals.update(rows));
    CHECK(normals.update(fewer, std::array<Index, 1>{0}).empty());
    for (const Index wrong : {-1, 12, 1'000'000'000}) CHECK(normals.update(x, std::array{wrong}).empty());
    CHECK(normals.values() == before);
    const auto mesh = icosphere({.subdivisions = 0});
    const Adjacency adjacency(mesh);
    for (const Index wrong : {-1, 20}) {
        const auto normal = pseudo_normal(x, mesh.triangles(), adjacency, wrong, Vector3<double>(0, 0, 1));
        CHECK(normal == Vector3<double>(0, 0, 0));
    }
}
