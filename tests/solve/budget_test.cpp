// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

// Whatever ends a step early, deadline or limit, and whatever it is combined with: the membrane stays near the tool,
// the force near what it would be with all the time in the world, and the report says what is left.
namespace {

constexpr double radius = 0.01, dt = 1e-3;  // [m], [s]

/// A sphere of 10 mm by [Liu07], as the README has it.
template <class Scalar>
struct Membrane {
    TriangleMesh<Scalar> mesh = icosphere<Scalar>({.radius = Scalar(radius), .subdivisions = 2});
    MassSpringNetwork<Scalar, LinearSpring> network{mesh, {}, {.stiffness = Scalar(40), .mass = Scalar(1.5e-4)}};
    VirtualVolumeSprings<Scalar> foundation{mesh, {.stiffness = Scalar(8), .damping = Scalar(0.02)}};
};

/// What a step of a run may cost: parts of what it would cost without an end, and vertex updates.
struct Budget {
    double time;  // the deadline, as a part of the clock readings of a whole step
    Index max_vertex_updates;
};

/// Each reading takes one unit of time; none is late before `end`.
struct CountingClock {
    double* readings;
    double operator()() const { return *readings += 1; }
};

/// Counts how often it is enforced.
template <class Scalar>
struct CountedPress : ToolContact<Scalar> {
    int* enforced;
    bool enforce(ConstraintContext<Scalar>& context) const noexcept {
        ++*enforced;
        return ToolContact<Scalar>::enforce(context);
    }
};

enum class Path { press, hold, slide, turn_back, jerk };

/// A ball in motion: into the membrane, then along `path`, then at rest.
template <class Scalar>
std::vector<Tool<Scalar>> tools(Path path, Random& random) {
    const Vector3<double> out = random.unit_vector();
    const Vector3<double> along = cross<double>(out, random.unit_vector()).normalized();
    const double r = random.number(1e-3, 3e-3), depth = random.number(0.2e-3, 1.5e-3),
                 speed = random.number(2e-5, 1e-4);
    std::vector<Tool<Scalar>> list;
    double angle = 0, below = -1e-4;
    const auto add = [&] {
        const Vector3<double> at = (radius + r - below) * (std::cos(angle) * out + std::sin(angle) * along);
        list.push_back({.position = at.cast<Scalar>(), .radius = Scalar(r), .time = Scalar(dt * double(list.size()))});
    };
    for (; below < depth; below += path == Path::jerk ? 4 * speed : speed) add();
    const int ticks = 40;
    for (int i = 0; i < ticks; ++i, add()) {
        if (path == Path::slide) angle += speed / radius;
        if (path == Path::turn_back) angle += (i < ticks / 2 ? speed : -speed) / radius;
        if (path == Path::press) below += speed / 8;
        if (path == Path::jerk && i % 10 == 5) angle += random.number(0.0, 0.3 * r) / radius;
    }
    return list;
}

/// One membrane under one tool.
template <class Scalar, class Rule>
struct Run {
    Run(const Membrane<Scalar>& scene, const SolverOptions<Scalar>& options, Rule rule)
        : membrane(scene), solver(scene.network, options, rule), tree(scene.mesh), tracker(scene.mesh) {}

    /// A tick whose step has time for so many readings of the clock; returns how many it took.
    double tick(const Tool<Scalar>& tool, double readings_left) {
        contact = tracker.update(tree, x, tool);
        depth = std::max(depth, double(contact.depth));
        return step(tool, readings_left);
    }
    double step(const Tool<Scalar>& tool, double readings_left) {
        double readings = 0;
        start = x;
        enforced = 0;
        const CountedPress<Scalar> presses{press(tool, contact), &enforced};
        const Deadline deadline(CountingClock{&readings}, readings_left);
        report = solver.step_until(deadline, x, Scalar(dt), membrane.network, membrane.foundation, presses);
        tree.refit(x, report.moved);
        return readings;
    }
    double force() const { return double(norm(report.reactions[0])); }
    double farthest() const { return double((x - membrane.mesh.positions()).colwise().norm().maxCoeff()); }

    /// The stiffness with which all that touches would resist, were nothing else to move [N/m].
    double stiffness_of_layer_0() const {
        double sum = 0;
        if (solver.queue().layer_count() == 0) return sum;
        for (const Index v : solver.queue().layer(0)) {
            sum += double(membrane.network.force_on(v, x).stiffness) + 8 + 0.02 / dt;
        }
        return sum;
    }

    const Membrane<Scalar>& membrane;
    QuasiStaticSolver<Scalar, Rule> solver;
    AabbTree<Scalar> tree;
    ContactTracker<Scalar> tracker;
    Points<Scalar> x = membrane.mesh.positions(), start = x;
    Contact<Scalar> contact;
    StepReport<Scalar> report;
    double depth = 0;
    int enforced = 0;       // in the last step
    bool reads_all = true;  // no limit of updates leaves out any of the queue
};

constexpr double no_end = 1e9;

/// What the report of the last step says, against a step that is then let run to its end, and against the forces.
template <class Scalar, class Rule>
void check_report(Run<Scalar, Rule>& run, Run<Scalar, Rule> before, const Tool<Scalar>& tool) {
    const auto& report = run.report;
    before.contact = run.contact;
    before.step(tool, no_end);
    REQUIRE_FALSE(before.report.out_of_time);
    if (report.out_of_time) {
        REQUIRE((report.vertex_updates < before.report.vertex_updates || run.enforced < before.enforced));
    } else {
        REQUIRE(same_bits(run.x, before.x));
        REQUIRE(report.vertex_updates == before.report.vertex_updates);
        REQUIRE(report.converged == before.report.converged);
    }
    const auto& queue = run.solver.queue();
    double beyond = 0;  // layer 0
    for (const Index v : queue.vertices()) {
        if (queue.layer_count() > 0 && std::ranges::count(queue.layer(0), v) > 0) continue;
        const Vector3<Scalar> here = point(run.x, v);
        const Vector3<Scalar> foundation =
            run.membrane.foundation.force_on(v, here, point(run.start, v), Scalar(dt)).force;
        beyond = std::max(beyond, double(norm<Scalar>(run.membrane.network.force_on(v, run.x).force + foundation)));
    }
    const double rounding = 1e4 * radius * double(std::numeric_limits<Scalar>::epsilon());
    if (run.reads_all) REQUIRE(beyond <= double(report.residual) + rounding);
    if (report.converged) REQUIRE(double(report.residual) <= 1e-6 * (1 + 1e-6));
}

template <class Scalar>
SolverOptions<Scalar> random_options(Random& random) {
    constexpr std::array<Index, 4> layers{0, 1, 6, unlimited};
    SolverOptions<Scalar> options{.layers = layers[std::size_t(random.index(4))], .sweeps = 1 + random.index(3)};
    options.adaptive_layers = random.chance(0.2);
    options.order = std::array{UpdateOrder::breadth_first, UpdateOrder::colour_layers,
                               UpdateOrder::colour_all}[std::size_t(random.index(3))];
    options.predict = random.chance(0.7);
    options.force_tolerance = Scalar(1e-6);  // of some 10 mN
    return options;
}

template <class Scalar, class Rule>
void check_run(const Membrane<Scalar>& scene, std::uint64_t seed, Rule rule) {
    CAPTURE(seed);
    Random random(seed);
    const auto path = static_cast<Path>(random.index(5));
    const auto strokes = tools<Scalar>(path, random);
    auto options = random_options<Scalar>(random);
    Run<Scalar, Rule> whole(scene, options, rule);
    constexpr std::array parts{0.0, 0.05, 0.1, 0.2, 0.4, 0.8};
    const bool by_deadline = random.chance(0.6);
    const double part = by_deadline ? parts[std::size_t(random.index(6))] : 1;
    if (!by_deadline) {
        options.max_vertex_updates = Index(std::exp(random.number(0.0, std::log(2000.0))));
        options.sweeps = random.chance(0.3) ? 1 : options.sweeps;
    }
    CAPTURE(int(path), part, options.max_vertex_updates, options.layers, options.adaptive_layers, options.sweeps,
            options.predict, int(options.order));
    Run<Scalar, Rule> cut(scene, options, rule);

    double largest = 0;
    std::vector<double> readings, forces;
    for (const auto& tool : strokes) {
        readings.push_back(whole.tick(tool, no_end));
        REQUIRE(whole.report.status == StepStatus::advanced);
        forces.push_back(whole.force());
        largest = std::max(largest, whole.force());
    }
    cut.reads_all = by_deadline && !options.adaptive_layers;
    for (std::size_t i = 0; i < strokes.size(); ++i) {
        const auto before = cut;
        cut.tick(strokes[i], by_deadline ? part * readings[i] : no_end);
        REQUIRE(cut.report.status == StepStatus::advanced);
        check_report(cut, before, strokes[i]);
        const double motion = i == 0 ? 0 : double(norm<Scalar>(strokes[i].position - strokes[i - 1].position));
        CAPTURE(i, cut.force(), largest, motion, cut.farthest(), cut.depth);
        REQUIRE(cut.force() <= 1.5 * largest + cut.stiffness_of_layer_0() * motion);
        double lift = 0;  // of a vertex that carries the contact
        for (const auto& point : cut.contact.patch.points) lift = std::max(lift, double(point.lift));
        REQUIRE(cut.farthest() <= 2 * (cut.depth + lift) + 1e-6);
    }
    for (int i = 0; i < 20'000 && !whole.report.converged; ++i) whole.tick(strokes.back(), no_end);
    for (int i = 0; i < 20'000 && !cut.report.converged; ++i) {
        cut.tick(strokes.back(), by_deadline ? part * readings.back() : no_end);
    }
    constexpr double tolerance = 1e-2;
    CHECK(cut.report.converged);
    CHECK(whole.report.converged);
    // Which vertices have ever been within a few layers depends on the contact of every tick, and so does where they
    // rest.
    if (options.layers != unlimited && !options.adaptive_layers) return;
    CHECK(cut.force() == Approx(whole.force()).epsilon(tolerance));
    CHECK(double((cut.x - whole.x).cwiseAbs().maxCoeff()) <= tolerance * whole.depth);
}

/// The rms errors of the force, in parts of the largest.
struct Errors {
    double predicted = 0, unpredicted = 0;
};

/// Steps with and without a prediction, and without one but with sweeps to the end, take the path tick by tick. With
/// all layers: with fewer, the equilibrium depends on which vertices have ever been within them.
template <class Scalar, class Rule>
void check_prediction(const Membrane<Scalar>& scene, std::uint64_t seed, Rule rule, Errors& sum) {
    CAPTURE(seed);
    Random random(seed);
    const auto path = static_cast<Path>(random.index(5));
    const auto strokes = tools<Scalar>(path, random);
    auto options = random_options<Scalar>(random);
    options.layers = unlimited;
    options.adaptive_layers = false;
    options.predict = false;
    Run<Scalar, Rule> unpredicted(scene, options, rule);
    auto other = options;
    other.predict = true;
    Run<Scalar, Rule> predicted(scene, other, rule);
    other = options;
    other.sweeps = 300;
    Run<Scalar, Rule> exact(scene, other, rule);
    CAPTURE(int(path), options.sweeps, int(options.order));

    Errors errors;
    double largest = 0;
    for (const auto& tool : strokes) {
        for (auto* run : {&exact, &unpredicted, &predicted}) run->tick(tool, no_end);
        const auto squared_error = [&](const auto& run) {
            return double(squared_norm<Scalar>(run.report.reactions[0] - exact.report.reactions[0]));
        };
        errors.predicted += squared_error(predicted) / double(strokes.size());
        errors.unpredicted += squared_error(unpredicted) / double(strokes.size());
        largest = std::max(largest, exact.force());
    }
    errors = {std::sqrt(errors.predicted) / largest, std::sqrt(errors.unpredicted) / largest};
    CHECK(errors.predicted <= 1.25 * errors.unpredicted + 1e-3);
    sum.predicted += errors.predicted;
    sum.unpredicted += errors.unpredicted;
}

/// `check(membrane, seed, rule)` for seeds from 1, for all scalars and rules in turn.
void for_each_seed(int runs, auto check) {
    const Membrane<double> in_double;
    const Membrane<float> in_float;
    for (int seed = 1; seed <= runs; ++seed) {
        const auto number = static_cast<std::uint64_t>(seed);
        if (seed % 4 == 0) check(in_float, number, BlockStep{});
        if (seed % 4 == 1) check(in_double, number, SafeStep{});
        if (seed % 4 == 2) check(in_double, number, MassStep{});
        if (seed % 4 == 3) check(in_double, number, BlockStep{});
    }
}

}  // namespace

TEST_CASE("no budget makes a step worse than what the tool explains", "[solver][deadline][budget]") {
    for_each_seed(cases(6, 20'000), [](const auto&... run) { check_run(run...); });
}

TEST_CASE("in float a contact at rest is seen to be at rest", "[solver][budget]") {
    const Membrane<float> scene;
    for (const std::uint64_t seed : {10732U, 12196U}) check_run(scene, seed, BlockStep{});
}

TEST_CASE("a prediction makes the force worse on no path, and better by a third over all", "[solver][budget]") {
    Errors sum;
    for_each_seed(cases(20, 3'600), [&](const auto&... run) { check_prediction(run..., sum); });
    CHECK(3 * sum.predicted <= 2 * sum.unpredicted);
}
