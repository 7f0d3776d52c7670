// SPDX-License-Identifier: MIT
#include <membrane/accuracy/trial.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::refusal;

namespace {

using Point = Vector3<double>;

constexpr double radius = 0.01, tool_radius = 3e-3, dt = 1e-3;  // [m], [m], [s]

/// A sphere, and a tool that presses, slides, closes on it, pulls, opens and leaves.
template <Real Scalar>
struct Scene {
    TriangleMesh<Scalar> mesh = icosphere<Scalar>({.radius = radius, .subdivisions = 2});
    MassSpringNetwork<Scalar, LinearSpring> network{mesh, {}, {.stiffness = Scalar(40), .mass = Scalar(4e-4)}};
    VirtualVolumeSprings<Scalar> foundation{mesh, {.stiffness = Scalar(8)}};
    std::vector<Tool<Scalar>> tools;

    Scene() {
        const auto go = [&](double x, double height, bool grasping = false) {
            tools.push_back({.position = Point(x, 0, radius + tool_radius + height).template cast<Scalar>(),
                             .radius = Scalar(tool_radius),
                             .grasping = grasping});
        };
        for (int t = 0; t < 12; ++t) go(0, 2e-4 - 1e-4 * t);
        for (int t = 0; t < 12; ++t) go(5e-5 * t, -9e-4);
        for (int t = 0; t < 12; ++t) go(6e-4, -9e-4 + 1e-4 * t, true);
        for (int t = 0; t < 4; ++t) go(6e-4, 1e-3 + 1e-3 * t);
    }
    ToolTrajectory<Scalar> stroke() const { return {mesh, tools, Scalar(dt)}; }
    Index ticks() const { return static_cast<Index>(tools.size()); }

    template <class History, class Rule = BlockStep, class Clock = SteadySeconds>
    TrialResult play(const History& history, std::span<const ReferenceTick> references,
                     const SolverOptions<Scalar>& options = {}, const Rule& rule = {}, const Clock& clock = {}) const {
        return run_trial(mesh, network, foundation, history, references, options, rule, clock);
    }

    /// Plays the stroke: each(tick, x, report, constraints...) after every step.
    template <class Each>
    void play_each(const SolverOptions<Scalar>& options, Each each) const {
        auto history = stroke();
        QuasiStaticSolver solver(network, options);
        Points<Scalar> x = mesh.positions();
        std::vector<Index> moved;
        for (Index tick = 0; tick < ticks(); ++tick) {
            const auto [presses, pulls] = history(tick, x, moved);
            const auto report = solver.step(x, Scalar(dt), network, foundation, presses, pulls);
            moved.assign(report.moved.begin(), report.moved.end());
            each(tick, x, report, presses, pulls);
        }
    }
};

/// A vertex is pulled out, a load turns, others are pinned.
struct Pinch {
    std::array<Index, 2> pins{30, 31};
    Index last = 19;

    Index ticks() const { return last + 1; }
    double dt() const { return 1e-3; }
    std::tuple<VertexAttachment<double>, PointLoad<double>, PinnedVertices> operator()(Index tick,
                                                                                       const ConstPointsRef<double>&,
                                                                                       std::span<const Index>) const {
        const double turn = 0.1 * tick;
        return {pull(5, pulled + 5e-5 * tick * pulled.normalized()),
                load<double>({0, 12, 14}, {0.5, 0.25, 0.25}, {0.02 * std::cos(turn), 0.02 * std::sin(turn), 0}),
                pin(pins)};
    }

    Point pulled = icosphere<double>({.radius = radius, .subdivisions = 2}).positions().col(5);
};
static_assert(LoadHistory<Pinch, double> && !LoadHistory<Pinch, float> && !LoadHistory<Tool<double>, double>);

/// Only what no hand feels.
struct LoadedAlone {
    Index ticks() const { return 3; }
    double dt() const { return 1e-3; }
    std::tuple<PointLoad<double>> operator()(Index tick, const ConstPointsRef<double>&, std::span<const Index>) const {
        return {load<double>({0, 12, 14}, {0.5, 0.25, 0.25}, {0, 0, -0.01 * (tick + 1)})};
    }
};

/// A history that cannot be played.
struct Odd {
    Index count = 1;
    double step = 1e-3;

    Index ticks() const { return count; }
    double dt() const { return step; }
    std::tuple<> operator()(Index, const ConstPointsRef<double>&, std::span<const Index>) const { return {}; }
};

}  // namespace

TEST_CASE("a stroke gives what the loop of the README does") {
    const Scene<double> scene;
    const SolverOptions<double> options{.layers = 4, .sweeps = 2};
    auto stroke = scene.stroke();
    QuasiStaticSolver solver(scene.network, options), other(scene.network, options);
    AabbTree tree(scene.mesh);
    ContactTracker tracker(scene.mesh);
    Grasper grasper(scene.mesh);
    Points<double> x = scene.mesh.positions(), y = x;
    std::vector<Index> moved;
    bool pressed = false, pulled = false;
    for (Index tick = 0; tick < stroke.ticks(); ++tick) {
        CAPTURE(tick);
        const auto& tool = scene.tools[static_cast<std::size_t>(tick)];
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, dt, scene.network, scene.foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);

        const auto constraints = stroke(tick, y, moved);
        const auto same = other.step(y, stroke.dt(), scene.network, scene.foundation, std::get<0>(constraints),
                                     std::get<1>(constraints));
        moved.assign(same.moved.begin(), same.moved.end());
        CHECK(test::same_bits(x, y));
        pressed |= report.reactions[0].norm() > 0;
        pulled |= report.reactions[1].norm() > 0;
    }
    CHECK(pressed);
    CHECK(pulled);
}

TEST_CASE("the errors of a trial are those to the equilibrium of each tick") {
    const Scene<double> scene;
    const SolverOptions<double> options{.layers = 4, .sweeps = 2};
    for (const Index tick_stride : {1, 3}) {
        const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke(), tick_stride);
        REQUIRE(references.size() == static_cast<std::size_t>(scene.ticks() / tick_stride));
        const auto outcome = scene.play(scene.stroke(), references, options);

        double errors = 0, squares = 0, displacements = 0;
        scene.play_each(options, [&](Index tick, const auto& x, const auto& report, const auto&... constraints) {
            if ((tick + 1) % tick_stride != 0) return;
            const auto& rest = references[static_cast<std::size_t>(tick / tick_stride)];
            CHECK(rest.tick == tick);
            const auto exact = equilibrium(x, scene.mesh, scene.network, scene.foundation, {}, constraints...);
            CHECK((exact.x - rest.x).norm() < 0.02 * radius);
            for (std::size_t i = 0; i < 2; ++i) {
                errors += (report.reactions[i] - rest.reactions[i]).squaredNorm();
                squares += rest.reactions[i].squaredNorm();
            }
            displacements += std::pow((x - rest.x).colwise().norm().maxCoeff(), 2);
        });
        CHECK(outcome.force_error == Approx(std::sqrt(errors / squares)));
        CHECK(outcome.position_error == Approx(std::sqrt(displacements / static_cast<double>(references.size()))));
        CHECK(outcome.force_error < 0.1);
        CHECK(outcome.ticks_compared == scene.ticks() / tick_stride);
        CHECK(outcome.advanced);
    }
}

TEST_CASE("the largest error of a tick, and the motion, are those of the ticks one by one") {
    const Scene<double> scene;
    const SolverOptions<double> options{.layers = 4, .sweeps = 2};
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke());
    const auto outcome = scene.play(scene.stroke(), references, options);
    double largest = 0, squares = 0, far = 0;
    scene.play_each(options, [&](Index tick, const auto& x, const auto& report, const auto&...) {
        const auto& rest = references[static_cast<std::size_t>(tick)];
        double error = 0;
        for (std::size_t i = 0; i < 2; ++i) error += (report.reactions[i] - rest.reactions[i]).squaredNorm();
        largest = std::max(largest, error);
        squares += rest.force * rest.force / static_cast<double>(references.size());
        far = std::max(far, (x - scene.mesh.positions()).colwise().norm().maxCoeff());
    });
    CHECK(outcome.max_force_error == Approx(std::sqrt(largest / squares)));
    CHECK(outcome.max_displacement == Approx(far));
    CHECK(outcome.max_speed == Approx(0.1));  // 1e-4 m a tick, in, out and up; 5e-5 along. The last 1e-3 are let go
}

TEST_CASE("more of everything is nearer to the equilibrium") {
    const Scene<double> scene;
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke());
    double force = 1, displacement = radius;
    for (const Index much : {1, 4, 16, 64}) {
        const auto outcome =
            scene.play(scene.stroke(), references, {.layers = much, .sweeps = much, .contact_iterations = 8});
        CHECK(outcome.force_error < force);
        CHECK(outcome.position_error < displacement);
        CHECK(outcome.layers_reached == std::min(much, outcome.layers_reached));
        force = outcome.force_error;
        displacement = outcome.position_error;
    }
    CHECK(force < 1e-3);
    CHECK(displacement < 1e-4 * radius);
    CHECK(scene.play(scene.stroke(), references, {.layers = 64}).layers_reached < 12);
    CHECK(scene.play(scene.stroke(), references, {.layers = 2}).layers_reached == 2);
}

/// A vertex of a mesh without springs, drawn out along its radius at a constant speed.
struct Draw {
    static constexpr double speed = 0.02;  // [m/s]
    Point from = icosphere<double>({.radius = radius, .subdivisions = 2}).positions().col(5);

    Index ticks() const { return 20; }
    double dt() const { return 1e-3; }
    std::tuple<VertexAttachment<double>> operator()(Index tick, const ConstPointsRef<double>&,
                                                    std::span<const Index>) const {
        return {pull(5, from + speed * dt() * (tick + 1) * from.normalized())};
    }
};

TEST_CASE("damping adds its coefficient times the speed to a vertex drawn out of its foundation") {
    const Scene<double> scene;
    const MassSpringNetwork<double, LinearSpring> slack(scene.mesh, {}, {.stiffness = 1e-9});
    for (const double damping : {0.0, 0.02, 0.3}) {
        const VirtualVolumeSprings foundation(scene.mesh, {.stiffness = 8.0, .damping = damping});
        const auto exact = exact_steps(scene.mesh, slack, foundation, Draw{});
        const auto still = equilibria(scene.mesh, slack, foundation, Draw{});
        REQUIRE(exact.size() == 20);
        double elastic = 0;  // sum of squares
        for (const auto& step : exact) {
            const double out = Draw::speed * 1e-3 * (step.tick + 1);
            CHECK(step.force == Approx(8.0 * out + damping * Draw::speed));
            elastic += 64 * out * out;
        }
        CHECK(viscous_difference(exact, still) ==
              Approx(std::sqrt(20 * std::pow(damping * Draw::speed, 2) / elastic)).margin(1e-6));
    }
}

/// The foundation during one tick, as an equilibrium sees it.
struct InOneTick {
    const VirtualVolumeSprings<double>& foundation;
    const Points<double>& before;

    VertexForce<double> force_on(Index v, const Point& position, const Point&, double) const noexcept {
        return foundation.force_on(v, position, point(before, v), dt);
    }
};

/// The largest difference of exact steps from Newton's method with the damping of the tick, of a force over the largest
/// of all and of a position over the radius.
template <class History>
std::pair<double, double> off_newton(const Scene<double>& scene, History history) {
    const VirtualVolumeSprings foundation(scene.mesh, {.stiffness = 8.0, .damping = 0.02});
    const auto exact = exact_steps(scene.mesh, scene.network, foundation, history);
    REQUIRE(exact.size() == static_cast<std::size_t>(history.ticks()));
    std::vector<Index> all(static_cast<std::size_t>(scene.mesh.vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    Points<double> x = scene.mesh.positions();
    double largest = 0, force = 0, position = 0;
    for (const auto& step : exact) {
        CAPTURE(step.tick);
        const auto constraints = history(step.tick, x, all);
        const auto solve = [&](const auto&... each) {
            return equilibrium(x, scene.mesh, scene.network, InOneTick{foundation, x},
                               {.max_iterations = 2000, .tolerance = 1e-10}, each...);
        };
        const auto newton = std::apply(solve, constraints);
        REQUIRE(newton.converged);
        for (std::size_t i = 0; i < step.reactions.size(); ++i) {
            force = std::max(force, norm<double>(step.reactions[i] - newton.reactions[i]));
        }
        position = std::max(position, (step.x - newton.x).colwise().norm().maxCoeff());
        largest = std::max(largest, step.force);
        x = step.x;
    }
    return {force / largest, position / radius};
}

TEST_CASE("exact steps are those of Newton's method with the damping of the tick") {
    const Scene<double> scene;
    const auto [force, position] = off_newton(scene, Pinch{});
    CHECK(force < 1e-6);
    CHECK(position < 1e-6);
    // A step is pressed at the triangles of its contact, an equilibrium everywhere.
    const auto [pressed_force, pressed_position] = off_newton(scene, scene.stroke());
    CHECK(pressed_force < 5e-3);
    CHECK(pressed_position < 2e-3);
}

TEST_CASE("without damping exact steps are equilibria, and a solver that goes on is all right by them") {
    const Scene<double> scene;
    const auto still = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke(), 4);
    CHECK(viscous_difference(exact_steps(scene.mesh, scene.network, scene.foundation, scene.stroke(), 4), still) <
          1e-4);
    const VirtualVolumeSprings foundation(scene.mesh, {.stiffness = 8.0, .damping = 0.02});
    const auto exact = exact_steps(scene.mesh, scene.network, foundation, scene.stroke());
    const auto slow = equilibria(scene.mesh, scene.network, foundation, scene.stroke());
    const SolverOptions<double> many{.layers = 64, .sweeps = 64, .contact_iterations = 8};
    const auto play = [&](const std::vector<ReferenceTick>& references) {
        return run_trial(scene.mesh, scene.network, foundation, scene.stroke(), references, many).force_error;
    };
    const double viscous = viscous_difference(exact, slow);
    CHECK(viscous > 0.02);
    CHECK(play(exact) < 1e-3);
    CHECK(play(slow) == Approx(viscous).epsilon(0.05));
}

TEST_CASE("floats are set against the same equilibria") {
    const Scene<float> scene;
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke());
    const auto outcome = scene.play(scene.stroke(), references, {.layers = 64, .sweeps = 16});
    CHECK(outcome.force_error < 0.01);
    CHECK(outcome.force_error > 0);
}

TEST_CASE("a history of one's own is played, and reactions of loads and pins do not count") {
    const Scene<double> scene;
    const Pinch pinch;
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, pinch);
    REQUIRE(references.size() == 20);
    for (const auto& rest : references) {
        REQUIRE(rest.reactions.size() == 3);
        CHECK(rest.force == rest.reactions[0].norm());
    }
    const auto outcome = scene.play(pinch, references, {.layers = 64, .sweeps = 32});
    CHECK(outcome.force_error < 0.02);
    CHECK(scene.play(pinch, references, {.layers = 2, .sweeps = 1}).force_error > outcome.force_error);

    const auto alone = equilibria(scene.mesh, scene.network, scene.foundation, LoadedAlone{});
    CHECK(alone.back().force == 0);
    const auto unfelt = scene.play(LoadedAlone{}, alone);
    CHECK(unfelt.force_error == 0);
    CHECK(unfelt.time == 0);
    CHECK(unfelt.position_error > 0);
}

TEST_CASE("the time is that of the ticks in which a force is felt, by the given clock") {
    struct OneSecondEach {
        double* now;
        double operator()() const { return *now += 1; }
    };
    const Scene<double> scene;
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke(), 10);
    double now = 0;
    CHECK(scene.play(scene.stroke(), references, {}, BlockStep{}, OneSecondEach{&now}).time == 1);
    CHECK(now == 2 * scene.ticks());
    CHECK(scene.play(scene.stroke(), references).time < 1);
}

TEST_CASE("trials by vertices compare with equilibria by vertices") {
    const Scene<double> scene;
    const ToolTrajectory<double> stroke(scene.mesh, scene.tools, dt, {.fine_triangles = 1});
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, stroke, 5);
    const ToolTrajectory<double> of_faces(scene.mesh, scene.tools, dt, {.fine_triangles = 0});
    const auto by_faces = equilibria(scene.mesh, scene.network, scene.foundation, of_faces, 5);
    const SolverOptions<double> most{.layers = unlimited, .sweeps = 60};
    CHECK(scene.play(stroke, references, most).force_error < 1e-4);
    CHECK(scene.play(of_faces, references, most).force_error > 0.05);
    REQUIRE(references[3].tick == by_faces[3].tick);
    CHECK(references[3].force < 0.8 * by_faces[3].force);  // flat faces hold the membrane off the tool
}

TEST_CASE("a step that is refused ends the trial") {
    const Scene<double> scene;
    const auto references = equilibria(scene.mesh, scene.network, scene.foundation, scene.stroke(), 10);
    CHECK(scene.play(scene.stroke(), references, {}, MassStep{}).advanced);
    const MassSpringNetwork light(scene.mesh, LinearSpring{}, {.stiffness = 40.0, .mass = 1e-7});
    const auto outcome = run_trial(scene.mesh, light, scene.foundation, scene.stroke(), references, {}, MassStep{});
    CHECK_FALSE(outcome.advanced);
    CHECK(outcome.force_error == std::numeric_limits<double>::infinity());
    CHECK(outcome.time == std::numeric_limits<double>::infinity());
}

TEST_CASE("a stroke or a trial that makes no sense is refused") {
    const Scene<double> scene;
    const std::vector<Tool<double>> one{{.position = {0, 0, 1}, .radius = 1e-3}};
    CHECK(refusal([&] { ToolTrajectory(scene.mesh, {}, dt); }) ==
          "ToolTrajectory: the history must have a tick, got 0");
    CHECK(refusal([&] { ToolTrajectory(scene.mesh, one, 0); }) ==
          "ToolTrajectory: dt of the history must be finite and positive [s], got 0");
    CHECK(refusal([&] { ToolTrajectory(scene.mesh, one, dt, {.fine_triangles = 2}); }) ==
          "ContactTracker: fine_triangles must be from 0 to 1 [tool radii], got 2");
    auto tools = scene.tools;
    tools[7].radius = -1;
    CHECK(refusal([&] { ToolTrajectory(scene.mesh, tools, dt); }) ==
          "ToolTrajectory: the tool of tick 7 must be finite, its radius not negative, got one that is not");

    const auto references_of = [&](const auto& history, Index tick_stride = 1) {
        return equilibria(scene.mesh, scene.network, scene.foundation, history, tick_stride);
    };
    CHECK(refusal([&] { (void)references_of(Odd{.count = 0}); }) == "equilibria: the history must have a tick, got 0");
    CHECK(refusal([&] { (void)references_of(Odd{.step = -1}); }) ==
          "equilibria: dt of the history must be finite and positive [s], got -1");
    CHECK(refusal([&] { (void)references_of(Odd{}, 0); }) == "equilibria: tick_stride must be at least 1, got 0");
    const auto exact = [&](const auto& history, Index tick_stride) {
        return refusal([&] { (void)exact_steps(scene.mesh, scene.network, scene.foundation, history, tick_stride); });
    };
    CHECK(exact(Odd{.count = 0}, 1) == "exact_steps: the history must have a tick, got 0");
    CHECK(exact(Odd{}, 0) == "exact_steps: tick_stride must be at least 1, got 0");
    CHECK(refusal([&] { (void)viscous_difference({}, {}); }) ==
          "viscous_difference: both must have a tick with a force in common, got none");
    const std::vector<ReferenceTick> first{{.tick = 3, .x = {}, .reactions = {Point(1, 0, 0)}, .force = 1}};
    const std::vector<ReferenceTick> second{{.tick = 3, .x = {}, .reactions = {}, .force = 0}};
    CHECK(refusal([&] { (void)viscous_difference(first, second); }) ==
          "viscous_difference: tick 3 must have as many reactions in both, got 1 and 0");

    auto references = references_of(Pinch{}, 5);
    const std::string others =
        "run_trial: references must be of ticks of the history, in order, at least one; got others";
    CHECK(refusal([&] { (void)scene.play(Pinch{}, {}); }) == others);
    CHECK(refusal([&] { (void)scene.play(Pinch{.last = 12}, references); }) == others);
    CHECK(refusal([&] { (void)scene.play(Odd{.count = 0}, references); }) ==
          "run_trial: the history must have a tick, got 0");
    CHECK(refusal([&] { (void)scene.play(Pinch{}, references, {.sweeps = 0}); }) ==
          "QuasiStaticSolver: sweeps must be at least 1, got 0");
    references[1].reactions.pop_back();
    CHECK(refusal([&] { (void)scene.play(Pinch{}, references); }) ==
          "run_trial: the reference of tick 9 must have 162 vertices and 3 reactions, got 162 and 2");
    references = references_of(Pinch{}, 5);
    std::swap(references[0], references[1]);
    CHECK(refusal([&] { (void)scene.play(Pinch{}, references); }) == others);
}
