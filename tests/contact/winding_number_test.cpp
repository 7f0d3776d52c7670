// SPDX-License-Identifier: MIT
#include <membrane/contact/winding_number.hpp>

#include <cmath>
#include <cstdint>
#include <numbers>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using membrane::AabbTree;
using membrane::Index;
using membrane::LocalSurface;
using membrane::Points;
using membrane::Vector3;
using membrane::winding_number;

namespace {

/// The same by the solid angles of all triangles.
template <membrane::Real S>
double by_angles(const LocalSurface<S>& surface, const Points<S>& x, const Vector3<S>& q) {
    double sum = 0;
    for (Index f = 0; f < surface.triangle_count(); ++f) {
        const auto triangle = surface.triangle(x, f);
        const Vector3<double> a = (triangle.a - q).template cast<double>().normalized(),
                              b = (triangle.b - q).template cast<double>().normalized(),
                              c = (triangle.c - q).template cast<double>().normalized();
        sum += 2 * std::atan2(a.dot(membrane::cross<double>(b, c)), 1 + a.dot(b) + b.dot(c) + c.dot(a));
    }
    return sum / (4 * std::numbers::pi);
}

template <membrane::Real S>
void check_crumpled(double amplitude) {
    const auto mesh = membrane::icosphere<S>({.radius = 1, .subdivisions = 2});
    const LocalSurface<S> surface(mesh);
    AabbTree<S> tree(mesh);
    int inside = 0, folded = 0;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed, amplitude);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Points<S> x = test::jittered<S>(mesh.positions(), static_cast<S>(amplitude), random);
        tree.refit(x);
        const Vector3<S> q = random.vector<S>(S(-1.3), S(1.3));
        if (tree.closest_point(x, q).squared_distance < S(1e-8)) continue;
        const double expected = by_angles<S>(surface, x, q);
        const int found = winding_number(surface, tree, x, q);
        REQUIRE(std::abs(expected - found) < 1e-2);
        inside += found == 1;
        folded += found != 0 && found != 1;
    }
    CHECK(inside > cases(2000) / 10);
    if (amplitude > 0.5) CHECK(folded > 0);
}

}  // namespace

TEST_CASE("a sphere, however crumpled, winds round a point as often as its solid angles say") {
    for (const double amplitude : {0.0, 0.1, 0.8}) {
        check_crumpled<double>(amplitude);
        check_crumpled<float>(amplitude);
    }
}

TEST_CASE("a ray through corners and along edges is counted once") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 1});
    const LocalSurface<double> surface(mesh);
    const AabbTree<double> tree(mesh);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        for (const double part : {0.0, 0.5, 0.9}) {
            Vector3<double> q = membrane::point(mesh.positions(), v);
            CAPTURE(v, part);
            q.z() *= part;  // straight below the corner, or above it
            if (tree.closest_point(mesh.positions(), q).squared_distance < 1e-8) continue;
            CHECK(winding_number(surface, tree, mesh.positions(), q) ==
                  std::lround(by_angles<double>(surface, mesh.positions(), q)));
        }
    }
}

TEST_CASE("a point on the surface is inside or outside") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 1});
    const LocalSurface<double> surface(mesh);
    const AabbTree<double> tree(mesh);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const int number = winding_number(surface, tree, mesh.positions(), membrane::point(mesh.positions(), v));
        CHECK((number == 0 || number == 1));
    }
}
