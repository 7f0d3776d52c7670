// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/fluid.hpp"
#include "support/loop_options.hpp"
#include "support/peel_scene.hpp"

/// The loop of a peel, for a hand of any kind.
namespace examples {

// Assumed, not measured: E is that of the lens capsule [Fisher69], which is a basement membrane too, and the Poisson
// ratio that of springs. Thickness and energy are plausible.
const membrane::Material ilm{.young_modulus = membrane::materials::lens_capsule().typical.young_modulus,
                             .poisson_ratio = 1.0 / 3,
                             .thickness = 2e-6};
constexpr double peel_energy = 0.05;  // [J/m^2]

/// Adhesion but for the flap. The strength is the largest that the edges resolve.
[[nodiscard]] inline membrane::CohesiveSprings<double> adhesion_of(const PeelScene& scene) {
    const double strength = peel_energy / (3 * mean_edge(scene.mesh));
    std::vector<double> strengths;
    for (membrane::Index v = 0; v < scene.mesh.vertex_count(); ++v)
        strengths.push_back(scene.in_flap(v) ? 0 : strength);
    const double stiffness = 10 * strength * strength / peel_energy;  // damage begins at a 20th of the failure opening
    return {scene.mesh, {.stiffness = stiffness, .strength = strengths, .energy = peel_energy}};
}

/// A membrane that adheres, under forceps.
class Peeling {
  public:
    /// With 8 sweeps a tick takes less than 1 ms.
    explicit Peeling(const PeelScene& scene, const LoopOptions& options = {})
        : scene_(scene),
          network_(scene.mesh, membrane::LinearSpring{}, {.stiffness = membrane::spring_stiffnesses(scene.mesh, ilm)}),
          adhesion_(adhesion_of(scene)),
          options_(options),
          solver_(network_, {.layers = membrane::unlimited, .sweeps = options.sweeps}),
          tree_(scene.mesh),
          tracker_(scene.mesh),
          grasper_(scene.mesh, {.snap_to_vertex = true}),
          x_(scene.mesh.positions()),
          fluid_(options.drag, x_.cols()) {}

    /// What the forceps hold of the membrane.
    [[nodiscard]] membrane::Grasp<double> grasp(const membrane::Tool<double>& tool) {
        const auto contact = tracker_.update(tree_, x_, tool);
        return grasper_.update(contact, x_, tool);
    }

    /// One tick, with a constraint that holds the membrane.
    template <class Held>
    auto step(const Held& held) {
        const auto report = fluid_.step(solver_, x_, options_.tick, network_, adhesion_, held);
        adhesion_.update(x_, report.moved);
        tree_.refit(x_, report.moved);
        return report;
    }

    [[nodiscard]] const membrane::Points<double>& x() const { return x_; }

    ///@{
    /// Energy in membrane and adhesion; that the damage has taken; that a fluid has taken [J]. Area beyond the flap
    /// that has let go [m^2].
    [[nodiscard]] double stored() const {
        double sum = network_.energy(x_);
        for (membrane::Index v = 0; v < scene_.mesh.vertex_count(); ++v) sum += adhesion_.energy(v, x_.col(v));
        return sum;
    }
    [[nodiscard]] double dissipated() const { return adhesion_.dissipated(); }
    [[nodiscard]] double damped() const { return fluid_.taken(); }
    [[nodiscard]] double area() const {
        const auto areas = membrane::vertex_areas(scene_.mesh);
        double sum = 0;
        for (membrane::Index v = 0; v < scene_.mesh.vertex_count(); ++v) {
            if (!scene_.in_flap(v) && !adhesion_.adheres(v)) sum += areas[static_cast<std::size_t>(v)];
        }
        return sum;
    }
    ///@}

  private:
    PeelScene scene_;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network_;
    membrane::CohesiveSprings<double> adhesion_;
    LoopOptions options_;
    membrane::QuasiStaticSolver<double> solver_;
    membrane::AabbTree<double> tree_;
    membrane::ContactTracker<double> tracker_;
    membrane::Grasper<double> grasper_;
    membrane::Points<double> x_;  // [m]
    Fluid<double> fluid_;
};

}  // namespace examples
