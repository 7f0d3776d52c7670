// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/haptics/device.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/traps.hpp"

using namespace membrane;

namespace {

constexpr double radius = 0.01, stiffness = 40, dt = 1e-3;

/// How far `x` is from the shape `rest` where the two lie on one another best [m].
double distance_from_shape(const Points<double>& x, const Points<double>& rest) {
    const Eigen::Matrix4d best = Eigen::umeyama(x, rest, false);
    const Points<double> moved = (best.topLeftCorner<3, 3>() * x).colwise() + best.topRightCorner<3, 1>();
    return (moved - rest).colwise().norm().maxCoeff();
}

/// A sphere in a user's loop.
struct Membrane {
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network{mesh, LinearSpring{},
                                                    NetworkOptions<double>{.stiffness = stiffness}};
    QuasiStaticSolver<double> solver{network, SolverOptions<double>{.layers = 6, .sweeps = 4}};
    AabbTree<double> tree{mesh};
    ContactTracker<double> tracker{mesh};
    Grasper<double> grasper{mesh};
    Points<double> x = mesh.positions();

    explicit Membrane(Index subdivisions) : mesh(icosphere({.radius = radius, .subdivisions = subdivisions})) {}

    /// Plays `script`, and then lets the membrane come to rest. Returns the largest distance from the shape meanwhile
    /// and the one at the end [R].
    template <class Volume>
    std::pair<double, double> play(const std::vector<Waypoint<double>>& script, double tool_radius,
                                   const Volume& volume) {
        ScriptedDevice<double> device(script, {.tick = dt, .radius = tool_radius});
        double largest = 0;
        while (device.running()) {
            const auto tool = device.read();
            const auto contact = tracker.update(tree, x, tool);
            const auto grasp = grasper.update(contact, x, tool);
            const auto report = solver.step(x, dt, network, volume, press(tool, contact, grasp), pull(tool, grasp));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
            largest = std::max(largest, (x - mesh.positions()).colwise().norm().maxCoeff());
        }
        REQUIRE(test::run_to_equilibrium(solver, x, dt, network, volume).converged);
        return {largest / radius, distance_from_shape(x, mesh.positions()) / radius};
    }
};

/// Down onto the sphere along `from`, a fifth of the radius deep, and away again.
std::vector<Waypoint<double>> press_script(const Vector3<double>& from, double tool_radius) {
    const double touching = radius + tool_radius;
    return {{.time = 0, .position = (touching + 0.001) * from},
            {.time = 0.2, .position = (touching - 0.2 * radius) * from},
            {.time = 0.3, .position = (touching - 0.2 * radius) * from},
            {.time = 0.5, .position = (touching + 0.005) * from}};
}

/// Down onto the surface, which between its vertices lies lower than the sphere, closed there, a fifth of the radius
/// up, and opened.
std::vector<Waypoint<double>> pull_script(const Vector3<double>& from, double tool_radius) {
    const double touching = radius + tool_radius;
    return {{.time = 0, .position = (touching + 0.001) * from},
            {.time = 0.1, .position = (touching - 0.05 * radius) * from, .grasping = true},
            {.time = 0.3, .position = (touching + 0.2 * radius) * from, .grasping = true},
            {.time = 0.4, .position = (touching + 0.2 * radius) * from},
            {.time = 0.5, .position = (touching + 0.5 * radius) * from}};
}

}  // namespace

TEST_CASE("with volume springs of a hundredth of the springs the shape comes back", "[recovery]") {
    for (const Index subdivisions : {2, 3}) {
        for (const double part : {0.01, 0.2}) {
            for (int seed = 1; seed <= cases(2); ++seed) {
                CAPTURE(subdivisions, part, seed);
                test::Random random(static_cast<std::uint64_t>(seed));
                Membrane membrane(subdivisions);
                const VirtualVolumeSprings foundation(membrane.mesh,
                                                      {.stiffness = part * stiffness, .damping = part * 0.1});
                const auto pressed = membrane.play(press_script(random.unit_vector(), 2e-3), 2e-3, foundation);
                REQUIRE(pressed.first > 0.15);
                REQUIRE(pressed.second < 1e-6);
                const auto pulled = membrane.play(pull_script(random.unit_vector(), 5e-4), 5e-4, foundation);
                REQUIRE(pulled.first > 0.15);
                REQUIRE(pulled.second < 1e-6);
            }
        }
    }
}

TEST_CASE("without volume springs the shape does not come back from a press", "[recovery]") {
    for (const Index subdivisions : {2, 3}) {
        for (int seed = 1; seed <= cases(3); ++seed) {
            CAPTURE(subdivisions, seed);
            test::Random random(static_cast<std::uint64_t>(seed));
            const Vector3<double> from = random.unit_vector();
            Membrane pressed(subdivisions), pulled(subdivisions);
            const auto after_press = pressed.play(press_script(from, 2e-3), 2e-3, NoFoundation{});
            REQUIRE(after_press.first > 0.1);
            CHECK(after_press.second > 0.01);
            const auto after_pull = pulled.play(pull_script(from, 5e-4), 5e-4, NoFoundation{});
            REQUIRE(after_pull.first > 0.1);
            WARN("without volume springs, " << pressed.mesh.vertex_count() << " vertices: off by " << after_press.second
                                            << " R after the press, " << after_pull.second << " R after the pull");
        }
    }
}

namespace {

/// A tool that is somewhere else every ten ticks, in the sphere or up to a million radii away.
std::vector<Tool<double>> jumping_tool(test::Random& random) {
    std::vector<Tool<double>> displacement;
    Tool<double> tool{.position = {0, 0, 5 * radius}};
    if (random.chance(0.8)) tool.radius = radius * 0.02 * std::pow(50, random.number());
    for (int tick = 0; tick < 40; ++tick) {
        const double far = random.chance(0.5) ? 1 : std::pow(10, random.number(-1.0, 6.0));
        if (tick % 10 == 9) tool.position = radius * far * random.vector();
        displacement.push_back(tool);
    }
    return displacement;
}

}  // namespace

TEST_CASE("after a tool that jumps anywhere, the membrane comes back where its foundation is as stiff as its springs",
          "[recovery]") {
    const Membrane fresh(2);
    const VirtualVolumeSprings foundation(fresh.mesh, {.stiffness = stiffness});
    for (int seed = 1; seed <= cases(120, 20'000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Membrane membrane = fresh;
        auto& x = membrane.x;
        for (const auto& tool : jumping_tool(random)) {
            const Points<double> before = x;
            StepReport<double> report;
            {
                const test::FloatingPointTraps traps;
                const auto contact = membrane.tracker.update(membrane.tree, x, tool);
                report = membrane.solver.step(x, dt, membrane.network, foundation, press(tool, contact));
            }
            REQUIRE(is_finite(x));
            if (report.status != StepStatus::advanced) REQUIRE(x == before);
            for (const auto& reaction : report.reactions) REQUIRE(is_finite(reaction));
            membrane.tree.refit(x, report.moved);
        }
        REQUIRE(test::run_to_equilibrium(membrane.solver, x, dt, membrane.network, foundation).converged);
        REQUIRE((x - membrane.mesh.positions()).cwiseAbs().maxCoeff() < 1e-6 * radius);
    }
}

TEST_CASE("a tool that jumps through the membrane drags it along with a force that soon is a membrane's",
          "[recovery]") {
    for (const double foundation_stiffness : {4.0, 8.0, 40.0}) {
        CAPTURE(foundation_stiffness);
        Membrane membrane(3);
        const VirtualVolumeSprings foundation(membrane.mesh, {.stiffness = foundation_stiffness, .damping = 0.02});
        Vector3<double> force;
        for (int tick = 0; tick < 50; ++tick) {
            Tool<double> tool{.position = {0, 0, 0.02}, .radius = 1e-3};
            if (tick > 0) tool.position = {0.003, 0.002, -0.012};
            const auto contact = membrane.tracker.update(membrane.tree, membrane.x, tool);
            const auto report =
                membrane.solver.step(membrane.x, dt, membrane.network, foundation, press(tool, contact));
            REQUIRE(report.status == StepStatus::advanced);
            membrane.tree.refit(membrane.x, report.moved);
            force = report.reactions[0];
        }
        // What springs and foundation of a hundred vertices can pull with over that displacement.
        CHECK(norm(force) < 100 * (stiffness + foundation_stiffness) * 0.032);
        CHECK((membrane.x - membrane.mesh.positions()).cwiseAbs().maxCoeff() < 2 * 0.032);
    }
}
