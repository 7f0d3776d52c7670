// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

#include <membrane/model/volume_springs.hpp>

/// A membrane in a viscous fluid.
///
///     examples::Fluid<double> fluid(3e-3, mesh.vertex_count());           // [N s/m]
///     const auto report = fluid.step(solver, x, dt, tissue, foundation, pull(tool, grasp));
///     std::printf("%g J", fluid.taken());
namespace examples {

/// A foundation, and a fluid at rest around the membrane: a drag on each vertex against its velocity. A
/// `FoundationModel`.
template <membrane::Real Scalar, class Foundation>
class InFluid {
    using Vector = membrane::Vector3<Scalar>;

  public:
    /// `drag` on a vertex per velocity [N s/m]. The foundation must outlive this.
    InFluid(const Foundation& foundation, Scalar drag) : foundation_(&foundation), drag_(drag) {}

    [[nodiscard]] membrane::VertexForce<Scalar> force_on(membrane::Index v, const Vector& position, const Vector& start,
                                                         Scalar dt) const noexcept {
        auto sum = foundation_->force_on(v, position, start, dt);
        sum.force += drag_ / dt * (start - position);
        sum.stiffness += drag_ / dt;
        return sum;
    }

    /// The drag alone is the damping of a spring from where the vertex started: with it a solver updates several
    /// vertices at once.
    [[nodiscard]] membrane::VolumeSpring<Scalar> spring(membrane::Index, const Vector& start, Scalar dt)
        const noexcept requires std::same_as<Foundation, membrane::NoFoundation> {
        return {.anchor = start, .rate = drag_ / dt};
    }

  private:
    const Foundation* foundation_;
    Scalar drag_;
};

/// A fluid, and the energy that its drag takes. If drag / dt is near the stiffness that a membrane moves against, it
/// takes several ticks to jump to its next equilibrium, and the drag takes the energy of the jump, not the solver's
/// steps.
template <membrane::Real Scalar>
class Fluid {
  public:
    /// `drag` on a vertex per velocity [N s/m]; 0: no fluid, at no cost.
    Fluid(Scalar drag, Eigen::Index vertices)
        : drag_(drag), before_(3, vertices), last_(membrane::Points<Scalar>::Zero(3, vertices)) {}

    /// A step of the solver, in the fluid.
    template <class Solver, class Network, class Foundation, class... Constraints>
    auto step(Solver& solver, membrane::Points<Scalar>& x, Scalar dt, const Network& network,
              const Foundation& foundation, const Constraints&... constraints) {
        if (!(drag_ > 0)) return solver.step(x, dt, network, foundation, constraints...);
        before_ = x;
        const auto report = solver.step(x, dt, network, InFluid(foundation, drag_), constraints...);
        const auto displacements = x - before_;
        taken_ += static_cast<double>(drag_ / dt * displacements.cwiseProduct(displacements + last_).sum() / 2);
        last_ = displacements;
        return report;
    }

    [[nodiscard]] Scalar drag() const { return drag_; }
    /// Energy that the drag has taken, by the trapezoidal rule from step to step [J].
    [[nodiscard]] double taken() const { return taken_; }

  private:
    Scalar drag_;
    membrane::Points<Scalar> before_;  // positions before the step [m]
    membrane::Points<Scalar> last_;    // displacements in the last step [m]
    double taken_ = 0;
};

}  // namespace examples
