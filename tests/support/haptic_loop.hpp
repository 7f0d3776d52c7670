// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <membrane/certify/passivity.hpp>
#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/extrapolated_reaction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/grasp_transition.hpp>
#include <membrane/haptics/handover.hpp>
#include <membrane/haptics/rest_contact.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/haptics/virtual_coupling.hpp>
#include <membrane/replay/recording.hpp>
#include <membrane/replay/simulated_hand.hpp>

#include "../../examples/openhaptics/units.hpp"
#include "support/whole_loop.hpp"

/// The complete loop of a hand, and what can go wrong in it.
///
///     test::HapticLoop<double> loop(seed);
///     test::FaultInjector faults(seed);
///     for (int i = 0; i < 1'000'000; ++i) loop.tick(faults.next());
namespace test {

/// What goes wrong in a tick: nothing.
struct Fault {
    membrane::Vector3<double> tip = membrane::Vector3<double>::Zero();    ///< off where the hand is [m]
    membrane::Vector3<double> force = membrane::Vector3<double>::Zero();  ///< more than was asked for [N]
    bool frozen = false;                                                  ///< the solver has not come to an end
    double late = 0;                                                      ///< the tick comes so much later [s]

    [[nodiscard]] bool any() const noexcept {
        return !(tip.isZero(0) && force.isZero(0)) || frozen || late > 0;  // what is not a number is not zero
    }
};

/// A device with a hand, in millimetres and in a frame of its own; contact and solver; every policy, each in its turn;
/// the limits; an observer; a recorder; both sides of the hand-over.
template <membrane::Real S>
struct HapticLoop {
    using V = membrane::Vector3<S>;

    explicit HapticLoop(std::uint64_t seed)
        : network(mesh, {}, {.stiffness = S(40)}),
          foundation(mesh, {.stiffness = S(8), .damping = S(0.005)}),
          solver(network, {.layers = 3, .sweeps = 1, .force_tolerance = S(1e-6)}),
          device(at_desk(busy_script<S>(seed, 40)), {.tick = dt, .radius = 1e-3},
                 membrane::SimulatedHand<S>({.mass = 0.1, .damping = 4, .stiffness = 300})) {}

    void tick(const Fault& fault = {}) noexcept {
        if (!device.running()) device.reset();
        now += dt + fault.late;
        const auto hand = in_scene(device.read(), fault);
        if (!fault.frozen) simulate(policy == 3 ? coupling.update(hand, reaction, S(dt)) : hand);
        asked += fault.force.cast<S>();
        felt = limit(asked, now, solves);
        observer.update(hand.position, felt, dt);
        if (recorder.missed() > 100) recorder.clear();
        recorder.add(hand, felt);
        const auto device_force = scale.to_device(examples::Newtons(felt.template cast<double>())).device_force;
        device.write(device_force.value().template cast<S>());
        draw(hand);
        ++ticks;
    }

    static constexpr double dt = 1e-3;  // [s]

    membrane::TriangleMesh<S> mesh = membrane::icosphere<S>({.radius = 0.01, .subdivisions = 2});
    membrane::MassSpringNetwork<S, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<S> foundation;
    membrane::QuasiStaticSolver<S> solver;
    membrane::AabbTree<S> tree{mesh};
    membrane::ContactTracker<S> tracker{mesh};
    membrane::Grasper<S> grasper{mesh};
    membrane::VertexNormals<S> normals{mesh};
    membrane::SmoothContact<S> smooth{mesh};
    membrane::RestContact<S> rest{mesh};
    membrane::Points<S> x = mesh.positions();
    V reaction = V::Zero();

    using Paper = membrane::ContactFriction<membrane::SpringDamperForce, S>;
    membrane::GraspTransition<Paper, S> paper{
        Paper({.stiffness = 100, .damping = 0.5}, {.coefficient = 0.2, .stiffness = 100}), {.duration = 0.05}};
    membrane::ReactionForce react{.scale = 5};
    membrane::ExtrapolatedReaction<S> extrapolate{{.scale = 5}};
    // Less than `min_damping` for what it holds: the tool runs away, and all else has to bear that.
    membrane::VirtualCoupling<S> coupling{{.stiffness = 200, .damping = 0.2, .scale = 5}};
    membrane::SpringDamperForce spring{.stiffness = 100, .damping = 0.5};
    membrane::ForceLimiter limit{membrane::devices::touch};
    membrane::PassivityObserver observer;
    membrane::Recorder<S> recorder{1000, mesh.vertex_count()};

    /// The hand goes twice as far as the tool, elsewhere and turned.
    examples::DeviceScale scale = [] {
        examples::DeviceScale s{.force = 1, .motion = 0.5};
        s.device.rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
        s.device.origin = {0, 0, 0.002};
        return s;
    }();
    membrane::ScriptedDevice<S, membrane::SimulatedHand<S>> device;
    membrane::MovedPoints<S> moved{mesh.vertex_count()};
    membrane::Latest<membrane::Tool<S>> pose;
    membrane::Points<S> shown = x;

    V asked = V::Zero(), felt = V::Zero();  // [N]
    std::uint64_t solves = 0;
    double now = 0;
    int ticks = 0, policy = 0, touching = 0, holding = 0, refused = 0;
    std::array<int, 5> pushed{};  // ticks with a force, by policy
    bool drawn_right = true;

  private:
    std::vector<membrane::Waypoint<S>> at_desk(std::vector<membrane::Waypoint<S>> script) const {
        for (auto& waypoint : script) {
            const membrane::Vector3<double> place = waypoint.position.template cast<double>();
            waypoint.position = (scale.device.point_to_body(place) / scale.motion).template cast<S>();
        }
        return script;
    }

    [[nodiscard]] membrane::Tool<S> in_scene(const membrane::Tool<S>& at_desk, const Fault& fault) const noexcept {
        const auto there =
            scale.to_scene(in_millimetres(examples::Metres(at_desk.position.template cast<double>())),
                           in_millimetres(examples::MetresPerSecond(at_desk.velocity.template cast<double>())));
        auto tool = at_desk;
        tool.position = (there.position + fault.tip).template cast<S>();
        tool.velocity = there.velocity.template cast<S>();
        return tool;
    }

    void simulate(const membrane::Tool<S>& tool) noexcept {
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, S(dt), network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        moved.publish(report.moved, x, now);
        reaction = report.total_reaction();
        if (report.status == membrane::StepStatus::advanced) {
            ++solves;
        } else {
            ++refused;
        }
        if (ticks % 5 == 0) extrapolate.solved(reaction, membrane::diagonal3(S(20)), tool.position);
        const membrane::HapticState<S> state{tool, smooth(contact), report, grasp};
        const membrane::HapticState<S> undeformed{tool, rest(contact, tool), report, grasp};
        const std::array<V, 5> displacements{paper(state), react(state), extrapolate(state), coupling(state),
                                             spring(undeformed)};
        asked = displacements[static_cast<std::size_t>(policy)];
        pushed[static_cast<std::size_t>(policy)] += asked.isZero(0) ? 0 : 1;
        if (!contact.touching() && !grasp.holding() && ticks % 500 < 250) policy = ticks / 500 % 5;
        touching += contact.touching();
        holding += grasp.holding();
    }

    /// What the other loop does, every 16th tick.
    void draw(const membrane::Tool<S>& tool) noexcept {
        pose.publish(tool, now);
        if (ticks % 16 != 0) return;
        const auto news = moved.read();
        for (const auto v : news.moved) shown.col(v) = news.x.col(v);
        drawn_right = drawn_right && shown == x && pose.read().number > 0;
    }
};

/// A device that sends what is no number or jumps about, policies gone wild, a solver that hangs, ticks that are lost:
/// now and then, one after the other, with quiet times between.
class FaultInjector {
  public:
    explicit FaultInjector(std::uint64_t seed) : random_(seed) {}

    [[nodiscard]] Fault next() noexcept {
        if (left_ == 0) {
            kind_ = kind_ == 0 ? 1 + random_.index(7) : 0;
            left_ = kind_ == 0   ? 300 + random_.index(1500)
                    : kind_ == 6 ? 1 + random_.index(300)
                                 : 1 + random_.index(20);
        }
        --left_;
        constexpr double none = std::numeric_limits<double>::quiet_NaN(),
                         infinity = std::numeric_limits<double>::infinity();
        Fault fault;
        if (kind_ == 1) fault.tip[random_.index(3)] = random_.chance(0.5) ? none : -infinity;
        if (kind_ == 2) fault.tip = 0.05 * random_.vector<double>();
        if (kind_ == 3) fault.force = 1e6 * random_.unit_vector();
        if (kind_ == 4) fault.force[random_.index(3)] = none;
        if (kind_ == 5) fault.force[random_.index(3)] = infinity;
        fault.frozen = kind_ == 6;
        fault.late = kind_ == 7 ? 0.05 : 0;
        return fault;
    }

  private:
    Random random_;
    membrane::Index kind_ = 0, left_ = 100;
};

}  // namespace test
