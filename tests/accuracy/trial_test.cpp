// SPDX-License-Identifier: MIT
#include <membrane/accuracy/trial.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
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

        auto stroke = scene.stroke();
        QuasiStaticSolver solver(scene.network, options);
        Points<double> x = scene.mesh.positions();
        std::vector<Index> moved;
        double errors = 0, squares = 0, displacements = 0;
        for (Index tick = 0; tick < scene.ticks(); ++tick) {
            const auto [presses, pulls] = stroke(tick, x, moved);
            const auto report = solver.step(x, dt, scene.network, scene.foundation, presses, pulls);
            moved.assign(report.moved.begin(), report.moved.end());
            if ((tick + 1) % tick_stride != 0) continue;
            const auto& rest = references[static_cast<std::size_t>(tick / tick_stride)];
            CHECK(rest.tick == tick);
            const auto exact = equilibrium(x, scene.mesh, scene.network, scene.foundation, {}, presses, pulls);
            CHECK((exact.x - rest.x).norm() < 0.02 * radius);
            for (std::size_t i = 0; i < 2; ++i) {
                errors += (report.reactions[i] - rest.reactions[i]).squaredNorm();
                squares += rest.reactions[i].squaredNorm();
            }
            displacements += std::pow((x - rest.x).colwise().norm().maxCoeff(), 2);
        }
        CHECK(outcome.force_error == Approx(std::sqrt(errors / squares)));
        CHECK(outcome.position_error == Approx(std::sqrt(displacements / static_cast<double>(references.size()))));
        CHECK(outcome.force_error < 0.1);
        CHECK(outcome.ticks_compared == scene.ticks() / tick_stride);
        CHECK(outcome.advanced);
    }
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
