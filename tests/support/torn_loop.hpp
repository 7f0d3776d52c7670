// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <tuple>

#include <membrane/haptics/force_limits.hpp>
#include <membrane/haptics/force_policy.hpp>
#include <membrane/haptics/handover.hpp>
#include <membrane/haptics/smooth_contact.hpp>
#include <membrane/membrane.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
#include "support/random.hpp"

/// A complete loop of a hand that tears a membrane off its body.
///
///     test::TearingHand<double> hand(seed);
///     test::TornLoop<double> loop;
///     const auto force = loop.tick(hand.next());
namespace test {

/// A hand that presses a disc at one place after the other and drags it; now and then its forceps close and draw up.
/// One in a hundred ticks is nonsense.
template <membrane::Real S>
class TearingHand {
  public:
    explicit TearingHand(std::uint64_t seed) : random_(seed) {}

    membrane::Tool<S> next() {
        const int t = tick_++ % stroke;
        if (t == 0) choose();
        const double down = std::min({t / 40.0, 1.0, (stroke - t) / 40.0}), drawn = std::max(0.0, t / 40.0 - 1);
        const double height = 1.2e-3 - down * (1.2e-3 + depth_) + (grasps_ ? 0.8e-3 * drawn * down : 0);
        const membrane::Vector3<double> place = from_ + 1.5e-3 * drawn * along_, position(place[0], place[1], height);
        membrane::Tool<S> tool{.position = position.template cast<S>(), .radius = S(1e-3)};
        tool.velocity = (1e3 * (position - last_)).template cast<S>();
        tool.time = static_cast<S>(tick_) * S(1e-3);
        tool.grasping = grasps_ && t >= 50 && t < stroke - 40;
        last_ = position;
        if (random_.chance(0.01)) tool.position[random_.index(3)] = std::numeric_limits<S>::quiet_NaN();
        return tool;
    }

  private:
    static constexpr int stroke = 200;

    void choose() {
        from_ = membrane::Vector3<double>(random_.number(-5e-3, 5e-3), random_.number(-5e-3, 5e-3), 0);
        along_ = membrane::Vector3<double>(random_.number(-1.0, 1.0), random_.number(-1.0, 1.0), 0);
        depth_ = random_.number(0.2e-3, 1e-3);
        grasps_ = random_.chance(0.9);
    }

    Random random_;
    membrane::Vector3<double> from_ = membrane::Vector3<double>::Zero(), along_ = from_, last_ = from_;
    double depth_ = 0;
    bool grasps_ = false;
    int tick_ = 0;
};

/// A stretched disc that adheres to its body, in a user's loop: forceps slit it where they close. All that happens is a
/// result of the tool. A drawing loop reads every 7th tick.
template <membrane::Real S>
struct TornLoop {
    using Springs = membrane::TearableSprings<S, membrane::LinearSpring>;
    using Sheet = membrane::Tissue<Springs, membrane::Elements<S, membrane::TriangularSpring<S>>>;
    static constexpr membrane::Material material{.young_modulus = 1e5, .poisson_ratio = 0.4, .thickness = 1e-4};

    /// One tick; returns the force on the hand.
    membrane::Vector3<S> tick(const membrane::Tool<S>& tool) {
        const auto contact = tracker.update(tree, x, tool);
        if (tool.grasping && !closed && contact.touching()) {
            follow(tear.cut_along(tear.slit_at(contact.corners[0], {tool.velocity[0], tool.velocity[1], 0}), x));
        }
        closed = tool.grasping;
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, S(1e-3), sheet, foundation, friction.press(tool, contact, grasp),
                                        pull(tool, grasp), tear.ligaments());
        foundation.update(x, report.moved);
        if (report.status == membrane::StepStatus::advanced) follow(tear.update(x, S(1e-3), sheet, foundation));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        moved.publish(report.moved, x, static_cast<double>(tool.time));
        if (++steps % 7 == 0) draw();
        const auto force = feel({tool, smooth(contact), report, grasp});
        return limit(force.template cast<double>(), static_cast<double>(tool.time), steps).template cast<S>();
    }

    void follow(std::span<const membrane::TearEvent<S>> events) {
        for (const auto& event : events) {
            membrane::follow(event, sheet, foundation, solver, tree, tracker, grasper, friction, normals, smooth,
                             moved);
            ++splits;
        }
    }

    /// What the drawing loop does.
    void draw() {
        const auto news = moved.read();
        for (const membrane::Index v : news.moved) shown.col(v) = news.x.col(v);
        for (const membrane::Index f : news.triangles) indices.col(f) = news.corners.col(f);
        drawn_right = drawn_right && same_bits(shown, x) && indices == tear.surface().triangles();
    }

    /// After a snapshot has been restored.
    void refresh() {
        tree.refit(x);
        normals.update(x);
        moved.publish_all(x, tear.surface().triangles(), 0);
    }

    /// What a snapshot holds: the tool is in the recording.
    auto parts() {
        return std::tie(sheet, foundation, tear, solver, tree, tracker, grasper, friction, normals, smooth, limit, x,
                        closed, steps, splits);
    }

    membrane::TriangleMesh<S> mesh = membrane::with_reserve(membrane::disc<S>({.radius = S(0.01), .rings = 8}), 80);
    Sheet sheet{Springs(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                          {.stiffness = S(1), .pinned = membrane::border(mesh)})),
                membrane::triangular_springs(mesh, material)};
    membrane::CohesiveSprings<S> foundation{mesh, {.stiffness = S(1e5), .strength = S(20), .energy = S(0.02)}};
    membrane::Tearing<S> tear{mesh, membrane::EnergyRelease{.toughness = 30, .thickness = material.thickness}};
    membrane::QuasiStaticSolver<S> solver{sheet, {.layers = 8, .sweeps = 2}};
    membrane::AabbTree<S> tree{mesh};
    membrane::ContactTracker<S> tracker{mesh};
    membrane::Grasper<S> grasper{mesh};
    membrane::ToolFriction<S> friction{{.coefficient = 0.3}};
    membrane::VertexNormals<S> normals{mesh};
    membrane::SmoothContact<S> smooth{mesh};
    membrane::MovedPoints<S> moved{mesh.vertex_count(), mesh.triangle_count()};
    membrane::ReactionForce feel{.scale = 2};
    membrane::ForceLimiter limit{membrane::devices::touch};
    membrane::Points<S> x = S(1.1) * mesh.positions();
    membrane::Points<S> shown = x;
    membrane::Triangles indices = mesh.triangles();
    bool drawn_right = true;
    bool closed = false;
    std::uint64_t steps = 0;
    int splits = 0;
};

}  // namespace test
