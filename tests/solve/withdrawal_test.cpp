// SPDX-License-Identifier: MIT
#include <membrane/solve/quasi_static.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/contact/grasper.hpp>
#include <membrane/contact/winding_number.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

// A tool that is out leaves nothing behind: the membrane comes back to rest.

using namespace membrane;

namespace {

using Point = Vector3<double>;

constexpr double size = 0.01, dt = 1e-3;  // [m], [s]

/// A membrane with the constants of README's example, before anything has touched it.
struct Scene {
    TriangleMesh<double> mesh;
    std::vector<Index> rim;  // its border
    MassSpringNetwork<double, LinearSpring> network;
    VirtualVolumeSprings<double> foundation;
    QuasiStaticSolver<double> solver;
    AabbTree<double> tree;
    ContactTracker<double> tracker;
    Grasper<double> grasper;
    Contact<double> contact;  // of the last tick
    Points<double> x;
    double edge;

    explicit Scene(const TriangleMesh<double>& surface, bool pinned = true)
        : mesh(surface),
          rim(border(mesh)),
          network(mesh, LinearSpring{}, {.stiffness = 40, .pinned = pinned ? rim : std::vector<Index>{}}),
          foundation(mesh, {.stiffness = 8, .damping = 0.02}),
          solver(network, {.layers = 6, .sweeps = 2}),
          tree(mesh),
          tracker(mesh),
          grasper(mesh),
          x(mesh.positions()),
          edge(LocalSurface<double>(mesh).mean_edge()) {}

    StepReport<double> tick(const Tool<double>& tool) {
        contact = tracker.update(tree, x, tool);
        const auto grasp = grasper.update(contact, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact, grasp), pull(tool, grasp));
        REQUIRE(report.status == StepStatus::advanced);
        tree.refit(x, report.moved);
        return report;
    }

    double off_rest() const { return (x - mesh.positions()).colwise().norm().maxCoeff(); }

    /// Ticks with the tool held still until the membrane is at rest, or `most`.
    bool comes_back(const Tool<double>& tool, int most) {
        for (int i = 0; i < most && off_rest() > 1e-3 * size; ++i) tick(tool);
        return off_rest() <= 1e-3 * size;
    }
};

/// From 0 to 1 between two ticks.
double ramp(int tick, int from, int to) {
    return std::clamp(static_cast<double>(tick - from) / std::max(1, to - from), 0.0, 1.0);
}

TriangleMesh<double> square() { return sheet<double>({.width = 0.02, .height = 0.02, .columns = 10, .rows = 10}); }

TriangleMesh<double> folded_square(double slope) {
    const auto flat = square();
    Points<double> x = flat.positions();
    x.row(2) = slope * x.row(0).cwiseAbs();
    return {x, flat.triangles()};
}

TriangleMesh<double> cube() {
    const auto ball = icosphere<double>({.radius = size, .subdivisions = 2});
    Points<double> x = ball.positions();
    for (auto corner : x.colwise()) corner *= 0.8 * size / corner.cwiseAbs().maxCoeff();
    return {x, ball.triangles()};
}

/// Where a tool goes: to `start`, `in` from there, `slide` along, back out by `out`.
struct Stroke {
    Tool<double> tool;
    Point start, in = Point::Zero(), slide = Point::Zero(), out = Point::Zero();
    bool turns_back = false;  // withdrawn along the path it came
    bool grasps = false;
    int pressed = 0, slides = 0, slid = 0, leaves = 0, gone = 0;  // ticks

    Tool<double> at(int tick) const {
        Tool<double> moved = tool;
        const double withdrawn = ramp(tick, leaves, gone);
        moved.position = start + ramp(tick, 0, pressed) * in + ramp(tick, slides, slid) * slide;
        if (turns_back) moved.position += std::min(1.0, 4 * withdrawn) * -in;
        moved.position += (turns_back ? std::max(0.0, (4 * withdrawn - 1) / 3) : withdrawn) * out;
        moved.grasping = grasps && tick >= pressed + 10 && tick < slid + 10;
        return moved;
    }
};

int ticks_for(const Point& displacement, double speed) {
    return std::max(1, static_cast<int>(displacement.norm() / speed / dt));
}

bool overlaps(const Scene& scene, const Tool<double>& tool) {
    bool any = false;
    scene.tree.overlap_capsule(scene.mesh.positions(), tool.position, tool.position + tool.axis, tool.radius + 1e-5,
                               [&](Index) { any = true; });
    return any;
}

/// Up to two edges deep, at 10 mm/s to 1 m/s, withdrawn by 20 mm at 10 mm/s or up to all in one tick. It may begin on
/// the other side of a crease, and then it passes through the membrane on withdrawal.
Stroke any_stroke(const Scene& scene, test::Random& random) {
    const auto& x = scene.mesh.positions();
    Stroke stroke;
    // Over a corner, an edge or a face; often over the border.
    Index f = random.index(scene.mesh.triangle_count());
    const bool over_rim = !scene.rim.empty() && random.chance(0.4);
    const Index v = over_rim ? scene.rim[static_cast<std::size_t>(random.index(static_cast<Index>(scene.rim.size())))]
                             : scene.mesh.triangles()(0, f);
    while ((scene.mesh.triangles().col(f).array() != v).all()) f = (f + 1) % scene.mesh.triangle_count();
    const auto triangle = triangle_at(x, scene.mesh.triangles().col(f));
    Point target = point(x, v);
    if (!over_rim && random.chance(0.75)) target = point_at<double>(triangle, random.barycentric());
    Point outward = area_vector(triangle).normalized();
    if (!scene.rim.empty() && random.chance(0.3)) outward = -outward;
    const Point inward = (0.5 * random.vector() - outward).normalized();

    const Index shape = random.index(3);  // a point, a sphere, a capsule
    if (shape > 0) stroke.tool.radius = scene.edge * 0.05 * std::pow(40, random.number());
    if (shape > 1) {
        const Point axis = random.unit_vector() + random.number() * outward;
        stroke.tool.axis = random.number(0.5, 4.0) * scene.edge * (axis.dot(outward) < 0 ? -axis : axis);
    }
    stroke.tool.position = target - stroke.tool.radius * inward;
    while (overlaps(scene, stroke.tool)) stroke.tool.position -= 2e-4 * inward;
    stroke.start = stroke.tool.position;
    stroke.in = std::min(random.number(0.2, 2.0) * scene.edge, size / 2) * inward;
    if (!over_rim && random.chance(0.5)) {
        stroke.slide = 0.5 * size * random.number() * inward.cross(random.unit_vector()).normalized();
    }
    // What has gone round a rim would come up from below, and lift the membrane as it should.
    stroke.turns_back = over_rim;
    stroke.out = (2 * size + stroke.in.norm() + stroke.tool.radius) * outward;
    Tool<double> away = stroke.tool;
    const Point last = stroke.start + (over_rim ? Point(Point::Zero()) : Point(stroke.in + stroke.slide));
    for (away.position = last + stroke.out; overlaps(scene, away); away.position += 1e-3 * outward) {
        stroke.out += 1e-3 * outward;
    }
    stroke.grasps = random.chance(0.3);
    stroke.pressed = ticks_for(stroke.in, 0.01 * std::pow(100, random.number()));
    stroke.slides = stroke.pressed + 20;
    stroke.slid = stroke.slides + ticks_for(stroke.slide, 0.01 * std::pow(20, random.number()));
    stroke.leaves = stroke.slid + 20;
    stroke.gone = stroke.leaves + ticks_for(stroke.out, 0.01 * std::pow(3000, random.number()));
    return stroke;
}

/// One that does not.
Stroke random_stroke(const Scene& scene, test::Random& random) {
    const auto passes_through = [&](const Stroke& stroke) {
        const Point from = stroke.tool.position, to = from + stroke.out;
        return scene.tree.first_hit(scene.mesh.positions(), from, to).triangle != no_index;
    };
    Stroke stroke = any_stroke(scene, random);
    while (passes_through(stroke)) stroke = any_stroke(scene, random);
    return stroke;
}

/// Two edges deep into a closed surface, at 10 mm/s to 1 m/s: a shaft thinner than an edge, with its tip or its middle
/// first, straight in, on a slant, or along itself.
Stroke thin_shaft_stroke(const Scene& scene, test::Random& random) {
    const auto& mesh = scene.mesh;
    const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(random.index(mesh.triangle_count())));
    const Point foot = random.chance(0.3) ? triangle.a : point_at<double>(triangle, random.barycentric());
    const Point outward = foot.normalized();
    Stroke stroke;
    stroke.tool.radius = scene.edge * 0.05 * std::pow(10, random.number());
    const double length = random.number(2.0, 6.0) * scene.edge;
    const Point across = outward.cross(random.unit_vector()).normalized();
    const double tilt = random.chance(0.3) ? 0.0 : random.number(0.0, 1.57);
    stroke.tool.axis = length * (std::cos(tilt) * outward + std::sin(tilt) * across);
    const double middle = random.chance(0.5) ? 0.0 : 0.5;
    stroke.tool.position = foot + stroke.tool.radius * outward - middle * stroke.tool.axis;
    while (overlaps(scene, stroke.tool)) stroke.tool.position += 2e-4 * outward;
    stroke.start = stroke.tool.position;
    const bool along = random.chance(0.3), slanted = random.chance(0.5);
    const Point inward = along     ? Point(-stroke.tool.axis.normalized())
                         : slanted ? Point((0.5 * random.vector() - outward).normalized())
                                   : Point(-outward);
    stroke.in = std::min(2 * scene.edge, size) * inward;
    stroke.out = 2 * size * outward - stroke.in;
    stroke.pressed = stroke.slides = stroke.slid = ticks_for(stroke.in, 0.01 * std::pow(100, random.number()));
    stroke.leaves = stroke.pressed + 1000;
    stroke.gone = stroke.leaves + 1000;
    return stroke;
}

/// Up to two edges deep into a sheet, dragged at 10 to 50 mm/s to where it is beside it, and out: a shaft that is
/// upright, leans or lies, with its tip first.
Stroke dragged_over_border(test::Random& random) {
    Stroke stroke;
    stroke.tool.radius = random.number(0.3e-3, 1.5e-3);
    const double kind = random.number(), direction = random.number(0.0, 6.28), bearing = random.number(0.0, 6.28);
    const double tilt = kind < 0.3 ? 0 : kind < 0.6 ? random.number(0.0, 1.2) : 1.45;
    const Point along(std::cos(direction), std::sin(direction), 0), across(std::cos(bearing), std::sin(bearing), 0);
    stroke.tool.axis = 0.03 * (std::sin(tilt) * across + std::cos(tilt) * Point::UnitZ());
    stroke.start = 0.004 * along + (stroke.tool.radius + 1e-4) * Point::UnitZ();
    stroke.in = -(random.number(0.3e-3, 2e-3) + stroke.start.z()) * Point::UnitZ();
    stroke.slide = 0.016 * along;
    stroke.out = 0.006 * Point::UnitZ();
    const double speed = random.number(0.01, 0.05);
    stroke.pressed = ticks_for(stroke.in, speed);
    stroke.slides = stroke.pressed;
    stroke.slid = stroke.leaves = stroke.slides + ticks_for(stroke.slide, speed);
    stroke.gone = stroke.leaves + ticks_for(stroke.out, speed);
    return stroke;
}

double max_edge(const Scene& scene) {
    double longest = 0;
    for (const auto& spring : scene.network.springs()) {
        longest = std::max(longest, norm<double>(scene.x.col(spring.second) - scene.x.col(spring.first)));
    }
    return longest;
}

/// Whether no point of a shaft's axis is inside a closed surface.
bool axis_is_outside(const Scene& scene, const Tool<double>& tool) {
    const LocalSurface<double> surface(scene.mesh);
    return scene.tree.first_hit(scene.x, tool.position, Point(tool.position + tool.axis)).triangle == no_index &&
           winding_number(surface, scene.tree, scene.x, tool.position) == 0;
}

Scene free_sheet(const TrackerOptions& options = {}) {
    Scene scene(sheet<double>({.width = 0.02, .height = 0.02, .columns = 20, .rows = 20}), false);
    scene.tracker = ContactTracker(scene.mesh, options);
    return scene;
}

/// What a shaft leaves that is dragged over the border of a free sheet: its longest edge ever, and whether it comes
/// back.
struct Dragged {
    double longest = 0;  // [m]
    bool comes_back = false;
};

Dragged drag_over_border(Scene scene, int seed) {
    test::Random random(static_cast<std::uint64_t>(seed));
    const Stroke stroke = dragged_over_border(random);
    scene.solver = QuasiStaticSolver(scene.network, {.layers = 6, .sweeps = 2 << random.index(4)});
    Dragged left;
    for (int tick = 0; tick <= stroke.gone; ++tick) {
        scene.tick(stroke.at(tick));
        left.longest = std::max(left.longest, max_edge(scene));
    }
    left.comes_back = scene.comes_back(stroke.at(stroke.gone), 2100);
    return left;
}

/// What comes of a thin shaft in a closed surface: whether that is at rest, with the shaft outside, within a second,
/// and comes back without it.
struct Pierced {
    bool converged = false, outside = false, comes_back = false;
};

Pierced press_thin_shaft(int seed) {
    test::Random random(static_cast<std::uint64_t>(seed));
    Scene scene(icosphere<double>({.radius = size, .subdivisions = 1 + seed % 2}));
    const Stroke stroke = thin_shaft_stroke(scene, random);
    Pierced left;
    for (int tick = 0; tick < stroke.leaves; ++tick) {
        left.converged = scene.tick(stroke.at(tick)).converged;
        if (left.converged && tick >= stroke.pressed) break;
    }
    left.outside = axis_is_outside(scene, stroke.at(stroke.pressed));
    for (int tick = stroke.leaves; tick <= stroke.gone; ++tick) scene.tick(stroke.at(tick));
    left.comes_back = scene.comes_back(stroke.at(stroke.gone), 2100);
    return left;
}

}  // namespace

TEST_CASE("after any stroke of any tool over creases, rims and coarse meshes the membrane comes back", "[withdrawal]") {
    const std::vector<Scene> scenes{Scene(icosphere<double>({.radius = size, .subdivisions = 1})),
                                    Scene(icosphere<double>({.radius = size, .subdivisions = 2})),
                                    Scene(cube()),
                                    Scene(square()),
                                    Scene(folded_square(-0.7)),
                                    Scene(folded_square(0.7)),
                                    Scene(spherical_cap<double>({.rings = 8}))};
    for (int seed = 1; seed <= cases(80, 20'000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Scene scene = scenes[static_cast<std::size_t>(seed) % scenes.size()];
        const Stroke stroke = random_stroke(scene, random);
        for (int tick = 0; tick <= stroke.gone; ++tick) scene.tick(stroke.at(tick));
        CHECK(scene.comes_back(stroke.at(stroke.gone), 2100));
    }
}

// Where nothing holds the border, a tool that slides off it may touch from the other side next, and lifts the membrane
// as it is withdrawn. That is no failure to come back, and so it is lowered again, until it neither touches from there
// nor overlaps the membrane at rest.
TEST_CASE("a membrane with a free border comes back from what has gone round it", "[withdrawal]") {
    const std::vector<Scene> scenes{Scene(square(), false), Scene(folded_square(-0.7), false),
                                    Scene(folded_square(0.7), false),
                                    Scene(spherical_cap<double>({.rings = 8}), false)};
    for (int seed = 1; seed <= cases(120, 2000); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Scene& fresh = scenes[static_cast<std::size_t>(seed) % scenes.size()];
        Scene scene = fresh;
        const Stroke stroke = random_stroke(scene, random);
        double first_side = 0;
        for (int tick = 0; tick <= stroke.gone; ++tick) {
            scene.tick(stroke.at(tick));
            if (first_side == 0 && scene.contact.touching()) first_side = scene.contact.patch.side;
        }
        Tool<double> tool = stroke.at(stroke.gone);
        const auto is_lifted = [&] { return scene.contact.touching() && scene.contact.patch.side != first_side; };
        constexpr int lowering = 400;
        for (int tick = 0; tick < lowering && (is_lifted() || overlaps(fresh, tool)); ++tick) {
            tool.position -= 2.0 / lowering * stroke.out;
            scene.tick(tool);
        }
        CHECK(scene.comes_back(tool, 2100));
    }
}

// Most slide off and draw no edge out by much. One in thirty catches on a border that has yielded: it is taken to have
// gone through it, and pulls a corner along.
TEST_CASE("a shaft dragged slowly over a free border slides off, and the membrane comes back", "[withdrawal]") {
    const Scene fresh = free_sheet();
    const int runs = cases(8, 1000);
    int caught = 0;
    for (int seed = 1; seed <= runs; ++seed) {
        CAPTURE(seed);
        const auto left = drag_over_border(fresh, seed);
        CHECK(left.comes_back);
        if (left.longest > 5 * fresh.edge) ++caught;
    }
    const double expected = 0.04 * runs, deviation = std::sqrt(0.96 * expected);
    CHECK(caught <= expected + 2 * deviation);
}

TEST_CASE("no shaft that is dragged over a free border is left with the membrane on it", "[withdrawal]") {
    for (const int seed : {67, 193, 378, 711}) CHECK(drag_over_border(free_sheet(), seed).comes_back);
    for (const int seed : {74, 169, 416, 418}) {
        CHECK(drag_over_border(free_sheet({.fine_triangles = 0}), seed).comes_back);
    }
}

TEST_CASE("forceps hold nothing once a shaft is back that had gone round a free border", "[withdrawal]") {
    const double fine = GENERATE(0.0, 0.5);
    Scene scene = free_sheet({.fine_triangles = fine});
    const Point from(0.0088, 0.0267, -0.0053), to(0.0084, 0.0067, -0.0041);
    Tool<double> shaft{.axis = {-0.002, 0.008, 0.0087}, .radius = 0.91e-3};
    bool touched = false;
    for (int tick = 0; tick < 1200; ++tick) {
        shaft.position = from + (ramp(tick, 0, 400) - 1.5 * ramp(tick, 600, 1200)) * (to - from);
        scene.tick(shaft);
        touched |= scene.contact.touching();
    }
    CHECK(touched);
    CHECK_FALSE(scene.contact.touching());
    shaft.grasping = true;
    scene.tick(shaft);
    CHECK_FALSE(scene.grasper.update(scene.contact, scene.x, shaft).holding());
}

// One or two in a hundred are not at rest after a second, one in two hundred has its axis inside until it is withdrawn.
TEST_CASE("a shaft thinner than an edge, two edges deep, stays outside a closed surface and leaves it",
          "[withdrawal]") {
    const int runs = cases(20, 2000);
    int moving = 0, inside = 0;
    for (int seed = 1; seed <= runs; ++seed) {
        CAPTURE(seed);
        const auto left = press_thin_shaft(seed);
        if (!left.converged) ++moving;
        if (!left.outside) ++inside;
        CHECK(left.comes_back);
    }
    CHECK(moving <= std::max(1, runs / 50));
    CHECK(inside <= std::max(1, runs / 100));
}

TEST_CASE("every still thin shaft comes to rest outside a closed surface", "[withdrawal]") {
    for (const int seed : {201, 704}) {
        CAPTURE(seed);
        const auto left = press_thin_shaft(seed);
        CHECK(left.converged);
        CHECK(left.outside);
    }
}

TEST_CASE("forceps that open below the surface and are drawn out slowly let go of it", "[withdrawal]") {
    const Scene fresh(icosphere<double>({.radius = size, .subdivisions = 2}));
    for (const double radius : {1e-3, 2e-3}) {
        for (const double drawn : {0.0, 2e-3}) {
            for (const Index place : {0, 1, 2}) {
                CAPTURE(radius, drawn, place);
                const Point foot = point(fresh.mesh.positions(), 41 * place + 20), out = foot.normalized();
                const Point side = out.cross(Point(0.3, 0.5, 0.81)).normalized();
                Stroke stroke{.tool = {.radius = radius}, .start = foot + radius * out, .in = -0.002 * out};
                stroke.slide = drawn * out + 0.006 * side;
                stroke.out = 0.02 * out;
                stroke.grasps = true;
                stroke.pressed = 100, stroke.slides = 150, stroke.slid = 300, stroke.leaves = 350;
                stroke.gone = 550;
                Scene scene = fresh;
                for (int tick = 0; tick <= stroke.gone; ++tick) scene.tick(stroke.at(tick));
                CHECK(scene.comes_back(stroke.at(stroke.gone), 500));
            }
        }
    }
}

TEST_CASE("a shaft over a pinned rim is withdrawn as it was pressed", "[withdrawal]") {
    const Scene fresh(sheet<double>({.width = 0.02, .height = 0.02, .columns = 14, .rows = 14}));
    for (const int i : {1, 3, 6, 8, 14}) {
        for (const double rise : {0.0, 0.001, 0.002}) {
            CAPTURE(i, rise);
            Stroke stroke{.tool = {.axis = {0.01, 0, rise}, .radius = 5e-4}, .start = {5e-4 * i, 0.0003, 0.0005}};
            stroke.in = {0, 0, -0.002};
            stroke.out = {0, 0, 0.02};
            stroke.pressed = 100, stroke.leaves = 200, stroke.gone = 1200;
            Scene scene = fresh;
            for (int tick = 0; tick <= stroke.gone; ++tick) scene.tick(stroke.at(tick));
            CHECK(scene.comes_back(stroke.at(stroke.gone), 500));
        }
    }
}
