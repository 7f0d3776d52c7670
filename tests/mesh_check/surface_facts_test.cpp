// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/mesh_check/validate.hpp>

#include <cmath>
#include <numbers>

#include "support/catch.hpp"
#include "support/meshes.hpp"

using namespace membrane;
using test::Surface;

// Against CGAL: validate_cgal_test.cpp.

TEST_CASE("facts of shapes that are known", "[mesh]") {
    const auto tetrahedron = test::tetrahedron<double>();
    const SurfaceFacts four = validate(tetrahedron.x, tetrahedron.triangles).facts;
    CHECK(four.closed());
    CHECK(four.vertices == 4);
    CHECK(four.edges == 6);
    CHECK(four.genus == 0);
    CHECK(four.facing == Facing::outward);
    CHECK(four.volume == Approx(1.0 / 6));
    CHECK(four.area == Approx(1.5 + std::sqrt(3.0) / 2));
    CHECK(four.shortest_edge == Approx(1));
    CHECK(four.max_edge == Approx(std::sqrt(2.0)));
    CHECK(four.mean_edge == Approx((1 + std::sqrt(2.0)) / 2));
    CHECK(four.smallest_angle == Approx(std::numbers::pi / 4));
    CHECK(four.largest_angle == Approx(std::numbers::pi / 2));
    CHECK(four.size == Vector3<double>(1, 1, 1));
    CHECK(four.likely_unit == LengthUnit::metre);

    const SurfaceFacts flat = validate(sheet({.width = 30, .height = 20, .columns = 3, .rows = 2})).facts;
    CHECK(!flat.closed());
    CHECK(flat.borders == 1);
    CHECK(flat.border_edges == 10);
    CHECK(flat.facing == Facing::unknown);
    CHECK(flat.volume == 0);
    CHECK(flat.area == Approx(600));
    CHECK(flat.likely_unit == LengthUnit::millimetre);

    const auto torus = test::klein_bottle<double>(9, 7, false);
    CHECK(validate(torus.x, torus.triangles).facts.genus == 1);
    Surface<double> two = torus;
    two.add(torus);
    two.x.rightCols(torus.x.cols()).array() += 20;
    for (Index f = torus.triangle_count(); f < two.triangle_count(); ++f) two.turn(f);
    const SurfaceFacts both = validate(two.x, two.triangles).facts;
    CHECK(both.genus == 2);
    CHECK(both.facing == Facing::both);
    CHECK(both.volume == Approx(0).margin(1e-9));
}

TEST_CASE("the unit is guessed from the size", "[mesh]") {
    CHECK(likely_unit(0.0117) == LengthUnit::metre);  // a cornea
    CHECK(likely_unit(11.7) == LengthUnit::millimetre);
    CHECK(likely_unit(11700) == LengthUnit::micrometre);
    for (const double extent : {1.001e-3, 1.999}) CHECK(likely_unit(extent) == LengthUnit::metre);
    for (const double extent : {2.001, 1.999e3}) CHECK(likely_unit(extent) == LengthUnit::millimetre);
    for (const double extent : {2.001e3, 1.999e6}) CHECK(likely_unit(extent) == LengthUnit::micrometre);
    for (const double extent : {1e-5, 0.999e-3, 2.001e6}) CHECK(likely_unit(extent) == LengthUnit::unknown);
    CHECK(likely_unit(1e9) == LengthUnit::unknown);
}
