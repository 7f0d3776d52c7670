// SPDX-License-Identifier: MIT
#include <membrane/coarse/coarse_correction.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/replay/initial_state.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/mesh_checks.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/vertex_forces.hpp"
#include "support/wild_tear.hpp"

using namespace membrane;

namespace {

/// A stretched capsule of 5 mm, held at its rim, in which half a circle is cut.
struct CutCapsule {
    CutCapsule()
        : mesh(with_reserve(disc<double>({.radius = 0.005, .rings = 16}), 40)),
          tissue(TearableSprings(mesh,
                                 MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 0.0, .pinned = border(mesh)})),
                 triangular_springs(mesh, materials::lens_capsule().typical, 1.01),
                 bending_springs(mesh, 30 * flexural_rigidity(materials::lens_capsule().typical))),
          coarse(mesh, tissue, NoFoundation(), {.points = 60}),
          solver(tissue),
          tear(mesh, EnergyRelease{.toughness = 1e6, .thickness = 1e-5}),
          x(mesh.positions()) {}

    void cut() {
        for (const auto& event : tear.cut_along(half_circle(), x)) follow(event, tissue, solver, coarse);
    }
    [[nodiscard]] std::vector<Index> half_circle() const {
        const double radius = 2e-3, edge = 0.005 / 16;
        const auto error_at = [&](Index v, double angle) {
            return norm<double>(point(mesh.positions(), v) -
                                radius * Vector3<double>(std::cos(angle), std::sin(angle), 0));
        };
        std::vector<Index> path;
        for (double angle = 0; angle < std::numbers::pi; angle += edge / radius) {
            Index best = path.empty() ? 0 : path.back();
            for (Index v = 0; v < mesh.vertex_count() - 40; ++v) {
                const auto next_to = [&](const auto& end) { return end.other == v; };
                const auto around = tissue.neighbours(best);
                if (!path.empty() && std::none_of(around.begin(), around.end(), next_to)) continue;
                if (error_at(v, angle) < error_at(best, angle)) best = v;
            }
            if (path.empty() || best != path.back()) path.push_back(best);
        }
        return path;
    }
    /// Draws the flap at its middle, up and away from its hinge. Returns the last force.
    Vector3<double> draw(int ticks, bool corrects, bool wakes, int from = 1) {
        Vector3<double> force = Vector3<double>::Zero();
        for (int tick = from; tick < from + ticks; ++tick) {
            const auto report = solver.step(x, 1e-3, tissue, NoFoundation(), forceps(tick));
            REQUIRE(report.status == StepStatus::advanced);
            force = report.reactions[0];
            if (!corrects) continue;
            const auto corrected = coarse.correct(x, solver);
            if (wakes) solver.wake(corrected.unbalanced);
        }
        return force;
    }
    [[nodiscard]] PointAttachment<double> forceps(int tick) const {
        Index held = 0;
        const auto middle = [&](Index f) {
            return point_at(triangle_at(mesh.positions(), mesh.triangles().col(f)), Vector3<double>::Constant(1.0 / 3));
        };
        const Vector3<double> place(0, 1.7e-3, 0);
        for (Index f = 1; f < mesh.triangle_count(); ++f) {
            if (norm<double>(middle(f) - place) < norm<double>(middle(held) - place)) held = f;
        }
        const double distance = (std::min)(tick, 200) * 5e-6;
        return {held, tear.surface().corners(held), Vector3<double>::Constant(1.0 / 3),
                middle(held) + distance * Vector3<double>(0, 0.6, 0.8)};
    }

    TriangleMesh<double> mesh;
    decltype(Tissue(TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 0.0})),
                    triangular_springs(mesh, Material()), bending_springs(mesh, 1.0))) tissue;
    CoarseCorrection<double> coarse;
    QuasiStaticSolver<double> solver;
    Tearing<double> tear;
    Points<double> x;
};

}  // namespace

TEST_CASE("forceps that draw a flap feel the force of its equilibrium", "[coarse][tear]") {
    // The part of the force that is wrong after a stroke, against steps of all layers from there until nothing moves.
    const auto error_of = [](bool corrects, bool wakes) {
        CutCapsule capsule;
        capsule.cut();
        REQUIRE(capsule.solver.splits() > 10);
        const Vector3<double> force = capsule.draw(250, corrects, wakes);
        QuasiStaticSolver all(capsule.tissue, {.layers = unlimited, .sweeps = 100, .relative_tolerance = 1e-6});
        StepReport<double> report;
        for (int i = 0; i < 500 && !report.converged; ++i) {
            all.wake_all();
            report = all.step(capsule.x, 1e-3, capsule.tissue, NoFoundation(), capsule.forceps(250));
        }
        REQUIRE(report.converged);
        return norm<double>(force - report.reactions[0]) / norm(report.reactions[0]);
    };
    CHECK(error_of(false, false) > 0.5);
    CHECK(error_of(true, false) < 0.01);
    CHECK(error_of(true, true) < 0.001);
}

TEST_CASE("a corrected membrane that was torn is whole again after a reset, to the bit", "[coarse][tear][snapshot]") {
    CutCapsule capsule;
    const InitialState whole(capsule.tear, capsule.tissue, capsule.solver, capsule.coarse, capsule.x);
    const auto run = [&] {
        (void)capsule.draw(20, true, true);
        capsule.cut();
        (void)capsule.draw(20, true, true);
        return Points<double>(capsule.x);
    };
    const auto first = run();
    REQUIRE(whole.reset(capsule.tear, capsule.tissue, capsule.solver, capsule.coarse, capsule.x));
    CHECK(test::same_bits(first, run()));
}

TEST_CASE("a corrected membrane that is torn goes on from a snapshot, to the bit", "[coarse][tear][snapshot]") {
    CutCapsule capsule;
    capsule.cut();
    (void)capsule.draw(190, true, false);
    for (int saved = 0; saved < 20; ++saved) {  // it is drawn, then stands still
        CAPTURE(saved);
        const InitialState now(capsule.tear, capsule.tissue, capsule.solver, capsule.coarse, capsule.x);
        const auto run = [&] {
            (void)capsule.draw(4, true, false, 191 + 4 * saved);
            return Points<double>(capsule.x);
        };
        const auto first = run();
        REQUIRE(now.reset(capsule.tear, capsule.tissue, capsule.solver, capsule.coarse, capsule.x));
        CHECK(test::same_bits(first, run()));
    }
}

TEST_CASE("a corrected membrane that was peeled adheres again after a reset, to the bit", "[coarse][snapshot]") {
    const auto mesh = disc<double>({.radius = 0.005, .rings = 8});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 20.0, .pinned = border(mesh)});
    CohesiveSprings<double> adhesion(mesh, {.stiffness = 1e7, .strength = 100.0, .energy = 2e-3});
    CoarseCorrection coarse(mesh, network, adhesion, {.points = 20});
    QuasiStaticSolver solver(network, {.layers = 2});
    Points<double> x = mesh.positions();
    std::vector<Index> all;
    for (Index v = 0; v < mesh.vertex_count(); ++v) all.push_back(v);
    const InitialState whole(adhesion, solver, coarse, x);
    const auto run = [&] {
        for (int tick = 1; tick <= 60; ++tick) {
            (void)solver.step(x, 1e-3, network, adhesion, pull(Index(0), Vector3<double>(0, 0, 1e-5 * tick)));
            (void)coarse.correct(x, solver);
            adhesion.update(x, all);
            coarse.update();
        }
        return Points<double>(x);
    };
    const auto first = run();
    CHECK(adhesion.dissipated() > 0);
    REQUIRE(whole.reset(adhesion, solver, coarse, x));
    CHECK(test::same_bits(first, run()));
}

TEST_CASE("a correction that has missed a split moves nothing", "[coarse][tear]") {
    CutCapsule capsule;
    for (const auto& event : capsule.tear.cut_along(capsule.half_circle(), capsule.x))
        follow(event, capsule.tissue, capsule.solver);
    const auto report = capsule.solver.step(capsule.x, 1e-3, capsule.tissue, NoFoundation(), capsule.forceps(20));
    REQUIRE(report.status == StepStatus::advanced);
    const Points<double> before = capsule.x;
    const auto corrected = capsule.coarse.correct(capsule.x, capsule.solver);
    CHECK(!corrected.corrected);
    CHECK(corrected.unbalanced.empty());
    CHECK(std::isnan(corrected.reaction_error[0]));
    CHECK(std::isnan(capsule.coarse.reaction_error(capsule.x, capsule.solver)[0]));
    CHECK(test::same_bits(before, capsule.x));
    const TriangleMesh<double> torn(capsule.tear.surface().rest_positions(), capsule.tear.surface().triangles());
    CoarseCorrection anew(torn, capsule.tissue, NoFoundation(), {.points = 60});
    CHECK(anew.correct(capsule.x, capsule.solver).corrected);
}

TEMPLATE_TEST_CASE("random tears: a correction knows all elements, as the network has them", "[coarse][tear]", double,
                   float) {
    using S = TestType;
    int splits = 0, corrections = 0;
    for (int seed = 1; seed <= cases(6, 200); ++seed) {
        CAPTURE(seed);
        test::WildTear<S> loop(static_cast<std::uint64_t>(seed));
        const auto with_foundation = [&](const auto& act) { loop.adheres ? act(loop.adhesion) : act(loop.foundation); };
        with_foundation([&](const auto& foundation) {
            CoarseCorrection<S> coarse(loop.mesh, loop.sheet, foundation,
                                       {.points = 10 + 10 * (seed % 4), .tolerance = 0.01 * (seed % 3)});
            const auto kinds = element_forces(loop.sheet, foundation);
            loop.follow_too = [&](const auto& event) { follow(event, coarse); };
            for (int tick = 0; tick < 200; ++tick) {
                (void)loop.tick([&](const auto&, const auto& step, S) {
                    if (step.status == StepStatus::advanced && coarse.correct(loop.x, loop.solver).corrected)
                        ++corrections;
                });
                if (loop.adheres) coarse.update();
                loop.tree.refit(loop.x);
                loop.normals.update(loop.x);
                REQUIRE(loop.x.allFinite());
                if (tick % 10 != 9) continue;
                for (const auto& kind : kinds) kind->update();
                test::check_forces<S>(kinds, loop.x, loop.sheet, foundation, sizeof(S) == 4 ? S(1e-4) : S(1e-12));
            }
            splits += loop.splits;
        });
    }
    CHECK(splits > 10);
    CHECK(corrections > 100);
}
