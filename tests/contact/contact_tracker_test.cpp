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
#include "support/tears.hpp"

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
    ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
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
            if (contact.patch.tunnelled) continue;
            CAPTURE(seed, tick, tool.radius, gap);
            REQUIRE(std::abs(contact.gap - gap) <= 1e-12);
            REQUIRE(std::abs((contact.point - nearest.point).norm()) <= 1e-6);
            ++agreements;
            if (tick % 5 != 0) continue;
            std::vector<Index> listed;
            for (const auto& touched : contact.patch.triangles) listed.push_back(touched.triangle);
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
    const int count = cases(600, 100'000);
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
    for (int seed = 1; seed <= cases(300, 10'000); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const double radius = random.chance(0.25) ? 0 : random.number(0.02, 1.5) * edge;
        const Vector out = random.unit_vector(), beside = (out + random.number() * random.unit_vector()).normalized();
        const Vector in = (1 - random.number(0.0, 0.2)) * out, to = (1 - random.number(0.0, 0.2)) * beside;
        CAPTURE(seed, radius);
        REQUIRE(sphere.stays_outside(
            path_through({(1.02 + radius) * out, in, to}, random_speed(random, 0.1 * edge, edge)), radius));
    }
    REQUIRE(sphere.touching > cases(1'500, 50'000));
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
        if (refused && tick > 8) REQUIRE(contact.patch.tunnelled);
        if (!refused && contact.touching()) {
            REQUIRE(std::abs(winding_number(x, mesh.triangles(), tool.position)) < 0.5);
        }
    }
}

TEST_CASE("a contact begins, goes on and ends once, with the depth against the surface without the tool") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
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

namespace {

/// Bodies 2 mm thick along z or less: a sphere, a tube along x, a slab. From the sphere, by the largest coordinate.
TriangleMesh<double> body(Index shape, double half) {
    const auto sphere = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    Points<double> x = sphere.positions();
    for (auto p : x.colwise()) {
        if (shape == 1) p = Vector(4, 1, 1).cwiseProduct(p) / std::max(std::abs(p.x()), std::hypot(p.y(), p.z()));
        if (shape == 2) p = Vector(4, 4, 1).cwiseProduct(p) / p.cwiseAbs().maxCoeff();
    }
    return {half * x, sphere.triangles()};
}

}  // namespace

TEST_CASE("the depth of a shaft is that of its deepest point, wherever the membrane touches it") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 2});
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto up = random.unit_vector();
        membrane::Tool<double> tool{.axis = random.number(0.2, 2.0) * random.unit_vector(),
                                    .radius = random.number(0.01, 0.2)};
        tool.axis -= random.number(0.7, 1.0) * membrane::dot(up, tool.axis) * up;
        const double deep = random.number(0.01, 0.15);
        tool.position = (1 + tool.radius - deep) * up - random.number() * tool.axis;
        const auto height = [&](const membrane::Vector3<double>& q) {  // of a convex body
            double nearest = 1e9, outside = -1e9;
            for (membrane::Index f = 0; f < mesh.triangle_count(); ++f) {
                const auto triangle = membrane::triangle_at(mesh.positions(), mesh.triangles().col(f));
                nearest = std::min(nearest, std::sqrt(membrane::squared_distance(triangle, q)));
                outside = std::max(outside, membrane::dot<double>(membrane::area_vector(triangle), q - triangle.a));
            }
            return outside > 0 ? nearest : -nearest;
        };
        constexpr int samples = 400;
        double depth = 0;
        for (int i = 0; i <= samples; ++i) {
            depth = std::max(depth, tool.radius - height(tool.position + i / double(samples) * tool.axis));
        }
        membrane::AabbTree<double> tree(mesh);
        membrane::ContactTracker<double> tracker(mesh);
        membrane::Points<double> x = mesh.positions();
        for (int tick = 0; tick < 4; ++tick) {
            const auto contact = tracker.update(tree, x, tool);
            REQUIRE(contact.touching());
            CHECK(contact.depth > depth - 1e-4);
            CHECK(contact.depth < depth + membrane::norm(tool.axis) / (2 * samples));
            x = test::jittered(mesh.positions(), 0.02, random);
            tree.refit(x);
        }
    }
}

// Pressed slowly through the middle of a body and its opposite wall, to a tool's radius beyond, and drawn back.
TEST_CASE("pressed deeper than the body is thick, a tool stays in contact, and the depth grows") {
    for (int seed = 1; seed <= cases(3, 60); ++seed) {
        test::Random random(static_cast<std::uint64_t>(seed));
        const Index shape = seed % 3;
        const double half = shape == 2 ? random.number(0.2e-3, 0.5e-3) : 1e-3, radius = random.number(0.3e-3, 0.5e-3);
        const auto mesh = body(shape, half);
        const membrane::MassSpringNetwork<double, membrane::LinearSpring> network(mesh, {}, {.stiffness = 40});
        const membrane::VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 8});
        membrane::QuasiStaticSolver<double> solver(network, {.layers = membrane::unlimited, .sweeps = 6});
        AabbTree<double> tree(mesh);
        ContactTracker<double> tracker(mesh);
        Points<double> x = mesh.positions();
        Tool<double> tool{.position = 0.05 * half * random.vector(), .radius = radius};
        const double step = random.number(5e-6, 15e-6), start = half + radius + 2 * step, end = -half - 2 * radius;
        double last_force = 0, largest = 0, last_depth = 0;
        bool opposed = false;  // whether the membrane pushes the tool back, not aside
        const auto tick = [&](double z) {
            tool.position.z() = z;
            const auto contact = tracker.update(tree, x, tool);
            const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
            tree.refit(x, report.moved);
            last_force = report.reactions[0].norm();
            largest = std::max(largest, last_force);
            opposed = report.reactions[0].z() > 0.7 * last_force;
            return contact;
        };
        for (double z = start; z > end; z -= step) {
            const double before = last_force;
            const auto contact = tick(z);
            CAPTURE(seed, shape, half, radius, z, before, last_force, contact.depth, last_depth);
            REQUIRE((contact.touching() || before <= 0.05 * largest));
            if (opposed && shape > 0) REQUIRE(contact.depth >= last_depth - 0.1 * step);
            if (shape == 2 && contact.touching()) REQUIRE(std::abs(contact.depth - (radius + half - z)) <= 1e-12);
            last_depth = contact.depth;
        }
        CAPTURE(seed, shape, half, radius);
        if (!opposed) continue;  // the body has rolled aside
        for (double z = end; z < start; z += step) tick(z);
        for (int still = 0; still < 50; ++still) tick(start);
        CHECK_FALSE(tick(start).touching());
        CHECK((x - mesh.positions()).cwiseAbs().maxCoeff() <= 1e-3 * half);
    }
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
        for (int tick = 0; tick <= 40; ++tick) {  // in, and out again
            const double height = 0.1 - 0.008 * std::min(tick, 40 - tick);
            const Tool<double> tool{.position = {0.03, 0.02, side * height}, .radius = 0.05};
            const auto contact = tracker.update(tree, mesh.positions(), tool);
            CAPTURE(side, tick);
            CHECK(contact.touching() == (height < 0.05));
            if (!contact.touching()) continue;
            CHECK_FALSE(contact.patch.closed);
            CHECK(contact.patch.side == side);
            CHECK(contact.normal.z() * side > 0.999);
            CHECK(contact.patch.tunnelled == (height < 0));
            CHECK(std::abs(contact.depth - (0.05 - height)) < 1e-12);
        }
    }
}

TEMPLATE_TEST_CASE("a shaft across a valley of a sheet, one end beyond the border, is behind it by its other end", "",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = membrane::sheet<S>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    for (const S side : {S(1), S(-1)}) {
        for (const S border : {S(-1), S(1)}) {
            for (const S across : {S(-0.33), S(-0.21), S(0.02), S(0.27)}) {
                for (const bool inner_first : {true, false}) {
                    CAPTURE(side, border, across, inner_first);
                    const auto at = [&](S from_border, S height) {
                        return Vector3<S>(across, border * (S(0.5) - from_border), side * height);
                    };
                    const Vector3<S> inner = at(S(0.8), S(0.015)), outer = at(S(-0.06), S(0.016));
                    const Tool<S> tool{.position = inner_first ? inner : outer,
                                       .axis = inner_first ? outer - inner : inner - outer,
                                       .radius = S(0.02)};
                    AabbTree<S> tree(mesh);
                    ContactTracker<S> tracker(mesh);
                    Points<S> x = mesh.positions();
                    REQUIRE(tracker.update(tree, x, tool).patch.side == side);  // it lies on the flat sheet
                    for (Eigen::Index v = 0; v < x.cols(); ++v) {  // highest at the border and at the inner end
                        const S from_border = S(0.5) - border * x(1, v);
                        x(2, v) = side * S(0.06) * std::cos(2 * std::numbers::pi_v<S> * from_border / S(0.8));
                    }
                    tree.refit(x);
                    const auto contact = tracker.update(tree, x, tool);
                    REQUIRE(contact.phase == ContactPhase::ongoing);
                    CHECK(contact.patch.tunnelled);
                    CHECK(contact.patch.side == side);
                    CHECK(membrane::norm<S>(contact.patch.axis_point - inner) < S(1e-6));
                    const auto nearest = tree.closest_point(x, inner);
                    CHECK(contact.gap < S(1e-5) - std::sqrt(nearest.squared_distance) - tool.radius);
                }
            }
        }
    }
}

TEST_CASE("a tool that flies through in one tick touches where it went through") {
    const auto mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    const AabbTree<double> tree(mesh);
    for (const double side : {1.0, -1.0}) {
        ContactTracker<double> tracker(mesh);
        const auto at = [&](double x, double height) {
            return tracker.update(tree, mesh.positions(), Tool<double>{.position = {x, x, side * height}});
        };
        CHECK_FALSE(at(0.1, 1).touching());
        const auto contact = at(-0.1, -1e5);
        REQUIRE(contact.phase == ContactPhase::began);
        CHECK(contact.patch.tunnelled);
        CHECK(contact.patch.side == side);
        CHECK(contact.normal.z() * side == 1);
        CHECK(std::abs(contact.point.x() - 0.1) < 1e-5);
        CHECK(contact.depth > 0.9e5);
    }
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
            CHECK(std::any_of(contact.patch.triangles.begin(), contact.patch.triangles.end(),
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
        const bool touched = std::any_of(contact.patch.triangles.begin(), contact.patch.triangles.end(),
                                         [f](const auto& listed) { return listed.triangle == f; });
        const std::array<Index, 3> corners{all(0, f), all(1, f), all(2, f)};
        const auto triangle = membrane::triangle_at(mesh.positions(), corners);
        for (int feature = 0; feature < membrane::feature_pairs(tool); ++feature) {
            const auto point = membrane::contact_point(f, corners, triangle, tool, feature, contact.patch.radius);
            if (!point ||
                !(contact.patch.tunnelled ? touched
                                          : point->gap + contact.patch.radius <= contact.patch.detection_distance))
                continue;
            points.push_back(*point);
        }
    }
    return points;
}

}  // namespace

TEMPLATE_TEST_CASE("the contact points are those of all triangles within reach, each with its gap", "[tracker]",
                   TEST_SCALARS) {
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
        ContactTracker<S> tracker(mesh, {.fine_triangles = 0});
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        if (!contact.touching()) continue;
        tunnelled += contact.patch.tunnelled ? 1 : 0;
        REQUIRE(contact.patch.has_all_points);
        auto expected = points_of(mesh, contact, tool);
        std::vector<membrane::ContactPoint<S>> found(contact.patch.points.begin(), contact.patch.points.end());
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
        REQUIRE(all.patch.points.size() > 3);
        CHECK(all.patch.has_all_points);
        CHECK(contact.patch.points.size() == 3);
        CHECK_FALSE(contact.patch.has_all_points);
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
        CHECK(contact.patch.side == 1);
    }
}

namespace {

/// A flat sheet in the plane z = 0 and a tool that moves beside its border x = 0.5.
struct Beside {
    TriangleMesh<double> mesh = membrane::sheet<double>({.width = 1, .height = 1, .columns = 10, .rows = 10});
    double edge = membrane::LocalSurface<double>(mesh).mean_edge();
    AabbTree<double> tree{mesh};
    ContactTracker<double> tracker{mesh};
    Points<double> x = mesh.positions();
    Tool<double> tool{.radius = 0.02};
    Vector rim{0.5, 0.03, 0};
    Contact<double> contact;

    /// Moves on, slowly, until the tool is `to`.
    void go(const Tool<double>& to) {
        const Tool<double> from = tool;
        const double travel = std::max((to.position - from.position).norm(), (to.axis - from.axis).norm());
        const int ticks = contact.phase == ContactPhase::none && !tracked ? 1 : 1 + static_cast<int>(travel / 0.01);
        for (int tick = 1; tick <= ticks; ++tick) {
            tool = to;
            tool.position = from.position + double(tick) / ticks * (to.position - from.position);
            tool.axis = from.axis + double(tick) / ticks * (to.axis - from.axis);
            contact = tracker.update(tree, x, tool);
        }
        tracked = true;
    }
    void go(const Vector& to) {
        Tool<double> moved = tool;
        moved.position = to;
        go(moved);
    }
    /// Moves around the border at this distance from it, by an angle from the upper normal.
    void go_round(double distance, double begin, double end) {
        for (int i = 0; i <= 40; ++i) {
            const double angle = begin + (end - begin) * i / 40;
            go(rim + distance * Vector(std::sin(angle), 0, std::cos(angle)));
        }
    }
    /// To below the middle, and up until it touches.
    void touch_from_below(double distance) {
        go(Vector(0, 0.03, -distance));
        go(Vector(0, 0.03, -0.9 * tool.radius));
        REQUIRE(contact.touching());
    }

    bool tracked = false;
};

constexpr double pi = std::numbers::pi;

}  // namespace

TEST_CASE("a tool keeps its side of a sheet until it is clear of it, in closed forceps all the same") {
    enum class Shape { sphere, tip_first, tip_last };
    for (const auto shape : {Shape::sphere, Shape::tip_first, Shape::tip_last}) {
        for (const bool grasping : {false, true}) {
            for (const double edges : {0.5, 1.8, 2.2, 4.0}) {
                CAPTURE(static_cast<int>(shape), grasping, edges);
                Beside sheet;
                // A shaft always points away from the sheet, or to it.
                const auto at = [&](double angle, double distance, const Vector& foot) {
                    const Vector outward(std::sin(angle), 0, std::cos(angle));
                    const Vector tip = foot + distance * outward;
                    Tool<double> tool{.position = tip, .radius = 0.02, .grasping = grasping};
                    if (shape != Shape::sphere) tool.axis = 0.5 * outward;
                    if (shape == Shape::tip_last) tool.position += tool.axis, tool.axis *= -1;
                    sheet.go(tool);
                };
                const Vector middle(0.2, 0.03, 0);
                const double distance = 0.02 + edges * sheet.edge;
                at(0, distance, middle);
                at(0, 0.018, middle);
                REQUIRE(sheet.contact.touching());
                at(0, distance, middle);
                for (int i = 0; i <= 40; ++i) at(pi * i / 40, distance, sheet.rim);
                at(pi, distance, middle);
                at(pi, 0.018, middle);
                REQUIRE(sheet.contact.touching());
                const bool keeps = grasping || edges < 2;
                CHECK(sheet.contact.patch.side == (keeps ? 1 : -1));
                CHECK(sheet.contact.patch.tunnelled == keeps);
                CHECK((sheet.contact.normal.z() > 0) == keeps);
            }
        }
    }
}

TEST_CASE("what touches a border is on the side within 60 degrees of its normal, and else on neither") {
    for (const double degrees : {0.0, 30.0, 58.0, 62.0, 90.0, 118.0, 122.0, 150.0}) {
        CAPTURE(degrees);
        Beside sheet;
        const double angle = degrees * pi / 180;
        sheet.go_round(0.07, angle, angle);
        sheet.go_round(0.0199, angle, angle);
        REQUIRE(sheet.contact.touching());
        sheet.go_round(0.07, angle, pi);
        sheet.touch_from_below(0.07);
        CHECK(sheet.contact.patch.side == (degrees < 60 ? 1 : -1));
    }
}

namespace {

/// The border pressed down, and a tool that slides off it, by as much as it keeps touching, to under the slope.
struct SlidOff : Beside {
    Vector normal = Vector(1, 0, 1).normalized();  // of the slope

    explicit SlidOff(const Vector& axis, double bend) {
        tool.axis = axis;
        x.row(2) = -bend * (x.row(0).array() - 0.3).max(0);
        tree.refit(x);
        rim.z() = -0.2 * bend;
        go(Vector(0.2, 0.03, 0.1));
        go(Vector(0.2, 0.03, 0.019));
        REQUIRE(contact.touching());
        go_round(0.019, 0, 1.2 * pi);
    }
    void lift(double height) {
        x.row(2).array() += height;
        tree.refit(x);
        tool.position.z() += height;
        contact = tracker.update(tree, x, tool);
    }
};

}  // namespace

TEST_CASE("a tool that has slid off a border that it displaced may touch the other side, else not") {
    for (const double bend : {0.0, 1.0}) {
        for (const Vector& axis : {Vector(0, 0, 0), Vector(0, 0.2, 0)}) {
            CAPTURE(bend, axis.y());
            SlidOff sheet(axis, bend);
            sheet.go_round(0.05, 1.2 * pi, 1.2 * pi);
            if (bend > 0) CHECK_FALSE(sheet.contact.touching());
            sheet.touch_from_below(0.25);
            CHECK(sheet.contact.patch.tunnelled == (bend == 0));
            CHECK((sheet.contact.normal.z() < 0) == (bend > 0));
        }
    }
}

TEST_CASE("a shaft that has slid off a border is beneath it, and does not pull what it lifts") {
    for (const double height : {0.0, -0.5, 0.5}) {
        CAPTURE(height);
        SlidOff sheet(Vector(0, 0.2, 0), 1);
        sheet.go(Vector(0.4, 0.03, -0.1) - 0.019 * sheet.normal);
        REQUIRE(sheet.contact.touching());
        CHECK_FALSE(sheet.contact.patch.tunnelled);
        CHECK(sheet.contact.normal.dot(sheet.normal) < 0);
        if (height != 0) sheet.lift(height);
        CHECK(sheet.contact.touching() == (height <= 0));  // farther out than the membrane without it: nothing to push
    }
}

TEST_CASE("a shaft through a ridge, both ends outside, is as deep as its middle") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Vector out = random.unit_vector(), along = out.cross(random.unit_vector()).normalized();
        const double before = random.number(0.6, 1.2), behind = random.number(0.6, 1.2);  // lengths
        ContactTracker<double> tracker(mesh);
        Contact<double> contact;
        for (double height = 1.05; height > 0.93; height -= 0.01) {
            contact = tracker.update(
                tree, mesh.positions(),
                {.position = height * out - before * along, .axis = (before + behind) * along, .radius = 0.02});
        }
        REQUIRE(contact.touching());
        CHECK(contact.patch.tunnelled);
        CHECK(contact.patch.closed);
        CHECK(contact.normal.dot(out) > 0.9);
        const auto nearest = tree.closest_point(mesh.positions(), contact.patch.axis_point);
        CHECK(std::abs(contact.patch.axis_point.dot(along)) < 0.05);
        CHECK(contact.gap == Approx(-std::sqrt(nearest.squared_distance) - 0.02));
    }
}

TEST_CASE("a sphere that is first seen behind a folded surface is inside where that winds round it") {
    const auto ball = membrane::icosphere<double>({.radius = 1, .subdivisions = 2});
    int outside = 0, inside = 0;
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const bool crumpled = random.chance(0.5);  // else a star
        Points<double> x = ball.positions();
        for (auto p : x.colwise()) p *= random.number(0.6, 1.4);
        if (crumpled) x = test::jittered(ball.positions(), 0.8, random);
        const TriangleMesh<double> mesh(x, ball.triangles());
        const auto triangle = membrane::triangle_at(x, mesh.triangles().col(random.index(mesh.triangle_count())));
        const Vector place = membrane::point_at(triangle, Vector(random.barycentric())) + 0.05 * random.vector();
        const auto contact = ContactTracker<double>(mesh).update(AabbTree<double>(mesh), x,
                                                                 Tool<double>{.position = place, .radius = 0.1});
        REQUIRE(contact.touching());
        const bool is_inside = std::abs(winding_number(x, mesh.triangles(), place)) > 0.5;
        if (contact.patch.tunnelled || !crumpled) CHECK(contact.patch.tunnelled == is_inside);
        ++(is_inside ? inside : outside);
    }
    CHECK((inside > 0 && outside > 0));
}

TEST_CASE("the candidates are all triangles within two rings, for some ticks after tunnelling within six") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 3});
    const AabbTree<double> tree(mesh);
    const membrane::LocalSurface<double> surface(mesh);
    ContactTracker<double> tracker(mesh);
    const auto sorted = [](std::vector<Index> some) {
        std::sort(some.begin(), some.end());
        some.erase(std::unique(some.begin(), some.end()), some.end());
        return some;
    };
    for (int tick = 0; tick < 40; ++tick) {
        CAPTURE(tick);
        const double height = tick == 10 ? -0.05 : 0.05;  // of the centre
        const Tool<double> tool{.position = (1 + height) * Vector(0.1, 0.2 + 0.002 * tick, 1).normalized(),
                                .radius = 0.1};
        const auto contact = tracker.update(tree, mesh.positions(), tool);
        REQUIRE(contact.patch.tunnelled == (tick == 10));
        std::vector<Index> expected, found;
        for (const auto& listed : contact.patch.triangles) expected.push_back(listed.triangle);
        for (int ring = 0; ring < (tick >= 10 && tick < 26 ? 6 : 2); ++ring) {
            for (const Index f : std::vector(expected)) {
                surface.around_corners(f, [&](Index g) { expected.push_back(g); });
            }
            expected = sorted(expected);
        }
        for (const auto& listed : contact.patch.candidates) found.push_back(listed.triangle);
        CHECK(sorted(found).size() == found.size());
        CHECK(sorted(found) == expected);
    }
}

TEST_CASE("after a reset a tracker is as new") {
    const auto mesh = membrane::icosphere<double>({.radius = 1, .subdivisions = 2});
    const AabbTree<double> tree(mesh);
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        ContactTracker<double> used(mesh, {.full_query_interval = 3}), fresh = used;
        const auto any = [&] { return Tool<double>{.position = Vector(0, 0, random.number(0.9, 1.1)), .radius = 0.1}; };
        for (Index i = random.index(20); i > 0; --i) (void)used.update(tree, mesh.positions(), any());
        used.reset();
        const Index before = used.full_query_count();
        for (int tick = 0; tick < 20; ++tick) {
            const auto tool = any();
            const auto a = used.update(tree, mesh.positions(), tool), b = fresh.update(tree, mesh.positions(), tool);
            REQUIRE((a.phase == b.phase && a.triangle == b.triangle && a.normal == b.normal && a.gap == b.gap));
            REQUIRE((a.depth == b.depth && a.patch.tunnelled == b.patch.tunnelled));
            REQUIRE(a.patch.candidates.size() == b.patch.candidates.size());
            REQUIRE(used.full_query_count() - before == fresh.full_query_count());
        }
    }
}

namespace {

/// All edges are of one length at rest, so that a tear does not change their mean.
test::Surface<double> regular_surface(test::Random& random) {
    if (random.chance(0.3)) return test::surface_of(membrane::icosphere<double>({.radius = 1, .subdivisions = 0}));
    return test::surface_of(test::triangle_strip<double>(8, 8, 1));
}

/// A tool at the surface, or beside it.
Tool<double> tool_near(const test::TearingSurface<double>& surface, const Points<double>& x, test::Random& random) {
    const auto triangle =
        membrane::triangle_at(x, surface.triangles().col(random.index(static_cast<Index>(surface.triangles().cols()))));
    const auto place = point_at(triangle, random.barycentric());
    Tool<double> tool{.position = place + 0.4 * random.vector(), .radius = 0.3};
    if (random.chance(0.3)) tool.axis = random.vector();
    return tool;
}

void check_same(const Contact<double>& found, const Contact<double>& expected) {
    constexpr double rounding = 1e-12;
    REQUIRE(found.phase == expected.phase);
    REQUIRE(found.triangle == expected.triangle);
    REQUIRE(found.corners == expected.corners);
    REQUIRE(found.patch.side == expected.patch.side);
    REQUIRE(found.patch.closed == expected.patch.closed);
    REQUIRE(found.patch.tunnelled == expected.patch.tunnelled);
    REQUIRE(membrane::norm<double>(found.point - expected.point) < rounding);
    REQUIRE(membrane::norm<double>(found.normal - expected.normal) < rounding);
    REQUIRE(std::abs(found.gap - expected.gap) < rounding);
    REQUIRE(found.patch.triangles.size() == expected.patch.triangles.size());
    REQUIRE(found.patch.candidates.size() == expected.patch.candidates.size());
    for (std::size_t i = 0; i < found.patch.candidates.size(); ++i) {
        REQUIRE(found.patch.candidates[i].triangle == expected.patch.candidates[i].triangle);
        REQUIRE(found.patch.candidates[i].corners == expected.patch.candidates[i].corners);
    }
    REQUIRE(found.patch.points.size() == expected.patch.points.size());
    for (std::size_t i = 0; i < found.patch.points.size(); ++i) {
        REQUIRE(found.patch.points[i].corners == expected.patch.points[i].corners);
        REQUIRE(std::abs(found.patch.points[i].gap - expected.patch.points[i].gap) < rounding);
    }
}

}  // namespace

// But for the depth: the surface at rest of the new one is torn, and a walk over it ends at a tear.
TEST_CASE("after random tears the contacts are those of a tracker that is built anew", "[tear]") {
    int contacts = 0;
    for (int seed = 1; seed <= cases(150); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto whole = regular_surface(random);
        test::TearingSurface<double> surface(whole, 4 + random.index(60));
        AabbTree<double> tree(surface.mesh());
        ContactTracker<double> tracker(surface.mesh());
        Points<double> x = surface.mesh().positions();
        const auto follow = [&](const membrane::VertexSplit& split) {
            tree.split(split);
            tracker.split(split);
            x.col(split.copy) = x.col(split.vertex);
        };
        while (surface.tear(random, follow)) {
            const auto mesh = surface.mesh();
            if (surface.used() == mesh.vertex_count()) break;  // the split below needs a vertex without triangles
            ContactTracker<double> fresh(mesh);
            fresh.split({.vertex = 0, .copy = mesh.vertex_count() - 1});  // torn, but for no triangle
            for (Index v = 0; v < surface.used(); ++v) x.col(v) += 0.03 * random.vector();
            tree.refit(x);
            AabbTree<double> fresh_tree(mesh);
            fresh_tree.refit(x);
            tracker.reset();
            auto tool = tool_near(surface, x, random);
            for (int tick = 0; tick < 8; ++tick) {
                const auto contact = tracker.update(tree, x, tool), expected = fresh.update(fresh_tree, x, tool);
                if (std::abs(contact.depth - expected.depth) > 1e-12) break;
                check_same(contact, expected);
                contacts += contact.touching() ? 1 : 0;
                tool.position += 0.2 * random.vector();
            }
        }
    }
    CHECK(contacts > 10 * cases(150));
}

TEST_CASE("a contact goes on while the surface tears under it", "[tear]") {
    int contacts = 0;
    for (int seed = 1; seed <= cases(150); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> surface(
            test::surface_of(membrane::icosphere<double>({.radius = 1, .subdivisions = 2})), 60);
        AabbTree<double> tree(surface.mesh()), whole_tree = tree;
        ContactTracker<double> tracker(surface.mesh()), whole(surface.mesh());
        Points<double> x = surface.mesh().positions();
        const auto follow = [&](const membrane::VertexSplit& split) {
            tree.split(split);
            tracker.split(split);
            x.col(split.copy) = x.col(split.vertex);
        };
        Vector towards = random.unit_vector();
        for (bool more = true; more;) {
            towards = membrane::direction<double>(towards + 0.05 * random.vector(), towards);
            const Tool<double> tool{.position = random.number(1.02, 1.1) * towards, .radius = 0.15};
            const auto contact = tracker.update(tree, x, tool), expected = whole.update(whole_tree, x, tool);
            REQUIRE(contact.phase == expected.phase);
            REQUIRE(std::abs(contact.gap - expected.gap) < 1e-12);
            REQUIRE(std::abs(contact.depth - expected.depth) < 1e-12);
            REQUIRE(membrane::norm<double>(contact.point - expected.point) < 1e-12);
            contacts += contact.touching() ? 1 : 0;
            for (const auto& listed : contact.patch.candidates) {
                const auto corners = surface.triangles().col(listed.triangle);
                REQUIRE(listed.corners == std::array<Index, 3>{corners[0], corners[1], corners[2]});
            }
            more = surface.tear(random, follow);
        }
    }
    CHECK(contacts > 10 * cases(150));
}

TEST_CASE("a tool that slides over tears touches both sides at once", "[tear]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        test::TearingSurface<double> surface(test::surface_of(test::triangle_strip<double>(12, 12, 1)), 100);
        AabbTree<double> tree(surface.mesh());
        ContactTracker<double> tracker(surface.mesh(), {.full_query_interval = 1'000'000});
        const auto follow = [&](const membrane::VertexSplit& split) {
            tree.split(split);
            tracker.split(split);
        };
        while (surface.tear(random, follow)) continue;
        const auto mesh = surface.mesh();
        const auto& x = mesh.positions();
        Vector towards(1, 0, 0);
        Tool<double> tool{.position = {4, 5, 0.6}, .radius = 0.7};
        for (int tick = 0; tick < 200; ++tick) {
            CAPTURE(tick);
            const auto contact = tracker.update(tree, x, tool);
            REQUIRE(contact.touching());
            for (Index f = 0; f < mesh.triangle_count(); ++f) {
                const auto nearest = closest_point(membrane::triangle_at(x, mesh.triangles().col(f)), tool.position);
                if (nearest.squared_distance > tool.radius * tool.radius) continue;
                const auto is_f = [f](const auto& listed) { return listed.triangle == f; };
                REQUIRE(std::any_of(contact.patch.triangles.begin(), contact.patch.triangles.end(), is_f));
            }
            towards += 0.1 * Vector(random.number(-1.0, 1.0), random.number(-1.0, 1.0), 0);
            towards /= membrane::norm(towards);
            if (std::abs(tool.position[0] - 6) > 4) towards[0] = std::copysign(towards[0], 6 - tool.position[0]);
            if (std::abs(tool.position[1] - 5) > 4) towards[1] = std::copysign(towards[1], 5 - tool.position[1]);
            tool.position += 0.05 * towards;
        }
    }
}

TEST_CASE("positions and trees of another membrane touch nothing, and the next contact goes on", "[tracker][bad]") {
    const auto mesh = membrane::icosphere({.radius = 1, .subdivisions = 2}), other = membrane::icosphere({});
    const Points<double>& x = mesh.positions();
    const Eigen::MatrixXd rows = x.transpose();
    const membrane::MovingBody<double> body(other);
    AabbTree<double> tree(mesh), other_tree(other);
    ContactTracker<double> tracker(mesh), fresh(mesh);
    const Tool<double> tool{.position = {0, 0, 1.1}, .radius = 0.2};
    REQUIRE(tracker.update(tree, x, tool).phase == ContactPhase::began);
    CHECK_FALSE(tracker.update(tree, rows, tool).touching());
    CHECK_FALSE(tracker.update(tree, x.leftCols(9), tool).touching());
    CHECK_FALSE(tracker.update(other_tree, other.positions(), tool).touching());
    CHECK_FALSE(fresh.update(other_tree, x, tool).touching());
    CHECK(tracker.update(tree, x, tool).phase == ContactPhase::ongoing);
    CHECK_FALSE(tracker.update(tree, x, tool, body).touching());
}

namespace {

/// A torus about the z axis, facing outward: `around` times `across` vertices.
TriangleMesh<double> torus(double radius, double thickness, Index around, Index across) {
    Points<double> x(3, around * across);
    Triangles triangles(3, 2 * around * across);
    Index f = 0;
    for (Index i = 0; i < around; ++i) {
        for (Index k = 0; k < across; ++k) {
            const double a = 2 * std::numbers::pi * i / around, b = 2 * std::numbers::pi * k / across;
            const double out = radius + thickness * std::cos(b);
            x.col(i * across + k) = Vector(out * std::cos(a), out * std::sin(a), thickness * std::sin(b));
            const auto at = [&](Index ring, Index of) { return ring % around * across + of % across; };
            triangles.col(f++) << at(i, k), at(i + 1, k), at(i + 1, k + 1);
            triangles.col(f++) << at(i, k), at(i + 1, k + 1), at(i, k + 1);
        }
    }
    return TriangleMesh<double>(x, triangles);
}

/// How often the surface winds round `q`, by the solid angles of its triangles.
double winding_by_angles(const Points<double>& x, const Triangles& triangles, const Vector& q) {
    double sum = 0;
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        const Vector a = x.col(triangles(0, f)) - q, b = x.col(triangles(1, f)) - q, c = x.col(triangles(2, f)) - q;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        sum += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (4 * std::numbers::pi);
}

}  // namespace

TEST_CASE("a shaft first seen across a closed surface is inside where the surface winds round its axis") {
    int across = 0;
    for (int seed = 1; seed <= cases(60, 20'000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = random.chance(0.5) ? membrane::icosphere<double>({.radius = 1, .subdivisions = 2})
                                             : torus(0.8, 0.3, 24, 10);
        const Points<double> x = mesh.vertex_count() == 162 ? wavy(mesh.positions(), random) : mesh.positions();
        const auto& triangles = mesh.triangles();
        Tool<double> shaft;
        shaft.axis = random.number(0.5, 4.0) * random.unit_vector();
        shaft.position = random.vector<double>(-1, 1) - random.number() * shaft.axis;
        shaft.radius = random.number(0.01, 0.1);
        double deepest = 0;  // of the axis
        for (int i = 0; i <= 60; ++i) {
            const Vector q = shaft.position + i / 60.0 * shaft.axis;
            if (winding_by_angles(x, triangles, q) > 0.5) deepest = std::max(deepest, distance_to(x, triangles, q));
        }
        AabbTree<double> tree(mesh);
        tree.refit(x);
        ContactTracker<double> tracker(mesh);
        const auto contact = tracker.update(tree, x, shaft);
        if (deepest > 0.02) CHECK(contact.touching());
        if (!contact.touching() || !(contact.gap < -shaft.radius * 1.001)) continue;
        CHECK(winding_by_angles(x, triangles, contact.patch.axis_point) > 0.5);
        CHECK(-contact.gap - shaft.radius < deepest + 0.05);
        ++across;
    }
    CHECK(across > 0);
}
