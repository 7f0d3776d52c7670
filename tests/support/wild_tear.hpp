// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <span>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tissue/foundation_layer.hpp>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/orders.hpp"
#include "support/random_tear.hpp"

/// A stretched disc on a foundation or adhering to its body, that is cut, pulled, grasped, pressed and dragged at
/// random.
///
///     test::WildTear<double> loop(seed);
///     for (int tick = 0; tick < 500; ++tick) loop.tick();
namespace test {

template <membrane::Real Scalar>
struct WildTear {
    using Index = membrane::Index;
    using Vector = membrane::Vector3<Scalar>;
    using Springs = membrane::TearableSprings<Scalar, membrane::LinearSpring>;
    using Sheet = membrane::Tissue<Springs, membrane::Elements<Scalar, membrane::TriangularSpring<Scalar>>>;
    using Report = membrane::StepReport<Scalar>;
    static constexpr Index reserve = 40;
    static constexpr membrane::Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};

    explicit WildTear(std::uint64_t seed)
        : random(seed),
          mesh(membrane::with_reserve(membrane::disc<Scalar>({.radius = 0.01, .rings = 8}), reserve)),
          rim(membrane::border(mesh)),
          sheet(Springs(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                          {.stiffness = Scalar(1), .pinned = rim})),
                membrane::triangular_springs(mesh, material)),
          adheres(random.chance(0.5)),
          foundation(mesh, {.normal = Scalar(0.5), .tangential = Scalar(0.1), .recovery_time = Scalar(0.05)}),
          adhesion(mesh, adhesion_options()),
          tear(mesh, membrane::EnergyRelease{.toughness = random.number(5.0, 100.0), .thickness = 1e-4},
               {.max_tips = 6, .move_vertices = random.chance(0.8)}),
          solver(sheet, options(static_cast<int>(seed))),
          tree(mesh),
          tracker(mesh, {.fine_triangles = std::array{0.0, 1.0, 0.3, 0.5}[seed % 4]}),  // faces, vertices, both
          grasper(mesh, {.snap_to_vertex = random.chance(0.3),
                         .holding_force = random.number(1e-3, 0.05),
                         .jaw_length = random.number(0.5e-3, 5e-3)}),
          coefficient(random.number(0.0, 1.5)),
          friction({.coefficient = coefficient}),
          normals(mesh),
          x(Scalar(random.number(1.0, 1.3)) * mesh.positions()),
          start(x),
          target(Vector(0, 0, 0)) {
        tree.refit(x);
        tool.axis = random.chance(0.3) ? Vector(Scalar(2e-3) * random.unit_vector<Scalar>()) : Vector(0, 0, 0);
        tool.radius = Scalar(random.chance(0.2) ? 0.0 : random.number(0.3e-3, 2e-3));
    }

    /// One tick. Whether the step advanced: its report's status. Calls `check(foundation, report, dt)` after the step,
    /// before the membrane tears.
    Report tick() {
        return tick([](const auto&...) {});
    }
    template <class Check>
    Report tick(const Check& check) {
        if (random.chance(0.02)) follow(cut_at_random(random, tear, x));
        if (random.chance(0.05)) held = random.index(mesh.vertex_count() - tear.surface().reserve()), target = at(held);
        target += random.template vector<Scalar>(Scalar(-2e-4), Scalar(2e-4));
        move_tool();
        Vector pulled = target;
        Scalar dt = Scalar(1e-3);
        if (random.chance(nonsense_chance)) nonsense(pulled, dt);
        const auto contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        grasps = grasp.holding();
        const auto corners = grasps ? tear.surface().corners(grasp.triangle) : grasp.corners;  // in any order
        grasps_surface = std::is_permutation(corners.begin(), corners.end(), grasp.corners.begin());
        const auto pressing = friction.press(tool, contact, grasp);
        const auto grasping = pull(tool, grasp);
        const auto pulling = membrane::pull(held, pulled);
        const auto ligaments = tear.ligaments();
        const auto step = [&](const auto& under) {
            if (deadline == 0) return solver.step(x, dt, sheet, under, pressing, grasping, pulling, ligaments);
            double time = 0;  // passes with each reading
            const membrane::Deadline until([&time] { return time += 1; }, deadline);
            return solver.step_until(until, x, dt, sheet, under, pressing, grasping, pulling, ligaments);
        };
        start = x;
        const Report report = adheres ? step(adhesion) : step(foundation);
        adheres ? check(adhesion, report, dt) : check(foundation, report, dt);
        if (report.status == membrane::StepStatus::advanced) {
            if (adheres) adhesion.update(x, report.moved);
            if (grasper.slip(x, tool, report.reactions[1])) ++slips;
            follow(adheres ? tear.update(x, dt, sheet, adhesion, grasp.corners)
                           : tear.update(x, dt, sheet, foundation, grasp.corners));
        }
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        return report;
    }

    /// Cuts until the reserve is too small for a cut.
    void use_up_reserve() {
        do follow(cut_at_random(random, tear, x));
        while (!tear.reserve_used_up());
    }

    /// Calls `act` with what a snapshot must hold.
    template <class Self, class Act>
    static auto with_state(Self& self, const Act& act) {
        return act(self.sheet, self.foundation, self.adhesion, self.tear, self.solver, self.tree, self.tracker,
                   self.grasper, self.friction, self.normals, self.x);
    }

    Random random;
    membrane::TriangleMesh<Scalar> mesh;
    std::vector<Index> rim;
    Sheet sheet;
    bool adheres, updates_all = true;  // whether a step updates all of its queue
    membrane::FoundationSprings<Scalar> foundation;
    membrane::CohesiveSprings<Scalar> adhesion;
    membrane::Tearing<Scalar> tear;
    membrane::QuasiStaticSolver<Scalar> solver;
    membrane::AabbTree<Scalar> tree;
    membrane::ContactTracker<Scalar> tracker;
    membrane::Grasper<Scalar> grasper;
    double coefficient;
    membrane::ToolFriction<Scalar> friction;
    membrane::VertexNormals<Scalar> normals;
    membrane::Points<Scalar> x, start;  // now, at the start of the last step
    membrane::Tool<Scalar> tool;
    Index held = 0;
    Vector target;
    double nonsense_chance = 0.1;  // of an input that no step takes
    double deadline = 0;           // of a step [readings of its clock]; 0: none
    int splits = 0, slips = 0;     // of vertices; of tissue through the jaws
    bool grasps = false,
         grasps_surface = true;  // whether the forceps hold a point; whether that is of the torn surface
    // Called for each event, after these parts have followed it.
    std::function<void(const membrane::TearEvent<Scalar>&)> follow_too;

  private:
    membrane::CohesionOptions<Scalar> adhesion_options() {
        const double strength = random.number(30.0, 1e3), energy = random.number(0.05, 0.5);
        return {.stiffness = Scalar(strength * strength / energy * random.number(0.6, 20.0)),
                .strength = Scalar(strength),
                .energy = Scalar(energy),
                .tangential_strength = Scalar(strength * random.number(0.5, 2.0)),
                .tangential_energy = Scalar(energy * random.number(0.5, 2.0))};
    }
    membrane::SolverOptions<Scalar> options(int seed) {
        membrane::SolverOptions<Scalar> with{.layers = random.chance(0.5) ? membrane::unlimited : random.index(8),
                                             .sweeps = 1 + random.index(4),
                                             .order = order_of(seed),
                                             .predict = random.chance(0.5)};
        with.adaptive_layers = random.chance(0.2);
        with.contact_iterations = random.index(4) + 1;
        if (random.chance(0.2)) with.max_vertex_updates = random.index(300) + 1;
        updates_all = !with.adaptive_layers && with.max_vertex_updates == membrane::unlimited;
        return with;
    }
    Vector at(Index v) const { return membrane::point(x, v); }

    // It jumps, or goes on a little, and opens and closes.
    void move_tool() {
        const Scalar far = Scalar(5e-3);
        if (!membrane::is_valid(tool) || !(norm(tool.position) < 4 * far) || random.chance(0.02)) {
            tool.position = random.template vector<Scalar>(-far, far);
            tool.position[2] = Scalar(2e-3);
        }
        const Scalar down = tool.grasping ? Scalar(3e-5) : Scalar(tool.position[2] > -far / 5 ? -1e-4 : 1e-3);
        tool.position += Scalar(1e-4) * random.template vector<Scalar>() + Vector(0, 0, down);
        if (random.chance(0.03)) tool.grasping = !tool.grasping;
    }
    void nonsense(Vector& pulled, Scalar& dt) {
        constexpr std::array<Scalar, 4> wild{std::numeric_limits<Scalar>::quiet_NaN(),
                                             std::numeric_limits<Scalar>::infinity(), Scalar(-1),
                                             std::numeric_limits<Scalar>::max()};
        const Scalar number = wild[static_cast<std::size_t>(random.index(4))];
        const Index kind = random.index(3);
        if (kind == 0) pulled[random.index(3)] = number;
        if (kind == 1) dt = number;
        if (kind == 2) tool.position[random.index(3)] = number;
    }
    void follow(std::span<const membrane::TearEvent<Scalar>> events) {
        for (const auto& event : events) {
            membrane::follow(event, sheet, foundation, adhesion, solver, tree, tracker, grasper, friction, normals);
            if (follow_too) follow_too(event);
            splits += event.split.vertex != membrane::no_index ? 1 : 0;
        }
    }
};

}  // namespace test
