// SPDX-License-Identifier: MIT
#include <membrane/contact/grasper.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/surface/moving_body.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/tears.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S>
Contact<S> contact_at(const TriangleMesh<S>& mesh, Index f, const Vector3<S>& barycentric) {
    Contact<S> contact;
    contact.phase = ContactPhase::ongoing;
    contact.triangle = f;
    contact.corners = {mesh.triangles()(0, f), mesh.triangles()(1, f), mesh.triangles()(2, f)};
    contact.barycentric = barycentric;
    return contact;
}

template <class S>
bool same(const Grasp<S>& a, const Grasp<S>& b) {
    return a.triangle == b.triangle && a.corners == b.corners && a.barycentric == b.barycentric &&
           a.offset == b.offset && a.origin == b.origin;
}

}  // namespace

TEMPLATE_TEST_CASE("forceps take hold of the point they touch, and it goes with them", "[grasp]", TEST_SCALARS) {
    using S = TestType;
    const S tolerance = 16 * std::numeric_limits<S>::epsilon();
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<S>({.radius = 1, .subdivisions = 1});
        Points<S> x = test::jittered(mesh.positions(), S(0.1), random);
        Grasper<S> grasper(mesh);
        const Index f = random.index(80);
        const auto contact = contact_at<S>(mesh, f, random.barycentric<S>());
        Tool<S> tool{.position = random.vector<S>(), .radius = S(0.1)};
        REQUIRE_FALSE(grasper.update(contact, x, tool).holding());

        tool.grasping = true;
        const auto grasp = grasper.update(contact, x, tool);
        REQUIRE(grasp.holding());
        REQUIRE(grasp.triangle == f);
        REQUIRE(grasp.corners == contact.corners);
        REQUIRE(grasp.barycentric == contact.barycentric);
        const Vector3<S> held = point_at(triangle_at(x, grasp.corners), grasp.barycentric);
        REQUIRE(norm<S>(tool.position + grasp.offset - held) <= tolerance);
        const Vector3<S> at_first = point_at(triangle_at(mesh.positions(), grasp.corners), grasp.barycentric);
        REQUIRE(norm<S>(grasp.origin - at_first) <= tolerance);

        const Vector3<S> displacement = random.vector<S>(), so_far = grasp.displacement(tool);
        REQUIRE(norm<S>(so_far - (held - at_first)) <= tolerance);
        Tool<S> taken = tool;
        taken.position += displacement;
        REQUIRE(norm<S>(grasp.displacement(taken) - (so_far + displacement)) <= tolerance);

        // Closed, they hold the same whatever else they touch, lose, or how the membrane moves.
        tool.position += random.vector<S>();
        x = test::jittered(x, S(0.1), random);
        REQUIRE(same(grasper.update(contact_at<S>(mesh, (f + 1) % 80, {1, 0, 0}), x, tool), grasp));
        REQUIRE(same(grasper.update(Contact<S>::none(), x, tool), grasp));

        tool.grasping = false;
        REQUIRE_FALSE(grasper.update(contact, x, tool).holding());
        tool.grasping = true;  // and once more, elsewhere
        REQUIRE(grasper.update(contact_at<S>(mesh, (f + 1) % 80, {1, 0, 0}), x, tool).triangle == (f + 1) % 80);
    }
}

namespace {

/// What a tool that closes on the membrane holds.
Vector3<double> point_held(const TriangleMesh<double>& mesh, const Points<double>& x, const Tool<double>& tool) {
    AabbTree<double> tree(mesh);
    tree.refit(x);
    ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
    Grasper<double> grasper(mesh);
    const auto grasp = grasper.update(tracker.update(tree, x, tool), x, tool);
    REQUIRE(grasp.holding());
    return tool.position + grasp.offset;
}

}  // namespace

TEST_CASE("in a fold forceps hold a point between its sides, whichever rounding makes the nearer", "[grasp]") {
    const auto mesh = sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double slope = random.number(0.1, 1.0), radius = random.number(0.03, 0.2);
        const double across = radius * slope / std::sqrt(1 + slope * slope);  // from the fold to where it touches
        const Tool<double> tool{
            .position = {0, random.number(-0.3, 0.3), (radius - 1e-6) * std::sqrt(1 + slope * slope)},
            .radius = radius,
            .grasping = true};
        const auto held = [&](double disturbance) {
            Points<double> x = mesh.positions();
            x.row(2) = slope * x.row(0).cwiseAbs();
            x = test::jittered<double>(x, disturbance, random);
            return point_held(mesh, x, tool);
        };
        const auto point = held(0);
        CHECK(std::abs(point.x()) < across);
        for (int i = 0; i < 4; ++i) CHECK(norm<double>(held(1e-13) - point) < 1e-9);
    }
}

TEST_CASE("a shaft on two hills holds the one at its tip, whichever rounding makes the nearer", "[grasp]") {
    const auto mesh = sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double height = random.number(0.2, 0.4), radius = random.number(0.005, 0.03);
        const double tip = random.chance(0.5) ? -1 : 1;
        const Tool<double> tool{.position = {0.45 * tip, 0, height + radius - 1e-6},
                                .axis = {-0.9 * tip, 0, 0},
                                .radius = radius,
                                .grasping = true};
        Points<double> x = mesh.positions();
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            const bool hill = std::abs(std::abs(x(0, v)) - 0.3) < 0.01 && std::abs(x(1, v)) < 0.01;
            if (hill) x(2, v) = height + random.number(-1e-13, 1e-13);
        }
        CHECK(norm<double>(point_held(mesh, x, tool) - Vector3<double>(0.3 * tip, 0, height)) < 1e-9);
    }
}

TEST_CASE("forceps that were closed before they touched hold nothing", "[grasp]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    Grasper<double> grasper(mesh);
    Tool<double> tool{.grasping = true};
    const auto contact = contact_at<double>(mesh, 3, {0.2, 0.3, 0.5});
    CHECK_FALSE(grasper.update(Contact<double>::none(), mesh.positions(), tool).holding());
    CHECK_FALSE(grasper.update(contact, mesh.positions(), tool).holding());
    CHECK(grasper.update(contact, mesh.positions(), tool).status == GraspStatus::missed);
    tool.grasping = false;
    CHECK_FALSE(grasper.update(contact, mesh.positions(), tool).holding());
    CHECK(grasper.update(contact, mesh.positions(), tool).status == GraspStatus::open);
    tool.grasping = true;
    CHECK(grasper.update(contact, mesh.positions(), tool).holding());
    CHECK(grasper.update(contact, mesh.positions(), tool).status == GraspStatus::holding);
    grasper.reset();
    CHECK_FALSE(grasper.update(Contact<double>::none(), mesh.positions(), tool).holding());
    grasper.reset();
    CHECK(grasper.update(contact, mesh.positions(), tool).holding());  // as a new one takes hold
}

// That it slips beyond what the jaws hold: solve/slipping_grasp_test.cpp.
TEST_CASE("forceps do not slip below what the jaws hold, or if they hold nothing", "[grasp]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    Grasper<double> grasper(mesh, {.holding_force = 2.0, .jaw_length = 0.1});
    const Tool<double> tool{.grasping = true}, moved{.position = {0.01, 0, 0}, .grasping = true};
    CHECK_FALSE(grasper.slip(mesh.positions(), moved, {3, 0, 0}));
    const auto grasp = grasper.update(contact_at<double>(mesh, 3, {0.2, 0.3, 0.5}), mesh.positions(), tool);
    REQUIRE(grasp.holding());
    CHECK_FALSE(grasper.slip(mesh.positions(), moved, {1.99, 0, 0}));
    const auto still = grasper.update(Contact<double>::none(), mesh.positions(), tool);
    CHECK(still.offset == grasp.offset);
    CHECK(grasper.slip(mesh.positions(), moved, {2, 0, 0}));
    CHECK(grasper.update(Contact<double>::none(), mesh.positions(), tool).offset != grasp.offset);
    const Tool<double> away{.position = {0.2, 0, 0}, .grasping = true};
    CHECK(grasper.slip(mesh.positions(), away, {2, 0, 0}));
    CHECK(grasper.update(Contact<double>::none(), mesh.positions(), away).status == GraspStatus::slipped);
}

TEST_CASE("a contact that has ended is not held, one that begins is", "[grasp]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    for (const auto& [phase, holds] : {std::pair(ContactPhase::none, false),
                                       {ContactPhase::began, true},
                                       {ContactPhase::ongoing, true},
                                       {ContactPhase::ended, false}}) {
        Grasper<double> grasper(mesh);
        auto contact = contact_at<double>(mesh, 3, {0.2, 0.3, 0.5});
        contact.phase = phase;
        CHECK(grasper.update(contact, mesh.positions(), Tool<double>{.grasping = true}).holding() == holds);
    }
}

TEST_CASE("on request they hold the nearest vertex", "[grasp]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    for (int k = 0; k < 3; ++k) {
        Grasper<double> grasper(mesh, {.snap_to_vertex = true});
        Vector3<double> barycentric(0.3, 0.3, 0.3);
        barycentric[k] = 0.4;
        const auto contact = contact_at(mesh, 3, barycentric);
        const Tool<double> tool{.position = {1, 2, 3}, .grasping = true};
        const auto grasp = grasper.update(contact, mesh.positions(), tool);
        CHECK(grasp.barycentric == Vector3<double>::Unit(k));
        const Vector3<double> vertex = point(mesh.positions(), contact.corners[static_cast<std::size_t>(k)]);
        CHECK(norm<double>(tool.position + grasp.offset - vertex) < 1e-15);
        CHECK(grasp.origin == vertex);
    }
}

TEST_CASE("a tool that is no tool takes no hold", "[grasp][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    Grasper<double> grasper(mesh);
    const auto contact = contact_at<double>(mesh, 3, {0.2, 0.3, 0.5});
    Tool<double> tool{.position = {std::nan(""), 0, 0}, .grasping = true};
    CHECK_FALSE(grasper.update(contact, mesh.positions(), tool).holding());
}

TEST_CASE("points and contacts of another membrane take no hold and change none", "[grasp][bad]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0}), other = icosphere({.subdivisions = 1});
    const auto contact = contact_at<double>(mesh, 3, {0.2, 0.3, 0.5});
    auto elsewhere = contact;
    elsewhere.corners[1] = 12;
    const Tool<double> tool{.grasping = true};
    const MovingBody body(other);
    const Eigen::MatrixXd rows = mesh.positions().transpose();
    Grasper<double> grasper(mesh), fresh(mesh);
    CHECK_FALSE(fresh.update(elsewhere, mesh.positions(), tool).holding());
    CHECK_FALSE(grasper.update(contact, rows, tool).holding());
    CHECK_FALSE(grasper.update(contact, other.positions(), tool).holding());
    const auto grasp = grasper.update(contact, mesh.positions(), tool);  // as none of these was a closing of the jaws
    REQUIRE(grasp.holding());
    CHECK(same(grasper.update(contact, rows, Tool<double>{}), grasp));
    CHECK(same(grasper.update(contact, mesh.positions(), tool, body), grasp));
    CHECK_FALSE(grasper.slip(rows, tool, Vector3<double>(0, 0, 1e9)));
}

TEST_CASE("forceps are copied and moved with what they hold", "[grasp]") {
    auto mesh = std::make_unique<TriangleMesh<double>>(icosphere({.radius = 1, .subdivisions = 0}));
    const Points<double> x = mesh->positions();
    const auto contact = contact_at<double>(*mesh, 3, {0.2, 0.3, 0.5});
    auto first = std::make_unique<Grasper<double>>(*mesh);
    const Tool<double> tool{.grasping = true};
    const auto grasp = first->update(contact, x, tool);
    mesh.reset();
    Grasper<double> copy = *first, moved = std::move(*first);
    first.reset();
    CHECK(same(copy.update(Contact<double>::none(), x, tool), grasp));
    CHECK(same(moved.update(Contact<double>::none(), x, tool), grasp));
    CHECK_FALSE(copy.update(contact, x, Tool<double>{}).holding());
    CHECK(copy.update(contact, x, tool).origin == grasp.origin);
    STATIC_REQUIRE(noexcept(copy.update(contact, std::declval<const ConstPointsRef<double>&>(), tool)));
}

TEST_CASE("on a body that moves they turn with it, and the displacement is relative to it", "[grasp]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
        MovingBody body(mesh);
        Points<double> x = mesh.positions(), still = x;
        Grasper<double> grasper(mesh), at_rest(mesh);
        const auto contact = contact_at<double>(mesh, random.index(80), random.barycentric());
        Tool<double> tool{.position = random.vector(), .grasping = true};
        for (int move = 0; move < 10; ++move) {
            RigidFrame<double> pose{.rotation = random.rotation(), .origin = random.vector()};
            pose.velocity = random.vector();
            pose.angular_velocity = random.vector();
            REQUIRE(body.move_to(pose, x));
            Tool<double> seen = tool;
            seen.position = pose.point_to_world(tool.position);
            const auto grasp = grasper.update(contact, x, seen, body);
            const auto expected = at_rest.update(contact, still, tool);
            REQUIRE(grasp.holding());
            REQUIRE(norm<double>(grasp.offset - pose.vector_to_world(expected.offset)) < 1e-14);
            REQUIRE(norm<double>(grasp.displacement(seen) - pose.vector_to_world(expected.displacement(tool))) < 1e-14);
            REQUIRE(norm<double>(grasp.body_velocity - pose.velocity_at(seen.position)) < 1e-14);
            tool.position += 0.1 * random.vector();
        }
        grasper.reset();  // as a new one, to the bit
        Grasper<double> fresh(mesh);
        REQUIRE(same(grasper.update(contact, x, tool, body), fresh.update(contact, x, tool, body)));
    }
}

TEST_CASE("a held point stays in its triangle while the surface tears", "[grasp][tear]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> surface(test::random_surface<double>(random), 40);
        const auto whole = surface.mesh();
        Grasper<double> grasper(whole);
        const Index f = random.index(whole.triangle_count());
        const auto contact = contact_at<double>(whole, f, random.barycentric());
        const Tool<double> tool{.position = random.vector(), .grasping = true};
        const auto before = grasper.update(contact, whole.positions(), tool);
        while (surface.tear(random, [&](const VertexSplit& split) { grasper.split(split); })) {
            const auto mesh = surface.mesh();
            const auto grasp = grasper.update(contact, mesh.positions(), tool);
            const auto corners = mesh.triangles().col(f);
            REQUIRE(grasp.triangle == f);
            REQUIRE(grasp.corners == std::array<Index, 3>{corners[0], corners[1], corners[2]});
            REQUIRE(grasp.barycentric == before.barycentric);
            Grasper<double> anew = grasper, fresh(mesh);
            anew.reset();
            const auto again = contact_at<double>(mesh, f, before.barycentric);
            REQUIRE(same(anew.update(again, mesh.positions(), tool), fresh.update(again, mesh.positions(), tool)));
        }
    }
}

TEST_CASE("a held point stays the same point of the tissue if a vertex moves at rest", "[grasp][tear]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = disc<double>({.radius = 1, .rings = 1});  // six triangles around vertex 0
        Points<double> x = mesh.positions();
        Grasper<double> grasper(mesh);
        const auto contact = contact_at<double>(mesh, random.index(6), random.barycentric());
        const Tool<double> tool{.grasping = true};
        const auto before = grasper.update(contact, x, tool);
        const Vector3<double> held = point_at(triangle_at(x, before.corners), before.barycentric);
        const Vector3<double> to(random.number(-0.3, 0.3), random.number(-0.3, 0.3), 0);
        std::vector<ReshapedTriangle<double>> triangles;
        for (Index f = 0; f < 6; ++f) {
            const auto corners = mesh.triangles().col(f);
            ReshapedTriangle<double> one{f, {corners[0], corners[1], corners[2]}, {}, {}};
            for (std::size_t k = 0; k < 3; ++k) {
                one.before[k] = point(x, one.corners[k]);
                one.after[k] = one.corners[k] == 0 ? to : one.before[k];
            }
            triangles.push_back(one);
        }
        grasper.reshape({0, to, triangles});
        x.col(0) = to;
        const auto grasp = grasper.update(contact, x, tool);
        REQUIRE(norm<double>(point_at(triangle_at(x, grasp.corners), grasp.barycentric) - held) < 1e-14);
        REQUIRE(grasp.offset == before.offset);
    }
}

TEST_CASE("forceps hold what is under them, whether vertices or faces carry the contact", "[grasp]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    const double edge = mean_edge(mesh);
    for (int seed = 1; seed <= cases(2400); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(random.index(mesh.triangle_count())));
        const Vector3<double> place = point_at<double>(triangle, random.barycentric()), up = place / norm(place);
        const double radius = edge * random.number(0.7, 4.0), depth = radius * random.number(0.005, 0.05);
        Tool<double> tool{.position = place + (radius - depth) * up, .radius = radius, .grasping = true};
        ContactTracker<double> tracker(mesh, {.fine_triangles = seed % 2 == 0 ? 0 : 0.5});
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        const auto grasp = Grasper<double>(mesh).update(contact, mesh.positions(), tool);
        REQUIRE(grasp.holding());
        REQUIRE(norm<double>(cross<double>(grasp.offset, up)) < 0.3 * edge);
    }
}
