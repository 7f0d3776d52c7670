// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

// `converged` against the forces on all vertices and the distance to the tools, from nothing but positions.
namespace {

constexpr double radius = 0.01, dt = 1e-3;  // [m], [s]

/// A sphere, or a cap with or without a pinned rim, on a foundation that is softer than its springs or much stiffer.
struct Scene {
    explicit Scene(Random& random)
        : mesh(random.chance(0.3)
                   ? spherical_cap({.radius = radius, .diameter = 1.5 * radius, .rings = 4 + random.index(5)})
                   : icosphere({.radius = radius, .subdivisions = 1 + random.index(2)})),
          network(mesh, {}, {.stiffness = 40.0, .pinned = random.chance(0.5) ? border(mesh) : std::vector<Index>{}}),
          foundation_stiffness(40 * std::pow(10.0, random.number(-1.0, 3.0))),
          foundation(mesh, {.stiffness = foundation_stiffness, .damping = random.chance(0.5) ? 0.02 : 0.0}) {}

    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    double foundation_stiffness;  // [N/m]
    VirtualVolumeSprings<double> foundation;
};

SolverOptions<double> random_options(Random& random) {
    constexpr std::array<Index, 4> layers{0, 2, 6, unlimited};
    constexpr std::array orders{UpdateOrder::breadth_first, UpdateOrder::colour_layers, UpdateOrder::colour_all};
    SolverOptions<double> options;
    options.layers = layers[static_cast<std::size_t>(random.index(4))];
    options.adaptive_layers = random.chance(0.4);
    options.sweeps = 1 + random.index(8);
    options.contact_iterations = 1 + random.index(6);
    options.order = orders[static_cast<std::size_t>(random.index(3))];
    options.predict = random.chance(0.7);
    if (random.chance(0.3)) options.max_vertex_updates = 1 + random.index(1000);
    if (random.chance(0.6)) options.force_tolerance = std::pow(10.0, random.number(-7.0, -3.0));
    return options;
}

/// A sphere, a capsule or a point that comes within 30 ticks, stays, goes along, and leaves: slowly, or in one tick.
/// Some are forceps, which close and open meanwhile.
struct Stroke {
    Stroke(const TriangleMesh<double>& mesh, Random& random) {
        const Vector3<double> target = point(mesh.positions(), random.index(mesh.vertex_count()));
        out = (target + 0.1 * radius * random.vector()).normalized();
        along = cross<double>(out, random.unit_vector()).normalized();
        const double shape = random.number();
        tool_radius = shape < 0.2 ? 0 : random.number(0.3e-3, 3e-3);
        if (shape > 0.7) axis = random.number(2e-3, 20e-3) * (random.number() * out + random.number(-1.0, 1.0) * along);
        depth = random.number(0.05e-3, 1.5e-3);
        slide = random.chance(0.5) ? 0 : random.number(0.0, 5e-3);
        ticks_to_leave = random.chance(0.4) ? 1 : 1 + random.index(40);
        grasps = random.chance(0.3);
        opens = 80 + random.index(70);
    }
    Tool<double> at(int tick) const {
        const double in = std::min(tick / 30.0, 1.0), go = std::clamp((tick - 60) / 40.0, 0.0, 1.0);
        const double leave = std::clamp((tick - 130) / static_cast<double>(ticks_to_leave), 0.0, 1.0);
        const double height = tool_radius + 0.1e-3 - (depth + 0.1e-3) * in + leave * (depth + 8e-3);
        return {.position = (radius + height) * out + go * slide * along,
                .axis = axis,
                .radius = tool_radius,
                .time = dt * tick,
                .grasping = grasps && tick > 40 && tick < opens};
    }

    Vector3<double> out, along, axis = Vector3<double>::Zero();
    double tool_radius, depth, slide;  // [m]
    int ticks_to_leave, opens;
    bool grasps;
};

/// By how much the tool overlaps the surface [m], where no corner of the nearest triangle is fixed.
template <class IsFixed>
double overlap(const TriangleMesh<double>& mesh, const Points<double>& x, const Tool<double>& tool, IsFixed is_fixed) {
    double nearest = std::numeric_limits<double>::infinity();
    bool is_free = false;
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const auto corners = mesh.triangles().col(f);
        for (int pair = 0; pair < feature_pairs(tool); ++pair) {
            const auto found = closest_points(triangle_at(x, corners), tool, pair);
            if (!found || norm(found->separation) >= nearest) continue;
            nearest = norm(found->separation);
            is_free = std::none_of(corners.begin(), corners.end(), is_fixed);
        }
    }
    return is_free ? tool.radius - nearest : 0;
}

/// One membrane under two tools, a load and a pin, each of which may be left out, and which leave or end.
struct Run {
    explicit Run(std::uint64_t seed)
        : random(seed),
          scene(random),
          options(random_options(random)),
          stroke(scene.mesh, random),
          second(scene.mesh, random),
          has_second(random.chance(0.3)),
          solver(scene.network, options) {
        const Index f = random.index(scene.mesh.triangle_count());
        for (std::size_t k = 0; k < 3; ++k) corners[k] = scene.mesh.triangles()(static_cast<Index>(k), f);
        weights = random.barycentric();
        if (random.chance(0.2)) force = 0.02 * random.vector();
        for (int i = random.chance(0.2) ? 3 : 0; i > 0; --i) pins.push_back(random.index(scene.mesh.vertex_count()));
        tolerance = options.force_tolerance > 0 ? options.force_tolerance : scene.network.force_tolerance();
    }

    void tick(int i) {
        const bool late = i >= 150;
        if (late) {
            force.setZero();
            pins.clear();
        }
        tool = stroke.at(i);
        contact = tracker.update(tree, x, tool);
        grasp = grasper.update(contact, x, tool);
        const auto tool_2 = second.at(i - 20);
        const auto contact_2 = has_second ? tracker_2.update(tree, x, tool_2) : Contact<double>::none();
        report = solver.step(x, dt, scene.network, scene.foundation, press(tool, contact, grasp), pull(tool, grasp),
                             press(tool_2, contact_2), load<double>(corners, weights, force), pin(pins));
        tree.refit(x, report.moved);
        for (const Index v : solver.queue().vertices()) has_taken_part[static_cast<std::size_t>(v)] = 1;
    }

    bool is_fixed(Index v) const { return scene.network.pinned(v) || std::ranges::count(pins, v) > 0; }

    /// Beyond a threshold of layers the membrane stands still by design.
    bool may_move(Index v) const {
        if (is_fixed(v)) return false;
        return options.layers == unlimited || options.adaptive_layers || has_taken_part[static_cast<std::size_t>(v)];
    }

    Vector3<double> internal_force(Index v) const {
        const Vector3<double> here = point(x, v);
        return scene.network.force_on(v, x).force + scene.foundation.force_on(v, here, here, dt).force;
    }

    Random random;
    Scene scene;
    SolverOptions<double> options;
    Stroke stroke, second;
    bool has_second;
    QuasiStaticSolver<double> solver;
    AabbTree<double> tree{scene.mesh};
    // A second fold that comes to the tool is known at once.
    ContactTracker<double> tracker{scene.mesh, {.full_query_interval = 1, .fine_triangles = 0}},
        tracker_2{scene.mesh, {.full_query_interval = 1, .fine_triangles = 0}};
    Grasper<double> grasper{scene.mesh};
    Points<double> x = scene.mesh.positions();
    std::vector<char> has_taken_part = std::vector<char>(static_cast<std::size_t>(scene.mesh.vertex_count()), 0);
    std::array<Index, 3> corners{};
    Vector3<double> weights, force = Vector3<double>::Zero();
    std::vector<Index> pins;
    double tolerance;  // [N]
    Tool<double> tool;
    Contact<double> contact;
    Grasp<double> grasp;
    StepReport<double> report;
};

void check_converged(const Run& run) {
    const double rounding = 1e-13, limit = run.tolerance * (1 + 1e-9) + rounding;  // [N]
    const auto& queue = run.solver.queue();
    const auto layer_0 = queue.layer_count() > 0 ? queue.layer(0) : std::span<const Index>();
    Vector3<double> sum = -run.report.total_reaction();
    for (Index v = 0; v < run.x.cols(); ++v) {
        if (std::ranges::count(layer_0, v) > 0) {
            sum += run.internal_force(v);
        } else if (run.may_move(v)) {
            CAPTURE(v);
            REQUIRE(norm(run.internal_force(v)) <= limit);
        }
    }
    // What the membrane pulls with at layer 0 is what those who act feel, but for what they do to fixed vertices.
    const bool all_free = run.pins.empty() && border(run.scene.mesh).empty();
    if (all_free) REQUIRE(norm(sum) <= static_cast<double>(layer_0.size()) * limit);
    if (run.contact.touching() && !run.grasp.holding()) {
        const double slack =
            run.tolerance / run.scene.foundation_stiffness + 1e-9;  // what the force does to a vertex [m]
        REQUIRE(overlap(run.scene.mesh, run.x, run.tool, [&](Index v) { return run.is_fixed(v); }) <= slack);
    }
}

}  // namespace

TEST_CASE("converged: no vertex that may move is out of balance, no tool inside", "[solver][converged]") {
    long said = 0;
    const int runs = cases(80, 20'000);
    for (int seed = 1; seed <= runs; ++seed) {
        CAPTURE(seed);
        Run run(static_cast<std::uint64_t>(seed));
        for (int i = 0; i < 300; ++i) {
            CAPTURE(i);
            run.tick(i);
            REQUIRE(run.report.status == StepStatus::advanced);
            if (!run.report.converged) continue;
            ++said;
            check_converged(run);
        }
    }
    CHECK(said > 100L * runs);
}

namespace {

/// What a press of `Scalar` comes to at rest: its force, whether it has converged, and how far the membrane is from its
/// rest shape once the tool is gone.
struct PressAndRelease {
    double force = 0, left = 0;  // [N], [m]
    bool converged_pressed = false, converged_released = false;
};

template <Real S>
PressAndRelease press_and_release(const TriangleMesh<double>& shape, const Vector3<double>& offset, double support,
                                  double damping, bool pins, const SolverOptions<S>& options, double depth) {
    const double top = shape.positions().row(2).maxCoeff(), tool_radius = 2e-3;
    const TriangleMesh<S> mesh((shape.positions().colwise() + offset.eigen()).template cast<S>(), shape.triangles());
    const MassSpringNetwork network(mesh, LinearSpring{},
                                    {.stiffness = S(40), .pinned = pins ? border(mesh) : std::vector<Index>{}});
    const VirtualVolumeSprings<S> foundation(mesh, {.stiffness = S(support), .damping = S(damping)});
    QuasiStaticSolver<S> solver(network, options);
    AabbTree<S> tree(mesh);
    ContactTracker<S> tracker(mesh);
    Points<S> x = mesh.positions();
    PressAndRelease result;
    const auto hold = [&](double from, double to) {
        StepReport<S> report;
        for (int tick = 0; tick <= 500 && !(tick > 100 && report.converged); ++tick) {
            const double part = std::min(1.0, tick / 100.0), height = top + tool_radius + (1 - part) * from + part * to;
            const Vector3<double> at = offset + Vector3<double>(0.4e-3, 0.3e-3, height);
            const Tool<S> tool{.position = at.template cast<S>(), .radius = S(tool_radius)};
            const auto contact = tracker.update(tree, x, tool);
            report = solver.step(x, S(1e-3), network, foundation, press(tool, contact));
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
        }
        result.force = static_cast<double>(norm(report.total_reaction()));
        return report.converged;
    };
    result.converged_pressed = hold(1e-4, -depth);
    const double force = result.force;
    result.converged_released = hold(-depth, 0.02);
    result.force = force;
    result.left = static_cast<double>((x - mesh.positions()).colwise().norm().maxCoeff());
    return result;
}

}  // namespace

// The default tolerance, 0.8 uN, is a few times what rounding allows: half a spacing of numbers in each coordinate, 0.8
// nm, times 268 N/m.
TEST_CASE("in float a press of README's scene is that in double to a thousandth, and leaves no dent",
          "[solver][converged]") {
    const auto mesh = icosphere({.radius = radius, .subdivisions = 3});
    for (const double depth : {0.5e-3, 1e-3, 2e-3}) {
        CAPTURE(depth);
        const auto all = press_and_release<double>(mesh, {0, 0, 0}, 8, 0.02, false, {}, depth);
        const auto less = press_and_release<float>(mesh, {0, 0, 0}, 8, 0.02, false, {}, depth);
        CHECK(less.converged_pressed);
        CHECK(less.converged_released);
        CHECK(std::abs(less.force - all.force) <= 2e-4 * all.force);
        CHECK(less.left <= 1.5e-7);
    }
}

TEST_CASE("in float a press comes to rest on every support, and away from the origin", "[solver][converged]") {
    for (int seed = 1; seed <= cases(40, 1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const std::array meshes{spherical_cap({.radius = radius, .diameter = 1.6 * radius, .rings = 8}),
                                icosphere({.radius = radius, .subdivisions = 2}),
                                sheet<double>({.width = 0.02, .height = 0.02, .columns = 16, .rows = 16})};
        const double support = std::pow(10.0, random.number(0.5, 2.0));                    // 3 to 100 N/m
        const double damping = random.chance(0.5) ? 0 : 0.03 * random.number() * support;  // up to 30 ms
        const Vector3<double> offset = std::pow(10.0, random.number(-3.0, 0.0)) * random.unit_vector();
        const SolverOptions<float> options{.layers = random.chance(0.5) ? Index(6) : unlimited,
                                           .sweeps = 1 << random.index(4)};
        const auto result = press_and_release<float>(meshes[static_cast<std::size_t>(random.index(3))], offset, support,
                                                     damping, random.chance(0.5), options, random.number(0.2e-3, 1e-3));
        CHECK(result.converged_pressed);
        CHECK(result.converged_released);
    }
}
