// SPDX-License-Identifier: MIT
#include <membrane/surface/moving_body.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/tears.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

template <class S>
TriangleMesh<S> some_mesh(int which) {
    if (which % 3 == 0) return icosphere<S>({.radius = S(0.01), .subdivisions = 1});
    if (which % 3 == 1) return sheet<S>({.width = S(0.02), .height = S(0.005), .columns = 8, .rows = 2});  // flat
    return spherical_cap<S>({.radius = S(0.01), .diameter = S(0.016), .rings = 4});
}

template <class S>
RigidFrame<S> random_pose(Random& random) {
    return {random.rotation<S>(), S(0.05) * random.vector<S>(), random.vector<S>(), random.vector<S>()};
}

template <class S>
Points<S> carried(const Points<S>& x, const RigidFrame<S>& pose) {
    Points<S> result = x;
    for (Index v = 0; v < x.cols(); ++v) result.col(v) = pose.point_to_world(point(x, v));
    return result;
}

double misfit(const Points<double>& rest, const Points<double>& now, const RigidFrame<double>& pose) {
    return (carried(rest, pose) - now).squaredNorm();
}

}  // namespace

TEMPLATE_TEST_CASE("given by a pose or by the anchors, the body is in the same place", "[body]", TEST_SCALARS) {
    using S = TestType;
    const S tolerance = 64 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = some_mesh<S>(seed);
        MovingBody<S> by_pose(mesh), by_anchors(mesh);
        Points<S> x = test::jittered(mesh.positions(), S(1e-3), random), y = x;
        const Points<S> start = x;
        for (int move = 0; move < 5; ++move) {
            const auto pose = random_pose<S>(random);
            REQUIRE(by_pose.move_to(pose, x));
            REQUIRE(by_anchors.move_to(carried(mesh.positions(), pose), S(1e-3), y));
            REQUIRE((x - carried(start, pose)).cwiseAbs().maxCoeff() <= tolerance);
            REQUIRE((x - y).cwiseAbs().maxCoeff() <= tolerance);
            REQUIRE(by_pose.pose().same_pose(pose));
            REQUIRE((by_anchors.pose().rotation - pose.rotation).cwiseAbs().maxCoeff() <= tolerance);
            REQUIRE(norm<S>(by_anchors.pose().origin - pose.origin) <= tolerance);
            REQUIRE(by_pose.anchors() == by_anchors.anchors());
            REQUIRE((by_pose.normals() - by_anchors.normals()).cwiseAbs().maxCoeff() <= 4 * tolerance);
            REQUIRE(by_anchors.rotation_at(3) == by_anchors.pose().rotation);
        }
        CHECK(by_pose.deformations() == 0);
        CHECK(by_anchors.deformations() == 0);
    }
}

TEST_CASE("what lies on its anchor stays there, to the bit", "[body]") {
    Random random(1);
    const auto mesh = some_mesh<double>(0);
    MovingBody body(mesh);
    Points<double> x = mesh.positions();
    for (int move = 0; move < 100; ++move) {
        const auto pose = random_pose<double>(random);
        const Points<double> anchors = test::jittered(mesh.positions(), 1e-3, random);
        REQUIRE((move % 2 == 0 ? body.move_to(pose, x) : body.move_to(anchors, 1e-3, x)));
        REQUIRE(x == body.anchors());
    }
}

TEST_CASE("the pose is the best fit to the anchors, and normals are theirs", "[body]") {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = some_mesh<double>(seed);
        const auto& rest = mesh.positions();
        MovingBody body(mesh);
        Points<double> x = rest;
        const Points<double> anchors = test::jittered(carried(rest, random_pose<double>(random)), 5e-4, random);
        REQUIRE(body.move_to(anchors, 1e-3, x));
        CHECK(body.deformations() == 1);
        const auto& pose = body.pose();
        CHECK((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
        CHECK(pose.rotation.determinant() == Approx(1));
        for (int other = 0; other < 20; ++other) {
            RigidFrame<double> near = pose;
            const double angle = std::pow(10, random.number(-4.0, 0.0));
            near.rotation = Eigen::AngleAxisd(angle, random.unit_vector().eigen()).matrix() * pose.rotation;
            REQUIRE(misfit(rest, anchors, near) > misfit(rest, anchors, pose));
            near = pose;
            near.origin += 1e-6 * random.unit_vector();
            REQUIRE(misfit(rest, anchors, near) > misfit(rest, anchors, pose));
        }
        VertexNormals normals(mesh);
        const Points<double> at_rest = normals.values();
        normals.update(anchors);
        CHECK(body.normals() == normals.values());
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Eigen::Matrix3d turn = body.rotation_at(v);
            REQUIRE((turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-13);
            REQUIRE(norm<double>(turn * point(at_rest, v) - point(body.normals(), v)) < 1e-13);
        }
    }
}

TEST_CASE("only what is not rigid counts as a deformation", "[body]") {
    Random random(1);
    const auto mesh = some_mesh<double>(2);
    MovingBody body(mesh);
    Points<double> x = mesh.positions();
    const Points<double> bent = test::jittered(mesh.positions(), 1e-3, random);
    for (int move = 0; move < 20; ++move) REQUIRE(body.move_to(carried(bent, random_pose<double>(random)), 1e-3, x));
    CHECK(body.deformations() == 1);
    REQUIRE(body.move_to(random_pose<double>(random), x));  // as the mesh again
    CHECK(body.deformations() == 2);
    REQUIRE(body.move_to(random_pose<double>(random), x));
    CHECK(body.deformations() == 2);
    REQUIRE(body.move_to((1.001 * mesh.positions()).eval(), 1e-3, x));
    CHECK(body.deformations() == 3);
}

TEST_CASE("velocities are the pose's, or those of the anchors", "[body]") {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = some_mesh<double>(seed);
        MovingBody by_pose(mesh), by_anchors(mesh), swells(mesh);
        Points<double> x = mesh.positions();
        const auto pose = random_pose<double>(random);
        const auto& corners = mesh.triangles().col(random.index(mesh.triangle_count()));
        const std::array<Index, 3> vertices{corners[0], corners[1], corners[2]};
        const auto weights = random.barycentric();
        const Vector3<double> place = 0.02 * random.vector();
        REQUIRE(by_pose.move_to(pose, x));
        CHECK(norm<double>(by_pose.velocity_at(place, vertices, weights) - pose.velocity_at(place)) < 1e-15);

        const double dt = 1e-6, speed = norm(pose.angular_velocity);
        RigidFrame<double> later = pose;
        later.origin += dt * pose.velocity;
        later.rotation =
            Eigen::AngleAxisd(speed * dt, (pose.angular_velocity / speed).eigen()).matrix() * pose.rotation;
        REQUIRE(by_anchors.move_to(carried(mesh.positions(), pose), 1, x));
        REQUIRE(by_anchors.move_to(carried(mesh.positions(), later), dt, x));
        const Vector3<double> expected = later.velocity_at(place);
        CHECK(norm<double>(by_anchors.velocity_at(place, vertices, weights) - expected) < 1e-6);
        REQUIRE(by_anchors.move_to(Points<double>(by_anchors.anchors()), dt, x));  // it has stopped
        CHECK(norm(by_anchors.velocity_at(place, vertices, weights)) < 1e-7);

        REQUIRE(swells.move_to((1.01 * mesh.positions()).eval(), 0.1, x));
        const auto held = point_at(triangle_at(mesh.positions(), vertices), weights);
        CHECK(norm<double>(swells.velocity_at(1.01 * held, vertices, weights) - 0.1 * held) < 1e-12);
    }
}

TEMPLATE_TEST_CASE("a number that is not finite is refused, and nothing has moved", "[body][bad]", TEST_SCALARS) {
    using S = TestType;
    using Limits = std::numeric_limits<S>;
    Random random(1);
    const auto mesh = some_mesh<S>(0);
    MovingBody<S> body(mesh);
    Points<S> x = test::jittered(mesh.positions(), S(1e-3), random);
    REQUIRE(body.move_to(test::jittered(mesh.positions(), S(1e-3), random), S(1e-3), x));
    const Points<S> anchors = body.anchors(), normals = body.normals(), before = x;
    const auto pose = body.pose();
    const std::array<Index, 3> corners{0, 1, 2};
    const Vector3<S> weights(1, 0, 0), velocity = body.velocity_at(point(x, 0), corners, weights);
    const auto check_unmoved = [&] {
        REQUIRE(same_bits(body.anchors(), anchors));
        REQUIRE(same_bits(body.normals(), normals));
        REQUIRE(body.pose().same_pose(pose));
        REQUIRE(body.velocity_at(point(before, 0), corners, weights) == velocity);
    };
    for (const S bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
        for (int k = 0; k < 3; ++k) {
            CAPTURE(bad, k);
            Points<S> wrong = anchors;
            wrong(k, 7) = bad;
            CHECK_FALSE(body.move_to(wrong, S(1e-3), x));
            RigidFrame<S> frame;
            frame.origin[k] = bad;
            CHECK_FALSE(body.move_to(frame, x));
            frame = {};
            frame.velocity[k] = bad;
            CHECK_FALSE(body.move_to(frame, x));
            frame = {};
            frame.angular_velocity[k] = bad;
            CHECK_FALSE(body.move_to(frame, x));
            frame = {};
            frame.rotation(k, k) = bad;
            CHECK_FALSE(body.move_to(frame, x));
            check_unmoved();
            REQUIRE(same_bits(x, before));
            Points<S> lost = x;
            lost(k, 3) = bad;
            const Points<S> lost_before = lost;
            CHECK_FALSE(body.move_to(RigidFrame<S>(), lost));
            CHECK_FALSE(body.move_to(anchors, S(1e-3), lost));
            REQUIRE(same_bits(lost, lost_before));
            check_unmoved();
        }
    }
    for (const S wrong : {S(0), S(-1), Limits::quiet_NaN(), Limits::infinity(), Limits::denorm_min()}) {
        CHECK_FALSE(body.move_to(mesh.positions(), wrong, x));
        check_unmoved();
        REQUIRE(same_bits(x, before));
    }
    // So far off that what is carried there has no number: refused as well.
    RigidFrame<S> far;
    far.origin = Vector3<S>::Constant((Limits::max)());
    Points<S> off = (Limits::max)() / 2 * Points<S>::Ones(3, x.cols());
    CHECK_FALSE(body.move_to(far, off));
    check_unmoved();
}

TEMPLATE_TEST_CASE("where no return has a finite velocity, a pose returns the body", "[body][bad]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = some_mesh<S>(0);
    MovingBody<S> body(mesh);
    Points<S> x = mesh.positions();
    RigidFrame<S> far;
    far.origin[1] = std::numeric_limits<S>::max();
    REQUIRE(body.move_to(far, x));
    const Points<S> before = x, anchors = body.anchors();
    CHECK_FALSE(body.move_to(mesh.positions(), S(1e-3), x));
    CHECK(same_bits(x, before));
    CHECK(same_bits(body.anchors(), anchors));
    CHECK(body.move_to(RigidFrame<S>(), x));
    CHECK(same_bits(body.anchors(), mesh.positions()));
}

TEST_CASE("a tear does not part the body: a copy has the anchor and the normal of its vertex", "[body][tear]") {
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> surface(test::surface_of(some_mesh<double>(seed)), 30);
        MovingBody<double> body(surface.mesh()), whole = body;
        Points<double> x = surface.mesh().positions(), y = x;
        const Index vertices = surface.used();
        std::vector<std::array<Index, 2>> copies;
        const auto follow = [&](const VertexSplit& split) {
            body.split(split);
            x.col(split.copy) = x.col(split.vertex);
            copies.push_back({split.vertex, split.copy});
        };
        while (surface.tear(random, follow)) {
            if (random.chance(0.5)) {
                const auto pose = random_pose<double>(random);
                REQUIRE(body.move_to(pose, x));
                REQUIRE(whole.move_to(pose, y));
            } else {
                const Points<double> anchors = test::jittered(whole.anchors(), 1e-3, random);
                REQUIRE(body.move_to(anchors, 1e-3, x));
                REQUIRE(whole.move_to(anchors, 1e-3, y));
            }
            REQUIRE(body.pose().rotation == whole.pose().rotation);
            REQUIRE(body.deformations() == whole.deformations());
            REQUIRE(body.anchors().leftCols(vertices) == whole.anchors().leftCols(vertices));
            REQUIRE(body.normals().leftCols(vertices) == whole.normals().leftCols(vertices));
            REQUIRE(x.leftCols(vertices) == y.leftCols(vertices));
            for (const auto& [vertex, copy] : copies) {
                REQUIRE(body.anchors().col(copy) == body.anchors().col(vertex));
                REQUIRE(body.normals().col(copy) == body.normals().col(vertex));
                REQUIRE(body.rotation_at(copy) == body.rotation_at(vertex));
                REQUIRE(x.col(copy) == x.col(vertex));
            }
        }
    }
}

TEST_CASE("counts that differ and a rotation that is none are refused, and nothing moves", "[body][bad]") {
    const auto mesh = some_mesh<double>(0);
    MovingBody body(mesh);
    Points<double> x = mesh.positions(), fewer = x.leftCols(11);
    RigidFrame<double> mirror, stretched;
    mirror.rotation(2, 2) = -1;
    stretched.rotation *= 1.1;
    Eigen::MatrixXd rows = x.transpose();
    CHECK_FALSE(body.move_to(RigidFrame<double>(), fewer));
    CHECK_FALSE(body.move_to(RigidFrame<double>(), rows));
    CHECK_FALSE(body.move_to(fewer, 1, x));
    CHECK_FALSE(body.move_to(x, 1, fewer));
    CHECK_FALSE(body.move_to(mirror, x));
    CHECK_FALSE(body.move_to(stretched, x));
    CHECK(x == mesh.positions());
    CHECK(body.anchors() == mesh.positions());
    CHECK(body.move_to(RigidFrame<double>(), x));
}
