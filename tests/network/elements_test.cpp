// SPDX-License-Identifier: MIT
#include <membrane/network/elements.hpp>

#include <vector>

#include <membrane/mesh/shapes.hpp>
#include <membrane/network/pressure.hpp>
#include <membrane/network/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

static_assert(Element<TriangularSpring<float>> && Element<TriangularSpring<double>>);
static_assert(Element<PressedTriangle<float>> && Element<DeadLoad<double>>);
static_assert(!Element<int> && !Element<CornerPull<double>>);

TEST_CASE("each vertex is told of its elements, which corner it is and where the others are", "[elements]") {
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
        }
    }
}

TEST_CASE("a force that is nothing beside the others grows with stiffness and size", "[elements]") {
    const auto force = [](double radius, double modulus) {
        const auto mesh = icosphere({.radius = radius, .subdivisions = 1});
        return triangular_springs(mesh, {.young_modulus = modulus, .poisson_ratio = 0.3, .thickness = 1e-4})
            .negligible_force();
    };
    CHECK(force(0.01, 1e6) > 0);
    CHECK(force(0.01, 1e6) < 1e-6 * 1e6 * 1e-4 * 0.01);
    CHECK(force(0.02, 1e6) == Approx(2 * force(0.01, 1e6)));
    CHECK(force(0.01, 3e6) == Approx(3 * force(0.01, 1e6)));
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
