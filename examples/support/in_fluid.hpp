// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

#include <membrane/model/volume_springs.hpp>

/// A membrane in a viscous fluid.
///
///     const examples::InFluid fluid(foundation, drag);                   // [N s/m]
///     const auto before = x;
///     const auto report = solver.step(x, dt, tissue, fluid, pull(tool, grasp));
///     drag_work.add(x - before, drag / dt);                              // examples::DragWork<double>(vertices)
namespace examples {

/// A foundation, and a fluid at rest around the membrane: a drag on each vertex against its velocity. A
/// `FoundationModel`. A membrane that jumps to its next equilibrium takes several ticks for it if drag / dt is near the
/// stiffness that it moves against, and then the drag takes the energy, not the solver's steps.
template <membrane::Real Scalar, class Foundation = membrane::NoFoundation>
class InFluid {
    using Vector = membrane::Vector3<Scalar>;

  public:
    /// `drag` on a vertex per velocity [N s/m], 0 for no fluid. The foundation must outlive this.
    InFluid(const Foundation& foundation, Scalar drag) : foundation_(&foundation), drag_(drag) {}

    [[nodiscard]] membrane::VertexForce<Scalar> force_on(membrane::Index v, const Vector& position, const Vector& start,
                                                         Scalar dt) const noexcept {
        auto sum = foundation_->force_on(v, position, start, dt);
        sum.force += drag_ / dt * (start - position);
        sum.stiffness += drag_ / dt;
        return sum;
    }

    /// In a tick the drag is as a spring to where the vertex started: a solver updates several vertices at once with
    /// it.
    [[nodiscard]] membrane::VolumeSpring<Scalar> spring(membrane::Index, const Vector& start, Scalar dt)
        const noexcept requires std::same_as<Foundation, membrane::NoFoundation> {
        return {start, drag_ / dt};
    }

  private:
    const Foundation* foundation_;
    Scalar drag_;
};

/// The energy that a drag takes, by the trapezoidal rule from step to step.
template <membrane::Real Scalar>
class DragWork {
  public:
    explicit DragWork(Eigen::Index vertices) : last_(membrane::Points<Scalar>::Zero(3, vertices)) {}

    /// A step with these displacements of all vertices [m]; `rate` is the drag over the time of the step [N/m].
    void add(const membrane::Points<Scalar>& displacements, Scalar rate) {
        taken_ += static_cast<double>(rate * displacements.cwiseProduct(displacements + last_).sum() / 2);
        last_ = displacements;
    }

    /// Since the first step [J].
    [[nodiscard]] double taken() const { return taken_; }

  private:
    membrane::Points<Scalar> last_;  // displacements [m]
    double taken_ = 0;
};

}  // namespace examples
