// SPDX-License-Identifier: MIT
#include <membrane/model/moving_foundation.hpp>

#include <limits>

#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

/// A model of one's own, that knows of no body that moves: it stiffens, and differently along the three axes.
template <class S>
struct Moss {
    [[nodiscard]] VertexForce<S> force_on(Index v, const Vector3<S>& position, const Vector3<S>& start,
                                          S dt) const noexcept {
        const Vector3<S> displacement = position - point(anchors, v);
        const Vector3<S> k(1, 2, 3);
        return {-(1 + squared_norm(displacement)) * k.cwiseProduct(displacement) - S(0.01) / dt * (position - start),
                S(12)};
    }
    Points<S> anchors;
};

template <class S>
Symmetric3<S> outward_stiffness(S normal, S tangential, const Vector3<S>& n) {
    auto k = diagonal3(tangential);
    k += outer<S>(normal - tangential, n);
    return k;
}

}  // namespace

TEMPLATE_TEST_CASE("on a body that moves rigidly every model pulls as at rest, turned", "[moving_foundation]",
                   TEST_SCALARS) {
    using S = TestType;
    const S tolerance = 3000 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
        const VirtualVolumeSprings volume(mesh, {.stiffness = S(3), .damping = S(0.2)});
        const FoundationSprings foundation(mesh, {.normal = S(5), .tangential = S(2), .recovery_time = S(0.1)});
        const Moss<S> moss{mesh.positions()};
        MovingBody body(mesh);
        Points<S> x = mesh.positions();
        const RigidFrame<S> pose{.rotation = random.rotation<S>(), .origin = random.vector<S>()};
        if (seed % 2 == 0) {
            REQUIRE(body.move_to(pose, x));
        } else {
            REQUIRE(body.move_to(((pose.rotation * x).colwise() + pose.origin.eigen()).eval(), S(0.1), x));
        }
        const Index v = random.index(42);
        const Vector3<S> position = point(mesh.positions(), v) + S(0.3) * random.vector<S>(),
                         start = point(mesh.positions(), v) + S(0.3) * random.vector<S>();
        const auto check = [&](const auto& model) {
            const auto moved = on(body, model);
            STATIC_REQUIRE(FoundationModel<decltype(moved), S>);
            const auto there = moved.force_on(v, pose.point_to_world(position), pose.point_to_world(start), S(0.01));
            const auto here = model.force_on(v, position, start, S(0.01));
            REQUIRE(norm<S>(there.force - pose.vector_to_world(here.force)) <= tolerance);
            REQUIRE(there.stiffness == here.stiffness);
        };
        check(volume);
        check(foundation);
        check(moss);
        check(NoFoundation{});
        REQUIRE(on(body, volume).energy(v, pose.point_to_world(position)) == Approx(volume.energy(v, position)));
        REQUIRE(on(body, foundation).energy(v, pose.point_to_world(position)) ==
                Approx(foundation.energy(v, position)));
        const auto spring = on(body, volume).spring(v, pose.point_to_world(start), S(0.01));
        REQUIRE(spring.anchor == point(body.anchors(), v));
        REQUIRE(norm<S>(spring.force_on(pose.point_to_world(position)).force -
                        pose.vector_to_world(volume.force_on(v, position, start, S(0.01)).force)) <= tolerance);
        const auto k = on(body, foundation).hessian(v);
        const Vector3<S> displacement = random.vector<S>();
        REQUIRE(norm<S>(k * pose.vector_to_world(displacement) -
                        pose.vector_to_world(foundation.hessian(v) * displacement)) <= tolerance);
    }
}

TEST_CASE("on a body that is deformed springs pull to the anchors, and a foundation as its surface faces",
          "[moving_foundation]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
        const VirtualVolumeSprings volume(mesh, {.stiffness = 3.0});
        const FoundationSprings foundation(mesh, {.normal = 5.0, .tangential = 2.0});
        MovingBody body(mesh);
        Points<double> x = mesh.positions();
        const Points<double> bent = random.rotation() * test::jittered(x, 0.15, random);
        REQUIRE(body.move_to(bent, 0.1, x));
        CHECK(x == bent);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Vector3<double> off = 0.3 * random.vector(), here = point(bent, v) + off;
            REQUIRE(norm<double>(on(body, volume).force_on(v, here, here, 1.0).force + 3 * off) < 1e-14);
            REQUIRE(on(body, volume).energy(v, here) == Approx(1.5 * squared_norm(off)));
            const auto k = outward_stiffness<double>(5, 2, point(body.normals(), v));
            REQUIRE(norm<double>(on(body, foundation).force_on(v, here, here, 1.0).force + k * off) < 1e-13);
            REQUIRE(norm<double>((on(body, foundation).hessian(v) * off) - k * off) < 1e-13);
        }
        CHECK(on(body, volume).anchors() == bent);
    }
}

TEST_CASE("what goes along with its body is not damped, and what stays behind is", "[moving_foundation]") {
    Random random(1);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const VirtualVolumeSprings volume(mesh, {.stiffness = 3.0, .damping = 0.5});
    MovingBody body(mesh);
    Points<double> x = test::jittered(mesh.positions(), 0.1, random);
    const Points<double> before = x;
    REQUIRE(body.move_to(RigidFrame<double>{random.rotation(), random.vector()}, x));
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const auto pull = on(body, volume).force_on(v, point(x, v), point(x, v), 1e-3);
        REQUIRE(norm<double>(pull.force + 3 * (point(x, v) - point(body.anchors(), v))) < 1e-12);
        REQUIRE(norm(pull.force) == Approx(3 * norm<double>(point(before, v) - point(mesh.positions(), v))));
        const Vector3<double> longer = 1.1 * point(x, v) - 0.1 * point(body.anchors(), v);
        const double more = norm(on(body, volume).force_on(v, longer, point(x, v), 1e-3).force) - norm(pull.force);
        REQUIRE(more == Approx((3 + 0.5 / 1e-3) * norm<double>(longer - point(x, v))));
    }
}

TEST_CASE("the rotation of a body of floats is one of doubles to their last digits", "[moving_foundation]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const Eigen::Matrix3f single = random.rotation<float>();
        const Eigen::Matrix3d found = detail::rotation_in<double>(single);
        CHECK((found * found.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
        CHECK((found - single.cast<double>()).norm() < 1e-6);
    }
}
