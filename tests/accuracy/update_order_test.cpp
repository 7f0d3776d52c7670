// SPDX-License-Identifier: MIT The default order updates several vertices at once, and not nearest to the contact first
// within a layer as [Liu07] has it: is the force any worse for it, where a tool presses and slides, and where forceps
// hold one triangle and layers decide?
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <membrane/accuracy/trial.hpp>
#include <membrane/membrane.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"

using namespace membrane;

namespace {

constexpr double ball = 0.01, tick = 1e-3;  // [m], [s]

Vector3<double> start() { return Vector3<double>(0.3, 0.2, 0.93).normalized(); }

/// A tool of 2 mm, 1 mm deep after 30 ticks, slides on at 50 mm/s.
std::vector<Tool<double>> press() {
    constexpr double radius = 2e-3, depth = 1e-3, speed = 0.05;
    const Vector3<double> along = Vector3<double>(0, 0.93, -0.2).normalized();
    std::vector<Tool<double>> tools;
    for (Index t = 1; t <= 90; ++t) {
        const double angle = speed * tick * std::max<Index>(t - 30, 0) / ball;
        const double from_centre = ball + radius - depth * std::min<Index>(t, 30) / 30;
        const Vector3<double> out = Vector3<double>(std::cos(angle) * start() + std::sin(angle) * along).normalized();
        tools.push_back({.position = from_centre * out, .radius = radius});
    }
    return tools;
}

/// Forceps draw the surface out by 1.5 mm within 30 ticks, and go along at 25 mm/s.
std::vector<Tool<double>> pull() {
    constexpr double tip = 5e-4, out = 1.5e-3, speed = 0.025;
    const Vector3<double> along = Vector3<double>(0, 0.93, -0.2).normalized();
    std::vector<Tool<double>> tools;
    for (Index t = 1; t <= 90; ++t) {
        const double from_centre = ball + out * std::min<Index>(t, 30) / 30;
        const double displacement = speed * tick * std::max<Index>(t - 30, 0);
        tools.push_back({.position = from_centre * start() + displacement * along, .radius = tip, .grasping = true});
    }
    return tools;
}

}  // namespace

TEST_CASE("the default order of updates costs no accuracy, in press and pull, at every size", "[order]") {
    for (Index subdivisions = 2; subdivisions <= std::clamp(cases(3, 4), 2, 4); ++subdivisions) {
        const auto mesh = icosphere<double>({.radius = ball, .subdivisions = subdivisions});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0});
        for (const bool pulls : {false, true}) {
            const ToolTrajectory<double> stroke(mesh, pulls ? pull() : press(), tick);
            const auto references = equilibria(mesh, network, foundation, stroke, 6);
            REQUIRE(references.size() == 15);
            const auto error = [&](UpdateOrder order, Index layers, Index sweeps) {
                const SolverOptions<double> options{.layers = layers, .sweeps = sweeps, .order = order};
                return run_trial(mesh, network, foundation, stroke, references, options).force_error;
            };
            for (const auto& [layers, sweeps] : {std::pair<Index, Index>{6, 2}, {3, 1}, {6, 8}}) {
                CAPTURE(mesh.vertex_count(), pulls, layers, sweeps);
                const double by_default = error(SolverOptions<double>().order, layers, sweeps),
                             by_arrival = error(UpdateOrder::breadth_first, layers, sweeps);
                CHECK(by_default <= 1.1 * by_arrival + 1e-4);  // of the force: a hundredth of a percent is nothing
            }
        }
    }
}
