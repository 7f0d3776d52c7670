// SPDX-License-Identifier: MIT
#include <membrane/tissue/elements.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

static_assert(Element<TriangularSpring<float>> && Element<TriangularSpring<double>>);
static_assert(Element<PressureLoad<float>> && Element<DeadLoad<double>>);

TEST_CASE("each vertex has its elements, which corner it is and where the others are", "[elements]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<double>(random).mesh();
        const auto elements = pressure(mesh, 1.0);
        REQUIRE(elements.vertex_count() == mesh.vertex_count());
        REQUIRE(elements.all().size() == static_cast<std::size_t>(mesh.triangle_count()));
        const Points<double> x = test::jittered(mesh.positions(), 0.1, random);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            int found = 0, expected = 0;
            elements.for_each(v, x, [&](const auto& placed, const auto& corners, std::size_t i) {
                ++found;
                REQUIRE(placed.corners[i] == v);
                for (std::size_t k = 0; k < 3; ++k) REQUIRE(corners[k] == x.col(placed.corners[k]));
            });
            for (const Index w : mesh.triangles().reshaped()) expected += w == v ? 1 : 0;
            REQUIRE(found == expected);
            std::size_t by_place = 0;
            for (std::size_t place = 0; place < 3; ++place) {
                for (const auto& at : elements.at(v, place)) REQUIRE(at.place == place);
                by_place += elements.at(v, place).size();
            }
            REQUIRE(by_place == elements.at(v).size());
        }
    }
}

TEST_CASE("a force that is nothing beside the others grows with stiffness and size", "[elements]") {
    const auto force = [](double radius, double modulus) {
        const auto mesh = icosphere({.radius = radius, .subdivisions = 1});
        return triangular_springs(mesh, {.young_modulus = modulus, .poisson_ratio = 0.3, .thickness = 1e-4})
            .force_tolerance();
    };
    CHECK(force(0.01, 1e6) > 0);
    CHECK(force(0.01, 1e6) < 1e-6 * 1e6 * 1e-4 * 0.01);
    CHECK(force(0.02, 1e6) == Approx(2 * force(0.01, 1e6)));
    CHECK(force(0.01, 3e6) == Approx(3 * force(0.01, 1e6)));
}

TEMPLATE_TEST_CASE("an element that pulls with what is not finite is refused", "[elements][bad]", TEST_SCALARS) {
    const TestType tiny = std::sqrt(std::sqrt(std::numeric_limits<TestType>::min()));
    Points<TestType> x(3, 4);
    x << 0, 1, TestType(0.5), TestType(0.5), 0, 0, tiny * tiny, -1, 0, 0, 0, 0;  // the first triangle all but flat
    Triangles triangles(3, 2);
    triangles << 0, 1, 1, 0, 2, 3;
    const TriangleMesh<TestType> mesh(x, triangles);
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = 1e-3};
    const auto said = [](int element, int vertex) {
        return "Elements: element " + std::to_string(element) + " at vertex " + std::to_string(vertex) +
               " must pull with a finite force and stiffness at rest: its triangle is too thin, or a constant too "
               "large";
    };
    CHECK(refusal([&] { (void)triangular_springs(mesh, material); }) == said(0, 0));
    const auto sphere = icosphere<TestType>({.subdivisions = 0});
    const auto& corners = sphere.triangles();
    CHECK(refusal([&] { (void)pressure(sphere, 1e100); }) == (sizeof(TestType) == 4 ? said(0, corners(0, 0)) : ""));
    CHECK(refusal([&] { (void)triangular_springs(sphere, material, 1e-160); }) == said(0, corners(0, 0)));
    CHECK(refusal([&] { (void)triangular_springs(sphere, material, 100); }).empty());
    const auto infinite = std::numeric_limits<TestType>::infinity();
    using Loads = Elements<TestType, DeadLoad<TestType>>;
    CHECK(refusal([&] { (void)Loads(sphere, {{{5}, {{0, infinite, 0}}}}); }) == said(0, 5));
}

TEST_CASE("an element at no vertex is refused", "[elements][bad]") {
    using Loads = Elements<double, DeadLoad<double>>;
    const auto mesh = icosphere({.subdivisions = 0});
    const auto loads_at = [&](Index v) {
        return refusal([&] {
            (void)Loads(mesh, {{{3}, {Vector3<double>::Zero()}}, {{v}, {Vector3<double>::Zero()}}});
        });
    };
    CHECK(loads_at(11).empty());
    CHECK(loads_at(12) == "Elements: element 1 names vertex 12, expected 0 to 11");
    CHECK(loads_at(-1) == "Elements: element 1 names vertex -1, expected 0 to 11");
}
