// SPDX-License-Identifier: MIT
#include <array>
#include <span>

#include <membrane/certify/passivity.hpp>
#include <membrane/haptics/contact_friction.hpp>
#include <membrane/haptics/extrapolated_reaction.hpp>
#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/grasp_transition.hpp>
#include <membrane/haptics/handover.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/haptics/virtual_coupling.hpp>
#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/replay/recording.hpp>
#include <membrane/replay/simulated_hand.hpp>
#include <membrane/solve/explicit_euler.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/catch.hpp"

// What is called in a user's loop does not throw, and says so. Laws, rules, volume models, constraints, force policies
// and devices say so by their concepts. The lambdas are compiled, never called.

using namespace membrane;

namespace {

// Eigen's own types may throw when they are copied (a matrix allocates), so `noexcept(call)` says no to a call that
// takes one by value: here the type of the function is asked.
template <class Function>
constexpr bool is_noexcept = false;
template <class Result, class Class, class... Arguments>
constexpr bool is_noexcept<Result (Class::*)(Arguments...) noexcept> = true;
template <class Result, class Class, class... Arguments>
constexpr bool is_noexcept<Result (Class::*)(Arguments...)& noexcept> = true;
template <class Result, class Class, class... Arguments>
constexpr bool is_noexcept<Result (Class::*)(Arguments...) const noexcept> = true;

}  // namespace

TEMPLATE_TEST_CASE("surfaces are queried without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    static_cast<void>([](const Vector3<S>& p, S s, const Points<S>& points, const Triangle<S>& triangle) {
        static_assert(noexcept(dot(p, p))&& noexcept(squared_norm(p))&& noexcept(norm(p))&& noexcept(cross(p, p)));
        static_assert(noexcept(direction(p, p))&& noexcept(point(points, 0)));
        static_assert(noexcept(is_finite(s))&& noexcept(is_finite(p)));
        static_assert(noexcept(area_vector(triangle))&& noexcept(point_at(triangle, p)));
        static_assert(noexcept(closest_point(triangle, p))&& noexcept(closest_to_segment(triangle, p, p)));
        static_assert(noexcept(closest_to_segment(triangle, 0, p, p))&& noexcept(first_hit(triangle, p, p)));
        static_assert(noexcept(touches_box(triangle, p, p)));
    });
    static_cast<void>([](VertexNormals<S>& normals, const ConstPointsRef<S>& x, std::span<const Index> moved,
                         const Triangles& triangles, const Adjacency& adjacency, const Vector3<S>& barycentric,
                         const std::array<Index, 3>& corners) {
        static_assert(noexcept(triangle_at(x, corners)));
        static_assert(noexcept(normals.update(x))&& noexcept(normals.update(x, moved))&& noexcept(normals.values()));
        static_assert(noexcept(pseudo_normal(x, triangles, adjacency, 0, barycentric)));
        static_assert(noexcept(adjacency.neighbours(0))&& noexcept(adjacency.triangles_of(0)));
        static_assert(noexcept(adjacency.triangle_neighbours(0))&& noexcept(adjacency.edges()));
        static_assert(noexcept(adjacency.border_vertices())&& noexcept(adjacency.closed()));
    });
    SUCCEED();
}

TEMPLATE_TEST_CASE("contact is found without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    static_cast<void>([](AabbTree<S>& tree, const ConstPointsRef<S>& x, std::span<const Index> moved,
                         const Vector3<S>& p, S radius, void (*visit)(Index)) {
        static_assert(noexcept(tree.refit(x))&& noexcept(tree.refit(x, moved))&& noexcept(tree.closest_point(x, p)));
        static_assert(noexcept(tree.first_hit(x, p, p))&& noexcept(tree.overlap_sphere(x, p, radius, visit)));
        static_assert(noexcept(tree.overlap_box(x, p, p, visit)));
        static_assert(noexcept(tree.overlap_capsule(x, p, p, radius, visit)));
    });
    static_cast<void>([](ContactTracker<S>& tracker, Grasper<S>& grasper, const AabbTree<S>& tree,
                         const ConstPointsRef<S>& x, const Tool<S>& tool, const Contact<S>& contact,
                         const Grasp<S>& grasp, const RigidFrame<S>& frame, const MovingBody<S>& body,
                         const Vector3<S>& p) {
        static_assert(noexcept(tracker.update(tree, x, tool))&& noexcept(tracker.update(tree, x, tool, body)));
        static_assert(noexcept(grasper.update(contact, x, tool, body))&& noexcept(body.velocity_at(p, {}, p)));
        static_assert(noexcept(tracker.reset())&& noexcept(tracker.full_query_count()));
        static_assert(noexcept(grasper.update(contact, x, tool))&& noexcept(grasper.reset()));
        static_assert(noexcept(contact.touching())&& noexcept(Contact<S>::none())&& noexcept(grasp.holding()));
        static_assert(noexcept(is_valid(tool))&& noexcept(to_body_frame(tool, frame)));
        static_assert(
            noexcept(frame.point_to_body(p))&& noexcept(frame.point_to_world(p))&& noexcept(frame.velocity_in(p, p)));
        static_assert(noexcept(frame.vector_to_body(p))&& noexcept(frame.vector_to_world(p)));
    });
    SUCCEED();
}

TEMPLATE_TEST_CASE("the membrane moves without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    using Network = MassSpringNetwork<S, LinearSpring>;
    using Volume = VirtualVolumeSprings<S>;
    static_cast<void>([](const Network& network, const Volume& volume, const MovingBody<S>& body,
                         const ConstPointsRef<S>& x, const Vector3<S>& p, S s, std::span<const Index> vertices,
                         PropagationQueue& queue) {
        static_assert(noexcept(network.force_on(0, x))&& noexcept(network.tension(0, x))&& noexcept(network.energy(x)));
        static_assert(noexcept(network.springs_of(0))&& noexcept(network.pinned(0))&& noexcept(network.mass(0)));
        static_assert(
            noexcept(volume.force_on(0, p, p, s))&& noexcept(volume.energy(0, p))&& noexcept(on(body, volume)));
        static_assert(noexcept(on(body, volume).force_on(0, p, p, s))&& noexcept(network.hessian(0, x)));
        static_assert(noexcept(body.anchors())&& noexcept(body.rotation_at(0)));
        static_assert(
            noexcept(queue.build(network, vertices, 4))&& noexcept(queue.vertices())&& noexcept(queue.layer(0)));
        static_assert(noexcept(queue.contains(0))&& noexcept(queue.clear())&& noexcept(queue.grow(network)));
        static_assert(noexcept(queue.group(network))&& noexcept(queue.colour_ends()));
    });
    static_cast<void>([](ActiveVertices& active, const Network& network, std::span<const Index> vertices,
                         const SolverOptions<S>& options, bool (*is_balanced)(Index)) {
        static_assert(noexcept(active.begin_step(network, vertices, options))&& noexcept(active.vertices()));
        static_assert(noexcept(active.contact_layer())&& noexcept(active.queue()));
        static_assert(noexcept(active.end_step(network, is_balanced, {}))&& noexcept(active.clear()));
        static_assert(noexcept(active.wake(0))&& noexcept(active.grow(network, options)));
        static_assert(noexcept(active.frontier())&& noexcept(active.colour_ends()));
    });
    static_cast<void>([](PackedVertices<S>& packed, const PropagationQueue& queue, const Network& network,
                         const StepInput<S, Network, Volume>& scene, const AnyExecutor& executor) {
        static_assert(noexcept(packed.assign(queue.vertices(), queue.colour_ends(), network)));
        static_assert(noexcept(packed.append(queue.vertices(), 0, queue.colour_ends(), network)));
        static_assert(noexcept(packed.vertices(0))&& noexcept(packed.first_of(0))&& noexcept(packed.pack_from(0)));
        static_assert(noexcept(packed.begin_step(scene))&& noexcept(packed.evaluate_residual(0, scene)));
        static_assert(noexcept(packed.extend(queue.vertices(), 0, queue.colour_ends(), network)));
        static_assert(noexcept(packed.update(0, 1, scene, SafeStep{}, Constrained::in_contact, executor)));
        static_assert(noexcept(packed.update(0, 1, scene, BlockStep{}, Constrained::no, executor)));
        static_assert(noexcept(packed.free_count(0))&& noexcept(packed.needed()));
    });
    static_cast<void>([](VertexRows<S>& rows, ContactState<S>& contacts, const ToolShape<S>& tool,
                         std::span<ContactPack<S>> packs, std::span<ContactPoint<S>> points) {
        static_assert(noexcept(rows.begin_step())&& noexcept(rows.reset()));
        static_assert(noexcept(contacts.begin_step())&& noexcept(contacts.end_step())&& noexcept(contacts.reset()));
        static_assert(noexcept(push_out(rows, contacts, tool, packs)));
        static_assert(noexcept(solve_contacts(rows, contacts, tool, packs)));
        static_assert(noexcept(apply_forces(rows, contacts, packs))&& noexcept(contacts.packs.unpack(points)));
        static_assert(noexcept(largest_squared_move(rows, contacts)));
    });
    static_cast<void>([](Predictor<S, 4>& predictor, std::span<const DrivingInput<S>> inputs) {
        static_assert(noexcept(predictor.extrapolation_factor(inputs))&& noexcept(predictor.reset()));
    });
    static_cast<void>([](const Tool<S>& tool, const Contact<S>& contact, const Grasp<S>& grasp, const Vector3<S>& p,
                         const std::array<Index, 3>& corners, std::span<const Index> vertices) {
        static_assert(noexcept(press(tool, contact, grasp)));
        static_assert(noexcept(pull(tool, grasp))&& noexcept(pull(0, p))&& noexcept(pin(vertices)));
        static_assert(noexcept(load(corners, p, p)));
    });
    using Solver = QuasiStaticSolver<S, MassStep>;
    static_assert(is_noexcept<decltype(&Solver::template step<Network, Volume>)>);
    static_assert(is_noexcept<decltype(&Solver::template step<Network, NoFoundation, ToolContact<S>, PointAttachment<S>,
                                                              VertexAttachment<S>, PointLoad<S>, PinnedVertices>)>);
    static_assert(is_noexcept<decltype(&Solver::template step_until<S (*)(), Network, Volume, ToolContact<S>>)>);
    static_assert(is_noexcept<decltype(&Solver::wake)> && is_noexcept<decltype(&Solver::wake_all)>);
    static_assert(is_noexcept<decltype(&Solver::reset)>);
    using Euler = ExplicitEuler<S>;
    bool (Euler::*const step)(PointsRef<S>, PointsRef<S>, S, const Network&, const Volume&) noexcept = &Euler::step;
    bool (Euler::*const pushed)(PointsRef<S>, PointsRef<S>, S, const Network&, const Volume&,
                                const ConstPointsRef<S>&) noexcept = &Euler::step;
    CHECK((step != nullptr && pushed != nullptr));
}

TEMPLATE_TEST_CASE("the device is served without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    static_cast<void>([](ScriptedDevice<S>& device, const Vector3<S>& force, const HapticState<S>& state,
                         const SpringDamperForce& springs, const ReactionForce& reaction) {
        static_assert(noexcept(device.running())&& noexcept(device.read())&& noexcept(device.write(force)));
        static_assert(noexcept(device.force())&& noexcept(device.time())&& noexcept(device.reset()));
        static_assert(noexcept(springs(state))&& noexcept(reaction(state)));
    });
    static_cast<void>([](Recorder<S>& recorder, ReplayDevice<S>& replay, const Tool<S>& tool, const Vector3<S>& force) {
        static_assert(noexcept(recorder.add(tool, force))&& noexcept(recorder.clear())&& noexcept(recorder.missed()));
        static_assert(noexcept(replay.differing())&& noexcept(replay.first_difference())&& noexcept(replay.reset()));
    });
    SUCCEED();
}

TEMPLATE_TEST_CASE("a force is found and limited without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    static_cast<void>([](ContactFriction<SpringDamperForce, S>& friction, ExtrapolatedReaction<S>& extrapolated,
                         GraspTransition<SpringDamperForce, S>& transition, VirtualCoupling<S>& coupling,
                         const SmoothContact<S>& smooth, const HapticState<S>& state, const MovingBody<S>& body,
                         const Vector3<S>& p, const Symmetric3<S>& stiffness) {
        static_assert(noexcept(friction(state))&& noexcept(friction.slips()));
        static_assert(noexcept(extrapolated(state))&& noexcept(extrapolated.solved(p, stiffness, p)));
        static_assert(noexcept(transition(state))&& noexcept(transition.in_transition()));
        static_assert(noexcept(coupling.update(state.tool, p, S(1)))&& noexcept(coupling(state)));
        static_assert(noexcept(coupling.force())&& noexcept(coupling.reset()));
        static_assert(noexcept(smooth(state.contact))&& noexcept(smooth(state.contact, body)));
    });
    static_cast<void>([](ForceLimiter& limit, PassivityObserver& observer, Watchdog& watchdog, SoftStart& start,
                         MotorThermalModel& heat, const Vector3<S>& force) {
        static_assert(
            noexcept(limit(force, 0.0, 1))&& noexcept(limit.active_limits())&& noexcept(limit.thermal_load()));
        static_assert(noexcept(limit.gain())&& noexcept(limit.device())&& noexcept(limit.reset()));
        static_assert(noexcept(observer.update(force, force, 1e-3))&& noexcept(observer.energy()));
        static_assert(noexcept(observer.energy_in())&& noexcept(observer.min_energy())&& noexcept(observer.reset()));
        static_assert(noexcept(watchdog.update(1, 0.0))&& noexcept(start.update(1.0, 0.0)));
        static_assert(noexcept(heat.add(1.0, 1.0))&& noexcept(heat.max_force()));
    });
    SUCCEED();
}

TEMPLATE_TEST_CASE("a membrane tears, peels and is dragged without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    using Springs = TearableSprings<S, LinearSpring>;
    using Foundation = CohesiveSprings<S>;
    static_assert(is_noexcept<decltype(&Tearing<S>::cut_along)>);
    static_assert(is_noexcept<decltype(&Tearing<S>::template start_at<Springs>)>);
    static_assert(is_noexcept<decltype(&Tearing<S>::template update<Springs, Foundation>)>);
    static_assert(is_noexcept<decltype(&Tearing<S>::stored)>);
    static_cast<void>([](Tearing<S>& tear, Springs& springs, Foundation& foundation, const TearEvent<S>& event,
                         const ConstPointsRef<S>& x, std::span<const Index> moved, const Contact<S>& contact,
                         const Vector3<S>& p, S s) {
        static_assert(noexcept(foundation.update(x, moved)));
        static_assert(noexcept(tear.slit_at(0, p))&& noexcept(tear.slit_under(contact, p, s, p)));
        static_assert(noexcept(tear.dissipated())&& noexcept(tear.ligaments())&& noexcept(tear.tips()));
        static_assert(noexcept(follow(event, springs, foundation))&& noexcept(foundation.dissipated()));
    });
    static_cast<void>([](QuasiStaticSolver<S>& solver, AabbTree<S>& tree, ContactTracker<S>& tracker,
                         Grasper<S>& grasper, VertexNormals<S>& normals, SmoothContact<S>& smooth,
                         MovedPoints<S>& moved, ToolFriction<S>& friction, const TearEvent<S>& event,
                         const Tool<S>& tool, const Contact<S>& contact, const Grasp<S>& grasp) {
        static_assert(noexcept(follow(event, solver, tree, tracker, grasper, normals, smooth, moved, friction)));
        static_assert(noexcept(friction.press(tool, contact))&& noexcept(friction.press(tool, contact, grasp)));
        static_assert(noexcept(friction.vertices())&& noexcept(friction.reset()));
    });
    SUCCEED();
}

TEMPLATE_TEST_CASE("hands and loops meet without exceptions", "[noexcept]", TEST_SCALARS) {
    using S = TestType;
    static_cast<void>([](SimulatedHand<S>& hand, ScriptedDevice<S, SimulatedHand<S>>& device, const Vector3<S>& p) {
        static_assert(noexcept(hand.reset_to(p))&& noexcept(hand.set_target(p, p))&& noexcept(hand.advance(p, S(1))));
        static_assert(noexcept(hand.position())&& noexcept(hand.velocity()));
        static_assert(noexcept(device.running())&& noexcept(device.read())&& noexcept(device.write(p)));
    });
    static_cast<void>([](MovedPoints<S>& moved, Latest<Tool<S>>& pose, std::span<const Index> vertices,
                         const ConstPointsRef<S>& x, const Triangles& triangles, const Tool<S>& tool) {
        static_assert(noexcept(moved.publish(vertices, x, 0.0))&& noexcept(moved.read()));
        static_assert(noexcept(moved.publish_all(x, 0.0))&& noexcept(moved.publish_all(x, triangles, 0.0)));
        static_assert(noexcept(pose.publish(tool, 0.0))&& noexcept(pose.read())&& noexcept(pose.read().age(0.0)));
    });
    SUCCEED();
}
