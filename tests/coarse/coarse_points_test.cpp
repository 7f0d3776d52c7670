// SPDX-License-Identifier: MIT
#include <membrane/coarse/coarse_points.hpp>

#include <cmath>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/surface/mesh_checks.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;

namespace {

double sum_of_weights(const CoarsePoints& points, Index v) {
    double sum = 0;
    for (const auto& [k, weight] : points.weights(v)) sum += static_cast<double>(weight);
    return sum;
}

}  // namespace

TEST_CASE("coarse points are about as many as asked, and no vertex is far from them", "[coarse]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    for (const Index count : {1, 12, 64, 200, 641}) {
        CAPTURE(count);
        const CoarsePoints points(mesh, network, count);
        CHECK(points.count() >= 0.8 * count);
        CHECK(points.count() <= 1.2 * count);
        for (Index v = 0; v < mesh.vertex_count(); ++v) REQUIRE(points.weights(v).size() >= 1);
    }
}

TEST_CASE("points with equal displacements displace every vertex equally, beside pins less", "[coarse]") {
    const auto sphere = icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const CoarsePoints free(sphere, MassSpringNetwork(sphere, LinearSpring{}, {.stiffness = 40.0}), 50);
    for (Index v = 0; v < sphere.vertex_count(); ++v) CHECK(sum_of_weights(free, v) == Approx(1).margin(1e-6));

    const auto mesh = disc<double>({.radius = 0.005, .rings = 16});
    const auto rim = border(mesh);
    const CoarsePoints held(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 40.0, .pinned = rim}), 50);
    for (const Index v : rim) CHECK(held.weights(v).empty());
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const double from_rim = 0.005 - mesh.positions().col(v).norm();
        if (from_rim > 2.5 * held.spacing()) CHECK(sum_of_weights(held, v) == Approx(1).margin(1e-6));
        if (from_rim < 0.1 * held.spacing()) CHECK(std::abs(sum_of_weights(held, v)) < 0.3);
    }
}

TEST_CASE("an affine motion of the points displaces every vertex by it", "[coarse]") {
    test::Random random(1);
    // In a plane exactly; of a curved surface as far as its few points show how it curves.
    const auto deviation = [&](const TriangleMesh<double>& mesh, Index count) {
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
        const CoarsePoints points(mesh, network, count);
        Eigen::Matrix3d map;
        for (int i = 0; i < 3; ++i) map.col(i) = Eigen::Vector3d(random.vector<double>(-1, 1));
        // The points are the vertices that follow themselves alone: where they are is seen from the weights of x.
        Points<double> at = Points<double>::Zero(3, points.count());
        Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(mesh.vertex_count(), points.count());
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            for (const auto& [k, weight] : points.weights(v)) weights(v, k) = static_cast<double>(weight);
        }
        at = (weights.transpose() * weights)
                 .ldlt()
                 .solve(weights.transpose() * mesh.positions().transpose())
                 .transpose();
        const Eigen::MatrixXd moved = map * at * weights.transpose();
        const Eigen::MatrixXd expected = map * mesh.positions();
        return (moved - expected).colwise().norm().maxCoeff() / expected.colwise().norm().maxCoeff();
    };
    CHECK(deviation(disc<double>({.radius = 0.005, .rings = 14}), 60) < 1e-5);
    CHECK(deviation(icosphere<double>({.radius = 0.01, .subdivisions = 3}), 100) < 1e-2);
}

TEST_CASE("there are no points without free vertices, and no more than free vertices", "[coarse]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 1});
    std::vector<Index> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) all.push_back(v);
    CHECK(CoarsePoints(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = all}), 8).count() ==
          0);

    const CoarsePoints points(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0}), 1000);
    CHECK(points.count() == mesh.vertex_count());
    CHECK(points.spacing() == 0);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        REQUIRE(points.weights(v).size() == 1);
        CHECK(points.weights(v)[0].weight == 1);
    }
}

TEST_CASE("each piece of a mesh has coarse points, however few are asked", "[coarse]") {
    const auto piece = disc<double>({.radius = 0.005, .rings = 5});
    const Index vertices = piece.vertex_count(), triangles = piece.triangle_count();
    for (const Index pieces : {1, 2, 7}) {
        Points<double> x(3, pieces * vertices);
        Triangles corners(3, pieces * triangles);
        for (Index i = 0; i < pieces; ++i) {
            x.middleCols(i * vertices, vertices) = piece.positions();
            x.middleCols(i * vertices, vertices).row(0).array() += 0.02 * i;
            corners.middleCols(i * triangles, triangles) = piece.triangles().array() + i * vertices;
        }
        const TriangleMesh<double> mesh(x, corners);
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
        for (Index count = 1; count < 2 * pieces; ++count) {
            CAPTURE(pieces, count);
            const CoarsePoints points(mesh, network, count);
            CHECK(points.count() >= pieces);
            CHECK(points.spacing() < 0.011);
            for (Index v = 0; v < mesh.vertex_count(); ++v) CHECK(sum_of_weights(points, v) == Approx(1).margin(1e-6));
        }
    }
}

TEST_CASE("coarse points of another network than the mesh's are refused", "[coarse]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 1});
    const auto other = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(other, LinearSpring{}, {.stiffness = 1.0});
    CHECK(test::refusal([&] { CoarsePoints(mesh, network, 8); }) ==
          "CoarsePoints: the network must be of the mesh's 42 vertices, got one of 162");
}
