// SPDX-License-Identifier: MIT
#include "support/specimen.hpp"

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string>

#include <Eigen/Geometry>

#include <membrane/surface/shapes.hpp>

#include "mesh_texts.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace test;

namespace {

/// What is said of the file.
std::string noted(const examples::MeshOptions& options) {
    std::ostringstream said;
    auto* const error = std::cerr.rdbuf(said.rdbuf());
    (void)options.specimen(examples::stock_sphere());
    std::cerr.rdbuf(error);
    return said.str();
}

}  // namespace

TEST_CASE("a sphere is met where it is highest, a disc in its middle") {
    const auto sphere = examples::specimen_of(examples::stock_sphere());
    CHECK(sphere.size == Approx(0.01).epsilon(1e-12));
    CHECK(sphere.centre.norm() < 1e-12);
    CHECK((sphere.above(0.3) - Eigen::Vector3d(0, 0, 0.013)).norm() < 1e-12);
    CHECK(sphere.tool_radius() == Approx(0.002));
    CHECK(sphere.rim().size() > 200);  // a sphere has none: its lower half
    for (const auto v : sphere.rim()) CHECK(sphere.surface.points(2, v) < 0);

    const auto mesh = membrane::disc<double>({.radius = 0.01, .rings = 8});
    const auto disc = examples::specimen_of(mesh);
    CHECK(disc.vertex == 0);
    CHECK(disc.outward == Eigen::Vector3d(0, 0, 1));
    CHECK(disc.rim() == membrane::border(mesh));
}

TEST_CASE("wherever a membrane is and however large, it is met at the same place") {
    for (int seed = 1; seed <= cases(50, 1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = seed % 2 == 0 ? membrane::spherical_cap<double>({.rings = 5})
                                        : membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
        const double scale = random.number(1e-3, 1e3);
        const Eigen::Vector3d shift = 0.1 * scale * random.vector<double>(-1, 1);
        const auto at_rest = examples::specimen_of(mesh);
        const auto moved = examples::specimen_of(
            membrane::TriangleMesh<double>((scale * mesh.positions()).colwise() + shift, mesh.triangles()));
        CHECK(moved.vertex == at_rest.vertex);
        CHECK(moved.size == Approx(scale * at_rest.size));
        CHECK((moved.above(0.3) - scale * at_rest.above(0.3) - shift).norm() < 1e-9 * scale);
        if (seed % 2 == 0) CHECK(moved.rim() == at_rest.rim());  // half of a sphere is a matter of rounding
    }
}

TEST_CASE("the lens that comes with the examples is a membrane") {
    examples::MeshOptions options{.file = MEMBRANE_EXAMPLE_DATA "/lens.obj", .unit = "mm"};
    const auto lens = options.specimen(examples::stock_sphere());
    CHECK(lens.surface.points.cols() == 296);
    CHECK(lens.surface.triangles.cols() == 588);
    CHECK(lens.size == Approx(4.48742e-3));  // the rim's 42 corners are up to 4.5 mm off along x, not along y
    CHECK((lens.above(0) - Eigen::Vector3d(0, 0, 1.6e-3)).norm() < 1e-12);
    CHECK(lens.outward.z() == Approx(1));
    double volume = 0;
    for (const auto& t : lens.surface.triangles.colwise()) {
        const auto& x = lens.surface.points;
        const Eigen::Vector3d a = x.col(t[0]), b = x.col(t[1]), c = x.col(t[2]);
        volume += a.dot(b.cross(c)) / 6;
    }
    CHECK(volume == Approx(2.0 / 3 * 3.14159265 * 4.5e-3 * 4.5e-3 * 4e-3).epsilon(0.05));  // faces outward

    options.unit = "cm";
    CHECK(options.specimen(examples::stock_sphere()).size == Approx(4.48742e-2));
    CHECK(noted(options).empty());
    options.unit = "m";
    CHECK_THAT(noted(options), ContainsSubstring("lens.obj is 9 m large; in millimetres? --unit mm"));
    options.file = "";
    CHECK(options.specimen(examples::stock_sphere()).surface.points.cols() == 642);

    const Folder folder;
    options.file =
        folder.file("moebius.off",
                    "OFF\n5 5 0\n1 0 0\n0 1 0\n-1 0 0\n0 -1 0\n0 0 1\n3 0 1 2\n3 1 2 3\n3 2 3 4\n3 3 4 0\n3 4 0 1\n");
    CHECK_THAT(refusal([&] { (void)options.specimen(examples::stock_sphere()); }), ContainsSubstring("TriangleMesh: "));
}
