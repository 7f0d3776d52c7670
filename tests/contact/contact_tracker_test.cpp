// SPDX-License-Identifier: MIT
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/surface/moving_body.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <membrane/model/mass_spring_network.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/brute_force.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using membrane::AabbTree;
using membrane::Contact;
using membrane::ContactPhase;
using membrane::ContactTracker;
using membrane::Index;
using membrane::Points;
using membrane::Tool;
using membrane::TriangleMesh;
using membrane::Triangles;
using membrane::Vector3;

namespace {

using Vector = Vector3<double>;

/// The sphere with waves in it.
Points<double> wavy(const Points<double>& x, test::Random& random) {
    Points<double> deformed = x;
    for (int wave = 0; wave < 4; ++wave) {
        const Vector towards = random.unit_vector();
        const double amplitude = random.number(-0.06, 0.06), number = random.number(1.0, 4.0), phase = random.number();
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            deformed.col(v) += amplitude * std::sin(number * towards.dot(x.col(v)) + 6 * phase) * x.col(v);
        }
    }
    return deformed;
}

/// Distance by brute force over all triangles.
double distance_to(const Points<double>& x, const Triangles& triangles, const Vector& q) {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        const auto triangle = test::brute_triangle<double>(membrane::triangle_at(x, triangles.col(f)));
        least = std::min(least, test::squared_distance<double>(triangle, q));
    }
    return std::sqrt(least);
}

/// How often the surface winds round `q`, by the angles of its triangles: 1 inside a valid surface, 0 outside.
double winding_number(const Points<double>& x, const Triangles& triangles, const Vector& q) {
    double sum = 0;
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        const Vector a = (x.col(triangles(0, f)) - q).normalized(), b = (x.col(triangles(1, f)) - q).normalized(),
                     c = (x.col(triangles(2, f)) - q).normalized();
        const double volume = a.dot(test::cross<double>(b, c));
        sum += 2 * std::atan2(volume, 1 + a.dot(b) + b.dot(c) + c.dot(a));
    }
    return sum / (4 * std::numbers::pi);
}

}  // namespace

TEST_CASE("the tracker agrees with a search of the whole surface along random tracks") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const double edge = membrane::LocalSurface<double>(mesh).mean_edge();
    AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh);
    long contact_ticks = 0, agreements = 0;
    for (int seed = 1; seed <= cases(2'000, 100'000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        static Points<double> x;
        if (seed % 50 == 1) x = wavy(mesh.positions(), random);
        if (seed % 50 == 1) tree.refit(x);
        tracker.reset();
        Tool<double> tool{.radius = random.number(0.05, 2.0) * edge};
        Vector over = random.unit_vector(), displacement = random.unit_vector();
        double height = random.number(0.5, 1.5);
        for (int tick = 0; tick < 20; ++tick) {
            over = (over + 0.1 * edge * displacement).normalized();
            const Vector foot = 3 * over * (1 - tree.first_hit(x, 3 * over, Vector::Zero()).fraction);
            height = std::clamp(height + random.number(-0.05, 0.05) * edge / tool.radius, 0.4, 1.6);
            tool.position = foot + height * tool.radius * over;
            const auto contact = tracker.update(tree, x, tool);
            const auto nearest = tree.closest_point(x, tool.position);
            const double gap = std::sqrt(nearest.squared_distance) - tool.radius;
            if (!contact.touching()) {
                REQUIRE(gap > 0);
                continue;
            }
            ++contact_ticks;
            if (contact.tunnelled) continue;
            CAPTURE(seed, tick, tool.radius, gap);
            REQUIRE(std::abs(contact.gap - gap) <= 1e-12);
            REQUIRE(std::abs((contact.point - nearest.point).norm()) <= 1e-6);
            ++agreements;
            if (tick % 5 != 0) continue;
            std::vector<Index> listed;
            for (const auto& touched : contact.triangles) listed.push_back(touched.triangle);
            tree.overlap_sphere(x, tool.position, tool.radius,
                                [&](Index f) { REQUIRE(std::find(listed.begin(), listed.end(), f) != listed.end()); });
        }
    }
    CAPTURE(contact_ticks, agreements, tracker.full_query_count());
    REQUIRE(agreements > contact_ticks / 2);
    REQUIRE(tracker.full_query_count() <= contact_ticks / 100);
}

namespace {

/// A sphere that is stroked again and again, each time from rest.
class Stroked {
  public:
    explicit Stroked(Index subdivisions)
        : mesh_(membrane::icosphere<double>({.radius = 1, .subdivisions = subdivisions})) {}

    double edge() const { return membrane::LocalSurface<double>(mesh_).mean_edge(); }

    /// Takes the tool along the places, a tick each; whether it was on its side of the surface after every tick.
    bool stays_outside(const std::vector<Vector>& places, double radius) {
        auto tracker = fresh_tracker_;
        auto solver = fresh_solver_;
        tree_.refit(mesh_.positions());
        Points<double> x = mesh_.positions();
        for (const Vector& place : places) {
            const Tool<double> tool{.position = place, .radius = radius};
            const auto contact = tracker.update(tree_, x, tool);
            const auto report = solver.step(x, 1e-3, network_, foundation_, press(tool, contact));
            if (report.status != membrane::StepStatus::advanced) return false;
            tree_.refit(x, report.moved);
            if (!contact.touching()) continue;
            ++touching;
            if (std::abs(winding_number(x, mesh_.triangles(), place)) > 0.5) return false;
        }
        return true;
    }

    long touching = 0;  // ticks

  private:
    TriangleMesh<double> mesh_;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network_{mesh_, {}, {.stiffness = 1.0}};
    membrane::VirtualVolumeSprings<double> foundation_{mesh_, {.stiffness = 0.3}};
    membrane::QuasiStaticSolver<double> fresh_solver_{network_, {.layers = 4, .sweeps = 4}};
    ContactTracker<double> fresh_tracker_{mesh_};
    AabbTree<double> tree_{mesh_};
};

/// From place to place, a tick for each `speed`, and two ticks at the end.
std::vector<Vector> path_through(const std::vector<Vector>& places, double speed) {
    std::vector<Vector> displacement{places.front()};
    for (std::size_t i = 1; i < places.size(); ++i) {
        const int ticks = std::min(20, static_cast<int>(std::ceil((places[i] - places[i - 1]).norm() / speed)));
        for (int tick = 1; tick <= ticks; ++tick) {
            displacement.push_back(places[i - 1] + double(tick) / ticks * (places[i] - places[i - 1]));
        }
    }
    displacement.insert(displacement.end(), 2, places.back());
    return displacement;
}

double random_speed(test::Random& random, double slowest, double max_speed) {
    return std::exp(random.number(std::log(slowest), std::log(max_speed)));
}

}  // namespace

// A stroke that jumps right through the membrane may leave it folded around the tool; of 100,000 one does.
TEST_CASE("a fast stroke leaves the tool on the side it came from") {
    Stroked sphere(2);
    const double edge = sphere.edge();
    const int count = cases(1'200, 100'000);
    int astray = 0;
    for (int seed = 1; seed <= count; ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const double radius = random.chance(0.25) ? 0 : random.number(0.02, 1.5) * edge;
        const Vector out = random.unit_vector();
        const double deepest = random.chance(0.5) ? 0.2 : 0.5;  // of the radius
        Vector to;
        do {
            to = random.vector();
        } while (to.norm() > 0.95 || to.dot(out) < 1 - deepest);
        const auto displacement = path_through({(1.02 + radius) * out, to}, random_speed(random, 0.1 * edge, 4 * edge));
        if (sphere.stays_outside(displacement, radius)) continue;
        WARN("astray: seed " << seed << ", a tool of " << radius);
        ++astray;
    }
    CHECK(astray <= count / 50'000);
    CHECK(sphere.touching > count);
}

TEST_CASE("a tool that strokes sideways in a dent stays on the side it came from") {
    Stroked sphere(2);
    const double edge = sphere.edge();
    for (int seed = 1; seed <= cases(600, 10'000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const double radius = random.chance(0.25) ? 0 : random.number(0.02, 1.5) * edge;
        const Vector out = random.unit_vector(), beside = (out + random.number() * random.unit_vector()).normalized();
        const Vector in = (1 - random.number(0.0, 0.2)) * out, to = (1 - random.number(0.0, 0.2)) * beside;
        CAPTURE(seed, radius);
        REQUIRE(sphere.stays_outside(
            path_through({(1.02 + radius) * out, in, to}, random_speed(random, 0.1 * edge, edge)), radius));
    }
    REQUIRE(sphere.touching > cases(3'000, 50'000));
}

TEST_CASE("a tool that a surface has not yielded to stays behind it, until it does") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 2});
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{}, {.stiffness = 1.0});
    const membrane::VirtualVolumeSprings foundation(mesh, {.stiffness = 0.3});
    AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh);
    membrane::QuasiStaticSolver solver(network);
    Points<double> x = mesh.positions();
    for (int tick = 0; tick < 20; ++tick) {
        const Tool<double> tool{.position = {0.03, 0.02, 1.05 - 0.01 * tick}, .radius = 0.02};
        const auto contact = tracker.update(tree, x, tool);
        const bool refused = tick > 2 && tick < 15;
        const auto report = solver.step(x, refused ? 0.0 : 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        CAPTURE(tick);
        REQUIRE((report.status == membrane::StepStatus::advanced) == !refused);
        if (contact.touching()) REQUIRE(contact.normal.z() > 0);
        if (refused && tick > 8) REQUIRE(contact.tunnelled);
        if (!refused && contact.touching()) {
            REQUIRE(std::abs(winding_number(x, mesh.triangles(), tool.position)) < 0.5);
        }
    }
}

TEST_CASE("a contact begins, goes on and ends once, with the depth against the surface without the tool") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh);
    const Points<double>& x = mesh.positions();
    const double radius = 0.1;
    int began = 0, ended = 0;
    for (int tick = 0; tick <= 200; ++tick) {
        const double z = tick < 100 ? 1.2 - 0.002 * tick : 1.0 + 0.002 * (tick - 100);
        const Tool<double> tool{.position = {0.02, 0.01, z}, .radius = radius};
        const auto contact = tracker.update(tree, x, tool);
        began += contact.phase == ContactPhase::began ? 1 : 0;
        ended += contact.phase == ContactPhase::ended ? 1 : 0;
        const double gap = distance_to(x, mesh.triangles(), tool.position) - radius;
        CAPTURE(tick, z, gap);
        if (gap > 1e-9) {
            CHECK_FALSE(contact.touching());
        } else if (gap < -1e-9) {
            REQUIRE(contact.touching());
            CHECK(std::abs(contact.gap - gap) < 1e-12);
            CHECK(std::abs(contact.depth + gap) < 1e-12);  // nothing yields here
            CHECK(contact.normal.z() > 0.9);
            CHECK(std::abs(contact.normal.norm() - 1) < 1e-12);
        }
    }
    CHECK(began == 1);
    CHECK(ended == 1);
}

TEST_CASE("anchors that moved carry the depth with them") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 2});
    const Vector shift(0.3, -0.1, 0.2);
    membrane::MovingBody body(mesh);
    Points<double> moved = mesh.positions();
    REQUIRE(body.move_to(membrane::RigidFrame<double>{.origin = shift}, moved));
    AabbTree<double> tree(mesh);
    tree.refit(moved);
    ContactTracker<double> still(mesh), carried(mesh);
    const AabbTree<double> still_tree(mesh);
    const Tool<double> tool{.position = {0, 0, 1.05}, .radius = 0.1};
    Tool<double> moved_tool = tool;
    moved_tool.position += shift;
    const auto a = still.update(still_tree, mesh.positions(), tool);
    const auto b = carried.update(tree, moved, moved_tool, body);
    REQUIRE(a.touching());
    REQUIRE(b.touching());
    CHECK(std::abs(a.depth - b.depth) < 1e-12);
    CHECK(a.triangle == b.triangle);
}

TEST_CASE("an open sheet is touched from either side, and the side of first contact is kept") {
    const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    const AabbTree<double> tree(mesh);
    for (const double side : {1.0, -1.0}) {
        ContactTracker<double> tracker(mesh);
        Contact<double> contact;
        for (int tick = 0; tick <= 20; ++tick) {
            const Tool<double> tool{.position = {0.03, 0.02, side * (0.1 - 0.008 * tick)}, .radius = 0.05};
            contact = tracker.update(tree, mesh.positions(), tool);
            CAPTURE(side, tick);
            if (!contact.touching()) continue;
            CHECK(contact.side == side);
            CHECK(contact.normal.z() * side > 0.999);
        }
        CHECK(contact.tunnelled);
        CHECK(std::abs(contact.depth - (0.05 + 0.06)) < 1e-12);
    }
}

TEST_CASE("a tool that flies through in one tick touches where it went through") {
    const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    const AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh);
    CHECK_FALSE(tracker.update(tree, mesh.positions(), Tool<double>{.position = {0.1, 0.1, 1}}).touching());
    const auto contact = tracker.update(tree, mesh.positions(), Tool<double>{.position = {-0.1, -0.1, -1e6}});
    REQUIRE(contact.phase == ContactPhase::began);
    CHECK(contact.tunnelled);
    CHECK(contact.side == 1);
    CHECK(std::abs(contact.point.x() - 0.1) < 1e-5);
    CHECK(contact.depth > 0.9e6);
}

TEST_CASE("a capsule touches with its ends, its middle and what it is stuck through") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    for (int seed = 1; seed <= cases(2000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        Tool<double> tool{.radius = random.number(0.01, 0.2)};
        tool.position = random.number(0.9, 1.4) * random.unit_vector();
        tool.axis = random.number(0.1, 1.5) * random.unit_vector();
        ContactTracker<double> tracker(mesh);
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        std::vector<Index> touched;
        tree.overlap_capsule(mesh.positions(), tool.position, tool.position + tool.axis, tool.radius,
                             [&](Index f) { touched.push_back(f); });
        CAPTURE(seed);
        if (touched.empty() && (tool.position).norm() > 1) CHECK_FALSE(contact.touching());
        if (touched.empty()) continue;
        REQUIRE(contact.touching());
        for (const Index f : touched) {
            CHECK(std::any_of(contact.triangles.begin(), contact.triangles.end(),
                              [f](const auto& listed) { return listed.triangle == f; }));
        }
    }
}

TEST_CASE("a tool that is not valid touches nothing and changes nothing") {
    const auto mesh = membrane::icosphere<float>({.radius = 1, .subdivisions = 2});
    const AabbTree<float> tree(mesh);
    ContactTracker<float> tracker(mesh);
    const Tool<float> tool{.position = {0, 0, 1.05F}, .radius = 0.1F};
    REQUIRE(tracker.update(tree, mesh.positions(), tool).phase == ContactPhase::began);
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        Tool<float> broken = tool;
        broken.position.y() = bad;
        CHECK(tracker.update(tree, mesh.positions(), broken).phase == ContactPhase::none);
        broken = tool;
        broken.radius = -bad;
        CHECK(tracker.update(tree, mesh.positions(), broken).phase == ContactPhase::none);
    }
    CHECK(tracker.update(tree, mesh.positions(), tool).phase == ContactPhase::ongoing);
}

TEST_CASE("tracker options out of range are refused") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 1});
    for (const double margin : {0.0, -1.0, 1.5, std::numeric_limits<double>::quiet_NaN()}) {
        CHECK_THAT(test::refusal([&] { ContactTracker<double>(mesh, {.margin = margin}); }),
                   ContainsSubstring("ContactTracker: margin must be above 0 and at most 1 [mean edges], got "));
    }
    CHECK(test::refusal([&] { ContactTracker<double>(mesh, {.full_query_interval = 0}); }) ==
          "ContactTracker: full_query_interval must be at least 1, got 0");
    CHECK(test::refusal([&] { ContactTracker<double>(mesh, {.max_contact_points = 0}); }) ==
          "ContactTracker: max_contact_points must be at least 1, got 0");
}

namespace {

/// All contact points within the detection distance of `contact`, or of what it touches, found one by one.
template <class S>
std::vector<membrane::ContactPoint<S>> points_of(const TriangleMesh<S>& mesh, const Contact<S>& contact,
                                                 const Tool<S>& tool) {
    std::vector<membrane::ContactPoint<S>> points;
    const auto& all = mesh.triangles();
    for (Index f = 0; f < mesh.triangle_count(); ++f) {
        const bool touched = std::any_of(contact.triangles.begin(), contact.triangles.end(),
                                         [f](const auto& listed) { return listed.triangle == f; });
        const std::array<Index, 3> corners{all(0, f), all(1, f), all(2, f)};
        const auto triangle = membrane::triangle_at(mesh.positions(), corners);
        for (int feature = 0; feature < membrane::feature_pairs(tool); ++feature) {
            const auto point = membrane::contact_point(f, corners, triangle, tool, feature, contact.radius);
            if (!point || !(contact.tunnelled ? touched : point->gap + contact.radius <= contact.detection_distance))
                continue;
            points.push_back(*point);
        }
    }
    return points;
}

}  // namespace

TEMPLATE_TEST_CASE("the contact points are those of all triangles within reach, each with its gap", "[tracker]", double,
                   float) {
    using S = TestType;
    const auto mesh = membrane::icosphere<S>({.radius = 1, .subdivisions = 3});
    const AabbTree<S> tree(mesh);
    const S rounding = 100 * std::numeric_limits<S>::epsilon();
    int found_points = 0, tunnelled = 0;
    for (int seed = 1; seed <= cases(400); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Tool<S> tool{.radius = static_cast<S>(random.number(0.0, 0.2))};
        tool.position = static_cast<S>(random.number(0.9, 1.1)) * random.unit_vector().cast<S>();
        if (seed % 2 == 0) tool.axis = static_cast<S>(random.number(0.1, 1.5)) * random.unit_vector().cast<S>();
        ContactTracker<S> tracker(mesh);
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        if (!contact.touching()) continue;
        tunnelled += contact.tunnelled ? 1 : 0;
        REQUIRE(contact.has_all_points);
        auto expected = points_of(mesh, contact, tool);
        std::vector<membrane::ContactPoint<S>> found(contact.points.begin(), contact.points.end());
        const auto in_order = [](const auto& p, const auto& q) {
            return std::pair(p.triangle, p.feature) < std::pair(q.triangle, q.feature);
        };
        std::sort(found.begin(), found.end(), in_order);
        REQUIRE(found.size() == expected.size());
        for (std::size_t i = 0; i < found.size(); ++i) {
            REQUIRE(found[i].triangle == expected[i].triangle);
            REQUIRE(found[i].feature == expected[i].feature);
            CHECK(std::abs(found[i].gap - expected[i].gap) <= rounding);
            CHECK(membrane::norm<S>(found[i].weights - expected[i].weights) <= rounding);
            CHECK(membrane::norm<S>(found[i].normal - expected[i].normal) <= rounding);
            CHECK(found[i].force == Vector3<S>(0, 0, 0));
        }
        found_points += static_cast<int>(found.size());
    }
    CHECK(found_points > cases(400));
    CHECK(tunnelled > 0);
}

TEST_CASE("a contact with more points than the capacity says so, and is refused by a step") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{}, {.stiffness = 1.0});
    for (const bool is_shaft : {false, true}) {
        Tool<double> tool{.position = {0, 0, 1.1}, .radius = 0.2};
        if (is_shaft) tool.axis = {0.1, 0, 0};
        ContactTracker<double> few(mesh, {.max_contact_points = 3}), enough(mesh);
        const auto contact = few.update(tree, mesh.positions(), tool),
                   all = enough.update(tree, mesh.positions(), tool);
        REQUIRE(all.points.size() > 3);
        CHECK(all.has_all_points);
        CHECK(contact.points.size() == 3);
        CHECK_FALSE(contact.has_all_points);
        membrane::QuasiStaticSolver solver(network);
        Points<double> x = mesh.positions();
        const auto report = solver.step(x, 1e-3, network, membrane::NoFoundation(), press(tool, contact));
        CHECK(report.status == membrane::StepStatus::too_many_contact_points);
        CHECK(x == mesh.positions());
    }
}

TEST_CASE("a tool first seen with its centre on the surface is on its outer side") {
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const AabbTree<double> tree(mesh);
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto triangle =
            membrane::triangle_at(mesh.positions(), mesh.triangles().col(random.index(mesh.triangle_count())));
        const Vector place = membrane::point_at(triangle, Vector(random.barycentric()));
        ContactTracker<double> tracker(mesh);
        const auto contact = tracker.update(tree, mesh.positions(), Tool<double>{.position = place, .radius = 1e-3});
        REQUIRE(contact.touching());
        REQUIRE(contact.normal.dot(place) > 0);
        REQUIRE(std::abs(contact.gap + 1e-3) <= 1e-15);
    }
}

TEST_CASE("on an open surface a tool that grazes a crest is on the side it came from") {
    const auto flat = membrane::sheet<double>({.width = 2, .height = 2, .columns = 10, .rows = 10});
    Points<double> x = flat.positions();
    x.row(2) = -0.7 * x.row(0).cwiseAbs();
    const TriangleMesh<double> roof(x, flat.triangles());
    const AabbTree<double> tree(roof);
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        // Over one slope to the other, through the crest, to the last digits: a little above it or below.
        const Vector crest(0, random.number(-0.5, 0.5), random.number(-1e-16, 1e-16));
        const Vector displacement(1, 0, random.number(-0.6, 0.6));
        const double radius = random.number(0.01, 0.05);
        const Vector axis = random.chance(0.5) ? Vector(random.number(-0.3, 0.3) * Vector::UnitY()) : Vector::Zero();
        Tool<double> tool{.position = crest - random.number(0.2, 0.4) * displacement, .axis = axis, .radius = radius};
        if (distance_to(x, roof.triangles(), tool.position) <= radius) continue;
        ContactTracker<double> tracker(roof);
        REQUIRE_FALSE(tracker.update(tree, x, tool).touching());
        tool.position = crest + random.number(0.01, 1.0) * radius * displacement;
        const auto contact = tracker.update(tree, x, tool);
        REQUIRE(contact.touching());
        CHECK(contact.side == 1);
    }
}
