// SPDX-License-Identifier: MIT
#include <membrane/accuracy/tangent_stiffness.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/newton.hpp"
#include "support/random.hpp"
#include "support/sparse_newton.hpp"

using namespace membrane;

namespace {

Eigen::Matrix3d dense(const Symmetric3<double>& a) {
    Eigen::Matrix3d m;
    m << a.xx, a.xy, a.xz, a.xy, a.yy, a.yz, a.xz, a.yz, a.zz;
    return m;
}

/// Minus the change of `reaction(d)` for a shift d, by central differences.
template <class Reaction>
Eigen::Matrix3d by_differences(double h, Reaction reaction) {
    Eigen::Matrix3d result;
    for (int k = 0; k < 3; ++k) {
        const Vector3<double> displacement = h * Vector3<double>::Unit(k);
        result.col(k) = (reaction(-displacement) - reaction(displacement)) / (2 * h);
    }
    return result;
}

}  // namespace

TEST_CASE("the slope of a held vertex's reaction, all vertices free or some", "[tangent_stiffness]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    TangentStiffness tangent(network);
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double stiffness = 40 * std::pow(10, random.number(-1.5, 1.0));
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness, .damping = 0.1});
        const Index held = random.index(mesh.vertex_count());
        Points<double> x = mesh.positions();
        const Vector3<double> target = (1 + random.number(-0.05, 0.1)) * point(x, held);
        PropagationQueue queue(mesh.vertex_count());
        const bool all = random.chance(0.5);
        queue.build(network, std::array{held}, all ? unlimited : 1 + random.index(5));

        test::StillMembrane still(network, mesh.positions(), stiffness);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (v == held || !queue.contains(v)) still.fix(v);
        }
        const auto rest_at = [&](const Vector3<double>& place) {
            Points<double> start = x;
            start.col(held) = place;
            return still.equilibrium(start).x;
        };
        x = rest_at(target);
        const auto expected = by_differences(2e-8, [&](const Vector3<double>& displacement) {
            return Vector3<double>(still.forces(rest_at(target + displacement)).col(held));
        });
        const auto found = all ? tangent.compute(x, network, foundation, pull(held, target))
                               : tangent.compute(queue.vertices(), x, network, foundation, pull(held, target));
        REQUIRE(found.status == TangentStatus::found);
        CHECK((dense(found.stiffness) - expected).norm() < 1e-6 * expected.norm());
    }
}

TEST_CASE("the slope of a solver's reaction, over the vertices of its queue", "[tangent_stiffness]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 10.0});
    QuasiStaticSolver solver(network, {.layers = 4, .sweeps = 400, .force_tolerance = 1e-14});
    TangentStiffness tangent(network);
    Points<double> x = mesh.positions();
    const Vector3<double> target = 0.98 * point(x, 7);
    const auto reaction_at = [&](const Vector3<double>& place) {
        for (int i = 0; i < 5; ++i) (void)solver.step(x, 1e-3, network, foundation, pull(7, place));
        return Vector3<double>(solver.step(x, 1e-3, network, foundation, pull(7, place)).reactions[0]);
    };
    const auto expected =
        by_differences(1e-6, [&](const Vector3<double>& displacement) { return reaction_at(target + displacement); });
    (void)reaction_at(target);
    const auto found = tangent.compute(solver.queue().vertices(), x, network, foundation, pull(7, target));
    REQUIRE(found.status == TangentStatus::found);
    CHECK((dense(found.stiffness) - expected).norm() < 1e-5 * expected.norm());
}

TEST_CASE("the slope of the reaction of a held point, and of pins", "[tangent_stiffness]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5});
    TangentStiffness tangent(network, {.tolerance = 1e-8});
    for (int seed = 1; seed <= cases(5); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index f = random.index(mesh.triangle_count());
        const std::array<Index, 3> corners{mesh.triangles()(0, f), mesh.triangles()(1, f), mesh.triangles()(2, f)};
        PointAttachment<double> held{f, corners, random.barycentric(), Vector3<double>::Zero()};
        held.target = 0.95 * point_at(triangle_at(mesh.positions(), corners), held.barycentric);
        test::SmallMembrane<MassSpringNetwork<double, LinearSpring>> small{
            .network = network, .anchors = mesh.positions(), .volume_stiffness = 0.5};
        const auto rest_at = [&](const Vector3<double>& place) {
            small.held = {{{corners.begin(), corners.end()},
                           {held.barycentric[0], held.barycentric[1], held.barycentric[2]},
                           place}};
            return small.equilibrium(mesh.positions());
        };
        const auto expected = by_differences(1e-4, [&](const Vector3<double>& displacement) {
            return Vector3<double>(-rest_at(held.target + displacement).holding[0]);
        });
        const auto found = tangent.compute(rest_at(held.target).x, network, foundation, held);
        REQUIRE(found.status == TangentStatus::found);
        CHECK((dense(found.stiffness) - expected).norm() < 1e-6 * expected.norm());
    }
    const std::array<Index, 2> pins{1, 4};
    test::StillMembrane still(network, mesh.positions(), 0.5);
    for (const Index v : pins) still.fix(v);
    const auto expected = by_differences(1e-5, [&](const Vector3<double>& displacement) {
        Points<double> x = mesh.positions();
        for (const Index v : {1, 4}) x.col(v) += displacement;
        const Points<double> forces = still.forces(still.equilibrium(x).x);
        return Vector3<double>(forces.col(1) + forces.col(4));
    });
    const auto found = tangent.compute(mesh.positions(), network, foundation, pin(pins));
    CHECK((dense(found.stiffness) - expected).norm() < 1e-6 * expected.norm());
}

TEST_CASE("what has no slope is said, and why", "[tangent_stiffness]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5});
    TangentStiffness tangent(network);
    const Points<double>& x = mesh.positions();
    const auto held = pull(7, point(x, 7));
    CHECK(tangent.compute(x, network, foundation, held).status == TangentStatus::found);
    CHECK(tangent.compute(0.5 * x, network, foundation, pull(7, 0.5 * point(x, 7))).status ==
          TangentStatus::not_stable);
    CHECK(tangent.compute(std::numeric_limits<double>::infinity() * x, network, foundation, held).status ==
          TangentStatus::invalid_input);
    CHECK(tangent.compute(std::array<Index, 2>{1, 42}, x, network, foundation, held).status ==
          TangentStatus::invalid_input);
    CHECK(tangent.compute(x, network, foundation, pull(42, point(x, 7))).status == TangentStatus::invalid_input);
    CHECK(tangent
              .compute(x, network, foundation, PointAttachment<double>{0, {0, 12, 14}, {0.5, 0.5, 0}, point(x, 0)},
                       pin(std::array{12}))
              .status == TangentStatus::unsupported);
    const auto loaded = tangent.compute(x, network, foundation, load({0, 1, 2}, Vector3<double>(1, 0, 0), point(x, 7)));
    CHECK(loaded.status == TangentStatus::found);
    CHECK(dense(loaded.stiffness).isZero(0));
    TangentStiffness hasty(network, {.iterations = 1});
    CHECK(hasty.compute(x, network, foundation, held).status == TangentStatus::not_converged);
    CHECK_THROWS_AS(TangentStiffness(network, {.tolerance = 0}), InvalidInput);
    CHECK_THROWS_AS(TangentStiffness(network, {.iterations = 0}), InvalidInput);
    TangentStiffness copy = tangent;
    CHECK(dense(copy.compute(x, network, foundation, held).stiffness) ==
          dense(tangent.compute(x, network, foundation, held).stiffness));
}

TEST_CASE("with nothing else free the slope is the vertex's own stiffness", "[tangent_stiffness]") {
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0F});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5F});
    TangentStiffness tangent(network);
    const auto found = tangent.compute(std::span<const Index>(), mesh.positions(), network, foundation,
                                       pull(7, point(mesh.positions(), 7)));
    REQUIRE(found.status == TangentStatus::found);
    Eigen::Matrix3d expected = 0.5 * Eigen::Matrix3d::Identity();
    for (const auto& end : network.springs_of(7)) {
        const Eigen::Vector3d u =
            (mesh.positions().col(end.other) - mesh.positions().col(7)).cast<double>().normalized();
        expected += u * u.transpose();
    }
    CHECK((dense(found.stiffness) - expected).norm() < 1e-6);
}

TEST_CASE("a status of a tangent has the name that it has in a program", "[tangent]") {
    CHECK(to_string(membrane::TangentStatus::found) == "found");
    CHECK(to_string(membrane::TangentStatus::not_stable) == "not_stable");
    CHECK(to_string(membrane::TangentStatus::not_converged) == "not_converged");
    CHECK(to_string(membrane::TangentStatus::contact) == "contact");
    CHECK(to_string(membrane::TangentStatus::unsupported) == "unsupported");
    CHECK(to_string(membrane::TangentStatus::invalid_input) == "invalid_input");
}
