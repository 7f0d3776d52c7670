// SPDX-License-Identifier: MIT
#include <membrane/tear/crack_driving_force.hpp>

#include <membrane/tissue/fung.hpp>
#include <membrane/tissue/neo_hookean.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

constexpr Material material{.young_modulus = 2e3, .poisson_ratio = 0.4, .thickness = 1e-3};
using Three = std::array<Vector3<double>, 3>;

TriangleMesh<double> mesh_of(const Three& x) {
    test::Surface<double> surface;
    for (const auto& corner : x) surface.add(corner);
    surface.add(0, 1, 2);
    return surface.mesh();
}

template <class Make>
void check(Make make) {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto noise = [&] {
            return Vector3<double>(random.number(-0.2, 0.2), random.number(-0.2, 0.2), random.number(-0.2, 0.2));
        };
        const Three rest{Vector3<double>(0, 0, 0) + noise(), Vector3<double>(1, 0, 0) + noise(),
                         Vector3<double>(0, 1, 0) + noise()};
        Three x = rest;
        for (auto& corner : x) corner = 1.2 * corner + noise();
        const Points<double> now = mesh_of(x).positions();
        const auto energy_of = [&](const Three& shape) {
            const auto mesh = mesh_of(shape);
            const auto elements = make(mesh);
            TriangleResponse<double> sum;
            elements.add_response({0, 1, 2}, now, sum);
            return sum;
        };
        const auto response = energy_of(rest);
        const std::array<double, 3> weights{random.number(-1.0, 1.0), random.number(-1.0, 1.0),
                                            random.number(-1.0, 1.0)};
        const auto force = configurational_force(rest, x, response, weights);
        const RestTriangle<double> shape(rest);
        for (const auto& gradient : {shape.gradient[0], shape.gradient[1]}) {  // in the plane of the triangle
            const Vector3<double> along = direction_or_zero(gradient);
            constexpr double step = 1e-5;
            Three before = rest, after = rest;
            for (std::size_t i = 0; i < 3; ++i) {
                before[i] -= weights[i] * step * along;
                after[i] += weights[i] * step * along;
            }
            const double slope = (energy_of(after).energy - energy_of(before).energy) / (2 * step);
            REQUIRE(dot<double>(force, along) == Approx(-slope).epsilon(1e-5).margin(1e-6 * response.energy));
        }
    }
}

}  // namespace

// By finite differences of an element that is built anew.
TEST_CASE("the configurational force is the derivative of the energy by a rest position", "[tear]") {
    check([](const auto& mesh) { return triangular_springs(mesh, material); });
    check([](const auto& mesh) { return neo_hookean(mesh, material); });
    check([](const auto& mesh) { return fung(mesh, material, {.stiffening = 1.5}); });
}

TEST_CASE("the squared tension of a triangle in uniaxial tension is that tension", "[tear]") {
    const Three rest{Vector3<double>(0, 0, 0), Vector3<double>(1, 0, 0), Vector3<double>(0, 1, 0)};
    TriangleResponse<double> response;  // a tension of 3 N/m along x: half of it times the opposite edges' projections
    response.force = {Vector3<double>(1.5, 0, 0), Vector3<double>(-1.5, 0, 0), Vector3<double>(0, 0, 0)};
    const auto squared = squared_tension(RestTriangle<double>(rest), rest, response);
    CHECK(squared.xx == Approx(9));
    CHECK(squared.yy == 0);
    CHECK(squared.xy == 0);
}
