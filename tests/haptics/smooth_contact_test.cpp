// SPDX-License-Identifier: MIT
#include <membrane/haptics/smooth_contact.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

namespace {

template <Real S>
Contact<S> touching(Index triangle, const Vector3<S>& tool) {
    Contact<S> contact;
    contact.phase = ContactPhase::ongoing;
    contact.triangle = triangle;
    contact.patch.axis_point = tool;
    contact.normal = Vector3<S>(1, 0, 0);
    contact.patch.radius = S(1e-3);
    return contact;
}

/// A ball with hills and valleys.
template <Real S>
TriangleMesh<S> uneven_ball(Random& random, Index subdivisions, double unevenness) {
    const auto ball = icosphere<S>({.radius = S(0.01), .subdivisions = subdivisions});
    Points<S> x = ball.positions();
    for (Index v = 0; v < x.cols(); ++v) x.col(v) *= 1 + static_cast<S>(unevenness * random.number(-1.0, 1.0));
    return TriangleMesh<S>(x, ball.triangles());
}

}  // namespace

TEMPLATE_TEST_CASE("the proxy has the tool along its normal, above and below the surface", "[smooth]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<S>(random, 2, 0.02);
        const auto normals = VertexNormals(mesh).values();
        const auto smooth = SmoothContact(mesh);
        const auto tree = AabbTree(mesh);
        for (int i = 0; i < 10; ++i) {
            const Index f = random.index(mesh.triangle_count());
            const Vector3<S> weights = random.barycentric().cast<S>();
            const auto corners = mesh.triangles().col(f);
            const Vector3<S> normal = direction<S>(point_at(triangle_at(normals, corners), weights), {1, 0, 0});
            const auto height = static_cast<S>(random.number(-2e-3, 2e-3));
            const Vector3<S> foot = point_at(triangle_at(mesh.positions(), corners), weights);
            const Vector3<S> tool = foot + height * normal;
            auto contact = touching<S>(tree.closest_point(mesh.positions(), tool).triangle, tool);
            contact.patch.side = random.chance(0.5) ? S(1) : S(-1);
            const auto found = smooth(contact);
            CHECK(norm<S>(found.normal - contact.patch.side * normal) < 2e3 * std::numeric_limits<S>::epsilon());
            CHECK(found.depth == contact.depth);
            CHECK(found.triangle == contact.triangle);
        }
    }
}

TEST_CASE("however small the steps of a tool, its normal turns in proportion", "[smooth]") {
    for (int seed = 1; seed <= cases(10); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<double>(random, 2, 0.01);
        const auto x = mesh.positions();
        const auto tree = AabbTree(mesh);
        const auto smooth = SmoothContact(mesh);
        const Vector3<double> from = point(x, random.index(static_cast<Index>(x.cols()))) / 0.01;
        const Vector3<double> across = direction<double>(cross<double>(from, random.unit_vector()), {1, 0, 0});
        for (const double height :
             {0.5e-3, -0.7e-3}) {  // of the centre: where faces meet the nearest point jumps below
            double turned = 0, jumped = 0;
            for (const double step : {4e-3, 2e-3, 1e-3}) {  // [rad]; an edge is 0.3 long
                auto tracker = ContactTracker(mesh);
                Vector3<double> last = Vector3<double>::Zero(), last_flat = last;
                double largest = 0, flat = 0;
                for (int i = -1; i * step < 1; ++i) {
                    Tool<double> tool{.radius = 1e-3};
                    const double displacement = i * step;
                    // From outside, then at one height.
                    tool.position = (i < 0 ? 0.0105 : 0.01 + height) *
                                    (std::cos(displacement) * from + std::sin(displacement) * across);
                    const auto contact = tracker.update(tree, x, tool);
                    REQUIRE(contact.touching());
                    const auto found = smooth(contact);
                    REQUIRE(std::abs(norm(found.normal) - 1) < 1e-12);
                    if (i > 0) {
                        largest = std::max(largest, norm<double>(found.normal - last));
                        flat = std::max(flat, norm<double>(contact.normal - last_flat));
                    }
                    last = found.normal;
                    last_flat = contact.normal;
                }
                if (turned > 0) {
                    CHECK(largest > 0.4 * turned);
                    CHECK(largest < 0.6 * turned);
                    if (height < 0) CHECK(flat > 0.8 * jumped);  // the triangles themselves
                }
                turned = largest;
                jumped = flat;
            }
        }
    }
}

TEMPLATE_TEST_CASE("at a vertex its normal, on an edge both, beyond a border the border's", "[smooth]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = sheet<S>({.width = 2, .height = 2, .columns = 1, .rows = 1});  // two triangles
    const auto smooth = SmoothContact(mesh);
    Points<S> x = mesh.positions();
    MovingBody<S> body(mesh);
    Points<S> warped = x;
    warped.row(2) << S(0.2), S(-0.1), S(0), S(0.3);
    REQUIRE(body.move_to(warped, S(1), x));
    const auto corners = mesh.triangles().col(0);
    CHECK((body.normals().col(corners[0]) - body.normals().col(corners[1])).norm() +
              (body.normals().col(corners[1]) - body.normals().col(corners[2])).norm() >
          S(0.05));
    const auto at = [&](const Vector3<S>& place) { return smooth(touching<S>(0, place), body).normal; };
    for (int k = 0; k < 3; ++k) {
        const Vector3<S> corner = point(warped, corners[k]), next = point(warped, corners[(k + 1) % 3]);
        const Vector3<S> here = point(body.normals(), corners[k]), there = point(body.normals(), corners[(k + 1) % 3]);
        CHECK(norm<S>(at(corner) - here) < S(1e-6));
        CHECK(norm<S>(at((corner + next) / 2) - direction<S>(here + there, here)) < S(1e-6));
        // Outside, in the planes of all its triangles: those of the diagonal are of both.
        const Vector3<S> last = point(warped, corners[(k + 2) % 3]);
        const auto other = mesh.triangles().col(1);
        const auto shared = [&](int i) { return (other.array() == corners[i % 3]).any(); };
        const Vector3<S> outside = !shared(k)      ? Vector3<S>(3 * corner - next - last)
                                   : shared(k + 1) ? Vector3<S>(2 * corner - next)
                                                   : Vector3<S>(2 * corner - last);
        CHECK(norm<S>(at(outside) - here) < S(1e-6));
    }
}

TEST_CASE("far from its triangle, where the search for the proxy goes in circles, a contact has a normal", "[smooth]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<double>(random, 1, 0.5);
        const auto smooth = SmoothContact(mesh);
        for (int i = 0; i < 20; ++i) {
            const auto contact = touching<double>(random.index(mesh.triangle_count()), 0.02 * random.vector());
            CHECK(norm(smooth(contact).normal) == Approx(1));
        }
    }
}

TEST_CASE("what is no contact, or not finite, or has no normal, stays as it is", "[smooth]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 1});
    const auto smooth = SmoothContact(mesh);
    Contact<double> contact;
    CHECK(smooth(contact).normal == contact.normal);
    contact = touching<double>(AabbTree(mesh).closest_point(mesh.positions(), {0, 0, 1}).triangle, {0, 0, 0.0105});
    MovingBody body(mesh);
    Points<double> x = mesh.positions();
    const Points<double> one_place = Points<double>::Zero(3, mesh.vertex_count());
    REQUIRE(body.move_to(one_place, 1, x));
    const auto collapsed = smooth(contact, body).normal;
    CHECK((collapsed == contact.normal || std::abs(norm(collapsed) - 1) < 1e-12));
    for (const double far : {0.0, 1e300, -1e300}) {
        contact.patch.axis_point = {0, far, 0};
        const auto found = smooth(contact).normal;
        CHECK((found == contact.normal || std::abs(norm(found) - 1) < 1e-12));
    }
    contact.patch.axis_point.x() = std::numeric_limits<double>::infinity();
    CHECK(smooth(contact).normal == contact.normal);
    contact.patch.axis_point = {0, 0, 0.0105};  // and it goes on
    CHECK(norm<double>(smooth(contact).normal - Vector3<double>(0, 0, 1)) < 1e-12);
    auto elsewhere = contact;
    elsewhere.triangle = mesh.triangle_count();
    CHECK(smooth(elsewhere).normal == contact.normal);
    CHECK(smooth(contact, MovingBody(icosphere<double>({.subdivisions = 0}))).normal == contact.normal);
}

TEST_CASE("a body that moves takes its normals along", "[smooth]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = uneven_ball<double>(random, 2, 0.02);
        const auto smooth = SmoothContact(mesh);
        const auto turn = random.rotation();
        const Vector3<double> displacement = 0.01 * random.unit_vector();
        MovingBody body(mesh);
        Points<double> x = mesh.positions();
        const Points<double> anchors = (turn * x).colwise() + displacement.eigen();
        REQUIRE(
            (seed % 2 == 0 ? body.move_to(RigidFrame<double>{turn, displacement}, x) : body.move_to(anchors, 1, x)));
        const Vector3<double> tool = 0.0105 * random.unit_vector();
        const auto contact = touching(AabbTree(mesh).closest_point(mesh.positions(), tool).triangle, tool);
        auto seen = contact;
        seen.patch.axis_point = turn * contact.patch.axis_point + displacement;
        CHECK(norm<double>(smooth(seen, body).normal - turn * smooth(contact).normal) < 1e-9);
    }
}
