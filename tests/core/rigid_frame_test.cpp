// SPDX-License-Identifier: MIT
#include <membrane/core/rigid_frame.hpp>

#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;

namespace {

template <class S>
RigidFrame<S> random_frame(test::Random& random) {
    return {random.rotation<S>(), random.vector<S>(), random.vector<S>(), random.vector<S>()};
}

}  // namespace

TEMPLATE_TEST_CASE("a frame at rest in the world changes nothing", "[core]", double, float) {
    using S = TestType;
    const RigidFrame<S> world;
    const Vector3<S> p(1, -2, 3), v(S(0.5), 4, 0);
    CHECK(world.point_to_body(p) == p);
    CHECK(world.point_to_world(p) == p);
    CHECK(world.vector_to_body(p) == p);
    CHECK(world.vector_to_world(p) == p);
    CHECK(world.velocity_in(v, p) == v);
}

TEST_CASE("a frame turned by hand", "[core]") {
    RigidFrame<double> frame;
    frame.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // the body's x is the world's y
    frame.origin = {10, 0, 0};
    CHECK(frame.point_to_world({1, 0, 0}) == Vector3<double>(10, 1, 0));
    CHECK(frame.point_to_body({10, 1, 0}) == Vector3<double>(1, 0, 0));
    CHECK(frame.vector_to_world({1, 0, 0}) == Vector3<double>(0, 1, 0));
    CHECK(frame.vector_to_body({0, 1, 0}) == Vector3<double>(1, 0, 0));
    frame.angular_velocity = {0, 0, 2};
    // What stands still in the world 1 m along the body's x seems to run backwards along the circle.
    CHECK(frame.velocity_in({0, 0, 0}, {10, 1, 0}) == Vector3<double>(0, -2, 0));
    frame.velocity = {0, 3, 0};
    CHECK(frame.velocity_in({0, 3, 0}, {10, 0, 0}) == Vector3<double>(0, 0, 0));
}

TEMPLATE_TEST_CASE("into a frame and out of it again", "[core]", double, float) {
    using S = TestType;
    const S tolerance = 16 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto frame = random_frame<S>(random);
        const Vector3<S> p = random.vector<S>(), q = random.vector<S>();
        REQUIRE(norm<S>(frame.point_to_world(frame.point_to_body(p)) - p) < tolerance);
        REQUIRE(norm<S>(frame.point_to_body(frame.point_to_world(p)) - p) < tolerance);
        REQUIRE(norm<S>(frame.vector_to_world(frame.vector_to_body(p)) - p) < tolerance);
        REQUIRE(norm<S>(frame.point_to_world(p) - (frame.rotation * p + frame.origin)) < tolerance);
        REQUIRE(norm<S>(frame.vector_to_body(p) - frame.rotation.transpose() * p) < tolerance);
        // Directions are differences of points; lengths and angles stay.
        REQUIRE(norm<S>(frame.vector_to_body(p - q) - (frame.point_to_body(p) - frame.point_to_body(q))) < tolerance);
        REQUIRE(std::abs(dot(frame.vector_to_body(p), frame.vector_to_body(q)) - dot(p, q)) < tolerance);
    }
}

TEMPLATE_TEST_CASE("the motion from one pose to another takes along what is on the body", "[core]", double, float) {
    using S = TestType;
    const S tolerance = 32 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto from = random_frame<S>(random), to = random_frame<S>(random);
        const auto motion = motion_between(from, to);
        const Vector3<S> p = random.vector<S>();
        REQUIRE(norm<S>(motion.point_to_world(from.point_to_world(p)) - to.point_to_world(p)) < tolerance);
        REQUIRE(norm<S>(motion.vector_to_world(from.vector_to_world(p)) - to.vector_to_world(p)) < tolerance);
        REQUIRE(motion.velocity == Vector3<S>(0, 0, 0));
        REQUIRE(from.same_pose(from));
        REQUIRE_FALSE(from.same_pose(to));
        // What moves with the body stands still on it.
        REQUIRE(norm<S>(to.velocity_in(to.velocity_at(p), p)) < tolerance);
    }
}

TEST_CASE("a velocity seen from a frame is how fast the point moves in it", "[core]") {
    const double h = 1e-5;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto now = random_frame<double>(random);
        const Vector3<double> p = random.vector(), velocity = random.vector();
        const auto place_at = [&](double t) {  // both go on for a time t
            RigidFrame<double> then = now;
            const double speed = norm(now.angular_velocity);
            then.rotation =
                Eigen::AngleAxisd(speed * t, (now.angular_velocity / speed).eigen()).matrix() * now.rotation;
            then.origin += t * now.velocity;
            return then.point_to_body(p + t * velocity);
        };
        const Vector3<double> difference = (place_at(h) - place_at(-h)) / (2 * h);
        REQUIRE(norm<double>(now.velocity_in(velocity, p) - difference) < 1e-8);
    }
}
