// SPDX-License-Identifier: MIT
#include <membrane/accuracy/equilibrium.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/contact_newton.hpp"
#include "support/meshes.hpp"
#include "support/newton.hpp"
#include "support/random.hpp"
#include "support/reference_table.hpp"
#include "support/refusal.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;
using test::Random;
using test::ReferenceRow;
using test::refusal;

namespace {

using Point = Vector3<double>;

/// The membrane of a row of the tables, on a sphere of `radius` with all stiffnesses times `factor`.
struct Reference {
    double radius, factor;
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;

    explicit Reference(const ReferenceRow& row, double r = 1, double f = 1)
        : radius(r),
          factor(f),
          mesh(icosphere({.radius = r, .subdivisions = row.integer("level")})),
          network(mesh, LinearSpring{}, {.stiffness = stiffnesses(row)}),
          foundation(mesh, {.stiffness = f * row.number("k_volume"), .damping = 1.0}) {}

    std::vector<double> stiffnesses(const ReferenceRow& row) const {
        std::vector<double> result;
        const auto& x = mesh.positions();
        const Adjacency adjacency(mesh);
        for (const auto& [p, q] : adjacency.edges()) {
            const double middle = (x(0, p) + x(0, q)) / (2 * radius);
            result.push_back(factor * row.number("k") * (1 + row.number("vary") * middle));
        }
        return result;
    }
    Index vertex_at(const Point& place) const {
        Eigen::Index nearest = 0;
        (mesh.positions().colwise() - (radius * place.normalized()).eigen()).colwise().norm().minCoeff(&nearest);
        return static_cast<Index>(nearest);
    }
    VertexAttachment<double> hold(Index v, double by) const {
        return pull(v, ((1 + by) * mesh.positions().col(v)).eval());
    }

    template <class Volume>
    double energy(const Points<double>& x, const Volume& volume) const {
        double sum = network.energy(x);
        for (Index v = 0; v < mesh.vertex_count(); ++v) sum += volume.energy(v, point(x, v));
        return sum;
    }
};

bool is_slow(const ReferenceRow& row) { return !in_full() && row.integer("level") > 2; }

/// A row of the first table, in units of its own.
void check_row(const ReferenceRow& row, double radius, double factor) {
    const Reference membrane(row, radius, factor);
    const auto& initial = membrane.mesh.positions();
    const Index held = membrane.vertex_at({0, 1, std::numbers::phi});
    const Index layers = row.integer("layers") == 0 ? unlimited : row.integer("layers");
    const auto rest = equilibrium(initial, membrane.mesh, membrane.network, membrane.foundation,
                                  {.increments = 20, .layers = layers}, membrane.hold(held, row.number("delta")));
    REQUIRE(rest.converged);
    CHECK(rest.residual < 1e-13 * radius * factor);
    const double force = row.number("holding_force") * radius * factor;
    CHECK(-dot<double>(rest.reactions[0], initial.col(held)) / radius == Approx(force).epsilon(1e-9));
    const double energy = row.number("energy") * radius * radius * factor;
    CHECK(membrane.energy(rest.x, membrane.foundation) == Approx(energy).epsilon(1e-9));
    PropagationQueue all(membrane.mesh.vertex_count());
    all.build(membrane.network, std::array{held}, unlimited);
    for (const Index distance : {1, 2, 4, 8}) {
        CAPTURE(distance);
        double sum = 0;
        for (const Index v : all.layer(distance)) sum += (rest.x.col(v) - initial.col(v)).norm();
        const double found = sum / static_cast<double>(all.layer(distance).size());
        CHECK(found == Approx(row.number("disp" + std::to_string(distance)) * radius).epsilon(1e-9).margin(1e-13));
        CHECK((distance > layers) == (found == 0));
    }
}

/// The force that holds a vertex; what is zero in the table is the residual of the other program.
void check_force(const Point& found, const ReferenceRow& row, const std::string& number) {
    const Point expected(row.number("fx" + number), row.number("fy" + number), row.number("fz" + number));
    CHECK(norm<double>(found - expected) <= 1e-9 * norm(expected));
}

/// A unit sphere, its springs of stiffness 1.
struct Sphere {
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;
    double k;

    explicit Sphere(double volume_stiffness = 0.3, Index subdivisions = 2, const std::vector<Index>& pinned = {})
        : mesh(icosphere({.radius = 1, .subdivisions = subdivisions})),
          network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = pinned}),
          foundation(mesh, {.stiffness = volume_stiffness, .damping = 0.02}),
          k(volume_stiffness) {}

    const Points<double>& x() const { return mesh.positions(); }
    std::array<Index, 3> corners(Index f) const {
        return {mesh.triangles()(0, f), mesh.triangles()(1, f), mesh.triangles()(2, f)};
    }
    Grasp<double> grasp(Index f, const Point& barycentric) const {
        return {.triangle = f, .corners = corners(f), .barycentric = barycentric};
    }
    template <class... Constraints>
    Equilibrium rest(const EquilibriumOptions& options, const Constraints&... constraints) const {
        return equilibrium(x(), mesh, network, foundation, options, constraints...);
    }
    test::PressedMembrane pressed_by(const std::vector<Tool<double>>& tools) const {
        return {mesh.triangles(), {network.springs().begin(), network.springs().end()}, x(), k, tools};
    }
};

/// A tool and where it goes; it does not touch yet.
struct Stroke {
    Tool<double> tool;
    Point displacement;

    Tool<double> at(double part) const {
        Tool<double> moved = tool;
        moved.position += part * displacement;
        return moved;
    }
    /// How it touches in the end if the membrane does not yield.
    Contact<double> contact(const Sphere& sphere) const {
        AabbTree tree(sphere.mesh);
        ContactTracker tracker(sphere.mesh, {.fine_triangles = 0});
        Contact<double> contact;
        for (int i = 0; i <= 20; ++i) contact = tracker.update(tree, sphere.x(), at(i / 20.0));
        return contact;
    }
};

/// Into the unit sphere around `outward`, on a slant: a sphere of a tenth of an edge to two edges, or a capsule.
Stroke random_stroke(const Point& outward, bool is_capsule, Random& random) {
    const Point inward = (0.3 * random.vector() - outward).normalized();
    Stroke stroke;
    stroke.tool.radius = 0.03 * std::pow(20, random.number());
    stroke.tool.position = outward - (stroke.tool.radius + 0.1) * inward;
    if (is_capsule) {
        const Point axis = random.unit_vector() + random.number() * outward;
        stroke.tool.axis = random.number(0.2, 0.8) * (axis.dot(outward) < 0 ? -axis : axis);
    }
    stroke.displacement = (0.1 + random.number(0.05, 0.15)) * inward;
    return stroke;
}

/// The tests' own method, the tools moved in in small steps.
test::PressedState newton_along(const Sphere& sphere, const std::vector<Stroke>& strokes) {
    double radius = 1;
    for (const auto& stroke : strokes) radius = std::min(radius, stroke.tool.radius);
    const int steps = static_cast<int>(std::ceil(0.25 / std::min(0.02, 0.3 * radius)));
    test::PressedState state{sphere.x(), {}, true};
    for (int i = 1; i <= steps && state.converged; ++i) {
        std::vector<Tool<double>> tools;
        for (const auto& stroke : strokes) tools.push_back(stroke.at(static_cast<double>(i) / steps));
        state = test::at_rest(sphere.pressed_by(tools), state.x, {.far = 0.15, .max_step = radius / 2});
    }
    return state;
}

/// What is said of the equilibrium, seen by other means: no overlap, and forces that only push, along the normals of
/// what touches, explain all that is out of balance.
void check_pressed(const Equilibrium& rest, const Sphere& sphere, const std::vector<Tool<double>>& tools) {
    REQUIRE(rest.converged);
    const auto pressed = sphere.pressed_by(tools);
    for (const auto& tool : tools) {
        for (const auto& corners : sphere.mesh.triangles().colwise()) {
            REQUIRE(test::distance_from_axis(tool, rest.x(Eigen::all, corners)) - tool.radius > -1e-12);
        }
        CHECK(test::winding_number(sphere.mesh.triangles(), rest.x, tool.position) < 0.5);
    }
    const auto touching = test::features_near(pressed, rest.x, 1e-11);
    const Eigen::MatrixXd J = test::gap_gradients(touching, rest.x.size());
    const Eigen::VectorXd F = pressed.forces(rest.x);
    const Eigen::VectorXd pressures = test::smallest_non_negative(J * J.transpose(), J * F);
    CHECK((F + J.transpose() * pressures).lpNorm<Eigen::Infinity>() < 1e-12);
    std::vector<Point> reactions(tools.size(), Point::Zero());
    for (std::size_t i = 0; i < touching.size(); ++i) {
        reactions[touching[i].tool] += pressures[static_cast<Eigen::Index>(i)] * touching[i].normal();
    }
    for (std::size_t i = 0; i < tools.size(); ++i) CHECK((reactions[i] - rest.reactions[i]).norm() < 1e-11);
}

void check_same(const Equilibrium& rest, const test::PressedState& expected) {
    REQUIRE(expected.converged);
    CHECK((rest.x - expected.x).cwiseAbs().maxCoeff() < 1e-9);
    for (std::size_t i = 0; i < expected.reactions.size(); ++i) {
        CHECK((rest.reactions[i] - expected.reactions[i]).norm() < 1e-9);
    }
}

/// A solver's loop, to the end, and the equilibrium of the same scene.
template <class... Constraints>
void check_solver(const Sphere& sphere, const Points<double>& start, const Constraints&... constraints) {
    QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 50, .force_tolerance = 1e-13});
    Points<double> x = start;
    const auto report = test::run_to_equilibrium(solver, x, 1e-3, sphere.network, sphere.foundation, constraints...);
    REQUIRE(report.converged);
    const auto rest = equilibrium(start, sphere.mesh, sphere.network, sphere.foundation, {}, constraints...);
    REQUIRE(rest.converged);
    CHECK((rest.x - x).cwiseAbs().maxCoeff() < 1e-7);
    REQUIRE(rest.reactions.size() == report.reactions.size());
    for (std::size_t i = 0; i < rest.reactions.size(); ++i) {
        CHECK((rest.reactions[i] - report.reactions[i]).norm() < 1e-7);
    }
}

/// Pulls vertex 7 with a force that is not a number.
struct BrokenBacking {
    [[nodiscard]] VertexForce<double> force_on(Index v, const Point& position, const Point&, double) const noexcept {
        return {(v == 7 ? std::numeric_limits<double>::quiet_NaN() : 0.0) * position, 1.0};
    }
};

/// A constraint of one's own: two vertices as one would with forceps of two tips.
struct Clamp {
    Index first, second;
    Point by;
};
void describe(const Clamp& clamp, EquilibriumScene& scene) {
    for (const Index v : {clamp.first, clamp.second}) scene.prescribe(v, point(scene.goals(1).targets, v) + clamp.by);
}

}  // namespace

TEST_CASE("equilibrium of one held vertex: every row of the reference", "[equilibrium]") {
    const auto rows = test::reference_table("equilibria.csv");
    REQUIRE(rows.size() == 15);
    for (const auto& row : rows) {
        if (is_slow(row)) continue;
        CAPTURE(row.line());
        check_row(row, 1, 1);
        if (row.integer("level") == 2) check_row(row, 0.01, 40);
    }
}

TEST_CASE("equilibrium of mixed springs, two held vertices, moved anchors: every row of the reference",
          "[equilibrium]") {
    const auto rows = test::reference_table("equilibria_more.csv");
    REQUIRE(rows.size() == 7);
    for (const auto& row : rows) {
        if (is_slow(row)) continue;
        CAPTURE(row.line());
        const Reference membrane(row);
        const auto& initial = membrane.mesh.positions();
        Eigen::Matrix3d displacement = Eigen::Matrix3d::Zero();
        if (row.integer("anchors") == 1) displacement(0, 1) = 1;
        if (row.integer("anchors") == 2) displacement.diagonal() << 1, -0.5, -0.5;
        const Points<double> anchors = initial + row.number("amount") * displacement * initial;
        MovingBody body(membrane.mesh);
        Points<double> start = initial;
        REQUIRE(body.move_to(anchors, 1, start));
        const auto volume = on(body, membrane.foundation);
        const auto hold = [&](const std::string& n) {
            const Point place(row.number("x" + n), row.number("y" + n), row.number("z" + n));
            return membrane.hold(membrane.vertex_at(place), row.number("delta" + n));
        };
        const auto rest_under = [&](const auto&... constraints) {
            return equilibrium(initial, membrane.mesh, membrane.network, volume, {.increments = 20}, constraints...);
        };
        Equilibrium rest;
        if (row.integer("held") == 0) rest = rest_under();
        if (row.integer("held") == 1) rest = rest_under(hold("1"));
        if (row.integer("held") == 2) rest = rest_under(hold("1"), hold("2"));
        REQUIRE(rest.converged);
        REQUIRE(rest.reactions.size() == static_cast<std::size_t>(row.integer("held")));
        if (row.integer("held") > 0) check_force(-rest.reactions[0], row, "1");
        if (row.integer("held") > 1) check_force(-rest.reactions[1], row, "2");
        CHECK(membrane.energy(rest.x, volume) == Approx(row.number("energy")).epsilon(1e-9));
        const double largest = (rest.x - initial).colwise().norm().maxCoeff();
        CHECK(largest == Approx(row.number("largest_displacement")).epsilon(1e-9));
    }
}

TEST_CASE("equilibrium under one tool, against Newton's method of the tests' own", "[equilibrium]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere(seed % 3 == 0 ? 0.1 : 0.3);
        const Stroke stroke = random_stroke(random.unit_vector(), seed % 3 == 1, random);
        const auto rest = sphere.rest({}, press(stroke.at(1), stroke.contact(sphere)));
        check_pressed(rest, sphere, {stroke.at(1)});
        CHECK(rest.reactions[0].norm() > 1e-3);
        check_same(rest, newton_along(sphere, {stroke}));
        const auto again = sphere.rest({.increments = 7}, press(stroke.at(1), stroke.contact(sphere)));
        CHECK((again.x - rest.x).cwiseAbs().maxCoeff() < 1e-11);
    }
}

TEST_CASE("equilibrium under two tools, against Newton's method of the tests' own", "[equilibrium]") {
    for (int seed = 1; seed <= cases(8); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere;
        const Point here = random.unit_vector(), there = (here + 1.2 * here.eigen().unitOrthogonal()).normalized();
        const std::vector<Stroke> strokes{random_stroke(here, false, random), random_stroke(there, false, random)};
        const auto rest = sphere.rest({}, press(strokes[0].at(1), strokes[0].contact(sphere)),
                                      press(strokes[1].at(1), strokes[1].contact(sphere)));
        check_pressed(rest, sphere, {strokes[0].at(1), strokes[1].at(1)});
        check_same(rest, newton_along(sphere, strokes));
    }
}

TEST_CASE("equilibrium near a press takes a few iterations", "[equilibrium]") {
    const Sphere sphere(0.1, 3);
    Random random(1);
    const Stroke stroke = random_stroke(random.unit_vector(), true, random);
    const auto rest = sphere.rest({}, press(stroke.at(1), stroke.contact(sphere)));
    REQUIRE(rest.converged);
    auto contact = stroke.contact(sphere);
    contact.gap = 0;
    const auto start = test::jittered<double>(rest.x, 1e-4, random);
    const auto again =
        equilibrium(start, sphere.mesh, sphere.network, sphere.foundation, {}, press(stroke.at(1), contact));
    REQUIRE(again.converged);
    CHECK(again.iterations <= 8);
    CHECK((again.x - rest.x).cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("a tool that is deeper than it is thick comes from outside", "[equilibrium]") {
    const Sphere sphere;
    for (const double radius : {0.02, 0.1}) {
        const Stroke stroke{.tool = {.position = {0.1, 0.2, 1.3}, .radius = radius}, .displacement = {0, 0, -0.6}};
        const auto rest = sphere.rest({}, press(stroke.at(1), stroke.contact(sphere)));
        check_pressed(rest, sphere, {stroke.at(1)});
        CHECK(rest.reactions[0].z() > 0.05);
    }
}

TEST_CASE("a ball on slender triangles around a pole: safe steps come to rest where Newton's method does",
          "[equilibrium]") {
    constexpr Index rings = 14, slices = 36;
    test::Surface<double> dome;
    dome.add(Point(0, 0, 8e-3));
    for (Index i = 1; i <= rings; ++i) {
        for (Index j = 0; j < slices; ++j) {
            const double down = 0.8 * i / rings, around = 2 * std::numbers::pi * j / slices;
            dome.add(8e-3 *
                     Point(std::sin(down) * std::cos(around), std::sin(down) * std::sin(around), std::cos(down)));
        }
    }
    const auto at = [](Index i, Index j) { return i == 0 ? 0 : 1 + (i - 1) * slices + j % slices; };
    for (Index i = 0; i < rings; ++i) {
        for (Index j = 0; j < slices; ++j) {
            if (i > 0) dome.add(at(i, j), at(i + 1, j), at(i, j + 1));
            dome.add(at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
        }
    }
    const auto mesh = dome.mesh();
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0, .pinned = border(mesh)});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    for (const double depth : {0.4e-3, 0.7e-3}) {
        CAPTURE(depth);
        QuasiStaticSolver solver(network, {.layers = 8, .sweeps = 3}, SafeStep());
        AabbTree<double> tree(mesh);
        ContactTracker<double> tracker(mesh);
        Points<double> x = mesh.positions();
        Tool<double> tool{.position = {0.5e-3, 0, 0}, .radius = 1.5e-3};
        Contact<double> contact;
        StepReport<double> report;
        for (int tick = 0; tick < 1500; ++tick) {
            tool.position.z() = 9.6e-3 - (std::min)(tick / 1000.0, 1.0) * (depth + 0.1e-3);
            contact = tracker.update(tree, x, tool);
            report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
        }
        CHECK(report.residual < 1e-6);
        const double force = norm(report.reactions[0]);
        const auto rest = equilibrium(x, mesh, network, foundation, {}, press(tool, contact));
        REQUIRE(rest.converged);
        CHECK(force == Approx(norm(rest.reactions[0])).epsilon(1e-4));
    }
}

TEST_CASE("equilibrium agrees with the quasi-static solver", "[equilibrium]") {
    for (int seed = 1; seed <= cases(1, 2); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Index pinned = random.index(162);
        const Sphere sphere(0.5, 2, {pinned});
        const auto beside = [&](Index v) -> Point { return sphere.x().col(v) + 0.1 * random.vector(); };
        const Index v = random.index(162), f = random.index(320);
        const Point weights = random.barycentric();
        const Tool<double> forceps{.position = triangle_at(sphere.x(), sphere.corners(f)).a + 0.1 * random.vector()};
        const auto grasp = sphere.grasp(f, weights);
        const std::array<Index, 3> pins{random.index(162), random.index(162), pinned};
        const auto load_of = [&](double size) {
            return load<double>(sphere.corners(random.index(320)), random.barycentric(), size * random.vector());
        };
        check_solver(sphere, sphere.x(), pull(v, beside(v)), pull(v, beside(v)));
        if (in_full()) {
            check_solver(sphere, sphere.x(), pull(v, beside(v)), pull(pinned, beside(v)));
            check_solver(sphere, sphere.x(), pull(forceps, grasp));
            check_solver(sphere, sphere.x(), load_of(0.1), load_of(0.2));
            check_solver(sphere, sphere.x(), pin(pins), load_of(0.2));
        }
        check_solver(sphere, sphere.x(), pin(pins), load_of(0.1), pull(forceps, grasp), pull(forceps, {}));
    }
}

TEST_CASE("equilibrium agrees with the quasi-static solver's loop", "[equilibrium]") {
    for (int seed = 1; seed <= cases(2, 6); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere(0.3);
        const Point here = random.unit_vector(), there = (here + 1.2 * here.eigen().unitOrthogonal()).normalized();
        const std::array strokes{random_stroke(here, seed % 2 == 0, random), random_stroke(there, false, random)};
        const Index v = sphere.mesh.triangles()(0, 0);
        QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 16, .force_tolerance = 1e-12});
        AabbTree tree(sphere.mesh);
        std::vector<ContactTracker<double>> trackers(2, ContactTracker(sphere.mesh, {.fine_triangles = 0}));
        Points<double> x = sphere.x();
        Equilibrium rest;
        StepReport<double> report;
        for (int i = 0; i <= 2000 && !(i > 20 && report.converged); ++i) {
            std::array<Tool<double>, 2> tools;
            std::array<Contact<double>, 2> contacts;
            for (std::size_t t = 0; t < 2; ++t) {
                tools[t] = strokes[t].at(std::min(i / 20.0, 1.0));
                contacts[t] = trackers[t].update(tree, x, tools[t]);
            }
            const auto hold = pull(v, (1.05 * sphere.x().col(v)).eval());
            report = solver.step(x, 1e-3, sphere.network, sphere.foundation, press(tools[0], contacts[0]), hold,
                                 press(tools[1], contacts[1]));
            tree.refit(x, report.moved);
            if (i > 20 && report.converged) {
                rest = equilibrium(x, sphere.mesh, sphere.network, sphere.foundation, {}, press(tools[0], contacts[0]),
                                   hold, press(tools[1], contacts[1]));
            }
        }
        REQUIRE(report.converged);
        REQUIRE(rest.converged);
        CHECK(rest.iterations <= 5);
        CHECK((rest.x - x).cwiseAbs().maxCoeff() < 1e-7);
        for (std::size_t i = 0; i < 3; ++i) CHECK((rest.reactions[i] - report.reactions[i]).norm() < 1e-7);
    }
}

TEST_CASE("equilibrium of any law, against Newton's method by differences", "[equilibrium]") {
    const auto check = [](const auto& law, int seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
        const MassSpringNetwork network(mesh, law, {.stiffness = 2.0});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 2.0, .damping = 0.1});
        const auto& x = mesh.positions();
        const std::array<Index, 3> corners{mesh.triangles()(0, 7), mesh.triangles()(1, 7), mesh.triangles()(2, 7)};
        const std::vector<Index> vertices(corners.begin(), corners.end());
        const Point weights = random.barycentric(), force = 0.3 * random.vector();
        const Point target = point_at(triangle_at(x, corners), weights) + 0.15 * random.vector();
        const std::vector<double> shares{weights[0], weights[1], weights[2]};
        const Index pinned = mesh.triangles()(0, 40), loaded = mesh.triangles()(1, 60);
        const std::array<Index, 1> pins{pinned};

        const test::SmallMembrane<std::decay_t<decltype(network)>> oracle{
            network, x, 2, {pinned}, {{vertices, shares, target}}, {{{loaded}, {1}, force}}};
        const auto expected = oracle.equilibrium(x);
        const Grasp<double> grasp{.triangle = 7, .corners = corners, .barycentric = weights};
        const auto rest = equilibrium(x, mesh, network, foundation, {}, pull(Tool<double>{.position = target}, grasp),
                                      pin(pins), load<double>({loaded, 0, 1}, {1, 0, 0}, force));
        REQUIRE(rest.converged);
        CHECK((rest.x - expected.x).cwiseAbs().maxCoeff() < 1e-9);
        CHECK((rest.reactions[0] + expected.holding[0]).norm() < 1e-8);
        CHECK(rest.reactions[2] == -force);
        // All reactions together balance what the foundation pulls with.
        const Point backed = 2 * (x - rest.x).rowwise().sum();
        CHECK((rest.reactions[0] + rest.reactions[1] + rest.reactions[2] - backed).norm() < 1e-11);
    };
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        check(ExponentialSpring{.stiffening = 8}, seed);
        check(test::CubicSpring{}, seed);
        check(LinearSpring{}, seed);
    }
}

TEST_CASE("equilibrium beyond the point where only a hold is stable", "[equilibrium]") {
    // A dome without foundation snaps through under a force, not under a hold.
    const auto mesh = spherical_cap({.radius = 1, .diameter = 1, .rings = 6});
    const Adjacency adjacency(mesh);
    const std::vector<Index> rim(adjacency.border_vertices().begin(), adjacency.border_vertices().end());
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = rim});
    const Grasp<double> grasp{.triangle = 0, .corners = {0, 1, 2}, .barycentric = {1, 0, 0}};
    const Point target = mesh.positions().col(0) - Point(0, 0, 0.12);
    const EquilibriumOptions options{.increments = 10};
    const auto vertex = equilibrium(mesh.positions(), mesh, network, NoFoundation{}, options, pull(0, target));
    const auto held = equilibrium(mesh.positions(), mesh, network, NoFoundation{}, options,
                                  pull(Tool<double>{.position = target}, grasp));
    REQUIRE(vertex.converged);
    REQUIRE(held.converged);
    CHECK((vertex.x - held.x).cwiseAbs().maxCoeff() < 1e-9);
    CHECK((vertex.reactions[0] - held.reactions[0]).norm() < 1e-11);
    CHECK(vertex.iterations < 200);
    CHECK(held.iterations < 200);
}

TEST_CASE("equilibrium of a flat sheet that nothing backs", "[equilibrium]") {
    const auto mesh = disc({.radius = 1, .rings = 5});
    const Adjacency adjacency(mesh);
    const std::vector<Index> rim(adjacency.border_vertices().begin(), adjacency.border_vertices().end());
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = rim});
    const auto rest = equilibrium(mesh.positions(), mesh, network, NoFoundation{}, {}, pull(0, Point(0, 0, 0.3)));
    REQUIRE(rest.converged);
    CHECK(rest.reactions[0].z() < -0.01);
    CHECK(std::abs(rest.reactions[0].x()) < 1e-12);
}

TEST_CASE("equilibrium in layers moves no other vertices", "[equilibrium]") {
    const Sphere sphere(0.1, 3);
    Random random(3);
    const Stroke stroke = random_stroke(random.unit_vector(), false, random);
    const auto contact = stroke.contact(sphere);
    const auto whole = sphere.rest({}, press(stroke.at(1), contact));
    double error = 1;
    for (const Index layers : {1, 3, 6}) {
        CAPTURE(layers);
        const auto rest = sphere.rest({.layers = layers}, press(stroke.at(1), contact));
        REQUIRE(rest.converged);
        PropagationQueue queue(sphere.mesh.vertex_count());
        queue.build(sphere.network, contact.corners, layers + 8);
        for (Index v = 0; v < sphere.mesh.vertex_count(); ++v) {
            if (!queue.contains(v)) CHECK(rest.x.col(v) == sphere.x().col(v));
        }
        const double now = (rest.x - whole.x).cwiseAbs().maxCoeff();
        CHECK(now < error);
        error = now;
    }
}

TEST_CASE("a tool that does not touch presses nothing, and nothing moves a membrane at rest", "[equilibrium]") {
    const Sphere sphere;
    const Tool<double> tool{.position = {0, 0, 1}, .radius = 0.1};
    const auto rest = sphere.rest({.increments = 3}, press(tool, Contact<double>::none()));
    CHECK(rest.converged);
    CHECK(test::same_bits(rest.x, sphere.x()));
    CHECK(rest.reactions[0].isZero(0));
    CHECK(rest.residual == 0);
}

TEST_CASE("what cannot move is not kept out of a tool, and a point of it is not held", "[equilibrium]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    std::vector<Index> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) all.push_back(v);
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .pinned = all});
    const Sphere sphere(0.3, 1);
    const Stroke stroke{.tool = {.position = {0, 0, 1.3}, .radius = 0.1}, .displacement = {0, 0, -0.3}};
    const auto rest =
        equilibrium(mesh.positions(), mesh, network, sphere.foundation, {}, press(stroke.at(1), stroke.contact(sphere)),
                    pull(stroke.at(0), sphere.grasp(3, {0.2, 0.3, 0.5})));
    CHECK(rest.converged);
    CHECK(test::same_bits(rest.x, mesh.positions()));
    CHECK((rest.reactions[0].isZero(0) && rest.reactions[1].isZero(0)));
}

TEST_CASE("equilibrium takes constraints of one's own", "[equilibrium]") {
    const Sphere sphere;
    const Point by(0, 0, 0.1);
    const auto own = sphere.rest({}, Clamp{3, 17, by});
    const auto stock = sphere.rest({}, pull(3, sphere.x().col(3) + by), pull(17, sphere.x().col(17) + by));
    REQUIRE(own.converged);
    CHECK(test::same_bits(own.x, stock.x));
    REQUIRE(own.reactions.size() == 1);
    CHECK((own.reactions[0] - stock.reactions[0] - stock.reactions[1]).norm() < 1e-15);
}

TEST_CASE("equilibrium of a scene of floats is that of the same numbers in doubles", "[equilibrium]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<float>({.radius = 0.01F, .subdivisions = 2});
        const TriangleMesh<double> wide(mesh.positions().cast<double>().eval(), mesh.triangles());
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0F});
        std::vector<double> lengths, stiffness;
        for (const auto& spring : network.springs()) lengths.push_back(spring.rest_length);
        const MassSpringNetwork wide_network(wide, LinearSpring{}, {.stiffness = 40.0, .rest_length = lengths});
        std::vector<float> constants;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            constants.push_back(random.number<float>(1.0F, 9.0F));
            stiffness.push_back(constants.back());
        }
        const VirtualVolumeSprings foundation(mesh, {.stiffness = constants, .damping = 0.02F});
        const VirtualVolumeSprings wide_foundation(wide, {.stiffness = stiffness});
        const Index v = random.index(mesh.vertex_count());
        const Vector3<float> target = 1.1F * mesh.positions().col(v);
        const auto rest = equilibrium(mesh.positions(), mesh, network, foundation, {}, pull(v, target));
        const auto expected =
            equilibrium(wide.positions(), wide, wide_network, wide_foundation, {}, pull(v, target.cast<double>()));
        REQUIRE(rest.converged);
        REQUIRE(expected.converged);
        CHECK((rest.x - expected.x).cwiseAbs().maxCoeff() < 1e-15);
        CHECK((rest.reactions[0] - expected.reactions[0]).norm() < 1e-13 * expected.reactions[0].norm());
        for (Index w = 0; w < mesh.vertex_count(); ++w) {  // really in balance
            if (w == v) continue;
            const Point here = rest.x.col(w);
            const auto force =
                wide_network.force_on(w, rest.x).force + wide_foundation.force_on(w, here, here, 1.0).force;
            REQUIRE(norm<double>(force) < 1e-14);
        }
    }
}

TEST_CASE("equilibrium in floats is the one in doubles, as near as floats come", "[equilibrium]") {
    Random random(5);
    const Sphere sphere(0.3);
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0F});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.3F, .damping = 0.02F});
    const Point weights = random.barycentric(), force = 0.1 * random.vector();
    const Stroke stroke = random_stroke(random.unit_vector(), true, random);
    Tool<float> tool;
    tool.position = stroke.at(1).position.cast<float>();
    tool.axis = stroke.tool.axis.cast<float>();
    tool.radius = static_cast<float>(stroke.tool.radius);
    const auto contact = stroke.contact(sphere);
    Contact<float> touching;
    touching.phase = contact.phase;
    touching.corners = contact.corners;
    touching.point = contact.point.cast<float>();
    touching.normal = contact.normal.cast<float>();
    touching.patch.axis_point = contact.patch.axis_point.cast<float>();
    touching.gap = static_cast<float>(contact.gap);
    touching.patch.detection_distance = static_cast<float>(contact.patch.detection_distance);
    touching.patch.radius = static_cast<float>(contact.patch.radius);

    const auto rest = sphere.rest({}, press(stroke.at(1), contact), load<double>(sphere.corners(9), weights, force));
    const auto in_float = equilibrium(mesh.positions(), mesh, network, foundation, {}, press(tool, touching),
                                      load<float>(sphere.corners(9), weights.cast<float>(), force.cast<float>()));
    REQUIRE(rest.converged);
    REQUIRE(in_float.converged);
    CHECK(in_float.residual < 1e-12);
    CHECK((rest.x - in_float.x).cwiseAbs().maxCoeff() < 3e-6);
    for (std::size_t i = 0; i < 2; ++i) CHECK((rest.reactions[i] - in_float.reactions[i]).norm() < 3e-6);
}

TEST_CASE("equilibrium says when it is not there yet", "[equilibrium]") {
    const Sphere sphere;
    const Point target = 0.7 * sphere.x().col(0);
    const auto rest = sphere.rest({.max_iterations = 1}, pull(0, target));
    CHECK(!rest.converged);
    CHECK(rest.status == EquilibriumStatus::unbalanced);
    CHECK(rest.iterations == 1);
    CHECK(rest.residual > 1e-6);
    CHECK(is_finite(rest.x));

    // Nothing to balance it.
    const MassSpringNetwork network(sphere.mesh, LinearSpring{}, {.stiffness = 1.0});
    const auto lost = equilibrium(sphere.x(), sphere.mesh, network, NoFoundation{}, {},
                                  load<double>(sphere.corners(0), {1, 0, 0}, {0, 0, 1}));
    CHECK(!lost.converged);
    CHECK(lost.status == EquilibriumStatus::unbalanced);
    CHECK(lost.residual > 1e-3);

    // A point held where a tool is.
    const Stroke stroke{.tool = {.position = {0, 0, 1.3}, .radius = 0.1}, .displacement = {0, 0, -0.3}};
    const auto contact = stroke.contact(sphere);
    const auto grasp = sphere.grasp(contact.triangle, contact.barycentric);
    const auto stuck = sphere.rest({}, press(stroke.at(1), contact), pull(stroke.at(1), grasp));
    CHECK(!stuck.converged);
    CHECK(stuck.status != EquilibriumStatus::found);

    // A shaft that is already through, whatever the contact says.
    Contact<double> wrong = contact;
    wrong.gap = 0;
    const Tool<double> shaft{.position = {0.05, 0.03, 0.9}, .axis = {0, 0, 0.4}, .radius = 0.01};
    const auto through = sphere.rest({}, press(shaft, wrong));
    CHECK(!through.converged);
    CHECK(through.status == EquilibriumStatus::penetrated);
    CHECK(to_string(through.status) == "a tool penetrates");
}

// Contact points on both sides of an edge may be near it: then they are nearly dependent.
TEST_CASE("equilibrium under a tool that presses the pole of an icosphere converges at every depth, in few iterations",
          "[equilibrium]") {
    const auto mesh = icosphere({.radius = 10e-3, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0});
    for (int seed = 1; seed <= cases(60, 5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        // Near the depth of 0.6 mm, at which a contact point is at 3e-4 of a triangle's height from an edge.
        const double depth = random.chance(0.5) ? 0.6e-3 + 1e-5 * random.number(-1.0, 1.0) : random.number(1e-5, 2e-3);
        const Tool<double> tool{.position = {0, 0, 12e-3 - depth}, .radius = 2e-3};
        AabbTree tree(mesh);
        ContactTracker tracker(mesh);
        Tool<double> above = tool;
        above.position.z() = 12.5e-3;
        (void)tracker.update(tree, mesh.positions(), above);
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        const auto start = test::jittered<double>(mesh.positions(), random.number(0.0, 1e-4), random);
        const auto rest = equilibrium(start, mesh, network, foundation, {}, press(tool, contact));
        CAPTURE(depth, to_string(rest.status), rest.residual, rest.penetration);
        REQUIRE(rest.converged);
        REQUIRE(rest.iterations <= 30);
    }
}

TEST_CASE("equilibrium takes as many iterations on a fine mesh as on a coarse one", "[equilibrium]") {
    for (const Index subdivisions : {2, 3, 4}) {
        CAPTURE(subdivisions);
        const auto mesh = icosphere({.radius = 10e-3, .subdivisions = subdivisions});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0});
        Tool<double> tool{.position = {0, 0, 12.5e-3}, .radius = 2e-3};
        AabbTree tree(mesh);
        ContactTracker tracker(mesh);
        (void)tracker.update(tree, mesh.positions(), tool);
        tool.position.z() = 11.4e-3;
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        const auto rest = equilibrium(mesh.positions(), mesh, network, foundation, {}, press(tool, contact));
        REQUIRE(rest.converged);
        CHECK(rest.iterations <= 8);
    }
}

TEST_CASE("equilibrium refuses what does not fit together", "[equilibrium]") {
    const Sphere sphere(0.3, 1), other(0.3, 0);
    const auto refused = [&](const auto& x, const auto& mesh, const auto& network, const auto& foundation) {
        return refusal([&] { std::ignore = equilibrium(x, mesh, network, foundation, {}); });
    };
    CHECK(refused(sphere.x(), sphere.mesh, sphere.network, sphere.foundation) == "");
    CHECK(refused(other.x(), sphere.mesh, sphere.network, sphere.foundation) ==
          "equilibrium: x must have as many vertices as the mesh, 42, got 12");
    CHECK(refused(sphere.x(), sphere.mesh, other.network, sphere.foundation) ==
          "equilibrium: the network must have as many vertices as the mesh, 42, got 12");
    CHECK(refused(sphere.x(), sphere.mesh, sphere.network, other.foundation) ==
          "equilibrium: the foundation must have as many vertices as the mesh, 42, got 12");
    Points<double> x = sphere.x();
    x(1, 7) = std::numeric_limits<double>::quiet_NaN();
    CHECK(refused(x, sphere.mesh, sphere.network, sphere.foundation) ==
          "equilibrium: y of vertex 7 must be finite [m], got nan");
    CHECK(refused(sphere.x(), sphere.mesh, sphere.network, BrokenBacking{}) ==
          "equilibrium: the foundation of vertex 7 must pull with a finite force [N], got one that is not");
    CHECK(refusal([&] { std::ignore = sphere.rest({.increments = 0}); }) ==
          "equilibrium: increments must be at least 1, got 0");
    CHECK(refusal([&] { std::ignore = sphere.rest({}, pull(0, Point(0, 0, 1)), pull(42, Point(0, 0, 1))); }) ==
          "equilibrium: constraint 1 names vertex 42, expected 0 to 41");
}

TEST_CASE("an equilibrium needs no options, and is then that of the default ones", "[equilibrium]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5});
    const auto hold = pull(3, Eigen::Vector3d(1.1 * mesh.positions().col(3)));
    const auto plain = equilibrium(mesh.positions(), mesh, network, foundation, hold);
    const auto full = equilibrium(mesh.positions(), mesh, network, foundation, {}, hold);
    CHECK(plain.x == full.x);
    CHECK(plain.reactions[0] == full.reactions[0]);
}
