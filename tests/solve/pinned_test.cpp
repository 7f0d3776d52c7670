// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/contact_newton.hpp"
#include "support/random.hpp"

// Which vertices are pinned is the network's affair, and that of the network of the step alone.

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

const TriangleMesh<double> mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
const VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 4.0, .damping = 0.02});

auto network_with(std::vector<Index> pinned) {
    return MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 40.0, .pinned = std::move(pinned)});
}

std::vector<Index> some_vertices(Random& random) {
    std::vector<Index> some;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (random.chance(0.1)) some.push_back(v);
    }
    return some;
}

SolverOptions<double> options_of(Random& random) {
    return {.layers = random.chance(0.3) ? unlimited : random.index(4),
            .adaptive_layers = random.chance(0.3),
            .sweeps = 1 + random.index(3)};
}

}  // namespace

TEST_CASE("a solver does not care what another network than that of the step has pinned", "[pinned]") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        CAPTURE(seed);
        Random random(seed);
        const auto network = network_with(some_vertices(random)), other = network_with(some_vertices(random));
        const auto options = options_of(random);
        QuasiStaticSolver one(network, options), two(other, options);
        auto x = mesh.positions(), y = x;
        Index v = random.index(mesh.vertex_count());
        for (int tick = 0; tick < 12; ++tick) {
            if (random.chance(0.2)) v = random.index(mesh.vertex_count());
            if (random.chance(0.2)) one.wake_all(), two.wake_all();
            const Vector3<double> target = point(mesh.positions(), v) + random.vector(-2e-3, 2e-3);
            const auto step = one.step(x, 1e-3, network, foundation, pull(v, target));
            const auto again = two.step(y, 1e-3, network, foundation, pull(v, target));
            REQUIRE(same_bits(x, y));
            REQUIRE(step.vertex_updates == again.vertex_updates);
            REQUIRE(step.converged == again.converged);
        }
    }
}

TEST_CASE("what the network of the step pins does not move, whatever went before", "[pinned]") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        CAPTURE(seed);
        Random random(seed);
        const auto free = network_with({});
        const auto pinned = some_vertices(random);
        const auto network = network_with(pinned);
        QuasiStaticSolver solver(free, options_of(random));
        auto x = mesh.positions();
        const Index v = random.index(mesh.vertex_count());
        for (int tick = 0; tick < 6; ++tick) {  // in motion, with something to predict
            const Vector3<double> target = (1 + 0.02 * tick) * point(mesh.positions(), v);
            REQUIRE(solver.step(x, 1e-3, free, foundation, pull(v, target)).status == StepStatus::advanced);
        }
        const auto before = x;
        for (int tick = 6; tick < 200; ++tick) {
            if (tick == 9) solver.wake_all();
            const Vector3<double> target = (1 + 0.02 * (tick < 12 ? tick : 12)) * point(mesh.positions(), v);
            const auto report = solver.step(x, 1e-3, network, foundation, pull(v, target));
            REQUIRE(report.status == StepStatus::advanced);
            for (const Index fixed : pinned) REQUIRE(same_bits(point(x, fixed), point(before, fixed)));
        }
        for (int tick = 0; tick < 3000; ++tick) {  // and does not keep the others from their rest
            const auto report = solver.step(x, 1e-3, network, foundation);
            if (report.converged) break;
            REQUIRE(tick < 2999);
        }
    }
}

TEST_CASE("a rim that its user moves takes the membrane along", "[pinned]") {
    const auto cap = spherical_cap({.radius = 0.01, .diameter = 0.015, .rings = 8});
    const auto rim = border(cap);
    const MassSpringNetwork network(cap, LinearSpring{}, {.stiffness = 40.0, .pinned = rim});
    const MassSpringNetwork free(cap, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings soft(cap, {.stiffness = 1.0});
    const auto is_woken = [&](const SolverOptions<double>& options, bool wakes, bool by_network = true,
                              bool refuses = false) {
        QuasiStaticSolver solver(network, options);
        Points<double> x = cap.positions();
        StepReport<double> report;
        for (int tick = 0; tick < 2000 && !(tick > 60 && report.converged); ++tick) {
            if (tick > 20 && tick <= 40) {
                for (const Index v : rim) x.col(v) += 5e-5 * Vector3<double>(1, 0.5, 0.2);
            }
            if (wakes) solver.wake_all();
            const auto step = [&](const auto&... loads) {
                return by_network ? solver.step(x, 1e-3, network, soft, loads...)
                                  : solver.step(x, 1e-3, free, soft, pin(rim), loads...);
            };
            if (refuses && tick > 20 && tick <= 40) {  // it moves in steps that are refused
                REQUIRE(step(load<double>({0, 1, 2}, {1, 0, 0}, {NAN, 0, 0})).status == StepStatus::invalid_input);
                continue;
            }
            report = step();
            REQUIRE(report.status == StepStatus::advanced);
        }
        REQUIRE(report.converged);
        return x;
    };
    const SolverOptions<double> all{.layers = unlimited, .sweeps = 4};
    const auto x = is_woken(all, false), y = is_woken(all, true);
    CHECK((x - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((x - cap.positions()).colwise().norm().minCoeff() > 1e-6);
    const SolverOptions<double> as_needed{.layers = unlimited, .adaptive_layers = true, .sweeps = 4};
    CHECK((is_woken(as_needed, false) - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((is_woken(all, false, false) - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((is_woken(as_needed, false, false) - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((is_woken(all, false, true, true) - y).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((is_woken(all, false, false, true) - y).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("a rim at rest wakes nothing", "[pinned]") {
    const auto cap = spherical_cap({.radius = 0.01, .diameter = 0.015, .rings = 8});
    const MassSpringNetwork network(cap, LinearSpring{}, {.stiffness = 40.0, .pinned = border(cap)});
    QuasiStaticSolver solver(network);
    Points<double> x = 1.1 * cap.positions();  // out of equilibrium
    for (int tick = 0; tick < 3; ++tick) CHECK(solver.step(x, 1e-3, network, NoFoundation{}).vertex_updates == 0);
}

TEST_CASE("a ball on a sphere beside pinned vertices comes to rest", "[pinned]") {
    Random random(5);
    const double ball = mean_edge(mesh);
    for (int seed = 1; seed <= 30; ++seed) {
        const bool one = seed % 2 == 0;
        std::vector<Index> pins;
        for (Index v = 20 % (one ? 21 : 2); v < mesh.vertex_count(); v += one ? mesh.vertex_count() : 2)
            pins.push_back(v);
        CAPTURE(seed, one);
        const auto network = network_with(pins);
        QuasiStaticSolver<double> solver(network, {.layers = 6, .sweeps = 2});
        AabbTree<double> tree(mesh);
        ContactTracker<double> tracker(mesh);
        auto x = mesh.positions();
        const Vector3<double> above = point(mesh.positions(), 20) + random.vector(-0.7 * ball, 0.7 * ball);
        const Vector3<double> out = above.normalized();
        const double depth = 0.5 * ball * seed / 30;
        StepReport<double> report;
        for (int tick = 0; tick < 500 && !(tick > 100 && report.converged); ++tick) {
            const double in = depth * std::min(1.0, tick / 100.0);
            const Tool<double> tool{.position = (0.01 + ball - in) * out, .radius = ball};
            report = solver.step(x, 1e-3, network, foundation, press(tool, tracker.update(tree, x, tool)));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
        }
        CHECK(report.converged);
    }
}

namespace {

/// A flat mesh with its rim and some vertices inside pinned, and a ball of an edge's radius that presses it from above.
struct BallOnSheet {
    const TriangleMesh<double>& flat;
    double foundation_stiffness;  // [N/m]
    std::vector<Index> pins;
    SolverOptions<double> options;

    MassSpringNetwork<double, LinearSpring> network{flat, LinearSpring{}, {.stiffness = 40.0, .pinned = pins}};
    VirtualVolumeSprings<double> volume{flat, {.stiffness = foundation_stiffness}};
    QuasiStaticSolver<double> solver{network, options};
    double radius = mean_edge(flat);
    double fine_triangles = TrackerOptions().fine_triangles;
    Tool<double> tool{};
    Points<double> x = flat.positions();

    /// The last step after the ball has gone to `depth` below the mesh, and has waited for equilibrium.
    StepReport<double> press_at(const Vector3<double>& at, double depth) {
        AabbTree<double> tree(flat);
        ContactTracker<double> tracker(flat, {.fine_triangles = fine_triangles});
        StepReport<double> report;
        for (int tick = 0; tick < 1500 && !(tick > 100 && report.converged); ++tick) {
            const double down = depth * std::min(1.0, tick / 100.0);
            tool = {.position = {at.x(), at.y(), radius - down}, .radius = radius};
            report = solver.step(x, 1e-3, network, volume, press(tool, tracker.update(tree, x, tool)));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
        }
        return report;
    }

    /// The largest sum of all forces on a free vertex [N].
    double unbalanced() const {
        Points<double> force(3, flat.vertex_count());
        for (Index v = 0; v < flat.vertex_count(); ++v) {
            const auto here = point(x, v);
            force.col(v) = network.force_on(v, x).force + volume.force_on(v, here, here, 1.0).force;
        }
        for (const auto& contact : solver.contact_points(0)) {
            for (std::size_t k = 0; k < 3; ++k)
                force.col(contact.corners[k]) += contact.weights[static_cast<Index>(k)] * contact.force;
        }
        for (const Index v : pins) force.col(v).setZero();
        return force.colwise().norm().maxCoeff();
    }
};

/// The rim, the vertex in the middle, and every other vertex unless `one`.
std::vector<Index> pins_of(const TriangleMesh<double>& flat, bool one) {
    Index middle = 0;
    flat.positions().colwise().norm().minCoeff(&middle);
    std::vector<Index> pins = border(flat);
    pins.push_back(middle);
    for (Index v = middle % 2; v < flat.vertex_count() && !one; v += 2) pins.push_back(v);
    std::sort(pins.begin(), pins.end());
    pins.erase(std::unique(pins.begin(), pins.end()), pins.end());
    return pins;
}

}  // namespace

TEST_CASE("a ball on a sheet beside pinned vertices comes to rest", "[pinned]") {
    const auto square = sheet<double>({.width = 0.02, .height = 0.02, .columns = 12, .rows = 12});
    const auto round = disc<double>({.radius = 0.01, .rings = 7});
    for (int seed = 1; seed <= cases(60, 1'000); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const bool one = random.chance(0.5), founded = random.chance(0.7);
        const auto& flat = random.chance(0.5) ? square : round;
        BallOnSheet scene{flat, founded ? 4.0 : 0.0, pins_of(flat, one), {.layers = unlimited}};
        const auto at = random.vector(-0.7 * scene.radius, 0.7 * scene.radius);
        const double depth = scene.radius * random.number(0.1, 1.0);
        CAPTURE(seed, one, founded, depth / scene.radius);
        const auto report = scene.press_at(at, depth);
        // Without foundation a force may creep between nearly coincident points, long after the forces balance.
        CHECK((report.converged || !founded));
        CHECK(scene.unbalanced() < 1e-8);
    }
}

TEST_CASE("beside a pin the forces are those of Newton's method", "[pinned]") {
    const auto square = sheet<double>({.width = 0.02, .height = 0.02, .columns = 8, .rows = 8});
    const auto pins = pins_of(square, true);
    int at_the_pin = 0;
    for (int seed = 1; seed <= cases(20, 200); ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        // A stiff support: for Newton's method a pin does not yield, and the ball must stay beside it.
        BallOnSheet scene{square, 4.0, pins, {.layers = unlimited, .sweeps = 4, .rigid_stiffness = 1e8}};
        scene.fine_triangles = 0;                                                       // as for Newton's method
        const double beside = random.number(0.3, 1.5), turn = random.number(0.0, 6.3);  // [radii], [rad]
        const Vector3<double> at = beside * scene.radius * Vector3<double>(std::cos(turn), std::sin(turn), 0);
        const double lowest = beside < 1 ? 1 - std::sqrt(1 - beside * beside) : 1.0;
        const double depth = 0.95 * scene.radius * lowest * random.number(0.2, 1.0);
        CAPTURE(seed, beside, depth);
        const auto report = scene.press_at(at, depth);
        REQUIRE(report.converged);
        const auto springs = scene.network.springs();
        const test::PressedMembrane membrane{square.triangles(), {springs.begin(), springs.end()},
                                             square.positions(), 4.0,
                                             {scene.tool},       {pins.begin(), pins.end()}};
        const auto newton = test::at_rest(membrane, scene.x, {.far = scene.radius / 2, .max_step = scene.radius / 4});
        REQUIRE(newton.converged);
        CHECK((report.reactions[0] - newton.reactions[0]).norm() < 1e-3 * newton.reactions[0].norm() + 1e-8);
        for (const auto& contact : scene.solver.contact_points(0)) {
            const auto is_pin = [&](Index v) { return v == square.vertex_count() / 2; };
            at_the_pin +=
                norm(contact.force) > 0 && std::any_of(contact.corners.begin(), contact.corners.end(), is_pin);
        }
    }
    CHECK(at_the_pin > 0);
}
