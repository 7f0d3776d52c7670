// SPDX-License-Identifier: MIT
#include <membrane/solve/explicit_euler.hpp>
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"

// Where each rule begins to diverge, found by bisection, against the eigenvalues of a Hessian assembled here.

using namespace membrane;
using test::Random;

namespace {

/// A sphere of 42 vertices at rest: random springs, a foundation of a hundredth to ten times as much, random masses.
struct Scene {
    explicit Scene(int seed) : Scene(Random(static_cast<std::uint64_t>(seed))) {}
    explicit Scene(Random random)
        : mesh(test::jittered(icosphere({.radius = 1, .subdivisions = 1}).positions(), 0.05, random),
               icosphere({.radius = 1, .subdivisions = 1}).triangles()),
          network(mesh, {}, {.stiffness = numbers(120, 0.2, 5, random), .mass = numbers(42, 0.5, 2, random)}),
          foundation(mesh, {.stiffness = std::pow(10, random.number(-2.0, 1.0))}) {}

    static std::vector<double> numbers(std::size_t count, double low, double high, Random& random) {
        std::vector<double> values(count);
        for (double& value : values) value = random.number(low, high);
        return values;
    }

    /// Second derivative of the energy of springs and foundation at rest: no spring has a tension.
    [[nodiscard]] Eigen::MatrixXd hessian() const {
        const Index n = 3 * mesh.vertex_count();
        Eigen::MatrixXd h = foundation.stiffness(0) * Eigen::MatrixXd::Identity(n, n);
        for (const auto& spring : network.springs()) {
            const Eigen::Vector3d u =
                (mesh.positions().col(spring.second) - mesh.positions().col(spring.first)).normalized();
            const Eigen::Matrix3d k = spring.stiffness * u * u.transpose();
            const Index a = 3 * spring.first, b = 3 * spring.second;
            h.block<3, 3>(a, a) += k;
            h.block<3, 3>(b, b) += k;
            h.block<3, 3>(a, b) -= k;
            h.block<3, 3>(b, a) -= k;
        }
        return h;
    }

    [[nodiscard]] Vector3<double> force(Index v, const Points<double>& x) const {
        const Vector3<double> here = point(x, v);
        return network.force_on(v, x).force + foundation.force_on(v, here, here, 1.0).force;
    }

    TriangleMesh<double> mesh;
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;
};

std::vector<double> stiffnesses(const Scene& scene) {
    std::vector<double> values;
    for (const auto& spring : scene.network.springs()) values.push_back(spring.stiffness);
    return values;
}

/// Whether `x` is carried off when `move(x)` moves all of it so many times.
template <class Move>
bool grows(const Scene& scene, Points<double> x, Move move, int times) {
    for (int i = 0; i < times; ++i) {
        move(x);
        const double far = (x - scene.mesh.positions()).cwiseAbs().maxCoeff();
        if (!(far < 1e-3)) return true;  // from 1e-6
    }
    return false;
}

/// The largest number below which `diverges(number)` does not hold, between half of `theory` and twice, to a
/// thousandth.
template <class Diverges>
double limit_near(double theory, Diverges diverges) {
    double low = theory / 2, high = 2 * theory;
    REQUIRE_FALSE(diverges(low));
    REQUIRE(diverges(high));
    while (high > 1.001 * low) {
        const double middle = std::sqrt(low * high);
        (diverges(middle) ? high : low) = middle;
    }
    return low;
}

/// A start a millionth away from rest, along `displacement`.
Points<double> start_along(const Scene& scene, const Eigen::VectorXd& displacement) {
    const Points<double> moved = Eigen::Map<const Points<double>>(displacement.data(), 3, scene.mesh.vertex_count());
    return scene.mesh.positions() + 1e-6 / moved.cwiseAbs().maxCoeff() * moved;
}

}  // namespace

TEST_CASE("explicit Euler diverges beyond dt sqrt(largest eigenvalue of M^-1 H) = 2", "[limits]") {
    for (int seed = 1; seed <= cases(15, 500); ++seed) {
        CAPTURE(seed);
        const Scene scene(seed);
        Eigen::VectorXd root(126);  // of the masses
        for (Index v = 0; v < 42; ++v) root.segment<3>(3 * v).setConstant(std::sqrt(scene.network.mass(v)));
        const Eigen::MatrixXd scaled =
            (scene.hessian().array().colwise() / root.array()).rowwise() / root.transpose().array();
        const auto [largest, displacement] = test::largest_eigenpair(scaled);
        const double theory = 2 / std::sqrt(largest);
        const Points<double> start = start_along(scene, displacement.cwiseQuotient(root));
        const double found = limit_near(theory, [&](double dt) {
            ExplicitEuler euler(scene.network);
            Points<double> velocity = Points<double>::Zero(3, 42);
            const auto move = [&](Points<double>& x) {
                (void)euler.step(x, velocity, dt, scene.network, scene.foundation);
            };
            return grows(scene, start, move, 1000);
        });
        CHECK(found == Approx(theory).epsilon(0.1));
    }
}

TEST_CASE("moving all vertices at once by F dt^2 / m diverges beyond dt^2 / m = 2 / (largest eigenvalue of H)",
          "[limits]") {
    for (int seed = 1; seed <= cases(15, 500); ++seed) {
        CAPTURE(seed);
        const Scene scene(seed);
        const auto [largest, displacement] = test::largest_eigenpair(scene.hessian());
        const double theory = 2 / largest;
        const Points<double> start = start_along(scene, displacement);
        const double found = limit_near(theory, [&](double compliance) {
            const auto move = [&](Points<double>& x) {
                const Points<double> before = x;
                for (Index v = 0; v < 42; ++v) x.col(v) += compliance * scene.force(v, before);
            };
            return grows(scene, start, move, 1000);
        });
        CHECK(found == Approx(theory).epsilon(0.1));
    }
}

namespace {

/// The factor by which a sweep over all vertices, each moved by `compliance` times the force on it, multiplies what is
/// farthest from rest in the long run: the spectral radius of 1 - (1 / compliance + L)^-1 H, where L is what of H lies
/// below the diagonal blocks.
double factor_of_sweep(const Eigen::MatrixXd& h, double compliance) {
    Eigen::MatrixXd split = Eigen::MatrixXd::Identity(h.rows(), h.cols()) / compliance;
    for (Index v = 3; v < h.rows(); v += 3) split.block(v, 0, 3, v) = h.block(v, 0, 3, v);
    const Eigen::MatrixXd sweep = Eigen::MatrixXd::Identity(h.rows(), h.cols()) - test::solve(split, h);
    return test::spectral_radius(sweep);
}

}  // namespace

TEST_CASE(
    "rule (4) diverges beyond dt^2 / m = 2 / (largest eigenvalue of a 3 x 3 block) where neighbours are held, and "
    "never below",
    "[limits]") {
    for (int seed = 1; seed <= cases(15, 500); ++seed) {
        CAPTURE(seed);
        const Scene scene(seed);
        const Eigen::MatrixXd h = scene.hessian();
        double largest = 0;
        Index worst = 0;
        Eigen::VectorXd displacement = Eigen::VectorXd::Zero(126);
        for (Index v = 0; v < 42; ++v) {
            const auto [value, axis] = test::largest_eigenpair(h.block<3, 3>(3 * v, 3 * v));
            if (value <= largest) continue;
            largest = value;
            worst = v;
            displacement.setZero();
            displacement.segment<3>(3 * v) = axis;
        }
        const double theory = 2 / largest;
        const Points<double> start = start_along(scene, displacement);
        // By hand, without the solver's own check of the blocks.
        const auto moves = [&](double compliance, Index first, Index last) {
            return [&scene, compliance, first, last](Points<double>& x) {
                for (Index v = first; v <= last; ++v) x.col(v) += compliance * scene.force(v, x);
            };
        };
        const double alone = limit_near(
            theory, [&](double compliance) { return grows(scene, start, moves(compliance, worst, worst), 1000); });
        CHECK(alone == Approx(theory).epsilon(0.1));
        // All at work, neighbours take some of it away.
        const double together =
            limit_near(theory, [&](double compliance) { return grows(scene, start, moves(compliance, 0, 41), 3000); });
        CHECK(together > 0.99 * theory);
        CHECK(factor_of_sweep(h, 0.9 * together) < 1);
        CHECK(factor_of_sweep(h, 1.1 * together) > 1);
        // The solver, which does not know who is held, refuses from the first limit on.
        const auto status_at = [&](double compliance) {
            const MassSpringNetwork network(scene.mesh, LinearSpring{},
                                            {.stiffness = stiffnesses(scene), .mass = 1 / compliance});
            QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 1}, MassStep{});
            Points<double> x = start;
            solver.wake_all();
            return solver.step(x, 1.0, network, scene.foundation).status;
        };
        CHECK(status_at(0.999 * theory) == StepStatus::advanced);
        CHECK(status_at(1.001 * theory) == StepStatus::unstable);
    }
}
