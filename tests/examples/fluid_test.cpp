// SPDX-License-Identifier: MIT
#include <concepts>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/spring_law.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/catch.hpp"
#include "support/fluid.hpp"

using namespace membrane;

namespace {

constexpr double stiffness = 20;  // of the springs [N/m]

/// A stretched disc with a clamped rim, which is held up at its middle and then let go in a fluid.
template <class S, class Foundation>
struct LetGo {
    TriangleMesh<S> mesh = disc<S>({.radius = S(10e-3), .rings = 8});
    MassSpringNetwork<S, LinearSpring> network{
        mesh, LinearSpring{}, {.stiffness = S(stiffness), .pinned = border(mesh)}};
    Foundation foundation;
    QuasiStaticSolver<S> solver{network, {.layers = unlimited, .sweeps = 10}};
    examples::Fluid<S> fluid;
    Points<S> x = S(1.1) * mesh.positions();
    double before;

    /// `rate` is the drag over the time of a tick [N/m].
    explicit LetGo(double rate) : foundation(of(mesh)), fluid(static_cast<S>(rate * 1e-3), mesh.vertex_count()) {
        Vector3<S> up = point(x, 0);
        up[2] += S(1e-3);
        for (int i = 0; i < 500; ++i) {
            REQUIRE(solver.step(x, S(1e-3), network, foundation, pull(Index(0), up)).status == StepStatus::advanced);
        }
        before = energy();
    }
    void tick() { REQUIRE(fluid.step(solver, x, S(1e-3), network, foundation).status == StepStatus::advanced); }
    [[nodiscard]] double energy() const { return static_cast<double>(network.energy(x)); }

  private:
    static Foundation of(const TriangleMesh<S>& mesh) {
        if constexpr (std::same_as<Foundation, NoFoundation>) {
            return {};
        } else {
            return Foundation(mesh, {.stiffness = S(0)});
        }
    }
};

}  // namespace

TEMPLATE_TEST_CASE("a membrane that is let go in a fluid comes to rest, and the drag takes its energy", "[fluid]",
                   TEST_SCALARS) {
    const double rate = 20 * stiffness;
    LetGo<TestType, NoFoundation> alone(rate);
    LetGo<TestType, VirtualVolumeSprings<TestType>> on_body(rate);
    LetGo<TestType, NoFoundation> in_none(0);
    for (int i = 0; i < 300; ++i) in_none.tick();
    const double flat = in_none.energy();
    const double released = alone.before - flat;
    REQUIRE(released > 0.01 * flat);
    for (int i = 0; i < 4000; ++i) {
        alone.tick();
        on_body.tick();
        if (i == 100) CHECK(alone.energy() - flat > 0.1 * released);
        if (i % 500 == 0) CHECK((alone.x - on_body.x).cwiseAbs().maxCoeff() < 1e-6);
    }
    CHECK(alone.energy() - flat < 0.01 * released);
    CHECK(alone.fluid.taken() == Approx(released).epsilon(0.03));
    CHECK(on_body.fluid.taken() == Approx(released).epsilon(0.03));
}

TEST_CASE("without drag there is no fluid, to the bit", "[fluid]") {
    LetGo<double, VirtualVolumeSprings<double>> in_none(0), plain(0);
    for (int i = 0; i < 20; ++i) {
        in_none.tick();
        const StepReport report = plain.solver.step(plain.x, 1e-3, plain.network, plain.foundation);
        CHECK(report.status == StepStatus::advanced);
    }
    CHECK(in_none.x == plain.x);
    CHECK(in_none.fluid.taken() == 0);
}
