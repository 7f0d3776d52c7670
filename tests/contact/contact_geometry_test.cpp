// SPDX-License-Identifier: MIT
#include <membrane/contact/contact_geometry.hpp>

#include <cmath>

#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using membrane::Index;
using membrane::Tool;
using membrane::Vector3;

namespace {

const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 1, .rows = 1});
const membrane::LocalSurface<double> surface(mesh);

}  // namespace

TEST_CASE("over a sheet, gap and normal are the height's, on either side") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index f = random.index(2);
        const double side = random.chance(0.5) ? 1 : -1, height = random.number(-0.2, 0.2), radius = 0.1;
        const Vector3<double> foot = membrane::point_at(surface.triangle(mesh.positions(), f), random.barycentric());
        const Tool<double> tool{.position = foot + Vector3<double>(0, 0, side * height), .radius = radius};
        const auto contact = membrane::contact_in(surface, mesh.positions(), f, tool, radius, side);
        CAPTURE(seed, side, height);
        CHECK(std::abs(contact.gap - (height - radius)) < 1e-12);
        CHECK((contact.normal - Vector3<double>(0, 0, side)).norm() < 1e-9);
        CHECK((contact.point - foot).norm() < 1e-12);
        CHECK(contact.patch.side == side);
        CHECK(contact.corners == surface.corners(f));
    }
}

TEST_CASE("beside a border the tool is simply beside it, whichever side it was on") {
    const Tool<double> tool{.position = {0.55, 0.1, -0.02}, .radius = 0.1};
    const Index f = surface.walk_to_closest(mesh.positions(), 0, tool.position);
    const auto contact = membrane::contact_in(surface, mesh.positions(), f, tool, 0.1, 1.0);
    CHECK(contact.patch.side == -1);
    CHECK(std::abs(contact.gap - (std::hypot(0.05, 0.02) - 0.1)) < 1e-12);
    CHECK(contact.normal.x() > 0);
}

TEST_CASE("a shaft stuck through counts by its lower end") {
    const Tool<double> shaft{.position = {0.2, -0.1, 0.3}, .axis = {0, 0, -0.5}, .radius = 0.01};
    bool found = false;
    for (Index f = 0; f < 2; ++f) {
        if (closest_to_axis(surface.triangle(mesh.positions(), f), shaft).on_triangle.squared_distance > 0) continue;
        found = true;
        const auto contact = membrane::contact_in(surface, mesh.positions(), f, shaft, 0.01, 1.0);
        CHECK(std::abs(contact.gap - (-0.2 - 0.01)) < 1e-12);
        CHECK(std::abs(contact.patch.axis_point.z() + 0.2) < 1e-12);
    }
    CHECK(found);
}

TEST_CASE("a shaft stuck through overlaps by its radius at least, also with its ends beyond the border") {
    const double radius = 0.01;
    for (int seed = 1; seed <= cases(1000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index f = random.index(2);
        const Vector3<double> at = membrane::point_at(surface.triangle(mesh.positions(), f), random.barycentric());
        Vector3<double> along = random.unit_vector();
        if (random.chance(0.5)) along.z() *= 0.01;
        const Tool<double> shaft{
            .position = at - random.number(0.1, 2.0) * along, .axis = 4 * random.number() * along, .radius = radius};
        if (closest_to_axis(surface.triangle(mesh.positions(), f), shaft).on_triangle.squared_distance > 0) continue;
        const auto contact = membrane::contact_in(surface, mesh.positions(), f, shaft, radius, 1.0);
        CAPTURE(seed);
        CHECK(contact.gap <= -radius + 1e-12);
        CHECK(contact.normal.z() > 0);
    }
}

TEST_CASE("where a point passed, the contact is what it passed") {
    const Vector3<double> barycentric(0.2, 0.3, 0.5), from(0.1, 0.1, 1), to(0.1, 0.1, -0.4);
    const auto contact = membrane::contact_where_passed(surface, mesh.positions(), 1, barycentric, from, to, 1.0);
    CHECK(contact.triangle == 1);
    CHECK(std::abs(contact.gap + 0.4) < 1e-12);
    CHECK(contact.patch.tunnelled);
    CHECK(contact.patch.previous_axis_point == from);
    CHECK(contact.patch.axis_point == to);
    CHECK((contact.point - membrane::point_at(surface.triangle(mesh.positions(), 1), barycentric)).norm() < 1e-15);
    CHECK(contact.normal.z() == 1);
}
