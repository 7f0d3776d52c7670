// SPDX-License-Identifier: MIT
//
// What README and chapters show beside the examples, as a user's program: nothing of the library's is known by its bare
// name.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <memory>
#include <span>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include <membrane/membrane.hpp>

// [threads]
#include <membrane/core/thread_pool.hpp>  // the stock pool; waking its threads is a system call
// [/threads]

// [hand]
#include <membrane/certify/passivity.hpp>
#include <membrane/haptics/force_limits.hpp>
// [/hand]

// [smooth]
#include <membrane/haptics/smooth_contact.hpp>
// [/smooth]

// [rest]
#include <membrane/haptics/rest_contact.hpp>
// [/rest]

// [policies]
#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/grasp_transition.hpp>
// [/policies]

// [coupling]
#include <membrane/haptics/virtual_coupling.hpp>
// [/coupling]

// [moving]
#include <membrane/model/moving_foundation.hpp>
// [/moving]

// [handover]
#include <membrane/haptics/handover.hpp>
// [/handover]

// [recording]
#include <membrane/replay/recording_file.hpp>
// [/recording]

// [tear_reset]
#include <membrane/replay/initial_state.hpp>
// [/tear_reset]

// [snapshot]
#include <membrane/replay/snapshot.hpp>
// [/snapshot]

// [facets]
#include <membrane/contact/facet_correction.hpp>
// [/facets]

// [distmesh]
#include <membrane/meshing/distmesh.hpp>
// [/distmesh]

// [graded]
#include <membrane/meshing/graded_edge_length.hpp>
// [/graded]

// [validate]
#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>
// [/validate]

// [constants]
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/recommended_layers.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
// [/constants]

// [adhesion]
#include <membrane/tear/cohesive_springs.hpp>
// [/adhesion]

// [friction]
#include <membrane/solve/tool_friction.hpp>
// [/friction]

// [tear]
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/tissue.hpp>
// [/tear]

// [coarse]
#include <membrane/coarse/coarse_correction.hpp>
// [/coarse]

// [equilibrium]
#include <membrane/accuracy/equilibrium.hpp>
// [/equilibrium]

// [bound]
#include <membrane/certify/error_bound.hpp>
// [/bound]

// [mesh_error]
#include <membrane/accuracy/mesh_error.hpp>
// [/mesh_error]

// [settings]
#include <membrane/accuracy/choose_settings.hpp>
// [/settings]

// [fit]
#include <membrane/calibration/fit.hpp>
#include <membrane/calibration/indentation.hpp>
// [/fit]

#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

// [units]
#include "openhaptics/units.hpp"
// [/units]
#include "support/catch.hpp"

// A region declares what its page's loop declares, though the test's fixture has some of it.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

double now() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

struct AtRest {
    membrane::TriangleMesh<double> mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network{mesh, {}, {.stiffness = 40.0}};
    membrane::VirtualVolumeSprings<double> foundation{mesh, {.stiffness = 40.0}};
    const double dt = 1e-3;
};

/// A ball touches a little.
struct Touched : AtRest {
    membrane::QuasiStaticSolver<double> solver{network};
    membrane::AabbTree<double> tree{mesh};
    membrane::ContactTracker<double> tracker{mesh};
    membrane::Grasper<double> grasper{mesh};
    membrane::Points<double> x = mesh.positions();
    membrane::Tool<double> tool{.position = {0, 0, 0.0108}, .radius = 1e-3};
    membrane::Contact<double> contact = tracker.update(tree, x, tool);
    membrane::SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    std::uint64_t steps = 1;
};

/// What a sphere tool meets that goes down for some ticks.
std::vector<membrane::Tool<double>> stroke_of_ticks() {
    std::vector<membrane::Tool<double>> tools;
    for (int i = 0; i < 12; ++i) tools.push_back({.position = {0, 0, 0.0118 - i * 2e-5}, .radius = 2e-3});
    return tools;
}

/// Stands for the interface of a vendor, in its units.
struct Driver {
    double tick = 0;
    double force[3] = {};
    bool connected() const noexcept { return tick < 200; }
    std::array<double, 3> millimetres() const noexcept { return {0, 0, 12 - 0.02 * tick}; }
    std::array<double, 3> millimetres_per_second() const noexcept { return {0, 0, -20}; }
    double seconds() const noexcept { return 1e-3 * tick; }
    bool button() const noexcept { return false; }
    void send(const double* newtons) noexcept {
        std::copy_n(newtons, 3, force);
        ++tick;
    }
};

// [own_device]
/// The device of a driver that counts in millimetres.
class OwnDevice {
  public:
    explicit OwnDevice(Driver& driver) : driver_(driver) {}

    bool running() const noexcept { return driver_.connected(); }
    membrane::Tool<double> read() noexcept {
        return {.position = metres(driver_.millimetres()),
                .radius = 1e-3,
                .velocity = metres(driver_.millimetres_per_second()),
                .time = driver_.seconds(),
                .grasping = driver_.button()};
    }
    void write(const membrane::Vector3<double>& force) noexcept { driver_.send(force.data()); }

  private:
    static membrane::Vector3<double> metres(const std::array<double, 3>& mm) noexcept {
        return {1e-3 * mm[0], 1e-3 * mm[1], 1e-3 * mm[2]};
    }
    Driver& driver_;
};
static_assert(membrane::Device<OwnDevice, double>);
// [/own_device]

// [below]
/// A firm, smooth body below the plane z = 0, that holds nothing: a foundation of your own.
struct Below {
    double stiffness = 1;  // for each vertex [N/m]

    membrane::VertexForce<double> force_on(membrane::Index, const membrane::Vector3<double>& position,
                                           const membrane::Vector3<double>&, double) const noexcept {
        return {{0, 0, std::max(0.0, -stiffness * position.z())}, stiffness};
    }
};
static_assert(membrane::FoundationModel<Below, double>);
// [/below]

// [members]
struct Membrane {
    membrane::TriangleMesh<float> mesh;  // each part is made from those above it
    membrane::MassSpringNetwork<float> network{mesh, {}, {.stiffness = 40.0F}};                     // [N/m]
    membrane::VirtualVolumeSprings<float> foundation{mesh, {.stiffness = 8.0F, .damping = 0.02F}};  // [N/m], [N s/m]
    membrane::QuasiStaticSolver<float> solver{network, {.layers = 6, .sweeps = 2}};
    membrane::AabbTree<float> tree{mesh};
    membrane::ContactTracker<float> tracker{mesh};
    membrane::VertexNormals<float> normals{mesh};
    membrane::Points<float> x = mesh.positions();  // [m]

    membrane::Vector3<float> step(const membrane::Tool<float>& tool, float dt) {
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        return report.reactions[0];  // [N]
    }
};
// [/members]

}  // namespace

TEST_CASE("pages: members") {
    Membrane first{membrane::icosphere<float>({.radius = 0.01, .subdivisions = 2})};
    CHECK(first.step({.position = {0, 0, 0.0108F}, .radius = 1e-3F}, 1e-3F).z() > 0);
    auto second = std::make_unique<Membrane>(first);  // owns all that it uses
    auto third = std::move(*second);
    second.reset();
    const membrane::Tool<float> deeper{.position = {0, 0, 0.0106F}, .radius = 1e-3F};
    CHECK(first.step(deeper, 1e-3F) == third.step(deeper, 1e-3F));
    CHECK(first.x == third.x);
}

TEST_CASE_METHOD(Touched, "pages: device of one's own") {
    Driver driver;
    OwnDevice device(driver);
    const membrane::ReactionForce reaction;
    x = mesh.positions();
    tracker.reset();
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        device.write(reaction({tool, contact, report}));
    }
    CHECK(driver.force[2] > 0.01);
}

TEST_CASE_METHOD(Touched, "pages: facets") {
    Driver driver;
    OwnDevice device(driver);
    x = mesh.positions();
    tracker.reset();
    const membrane::ReactionForce force;
    // [faces]
    auto by_faces = membrane::ContactTracker(mesh, {.fine_triangles = 0});
    // [/faces]
    // [facets]
    const membrane::FacetCorrection<double> correction(mesh, {.tension = 0.5});  // [N/m]
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    while (device.running()) {
        const auto tool = device.read();
        auto pressed = tool;
        pressed.position += offset;
        const auto contact = by_faces.update(tree, x, pressed);
        const auto report = solver.step(x, dt, network, foundation, press(pressed, contact));
        tree.refit(x, report.moved);
        offset += (correction(x, contact, report.reactions[0]) - offset) / 2;
        device.write(force({tool, contact, report}));
    }
    // [/facets]
    CHECK(offset.norm() > 0);
    CHECK(driver.force[2] > 0.01);
}

TEST_CASE_METHOD(AtRest, "pages: time steps of other lengths, and late ticks") {
    const membrane::VirtualVolumeSprings<double> damped(mesh, {.stiffness = 40.0, .damping = 0.4});
    const auto after = [&](const auto& foundation, double dt, int ticks) {
        auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 2});
        const membrane::AabbTree<double> tree(mesh);
        membrane::ContactTracker<double> tracker(mesh);
        auto x = mesh.positions();
        const membrane::Tool<double> tool{.position = {0, 0, 0.0105}, .radius = 1e-3};
        for (int i = 0; i < ticks; ++i) {
            const auto contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
            REQUIRE(report.status == membrane::StepStatus::advanced);
        }
        return x;
    };
    CHECK(after(foundation, 1e-3, 5) == after(foundation, 16e-3, 5));  // nothing is damped
    CHECK(after(damped, 1e-3, 5) != after(damped, 16e-3, 5));
    const auto still = after(damped, 1e-3, 3000), coarse = after(damped, 16e-3, 3000), once = after(damped, 60.0, 3000);
    CHECK((still - coarse).cwiseAbs().maxCoeff() < 1e-9);  // the same equilibrium [m]
    CHECK((still - once).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE_METHOD(Touched, "pages: a long frame in parts") {
    const auto exact = [&](const membrane::Vector3<double>& position) {
        membrane::QuasiStaticSolver<double> solver(network, {.layers = membrane::unlimited, .sweeps = 50});
        auto x = mesh.positions();
        const membrane::Tool<double> there{.position = position, .radius = 1e-3};
        membrane::ContactTracker<double> tracker(mesh);
        membrane::AabbTree<double> tree(mesh);
        double force = 0;
        for (int i = 0; i < 20; ++i) {
            const auto contact = tracker.update(tree, x, there);
            const auto report = solver.step(x, dt, network, foundation, press(there, contact));
            tree.refit(x, report.moved);
            force = report.total_reaction().norm();
        }
        return force;
    };
    x = mesh.positions();
    tracker.reset();
    membrane::Vector3<double> before(0, 0, 0.0115), now = before;
    for (const double height : {0.0109, 0.0103, 0.0096, 0.0104}) {  // the last two frames are far apart
        now.z() = height;
        const double frame = height == 0.0104 ? 0.25 : 1.0 / 60;
        double force = 0;
        // [substeps]
        const int steps = static_cast<int>(std::ceil(frame / 2e-3));  // of a frame [s] in which the tool moves to `now`
        for (int i = 1; i <= steps; ++i) {
            tool.position = before + (now - before) * i / steps;
            const auto contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, frame / steps, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
            force = report.reactions[0].norm();
        }
        // [/substeps]
        CHECK(force == Approx(exact(now)).epsilon(0.02));
        before = now;
    }
}

TEST_CASE_METHOD(Touched, "pages: a tool that starts inside") {
    x = mesh.positions();
    tracker.reset();
    tool.position = {0, 0, 0.008};
    membrane::ForceLimiter limit(membrane::devices::touch);
    const membrane::ReactionForce reaction;
    double first = 0, last = 0;
    bool clear = false;
    membrane::ScriptedDevice<double> device({{.time = 0}}, {.tick = 1e-3});
    for (int i = 0; i < 500; ++i) {
        if (i >= 400) tool.position.z() += 1e-4;  // out
        tool.time = i * dt;
        const auto contact = tracker.update(tree, x, tool);
        if (i < 400) REQUIRE(contact.touching());
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        REQUIRE(report.status == membrane::StepStatus::advanced);
        tree.refit(x, report.moved);
        const auto force = reaction({tool, contact, report});
        // [clear]
        clear = clear || !contact.touching();  // false at the start
        device.write(clear ? force : membrane::Vector3<double>::Zero());
        // [/clear]
        REQUIRE(device.force().isZero(0));
        if (i >= 400) continue;
        last = limit(force, tool.time, ++steps).norm();
        if (i == 0) first = last;
        if (i < 399) continue;
        CHECK(std::sqrt(tree.closest_point(x, tool.position).squared_distance) > 0.99 * tool.radius);
        CHECK(x.row(2).maxCoeff() < 0.0101);
    }
    CHECK(clear);
    CHECK(first < 0.05 * last);  // the force grows from zero
}

TEST_CASE_METHOD(Touched, "pages: several membranes") {
    const membrane::Points<double> lower = mesh.positions().colwise() - Eigen::Vector3d(0, 0, 0.0005);
    const membrane::TriangleMesh<double> other_mesh(lower, mesh.triangles());
    const membrane::MassSpringNetwork<double, membrane::LinearSpring> other_network(other_mesh, {},
                                                                                    {.stiffness = 40.0});
    const membrane::VirtualVolumeSprings<double> other_foundation(other_mesh, {.stiffness = 40.0});
    membrane::QuasiStaticSolver<double> other_solver(other_network);
    membrane::AabbTree<double> other_tree(other_mesh);
    membrane::ContactTracker<double> other_tracker(other_mesh);
    membrane::Points<double> other_x = other_mesh.positions();
    tool.position = {0, 0, 0.0100};
    // [several]
    const auto contact = tracker.update(tree, x, tool);
    const auto other_contact = other_tracker.update(other_tree, other_x, tool);
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    const auto other_report =
        other_solver.step(other_x, dt, other_network, other_foundation, press(tool, other_contact));
    const auto force = report.total_reaction() + other_report.total_reaction();  // on the tool [N]
    // [/several]
    CHECK(report.total_reaction().z() > 0);
    CHECK(other_report.total_reaction().z() > 0);
    CHECK(force.z() > report.total_reaction().z());
}

TEST_CASE_METHOD(AtRest, "pages: moving body") {
    membrane::QuasiStaticSolver<double> solver(network);
    membrane::AabbTree<double> tree(mesh);
    membrane::ContactTracker<double> tracker(mesh);
    membrane::Grasper<double> grasper(mesh);
    const membrane::SmoothContact smooth(mesh);
    const membrane::SpringDamperForce feel{.stiffness = 100, .damping = 0.5};
    const membrane::Tool<double> tool{.position = {0, 0, 0.0108}, .radius = 1e-3};
    const membrane::Points<double> anchors = 1.001 * mesh.positions();
    membrane::Points<double> x = mesh.positions();
    // [moving]
    auto body = membrane::MovingBody(mesh);     // and const auto smooth = membrane::SmoothContact(mesh);
    if (!body.move_to(anchors, dt, x)) return;  // each tick: 3 x V [m]; a rigid motion: body.move_to(pose, x)
    tree.refit(x);
    const auto contact = tracker.update(tree, x, tool, body);
    const auto grasp = grasper.update(contact, x, tool, body);
    const auto report =
        solver.step(x, dt, network, on(body, foundation), press(tool, contact, grasp), pull(tool, grasp));
    const auto force = feel({tool, smooth(contact, body), report, grasp});
    // [/moving]
    CHECK(contact.touching());
    CHECK(report.status == membrane::StepStatus::advanced);
    CHECK(force.z() > 0);
}

TEST_CASE_METHOD(Touched, "pages: constraints") {
    tool.grasping = true;
    const auto& triangles = mesh.triangles();
    const std::array<membrane::Index, 3> corners{triangles(0, 9), triangles(1, 9), triangles(2, 9)};
    const Eigen::Vector3d barycentric(0.2, 0.3, 0.5), force(0, 0, 0.01);
    const std::vector<membrane::Index> vertices{100, 101};
    // [constraints]
    const auto grasp = grasper.update(contact, x, tool);  // forceps: membrane::Grasper(mesh)
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp),
                                    membrane::load(corners, barycentric, force), membrane::pin(vertices));
    // [/constraints]
    CHECK(grasp.holding());
    CHECK(report.status == membrane::StepStatus::advanced);
    CHECK(report.reactions.size() == 4);
    CHECK((report.reactions[2] + force).norm() < 1e-15);
}

TEST_CASE_METHOD(Touched, "pages: forces in balance") {
    const std::vector<membrane::Index> rim{30, 31, 32};
    const membrane::Index layers = GENERATE(3, membrane::unlimited);
    solver = membrane::QuasiStaticSolver(network, {.layers = layers, .sweeps = 16});
    tool.grasping = true;
    membrane::Tool<double> second{.position = {0.0108, 0, 0}, .radius = 1e-3};
    auto second_tracker = membrane::ContactTracker(mesh);
    membrane::Vector3<double> difference = membrane::Vector3<double>::Zero(), unsupported = difference;
    double force = 0;
    for (int i = 0; i < 200; ++i) {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto second_contact = second_tracker.update(tree, x, second);
        tool.position.z() += 2e-6;
        // [balance]
        const auto start = x;  // damping is for the motion since here; on a moving body after `move_to`
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp),
                                        press(second, second_contact), membrane::pin(rim));
        auto unbalanced = report.total_reaction();  // on tools and pins [N]
        for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
            const auto on_membrane = foundation.force_on(v, membrane::point(x, v), membrane::point(start, v), dt).force;
            unbalanced -= on_membrane;
        }
        // [/balance]
        tree.refit(x, report.moved);
        difference = unbalanced;
        unsupported = report.unsupported;
        force = report.reactions[1].norm();
    }
    CHECK(force > 1e-3);
    CHECK((unsupported.norm() > 0.01 * force) == (layers == 3));
    CHECK((difference + unsupported).norm() < 1e-3 * force);
}

TEST_CASE_METHOD(Touched, "pages: deadline") {
    // [deadline]
    const auto deadline = membrane::Deadline([] { return Clock::now(); }, Clock::now() + 300us);
    const auto report = solver.step_until(deadline, x, dt, network, foundation, press(tool, contact));
    // [/deadline]
    CHECK(report.status == membrane::StepStatus::advanced);
}

TEST_CASE_METHOD(AtRest, "pages: threads") {
    // [threads]
    const membrane::ThreadPool pool;
    auto solver =
        membrane::QuasiStaticSolver(network,
                                    {.layers = membrane::unlimited,
                                     .sweeps = 16,
                                     .order = membrane::UpdateOrder::colour_all,
                                     .max_packed_vertices = membrane::unlimited},  // for more than 32,768 vertices
                                    membrane::BlockStep{}, pool.executor());
    // [/threads]
    auto x = mesh.positions();
    const auto report = solver.step(x, dt, network, foundation, membrane::pull(7, 1.01 * x.col(7)));
    CHECK(report.status == membrane::StepStatus::advanced);
}

TEST_CASE_METHOD(Touched, "pages: hand") {
    membrane::ScriptedDevice<double> device({{.time = 0}}, {.tick = 1e-3});
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    // [hand]
    const auto profile = membrane::devices::touch;
    const auto loop = membrane::SampledLoop{.stiffness = 100,  // [N/m]
                                            .damping = 0.5,    // [N s/m]
                                            .tick = 1e-3,
                                            .negative_stiffness = 100,  // 1 mm deep, a tool of 2 mm radius
                                            .off_potential = 0.06};     // [N]: 1 mm deep, normals up to 35 degrees off
    membrane::require_passive(loop, profile, {.hand_damping = 2});
    auto limit = membrane::ForceLimiter(profile);  // each limit can be taken off
    device.write(limit(feel({tool, contact, report}), tool.time, steps));
    // [/hand]
    // [smooth]
    const auto smooth = membrane::SmoothContact(mesh);
    device.write(limit(feel({tool, smooth(contact), report}), tool.time, steps));
    // [/smooth]
    // [rest]
    const auto rest = membrane::RestContact(mesh);
    device.write(limit(feel({tool, rest(contact, tool), report}), tool.time, steps));
    // [/rest]
    CHECK(limit.active_limits().faded);  // it has only begun

    const auto force = device.force();
    std::stringstream file;
    // [recording]
    membrane::Recorder<double> recorder(60'000, mesh.vertex_count());              // capacity: a minute at 1 kHz
    recorder.add(tool, force);                                                     // each tick
    membrane::write_recording(file, recorder.recording());                         // afterwards; write_csv for a table
    membrane::ReplayDevice<double> again(membrane::read_recording<double>(file));  // in place of the device
    // [/recording]
    CHECK(again.read().position == tool.position);
}

TEST_CASE_METHOD(Touched, "pages: policies on top of another") {
    membrane::ScriptedDevice<double> device({{.time = 0}}, {.tick = 1e-3});
    auto limit = membrane::ForceLimiter(membrane::devices::touch);
    auto grasp = grasper.update(contact, x, tool);
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    const auto alone = feel({tool, contact, report});
    // [policies]
    auto rough = membrane::ContactFriction(feel, {.coefficient = 0.1, .stiffness = 100});  // [N/m], along the surface
    auto smooth = membrane::GraspTransition(rough, {.duration = 0.1});                     // [s], at grasp and release
    device.write(limit(smooth({tool, contact, report, grasp}), tool.time, steps));
    // [/policies]
    tool.position.x() += 1e-3;  // slides
    CHECK(norm<double>(smooth({tool, contact, report, grasp}) - alone) > 0.09 * norm(alone));
}

TEST_CASE_METHOD(Touched, "pages: a coupling between hand and tool") {
    membrane::ScriptedDevice<double> device({{0.0, {0, 0, 10.8e-3}}, {0.2, {0, 0, 10.2e-3}}}, {.radius = 1e-3});
    auto limit = membrane::ForceLimiter(membrane::devices::touch);
    // [coupling]
    const double scale = 20, tissue = 60;  // force at the hand over that of the tissue, whose stiffness is below 60 N/m
    auto coupling = membrane::VirtualCoupling<double>(
        {.stiffness = 300, .damping = membrane::min_damping(scale * tissue, 300, dt), .scale = scale});
    membrane::Vector3<double> reaction(0, 0, 0);
    while (device.running()) {
        const auto held = coupling.update(device.read(), reaction, dt);  // the tool in contact
        const auto contact = tracker.update(tree, x, held);
        const auto report = solver.step(x, dt, network, foundation, press(held, contact));
        tree.refit(x, report.moved);
        reaction = report.reactions[0];
        device.write(limit(coupling.force(), held.time, ++steps));
    }
    // [/coupling]
    // The spring from the tool to the hand has the force of the membrane, times the scale.
    CHECK(coupling.force().z() == Approx(scale * reaction.z()).epsilon(0.05));
    CHECK(coupling.force().z() > 0.1);
}

// The lines of the loop and those of the hand, together, as a user has them.
TEST_CASE_METHOD(AtRest, "pages: loop with limits and recorder replays to the bit, however late it runs") {
    const auto feel = membrane::SpringDamperForce{.stiffness = 400, .damping = 0.5};
    const auto smooth = membrane::SmoothContact(mesh);
    const auto play = [&](auto& device, membrane::Recorder<double>* recorder) {
        auto solver = membrane::QuasiStaticSolver(network, {.layers = 6, .sweeps = 2});
        auto tree = membrane::AabbTree(mesh);
        auto tracker = membrane::ContactTracker(mesh);
        auto limit = membrane::ForceLimiter(membrane::devices::touch);
        auto x = mesh.positions();
        std::uint64_t steps = 0;
        int limited = 0;
        while (device.running()) {
            if (recorder != nullptr && steps % 40 == 0) std::this_thread::sleep_for(2ms);
            const auto tool = device.read();
            const auto contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
            const auto force = limit(feel({tool, smooth(contact), report}), tool.time, ++steps);
            device.write(force);
            if (recorder != nullptr) recorder->add(tool, force);
            limited += limit.active_limits().any();
        }
        return limited;
    };
    membrane::ScriptedDevice<double> device({{0, {0, 0, 0.012}}, {0.03, {0, 0, 0.009}}, {0.3, {0, 2e-3, 0.009}}},
                                            {.radius = 1e-3});
    membrane::Recorder<double> recorder(1000, mesh.vertex_count());
    CHECK(play(device, &recorder) > 50);  // a soft start, at least
    std::stringstream file;
    membrane::write_recording(file, recorder.recording());
    membrane::ReplayDevice<double> again(membrane::read_recording<double>(file));
    CHECK(play(again, nullptr) > 50);
    CHECK(again.differing() == 0);
    CHECK(recorder.size() == 301);
}

TEST_CASE("pages: device in millimetres") {
    const Eigen::Vector3d position(0, 0, 108), velocity(0, 0, -50);
    const membrane::Vector3<double> force(0, 0, 0.01);
    membrane::ScriptedDevice<double> device({{.time = 0}}, {.tick = 1e-3});
    // [units]
    const auto scale =
        examples::DeviceScale{.force = 40, .motion = 0.1};  // 40 times the force, 10 times the displacement
    const auto seen = scale.to_scene(examples::Millimetres(position), examples::MillimetresPerSecond(velocity));
    device.write(scale.to_device(examples::Newtons(force)).device_force.value());
    // [/units]
    CHECK(seen.position.z() == Approx(0.0108));
    CHECK(device.force().z() == 0.4);
    CHECK(scale.at_device(examples::NewtonsPerMetre(40)).value() == Approx(160));
}

TEST_CASE_METHOD(Touched, "pages: two loops") {
    auto shown = x;
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    // [handover]
    membrane::MovedPoints<double> moved(mesh.vertex_count());
    moved.publish(report.moved, x, now());  // haptic loop, each tick; a steady clock [s]
    const auto news = moved.read();         // drawing loop, each frame; news.age(now())
    for (const auto v : news.moved) shown.col(v) = news.x.col(v);
    // [/handover]
    CHECK_FALSE(news.moved.empty());
    CHECK(shown == x);
}

TEST_CASE_METHOD(Touched, "pages: snapshot") {
    std::vector<double> forces;
    const auto play = [&](int ticks) {
        for (int i = 0; i < ticks; ++i) {
            tool.time += dt;
            tool.position.z() -= 1e-5;
            contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
            forces.push_back(feel({tool, contact, report}).norm());
            ++steps;
        }
    };
    play(10);
    // [snapshot]
    std::vector<std::byte> buffer(membrane::snapshot_capacity(solver, tracker, x, tool, steps));  // before the loop
    const auto size = membrane::save_snapshot(buffer, solver, tracker, x, tool, steps);           // at any tick
    // ... later, or in another program:
    const auto go_back = [&] {
        const auto snapshot = std::span(buffer).first(size);
        if (!membrane::restore_snapshot(snapshot, solver, tracker, x, tool, steps)) return false;
        tree.refit(x);
        return true;
    };
    // [/snapshot]
    play(40);
    REQUIRE(go_back());
    play(40);
    REQUIRE(forces.size() == 90);
    CHECK(std::equal(forces.begin() + 10, forces.begin() + 50, forces.begin() + 50));
    CHECK(forces.back() > 0);
}

TEST_CASE("pages: a mesh from a file") {
    std::istringstream file("# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1 4/1\n");
    // [obj]
    std::vector<double> coordinates;
    std::vector<membrane::Index> corners;
    for (std::string line, word; std::getline(file, line);) {
        std::istringstream words(line);
        words >> word;
        if (word == "v") {
            for (double c = 0; words >> c;) coordinates.push_back(c / 1000);  // in the file: millimetres
        } else if (word == "f") {
            std::vector<membrane::Index> face;
            while (words >> word) face.push_back(std::stoi(word) - 1);  // "7/3/1" begins with the vertex
            for (std::size_t k = 2; k < face.size(); ++k)
                corners.insert(corners.end(), {face[0], face[k - 1], face[k]});
        }
    }
    const auto points = Eigen::Map<membrane::Points<double>>(coordinates.data(), 3, std::ssize(coordinates) / 3);
    const auto triangles = Eigen::Map<membrane::Triangles>(corners.data(), 3, std::ssize(corners) / 3);
    const auto mesh = membrane::TriangleMesh(points, triangles);  // throws if it is no surface
    // [/obj]
    CHECK(mesh.vertex_count() == 4);
    CHECK(mesh.triangle_count() == 2);
    CHECK(mesh.positions().col(2) == Eigen::Vector3d(1e-3, 1e-3, 0));
}

TEST_CASE("pages: meshes from formulas") {
    // [distmesh]
    const auto lens = membrane::distmesh(membrane::Ellipsoid{.radii = {4.5e-3, 4.5e-3, 2e-3}}, {.edge_length = 2e-3});
    const auto front = membrane::trimmed(membrane::Ball{.radius = 8e-3}, membrane::HalfSpace{.point = {0, 0, -5e-3}});
    const auto cornea = membrane::distmesh(front, {.edge_length = 2e-3});  // with a border
    const auto torus = [](const Eigen::Vector3d& p) {                      // or any function of your own
        return std::hypot(std::hypot(p.x(), p.y()) - 6e-3, p.z()) - 2e-3;
    };
    const auto ring = membrane::distmesh(
        torus, {.edge_length = 2e-3, .bounds = membrane::Bounds{{-0.01, -0.01, -0.003}, {0.01, 0.01, 0.003}}});
    // [/distmesh]
    // [graded]
    const auto length = membrane::graded_edge_length({.longest = 2e-3,
                                                      .loads = {{.centre = {0, 0, 8e-3}, .radius = 1.5e-3}},
                                                      .tension = 1.8,       // [N/m]
                                                      .foundation = 2e6});  // [Pa/m]
    const auto graded = membrane::distmesh(membrane::Ball{.radius = 8e-3}, {.edge_length = length});
    // [/graded]
    CHECK(membrane::mean_edge(graded) < 2e-3);
    CHECK(membrane::validate(lens).facts.closed());
    CHECK(membrane::validate(cornea).facts.borders == 1);
    CHECK(membrane::validate(ring).facts.genus == 1);
}

TEST_CASE("pages: mesh from elsewhere") {
    const auto good = membrane::icosphere<double>({.radius = 10, .subdivisions = 2});
    auto triangles = good.triangles();
    membrane::Points<double> points(3, good.vertex_count() + 1);  // triangle 7 has a corner of its own, as in an STL
    points << good.positions(), good.positions().col(triangles(0, 7));
    triangles(0, 7) = good.vertex_count();
    for (membrane::Index f = 0; f < triangles.cols(); ++f) {  // most of them inside out
        if (f % 5 < 3) std::swap(triangles(0, f), triangles(1, f));
    }
    // [validate]
    const auto report = membrane::validate(points, triangles);  // any numbers, 3 x V [m] and 3 x F
    std::cout << to_string(report);                             // each defect with its indices and a remedy
    if (report.facts.likely_unit == membrane::LengthUnit::millimetre) points /= 1000;  // facts of the mesh
    const auto repaired =
        membrane::repair(points, triangles, {.weld = 1e-6, .drop_repeated = true, .orient = true, .flip_inward = true});
    const auto mesh = membrane::TriangleMesh(repaired.positions, repaired.triangles);  // throws if a defect remains
    // [/validate]
    CHECK_FALSE(report.valid());
    CHECK(membrane::validate(mesh).empty());
    CHECK(membrane::validate(mesh).facts.facing == membrane::Facing::outward);
    CHECK(mesh.vertex_count() == good.vertex_count());
    CHECK(mesh.positions().colwise().norm().maxCoeff() == Approx(0.01));
}

TEST_CASE("pages: constants") {
    const auto mesh = membrane::icosphere<double>({.radius = 4e-3, .subdivisions = 2});
    // [constants]
    const auto capsule = membrane::materials::lens_capsule().typical;  // with the source of each number
    const auto fibres = membrane::FoundationLayer{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = membrane::spring_stiffnesses(mesh, capsule)});
    const auto foundation =
        membrane::FoundationSprings(mesh, {.normal = membrane::normal_stiffnesses(mesh, fibres),
                                           .tangential = membrane::tangential_stiffnesses(mesh, fibres),
                                           .recovery_time = 0.2});
    const auto layers = membrane::recommended_layers(mesh, capsule, fibres).tangential;
    // [/constants]
    CHECK(layers > 0);
}

TEST_CASE_METHOD(Touched, "pages: adhesion") {
    membrane::Grasper<double> grasper(mesh);
    tool.grasping = true;
    const auto grasp = grasper.update(contact, x, tool);
    REQUIRE(grasp.holding());
    tool.position += Eigen::Vector3d(0, 0, 1e-4);
    // [adhesion]
    auto adhesion = membrane::CohesiveSprings(mesh, {.stiffness = 1e8, .strength = 2e3, .energy = 0.05});  // per area
    const auto report = solver.step(x, dt, network, adhesion, membrane::pull(tool, grasp));
    adhesion.update(x, report.moved);
    // [/adhesion]
    CHECK(adhesion.dissipated() > 0);
}

TEST_CASE_METHOD(Touched, "pages: friction") {
    // [friction]
    auto friction = membrane::ToolFriction<double>({.coefficient = 0.3});  // one for each tool
    const auto report = solver.step(x, dt, network, foundation, friction.press(tool, contact));
    // [/friction]
    CHECK(report.total_reaction().norm() > 0);
    CHECK_FALSE(friction.vertices().empty());
}

TEST_CASE("pages: tear") {
    const auto sheet = membrane::disc<double>({.radius = 0.005, .rings = 8});
    const std::vector<membrane::Index> path{1, 0, 4}, rim = membrane::border(sheet);
    const double dt = 1e-3;
    // [tear]
    const auto mesh = membrane::with_reserve(sheet, 200);  // vertices to double others
    const auto network =
        membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 20.0, .pinned = rim});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, network));
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 12, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 1.4e3, .thickness = 12e-6});
    auto x = mesh.positions();

    for (const auto& event : tear.cut_along(path, x)) follow(event, tissue, solver, tree);       // a cut to start from
    const auto report = solver.step(x, dt, tissue, membrane::NoFoundation(), tear.ligaments());  // in each tick
    for (const auto& event : tear.update(x, dt, tissue, membrane::NoFoundation())) {
        follow(event, tissue, solver, tree);
    }
    tree.refit(x, report.moved);
    // [/tear]
    CHECK(report.status == membrane::StepStatus::advanced);
    CHECK(tear.tips().size() == 2);
}

TEST_CASE("pages: coarse") {
    const auto mesh = membrane::disc<double>({.radius = 0.005, .rings = 12});
    const auto rest = membrane::border(mesh);
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{}, {.stiffness = 20.0, .pinned = rest});
    const membrane::NoFoundation foundation;
    auto solver = membrane::QuasiStaticSolver(network);
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto x = mesh.positions();
    const double dt = 1e-3;
    const membrane::Tool<double> tool{.position = {0, 0, 0.9e-3}, .radius = 1e-3};
    // [coarse]
    membrane::CoarseCorrection coarse(mesh, network, foundation);  // once; foundation may be NoFoundation()

    const auto contact = tracker.update(tree, x, tool);
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    const auto corrected = coarse.correct(x, solver);
    corrected.moved ? tree.refit(x) : tree.refit(x, report.moved);
    // [/coarse]
    // [reaction_error]
    const auto error = coarse.reaction_error(x, solver);  // after the step [N]
    const bool trusted = norm(error) < 0.01 * norm(report.total_reaction());
    // [/reaction_error]
    CHECK(report.reactions[0].z() > 0);
    CHECK(norm(error) > 0);
    CHECK(trusted);
    auto deeper = tool;
    deeper.position.z() -= 0.1e-3;
    const auto uncorrected =
        solver.step(x, dt, network, foundation, press(deeper, tracker.update(tree, x, deeper))).total_reaction();
    CHECK(norm(coarse.reaction_error(x, solver)) > 0.01 * norm(uncorrected));
    CHECK(coarse.points().count() > 60);
}

TEST_CASE("pages: a flap that forceps tear") {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 0.005, .rings = 12}), 200);
    const auto capsule = membrane::materials::lens_capsule().typical;
    const auto network = membrane::MassSpringNetwork(
        mesh, membrane::LinearSpring{},
        {.stiffness = membrane::spring_stiffnesses(mesh, capsule), .pinned = membrane::border(mesh)});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, network));
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = membrane::unlimited, .sweeps = 4});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto grasper = membrane::Grasper(mesh);
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 300, .thickness = capsule.thickness});
    auto x = mesh.positions();
    const double dt = 1e-3, edge = membrane::mean_edge(mesh);
    // [flap]
    // A slit from the middle along x, then along y. The tissue between its two parts is the flap.
    const Below support{.stiffness = 10};
    std::vector<membrane::Index> path{0};
    while (path.size() < 6) path.push_back(tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
    while (path.size() < 10) path.push_back(tear.surface().nearest_in_direction(path.back(), {0, 1, 0}));
    for (const auto& event : tear.cut_along(path, x)) follow(event, tissue, solver, tree, tracker, grasper);

    std::vector<std::vector<membrane::Vector3<double>>> torn;  // a line for each tip, on the membrane at rest [m]
    for (const auto& tip : tear.tips()) {
        torn.push_back({membrane::point(tear.surface().rest_positions(), tip.vertex)});
    }
    const auto tick = [&](const membrane::Tool<double>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report =
            solver.step(x, dt, tissue, support, press(tool, contact, grasp), pull(tool, grasp), tear.ligaments());
        const auto held = std::span<const membrane::Index>(grasp.corners).first(grasp.holding() ? 3 : 0);
        for (const auto& event : tear.update(x, dt, tissue, support, held)) {
            follow(event, tissue, solver, tree, tracker, grasper);
        }
        for (const auto& tip : tear.tips()) {
            const auto at = membrane::point(tear.surface().rest_positions(), tip.vertex);
            const auto line = std::ranges::min_element(torn, {}, [&](const auto& l) { return norm(l.back() - at); });
            if (line->back() != at) line->push_back(at);
        }
        tree.refit(x, report.moved);
        return report.reactions[0] + report.reactions[1];  // on the forceps [N]
    };
    // [/flap]
    REQUIRE(tear.tips().size() == 2);
    membrane::Tool<double> tool{.position = {3.5 * edge, 0.9 * edge, 2e-4}, .radius = 1e-4};
    double largest = 0;
    for (int i = 0; i < 600; ++i) {
        if (i < 100) tool.position.z() -= 1.2e-6;  // touches
        tool.grasping = i >= 100;
        if (i >= 100) tool.position += Eigen::Vector3d(-4e-6, 4e-6, 1.5e-6);
        largest = std::max(largest, tick(tool).norm());
    }
    CHECK(grasper.update(tracker.update(tree, x, tool), x, tool).holding());
    CHECK(largest > 1e-3);
    CHECK(largest < 0.1);
    REQUIRE(torn.size() == 2);
    CHECK(torn[0].size() + torn[1].size() > 2);
    double length = 0;
    for (const auto& line : torn) {
        for (std::size_t i = 1; i < line.size(); ++i) {
            const double step = (line[i] - line[i - 1]).norm();
            CHECK(step < 2 * edge);  // it does not change between the tips
            length += step;
        }
    }
    CHECK(tear.torn_length() > edge);
    CHECK(length > 0.5 * tear.torn_length());
}

TEST_CASE("pages: coarse_tear") {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 0.005, .rings = 8}), 50);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = 20.0, .pinned = membrane::border(mesh)});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, network));
    auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 1e-3});
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 4});
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 10, .thickness = 12e-6});
    membrane::CoarseCorrection coarse(mesh, tissue, foundation);
    membrane::Points<double> x = mesh.positions();
    const double dt = 1e-3;
    for (const auto& event : tear.cut_along(tear.slit_at(0, {1, 0, 0}), x)) {
        follow(event, tissue, foundation, solver, coarse);
    }
    membrane::PointAttachment<double> forceps{0, tear.surface().corners(0), {0.4, 0.3, 0.3}, {0, 0, 0}};
    forceps.target = membrane::point_at(membrane::triangle_at(mesh.positions(), forceps.corners), forceps.barycentric);
    int corrections = 0;
    for (int i = 0; i < 300; ++i) {
        forceps.target += Eigen::Vector3d(0, 0, 5e-6);
        forceps.corners = tear.surface().corners(0);
        // [coarse_tear]
        const auto report = solver.step(x, dt, tissue, foundation, forceps, tear.ligaments());
        const auto corrected = coarse.correct(x, solver);
        solver.wake(corrected.unbalanced);
        for (const auto& event : tear.update(x, dt, tissue, foundation, forceps.corners)) {
            follow(event, tissue, foundation, solver, coarse);
        }
        // [/coarse_tear]
        REQUIRE(report.status == membrane::StepStatus::advanced);
        if (membrane::is_finite(corrected.reaction_error)) ++corrections;
    }
    CHECK(corrections > 30);
    CHECK(tear.torn_length() > 0.001);
    CHECK(x.row(2).maxCoeff() > 1e-3);
}

TEST_CASE("pages: tear_reset") {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 0.005, .rings = 8}), 50);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 20.0});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, network));
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 12});
    auto tree = membrane::AabbTree(mesh);
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 1.4e3, .thickness = 12e-6});
    auto x = mesh.positions();
    // [tear_reset]
    const membrane::InitialState whole(tear, tissue, solver, tree, x);  // all that follows a tear, and x
    const auto sew_up = [&] {                                           // between two ticks
        if (!whole.reset(tear, tissue, solver, tree, x)) return false;
        tree.refit(x);
        return true;
    };
    // [/tear_reset]
    for (const auto& event : tear.cut_along(tear.slit_at(0, {1, 0, 0}), x)) follow(event, tissue, solver, tree);
    REQUIRE(tear.surface().triangles() != mesh.triangles());
    REQUIRE(sew_up());
    CHECK(tear.surface().triangles() == mesh.triangles());
}

TEST_CASE("pages: tear_starts") {
    const auto mesh = membrane::with_reserve(membrane::disc<double>({.radius = 0.005, .rings = 8}), 50);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 20.0});
    auto tissue = membrane::Tissue(membrane::TearableSprings(mesh, network));
    auto solver = membrane::QuasiStaticSolver(tissue, {.layers = 12});
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto tear = membrane::Tearing(mesh, membrane::EnergyRelease{.toughness = 1.0, .thickness = 12e-6});
    membrane::Points<double> x = 1.3 * mesh.positions();
    tree.refit(x);
    const membrane::Index v = membrane::border(mesh)[0];
    const auto contact = tracker.update(tree, x, membrane::Tool<double>{.position = {0, 0, -1e-5}, .radius = 1e-4});
    REQUIRE(contact.touching());
    struct {
        std::vector<Eigen::Vector3d> reactions;
    } report{{0.03 * contact.normal}};
    // [tear_starts]
    const auto from_flaw = tear.start_at(v, 50e-6, x, tissue);  // the border at v has flaws of 50 um
    for (const auto& event : tear.cut_along(from_flaw, x)) follow(event, tissue, solver, tree, tracker);

    const auto under_blade = tear.slit_under(contact, report.reactions[0], 20e-3, {1, 0, 0});  // along x, from 20 mN on
    for (const auto& event : tear.cut_along(under_blade, x)) follow(event, tissue, solver, tree, tracker);
    // [/tear_starts]
    CHECK(tear.tips().size() == 3);
}

TEST_CASE_METHOD(Touched, "pages: equilibrium") {
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    // [equilibrium]
    const auto equilibrium = membrane::equilibrium(x, mesh, network, foundation, {}, press(tool, contact));
    const double displacement = (x - equilibrium.x).colwise().norm().maxCoeff();   // of the positions [m]
    const double force = (report.reactions[0] - equilibrium.reactions[0]).norm();  // of the force [N]
    // [/equilibrium]
    CHECK(equilibrium.converged);
    CHECK(displacement < 1e-5);
    CHECK(force < 0.1 * equilibrium.reactions[0].norm());
}

TEST_CASE_METHOD(Touched, "pages: bound") {
    const Eigen::Vector3d target = 1.01 * x.col(7);
    const auto report = solver.step(x, dt, network, foundation, membrane::pull(7, target));
    // [bound]
    auto bound = membrane::ErrorBound(network);  // once: allocates all it needs
    const auto error = bound.compute(x, network, foundation, membrane::pull(7, target));  // allocates nothing
    if (error.certified()) {
        const double displacement = error.position;  // no vertex is farther off [m]
        const double force =
            error.reactions[0].max_distance_to(report.reactions[0]);  // the force is no farther off [N]
        std::printf("%g m, %g N\n", displacement, force);
    }
    // [/bound]
    CHECK(error.certified());
}

TEST_CASE_METHOD(AtRest, "pages: settings") {
    const auto tools = stroke_of_ticks();
    // [settings]
    const auto trajectory = membrane::ToolTrajectory(mesh, tools, 1e-3);  // a tool for each tick of 1 ms
    const auto choice =
        membrane::choose_settings(mesh, network, foundation, trajectory, {.force_error = 0.05});  // .time, or both
    if (!choice.satisfied) std::puts("No setting is accurate enough. The nearest one:");
    std::printf("%g of the force, at most %g, in %g s\n", choice.force_error, choice.max_force_error, choice.time);
    std::printf("Up to %g m/s and %g m deep.\n", choice.max_speed, choice.max_displacement);  // as in the trial
    auto solver = membrane::QuasiStaticSolver(network, choice.options);
    // [/settings]
    CHECK(choice.satisfied);
}

TEST_CASE("pages: mesh_error") {
    const auto mesh = membrane::disc({.radius = 5e-3, .rings = 12});
    const membrane::Material material{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};
    const membrane::Tool<double> tool{.position = {0, 0, 1.6e-3}, .radius = 2e-3};
    // [mesh_error]
    const auto force = [&](const membrane::TriangleMesh<double>& any) {  // the scene on any mesh
        const membrane::MassSpringNetwork none(any, membrane::LinearSpring{},
                                               {.stiffness = 0.0, .pinned = border(any)});
        const membrane::Tissue tissue(none, membrane::triangular_springs(any, material, 1.02));
        membrane::ContactTracker<double> tracker(any);
        const auto contact = tracker.update(membrane::AabbTree(any), any.positions(), tool);
        const auto found =
            membrane::equilibrium(any.positions(), any, tissue, membrane::NoFoundation{}, {}, press(tool, contact));
        return found.reactions[0].norm();
    };
    const auto estimate = membrane::estimated_mesh_error(mesh, force);
    const double error = estimate.error();            // of the force, relative
    const double edges = estimate.edge_factor(0.01);  // for an error of 1 %: edges this much as long
    // [/mesh_error]
    CHECK(error > 0.001);
    CHECK(error < 0.1);
    CHECK(edges == Approx(std::sqrt(0.01 / error)));
}

TEST_CASE_METHOD(Touched, "pages: surface") {
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
    // [surface]
    const auto sphere = membrane::icosphere<double>({.radius = 10e-3, .subdivisions = 3});  // 642 vertices
    const auto cornea = membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 12});
    const auto rim = membrane::border(cornea);           // the vertices on it
    const auto near = membrane::reordered(sphere).mesh;  // neighbours near each other in memory
    auto normals = membrane::VertexNormals(mesh);
    normals.update(x, report.moved);  // unit vectors, 3 x V; cost: the moved vertices and their neighbours
    // [/surface]
    CHECK(sphere.vertex_count() == 642);
    CHECK(near.vertex_count() == 642);
    CHECK_FALSE(rim.empty());
    CHECK(normals.values().cols() == mesh.vertex_count());
}

TEST_CASE("pages: rim") {
    const auto cornea = membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 12});
    // [rim]
    const auto network = membrane::MassSpringNetwork(cornea, membrane::LinearSpring{},
                                                     {.stiffness = 40.0, .pinned = membrane::border(cornea)});
    // [/rim]
    for (const auto v : membrane::border(cornea)) CHECK(network.pinned(v));
}

TEST_CASE("pages: driven_rim") {
    const auto cornea = membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 12});
    const auto rim = membrane::border(cornea);
    const auto network =
        membrane::MassSpringNetwork(cornea, membrane::LinearSpring{}, {.stiffness = 40.0, .pinned = rim});
    const auto foundation = membrane::VirtualVolumeSprings(cornea, {.stiffness = 8.0});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited});
    auto tree = membrane::AabbTree(cornea);
    auto x = cornea.positions();
    const double dt = 1e-3, speed = 1e-3;
    static_cast<void>(solver.step(x, dt, network, foundation));
    // [driven_rim]
    for (const auto v : rim) x(2, v) += speed * dt;  // pinned vertices are the caller's to move
    const auto report = solver.step(x, dt, network, foundation);
    tree.refit(x, rim);
    tree.refit(x, report.moved);
    // [/driven_rim]
    CHECK(report.moved.size() == static_cast<std::size_t>(cornea.vertex_count()) - rim.size());
}

TEST_CASE_METHOD(Touched, "pages: contact") {
    // [contact]
    const auto nearest = tree.closest_point(x, tool.position);  // triangle, barycentric coordinates, distance
    tree.overlap_sphere(x, tool.position, 2e-3, [](membrane::Index triangle) { std::printf("%d ", triangle); });
    const membrane::Tool<double> shaft{.position = tool.position, .axis = {0, 0, 0.04}, .radius = 5e-4};
    const auto contact = tracker.update(tree, x, shaft);
    if (contact.touching()) std::printf("%g m deep\n", contact.depth);
    // [/contact]
    CHECK(nearest.triangle != membrane::no_index);
}

TEST_CASE_METHOD(Touched, "pages: forceps") {
    // [forceps]
    tool.grasping = true;                                 // while the jaws are closed
    const auto grasp = grasper.update(contact, x, tool);  // holds what the tool touches as they close
    const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
    const auto pulling = report.reactions[1];  // the membrane's force on the jaws [N]
    // [/forceps]
    CHECK(grasp.holding());
    CHECK(membrane::is_finite(pulling));
}

TEST_CASE_METHOD(Touched, "pages: status") {
    membrane::ScriptedDevice<double> device({{.time = 0}}, {.tick = 1e-3});
    membrane::ForceLimiter limit(membrane::devices::touch);
    const auto tick = [&] {
        tool.time += dt;
        // [status]
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        membrane::Vector3<double> force = membrane::Vector3<double>::Zero();  // if refused; x is unchanged then
        if (report.status == membrane::StepStatus::advanced) {
            force = feel({tool, contact, report});  // converged or not: the state of this tick
            ++steps;
        }
        device.write(limit(force, tool.time, steps));  // in every tick: zero passes at once
        // [/status]
        return device.force().norm();
    };
    double full = 0;
    for (int i = 0; i < 300; ++i) full = tick();
    REQUIRE(full > 0);
    const auto still = tool.position;
    tool.position.x() = std::numeric_limits<double>::quiet_NaN();
    for (int i = 0; i < 30; ++i) CHECK(tick() == 0);
    tool.position = still;
    const double in_a_tick = limit.device().peak_force / 0.02 * dt;  // the slew limit
    double last = 0;
    for (int i = 0; i < 300; ++i) {
        const double now = tick();
        CHECK(now - last <= 1.001 * in_a_tick);
        last = now;
    }
    CHECK(last == full);
}

TEST_CASE_METHOD(Touched, "pages: rigid body") {
    membrane::ScriptedDevice<double> device({{.time = 0, .position = {0, 0, 0.0308}}}, {.tick = 1e-3, .radius = 1e-3});
    const Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    const Eigen::Vector3d origin(0, 0, 0.02), velocity(0.1, 0, 0), spin(0, 0, 1);
    // [rigid_body]
    const membrane::RigidFrame<double> eye{.rotation = rotation,  // its pose in this tick, from the body to the world
                                           .origin = origin,
                                           .velocity = velocity,       // [m/s], for forces with damping
                                           .angular_velocity = spin};  // [rad/s]
    const auto seen = membrane::to_body_frame(device.read(), eye);
    const auto contact = tracker.update(tree, x, seen);
    const auto report = solver.step(x, dt, network, foundation, press(seen, contact));
    device.write(eye.vector_to_world(feel({seen, contact, report})));
    // [/rigid_body]
    CHECK(contact.touching());
    CHECK(device.force().z() > 0);
}

TEST_CASE("pages: fit") {
    const auto mesh = membrane::spherical_cap({.radius = 7.8e-3, .diameter = 11.7e-3, .rings = 4});
    const auto tip = membrane::Tool<double>{.position = {0, 0, 9.81e-3}, .radius = 2e-3};
    // [fit]
    const auto build = [&](std::span<const double> constants) {  // [N/m]
        return std::pair(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = constants[0], .pinned = membrane::border(mesh)}),
                         membrane::VirtualVolumeSprings(mesh, {.stiffness = constants[1]}));
    };
    const auto model = membrane::Indentation(mesh, tip, Eigen::Vector3d(0, 0, -1), build);  // a press along -z
    const auto table = membrane::ForceTable{.depth = {5e-5, 1e-4, 2e-4, 4e-4, 8e-4},        // [m]
                                            .force = {8.12e-4, 1.18e-3, 1.91e-3, 3.82e-3, 1.10e-2}};  // [N]
    const auto found = membrane::fit(table, {10, 10}, model);  // from a first guess
    std::printf("%g N/m, 95 %% within %g to %g\n", found.constants[0], found.intervals[0].lower,
                found.intervals[0].upper);
    // [/fit]
    CHECK(found.constants[0] == Approx(40).epsilon(0.02));  // by which the table was made
    CHECK(found.constants[1] == Approx(8).epsilon(0.02));
}

TEST_CASE_METHOD(Touched, "pages: two tools") {
    auto second_tracker = membrane::ContactTracker<double>(mesh);
    const membrane::Tool<double> second{.position = {0, 0.0108, 0}, .radius = 1e-3};
    // [two_tools]
    const auto first_contact = tracker.update(tree, x, tool);  // a tracker for each tool, one tree
    const auto second_contact = second_tracker.update(tree, x, second);
    const auto report =
        solver.step(x, dt, network, foundation, press(tool, first_contact), press(second, second_contact));
    const auto on_first = report.reactions[0], on_second = report.reactions[1];  // [N], in the order of the arguments
    // [/two_tools]
    CHECK(on_first.z() > 0);
    CHECK(on_second.y() > 0);
}

#pragma GCC diagnostic pop
