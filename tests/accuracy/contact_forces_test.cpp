// SPDX-License-Identifier: MIT
// How the force of a tool is distributed over the membrane: the contact points of a solver at rest against those of
// Newton's method.
#include <algorithm>
#include <cmath>
#include <span>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/membrane.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

// Forces on the vertices (3 x V [N]): of points that share an edge or a corner only the sum is unique.
template <class Point>
Points<double> forces_on_vertices(Index vertices, std::span<const Point> points) {
    Points<double> forces = Points<double>::Zero(3, vertices);
    for (const auto& point : points) {
        for (std::size_t k = 0; k < 3; ++k) {
            forces.col(point.corners[k]) += point.weights[static_cast<Eigen::Index>(k)] * point.force;
        }
    }
    return forces;
}

double largest(const Points<double>& forces) { return forces.colwise().norm().maxCoeff(); }

}  // namespace

TEST_CASE("at rest the contact points push on each vertex as in the equilibrium", "[contact_forces]") {
    const int runs = cases(60);
    for (int seed = 1; seed <= runs; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = seed % 3 == 0 ? 3 : 2});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
        const VirtualVolumeSprings volume(mesh, {.stiffness = 8.0, .damping = 0.02});
        QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 4, .force_tolerance = 1e-9});
        AabbTree tree(mesh);
        ContactTracker tracker(mesh, {.fine_triangles = 0});
        Points<double> x = mesh.positions();
        const Vector3<double> out = random.unit_vector();
        Tool<double> tool{.radius = random.number(0.001, 0.004)};
        if (seed % 2 == 0) tool.axis = 0.004 * direction<double>(cross(out, Vector3<double>(0.3, 0.5, 0.8)), out);
        const double depth = random.number(0.0002, 0.001);
        Contact<double> contact;
        StepReport<double> report;
        for (int tick = 0; tick < 3000 && !(tick > 60 && report.converged); ++tick) {
            const double part = std::min(tick / 50.0, 1.0);
            tool.position = (0.01 + tool.radius - part * depth) * out - tool.axis / 2;
            contact = tracker.update(tree, x, tool);
            report = solver.step(x, 1e-3, network, volume, press(tool, contact));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
        }
        REQUIRE(report.converged);
        const auto points = solver.contact_points(0);
        REQUIRE_FALSE(points.empty());
        CHECK(solver.contact_points(1).empty());
        CHECK(solver.contact_points(1000).empty());

        Vector3<double> sum = Vector3<double>::Zero();
        for (const auto& point : points) {
            CHECK(norm<double>(cross(point.force, point.normal)) <= 1e-12);
            CHECK(dot(point.force, point.normal) <= 0);
            sum -= point.force;
        }
        CHECK(norm<double>(sum - report.reactions[0]) <= 1e-12);

        const auto exact = equilibrium(x, mesh, network, volume, {}, press(tool, contact));
        REQUIRE(exact.converged);
        const auto found = forces_on_vertices<ContactPoint<double>>(mesh.vertex_count(), points);
        const auto expected = forces_on_vertices<ToolPoint>(mesh.vertex_count(), exact.contacts);
        CHECK(largest(found - expected) <= 1e-4 * largest(expected));
    }
}
