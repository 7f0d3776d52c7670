// SPDX-License-Identifier: MIT
#include <membrane/tissue/tissue.hpp>

#include <cmath>
#include <limits>
#include <set>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/solve/explicit_euler.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/newton.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/run_to_equilibrium.hpp"
#include "support/vertex_energy.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

/// Springs, triangles and hinges of a sphere of 1 cm, stretched or not, of 12 to 162 vertices.
struct Sphere {
    explicit Sphere(Random& random, Index subdivisions)
        : mesh(icosphere({.radius = 0.01, .subdivisions = subdivisions})),
          material{.young_modulus = 1e5, .poisson_ratio = random.number(0.0, 0.5), .thickness = 1e-4},
          springs(mesh, LinearSpring{}, {.stiffness = random.number(0.0, 5.0), .mass = 1e-5}),
          triangles(triangular_springs(mesh, material, random.number(1.0, 1.05))),
          hinges(bending_springs(mesh, flexural_rigidity(material))),
          tissue(springs, triangles, hinges, balancing_loads(mesh, Tissue(springs, triangles))),
          foundation(mesh, {.stiffness = random.number(0.5, 3.0)}) {}

    TriangleMesh<double> mesh;
    Material material;
    MassSpringNetwork<double, LinearSpring> springs;
    Elements<double, TriangularSpring<double>> triangles;
    Elements<double, Hinge<double>> hinges;
    Tissue<MassSpringNetwork<double, LinearSpring>, Elements<double, TriangularSpring<double>>,
           Elements<double, Hinge<double>>, Elements<double, DeadLoad<double>>>
        tissue;
    VirtualVolumeSprings<double> foundation;
};

}  // namespace

TEST_CASE("a tissue pulls with all its parts", "[tissue]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere(random, random.index(3));
        const Points<double> x = test::jittered(sphere.mesh.positions(), 1e-3, random);
        for (Index v = 0; v < sphere.mesh.vertex_count(); ++v) {
            Eigen::Vector3d force = sphere.springs.force_on(v, x).force;
            Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
            std::set<Index> joined;
            for (const auto& end : sphere.springs.springs_of(v)) joined.insert(end.other);
            sphere.tissue.for_each_kind([&](const auto& elements) {
                elements.for_each(v, x, [&](const auto& placed, const auto& corners, std::size_t i) {
                    const auto pull = placed.element.force_on(corners, i);
                    force += pull.force;
                    for (Eigen::Index k = 0; k < 3; ++k) {
                        curvature.col(k) += pull.hessian * Vector3<double>(Eigen::Vector3d::Unit(k));
                    }
                    for (const Index w : placed.corners) joined.insert(w);
                });
            });
            joined.erase(v);
            std::set<Index> neighbours;
            for (const auto& end : sphere.tissue.neighbours(v)) neighbours.insert(end.other);
            REQUIRE(neighbours == joined);
            const double scale = 1e-12 * (1 + force.norm());
            const auto pull = sphere.tissue.force_on(v, x);
            const auto curved = test::majoriser(sphere.tissue, v, x);
            REQUIRE((pull.force - force).norm() < scale);
            REQUIRE((curved.force - force).norm() < scale);
            const Vector3<double> displacement = 1e-4 * random.unit_vector();
            const auto of_springs = test::majoriser(sphere.springs, v, x);
            const double elements = displacement.dot(curvature * displacement);
            const auto bend = [&](const EnergyMajoriser<double>& p) {
                return p.stiffness * squared_norm(displacement) -
                       dot<double>(displacement, p.stiffness_reduction * displacement);
            };
            REQUIRE(bend(curved) == Approx(bend(of_springs) + elements));
            REQUIRE(pull.stiffness * squared_norm(displacement) >= bend(curved) * (1 - 1e-9));
        }
    }
}

TEST_CASE("a tissue without elements is its springs", "[tissue]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<double>(random).mesh();
        const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 3.0});
        const auto tissue = Tissue(springs);
        const Points<double> x = test::jittered(mesh.positions(), 0.01, random);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            REQUIRE(tissue.force_on(v, x).force == springs.force_on(v, x).force);
            REQUIRE(tissue.neighbours(v).size() == springs.neighbours(v).size());
        }
        REQUIRE(tissue.force_tolerance() == springs.force_tolerance());
        REQUIRE(tissue.vertex_count() == springs.vertex_count());
    }
}

TEST_CASE("steps of any rule bring a tissue to where Newton's method finds it at rest", "[tissue]") {
    for (int seed = 1; seed <= cases(12); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere(random, random.index(2));
        const Index held = random.index(sphere.mesh.vertex_count());
        const Vector3<double> start = sphere.mesh.positions().col(held);
        const Vector3<double> target = start + 1.5e-3 * random.unit_vector();
        // Dense, from forces alone.
        Eigen::VectorXd u = sphere.mesh.positions().reshaped();
        const auto residual = [&](const Eigen::VectorXd& at) {
            const Points<double> x = at.reshaped(3, at.size() / 3);
            Eigen::VectorXd result(at.size());
            for (Index v = 0; v < sphere.mesh.vertex_count(); ++v) {
                const Vector3<double> here = x.col(v);
                result.segment<3>(3 * v) = v == held
                                               ? Vector3<double>(target - here)
                                               : Vector3<double>(sphere.tissue.force_on(v, x).force +
                                                                 sphere.foundation.force_on(v, here, here, 1).force);
            }
            return result;
        };
        const Points<double> expected = test::newton(residual, u).reshaped(3, sphere.mesh.vertex_count());
        const auto rest =
            equilibrium(sphere.mesh.positions(), sphere.mesh, sphere.tissue, sphere.foundation, {}, pull(held, target));
        REQUIRE(rest.converged);
        REQUIRE((rest.x - expected).colwise().norm().maxCoeff() < 1e-9);
        const auto check = [&](auto rule) {
            auto solver = QuasiStaticSolver(sphere.tissue, {.layers = unlimited, .sweeps = 16}, rule);
            Points<double> x = sphere.mesh.positions();
            const auto report =
                test::run_to_equilibrium(solver, x, 1e-3, sphere.tissue, sphere.foundation, pull(held, target));
            REQUIRE(report.converged);
            REQUIRE((x - expected).colwise().norm().maxCoeff() < 1e-7);
            REQUIRE(norm<double>(report.reactions[0] - rest.reactions[0]) < 1e-5 * norm(rest.reactions[0]));
        };
        check(BlockStep{});
        check(SafeStep{});
    }
}

TEST_CASE("no visit of a tissue's vertex raises the energy, however wild the start", "[tissue]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Sphere sphere(random, 1);
        const auto energy = [&](const Points<double>& x) {
            double sum = sphere.springs.energy(x);
            sphere.tissue.for_each_kind([&](const auto& elements) {
                for (const auto& placed : elements.all()) sum += placed.element.energy(elements.where(placed, x));
            });
            for (Index v = 0; v < x.cols(); ++v) sum += sphere.foundation.energy(v, x.col(v));
            return sum;
        };
        auto solver = QuasiStaticSolver(sphere.tissue, {.layers = unlimited, .sweeps = 1, .predict = false});
        Points<double> x = test::jittered(sphere.mesh.positions(), random.number(0.0, 0.02), random);
        double before = energy(x);
        solver.wake_all();
        for (int step = 0; step < 20; ++step) {
            const auto report = solver.step(x, 1e-3, sphere.tissue, sphere.foundation);
            REQUIRE(report.status == StepStatus::advanced);
            const double after = energy(x);
            REQUIRE(after <= before + 1e-10 * std::abs(before));
            before = after;
        }
    }
}

TEST_CASE("a tissue presses back, and explicit Euler moves it too", "[tissue]") {
    Random random(3);
    const Sphere sphere(random, 2);
    auto euler = ExplicitEuler(sphere.tissue);
    Points<double> x = sphere.mesh.positions(), velocity = Points<double>::Zero(3, x.cols());
    REQUIRE(euler.step(x, velocity, 1e-5, sphere.tissue, sphere.foundation));
    // Only hinges are out of balance by rounding: it stays.
    CHECK((x - sphere.mesh.positions()).cwiseAbs().maxCoeff() < 1e-15);
}

TEST_CASE("elements of another mesh are refused", "[tissue][bad]") {
    const auto mesh = icosphere({.subdivisions = 1});
    const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0});
    const auto others = pressure(icosphere({.subdivisions = 0}), 1.0);
    CHECK(refusal([&] { (void)Tissue(springs, others); }) ==
          "Tissue: elements must be of the springs' mesh of 42 vertices, got one of 12");
}
