// SPDX-License-Identifier: MIT
//
// same_loop NAME: the loops and calls of loops.py in C++, and what they compute with all digits, for the tests to
// compare.
// same_loop time TICKS: the nanoseconds of each tick of the first loop, for overhead.py.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/accuracy/trial.hpp>
#include <membrane/calibration/fit.hpp>
#include <membrane/calibration/indentation.hpp>
#include <membrane/certify/error_bound.hpp>
#include <membrane/coarse/coarse_correction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/membrane.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/replay/simulated_hand.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>

namespace {

using membrane::Index;
using Vector = membrane::Vector3<double>;

constexpr double dt = 1e-3;  // [s]

void print(const Vector& vector) { std::printf("%.17g %.17g %.17g\n", vector.x(), vector.y(), vector.z()); }

template <class Points>
void print_points(const Points& x) {
    for (Eigen::Index v = 0; v < x.cols(); ++v) print(membrane::point(x, static_cast<Index>(v)));
}

/// A sphere is pressed, grasped and pulled, with a load and two pinned vertices; vertices carry the contact.
void sphere() {
    const auto mesh = membrane::icosphere<double>({.radius = 10e-3, .subdivisions = 3});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh, {.fine_triangles = 0.5});
    auto grasper = membrane::Grasper(mesh);
    auto normals = membrane::VertexNormals(mesh);
    const auto feel = membrane::SpringDamperForce{.stiffness = 100, .damping = 0.5};
    auto device = membrane::ScriptedDevice<double>({{0.0, {0, 0, 13e-3}},
                                                    {0.1, {0, 0, 11e-3}},
                                                    {0.2, {1e-3, 0, 11e-3}, true},
                                                    {0.3, {1e-3, 1e-3, 14e-3}, true},
                                                    {0.4, {0, 0, 16e-3}}},
                                                   {.radius = 2e-3});
    const Index pins[] = {100, 200};
    auto x = mesh.positions();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp),
                        membrane::load({0, 42, 44}, Vector(0.5, 0.25, 0.25), Vector(0, 1e-3, 0)), membrane::pin(pins));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report, grasp}));
        print(device.force());
        for (const auto& reaction : report.reactions) print(reaction);
    }
    print_points(x);
    print_points(normals.values());
}

/// A cornea on a layer, its rim pinned, by the other rule, with a limited force.
void cap() {
    const auto mesh = membrane::spherical_cap<double>();
    const auto material = membrane::materials::cornea().typical;
    const membrane::FoundationLayer layer{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    const auto network = membrane::MassSpringNetwork(
        mesh, membrane::TensionSpring{},
        {.stiffness = membrane::spring_stiffnesses(mesh, material), .pinned = membrane::border(mesh)});
    const auto foundation =
        membrane::FoundationSprings(mesh, {.normal = membrane::normal_stiffnesses(mesh, layer),
                                           .tangential = membrane::tangential_stiffnesses(mesh, layer),
                                           .recovery_time = 0.05});
    auto solver = membrane::QuasiStaticSolver(
        network, {.layers = 4, .sweeps = 3, .order = membrane::UpdateOrder::breadth_first}, membrane::SafeStep{});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto limit = membrane::ForceLimiter(membrane::devices::touch);
    const auto feel = membrane::ReactionForce{.scale = 20};
    auto device = membrane::ScriptedDevice<double>({{0.0, {0, 0, 10e-3}}, {0.3, {1e-3, 0, 8.2e-3}}}, {.radius = 1e-3});
    auto x = mesh.positions();
    for (unsigned tick = 0; device.running(); ++tick) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        device.write(limit(feel({tool, contact, report}), tool.time, tick));
        print(device.force());
    }
    print_points(x);
}

/// Meshes, an equilibrium, a fit.
void offline() {
    const auto half = membrane::distmesh(membrane::trimmed(membrane::Ball{.radius = 1}, membrane::HalfSpace{}),
                                         {.edge_length = 0.3, .iterations = 50});
    print_points(half.positions());
    const auto cube =
        membrane::distmesh([](const Vector& p) { return p.cwiseAbs().maxCoeff() - 0.5; },
                           {.edge_length = 0.3, .bounds = membrane::Bounds{{-1, -1, -1}, {1, 1, 1}}, .iterations = 20});
    print_points(cube.positions());

    const auto mesh = membrane::icosphere<double>({.subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::ExponentialSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0});
    const auto rest = membrane::equilibrium(mesh.positions(), mesh, network, foundation, {},
                                            membrane::pull(0, Vector(0, 6e-3, 9.2e-3)), membrane::pin({}));
    print_points(rest.x);
    for (const auto& reaction : rest.reactions) print(reaction);

    const auto build = [&](std::span<const double> c) {
        return std::pair(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = c[0]}),
                         membrane::VirtualVolumeSprings(mesh, {.stiffness = c[1]}));
    };
    const membrane::Tool<double> tip{.position = {0, 0, 0.015}, .radius = 1e-3};
    const membrane::Indentation model(mesh, tip, {0, 0, -1}, build);
    const std::vector<double> depths{2e-4, 5e-4, 1e-3, 2e-3};
    const auto found = membrane::fit({depths, model(std::vector<double>{40.0, 8.0}, depths)}, {30.0, 10.0}, model);
    for (const double constant : found.constants) std::printf("%.17g\n", constant);
}

/// A hand that yields presses a sphere, by the rule as published.
void published() {
    using Hand = membrane::SimulatedHand<double>;
    const auto mesh = membrane::icosphere<double>({.subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0, .mass = 2e-4});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 4}, membrane::MassStep{});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    const auto feel = membrane::ReactionForce{};
    auto device =
        membrane::ScriptedDevice<double, Hand>({{0.0, {0, 0, 13e-3}}, {0.2, {1e-3, 0, 9e-3}}}, {.radius = 2e-3},
                                               Hand({.mass = 0.1, .damping = 2, .stiffness = 300}));
    auto x = mesh.positions();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        device.write(feel({tool, contact, report}));
        print(device.force());
        print(tool.position);
        print(tool.velocity);
    }
    print_points(x);
}

/// A law of the user's.
struct Cubic {
    membrane::SpringResponse<double> operator()(const membrane::SpringState<double>& spring) const noexcept {
        const double k = spring.stiffness, e = spring.length - spring.rest_length;
        return {.tension = k * (e + 1e5 * (e * e * e)),
                .stiffness = k * (1 + 3e5 * (e * e)),
                .energy = k * (e * e / 2 + 1e5 * (e * e * e * e) / 4)};
    }
};

/// Steps under a tool and their equilibrium, of springs by a law of the user's.
void law() {
    const auto mesh = membrane::icosphere<double>({.subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, Cubic{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 8});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    const membrane::Tool<double> tool{.position = {0, 0, 11e-3}, .radius = 2e-3};
    auto x = mesh.positions();
    for (int tick = 0; tick < 20; ++tick) {
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        print(report.reactions[0]);
    }
    print_points(x);
    const auto contact = tracker.update(tree, x, tool);
    const auto rest = membrane::equilibrium(x, mesh, network, foundation, {}, press(tool, contact));
    print_points(rest.x);
    print(rest.reactions[0]);
}

template <class Rule>
void print_trial(const auto& mesh, const auto& network, const auto& foundation, const auto& trajectory,
                 const auto& references, const Rule& rule) {
    for (const membrane::Index layers : {0, 8}) {
        const auto result = membrane::run_trial(mesh, network, foundation, trajectory, references,
                                                {.layers = layers, .sweeps = 4}, rule);
        std::printf("%.17g %.17g %d\n", result.force_error, result.position_error, result.layers_reached);
    }
}

/// Trials of each rule, and the error bounds of a state in contact and of one that is pulled.
void accuracy() {
    const auto mesh = membrane::icosphere<double>({.subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0, .mass = 2e-4});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0});
    std::vector<membrane::Tool<double>> tools;
    for (int tick = 0; tick < 40; ++tick)
        tools.push_back({.position = {0, 0, 12e-3 - 2e-5 * tick}, .radius = 2e-3, .time = 1e-3 * tick});
    const membrane::ToolTrajectory trajectory(mesh, tools, dt);
    const auto references = membrane::equilibria(mesh, network, foundation, trajectory, 10);
    for (const auto& reference : references) print_points(reference.x);
    print_trial(mesh, network, foundation, trajectory, references, membrane::BlockStep{});
    print_trial(mesh, network, foundation, trajectory, references, membrane::SafeStep{});
    print_trial(mesh, network, foundation, trajectory, references, membrane::MassStep{});

    const auto show = [](const membrane::ErrorReport& error) {
        std::printf("%.17g %.17g %.17g\n", error.position, error.convexity, error.reactions[0].radius);
        const auto& centre = error.reactions[0].centre;
        std::printf("%.17g %.17g %.17g\n", centre.x(), centre.y(), centre.z());
    };
    membrane::ErrorBound bound(network);
    const auto contact =
        membrane::ContactTracker(mesh).update(membrane::AabbTree(mesh), mesh.positions(), tools.back());
    const auto pressing = press(tools.back(), contact);
    const auto rest = membrane::equilibrium(mesh.positions(), mesh, network, foundation, {}, pressing);
    show(bound.compute(rest, references.back().x, mesh, network, foundation, pressing));
    const auto pulled = membrane::pull(0, Vector(1.001 * membrane::point(mesh.positions(), 0)));
    show(bound.compute(mesh.positions(), network, foundation, pulled));
}

/// Forceps that slip peel a sheet off the plane that it adheres to.
void peel() {
    const auto mesh = membrane::sheet<double>({.width = 4e-3, .height = 0.48e-3, .columns = 25, .rows = 3});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 2.5});
    std::vector<double> strengths;
    for (const double x : mesh.positions().row(0)) strengths.push_back(x < -1.5e-3 ? 0 : 100);
    auto adhesion = membrane::CohesiveSprings(
        mesh, {.stiffness = 2e6, .strength = strengths, .energy = 0.05, .tangential_strength = 150});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 8});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto grasper = membrane::Grasper(mesh, {.snap_to_vertex = true, .holding_force = 17e-6, .jaw_length = 0.3e-3});
    auto device = membrane::ScriptedDevice<double>(
        {{0.0, {-1.9e-3, 0, 3e-4}}, {0.1, {-1.84e-3, 0, 1.5e-4}, true}, {0.8, {0.5e-3, 0, 2e-3}, true}},
        {.radius = 1.6e-4});
    auto x = mesh.positions();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, dt, network, adhesion, pull(tool, grasp));
        adhesion.update(x, report.moved);
        const bool slipped = grasper.slip(x, tool, report.reactions[0]);
        tree.refit(x, report.moved);
        device.write(report.total_reaction());
        print(report.reactions[0]);
        std::printf("%d %d %.17g\n", slipped, grasp.holding(), adhesion.dissipated());
    }
    print_points(x);
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        std::printf("%d %.17g %.17g\n", adhesion.adheres(v), adhesion.damage(v),
                    adhesion.energy(v, membrane::point(x, v)));
    }
    std::printf("%.17g\n", network.energy(x));
}

/// A tool drags a sphere by friction.
void friction() {
    const auto mesh = membrane::icosphere<double>({.subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto friction = membrane::ToolFriction<double>({.coefficient = 0.4});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto device = membrane::ScriptedDevice<double>(
        {{0.0, {0, 0, 13e-3}}, {0.1, {0, 0, 11e-3}}, {0.3, {2e-3, 0, 11e-3}}}, {.radius = 2e-3});
    auto x = mesh.positions();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, friction.press(tool, contact));
        tree.refit(x, report.moved);
        device.write(report.total_reaction());
        print(report.reactions[0]);
        std::printf("%d\n", friction.slips());
    }
    print_points(x);
    for (const auto& v : friction.vertices()) {
        print(v.offset);
        print(v.force);
        print(v.normal_force);
        std::printf("%d\n", v.vertex);
    }
}

/// A stretched disc is pressed, held and torn; the springs and `criterion` are as given.
template <class Springs>
void tear_disc(const membrane::TriangleMesh<double>& mesh, Springs springs, const auto& criterion) {
    auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 1e-3});
    auto solver = membrane::QuasiStaticSolver(springs, {.layers = 12, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto grasper = membrane::Grasper(mesh);
    auto normals = membrane::VertexNormals(mesh);
    auto tear = membrane::Tearing(mesh, criterion);
    membrane::Points<double> x = 1.3 * mesh.positions();
    const auto follow_all = [&](const auto& events) {
        for (const auto& event : events) {
            follow(event, springs, foundation, solver, tree, tracker, grasper, normals);
            std::printf("%d %d %d\n", event.moved.vertex, event.split.vertex, event.split.copy);
        }
    };
    tree.refit(x);
    std::vector<membrane::Index> path{tear.surface().nearest_in_direction(tear.slit_at(0, {1, 0, 0})[0], {-1, 0, 0})};
    while (path.size() < 5) path.push_back(tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
    follow_all(tear.cut_along(path, x));
    for (int tick = 0; tick < 200; ++tick) {
        const double height = 0.5e-3 + 2e-6 * tick;
        const membrane::Tool<double> tool{
            .position = {0, 3e-3, height}, .radius = 0.6e-3, .time = dt * tick, .grasping = tick > 20};
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, dt, springs, foundation, press(tool, contact, grasp), pull(tool, grasp), tear.ligaments());
        follow_all(tear.update(x, dt, springs, foundation));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        for (const auto& reaction : report.reactions) print(reaction);
        std::printf("%.17g %.17g %.17g\n", tear.torn_length(), tear.dissipated(), tear.stored(x));
        for (const auto& tip : tear.tips()) print(tip.driving_force);
    }
    print_points(x);
    print_points(tear.surface().rest_positions());
    print_points(normals.values());
    for (const auto& f : tear.surface().triangles().colwise()) std::printf("%d %d %d\n", f[0], f[1], f[2]);
}

/// Tears by each criterion, of springs and of a tissue, linear and not.
void tear() {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 5e-3, .rings = 8}), 100);
    const auto rim = membrane::border(mesh);
    const auto linear = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 20.0, .pinned = rim});
    const auto taut = membrane::MassSpringNetwork(mesh, membrane::TensionSpring{}, {.stiffness = 20.0, .pinned = rim});
    const membrane::EnergyRelease energy{.toughness = 1.4e3, .thickness = 8e-6};
    tear_disc(mesh, membrane::Tissue(membrane::TearableSprings(mesh, linear)), energy);
    tear_disc(mesh, membrane::TearableSprings(mesh, linear), energy);
    tear_disc(mesh, membrane::Tissue(membrane::TearableSprings(mesh, taut)), energy);
    tear_disc(mesh, membrane::TearableSprings(mesh, taut), membrane::LargestTension{.strength = 15});
}

/// A ball is pressed into a stretched disc that its rim holds, corrected after each step; then it tears.
void coarse() {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 5e-3, .rings = 8}), 60);
    auto tissue = membrane::Tissue(membrane::TearableSprings(
        mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                          {.stiffness = 20.0, .pinned = membrane::border(mesh)})));
    const membrane::NoFoundation foundation;
    membrane::CoarseCorrection coarse(mesh, tissue, foundation, {.points = 40, .tolerance = 0.02});
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 3, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 200, .thickness = 1e-5});
    auto x = mesh.positions();
    for (int tick = 0; tick < 100; ++tick) {
        if (tick == 50) {
            for (const auto& event : tear.cut_along(tear.slit_at(0, {1, 0, 0}), x))
                follow(event, tissue, solver, tree, tracker, coarse);
        }
        const membrane::Tool<double> tool{.position = {1e-3, 0, 1e-3 - 4e-6 * tick}, .radius = 1e-3};
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, tissue, foundation, press(tool, contact), tear.ligaments());
        print(coarse.reaction_error(x, solver));
        const auto corrected = coarse.correct(x, solver);
        solver.wake(corrected.unbalanced);
        tree.refit(x);
        print(report.reactions[0]);
        print(corrected.reaction_error);
        std::printf("%d %.17g %zu\n", corrected.corrected, corrected.step_length, corrected.unbalanced.size());
        for (const membrane::Index v : corrected.unbalanced) std::printf("%d\n", v);
    }
    print_points(x);
}

/// A stretched strip tears from a flaw of its border, and where a tool perforates it that drags it by friction.
void start() {
    const auto whole = membrane::sheet<double>({.width = 8e-3, .height = 4e-3, .columns = 16, .rows = 8});
    std::vector<membrane::Index> clamps;
    Index middle = 0;  // of a side
    for (Index v = 0; v < whole.vertex_count(); ++v) {
        const auto at = membrane::point(whole.positions(), v);
        if (std::abs(at.x()) > 3.9e-3) clamps.push_back(v);
        if (std::abs(at.x()) < 1e-6 && at.y() < -1.9e-3) middle = v;
    }
    const auto mesh = membrane::with_reserve(whole, 60);
    auto tissue = membrane::Tissue(membrane::TearableSprings(
        mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 20.0, .pinned = clamps})));
    auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 1e-3});
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 12, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto friction = membrane::ToolFriction<double>({.coefficient = 0.4});
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 200, .thickness = 1e-5});
    auto x = mesh.positions();
    x.row(0) *= 1.3;
    tree.refit(x);
    const auto follow_all = [&](const auto& events) {
        for (const auto& event : events) follow(event, tissue, foundation, solver, tree, tracker, friction);
        std::printf("%zu\n", events.size());
    };
    for (const Index v : membrane::border(whole)) {
        const auto state = membrane::border_state<double>(tear.surface(), v, x, tissue);
        print(state.along);
        print(state.inward);
        print({state.stretch, state.tension, state.energy});
        std::printf("%.17g\n", membrane::flaw_driving_force(state, 0.3e-3));
    }
    bool perforated = false;
    for (int tick = 0; tick < 80; ++tick) {
        const membrane::Tool<double> tool{
            .position = {2e-3 + 2e-6 * tick, 0, 0.6e-3 - 8e-6 * tick}, .radius = 0.6e-3, .time = dt * tick};
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, tissue, foundation, friction.press(tool, contact), tear.ligaments());
        const auto slit = tear.slit_under(contact, report.reactions[0], 2e-3, {0, 1, 0});
        if (!perforated && slit[0] != membrane::no_index) {
            perforated = true;
            follow_all(tear.cut_along(slit, x));
            for (const double flaw : {1e-9, 0.3e-3}) {
                const auto path = tear.start_at(middle, flaw, x, tissue);
                std::printf("%zu\n", path.size());
                for (const Index v : path) std::printf("%d\n", v);
                follow_all(tear.cut_along(path, x));
            }
        }
        follow_all(tear.update(x, dt, tissue, foundation));
        tree.refit(x, report.moved);
        print(report.reactions[0]);
        std::printf("%d %d %d %zu\n", slit[0], slit[1], slit[2], friction.vertices().size());
        for (const auto& v : friction.vertices()) print(v.force);
        for (const auto& tip : tear.tips()) std::printf("%.17g\n", tip.advanced);
    }
    print_points(x);
}

/// The loop of the README for `ticks` ticks: a tool goes in and out.
void time_ticks(int ticks) {
    const auto mesh = membrane::icosphere<double>({.radius = 10e-3, .subdivisions = 3});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    const auto feel = membrane::ReactionForce{};
    auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    std::vector<membrane::Waypoint<double>> script;
    for (int i = 0; i <= ticks / 200; ++i) script.push_back({0.2 * i, {0, 0, i % 2 == 0 ? 11.9e-3 : 10.5e-3}});
    auto device = membrane::ScriptedDevice<double>(script, {.radius = 2e-3});
    std::vector<double> times;
    times.reserve(static_cast<std::size_t>(ticks));
    auto x = mesh.positions();
    for (int tick = 0; tick < ticks; ++tick) {
        const auto start = std::chrono::steady_clock::now();
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        device.write(feel({tool, contact, report}));
        times.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count());
    }
    for (const double time : times) std::printf("%.0f\n", time);
}

}  // namespace

int main(int argc, char** argv) {
    const std::string_view name = argc > 1 ? argv[1] : "";
    const std::pair<std::string_view, void (*)()> scenes[] = {
        {"sphere", sphere}, {"cap", cap},           {"offline", offline}, {"published", published},
        {"law", law},       {"accuracy", accuracy}, {"peel", peel},       {"friction", friction},
        {"tear", tear},     {"start", start},       {"coarse", coarse}};
    for (const auto& [scene, run] : scenes) {
        if (name == scene) return run(), 0;
    }
    if (name != "time" || argc < 3) return 2;
    time_ticks(std::atoi(argv[2]));
}
