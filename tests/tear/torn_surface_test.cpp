// SPDX-License-Identifier: MIT
#include <membrane/tear/torn_surface.hpp>

#include <cmath>
#include <numbers>

#include <membrane/model/tearable_springs.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random_tear.hpp"

using namespace membrane;

namespace {

template <Real Scalar>
double area_of(const TornSurface<Scalar>& surface) {
    double sum = 0;
    for (Index f = 0; f < surface.triangles().cols(); ++f) {
        sum += static_cast<double>(RestTriangle<Scalar>(surface.corners_at(surface.rest_positions(), f)).area);
    }
    return sum;
}

}  // namespace

TEMPLATE_TEST_CASE("a surface that is cut at random is a mesh with the same triangles", "[tear]", double, float) {
    int splits = 0;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto whole = seed % 2 == 0 ? icosphere<TestType>({.radius = 1, .subdivisions = 2})
                                         : disc<TestType>({.radius = 1, .rings = 6});
        const auto mesh = with_reserve(whole, 30);
        Tearing tear(mesh, EnergyRelease{1, 1});
        Points<TestType> x = mesh.positions();
        for (int n = 0; n < 12; ++n) {
            const auto events = test::cut_at_random(random, tear, x);
            splits += static_cast<int>(events.size());
            const auto& surface = tear.surface();
            for (const auto& event : events) {
                REQUIRE(event.split.vertex != no_index);
                REQUIRE(event.split.area_share > 0);
                REQUIRE(event.split.area_share < 1);
                REQUIRE(x.col(event.split.copy) == x.col(event.split.vertex));
            }
            const TriangleMesh<TestType> torn(surface.rest_positions(), surface.triangles());  // one fan at each vertex
            const Adjacency expected(torn);
            for (Index f = 0; f < torn.triangle_count(); ++f) {
                REQUIRE(surface.adjacency().triangle_neighbours(f) == expected.triangle_neighbours(f));
            }
            REQUIRE(area_of(surface) == Approx(area_of(TornSurface<TestType>(whole))));
        }
    }
    CHECK(splits > cases(60));
}

TEST_CASE("a vertex that moves at rest keeps the area, the angles, and its point of the membrane", "[tear]") {
    constexpr double least = 0.35;
    int moved = 0;
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = with_reserve(disc<double>({.radius = 1, .rings = 6}), 1);
        TornSurface<double> surface(mesh);
        Eigen::Matrix3d map;
        for (double& number : map.reshaped()) number = random.number(-1.0, 1.0);
        Points<double> all = map * mesh.positions();
        PointsRef<double> x = all;
        const double area = area_of(surface);
        const Index v = random.index(37);  // within the disc
        const Vector3<double> from = point(surface.rest_positions(), v);
        const Vector3<double> place =
            from + 0.12 * Vector3<double>(random.number(-1.0, 1.0), random.number(-1.0, 1.0), 0);
        if (!surface.move_vertex(x, v, place, least)) continue;
        ++moved;
        const Vector3<double> to = point(surface.rest_positions(), v);
        const Eigen::Vector3d expected = map * Eigen::Vector3d(to[0], to[1], to[2]);
        REQUIRE((all.col(v) - expected).norm() < 1e-12);
        REQUIRE(norm<double>(cross<double>(to - from, place - from)) < 1e-12);
        REQUIRE(area_of(surface) == Approx(area));
        for (const Index f : surface.adjacency().triangles_of(v)) {
            const auto c = surface.corners_at(surface.rest_positions(), f);
            for (std::size_t k = 0; k < 3; ++k) {
                const Vector3<double> a = c[(k + 1) % 3] - c[k], b = c[(k + 2) % 3] - c[k];
                REQUIRE(std::atan2(norm<double>(cross(a, b)), dot(a, b)) > least - 1e-9);
            }
        }
        REQUIRE(surface.events().size() == 1);
        REQUIRE(surface.events()[0].moved.triangles.size() == surface.adjacency().triangles_of(v).size());
    }
    CHECK(moved > cases(150));
}
