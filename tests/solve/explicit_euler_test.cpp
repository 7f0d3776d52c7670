// SPDX-License-Identifier: MIT
#include <membrane/solve/explicit_euler.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <membrane/model/moving_foundation.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

template <class S>
Points<S> zeros(Index count) {
    return Points<S>::Zero(3, count);
}

/// A right triangle; vertex 1 lies at (1, 0, 0).
template <class S>
TriangleMesh<S> right_triangle() {
    Points<S> x(3, 3);
    x << 0, 1, 0,  //
        0, 0, 1,   //
        0, 0, 0;
    return {x, Eigen::Vector3i(0, 1, 2)};
}

/// m y'' + d y' + k y = 0 with y(0) = 1, y'(0) = 0, at time t.
double oscillation(double m, double d, double k, double t) {
    const double decay = d / (2 * m), square = k / m - decay * decay;
    if (square > 0) {
        const double w = std::sqrt(square);
        return std::exp(-decay * t) * (std::cos(w * t) + decay / w * std::sin(w * t));
    }
    const double w = std::sqrt(-square);
    return std::exp(-decay * t) * (std::cosh(w * t) + decay / w * std::sinh(w * t));
}

/// Largest error over [0, 2] s against the closed form, of `simulate(dt, steps, see)` that calls `see(i, y)`.
template <class Simulate>
double worst_error(double m, double d, double k, int steps, Simulate simulate) {
    double worst = 0;
    simulate(2.0 / steps, steps,
             [&](int i, double y) { worst = std::max(worst, std::abs(y - oscillation(m, d, k, 2.0 * i / steps))); });
    return worst;
}

/// The error halves with the step, within `margin`: the method is of first order.
template <class Simulate>
void check_first_order(double m, double d, double k, Simulate simulate, double margin = 0.1) {
    const double first = worst_error(m, d, k, 250, simulate);
    CHECK(first < 0.1);
    double before = first;
    for (int steps = 500; steps <= 8000; steps *= 2) {
        const double now = worst_error(m, d, k, steps, simulate);
        CAPTURE(steps, before, now);
        CHECK(std::log2(before / now) == Approx(1).margin(margin));
        before = now;
    }
    CHECK(std::log2(first / before) / 5 == Approx(1).margin(0.1));
    CHECK(before < 0.003);
}

}  // namespace

TEST_CASE("one damped spring follows its closed form, with an error of first order", "[euler]") {
    const double m = 0.3, k = 20;
    for (const double d : {0.0, 0.7, 6.0}) {  // undamped, swinging, creeping
        CAPTURE(d);
        // Only spring 0-1 is there. It is drawn out by a tenth of its length, and swings along itself.
        const auto mesh = right_triangle<double>();
        const MassSpringNetwork network(
            mesh, LinearSpring{},
            {.stiffness = std::vector<double>{k, 0, 0}, .mass = m, .viscosity = d, .pinned = {0, 2}});
        check_first_order(m, d, k, [&](double dt, int steps, auto see) {
            ExplicitEuler euler(network);
            Points<double> x = mesh.positions(), velocity = zeros<double>(3);
            x(0, 1) += 0.1;
            for (int i = 1; i <= steps; ++i) {
                REQUIRE(euler.step(x, velocity, dt, network, NoFoundation{}));
                see(i, (x(0, 1) - 1) / 0.1);
            }
            CHECK(point(x, 0) == Vector3<double>(0, 0, 0));
            CHECK(x(1, 1) == 0);
        });
    }
}

TEST_CASE("a damped volume spring follows its closed form, too", "[euler]") {
    const double m = 0.3, k = 20, d = 0.7;
    const auto mesh = right_triangle<double>();
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 0.0, .mass = m, .pinned = {0, 2}});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = k, .damping = d});
    const Vector3<double> displacement(0.3, -0.2, 0.6);
    check_first_order(
        m, d, k,
        [&](double dt, int steps, auto see) {
            ExplicitEuler euler(network);
            Points<double> x = mesh.positions(), velocity = zeros<double>(3);
            x.col(1) += displacement;
            for (int i = 1; i <= steps; ++i) {
                REQUIRE(euler.step(x, velocity, dt, network, foundation));
                see(i,
                    dot<double>(point(x, 1) - foundation.anchors().col(1), displacement) / squared_norm(displacement));
            }
        },
        0.3);  // where it passes its anchor, the length has a kink
}

TEMPLATE_TEST_CASE("(2) and (3): the force changes the velocity, the new velocity moves the point", "[euler]",
                   TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
        const Index count = mesh.vertex_count();
        std::vector<S> mass(static_cast<std::size_t>(count)), viscosity(mass.size());
        for (S& m : mass) m = random.number<S>(1, 2);
        for (S& d : viscosity) d = random.number<S>(0, 1);
        const MassSpringNetwork network(mesh, ExponentialSpring{},
                                        {.stiffness = S(3), .mass = mass, .viscosity = viscosity, .pinned = {5, 30}});
        const VirtualVolumeSprings foundation(mesh, {.stiffness = S(2), .damping = S(0.3)});
        const Points<S> x0 = test::jittered(mesh.positions(), S(0.1), random);
        const Points<S> v0 = test::jittered(zeros<S>(count), S(1), random);
        const Points<S> external = test::jittered(zeros<S>(count), S(1), random);
        Points<S> x = x0, velocity = v0;
        ExplicitEuler euler(network);
        const S dt = S(0.01), tolerance = 100 * std::numeric_limits<S>::epsilon();
        REQUIRE(euler.step(x, velocity, dt, network, foundation, external));
        S residual = 0;
        for (Index v = 0; v < count; ++v) {
            if (network.pinned(v)) {
                REQUIRE(point(x, v) == point(x0, v));
                REQUIRE(point(velocity, v) == point(v0, v));
                continue;
            }
            const Vector3<S> u = point(x0, v) - point(mesh.positions(), v), speed = point(v0, v);
            const S rate = (norm(u) - norm<S>(u - dt * speed)) / dt;  // of the length
            const Vector3<S> volume = -S(2) * u - S(0.3) * rate / norm(u) * u;
            const Vector3<S> force = network.force_on(v, x0).force + volume + point(external, v);
            const Vector3<S> new_speed = speed + dt / network.mass(v) * (force - network.viscosity(v) * speed);
            REQUIRE(norm<S>(point(velocity, v) - new_speed) <= 10 * tolerance);
            REQUIRE(norm<S>(point(x, v) - (point(x0, v) + dt * point(velocity, v))) <= tolerance);
            residual = std::max(residual, norm(force));
        }
        REQUIRE(euler.residual() == Approx(residual).epsilon(1e3 * std::numeric_limits<S>::epsilon()));

        // No external force is one of zero.
        Points<S> other = x0, other_velocity = v0;
        x = x0, velocity = v0;
        REQUIRE(euler.step(x, velocity, dt, network, foundation));
        REQUIRE(euler.step(other, other_velocity, dt, network, foundation, zeros<S>(count)));
        REQUIRE(same_bits(x, other));
        REQUIRE(same_bits(velocity, other_velocity));
    }
}

TEST_CASE("free in space, momentum and the velocity of the centre are kept", "[euler]") {
    Random random(4);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 5.0, .mass = 0.2});
    ExplicitEuler euler(network);
    Points<double> x = test::jittered(mesh.positions(), 0.05, random);
    Points<double> velocity = test::jittered(zeros<double>(162), 0.5, random);
    const Vector3<double> middle = x.rowwise().mean(), speed = velocity.rowwise().mean();
    for (int i = 0; i < 1000; ++i) REQUIRE(euler.step(x, velocity, 1e-3, network, NoFoundation{}));
    CHECK(norm<double>(velocity.rowwise().mean() - speed) < 1e-13);
    CHECK(norm<double>(x.rowwise().mean() - (middle + speed)) < 1e-12);
}

TEST_CASE("anchors that move take the membrane along", "[euler]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 5.0, .mass = 0.1, .viscosity = 0.5});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 2.0, .damping = 0.2});
    ExplicitEuler euler(network);
    MovingBody body(mesh);
    Random random(1);
    Points<double> anchors = mesh.positions(), x = test::jittered(anchors, 0.05, random), velocity = zeros<double>(42);
    for (int i = 0; i < 4000; ++i) {
        if (i < 100) anchors.row(0).array() += 0.003;
        REQUIRE(body.move_to(anchors, 0.01, x));
        REQUIRE(euler.step(x, velocity, 0.01, network, on(body, foundation)));
    }
    CHECK((x - anchors).cwiseAbs().maxCoeff() < 1e-9);
}

TEMPLATE_TEST_CASE("a step that cannot be made leaves everything as it was", "[euler][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    Random random(1);
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = S(3), .mass = S(1), .viscosity = S(0.1)});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = S(2), .damping = S(0.3)});
    ExplicitEuler euler(network);
    CHECK(euler.residual() == 0);
    const Points<S> good_x = test::jittered(mesh.positions(), S(0.1), random);
    const Points<S> good_velocity = test::jittered(zeros<S>(42), S(1), random);
    const auto refused = [&](const Points<S>& x0, const Points<S>& v0, S dt, const Points<S>& external) {
        Points<S> x = x0, velocity = v0;
        const bool done = euler.step(x, velocity, dt, network, foundation, external);
        return !done && same_bits(x, x0) && same_bits(velocity, v0);
    };
    const Points<S> none = zeros<S>(42);
    CHECK_FALSE(refused(good_x, good_velocity, S(0.01), none));
    for (const S dt : {S(0), S(-0.01), Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max()}) {
        CAPTURE(dt);
        CHECK(refused(good_x, good_velocity, dt, none));
    }
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), Limits::max()}) {
        for (Index v : {0, 17, 41}) {
            CAPTURE(bad, v);
            Points<S> wrong = good_x;
            wrong(1, v) = bad;
            CHECK(refused(wrong, good_velocity, S(0.01), none));
            wrong = good_velocity;
            wrong(2, v) = bad;
            CHECK(refused(good_x, wrong, S(10), none));
            wrong = none;
            wrong(0, v) = bad;
            CHECK(refused(good_x, good_velocity, S(10), wrong));
        }
    }
    // What was refused is forgotten: the next step is as if nothing had been.
    Points<S> x = good_x, velocity = good_velocity, other = good_x, other_velocity = good_velocity;
    ExplicitEuler fresh(network);
    REQUIRE(euler.step(x, velocity, S(0.01), network, foundation));
    REQUIRE(fresh.step(other, other_velocity, S(0.01), network, foundation));
    CHECK(same_bits(x, other));
}

TEST_CASE("a step beyond stability blows up, and is refused before it is no number", "[euler][bad]") {
    Random random(2);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 3.0, .mass = 1.0});
    ExplicitEuler euler(network);
    Points<double> x = test::jittered(mesh.positions(), 0.1, random), velocity = zeros<double>(42);
    int steps = 0;
    while (steps < 100'000 && euler.step(x, velocity, 10.0, network, NoFoundation{})) ++steps;
    CHECK(steps > 10);
    CHECK(steps < 100'000);
    CHECK(is_finite(x));
    CHECK(is_finite(velocity));
}

TEST_CASE("explicit Euler needs masses", "[euler][bad]") {
    const MassSpringNetwork network(icosphere({.subdivisions = 1}), LinearSpring{}, {.stiffness = 3.0});
    CHECK(test::refusal([&] { ExplicitEuler euler(network); }) == "ExplicitEuler: the network must have masses [kg]");
}

TEST_CASE("explicit Euler owns what it knows, and works in anybody's memory", "[euler]") {
    Random random(3);
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 1});
    auto network = std::make_unique<MassSpringNetwork<float, LinearSpring>>(
        mesh, LinearSpring{}, NetworkOptions<float>{.stiffness = 3.0F, .mass = 1.0F});
    auto first = std::make_unique<ExplicitEuler<float>>(*network);
    const auto other_network = *network;
    network.reset();
    ExplicitEuler<float> copy = *first, moved = std::move(*first);
    first.reset();
    Points<float> x = test::jittered(mesh.positions(), 0.1F, random), velocity = zeros<float>(42);
    std::vector<float> buffer(8 * 42, -1.0F);
    Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> y(buffer.data(), 3, 42, Eigen::OuterStride<>(8));
    Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> w(buffer.data() + 3, 3, 42, Eigen::OuterStride<>(8));
    y = x, w = velocity;
    for (int i = 0; i < 100; ++i) {
        REQUIRE(copy.step(x, velocity, 0.01F, other_network, NoFoundation{}));
        REQUIRE(moved.step(y, w, 0.01F, other_network, NoFoundation{}));
    }
    CHECK(same_bits(x, Points<float>(y)));
    CHECK(same_bits(velocity, Points<float>(w)));
    CHECK(buffer[6] == -1.0F);  // what lies between is not ours
    CHECK(buffer[8 * 41 + 7] == -1.0F);
    using Step =
        bool (ExplicitEuler<float>::*)(PointsRef<float>, PointsRef<float>, float,
                                       const MassSpringNetwork<float, LinearSpring>&, const NoFoundation&) noexcept;
    CHECK(Step(&ExplicitEuler<float>::step<MassSpringNetwork<float, LinearSpring>, NoFoundation>) != nullptr);
}

TEST_CASE("points of the wrong count are refused", "[euler][bad]") {
    const MassSpringNetwork network(icosphere({.subdivisions = 0}), LinearSpring{}, {.stiffness = 3.0, .mass = 1.0});
    ExplicitEuler euler(network);
    Points<double> right = zeros<double>(12), fewer = zeros<double>(11);
    const MassSpringNetwork other(icosphere({.subdivisions = 1}), LinearSpring{}, {.stiffness = 3.0, .mass = 1.0});
    Points<double> velocity = zeros<double>(12), more = zeros<double>(42);
    CHECK(euler.step(right, velocity, 0.01, network, NoFoundation{}));
    CHECK_FALSE(euler.step(fewer, velocity, 0.01, network, NoFoundation{}));
    CHECK_FALSE(euler.step(right, fewer, 0.01, network, NoFoundation{}));
    CHECK_FALSE(euler.step(right, velocity, 0.01, network, NoFoundation{}, fewer));
    CHECK_FALSE(euler.step(more, more, 0.01, other, NoFoundation{}));
}
