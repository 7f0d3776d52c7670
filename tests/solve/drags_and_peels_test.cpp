// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

/// A membrane that adheres, a tool with friction, forceps that slip, a body that moves: with any options together.
template <Real S>
struct Loop {
    Random random;
    double fine_triangles;  // contact by faces, by vertices, by both
    bool closed = random.chance(0.5), body_moves = random.chance(0.3);
    TriangleMesh<S> mesh = closed ? icosphere<S>({.radius = S(5e-3), .subdivisions = 2})
                                  : disc<S>({.radius = S(5e-3), .rings = random.index(4) + 4});
    Material material{.young_modulus = random.number(1e5, 5e6), .poisson_ratio = 1.0 / 3, .thickness = 20e-6};
    MassSpringNetwork<S, LinearSpring> network{
        mesh,
        LinearSpring{},
        {.stiffness = spring_stiffnesses(mesh, material),
         .pinned = closed || random.chance(0.5) ? std::vector<Index>{} : border(mesh)}};
    double strength = random.number(100.0, 3e3), energy = random.number(0.01, 0.2);
    CohesiveSprings<S> adhesion{mesh,
                                {.stiffness = S(strength * strength / energy * random.number(0.6, 50.0)),
                                 .strength = strengths(),
                                 .energy = S(energy),
                                 .tangential_strength = S(strength * random.number(0.5, 2.0)),
                                 .tangential_energy = S(energy * random.number(0.5, 2.0))}};
    QuasiStaticSolver<S> solver{network, options()};
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker{mesh, {.fine_triangles = fine_triangles}};
    Grasper<S> grasper{mesh,
                       {.snap_to_vertex = random.chance(0.3),
                        .holding_force = random.number(1e-3, 0.1),
                        .jaw_length = random.number(0.1e-3, 3e-3)}};
    double coefficient = random.number(0.0, 1.5);
    ToolFriction<S> friction{{.coefficient = coefficient}};
    MovingBody<S> body{mesh};
    Points<S> x = mesh.positions();
    Tool<S> tool{.position = {S(0), S(0), S(8e-3)},
                 .axis = random.chance(0.3) ? Vector3<S>(S(2e-3) * random.unit_vector<S>()) : Vector3<S>(0, 0, 0),
                 .radius = random.chance(0.2) ? S(0) : random.number<S>(S(0.2e-3), S(2e-3))};
    double dissipated = 0;

    explicit Loop(int seed)
        : random(static_cast<std::uint64_t>(seed)),
          fine_triangles(std::array{0.0, 1.0, 0.3, 0.5}[static_cast<std::size_t>(seed % 4)]) {}

    std::vector<S> strengths() {
        std::vector<S> each(static_cast<std::size_t>(mesh.vertex_count()), S(strength));
        for (S& s : each) s = random.chance(0.2) ? S(0) : s;
        return each;
    }
    SolverOptions<S> options() {
        SolverOptions<S> with{.layers = random.chance(0.5) ? random.index(8) : unlimited,
                              .sweeps = random.index(4) + 1};
        with.adaptive_layers = random.chance(0.2);
        with.contact_iterations = random.index(4) + 1;
        with.order = random.chance(0.2) ? UpdateOrder::breadth_first : UpdateOrder::colour_layers;
        with.predict = random.chance(0.7);
        if (random.chance(0.2)) with.max_vertex_updates = random.index(300) + 1;
        return with;
    }

    /// Where the hand goes next; one in ten is nonsense.
    void move_hand() {
        const S nan = std::numeric_limits<S>::quiet_NaN();
        if (!is_finite(tool.position) || norm(tool.position) > S(0.02)) tool.position = {S(0), S(0), S(8e-3)};
        const Vector3<S> to_middle = direction_or_zero<S>(-tool.position);
        tool.position += S(2e-5) * random.vector<S>() + S(1e-5) * (tool.grasping ? -to_middle : to_middle);
        if (random.chance(0.02)) tool.grasping = !tool.grasping;
        if (!random.chance(0.1)) return;
        switch (random.index(4)) {
            case 0: tool.position[0] = nan; break;
            case 1: tool.position = S(1e30) * random.unit_vector<S>(); break;
            case 2: tool.position = S(6e-3) * random.unit_vector<S>(); break;  // a jump
            default: tool.position += S(1e-3) * random.vector<S>();
        }
    }

    void tick() {
        move_hand();
        if (body_moves && random.chance(0.2)) {
            body_angle += S(0.01);
            const S c = std::cos(body_angle), s = std::sin(body_angle);
            RigidFrame<S> pose;
            pose.rotation << c, -s, 0, s, c, 0, 0, 0, 1;
            pose.origin = {body_angle * S(1e-3), 0, 0};
            if (body.move_to(pose, x)) tree.refit(x);
        }
        const auto contact = body_moves ? tracker.update(tree, x, tool, body) : tracker.update(tree, x, tool);
        const auto grasp = body_moves ? grasper.update(contact, x, tool, body) : grasper.update(contact, x, tool);
        const Points<S> before = x;
        const auto press = friction.press(tool, contact, grasp);
        const auto held = pull(tool, grasp);
        const S dt = random.chance(0.02) ? S(0) : S(1e-3);
        const auto report = body_moves ? solver.step(x, dt, network, on(body, adhesion), press, held)
                                       : solver.step(x, dt, network, adhesion, press, held);
        if (report.status != StepStatus::advanced) {
            REQUIRE(test::same_bits(x, before));
            return;
        }
        body_moves ? adhesion.update(body, x, report.moved) : adhesion.update(x, report.moved);
        grasper.slip(x, tool, report.reactions[1]);
        tree.refit(x, report.moved);
        check(report);
    }
    void check(const StepReport<S>& report) {
        REQUIRE(x.allFinite());
        for (const auto& reaction : report.reactions) REQUIRE(is_finite(reaction));
        REQUIRE(std::isfinite(adhesion.dissipated()));
        REQUIRE(adhesion.dissipated() >= dissipated);
        dissipated = adhesion.dissipated();
        const S rounding = 1000 * std::numeric_limits<S>::epsilon();
        for (const auto& v : friction.vertices()) {
            REQUIRE(norm(v.force) <= (1 + rounding) * S(coefficient) * norm(v.normal_force));
        }
    }
    [[nodiscard]] std::vector<std::byte> saved() {
        std::vector<std::byte> buffer(
            snapshot_capacity(solver, tracker, grasper, friction, adhesion, body, tool, body_angle, dissipated, x));
        buffer.resize(
            save_snapshot(buffer, solver, tracker, grasper, friction, adhesion, body, tool, body_angle, dissipated, x));
        return buffer;
    }
    void restore(const std::vector<std::byte>& buffer) {
        REQUIRE(restore_snapshot({buffer.data(), buffer.size()}, solver, tracker, grasper, friction, adhesion, body,
                                 tool, body_angle, dissipated, x));
        tree.refit(x);
    }

    S body_angle = 0;
};

}  // namespace

TEMPLATE_TEST_CASE(
    "random drags and peels, with nonsense among them, keep positions finite and forces in their cones, "
    "and replay to the bit",
    "[cohesion][friction]", TEST_SCALARS) {
    int let_go = 0, held = 0, slipped = 0;
    for (int seed = 1; seed <= cases(20, 2000); ++seed) {
        CAPTURE(seed);
        Loop<TestType> loop(seed);
        const int ticks = cases_are_slow ? 100 : 500;
        std::vector<std::byte> middle;
        Random random_in_middle(0);
        for (int i = 0; i < ticks; ++i) {
            if (i == ticks / 2) middle = loop.saved(), random_in_middle = loop.random;
            loop.tick();
            held += loop.tool.grasping;
            slipped += loop.friction.slips();
        }
        for (Index v = 0; v < loop.mesh.vertex_count(); ++v) let_go += loop.adhesion.damage(v) == 1;
        const Points<TestType> end = loop.x;
        loop.restore(middle);
        loop.random = random_in_middle;
        for (int i = ticks / 2; i < ticks; ++i) loop.tick();
        REQUIRE(test::same_bits(loop.x, end));
    }
    if (cases_are_slow) return;  // one short loop
    CHECK(let_go > 0);
    CHECK(held > 0);
    CHECK(slipped > 0);
}
