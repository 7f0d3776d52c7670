// SPDX-License-Identifier: MIT
#include <membrane/tissue/foundation_layer.hpp>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
Eigen::Matrix<S, 3, 3> full(const Symmetric3<S>& a) {
    return Eigen::Matrix<S, 3, 3>{{a.xx, a.xy, a.xz}, {a.xy, a.yy, a.yz}, {a.xz, a.yz, a.zz}};
}

/// The time constant of what decays like exp(-t / constant): the slope of its logarithm, by least squares [s].
double time_constant(const std::vector<double>& sizes, double dt) {
    const auto count = static_cast<double>(sizes.size());
    double ts = 0, ys = 0, tt = 0, ty = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
        const double t = dt * static_cast<double>(i), y = std::log(sizes[i]);
        ts += t, ys += y, tt += t * t, ty += t * y;
    }
    return -(count * tt - ts * ts) / (count * ty - ts * ys);
}

/// A lens capsule on what is soft under it: tangential and normal stiffness far apart, a recovery time of 0.2 s.
struct Capsule {
    TriangleMesh<double> mesh;
    Material material = materials::lens_capsule().typical;
    FoundationLayer layer{.young_modulus = 2e3, .poisson_ratio = 0.45, .thickness = 1e-3};
    MassSpringNetwork<double, LinearSpring> network{
        mesh, LinearSpring{}, {.stiffness = spring_stiffnesses(mesh, material)}};
    FoundationSprings<double> foundation{mesh,
                                         {.normal = normal_stiffnesses(mesh, layer),
                                          .tangential = tangential_stiffnesses(mesh, layer),
                                          .recovery_time = 0.2}};

    explicit Capsule(const TriangleMesh<double>& surface) : mesh(surface) {}
};

/// How long what is left of a dent takes to be a part of 1 / e, from `begin` to `end` [s] after the membrane is let go
/// at `x`: seen at the vertex that was farthest from rest.
double recovery(const Capsule& capsule, Points<double> x, double begin, double end, double dt) {
    QuasiStaticSolver solver(capsule.network, {.layers = unlimited, .sweeps = 100, .force_tolerance = 1e-11});
    Eigen::Index seen = 0;
    (x - capsule.mesh.positions()).colwise().norm().maxCoeff(&seen);
    solver.wake_all();
    std::vector<double> sizes;
    for (double t = 0; t <= end; t += dt) {
        if (t >= begin) sizes.push_back((x.col(seen) - capsule.mesh.positions().col(seen)).norm());
        std::ignore = solver.step(x, dt, capsule.network, capsule.foundation);
    }
    return time_constant(sizes, dt);
}

}  // namespace

TEMPLATE_TEST_CASE("a foundation pulls with a stiffness along the normal and one across", "[foundation]",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    for (int seed = 1; seed <= cases(300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<S> normal(12), tangential(12), time(12);
        for (S& k : normal) k = random.number<S>(0, 10);
        for (S& k : tangential) k = random.number<S>(0, 10);
        for (S& t : time) t = random.chance(0.3) ? S(0) : random.number<S>(0, 1);
        const FoundationSprings foundation(mesh, {.normal = normal, .tangential = tangential, .recovery_time = time});
        const Index v = random.index(12);
        const auto at = static_cast<std::size_t>(v);
        REQUIRE(foundation.normal_stiffness(v) == normal[at]);
        REQUIRE(foundation.tangential_stiffness(v) == tangential[at]);
        REQUIRE(foundation.recovery_time(v) == time[at]);

        // The normal of a corner of the icosahedron is its direction.
        const Vector3<S> anchor = point(mesh.positions(), v);
        REQUIRE((point(foundation.normals(), v) - anchor).norm() < 10 * std::numeric_limits<S>::epsilon());
        REQUIRE(point(foundation.anchors(), v) == anchor);
        const Eigen::Matrix<S, 3, 3> along = anchor * anchor.transpose();
        const Eigen::Matrix<S, 3, 3> stiffness =
            normal[at] * along + tangential[at] * (Eigen::Matrix<S, 3, 3>::Identity() - along);
        const Vector3<S> start = anchor + random.vector<S>(), now = start + S(0.3) * random.vector<S>();
        const S dt = random.number<S>(S(0.01), 1), rate = time[at] / dt;
        const S tolerance = 300 * std::numeric_limits<S>::epsilon() * (1 + rate);

        const auto pull = foundation.force_on(v, now, start, dt);
        const Vector3<S> expected = -stiffness * ((now - anchor) + rate * (now - start));
        REQUIRE((pull.force - expected).norm() <= tolerance);
        REQUIRE(pull.stiffness == Approx(std::max(normal[at], tangential[at]) * (1 + rate)));
        REQUIRE((full(foundation.hessian(v)) - stiffness).norm() <= tolerance);
        const S energy = (now - anchor).dot(stiffness * (now - anchor)) / 2;
        REQUIRE(std::abs(foundation.energy(v, now) - energy) <= tolerance);
        const auto endless = foundation.force_on(v, now, start, std::numeric_limits<S>::infinity());
        REQUIRE((endless.force + stiffness * (now - anchor)).norm() <= tolerance);
    }
}

TEST_CASE("a foundation that is alike in all directions is made of volume springs", "[foundation]") {
    Random random(1);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const FoundationSprings foundation(mesh, {.normal = 3.0, .tangential = 3.0});
    const VirtualVolumeSprings springs(mesh, {.stiffness = 3.0});
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const Vector3<double> now = random.vector(), start = random.vector();
        const auto a = foundation.force_on(v, now, start, 0.1), b = springs.force_on(v, now, start, 0.1);
        CHECK((a.force - b.force).norm() < 1e-15);
        CHECK(a.stiffness == b.stiffness);
    }
}

TEST_CASE("each tick leaves the same part of what the foundation brings back", "[foundation]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 0.0});
    const double time = 0.3, dt = 0.05;
    const FoundationSprings foundation(mesh, {.normal = 7.0, .tangential = 0.5, .recovery_time = time});
    Random random(1);
    Points<double> x = test::jittered<double>(mesh.positions(), 0.1, random);
    QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 1000, .force_tolerance = 1e-12});
    solver.wake_all();
    for (int i = 0; i < 10; ++i) {
        const Points<double> before = x;
        std::ignore = solver.step(x, dt, network, foundation);
        const Points<double> left = (before - mesh.positions()) / (1 + dt / time);
        CHECK((x - mesh.positions() - left).cwiseAbs().maxCoeff() < 1e-9);
    }
}

TEST_CASE("what the membrane helps to bring back recovers the sooner", "[foundation]") {
    // An icosahedron blown up: its 30 springs help its 12 vertices, all alike.
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const double k = 2, normal = 3, time = 0.3, dt = 0.01;
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = k});
    const FoundationSprings foundation(mesh, {.normal = normal, .tangential = 50.0, .recovery_time = time});
    const double edge = 1 / std::sin(2 * std::numbers::pi / 5), springs = 30 * k * edge * edge / 12;
    Points<double> x = 1.01 * mesh.positions();
    QuasiStaticSolver solver(network, {.layers = unlimited, .sweeps = 1000, .force_tolerance = 1e-13});
    solver.wake_all();
    for (int i = 0; i < 5; ++i) {
        const Points<double> before = x;
        std::ignore = solver.step(x, dt, network, foundation);
        const double part = normal * time / dt / (normal * (1 + time / dt) + springs);
        CHECK((x - mesh.positions() - part * (before - mesh.positions())).cwiseAbs().maxCoeff() < 1e-8);
    }
}

TEST_CASE("a dent in a sheet is gone in the time asked for", "[foundation]") {
    const Capsule capsule(sheet({.width = 0.02, .height = 0.02, .columns = 20, .rows = 20}));
    Points<double> x = capsule.mesh.positions();
    for (auto p : x.colwise()) p.z() -= 1e-6 * std::exp(-p.head<2>().squaredNorm() / 9e-6);
    const double found = recovery(capsule, x, 0, 0.4, 0.008);
    INFO("recovery time " << found << " s");
    CHECK(found == Approx(0.2).epsilon(0.05));
}

TEST_CASE("a sphere that a tool has pressed comes back in the time asked for", "[foundation]") {
    const Capsule capsule(icosphere({.radius = 0.01, .subdivisions = 1}));
    Points<double> x = capsule.mesh.positions();
    AabbTree tree(capsule.mesh);
    ContactTracker tracker(capsule.mesh);
    QuasiStaticSolver solver(capsule.network, {.layers = unlimited, .sweeps = 20});
    for (int i = 0; i <= 100; ++i) {
        const Tool<double> tool{.position = {0, 0, 0.0135 - 2e-5 * i}, .radius = 3e-3};
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, capsule.network, capsule.foundation, press(tool, contact));
        tree.refit(x, report.moved);
    }
    // At first the membrane helps.
    const double found = recovery(capsule, x, 0.6, 1.2, 0.008);
    INFO("recovery time " << found << " s");
    CHECK(found == Approx(0.2).epsilon(0.05));
}

TEST_CASE("foundation springs own what they know", "[foundation]") {
    auto mesh = std::make_unique<TriangleMesh<double>>(icosphere({.radius = 1, .subdivisions = 0}));
    auto first = std::make_unique<FoundationSprings<double>>(
        *mesh, FoundationOptions<double>{.normal = 3, .tangential = 1, .recovery_time = 0.1});
    const auto expected = first->force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force;
    mesh.reset();
    const auto copy = *first;
    const auto moved = std::move(*first);
    first.reset();
    CHECK(copy.force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force == expected);
    CHECK(moved.force_on(7, {1, 2, 3}, {0, 0, 0}, 0.5).force == expected);
}

TEMPLATE_TEST_CASE("foundation springs that make no sense are refused by name", "[foundation][bad]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 0});
    const auto refused = [&](const FoundationOptions<S>& options) {
        return test::refusal([&] { FoundationSprings(mesh, options); });
    };
    const std::string name = "FoundationSprings: ";
    CHECK(refused({}) == name + "normal [N/m] is required");
    CHECK(refused({.normal = S(1)}) == name + "tangential [N/m] is required");
    CHECK(refused({.normal = S(0), .tangential = S(0)}) == "");
    CHECK(refused({.normal = S(-3), .tangential = S(0)}) ==
          name + "normal must be finite and not negative [N/m], got -3");
    CHECK(refused({.normal = S(1), .tangential = std::vector<S>(11, 1)}) ==
          name + "tangential must be one number or one for each vertex (12), got 11");
    std::vector<S> time(12, 1);
    time[11] = std::numeric_limits<S>::infinity();
    CHECK(refused({.normal = S(1), .tangential = S(1), .recovery_time = time}) ==
          name + "recovery_time of vertex 11 must be finite and not negative [s], got inf");
}
