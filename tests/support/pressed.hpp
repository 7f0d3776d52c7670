// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/random.hpp"

/// Membranes in contact that are not at rest, for what says how far off they are.
///
///     test::Pressed membrane(seed, 2, 1.0);
///     membrane.press_somewhere(0.1);
///     const auto rest = membrane.rest_from(membrane.x);
namespace test {

/// A sphere of radius 1 with springs of 1 N/m, into which a tool is pressed by a solver that is given little time.
struct Pressed {
    Pressed(std::uint64_t seed, membrane::Index subdivisions, double foundation_stiffness, double fine_triangles = 0)
        : random(seed),
          mesh(membrane::icosphere({.radius = 1, .subdivisions = subdivisions})),
          foundation(mesh, {.stiffness = foundation_stiffness}),
          fine_triangles(fine_triangles) {
        edge = 2.0 / (1 << subdivisions) * 0.6;
    }

    /// By a sphere, or by the side and the end of a capsule, of one to four edges.
    void press_somewhere(double deep) {
        const membrane::Vector3<double> outward = random.unit_vector();
        tool.radius = edge * std::pow(4, random.number());
        if (random.chance(0.3)) tool.axis = 0.5 * (outward + 0.5 * random.vector());
        const membrane::SolverOptions<double> options{.layers = 1 + random.index(12), .sweeps = 1 + random.index(6)};
        press_at(outward, deep, options, 10 + random.index(20));
    }

    void press_at(const membrane::Vector3<double>& outward, double deep, const membrane::SolverOptions<double>& options,
                  membrane::Index ticks) {
        membrane::QuasiStaticSolver solver(network, options);
        membrane::AabbTree<double> tree(mesh);
        membrane::ContactTracker<double> tracker(mesh, {.fine_triangles = fine_triangles});
        for (membrane::Index tick = 0; tick <= ticks; ++tick) {
            const double part = std::min(1.5 * tick / ticks, 1.0);
            tool.position = (1 + tool.radius + 0.05 - (0.05 + deep) * part) * outward;
            tool.time = 1e-3 * tick;
            contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, 1e-3, network, foundation, membrane::press(tool, contact));
            tree.refit(x, report.moved);
            force = report.reactions[0];
        }
        touched.assign(contact.patch.triangles.begin(), contact.patch.triangles.end());
        candidates.assign(contact.patch.candidates.begin(), contact.patch.candidates.end());
        points.assign(contact.patch.points.begin(), contact.patch.points.end());
        faces.assign(contact.patch.faces.begin(), contact.patch.faces.end());
        contact.patch.points = points;
        contact.patch.triangles = touched;
        contact.patch.candidates = candidates;
        contact.patch.faces = faces;
    }

    [[nodiscard]] membrane::Equilibrium rest_from(const membrane::Points<double>& start) const {
        return membrane::equilibrium(start, mesh, network, foundation, {}, membrane::press(tool, contact));
    }

    Random random;
    membrane::TriangleMesh<double> mesh;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network{
        mesh, membrane::LinearSpring{}, membrane::NetworkOptions<double>{.stiffness = 1.0}};
    membrane::VirtualVolumeSprings<double> foundation;
    double edge, fine_triangles;
    membrane::Tool<double> tool;
    membrane::Contact<double> contact;
    std::vector<membrane::ContactTriangle> touched, candidates, faces;
    std::vector<membrane::ContactPoint<double>> points;
    membrane::Points<double> x = mesh.positions();
    membrane::Vector3<double> force = membrane::Vector3<double>::Zero();
};

}  // namespace test
