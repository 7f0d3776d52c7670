// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <sstream>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

// Contact carried by vertices, see `ContactVertices`, in a step.

using namespace membrane;
using Point = Vector3<double>;

namespace {

constexpr double body_radius = 0.01, tick = 1e-3;  // [m], [s]
const Point start = Point(0.31, 0.17, 0.93).normalized();
const Point along = start.cross(Point(0.7, -0.5, 0.2)).normalized();

/// The same foundation per area on a mesh of any triangles.
std::vector<double> foundation_of(const TriangleMesh<double>& mesh) {
    std::vector<double> stiffness = vertex_areas(mesh);
    const double whole = std::accumulate(stiffness.begin(), stiffness.end(), 0.0);
    for (double& area : stiffness) area *= 8 * 2562 / whole;
    return stiffness;
}

/// A sphere on volume springs, of the same stiffness per area on each mesh, under a tool that presses and slides.
template <Real S>
struct Scene {
    TriangleMesh<S> mesh;
    MassSpringNetwork<S, LinearSpring> network{mesh, {}, {.stiffness = S(40)}};
    VirtualVolumeSprings<S> foundation;
    QuasiStaticSolver<S> solver;
    AabbTree<S> tree{mesh};
    ContactTracker<S> tracker;
    Points<S> x = mesh.positions();
    Tool<S> tool{};
    Contact<S> contact = Contact<S>::none();

    Scene(const TriangleMesh<S>& of, const Field<S>& stiffness, double fine_triangles, const SolverOptions<S>& options,
          double damping = 0)
        : mesh(of),
          foundation(mesh, {.stiffness = stiffness, .damping = S(damping)}),
          solver(network, options),
          tracker(mesh, {.fine_triangles = fine_triangles}) {}

    Scene(int subdivisions, double fine_triangles, const SolverOptions<S>& options, double damping = 0)
        : Scene(icosphere<S>({.radius = S(body_radius), .subdivisions = subdivisions}),
                S(8 * std::pow(4.0, 4 - subdivisions)), fine_triangles, options, damping) {}

    /// Presses the tool `depth` deep at `angle` from the start.
    StepReport<S> press_at(double depth, double angle, double radius = 2e-3, const Point& axis = Point::Zero()) {
        return press_towards(std::cos(angle) * start + std::sin(angle) * along, depth, radius, axis);
    }
    StepReport<S> press_towards(const Point& outward, double depth, double radius, const Point& axis = Point::Zero()) {
        tool.position = ((body_radius + radius - depth) * outward).cast<S>();
        tool.axis = axis.cast<S>();
        tool.radius = S(radius);
        contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, S(tick), network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        return report;
    }
    /// The largest overlap of a vertex that carries the contact with the tool and its lift [m].
    [[nodiscard]] double overlap() const {
        double largest = 0;
        for (const auto& point : contact.patch.points) {
            const auto separation = to_segment<S>(membrane::point(x, point.corners[0]), tool.position, tool.axis);
            if (point.feature == vertex_feature)
                largest = std::max(largest, static_cast<double>(tool.radius + point.lift - norm(separation)));
        }
        return largest;
    }
};

}  // namespace

TEST_CASE("with contact by vertices, steps converge to Newton's equilibrium", "[contact]") {
    test::Random random(1);
    for (int i = 0; i < cases(12); ++i) {
        CAPTURE(i);
        Scene<double> scene(i == 0 ? 4 : 3, 0.5, {.layers = unlimited, .sweeps = 50});
        const double depth = random.number(0.2e-3, 1.5e-3), angle = random.number(0.0, 3.0);
        const Point axis = random.chance(0.5) ? Point(4e-3 * random.unit_vector() + 8e-3 * start) : Point::Zero();
        double force = 0;
        bool converged = false;
        for (int t = 1; t <= 200 && !converged; ++t) {
            const auto report = scene.press_at(depth * std::min(t, 20) / 20, angle, 2e-3, axis);
            REQUIRE(report.status == StepStatus::advanced);
            force = norm(report.reactions[0]);
            converged = t > 20 && report.converged;
        }
        CHECK(converged);
        const auto rest =
            equilibrium(scene.x, scene.mesh, scene.network, scene.foundation, {}, press(scene.tool, scene.contact));
        REQUIRE(rest.converged);
        CHECK((scene.x - rest.x).cwiseAbs().maxCoeff() < 1e-9);
        CHECK(force == Approx(norm(rest.reactions[0])).epsilon(1e-7));
        double sum = 0;
        for (const auto& point : scene.solver.contact_points(0)) {
            REQUIRE(point.feature == vertex_feature);
            const auto gap = norm(to_segment<double>(membrane::point(scene.x, point.corners[0]), scene.tool.position,
                                                     scene.tool.axis)) -
                             scene.tool.radius - point.lift;
            CHECK(gap > -1e-9);
            if (norm(point.force) > 1e-7) CHECK(gap < 1e-9);  // only a vertex that touches pushes
            sum += norm(point.force);
        }
        CHECK(sum >= force);
    }
}

// Around a deep contact triangles stretch to the size of the ball.
TEST_CASE("a ball does not pass between the vertices, however deep it is", "[contact]") {
    test::Random random(6);
    for (int i = 0; i < cases(4, 24); ++i) {
        const double size = random.number(0.4, 0.7),
                     radius = 1.4e-3 / std::sqrt(3.0) / size;  // of triangles over radius
        const double depth = random.number(1.75, 3.0) * radius, slide = random.chance(0.5) ? 0.4 : 0.0;
        CAPTURE(i, size, depth, slide);
        Scene<double> scene(3, random.chance(0.5) ? 1 : 0.5, {.layers = unlimited, .sweeps = 4});
        const Point from = random.unit_vector(), to = from.cross(random.unit_vector()).normalized();
        StepReport<double> report;
        bool passed = false;
        for (int t = 1; t <= 600 && !(t > 300 && report.converged); ++t) {
            const double angle = slide * std::clamp((t - 120) / 100.0, 0.0, 1.0);
            const Point outward = std::cos(angle) * from + std::sin(angle) * to;
            report = scene.press_towards(outward, depth * std::min(t, 100) / 100, radius);
            REQUIRE(report.status == StepStatus::advanced);
            passed = passed || scene.contact.patch.tunnelled;
        }
        CHECK_FALSE(passed);
        CHECK(report.converged);
        CHECK(scene.contact.gap > -0.51 * radius);
        CHECK(scene.overlap() < 1e-5);
    }
}

TEST_CASE("the force of a ball converges with the mesh, from coarse ones on", "[contact]") {
    const auto force_on = [](int subdivisions, double fine_triangles) {
        Scene<double> scene(subdivisions, fine_triangles, {.layers = unlimited, .sweeps = 20});
        double force = 0;
        for (int t = 1; t <= 60; ++t) force = norm(scene.press_at(1e-3 * std::min(t, 40) / 40, 0).reactions[0]);
        return force;
    };
    constexpr double continuum = 0.07748;  // the limit of both kinds of contact, extrapolated from 40,962 vertices
    const std::array<double, 3> bars{0.1, 0.015, 0.005};
    for (int subdivisions = 3; subdivisions <= cases(4, 5); ++subdivisions) {
        CAPTURE(subdivisions);
        const double error = std::abs(force_on(subdivisions, 0.5) / continuum - 1);
        CHECK(error < bars[static_cast<std::size_t>(subdivisions - 3)]);
        CHECK(force_on(subdivisions, 0) / continuum - 1 > 5 * error);  // by faces
    }
}

// A vertex of an icosphere has 5 or 6 triangles: with a foundation per area the ripple is that of the contact.
TEST_CASE("as a ball slides over vertices and faces, the force by vertices has about the ripple by faces",
          "[contact]") {
    std::ostringstream table;
    for (int subdivisions = 3; subdivisions <= cases(4, 6); ++subdivisions) {
        const auto mesh = icosphere<double>({.radius = body_radius, .subdivisions = subdivisions});
        const Field<double> stiffness = foundation_of(mesh);
        for (const double depth : {0.2e-3, 0.5e-3, 1e-3}) {
            table << mesh.vertex_count() << " vertices, " << 1e3 * depth << " mm deep: mean and ripple [mN]";
            std::array<double, 2> ripples{};
            for (const double fine : {0.0, 0.5}) {
                Scene<double> scene(mesh, stiffness, fine, {.layers = 12, .sweeps = 12});
                double low = 1, high = 0, sum = 0;
                const int held = 60, slid = cases(60, 260);
                for (int t = 1; t <= held + slid; ++t) {
                    const double edges = 2.0 * std::max(t - held, 0) / slid;  // slid by two edges
                    const double angle = edges * 1.1 / (1 << subdivisions);
                    const double pressed = depth * std::min(t, 40) / 40;
                    const double force = norm(scene.press_at(pressed, angle).reactions[0]);
                    if (t < held) continue;
                    low = std::min(low, force);
                    high = std::max(high, force);
                    sum += force / (slid + 1);
                }
                table << (fine == 0 ? ", by faces " : ", by vertices ") << 1e3 * sum << ' ' << 1e3 * (high - low);
                ripples[fine == 0 ? 0 : 1] = high - low;
            }
            table << "\n";
            CAPTURE(table.str());
            CHECK(ripples[1] < 1.5 * ripples[0]);
        }
    }
    WARN(table.str());
}

TEST_CASE("on a graded mesh the force does not jump where faces take over from the vertices", "[contact]") {
    const auto mesh = test::graded_sphere(body_radius, 4, 2.5);  // triangles of 0.08 to 0.5 tool radii
    const Field<double> stiffness = foundation_of(mesh);
    const SolverOptions<double> options{.layers = 12, .sweeps = 20};
    Scene<double> by_vertices(mesh, stiffness, 1, options), by_both(mesh, stiffness, 0.2, options),
        by_faces(mesh, stiffness, 0, options);
    const double radius = 2e-3, depth = 0.8e-3;
    const ContactVertices carriers(LocalSurface<double>(mesh), ConstPointsRef<double>(mesh.positions()), 0.2);
    const int places = std::max(10, cases(30, 200));
    bool both = false;
    double last = 0, of_faces = 0;
    for (int i = 0; i < places; ++i) {
        CAPTURE(i);
        const double angle = 0.3 + 2.3 * i / (places - 1);
        const Point outward(std::sin(angle) * std::cos(0.3), std::sin(angle) * std::sin(0.3), std::cos(angle));
        const auto force_on_ball = [&](Scene<double>& scene) {
            StepReport<double> report;
            for (int t = 1; t <= (i == 0 ? 60 : 8); ++t)
                report = scene.press_towards(outward, i == 0 ? depth * std::min(t, 40) / 40 : depth, radius);
            return norm(report.reactions[0]);
        };
        const double of_vertices = force_on_ball(by_vertices);
        of_faces = force_on_ball(by_faces);
        last = force_on_ball(by_both);
        double least = 1, most = 0;  // of roundness, where the tool presses
        for (const auto& point : by_both.solver.contact_points(0)) {
            for (std::size_t k = 0; k < point.vertices().size() && norm(point.force) > 0; ++k) {
                const double round = carriers.roundness(point.corners[k], radius);
                least = std::min(least, round);
                most = std::max(most, round);
            }
        }
        both = both || (most == 1 && least < 1);
        CAPTURE(of_vertices, of_faces, last, least);
        CHECK(last >= of_vertices * (1 - 1e-3));
        CHECK(last <= of_vertices + (1.2 - least) * (of_faces - of_vertices));
    }
    CHECK(both);
    CHECK(of_faces > 1.7 * 0.054);  // what faces add on the large triangles
    CHECK(last > 1.4 * 0.054);
}

TEST_CASE("where faces are lifted, steps converge to Newton's equilibrium", "[contact]") {
    test::Random random(4);
    const auto mesh = test::graded_sphere(body_radius, 3, 2);
    const int count = cases(15, 200);
    int lifted = 0, unconverged = 0;
    for (int i = 0; i < count; ++i) {
        CAPTURE(i);
        Scene<double> scene(mesh, foundation_of(mesh), 0.4, {.layers = unlimited, .sweeps = 50});
        const Point outward = random.unit_vector();
        const Point axis = random.chance(0.3) ? Point(4e-3 * random.unit_vector() + 8e-3 * outward) : Point::Zero();
        const double depth = random.number(0.3e-3, 1.2e-3);
        bool converged = false;
        for (int t = 1; t <= 200 && !converged; ++t) {
            const auto report = scene.press_towards(outward, depth * std::min(t, 20) / 20, 2e-3, axis);
            REQUIRE(report.status == StepStatus::advanced);
            converged = t > 20 && report.converged;
        }
        unconverged += !converged;
        const double force = norm(scene.press_towards(outward, depth, 2e-3, axis).reactions[0]);
        for (const auto& face : scene.contact.patch.faces) {
            lifted += face.lift < 0;
        }
        const auto rest =
            equilibrium(scene.x, scene.mesh, scene.network, scene.foundation, {}, press(scene.tool, scene.contact));
        unconverged += !rest.converged;
        CHECK((scene.x - rest.x).cwiseAbs().maxCoeff() < 1e-8);
        CHECK(force == Approx(norm(rest.reactions[0])).epsilon(1e-5));
    }
    CHECK(lifted > 0);
    CHECK(unconverged == 0);
}

TEMPLATE_TEST_CASE("no vertex ends a tick in the tool, at any depth and speed, and the membrane comes back",
                   "[contact]", TEST_SCALARS) {
    using S = TestType;
    test::Random random(2);
    for (int i = 0; i < cases(20, 200); ++i) {
        CAPTURE(i);
        const double depth = random.number(0.5e-3, 2e-3), speed = random.number(0.02, 0.1);
        const SolverOptions<S> options{.layers = random.chance(0.5) ? 3 : 6, .sweeps = random.index(2) + 1};
        Scene<S> scene(random.index(2) + 3, 0.5, options, 0.02);
        const Point axis = random.chance(0.3) ? Point(4e-3 * random.unit_vector() + 8e-3 * start) : Point::Zero();
        double overlap = 0, angle = 0;
        for (int t = 1; t <= 160; ++t) {
            if (t > 40) angle += speed * tick / body_radius;
            REQUIRE(scene.press_at(depth * std::min(t, 40) / 40, angle, 2e-3, axis).status == StepStatus::advanced);
            overlap = std::max(overlap, scene.overlap());
        }
        CHECK(overlap < 0.01 * body_radius / 8);  // 1 % of an edge
        for (int t = 1; t <= 150; ++t) {
            static_cast<void>(scene.press_at(depth - t * 1e-4, angle, 2e-3, axis));
        }
        CHECK(static_cast<double>((scene.x - scene.mesh.positions()).cwiseAbs().maxCoeff()) < 1e-6);
    }
}
