// SPDX-License-Identifier: MIT
#include <membrane/certify/error_bound.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/accuracy/tangent_stiffness.hpp>
#include <membrane/certify/factored_convexity.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/newton.hpp"
#include "support/random.hpp"
#include "support/random_tear.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/sparse_newton.hpp"

using namespace membrane;

namespace {

double farthest(const Points<double>& a, const Points<double>& b) { return (a - b).colwise().norm().maxCoeff(); }

/// A sphere of radius 1 with springs of 1 N/m.
struct Sphere {
    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    ErrorBound<> quick;
    ErrorBound<FactoredConvexity> sharp;
    test::StillMembrane still;
    double edge;

    explicit Sphere(Index subdivisions)
        : mesh(icosphere<double>({.radius = 1, .subdivisions = subdivisions})),
          network(mesh, LinearSpring{}, {.stiffness = 1.0}),
          quick(network),
          sharp(network),
          still(network, mesh.positions(), 1),
          edge(std::sqrt(8 * std::numbers::pi / std::sqrt(3.0) / mesh.vertex_count())) {}
};

/// How often a bound was found, and how near the truth it is.
struct Tally {
    int all = 0, certified = 0;
    std::vector<double> positions, forces;  // bound by true error
};

double quantile(std::vector<double> values, double part) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

std::string summary(const Tally& tally) {
    std::ostringstream text;
    text.precision(4);
    text << tally.certified << " of " << tally.all << " certified; bound by error, in nine of ten at most "
         << quantile(tally.positions, 0.9) << " (positions), " << quantile(tally.forces, 0.9) << " (forces)";
    return text.str();
}

/// By decade of the foundation.
struct Tallies {
    std::array<Tally, 3> quick, sharp;
};

/// A vertex pressed or pulled by a solver that is not given the time to come to rest.
struct HeldVertexCase {
    double foundation, depth;
    Index held;
    Vector3<double> target, reaction;
    Points<double> x;

    HeldVertexCase(const Sphere& sphere, test::Random& random)
        : foundation(std::pow(10, random.number(-2.0, 1.0))),
          depth(std::pow(10, random.number(-3.0, -0.6)) * (random.chance(0.5) ? 1 : -1)),
          held(random.index(sphere.mesh.vertex_count())),
          x(sphere.mesh.positions()) {
        const VirtualVolumeSprings springs(sphere.mesh, {.stiffness = foundation});
        QuasiStaticSolver solver(sphere.network, {.layers = 1 + random.index(12), .sweeps = 1 + random.index(6)});
        const Vector3<double> start = point(x, held);
        target = start - depth * (start + random.vector<double>(-0.3, 0.3));
        const Index steps = 1 + random.index(20);
        for (Index i = 1; i <= steps; ++i) {
            const Vector3<double> displacement = (std::min)(2.0 * i / steps, 1.0) * (target - start);
            const auto report = solver.step(x, 1e-3, sphere.network, springs, pull(held, start + displacement));
            reaction = report.reactions[0];
        }
    }
};

/// The truth, against which a bound is held.
struct Truth {
    Points<double> x;
    Vector3<double> reaction;
    bool stable;
};

Truth truth_of(Sphere& sphere, const HeldVertexCase& held) {
    sphere.still.back(held.foundation);
    sphere.still.fix(held.held);
    const auto rest = sphere.still.equilibrium(held.x);
    sphere.still.release(held.held);
    return {rest.x, sphere.still.forces(rest.x).col(held.held), rest.stable};
}

void check_bound(const ErrorReport& error, const HeldVertexCase& held, const Truth& truth, Tally& tally) {
    ++tally.all;
    CAPTURE(static_cast<int>(error.status), error.convexity);
    REQUIRE(error.reactions.size() == 1);
    if (!error.certified()) {
        CHECK(error.position == std::numeric_limits<double>::infinity());
        CHECK(error.reactions[0].radius == std::numeric_limits<double>::infinity());
        return;
    }
    ++tally.certified;
    const double off = farthest(truth.x, held.x), force_off = norm<double>(truth.reaction - held.reaction);
    const auto& reaction = error.reactions[0];
    CHECK(truth.stable);
    CHECK(off <= error.position);
    CHECK(force_off <= reaction.max_distance_to(held.reaction));
    CHECK(norm<double>(truth.reaction - reaction.centre) <= reaction.radius + 1e-13);  // rounding of the truth
    tally.positions.push_back(error.position / off);
    tally.forces.push_back(reaction.max_distance_to(held.reaction) / force_off);
}

void press_or_pull(Sphere& sphere, test::Random& random, Tallies& tallies) {
    const HeldVertexCase held(sphere, random);
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = held.foundation});
    const Truth truth = truth_of(sphere, held);
    const double off = farthest(truth.x, held.x);
    if (!(off > 1e-9)) return;
    CAPTURE(held.foundation, held.depth, off, off / sphere.edge);
    const std::size_t decade = held.foundation < 0.1 ? 0 : held.foundation < 1 ? 1 : 2;
    const auto quick = sphere.quick.compute(held.x, sphere.network, foundation, pull(held.held, held.target));
    check_bound(quick, held, truth, tallies.quick[decade]);
    if (held.foundation >= 1 && off <= 0.005 * sphere.edge) CHECK(quick.certified());
    const auto sharp = sphere.sharp.compute(held.x, sphere.network, foundation, pull(held.held, held.target));
    check_bound(sharp, held, truth, tallies.sharp[decade]);
}

}  // namespace

TEST_CASE("no vertex and no reaction is farther from the equilibrium than the bound", "[error_bound]") {
    Tallies tallies;
    struct Part {
        Index subdivisions;
        int count;
    };
    for (const Part& part : {Part{2, 1880}, Part{3, 140}, Part{4, 8}}) {
        Sphere sphere(part.subdivisions);
        for (int i = 1; i <= cases((part.count + 9) / 10, part.count); ++i) {
            const auto seed = static_cast<std::uint64_t>(10'000 * part.subdivisions + i);
            CAPTURE(seed);
            test::Random random(seed);
            press_or_pull(sphere, random, tallies);
        }
    }
    std::string table;
    const std::array<std::string, 3> decades{"0.01 to 0.1", "0.1 to 1", "1 to 10"};
    for (std::size_t i = 0; i < 3; ++i) {
        const auto &quick = tallies.quick[i], &sharp = tallies.sharp[i];
        table += "foundation " + decades[i] + " of the springs\n  blocks:  " + summary(quick) +
                 "\n  factors: " + summary(sharp) + "\n";
        for (const auto& tally : {quick, sharp}) {
            CHECK(quantile(tally.positions, 0.9) <= 5);
            CHECK(quantile(tally.forces, 0.9) <= 30);
        }
        CHECK(sharp.certified >= quick.certified);
    }
    WARN(table);
}

TEST_CASE("which of several equilibria is never left open", "[error_bound]") {
    // Six spokes pressed together by a rigid rim; the hub may rest above or below, and unstably in the middle.
    TriangleMesh<double> mesh = [] {
        Points<double> x = Points<double>::Zero(3, 7);
        Triangles triangles(3, 6);
        for (Index i = 0; i < 6; ++i) {
            const double angle = i * std::numbers::pi / 3;
            x.col(i + 1) << std::cos(angle), std::sin(angle), 0;
            triangles.col(i) << 0, i + 1, (i + 1) % 6 + 1;
        }
        return TriangleMesh<double>(x, triangles);
    }();
    const MassSpringNetwork network(mesh, LinearSpring{},
                                    {.stiffness = 1.0, .rest_length = 1.2, .pinned = {1, 2, 3, 4, 5, 6}});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.1});
    const double up = std::sqrt(std::pow(7.2 / 6.1, 2) - 1);
    ErrorBound quick(network);
    ErrorBound<FactoredConvexity> sharp(network);
    int certified = 0;
    for (int i = -200; i <= 200; ++i) {
        Points<double> x = mesh.positions();
        x(2, 0) = i * 0.005;
        CAPTURE(x(2, 0));
        for (const auto& error : {quick.compute(x, network, foundation), sharp.compute(x, network, foundation)}) {
            if (!error.certified()) continue;
            ++certified;
            int within = 0;
            for (const double z : {-up, 0.0, up}) within += std::abs(z - x(2, 0)) <= error.position ? 1 : 0;
            CHECK(within == 1);
            CHECK(std::abs(x(2, 0)) > up / 2);
        }
    }
    CHECK(certified > 100);
}

TEST_CASE("between two equilibria of a dented sphere nothing is certified for the wrong one", "[error_bound]") {
    Sphere sphere(2);
    const double stiffness = 0.002;
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = stiffness});
    sphere.still.back(stiffness);
    const Points<double>& whole = sphere.mesh.positions();
    Points<double> dented = whole;
    for (Index v = 0; v < dented.cols(); ++v) dented(2, v) = (std::min)(whole(2, v), 1.2 - whole(2, v));
    QuasiStaticSolver solver(sphere.network, {.layers = unlimited, .sweeps = 50});
    solver.wake_all();
    (void)test::run_within(100, solver, dented, 1e-3, sphere.network, foundation);
    dented = sphere.still.equilibrium(dented).x;
    const double apart = farthest(whole, dented);
    REQUIRE(sphere.still.forces(dented).norm() < 1e-10);
    REQUIRE(apart > 0.3);
    for (int i = 0; i <= 200; ++i) {
        const double part = i / 200.0;
        const Points<double> x = (1 - part) * whole + part * dented;
        const auto error = sphere.sharp.compute(x, sphere.network, foundation);
        CAPTURE(part, static_cast<int>(error.status));
        CHECK((error.certified() || (part > 0 && part < 1)));
        if (!error.certified()) continue;
        CHECK((part * apart <= error.position) != ((1 - part) * apart <= error.position));
    }
}

TEST_CASE("random crumpled states: where one equilibrium is proven, no start nearby leads to another",
          "[error_bound]") {
    const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
    std::vector<double> lengths;
    const MassSpringNetwork as_built(mesh, LinearSpring{}, {.stiffness = 1.0});
    int certified = 0, tried = 0;
    for (int seed = 1; seed <= cases(400); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        lengths.clear();
        const double swollen = random.number(1.0, 1.15);
        for (const auto& s : as_built.springs()) lengths.push_back(swollen * s.rest_length);
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0, .rest_length = lengths});
        const double stiffness = std::pow(10, random.number(-2.0, 0.5));
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness});
        test::StillMembrane still(network, mesh.positions(), stiffness);
        Points<double> x = still.equilibrium(test::jittered(mesh.positions(), 0.05, random)).x;
        x = test::jittered(x, std::pow(10, random.number(-6.0, -1.5)), random);
        ++tried;
        ErrorBound<FactoredConvexity> bound(network);
        const auto error = bound.compute(x, network, foundation);
        if (!error.certified()) continue;
        ++certified;
        const auto rest = still.equilibrium(x);
        CHECK(rest.stable);
        CHECK(farthest(rest.x, x) <= error.position);
        for (int start = 0; start < 5; ++start) {
            const auto other = still.equilibrium(test::jittered(x, error.position / 2, random)).x;
            if (still.forces(other).norm() > 1e-10 || farthest(other, x) > error.position) continue;
            CHECK(farthest(other, rest.x) < 1e-9);
        }
    }
    CHECK(certified > tried / 10);
    CHECK(certified < tried);
}

TEST_CASE("bounds with pins, loads, several held vertices and anchors that moved", "[error_bound]") {
    int certified = 0;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = disc<double>({.radius = 1, .rings = 6});
        std::vector<double> stiffnesses;
        for (std::size_t s = 0; s < edges(mesh).size(); ++s) stiffnesses.push_back(random.number(0.5, 2.0));
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = stiffnesses, .pinned = border(mesh)});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 1.0, .damping = 2e-4});
        const Points<double> anchors = test::jittered(mesh.positions(), 0.004, random);
        MovingBody body(mesh);
        Points<double> along = mesh.positions();
        REQUIRE(body.move_to(anchors, 1, along));
        const auto moved = on(body, foundation);
        const std::array<Index, 2> pinned{20, 33};
        const std::array<Index, 3> corners{mesh.triangles()(0, 5), mesh.triangles()(1, 5), mesh.triangles()(2, 5)};
        const auto weights = random.barycentric();
        const Vector3<double> force = random.vector<double>(-0.01, 0.01);
        const Vector3<double> target = point(mesh.positions(), 50) + random.vector<double>(-0.02, 0.02);
        QuasiStaticSolver solver(network, {.layers = 2 + random.index(8), .sweeps = 4});
        Points<double> x = mesh.positions();
        StepReport<double> report;
        for (int i = 0; i < 10; ++i) {
            report = solver.step(x, 1e-3, network, moved, pin(pinned), load(corners, weights, force), pull(50, target));
        }
        REQUIRE(report.status == StepStatus::advanced);
        ErrorBound bound(network);
        const auto error =
            bound.compute(x, network, moved, pin(pinned), load(corners, weights, force), pull(50, target));
        test::StillMembrane still(network, anchors, 1);
        for (const Index v : {pinned[0], pinned[1], 50}) still.fix(v);
        for (int k = 0; k < 3; ++k) still.load(corners[static_cast<std::size_t>(k)], weights[k] * force);
        const auto rest = still.equilibrium(x);
        if (!error.certified()) continue;
        ++certified;
        CHECK(farthest(rest.x, x) <= error.position);
        CHECK(error.position <= 1.2 * farthest(rest.x, x));
        const Points<double> forces = still.forces(rest.x);
        const std::array<Vector3<double>, 3> reactions{forces.col(pinned[0]) + forces.col(pinned[1]), -force,
                                                       forces.col(50)};
        for (std::size_t i = 0; i < 3; ++i) {
            CHECK(norm<double>(reactions[i] - error.reactions[i].centre) <= error.reactions[i].radius + 1e-13);
            CHECK(norm<double>(reactions[i] - report.reactions[i]) <=
                  error.reactions[i].max_distance_to(report.reactions[i]) + 1e-13);
        }
        CHECK(error.reactions[1].radius == 0);
    }
    CHECK(certified >= cases(80));
}

TEST_CASE("bounds with points of triangles held", "[error_bound]") {
    int certified = 0;
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 1});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
        const double stiffness = random.number(0.2, 2.0);
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness});
        const auto held_at = [&](Index f) {
            const std::array<Index, 3> corners{mesh.triangles()(0, f), mesh.triangles()(1, f), mesh.triangles()(2, f)};
            const auto weights = random.barycentric();
            const Vector3<double> now = point_at(triangle_at(mesh.positions(), corners), weights);
            return PointAttachment<double>{f, corners, weights, now + random.vector<double>(-0.1, 0.1)};
        };
        const auto one = held_at(3), two = held_at(70);
        QuasiStaticSolver solver(network, {.layers = 3, .sweeps = 3});
        Points<double> x = mesh.positions();
        StepReport<double> report;
        for (int i = 0; i < 5; ++i) report = solver.step(x, 1e-3, network, foundation, one, two);
        ErrorBound<FactoredConvexity> bound(network);
        const auto error = bound.compute(x, network, foundation, one, two);
        if (!error.certified()) continue;
        ++certified;
        const auto place = [](const PointAttachment<double>& held) {
            return test::AttachedPoint{{held.corners.begin(), held.corners.end()},
                                       {held.barycentric[0], held.barycentric[1], held.barycentric[2]},
                                       held.target};
        };
        const test::SmallMembrane<MassSpringNetwork<double, LinearSpring>> small{.network = network,
                                                                                 .anchors = mesh.positions(),
                                                                                 .volume_stiffness = stiffness,
                                                                                 .held = {place(one), place(two)}};
        const auto rest = small.equilibrium(x);
        CHECK(farthest(rest.x, x) <= error.position + 1e-12);
        CHECK(error.position <= 1.2 * farthest(rest.x, x));
        for (std::size_t i = 0; i < 2; ++i) {
            const Vector3<double> reaction = -rest.holding[i];
            CHECK(norm<double>(reaction - error.reactions[i].centre) <= error.reactions[i].radius + 1e-11);
            CHECK(norm<double>(reaction - report.reactions[i]) <=
                  error.reactions[i].max_distance_to(report.reactions[i]) + 1e-11);
        }
    }
    CHECK(certified >= cases(30));
}

TEST_CASE("a membrane of floats", "[error_bound]") {
    const auto mesh = icosphere<float>({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0F});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 20.0F});
    QuasiStaticSolver solver(network, {.layers = 3, .sweeps = 3});
    Points<float> x = mesh.positions();
    const Vector3<float> target = 0.9F * point(x, 7);
    StepReport<float> report;
    for (int i = 0; i < 3; ++i) report = solver.step(x, 1e-3F, network, foundation, pull(7, target));
    ErrorBound bound(network);
    const auto error = bound.compute(x, network, foundation, pull(7, target));
    REQUIRE(error.certified());
    test::StillMembrane still(network, mesh.positions().cast<double>(), 20);
    still.fix(7);
    const auto rest = still.equilibrium(x.cast<double>());
    const Vector3<double> reaction = still.forces(rest.x).col(7);
    CHECK(farthest(rest.x, x.cast<double>()) <= error.position);
    CHECK(error.position <= 1.1 * farthest(rest.x, x.cast<double>()));
    CHECK(norm<double>(reaction - report.reactions[0].cast<double>()) <=
          error.reactions[0].max_distance_to(report.reactions[0]));
}

TEST_CASE("at rest the bound is a matter of rounding", "[error_bound]") {
    const Sphere sphere(2);
    ErrorBound bound(sphere.network);
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = 1.0});
    const auto error = bound.compute(sphere.mesh.positions(), sphere.network, foundation);
    CHECK(error.certified());
    CHECK(error.position < 1e-12);
    CHECK(error.reactions.empty());
    // All that is held is where it is to be, and nothing else can move.
    std::vector<Index> all;
    for (Index v = 0; v < sphere.mesh.vertex_count(); ++v) all.push_back(v);
    const auto held = bound.compute(sphere.mesh.positions(), sphere.network, foundation, pin(all));
    CHECK(held.certified());
    CHECK(held.position < 1e-12);
}

TEST_CASE("a vertex that is not yet where it is held counts", "[error_bound]") {
    Sphere sphere(2);
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = 1.0});
    const Points<double>& x = sphere.mesh.positions();
    const Vector3<double> target = 1.01 * point(x, 5);
    const auto error = sphere.quick.compute(x, sphere.network, foundation, pull(5, target));
    REQUIRE(error.certified());
    CHECK(error.position >= 0.01);
    CHECK(error.position <= 0.0101);
}

TEST_CASE("what no bound is known for is said, and why", "[error_bound]") {
    Sphere sphere(1);
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = 1.0});
    const Points<double> x = sphere.mesh.positions();
    const auto status = [&](const Points<double>& at, const auto&... constraints) {
        const auto error = sphere.quick.compute(at, sphere.network, foundation, constraints...);
        if (!error.certified()) CHECK(error.position == std::numeric_limits<double>::infinity());
        return error.status;
    };
    const Vector3<double> here = point(x, 3);
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    CHECK(status(x, pull(3, here)) == BoundStatus::certified);

    for (const double wrong : {nan, infinite, -infinite}) {
        Points<double> broken = x;
        broken(1, 4) = wrong;
        CHECK(status(broken) == BoundStatus::invalid_input);
        CHECK(status(x, pull(3, Vector3<double>(wrong, 0, 0))) == BoundStatus::invalid_input);
        CHECK(status(x, load({0, 1, 2}, Vector3<double>(1, 0, 0), Vector3<double>(0, wrong, 0))) ==
              BoundStatus::invalid_input);
    }
    for (const Index wrong : {-1, 42, 1'000'000}) {
        CHECK(status(x, pull(wrong, here)) == BoundStatus::invalid_input);
        CHECK(status(x, pin(std::array{wrong})) == BoundStatus::invalid_input);
        CHECK(status(x, load({0, wrong, 2}, Vector3<double>(1, 0, 0), here)) == BoundStatus::invalid_input);
        CHECK(status(x, PointAttachment<double>{0, {0, 1, wrong}, {1, 0, 0}, here}) == BoundStatus::invalid_input);
    }
    CHECK(status(x.leftCols(20)) == BoundStatus::invalid_input);
    CHECK(status(1e200 * x) != BoundStatus::certified);
    CHECK(status(0 * x) == BoundStatus::not_convex);

    const PointAttachment<double> point_held{0, {0, 12, 14}, {0.5, 0.25, 0.25}, here};
    CHECK(status(x, point_held, pin(std::array{12})) == BoundStatus::unsupported);
    CHECK(status(x, point_held, PointAttachment<double>{1, {12, 5, 6}, {0.5, 0.25, 0.25}, here}) ==
          BoundStatus::unsupported);
    CHECK(status(x, PointAttachment<double>{}) == BoundStatus::certified);

    const auto free = sphere.quick.compute(x, sphere.network, NoFoundation{}, load({0, 1, 2}, {1, 0, 0}, here));
    CHECK(free.status == BoundStatus::not_convex);  // it may drift
    CHECK((free.reactions[0].centre == -here && free.reactions[0].radius == 0));

    Contact<double> contact;
    CHECK(status(x, press(Tool<double>{}, contact)) == BoundStatus::certified);
    contact.phase = ContactPhase::ongoing;
    contact.corners = {0, 1, 2};
    contact.patch.radius = 0.1;
    CHECK(status(x, press(Tool<double>{.radius = 0.1}, contact)) == BoundStatus::contact);

    ErrorBound hasty(sphere.network, {.cg_iterations = 1});
    const auto far = hasty.compute(x, sphere.network, foundation, pull(3, 1.3 * here));
    CHECK_FALSE(far.certified());
    CHECK(far.cg_iterations == 1);
    CHECK_THROWS_AS(ErrorBound(sphere.network, {.cg_iterations = 0}), InvalidInput);
}

TEMPLATE_TEST_CASE("a bound is the same in all units of length and stiffness", "[error_bound]", BlockConvexity,
                   FactoredConvexity) {
    const Sphere sphere(1);
    test::Random random(1);
    const Points<double> x = test::jittered(sphere.mesh.positions(), 1e-4, random);
    const Vector3<double> target = 1.01 * point(x, 5), force = 1e-3 * random.vector();
    const auto compute = [&](double length, double stiffness) {
        const TriangleMesh<double> mesh(length * sphere.mesh.positions(), sphere.mesh.triangles());
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = stiffness, .pinned = {7}});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = stiffness});
        ErrorBound<TestType> bound(network);
        const auto error = bound.compute(length * x, network, foundation, pull(5, length * target),
                                         load({20, 21, 22}, {0.5, 0.2, 0.3}, length * stiffness * force));
        const auto at_rest = bound.compute(mesh.positions(), network, foundation);
        REQUIRE((error.certified() && at_rest.certified()));
        return std::array{error.position / length, error.convexity / stiffness, at_rest.position / length,
                          error.reactions[0].radius / (length * stiffness)};
    };
    const auto expected = compute(1, 1);
    for (const double unit : {0x1p-20, 0x1p20}) {  // exact
        CHECK(compute(unit, 1) == expected);
        CHECK(compute(1, unit) == expected);
    }
}

TEST_CASE("a bound remembers nothing, and its copies are their own", "[error_bound]") {
    Sphere sphere(1);
    const VirtualVolumeSprings foundation(sphere.mesh, {.stiffness = 1.0});
    const Points<double> x = sphere.mesh.positions();
    const Vector3<double> target = 1.02 * point(x, 5);
    const auto first = sphere.quick.compute(x, sphere.network, foundation, pull(5, target));
    ErrorBound copy = sphere.quick;
    (void)sphere.quick.compute(x, sphere.network, foundation, pull(9, 0.9 * point(x, 9)), pin(std::array{1, 2}));
    for (auto* bound : {&copy, &sphere.quick}) {
        const auto again = bound->compute(x, sphere.network, foundation, pull(5, target));
        CHECK(again.position == first.position);
        CHECK(again.reactions.size() == 1);
    }
    CHECK(copy.compute(x, sphere.network, foundation).reactions.data() != first.reactions.data());
}

namespace {

using Springs = MassSpringNetwork<double, LinearSpring>;

// The network of the torn mesh with the springs of `torn`, in the order of its edges.
Springs built_anew(const TornSurface<double>& surface, const Springs& torn) {
    const TriangleMesh<double> mesh(surface.rest_positions(), surface.triangles());
    std::map<std::array<Index, 2>, Spring<double>> by_ends;
    for (const auto& spring : torn.springs()) {
        const auto [low, high] = std::minmax(spring.first, spring.second);
        by_ends[{low, high}] = spring;
    }
    std::vector<Index> pinned;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        if (torn.pinned(v)) pinned.push_back(v);
    }
    const Adjacency adjacency(mesh);
    std::vector<double> stiffness, rest;
    for (const auto& edge : adjacency.edges()) {
        stiffness.push_back(by_ends.at(edge).stiffness);
        rest.push_back(by_ends.at(edge).rest_length);
    }
    REQUIRE(by_ends.size() == stiffness.size());
    return {mesh, LinearSpring{}, {.stiffness = stiffness, .rest_length = rest, .pinned = pinned}};
}

void check_equal(const ErrorReport& found, const ErrorReport& expected) {
    REQUIRE(found.status == expected.status);
    CHECK(found.convexity == Approx(expected.convexity).epsilon(1e-9));
    CHECK(found.position == Approx(expected.position).epsilon(1e-6));
}

}  // namespace

// A foundation per area, or none, has no stiffness at the vertices in reserve.
TEST_CASE("a membrane that has torn has the bounds and the tangent of the torn mesh that is built anew",
          "[error_bound][tear]") {
    int certified = 0, torn_splits = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto flat = disc<double>({.radius = 0.01, .rings = 5});
        const auto mesh = with_reserve(flat, 20);
        TearableSprings springs(mesh, Springs(mesh, LinearSpring{}, {.stiffness = 10.0, .pinned = border(flat)}));
        auto per_area = vertex_areas(mesh);
        for (double& each : per_area) each *= 1e6;
        VirtualVolumeSprings<double> foundation(mesh, {.stiffness = per_area});
        ErrorBound<> quick(springs);
        ErrorBound<FactoredConvexity> stale(springs);
        TangentStiffness tangent(springs);
        Tearing tear(mesh, EnergyRelease{.toughness = 1, .thickness = 1e-4});
        Points<double> x = mesh.positions();
        for (int n = 0; n < 4; ++n) {
            const auto expected = built_anew(tear.surface(), springs);
            const Points<double> off =
                x + 1e-6 * Points<double>::NullaryExpr(3, x.cols(), [&] { return random.number(-1.0, 1.0); });
            ErrorBound<> quick_anew(expected);
            ErrorBound<FactoredConvexity> sharp(springs), sharp_anew(expected);
            const auto error = quick.compute(off, springs, foundation);
            check_equal(error, quick_anew.compute(off, expected, foundation));
            check_equal(sharp.compute(off, springs, foundation), sharp_anew.compute(off, expected, foundation));
            certified += error.certified() ? 1 : 0;
            const auto now = stale.compute(off, springs, foundation);
            CHECK(now.status == (tear.surface().reserve() == 20 ? BoundStatus::certified : BoundStatus::not_convex));
            const Index v = random.index(20);
            const auto held = pull(v, point(x, v));
            const auto slope = tangent.compute(x, springs, foundation, held);
            TangentStiffness tangent_anew(expected);
            const auto right = tangent_anew.compute(x, expected, foundation, held);
            REQUIRE(slope.status == right.status);
            CHECK(dense(slope.stiffness).isApprox(dense(right.stiffness), 1e-6));
            for (const auto& event : test::cut_at_random(random, tear, x)) {
                follow(event, springs, foundation);
                ++torn_splits;
            }
        }
    }
    CHECK(certified > 2 * cases(20));
    CHECK(torn_splits > cases(20));
}
