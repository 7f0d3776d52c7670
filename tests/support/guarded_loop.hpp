// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>

#include "support/bits.hpp"
#include "support/catch.hpp"
#include "support/traps.hpp"

namespace test {

/// A user's loop whose every tick must come to a safe outcome, with floating-point traps around the library: either all
/// numbers are finite, or the step is refused by name and the positions are bit for bit as they were.
///
///     test::GuardedLoop<double> loop(mesh, {.stiffness = 40.0}, {.stiffness = 8.0});
///     const auto report = loop.tick(tool, membrane::pull(3, target));
template <membrane::Real S, class Rule = membrane::BlockStep>
struct GuardedLoop {
    GuardedLoop(const membrane::TriangleMesh<S>& surface, const membrane::NetworkOptions<S>& springs,
                const membrane::VolumeSpringOptions<S>& volume, const membrane::SolverOptions<S>& options = {},
                const Rule& rule = {})
        : mesh(surface), network(mesh, {}, springs), foundation(mesh, volume), solver(network, options, rule) {}

    /// Tool, step and boxes.
    template <class... Constraints>
    membrane::StepReport<S> tick(const membrane::Tool<S>& tool, const Constraints&... constraints) {
        const membrane::Points<S> before = x;
        membrane::StepReport<S> report;
        {
            const FloatingPointTraps armed(traps);
            contact = tracker.update(tree, x, tool);
            report = solver.step(x, dt, network, foundation, membrane::press(tool, contact), constraints...);
            tree.refit(x, report.moved);
        }
        check(report, before);
        return report;
    }

    /// A step without a tool.
    template <class... Constraints>
    membrane::StepReport<S> step(const Constraints&... constraints) {
        const membrane::Points<S> before = x;
        membrane::StepReport<S> report;
        {
            const FloatingPointTraps armed(traps);
            report = solver.step(x, dt, network, foundation, constraints...);
            tree.refit(x, report.moved);
        }
        check(report, before);
        return report;
    }

    membrane::TriangleMesh<S> mesh;
    membrane::MassSpringNetwork<S, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<S> foundation;
    membrane::QuasiStaticSolver<S, Rule> solver;
    membrane::AabbTree<S> tree{mesh};
    membrane::ContactTracker<S> tracker{mesh};
    membrane::Points<S> x = mesh.positions();
    membrane::Contact<S> contact;
    S dt = S(1e-3);
    int traps = FloatingPointTraps::all;

  private:
    void check(const membrane::StepReport<S>& report, const membrane::Points<S>& before) const {
        REQUIRE(membrane::is_finite(x));
        REQUIRE(membrane::is_finite(report.residual));
        for (const auto& reaction : report.reactions) REQUIRE(membrane::is_finite(reaction));
        if (report.status == membrane::StepStatus::advanced) return;
        REQUIRE(report.moved.empty());
        REQUIRE(same_bits(x, before));
    }
};

}  // namespace test
