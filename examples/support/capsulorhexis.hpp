// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <concepts>
#include <utility>

#include <membrane/membrane.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/fluid.hpp"
#include "support/loop_options.hpp"
#include "support/rhexis.hpp"

/// The loop of a capsulorhexis, for a hand of any kind.
namespace examples {

const membrane::Material capsule = membrane::materials::lens_capsule().typical;
constexpr double capsule_toughness = 1.4e3;  // of the amnion [Koh19]: that of the capsule is not known [J/m^2]
constexpr double capsule_lift = 12;          // of the pull over the surface [degrees]
constexpr LoopOptions capsule_loop{.sweeps = 4};
constexpr double stiffer = 30;  // in bending than the capsule: else the flap crumples, as finely as its triangles

/// The front of a lens.
[[nodiscard]] inline RhexisScene lens_front() {
    constexpr double ball = 10e-3, rim = 4e-3, edge = 0.3e-3;  // [m]
    const auto front = membrane::trimmed(
        membrane::Ball{.radius = ball},
        membrane::HalfSpace{.point = {0, 0, std::sqrt(ball * ball - rim * rim)}, .normal = {0, 0, -1}});
    return capsule_scene(membrane::distmesh(front, {.edge_length = edge}), ball);
}

[[nodiscard]] inline auto capsule_tissue(const RhexisScene& scene) {
    const auto& mesh = scene.mesh;
    const auto none = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                  {.stiffness = 0.0, .pinned = scene.pinned});  // no springs
    return membrane::Tissue(membrane::TearableSprings(mesh, none),
                            membrane::triangular_springs(mesh, capsule, scene.stretch),
                            membrane::bending_springs(mesh, stiffer * membrane::flexural_rigidity(capsule)));
}

/// A cut capsule, which tears under forceps.
class Capsulorhexis {
  public:
    using Tissue = decltype(capsule_tissue(std::declval<const RhexisScene&>()));
    using Sheet = membrane::Elements<double, membrane::TriangularSpring<double>>;

    /// Its tension presses it onto the body, and then it is cut.
    explicit Capsulorhexis(const RhexisScene& scene, double toughness = capsule_toughness,
                           const LoopOptions& options = capsule_loop)
        : tissue_(capsule_tissue(scene)),
          body_(scene.body()),
          options_(options),
          solver_(tissue_, {.layers = 12, .sweeps = options.sweeps, .relative_tolerance = 1e-2}),
          tear_(scene.mesh, membrane::EnergyRelease{.toughness = toughness, .thickness = capsule.thickness}),
          x_(scene.mesh.positions()),
          fluid_(options.drag, x_.cols()) {
        run_to_equilibrium();
        for (const auto& event : tear_.cut_along(scene.cut(tear_.surface()), x_)) {
            follow(event, tissue_, body_, solver_);
        }
    }

    /// One tick, with what the forceps hold.
    auto step(const membrane::PointAttachment<double>& held) {
        const auto report = fluid_.step(solver_, x_, options_.tick, tissue_, body_, held, tear_.ligaments());
        for (const auto& event : tear_.update(x_, options_.tick, tissue_, body_, held.corners)) {
            follow(event, tissue_, body_, solver_);
        }
        return report;
    }

    /// Nothing holds it, and it does not tear.
    void run_to_equilibrium(int ticks = 300) {
        solver_.wake_all();
        for (int i = 0; i < ticks && !solver_.step(x_, options_.tick, tissue_, body_).converged; ++i) {
            solver_.wake_all();
        }
    }

    [[nodiscard]] const Tissue& tissue() const { return tissue_; }
    /// The elements that have the tension.
    [[nodiscard]] const Sheet& sheet() const {
        const Sheet* found = nullptr;
        tissue_.for_each_kind([&]<class Kind>(const Kind& kind) {
            if constexpr (std::same_as<Kind, Sheet>) found = &kind;
        });
        return *found;
    }
    [[nodiscard]] const BallUnder& body() const { return body_; }
    [[nodiscard]] const Tear& tear() const { return tear_; }
    [[nodiscard]] const membrane::Points<double>& x() const { return x_; }
    /// Energy that a fluid has taken [J].
    [[nodiscard]] double damped() const { return fluid_.taken(); }

  private:
    Tissue tissue_;
    BallUnder body_;
    LoopOptions options_;
    membrane::QuasiStaticSolver<double> solver_;
    Tear tear_;
    membrane::Points<double> x_;  // [m]
    Fluid<double> fluid_;
};

}  // namespace examples
