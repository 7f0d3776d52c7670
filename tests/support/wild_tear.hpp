// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <limits>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/foundation_layer.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/normals.hpp>

#include <membrane/model/tissue.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/orders.hpp"
#include "support/random_tear.hpp"

/// A stretched disc that is cut, pulled and pressed at random.
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
    static constexpr Index reserve = 40;
    static constexpr membrane::Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};

    explicit WildTear(std::uint64_t seed)
        : random(seed),
          mesh(membrane::with_reserve(membrane::disc<Scalar>({.radius = 0.01, .rings = 8}), reserve)),
          rim(membrane::border(mesh)),
          sheet(Springs(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                          {.stiffness = Scalar(1), .pinned = rim})),
                membrane::triangular_springs(mesh, material)),
          foundation(mesh, {.normal = Scalar(0.5), .tangential = Scalar(0.1), .recovery_time = Scalar(0.05)}),
          tear(mesh, membrane::EnergyRelease{.toughness = random.number(5.0, 100.0), .thickness = 1e-4},
               {.max_tips = 6, .move_vertices = random.chance(0.8)}),
          solver(sheet, {.layers = random.index(2) == 0 ? membrane::unlimited : 6,
                         .sweeps = 1 + random.index(4),
                         .order = order_of(static_cast<int>(seed)),
                         .predict = random.chance(0.5)}),
          tree(mesh),
          tracker(mesh),
          normals(mesh),
          x(Scalar(random.number(1.0, 1.3)) * mesh.positions()),
          target(Vector(0, 0, 0)) {}

    /// One tick; returns whether the step advanced.
    bool tick() {
        if (random.chance(0.02)) follow(cut_at_random(random, tear, x));
        if (random.chance(0.05)) held = random.index(mesh.vertex_count() - reserve), target = membrane::point(x, held);
        target += random.template vector<Scalar>(Scalar(-2e-4), Scalar(2e-4));
        Vector pulled = target;
        tool.position =
            Vector(Scalar(random.number(-5e-3, 5e-3)), Scalar(random.number(-5e-3, 5e-3)), tool.position[2]);
        tool.position[2] = Scalar(random.number(-1e-3, 2e-3));
        tool.radius = Scalar(1e-3);
        Scalar dt = Scalar(1e-3);
        if (random.chance(0.1)) nonsense(pulled, dt);
        const auto contact = tracker.update(tree, x, tool);
        const auto report =
            solver.step(x, dt, sheet, foundation, press(tool, contact), membrane::pull(held, pulled), tear.ligaments());
        const bool advanced = report.status == membrane::StepStatus::advanced;
        if (advanced) follow(tear.update(x, dt, sheet, foundation));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        return advanced;
    }

    /// Cuts until the reserve is too small for a cut.
    void use_up_reserve() {
        do follow(cut_at_random(random, tear, x));
        while (!tear.reserve_used_up());
    }

    std::array<Scalar, 2> state() const { return {x.sum(), static_cast<Scalar>(tear.torn_length())}; }

    Random random;
    membrane::TriangleMesh<Scalar> mesh;
    std::vector<Index> rim;
    Sheet sheet;
    membrane::FoundationSprings<Scalar> foundation;
    membrane::Tearing<Scalar> tear;
    membrane::QuasiStaticSolver<Scalar> solver;
    membrane::AabbTree<Scalar> tree;
    membrane::ContactTracker<Scalar> tracker;
    membrane::VertexNormals<Scalar> normals;
    membrane::Points<Scalar> x;
    membrane::Tool<Scalar> tool;
    Index held = 0;
    Vector target;
    int splits = 0;

  private:
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
            membrane::follow(event, sheet, foundation, solver, tree, tracker, normals);
            ++splits;
        }
    }
};

}  // namespace test
