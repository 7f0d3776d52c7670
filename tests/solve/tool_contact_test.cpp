// SPDX-License-Identifier: MIT
#include <membrane/solve/tool_contact.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <membrane/contact/contact_tracker.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/contact_newton.hpp"
#include "support/orders.hpp"
#include "support/random.hpp"

// Tools against a membrane, through tracker, tree and solver; lengths in radii of the sphere, stiffnesses in those of
// its springs.

using namespace membrane;

static_assert(Constraint<ToolContact<double>, double> && Constraint<ToolContact<float>, float>);

namespace {

using Point = Vector3<double>;

const TriangleMesh<double>& unit_sphere() {
    static const auto mesh = icosphere<double>({.radius = 1, .subdivisions = 2});
    return mesh;
}

double mean_edge(const TriangleMesh<double>& mesh) {
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    double sum = 0;
    for (const auto& spring : network.springs()) sum += spring.rest_length;
    return sum / static_cast<double>(network.springs().size());
}

std::vector<Index> border_of(const TriangleMesh<double>& mesh) {
    const Adjacency adjacency(mesh);
    return {adjacency.border_vertices().begin(), adjacency.border_vertices().end()};
}

struct Material {
    double foundation;
    double damping = 0;
    std::vector<Index> pinned = {};
    double fine_triangles = 0;  // of the trackers
};

/// A membrane with springs of stiffness 1 and all that a loop with two tools needs.
template <Real S>
class LoopOf {
  public:
    LoopOf(const TriangleMesh<S>& mesh, const Material& material, const SolverOptions<S>& options)
        : mesh_(mesh),
          material_(material),
          network_(mesh, LinearSpring{}, {.stiffness = S(1), .pinned = material.pinned}),
          foundation_(mesh,
                      {.stiffness = static_cast<S>(material.foundation), .damping = static_cast<S>(material.damping)}),
          solver_(network_, options),
          tree_(mesh),
          trackers_(2, ContactTracker(mesh, {.fine_triangles = material.fine_triangles})),
          x_(mesh.positions()) {}

    /// Presses with one tool or two.
    const StepReport<S>& tick(const std::vector<Tool<double>>& tools) {
        std::array<Tool<S>, 2> cast;
        for (std::size_t i = 0; i < tools.size(); ++i) {
            cast[i].position = tools[i].position.template cast<S>();
            cast[i].axis = tools[i].axis.template cast<S>();
            cast[i].radius = static_cast<S>(tools[i].radius);
            contacts_[i] = trackers_[i].update(tree_, x_, cast[i]);
        }
        report_ = solver_.step(x_, S(1e-3), network_, foundation_, press(cast[0], contacts_[0]),
                               press(cast[1], contacts_[1]));
        tree_.refit(x_, report_.moved);
        return report_;
    }

    const Points<S>& x() const { return x_; }
    const Contact<S>& contact() const { return contacts_.front(); }
    const MassSpringNetwork<S, LinearSpring>& network() const { return network_; }
    const VirtualVolumeSprings<S>& foundation() const { return foundation_; }

    /// Force of the membrane on tool `i`.
    Vector3<S> reaction(std::size_t i = 0) const { return report_.reactions[i]; }

    S energy() const {
        S sum = network_.energy(x_);
        for (Index v = 0; v < mesh_.vertex_count(); ++v) sum += foundation_.energy(v, point(x_, v));
        return sum;
    }

    /// The same membrane for the test's own method.
    test::PressedMembrane pressed_by(const std::vector<Tool<double>>& tools) const {
        return {mesh_.triangles(),
                {network_.springs().begin(), network_.springs().end()},
                mesh_.positions(),
                material_.foundation,
                tools,
                {material_.pinned.begin(), material_.pinned.end()}};
    }

  private:
    TriangleMesh<S> mesh_;
    Material material_;
    MassSpringNetwork<S, LinearSpring> network_;
    VirtualVolumeSprings<S> foundation_;
    QuasiStaticSolver<S> solver_;
    AabbTree<S> tree_;
    std::vector<ContactTracker<S>> trackers_;
    Points<S> x_;
    std::array<Contact<S>, 2> contacts_;
    StepReport<S> report_;
};
using Loop = LoopOf<double>;

constexpr SolverOptions<double> exact{.layers = unlimited, .sweeps = 16, .force_tolerance = 1e-12};

/// The same with each order of updates in turn.
SolverOptions<double> exact_in_order_of(int seed) {
    auto options = exact;
    options.order = test::order_of(seed);
    return options;
}

/// A tool and where it goes.
struct Stroke {
    Tool<double> tool;  // it does not touch yet
    Point displacement;

    Tool<double> at(double part) const {
        Tool<double> moved = tool;
        moved.position += part * displacement;
        return moved;
    }
};

std::vector<Tool<double>> tools_at(const std::vector<Stroke>& strokes, double part) {
    std::vector<Tool<double>> tools;
    for (const auto& stroke : strokes) tools.push_back(stroke.at(part));
    return tools;
}

/// Moves the tools in over several ticks and waits for rest; whether it came.
template <Real S>
bool press_to_rest(LoopOf<S>& loop, const std::vector<Stroke>& strokes, int ticks = 10) {
    for (int i = 1; i < ticks; ++i) loop.tick(tools_at(strokes, static_cast<double>(i) / ticks));
    for (int i = 0; i < 2000; ++i) {
        if (loop.tick(tools_at(strokes, 1)).converged) return true;
    }
    return false;
}

enum class Over { vertex, edge, face };

Point random_target(const TriangleMesh<double>& mesh, Over over, test::Random& random) {
    const auto triangle = triangle_at(mesh.positions(), mesh.triangles().col(random.index(mesh.triangle_count())));
    const double along = random.number(0.1, 0.9);
    switch (over) {
        case Over::vertex: return triangle.a;
        case Over::edge: return point_at<double>(triangle, {along, 1 - along, 0});
        default: return point_at<double>(triangle, random.barycentric());
    }
}

/// Whether a tool overlaps a surface.
bool overlaps(const Tool<double>& tool, const TriangleMesh<double>& mesh) {
    for (const auto& corners : mesh.triangles().colwise()) {
        if (test::distance_from_axis(tool, mesh.positions()(Eigen::all, corners)) < tool.radius) return true;
    }
    return false;
}

/// Into the unit sphere, on a slant: a sphere of 0.05 to 3 edges, or now and then a capsule.
Stroke random_stroke(Over over, test::Random& random) {
    const auto& mesh = unit_sphere();
    const double edge = mean_edge(mesh);
    const Point target = random_target(mesh, over, random), outward = target.normalized();
    const Point inward = (0.3 * random.vector<double>() - outward).normalized();
    Stroke stroke;
    stroke.tool.radius = edge * 0.05 * std::pow(60, random.number());
    if (random.chance(0.25)) {
        const Point axis = random.unit_vector() + random.number() * outward;
        stroke.tool.axis = random.number(0.5, 3.0) * edge * (axis.dot(outward) < 0 ? -axis : axis);
    }
    stroke.tool.position = target - stroke.tool.radius * inward;
    while (overlaps(stroke.tool, mesh)) stroke.tool.position -= 0.02 * inward;
    const double depth = std::min(0.15, 0.05 + stroke.tool.radius / 2) * random.number(0.2, 1.0);
    stroke.displacement = (depth + 0.005) * inward;
    stroke.tool.position -= 0.005 * inward;
    return stroke;
}

/// Whether two tools stay apart, so that the membrane has space between them.
bool apart(const Stroke& a, const Stroke& b) {
    const auto distance = [&](double s, double t) {
        const Tool<double> tool = a.at(1), other = b.at(1);
        return (tool.position + s * tool.axis - other.position - t * other.axis).norm();
    };
    const double min_distance = a.tool.radius + b.tool.radius + 0.3 * mean_edge(unit_sphere());
    for (const double s : {0.0, 0.25, 0.5, 0.75, 1.0}) {
        for (const double t : {0.0, 0.25, 0.5, 0.75, 1.0}) {
            if (distance(s, t) < min_distance) return false;
        }
    }
    return true;
}

/// One tool for odd seeds, two for even ones: somewhere, or side by side.
std::vector<Stroke> random_strokes(int seed, test::Random& random) {
    const auto over = static_cast<Over>(seed / 2 % 3);
    std::vector<Stroke> strokes{random_stroke(over, random)};
    const Stroke first = strokes.front();
    while (seed % 2 == 0 && strokes.size() < 2) {
        const Stroke other = random_stroke(over, random);
        const double distance = (other.tool.position - first.tool.position).norm();
        const bool beside = distance < first.tool.radius + other.tool.radius + 2 * mean_edge(unit_sphere());
        if (apart(first, other) && (beside || seed % 4 == 0)) strokes.push_back(other);
    }
    return strokes;
}

/// How deep the surface is in a tool, at the deepest.
double largest_overlap(const test::PressedMembrane& membrane, const Points<double>& x) {
    double largest = 0;
    for (const auto& tool : membrane.tools) {
        for (const auto& corners : membrane.triangles.colwise()) {
            const double distance = test::distance_from_axis(tool, x(Eigen::all, corners));
            largest = std::max(largest, tool.radius - distance);
        }
    }
    return largest;
}

/// What is left of the forces when those of frictionless contacts are taken off: each along the normal of something
/// that touches, away from the tool.
struct ContactForces {
    double unexplained = 0;
    std::vector<Point> reactions;
};

ContactForces contact_forces(const test::PressedMembrane& membrane, const Points<double>& x,
                             const std::vector<test::Feature>& touching) {
    Eigen::MatrixXd J = test::gap_gradients(touching, x.size());
    Eigen::VectorXd F = membrane.forces(x);
    for (const Eigen::Index row : test::coordinates_of(membrane.pinned)) {
        J.col(row).setZero();
        F[row] = 0;
    }
    const Eigen::VectorXd pressures = test::smallest_non_negative(J * J.transpose(), J * F);
    ContactForces forces{(F + J.transpose() * pressures).lpNorm<Eigen::Infinity>(),
                         std::vector<Point>(membrane.tools.size(), Point::Zero())};
    for (std::size_t i = 0; i < touching.size(); ++i) {
        forces.reactions[touching[i].tool] += pressures[static_cast<Eigen::Index>(i)] * touching[i].normal();
    }
    return forces;
}

double smallest_radius(const test::PressedMembrane& membrane) {
    return std::min(membrane.tools.front().radius, membrane.tools.back().radius);
}

/// Newton's method from beside `x`, every vertex moved at random.
test::PressedState newton_beside(const test::PressedMembrane& membrane, const Points<double>& x, test::Random& random) {
    const double radius = smallest_radius(membrane);
    const auto start = test::jittered<double>(x, std::min(0.01, 0.1 * radius), random);
    return test::at_rest(membrane, start, {.far = 0.15, .max_step = radius / 2});
}

/// Newton's method along its own path: from the untouched membrane, in small steps of the tools.
test::PressedState newton_along(test::PressedMembrane membrane, const std::vector<Stroke>& strokes) {
    const double radius = smallest_radius(membrane);
    const double displacement = std::max(strokes.front().displacement.norm(), strokes.back().displacement.norm());
    const int steps = static_cast<int>(std::ceil(displacement / std::min(0.02, 0.3 * radius)));
    test::PressedState state{membrane.anchors, {}, true};
    for (int i = 1; i <= steps && state.converged; ++i) {
        membrane.tools = tools_at(strokes, static_cast<double>(i) / steps);
        state = test::at_rest(membrane, state.x, {.far = 0.15, .max_step = radius / 2});
    }
    return state;
}

void check_forces(const Loop& loop, const test::PressedMembrane& pressed, const std::vector<test::Feature>& touching) {
    const auto forces = contact_forces(pressed, loop.x(), touching);
    CHECK(forces.unexplained < 1e-9);
    for (std::size_t i = 0; i < pressed.tools.size(); ++i) {
        CHECK((forces.reactions[i] - loop.reaction(i)).norm() < 1e-9);
    }
}

/// The tools are free of the surface, which touches them without friction, and feel what it feels.
void check_contact(const Loop& loop, const test::PressedMembrane& pressed) {
    CHECK(largest_overlap(pressed, loop.x()) < 1e-9);
    check_forces(loop, pressed, test::features_near(pressed, loop.x(), 1e-8));
}

/// A tiny sphere touches the planes of the triangles beside it, and the surface nearer than twice its radius.
void check_tiny_contact(const Loop& loop, const test::PressedMembrane& pressed) {
    const auto& tool = pressed.tools.front();
    std::vector<test::Feature> touching;
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& triangle : pressed.triangles.colwise()) {
        const Eigen::Matrix3d corners = loop.x()(Eigen::all, triangle);
        const Point weights = test::nearest_weights(corners, tool.position),
                    to_tool = tool.position - corners * weights;
        const Point normal = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
        const double height = normal.dot(to_tool);
        nearest = std::min(nearest, to_tool.norm());
        if (to_tool.norm() > loop.contact().patch.detection_distance || std::abs(height - tool.radius) > 1e-8) continue;
        touching.push_back(
            {0, 0, {triangle.begin(), triangle.end()}, {weights.begin(), weights.end()}, height * normal, tool.radius});
    }
    CHECK(nearest > tool.radius - 1e-9);
    CHECK(nearest < 2 * tool.radius);
    check_forces(loop, pressed, touching);
}

void check_equal(const Loop& loop, const test::PressedState& rest, double tolerance) {
    REQUIRE(rest.converged);
    CHECK((rest.x - loop.x()).cwiseAbs().maxCoeff() < tolerance);
    for (std::size_t i = 0; i < rest.reactions.size(); ++i) {
        CHECK((rest.reactions[i] - loop.reaction(i)).norm() < tolerance);
    }
}

}  // namespace

TEST_CASE("the curvature of a gap is the slope of its gradient", "[press]") {
    std::set<std::pair<int, std::size_t>> kinds;
    for (int seed = 1; seed <= 200; ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Eigen::Matrix3Xd x(3, 3);
        for (int k = 0; k < 3; ++k) x.col(k) = random.vector<double>();
        Tool<double> tool{.position = x * random.barycentric().eigen() + 0.3 * random.unit_vector()};
        if (seed % 2 == 0) tool.axis = random.vector<double>();
        const test::PressedMembrane membrane{Eigen::Vector3i(0, 1, 2), {}, x, 1, {tool}};
        for (const auto& feature : test::features_near(membrane, x, 10)) {
            const auto rows = test::coordinates_of(feature.vertices);
            const Eigen::MatrixXd curvature = test::gap_curvature(membrane, x, feature);
            const auto gradient_at = [&](Eigen::Index i, double by) {
                Eigen::Matrix3Xd moved = x;
                moved.reshaped()[rows[static_cast<std::size_t>(i)]] += by;
                for (const auto& other : test::features_near(membrane, moved, 10)) {
                    if (other.name() == feature.name()) return test::gap_gradients({other}, 9)(0, rows).eval();
                }
                return Eigen::RowVectorXd();  // something else is nearest there
            };
            for (Eigen::Index i = 0; i < curvature.cols(); ++i) {
                const auto more = gradient_at(i, 1e-6), less = gradient_at(i, -1e-6);
                if (more.size() == 0 || less.size() == 0) continue;
                CHECK(((more - less) / 2e-6 - curvature.row(i)).norm() < 1e-6 * std::pow(1 + curvature.norm(), 2));
                kinds.emplace(feature.part == 2 ? 2 : 0, rows.size() / 3);
            }
        }
    }
    CHECK(kinds == std::set<std::pair<int, std::size_t>>{{0, 1}, {0, 2}, {0, 3}, {2, 1}, {2, 2}});
}

TEST_CASE("random presses come to rest where Newton's method does", "[press]") {
    for (int seed = 1; seed <= cases(25, 200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Loop loop(unit_sphere(), {.foundation = 0.3 * std::pow(10, random.number())}, exact_in_order_of(seed));
        const auto strokes = random_strokes(seed, random);
        const auto tools = tools_at(strokes, 1);
        const auto pressed = loop.pressed_by(tools);
        REQUIRE(press_to_rest(loop, strokes));

        check_contact(loop, pressed);
        for (const auto& tool : tools) {
            CHECK(std::abs(test::winding_number(pressed.triangles, loop.x(), tool.position)) < 0.01);
        }
        check_equal(loop, newton_beside(pressed, loop.x(), random), 1e-6);
        if (seed % 5 == 0) check_equal(loop, newton_along(pressed, strokes), 1e-6);
    }
}

TEST_CASE("floats come to rest where doubles do", "[press]") {
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 2});
    for (int seed = 1; seed <= cases(30, 100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Material material{.foundation = 0.3 * std::pow(10, random.number())};
        const auto strokes = random_strokes(seed, random);
        Loop loop(unit_sphere(), material, exact);
        LoopOf<float> floats(mesh, material, {.layers = unlimited, .sweeps = 16, .order = test::order_of(seed)});
        REQUIRE(press_to_rest(loop, strokes));
        CHECK(press_to_rest(floats, strokes));
        CHECK((floats.x().cast<double>() - loop.x()).cwiseAbs().maxCoeff() < 1e-4);
        for (std::size_t i = 0; i < strokes.size(); ++i) {
            const Point reaction = floats.reaction(i).cast<double>();
            CHECK((reaction - loop.reaction(i)).norm() < 1e-3 * (1 + reaction.norm()));
        }
    }
}

TEST_CASE("a tool held still keeps depth, contact and force, and its contact begins and ends once", "[press]") {
    struct Case {
        const char* name;
        SolverOptions<double> options;
        Material material;
        double radius;  // [mean edges]
        Point axis = {0, 0, 0};
        Point away = {0, 0, 0.001};  // in a tick
    };
    const Case all[] = {
        {"exact, slow withdrawal", exact, {.foundation = 0.3}, 0.5},
        {"exact, at once", exact, {.foundation = 0.3}, 0.5, {0, 0, 0}, {0, 0, 2}},
        {"few layers and sweeps", {.layers = 4, .sweeps = 4}, {.foundation = 0.3}, 0.5},
        {"few sweeps, damped",
         {.layers = 6, .sweeps = 4},
         {.foundation = 0.3, .damping = 0.02},
         1,
         {0, 0, 0},
         {0, 0, 0.02}},
        {"one sweep, damped, at once",
         {.layers = 8, .sweeps = 1},
         {.foundation = 1, .damping = 0.05},
         2,
         {0, 0, 0},
         {0, 0, 2}},
        {"tiny tool", {.layers = 5, .sweeps = 4}, {.foundation = 1}, 0.05},
        {"point", {.layers = 5, .sweeps = 4}, {.foundation = 1}, 0},
        {"large tool", {.layers = 8, .sweeps = 4}, {.foundation = 3}, 3},
        {"large tool, by vertices", {.layers = 8, .sweeps = 4}, {.foundation = 3, .fine_triangles = 0.5}, 3},
        {"by vertices, one sweep, damped, at once",
         {.layers = 8, .sweeps = 1},
         {.foundation = 1, .damping = 0.05, .fine_triangles = 0.5},
         2,
         {0, 0, 0},
         {0, 0, 2}},
        {"sideways", {.layers = 6, .sweeps = 4}, {.foundation = 0.5}, 0.5, {0, 0, 0}, {0.01, 0.005, 0.001}},
        {"upright shaft", {.layers = 6, .sweeps = 4}, {.foundation = 0.5, .damping = 0.01}, 0.3, {0.1, 0.2, 1}},
        {"lying shaft", {.layers = 6, .sweeps = 4}, {.foundation = 0.5}, 0.3, {0.5, 0.2, 0.05}, {0, 0, 0.003}},
    };
    for (const auto& c : all) {
        CAPTURE(c.name);
        Loop loop(unit_sphere(), c.material, c.options);
        Tool<double> tool{.axis = c.axis, .radius = c.radius * mean_edge(unit_sphere())};
        tool.position = Point(0.07, 0.11, 1.05 + tool.radius) - 0.5 * Point(c.axis.x(), c.axis.y(), 0);
        int began = 0, ended = 0, gone = 0;
        const auto tick = [&] {
            loop.tick({tool});
            began += loop.contact().phase == ContactPhase::began;
            ended += loop.contact().phase == ContactPhase::ended;
        };
        for (int i = 0; i < 100; ++i) {
            tool.position.z() -= 0.0015;
            tick();
        }
        for (int i = 0; i < 3000; ++i) tick();

        const auto contact = loop.contact();
        const Point force = loop.reaction();
        REQUIRE(contact.depth > 0.01);
        REQUIRE(force.z() > 0);
        int kept = 0;
        for (int i = 0; i < cases(10'000); ++i) {
            tick();
            const auto& now = loop.contact();
            kept += now.phase == ContactPhase::ongoing && now.triangle == contact.triangle &&
                    std::abs(now.depth - contact.depth) <= 1e-9 * contact.depth &&
                    std::abs(now.gap - contact.gap) <= 1e-9 * contact.depth &&
                    (now.point - contact.point).norm() <= 1e-9 &&
                    (loop.reaction() - force).norm() <= 1e-9 * force.norm();
        }
        CHECK(kept == cases(10'000));
        CHECK(began == 1);
        CHECK(ended == 0);

        for (int i = 0; i < 2000; ++i) {
            tool.position += c.away;
            tick();
            gone += !loop.contact().touching() && !loop.reaction().isZero(0);
        }
        CHECK(began == 1);
        CHECK(ended == 1);
        CHECK(gone == 0);
        CHECK((loop.x() - unit_sphere().positions()).cwiseAbs().maxCoeff() < 1e-6);
    }
}

TEST_CASE("a sheet keeps the side from which it was touched first", "[press]") {
    const auto mesh = sheet<double>({.width = 2, .height = 2, .columns = 8, .rows = 8});
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double side = seed % 2 == 0 ? 1 : -1;
        const bool over_border = seed % 3 == 0;
        Material material{.foundation = random.number(0.3, 1.0)};
        if (!over_border && seed % 4 < 2) material.pinned = border_of(mesh);
        Stroke stroke;
        stroke.tool.radius = over_border ? random.number(0.3, 0.7) : 0.02 * std::pow(30, random.number());
        const double depth = std::min(0.2, 0.05 + stroke.tool.radius / 2);
        const double clearance = 0.9 - std::sqrt(2 * stroke.tool.radius * depth);  // no need for the rim to yield
        stroke.tool.position = {random.number(-clearance, clearance),
                                over_border ? 0.9 : random.number(-clearance, clearance),
                                side * (stroke.tool.radius + 0.01)};
        stroke.displacement = {0, 0, -side * (0.01 + depth)};
        auto options = exact;
        options.rigid_stiffness = 1e10;  // Newton's method below knows no rim that yields
        Loop loop(mesh, material, options);
        REQUIRE(press_to_rest(loop, {stroke}));

        CHECK(loop.contact().patch.side == side);
        CHECK(side * loop.contact().normal.z() > 0.5);
        CHECK(side * loop.reaction().z() > 1e-3);
        CHECK((side * loop.x().row(2)).minCoeff() < -0.01);
        CHECK((side * loop.x().row(2)).maxCoeff() < 0.05);
        const auto pressed = loop.pressed_by({stroke.at(1)});
        check_contact(loop, pressed);
        check_equal(loop, newton_along(pressed, {stroke}), 1e-6);
    }
}

TEST_CASE("a pinned rim does not yield, and the force stays finite", "[press]") {
    const auto mesh = sheet<double>({.width = 2, .height = 2, .columns = 8, .rows = 8});
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double side = seed % 2 == 0 ? 1 : -1, radius = 0.02 * std::pow(30, random.number());
        Loop loop(mesh, {.foundation = 0.5, .pinned = border_of(mesh)}, {.layers = 6, .sweeps = 4});
        Tool<double> tool{.position = {random.number(-1.0, 1.0), 1, side * (radius + 0.01)}, .radius = radius};
        int began = 0, ended = 0;
        double largest = 0, furthest = 0;
        for (int i = 0; i < 1500; ++i) {
            if (i < 20) tool.position.z() -= side * 0.004;
            if (i >= 1000) tool.position.z() += side * 0.004;
            loop.tick({tool});
            began += loop.contact().phase == ContactPhase::began;
            ended += loop.contact().phase == ContactPhase::ended;
            largest = std::max(largest, loop.reaction().norm());
            furthest = std::max(furthest, (loop.x() - mesh.positions()).cwiseAbs().maxCoeff());
        }
        CHECK(largest < 5);
        CHECK(furthest < 1);  // beside the rim, little space for the tool takes a long displacement of the next vertex
        CHECK(began > 0);
        CHECK(ended == began);
        CHECK((loop.x() - mesh.positions()).cwiseAbs().maxCoeff() < 1e-6);
    }
}

TEST_CASE("a tool that slides off a border has left", "[press]") {
    const auto mesh = sheet<double>({.width = 2, .height = 2, .columns = 8, .rows = 8});
    for (const double side : {1.0, -1.0}) {
        for (const double radius : {0.05, 0.3}) {
            CAPTURE(side, radius);
            Loop loop(mesh, {.foundation = 0.5}, {.layers = 6, .sweeps = 4});
            Tool<double> tool{.position = {0.1, 0.2, side * (radius + 0.01)}, .radius = radius};
            int began = 0, ended = 0;
            const auto tick = [&](const Point& displacement) {
                tool.position += displacement;
                loop.tick({tool});
                began += loop.contact().phase == ContactPhase::began;
                ended += loop.contact().phase == ContactPhase::ended;
            };
            for (int i = 0; i < 20; ++i) tick({0, 0, -side * 0.005});
            for (int i = 0; i < 200; ++i) tick({0.01, 0, 0});
            for (int i = 0; i < 500; ++i) tick({0, 0, 0});
            CHECK(began == 1);
            CHECK(ended == 1);
            CHECK((loop.x() - mesh.positions()).cwiseAbs().maxCoeff() < 1e-6);
        }
    }
}

// A point of a small margin is a sphere much smaller than what vertices move by while a step balances them. Straight
// over a vertex it is in the bottom of a dent, against up to six triangles at once, each within a radius of the corner
// they share.
TEST_CASE("a point that stands still over a vertex feels a force that does", "[press]") {
    const auto mesh = icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 8.0, .damping = 0.02});
    int unsteady = 0;
    for (Index v = 0; v < mesh.vertex_count(); v += 28) {
        for (const double margin : {1e-3, 1e-4}) {
            QuasiStaticSolver solver(network, {.layers = 6, .sweeps = 2});
            auto tree = AabbTree(mesh);
            auto tracker = ContactTracker(mesh, {.margin = margin});
            Points<double> x = mesh.positions();
            const Point foot = x.col(v), out = foot.normalized();
            double low = 1e9, high = 0;
            for (int i = 0; i < 600; ++i) {
                const Tool<double> tool{.position = foot + (1e-4 - 2.1e-3 * std::min(i / 200.0, 1.0)) * out};
                const auto contact = tracker.update(tree, x, tool);
                const auto none = press<double>({}, Contact<double>::none());
                const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact), none);
                tree.refit(x, report.moved);
                if (i < 500) continue;
                low = std::min(low, report.reactions[0].norm());
                high = std::max(high, report.reactions[0].norm());
            }
            if (!(high > 1e-3) || high - low > 1e-3 * high) ++unsteady;
        }
    }
    CHECK(unsteady == 0);
}

TEST_CASE("the force rises with the depth and is the slope of the energy", "[press]") {
    const std::array<double, 4> fine{0, 0.3, 0.5, 1};  // contact by faces, by faces and vertices, by vertices
    for (int seed = 1; seed <= cases(4, 40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double fine_triangles = fine[static_cast<std::size_t>(seed % 4)];
        Loop loop(unit_sphere(), {.foundation = random.number(0.3, 3.0), .fine_triangles = fine_triangles}, exact);
        Stroke stroke = random_stroke(static_cast<Over>(seed % 3), random);
        double last_force = 0;
        for (double part = 0.3; part < 1; part += 0.1) {
            CAPTURE(part);
            const auto rest_at = [&](double p) {
                for (int i = 0; i < 1000 && !(loop.tick({stroke.at(p)}).converged && i > 0); ++i) continue;
                return std::pair(loop.energy(), -loop.reaction().dot(stroke.displacement.normalized()));
            };
            const double step = 1e-3;
            const auto less = rest_at(part - step), here = rest_at(part), more = rest_at(part + step);
            const double slope = (more.first - less.first) / (2 * step * stroke.displacement.norm());
            if (less.second < 1e-3) continue;  // a shaft that has yet to arrive
            CHECK(here.second == Approx(slope).epsilon(1e-3).margin(1e-7));
            CHECK(here.second > last_force);
            last_force = here.second;
        }
    }
}

TEST_CASE("a small tool on a vertex feels what holds the vertex there", "[press]") {
    const auto& mesh = unit_sphere();
    for (const Index v : {0, 57, 130}) {
        CAPTURE(v);
        const Point outward = point(mesh.positions(), v).normalized();
        const Material material{.foundation = 1};
        Loop loop(mesh, material, exact);
        Stroke stroke{{.position = 1.03 * outward, .radius = 0.03}, -0.02 * outward};
        REQUIRE(press_to_rest(loop, {stroke}));
        const Point target = point(loop.x(), v);
        CHECK((stroke.at(1).position - target).norm() == Approx(0.03).margin(1e-9));

        auto x = mesh.positions();
        QuasiStaticSolver<double> solver(loop.network(), exact);
        StepReport<double> held;
        while (!held.converged) held = solver.step(x, 1e-3, loop.network(), loop.foundation(), pull(v, target));
        CHECK((held.reactions[0] - loop.reaction()).norm() < 1e-9);
        CHECK((x - loop.x()).cwiseAbs().maxCoeff() < 1e-9);
    }
}

TEST_CASE("a contact that lacks points is refused, and nothing has moved", "[press][bad]") {
    const auto& mesh = unit_sphere();
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const VirtualVolumeSprings<double> foundation(mesh, {.stiffness = 0.1});
    const Tool<double> tool{.position = {0, 0, 1.05}, .radius = 0.1};
    ContactTracker<double> tracker(mesh);
    auto contact = tracker.update(AabbTree<double>(mesh), mesh.positions(), tool);
    REQUIRE(contact.touching());
    for (const bool has_all_points : {false, true}) {
        contact.patch.has_all_points = has_all_points;
        QuasiStaticSolver<double> solver(network);
        Points<double> x = mesh.positions();
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        CHECK(report.status == (has_all_points ? StepStatus::advanced : StepStatus::too_many_contact_points));
        CHECK((x == mesh.positions()) == !has_all_points);
    }
}

namespace {

/// Two triangles in the middle of a step: one at z = 0 below a tool of radius 1, one far below.
struct TwoTriangles {
    explicit TwoTriangles(const Tool<double>& tool) : pressing{press(tool, Contact<double>())} {
        x << -1, 1, 0, -1, 1, 0, -1, -1, 1, -1, -1, 1, 0, 0, 0, -9, -9, -9;
        auto& contact = pressing.contact;
        contact.phase = ContactPhase::ongoing;
        contact.corners = triangles[1].corners;
        contact.barycentric = {0.25, 0.25, 0.5};
        contact.normal = {0, 0, 1};
        contact.patch.axis_point = contact.patch.previous_axis_point = tool.position;
        contact.gap = tool.position.z() - 1;
        contact.patch.detection_distance = 1.2;
        contact.patch.radius = 1;
        contact.patch.triangles = contact.patch.candidates = contact.patch.faces = triangles;
        rows.begin_step();
        contacts.begin_step();
        contacts.begin_points(0);
    }

    bool pinned(Index) const { return false; }
    void raise(std::size_t triangle, double by) {
        for (const Index v : triangles[triangle].corners) context.move(v, {0, 0, by});
    }

    Points<double> x = Points<double>::Zero(3, 6);
    ConstPointsRef<double> start = x;
    std::array<ContactTriangle, 2> triangles{{{0, {0, 1, 2}}, {1, {3, 4, 5}}}};
    VertexRows<double> rows{6};
    ContactState<double> contacts{6, 20};
    ConstrainedStep<double> step{start, rows, contacts, *this};
    ConstraintContext<double> context{step};
    ToolContact<double> pressing;
};

}  // namespace

TEST_CASE("a triangle that comes into the tool during a step is a violation, with or without a point", "[press]") {
    for (const double length : {0.0, 3.0}) {
        CAPTURE(length);
        const Tool<double> tool{.position = {0, 0, 1.1}, .axis = {0, 0, length}, .radius = 1};
        TwoTriangles scene(tool);
        const auto& corners = scene.triangles[0].corners;
        const auto near = contact_point(0, corners, triangle_at(scene.x, corners), tool, 0, 1.0);
        REQUIRE(near);
        scene.pressing.contact.patch.points = {&*near, 1};
        scene.pressing.begin(scene.context);
        REQUIRE(scene.context.points().size() == 1);
        CHECK_FALSE(scene.pressing.enforce(scene.context));
        scene.raise(1, 9.5);
        CHECK(scene.pressing.enforce(scene.context));
    }
}

TEST_CASE("a triangle that has passed the tool's axis goes back to some clearance in front of it", "[press]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double clearance = random.number(0.01, 1.15), by = clearance + random.number(0.01, 3.0);
        TwoTriangles scene({.position = {0, 0, clearance}, .radius = 1});
        scene.pressing.begin(scene.context);
        scene.raise(0, by);
        scene.pressing.enforce(scene.context);
        const double left = clearance - scene.context.position(0).z();
        REQUIRE(left >= 0.999 * std::min(0.25, 0.9 * clearance));  // a quarter of the radius, if it was as far before
        REQUIRE(left < clearance);
    }
}

TEST_CASE("a surface on the tool's axis is pushed away from where the tool comes", "[press]") {
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const Point shift = random.vector(-3.0, 3.0);
        const Tool<double> tool{.position = shift, .radius = 1};
        TwoTriangles scene(tool);
        scene.x.colwise() += shift.eigen();
        const bool moves = random.chance(0.8);
        const Point from = moves ? random.unit_vector() : Point(0, 0, 1);
        if (moves) scene.pressing.contact.patch.previous_axis_point += 0.3 * from;
        scene.pressing.contact.gap = -1;
        const ContactPoint<double> central{0, 0, scene.triangles[0].corners, {0.25, 0.25, 0.5}, {}, {}, {}, {}, {}, -1};
        scene.pressing.contact.patch.points = {&central, 1};
        scene.pressing.begin(scene.context);
        REQUIRE(scene.context.points().size() == 1);
        REQUIRE(norm<double>(scene.context.points()[0].normal - from) < 1e-14);
    }
}

TEST_CASE("a point presses too", "[press]") {
    for (int seed = 1; seed <= cases(40); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        Loop loop(unit_sphere(), {.foundation = random.number(0.3, 3.0)}, exact);
        Stroke stroke = random_stroke(static_cast<Over>(seed % 3), random);
        stroke.tool.position += stroke.tool.radius * stroke.displacement.normalized();
        stroke.tool.radius = 0;
        stroke.tool.axis.setZero();
        stroke.displacement *= 0.05 / stroke.displacement.norm();
        REQUIRE(press_to_rest(loop, {stroke}));
        stroke.tool.radius = loop.contact().patch.radius;  // what a point counts as
        CHECK(stroke.tool.radius < 0.02 * mean_edge(unit_sphere()));
        check_tiny_contact(loop, loop.pressed_by({stroke.at(1)}));
    }
}

// A tool carries a load however much larger it is than the forces of the membrane, inside and outside of contact alike.
TEST_CASE("a tool that holds back a load on the membrane has its force, and comes to rest", "[tool_contact]") {
    const auto mesh = icosphere<double>({.radius = 10e-3, .subdivisions = 3});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings foundation(mesh, VolumeSpringOptions<double>{.stiffness = 8.0, .damping = 0.02});
    const auto corners = mesh.triangles().col(0);
    const std::array<Index, 3> below{corners[0], corners[1], corners[2]};
    Vector3<double> middle(0, 0, 0);
    for (const Index v : below) middle += point(mesh.positions(), v) / 3;
    const Vector3<double> out = middle / norm(middle);
    AabbTree<double> tree(mesh);
    double without = 0;  // force of the tool without a load [N]
    for (const double size : {0.0, 0.005, 0.02, 0.1}) {
        CAPTURE(size);
        QuasiStaticSolver<double> solver(network, {.layers = unlimited, .sweeps = 4, .force_tolerance = 1e-7});
        ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
        Points<double> x = mesh.positions();
        tree.refit(x);
        for (int tick = 0; tick < 600; ++tick) {
            const double pressed = std::min(1.0, tick / 200.0), loaded = std::clamp((tick - 200) / 100.0, 0.0, 1.0);
            const Tool<double> tool{.position = ((1 - pressed) * 12.5e-3 + pressed * (norm(middle) + 1.9e-3)) * out,
                                    .radius = 2e-3};
            const auto contact = tracker.update(tree, x, tool);
            const Vector3<double> force = loaded * size * out;
            const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact),
                                            load<double>(below, {1 / 3.0, 1 / 3.0, 1 / 3.0}, force));
            tree.refit(x, report.moved);
            if (tick < 500) continue;
            REQUIRE(report.converged);
            if (size == 0) without = norm(report.reactions[0]);
            REQUIRE(norm(report.reactions[0]) == Approx(without + size).epsilon(0.02));
        }
    }
}
