// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cstdint>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

// What the report says of the vertices beyond the layers, against the forces on all vertices.

using namespace membrane;
using test::Random;

namespace {

constexpr double radius = 0.01, dt = 1e-3;  // [m], [s]

/// Sums over a membrane at rest, by the force on each vertex.
struct Forces {
    double largest_beyond = 0;                           // on a free vertex beside the queue [N]
    Vector3<double> beyond = Vector3<double>::Zero();    // the sum of these [N]
    Vector3<double> supports = Vector3<double>::Zero();  // of pins and foundation on the membrane [N]

    template <class Network, class Volume>
    Forces(const Points<double>& x, const Network& network, const Volume& volume, const PropagationQueue& queue) {
        for (Index v = 0; v < network.vertex_count(); ++v) {
            const Vector3<double> here = point(x, v), of_foundation = volume.force_on(v, here, here, dt).force;
            const Vector3<double> force = network.force_on(v, x).force + of_foundation;
            supports += network.pinned(v) ? Vector3<double>(of_foundation - force) : of_foundation;
            const auto near_queue = [&](const auto& end) { return queue.contains(end.other); };
            const auto around = network.neighbours(v);
            if (network.pinned(v) || queue.contains(v) || std::none_of(around.begin(), around.end(), near_queue))
                continue;
            largest_beyond = std::max(largest_beyond, norm(force));
            beyond += force;
        }
    }
};

/// Presses a ball into the top, or pulls the vertex there aside, from rest; checks each report.
template <class Network, class Volume>
StepReport<double> check(const TriangleMesh<double>& mesh, const Network& network, const Volume& volume, Index top,
                         const SolverOptions<double>& options, bool pulls) {
    QuasiStaticSolver<double> solver(network, options);
    AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh);
    Points<double> x = mesh.positions();
    StepReport<double> report;
    int compared = 0;
    for (int tick = 0; tick < 60 || (compared == 0 && !options.adaptive_layers && tick < 2000); ++tick) {
        const double part = std::min(1.0, tick / 20.0);
        const bool was_at_rest = report.converged && report.moved.empty();
        const Vector3<double> at = point(mesh.positions(), top);
        if (pulls) {
            const Vector3<double> target = at + part * Vector3<double>(0.4e-3, 0, 0.3e-3);
            report = solver.step(x, dt, network, volume, pull(top, target));
        } else {
            const Tool<double> tool{.position = at + Vector3<double>(0, 0, 1e-3 - 0.5e-3 * part), .radius = 1e-3};
            report = solver.step(x, dt, network, volume, press(tool, tracker.update(tree, x, tool)));
            tree.refit(x, report.moved);
        }
        REQUIRE(report.status == StepStatus::advanced);
        const Forces forces(x, network, volume, solver.queue());
        const double rounding = 100 * network.force_tolerance();
        if (solver.queue().vertices().empty()) continue;
        if (options.adaptive_layers) continue;  // the next layer is in the queue, but not updated
        // A ball that comes to touch other triangles leaves vertices that are updated until they are at rest.
        if (pulls || (was_at_rest && report.converged && report.moved.empty())) {
            ++compared;
            REQUIRE(report.residual_beyond == Approx(forces.largest_beyond).margin(rounding));
            REQUIRE(norm<double>(report.unsupported - forces.beyond) <= rounding);
        }
        // What the forceps do not give to the supports is out of balance, in the queue or beyond.
        if (!pulls) continue;
        const Vector3<double> lost = forces.supports - report.total_reaction();
        const double in_queue = static_cast<double>(solver.queue().vertices().size()) * report.residual;
        REQUIRE(norm<double>(lost - report.unsupported) <= in_queue + rounding);
    }
    CHECK((compared > 0 || options.adaptive_layers));
    return report;
}

/// Under a ball and under forceps, with these layers; the last reports.
template <class Network, class Volume>
void check_layers(const TriangleMesh<double>& mesh, const Network& network, const Volume& volume, Index top) {
    for (const bool pulls : {false, true}) {
        double before = 1e9;
        for (const Index layers : {0, 2, 6, unlimited}) {
            CAPTURE(pulls, layers);
            const auto report = check(mesh, network, volume, top, {.layers = layers, .sweeps = 8}, pulls);
            if (layers == unlimited) {
                CHECK(report.residual_beyond == 0);
                CHECK(report.unsupported == Vector3<double>::Zero());
            } else {
                CHECK(report.residual_beyond > 10 * network.force_tolerance());
            }
            if (layers > 0) CHECK(report.residual_beyond < before);
            before = report.residual_beyond;
            // Layers are added until the forces on the next one are below the tolerance, or the threshold is reached.
            const double enough = 1e-5;
            const auto adaptive =
                check(mesh, network, volume, top,
                      {.layers = layers, .adaptive_layers = true, .sweeps = 8, .force_tolerance = enough}, pulls);
            if (layers == unlimited) CHECK(adaptive.residual_beyond <= enough);
        }
    }
}

}  // namespace

TEST_CASE("the report has the forces that the layers leave out, on a capsule", "[beyond]") {
    const auto mesh = spherical_cap({.radius = radius, .diameter = 1.6 * radius, .rings = 10});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 40.0, .pinned = border(mesh)});
    const VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 2.0});
    check_layers(mesh, network, foundation, 0);
}

TEST_CASE("the report has the forces that the layers leave out, on a stretched disc without foundation", "[beyond]") {
    const auto mesh = disc({.radius = 5e-3, .rings = 10});
    const Material material{.young_modulus = 1e6, .poisson_ratio = 0.4, .thickness = 20e-6};
    const MassSpringNetwork<double, LinearSpring> rim(mesh, {}, {.stiffness = 0.0, .pinned = border(mesh)});
    const Tissue tissue(rim, triangular_springs(mesh, material, 1.02));
    check_layers(mesh, tissue, NoFoundation{}, 0);
}

TEST_CASE("the report has no force beyond if nothing acts, or if the step is refused", "[beyond]") {
    const auto mesh = icosphere({.radius = radius, .subdivisions = 2});
    const MassSpringNetwork<double, LinearSpring> network(mesh, {}, {.stiffness = 40.0});
    QuasiStaticSolver<double> solver(network, {.layers = 1});
    Points<double> x = mesh.positions();
    const auto pulled = solver.step(x, dt, network, NoFoundation{}, pull(3, Vector3<double>(1.1 * point(x, 3))));
    CHECK(pulled.residual_beyond > 0);
    const auto refused = solver.step(x, -dt, network, NoFoundation{});
    CHECK(refused.status == StepStatus::bad_time_step);
    CHECK(refused.residual_beyond == 0);
    CHECK(refused.unsupported == Vector3<double>::Zero());
    solver.reset();
    CHECK(solver.step(x, dt, network, NoFoundation{}).residual_beyond == 0);
}
