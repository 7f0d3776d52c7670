// SPDX-License-Identifier: MIT
#include <membrane/meshing/editable_mesh.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;

namespace {

/// The same triangles as a list, changed without any thought of what is next to what.
struct List {
    std::vector<std::array<Index, 3>>
        triangles;  // corners as EditableMesh counts them, turned to begin with the lowest
    std::vector<Vector3<double>> x;

    explicit List(const EditableMesh& mesh) {
        for (Index v = 0; v < mesh.vertex_count(); ++v) x.push_back(mesh.position(v));
        for (Index side = 0; side < mesh.side_count(); side += 3) {
            if (mesh.exists(side)) add({mesh.from(side), mesh.to(side), mesh.apex(side)});
        }
        sort();
    }

    void add(std::array<Index, 3> corners) {
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
        triangles.push_back(corners);
    }
    void sort() { std::sort(triangles.begin(), triangles.end()); }

    /// Takes the triangles at the edge out; the third vertices, after the one of a, b first.
    std::vector<Index> take_out(Index a, Index b) {
        std::vector<Index> apexes;
        for (const auto& [from, to] : {std::array{a, b}, {b, a}}) {
            for (std::size_t f = 0; f < triangles.size(); ++f) {
                auto corners = triangles[f];
                for (int turn = 0; turn < 3; ++turn) {
                    std::rotate(corners.begin(), corners.begin() + 1, corners.end());
                    if (corners[0] != from || corners[1] != to) continue;
                    apexes.push_back(corners[2]);
                    triangles.erase(triangles.begin() + static_cast<std::ptrdiff_t>(f--));
                    break;
                }
            }
        }
        return apexes;
    }

    void flip(Index a, Index b) {
        const auto apexes = take_out(a, b);
        add({apexes[1], apexes[0], a});
        add({apexes[0], apexes[1], b});
        sort();
    }
    void split(Index a, Index b, Index middle, const Vector3<double>& place) {
        const auto apexes = take_out(a, b);
        x.push_back(place);
        for (std::size_t i = 0; i < apexes.size(); ++i) {
            const Index from = i == 0 ? a : b, to = i == 0 ? b : a;
            add({from, middle, apexes[i]});
            add({middle, to, apexes[i]});
        }
        sort();
    }
    void collapse(Index a, Index b) {
        take_out(a, b);
        auto old = std::exchange(triangles, {});
        for (auto corners : old) {
            std::replace(corners.begin(), corners.end(), a, b);
            add(corners);
        }
        sort();
    }

    /// Vertices less edges plus triangles, if it is a surface.
    std::optional<int> euler() const {
        if (triangles.empty()) return std::nullopt;
        Points<double> points(3, static_cast<Eigen::Index>(x.size()));
        for (std::size_t v = 0; v < x.size(); ++v) points.col(static_cast<Eigen::Index>(v)) = x[v];
        Triangles corners(3, static_cast<Eigen::Index>(triangles.size()));
        std::set<Index> used;
        for (std::size_t f = 0; f < triangles.size(); ++f) {
            for (std::size_t k = 0; k < 3; ++k) {
                corners(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(f)) = triangles[f][k];
                used.insert(triangles[f][k]);
            }
        }
        std::optional<int> number;
        (void)test::refusal([&] {
            const TriangleMesh<double> mesh(points, corners);
            const Adjacency adjacency(mesh);
            number = static_cast<int>(used.size()) - static_cast<int>(adjacency.edges().size()) + mesh.triangle_count();
        });
        return number;
    }
};

/// Twins are twins, and each vertex knows the triangles around it in their order.
void require_valid(const EditableMesh& mesh) {
    std::vector<std::size_t> triangles_of(static_cast<std::size_t>(mesh.vertex_count()), 0);
    std::vector<char> border(triangles_of.size(), 0);
    for (Index side = 0; side < mesh.side_count(); ++side) {
        if (!mesh.exists(side)) continue;
        const Index other = mesh.twin(side);
        if (other == no_index) {
            border[static_cast<std::size_t>(mesh.from(side))] = border[static_cast<std::size_t>(mesh.to(side))] = 1;
        } else if (!mesh.exists(other) || mesh.twin(other) != side || mesh.from(other) != mesh.to(side) ||
                   mesh.to(other) != mesh.from(side)) {
            FAIL("side " << side << " and its twin " << other << " do not fit");
        }
        ++triangles_of[static_cast<std::size_t>(mesh.from(side))];
    }
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const std::size_t expected = triangles_of[static_cast<std::size_t>(v)];
        if (mesh.is_vertex(v) != (expected > 0)) FAIL("vertex " << v << " is there or not");
        if (expected == 0) continue;
        std::vector<Index> around;
        mesh.for_each_outgoing(v, [&](Index side) { around.push_back(side); });
        if (around.size() != expected) FAIL("vertex " << v << " has " << expected << " triangles, not all visited");
        if (mesh.is_border(v) != (border[static_cast<std::size_t>(v)] != 0)) FAIL("vertex " << v << " at a border");
        for (std::size_t i = 0; i < around.size(); ++i) {
            if (mesh.from(around[i]) != v) FAIL("side " << around[i] << " is not out of " << v);
            if (i > 0 && mesh.to(around[i]) != mesh.apex(around[i - 1])) FAIL("not in order around " << v);
        }
    }
}

/// One random change, done to the list as well; whether it was done must be what the list says.
void change(EditableMesh& mesh, test::Random& random, int& euler, std::array<int, 3>& done) {
    Index side = 0;
    do side = random.index(mesh.side_count());
    while (!mesh.exists(side));
    const Index a = mesh.from(side), b = mesh.to(side);
    const bool inner = mesh.twin(side) != no_index;
    List expected(mesh);
    const List before = expected;
    bool allowed = true, did = true;
    const Index kind = random.index(3);
    CAPTURE(side, a, b, kind);
    if (kind == 0) {
        if (inner) expected.flip(a, b);
        allowed = inner && expected.euler() == euler;
        did = mesh.flip(side);
        if (did) REQUIRE(!mesh.has_edge(a, b));
    } else if (kind == 1) {
        const Vector3<double> place = random.vector();
        expected.split(a, b, mesh.vertex_count(), place);
        const Index middle = mesh.split(side, place);
        REQUIRE(mesh.position(middle) == place);
        REQUIRE(mesh.to(side) == middle);
        REQUIRE(expected.euler() == euler);
    } else {
        const bool leaves_border = inner && mesh.is_border(a);
        expected.collapse(a, b);
        allowed = !leaves_border && expected.euler() == euler;
        did = mesh.collapse(side);
    }
    REQUIRE(did == allowed);
    REQUIRE(List(mesh).triangles == (did ? expected : before).triangles);
    require_valid(mesh);
    if (did) ++done[static_cast<std::size_t>(kind)];
}

void check_changes(const TriangleMesh<double>& start, int changes, std::uint64_t seed) {
    EditableMesh mesh(start);
    require_valid(mesh);
    REQUIRE(mesh.mesh().triangles() == start.triangles());
    REQUIRE(mesh.mesh().positions() == start.positions());
    int euler = List(mesh).euler().value();
    std::array<int, 3> done{};
    test::Random random(seed);
    for (int i = 0; i < changes; ++i) {
        CAPTURE(seed, i);
        change(mesh, random, euler, done);
    }
    if (changes >= 200) REQUIRE(*std::min_element(done.begin(), done.end()) > 20);
}

}  // namespace

TEST_CASE("a thousand triangles stay a surface through flips, splits and collapses", "[editable_mesh]") {
    check_changes(icosphere({.radius = 1, .subdivisions = 3}), cases(300, 3000), 1);
    check_changes(disc({.radius = 1, .rings = 13}), cases(300, 3000), 2);
}

TEST_CASE("what is done and what is not is what a list of triangles says, on small surfaces", "[editable_mesh]") {
    for (int seed = 1; seed <= cases(150, 1500); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        auto surface = test::random_surface<double>(random);
        if (random.chance(0.5)) surface = test::with_holes(surface, random);
        const auto mesh = surface.mesh();
        // Isolated vertices are not part of an editable mesh's output.
        if (edges(mesh).empty()) continue;
        EditableMesh editable(mesh);
        const auto used = editable.mesh();
        check_changes(used, 30, static_cast<std::uint64_t>(seed));
    }
}

TEST_CASE("the smallest surfaces stay", "[editable_mesh]") {
    const auto tetrahedron = [] {
        Points<double> x(3, 4);
        x << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
        Triangles corners(3, 4);
        corners << 0, 0, 0, 1, 2, 1, 3, 2, 1, 3, 2, 3;
        return TriangleMesh<double>(x, corners);
    }();
    EditableMesh closed(tetrahedron);
    EditableMesh triangle(TriangleMesh<double>(tetrahedron.positions().leftCols(3), Triangles{{0}, {1}, {2}}));
    for (Index side = 0; side < closed.side_count(); ++side) {
        CHECK(!closed.flip(side));
        CHECK(!closed.collapse(side));
    }
    for (Index side = 0; side < 3; ++side) {
        CHECK(!triangle.flip(side));
        CHECK(!triangle.collapse(side));
    }
    for (int seed = 1; seed <= cases(100); ++seed) {
        check_changes(tetrahedron, 20, static_cast<std::uint64_t>(seed));
        check_changes(triangle.mesh(), 20, static_cast<std::uint64_t>(seed));
    }
}

TEST_CASE("the mesh that comes out counts what is left, in order", "[editable_mesh]") {
    EditableMesh mesh(icosphere({.radius = 1, .subdivisions = 1}));
    REQUIRE(mesh.collapse(0));
    const Index middle = mesh.split(60, {5, 6, 7});
    mesh.move(1, {8, 9, 10});
    const auto out = mesh.mesh();
    CHECK(out.vertex_count() == 42);
    CHECK(out.triangle_count() == 80);
    CHECK(point(out.positions(), out.vertex_count() - 1) == Vector3<double>(5, 6, 7));
    CHECK(mesh.position(middle) == Vector3<double>(5, 6, 7));
    CHECK((out.positions().array() == 9).any());
}
