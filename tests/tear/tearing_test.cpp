// SPDX-License-Identifier: MIT
#include <membrane/tear/tearing.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <span>
#include <type_traits>
#include <vector>

#include <Eigen/Geometry>
#include <membrane/contact/aabb_tree.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/replay/initial_state.hpp>
#include <membrane/replay/snapshot.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/torn_centre.hpp"
#include "support/torn_strip.hpp"

using namespace membrane;
using test::TornStrip;

namespace {

constexpr double degree = std::numbers::pi / 180;

// Tears a strip whose grid is turned; returns the stretch at which it begins.
template <class Scalar>
double tear(TornStrip<Scalar>& strip, double edges, double& off_line) {
    strip.cut();
    strip.stretch(0.98 * strip.pure_shear().critical_stretch());
    double begins = 0;
    for (int tick = 0; tick < 3000 && strip.torn_edges() < edges && !strip.tear.tips().empty(); ++tick) {
        strip.tick(strip.at_rest() ? 2e-4 * strip.pure_shear().critical_stretch() : 0.0);
        REQUIRE(strip.report.status == StepStatus::advanced);
        if (begins == 0 && strip.tear.torn_length() > 0) begins = strip.stretched;
        if (!strip.tear.tips().empty()) off_line = std::max(off_line, strip.off_line());
    }
    return begins;
}

/// Lets nothing tear, and keeps the states that it sees.
struct Recorded {
    std::vector<TipState<double>>* states;

    bool opens(const TipState<double>& tip) const noexcept { return states->push_back(tip), false; }
    Vector3<double> direction(const TipState<double>& tip) const noexcept { return tip.heading; }
    double resistance() const noexcept { return 1; }
};

}  // namespace

// Eigenvalues of the mean of T^T T in the tangent plane, by Eigen.
TEST_CASE("a criterion sees the largest principal tension around the tip, in the surface at rest", "[tear]") {
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-3.0, 1.0));  // [m]
        const bool is_curved = random.chance(0.5);
        const auto mesh = with_reserve(is_curved ? icosphere<double>({.radius = size, .subdivisions = 2})
                                                 : disc<double>({.radius = size, .rings = 6}),
                                       4);
        auto tissue = Tissue(TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 10.0})));
        std::vector<TipState<double>> states;
        Tearing tear(mesh, Recorded{&states});
        Points<double> x = mesh.positions();
        for (Index v = 0; v < x.cols(); ++v) x.col(v) += random.vector(-0.03, 0.03) * size;
        x.row(0) *= random.number(1.1, 1.4);
        const auto slit = tear.slit_at(random.index(30), random.unit_vector<double>());
        for (const auto& event : tear.cut_along(slit, x)) follow(event, tissue);
        REQUIRE(tear.update(x, 1e-3, tissue, NoFoundation()).empty());
        REQUIRE(states.size() == tear.tips().size());
        for (std::size_t i = 0; i < states.size(); ++i) {
            const auto& surface = tear.surface();
            const Index tip = tear.tips()[i].vertex;
            Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
            double area = 0;
            for (const Index f : surface.adjacency().triangles_of(tip)) {
                const auto rest = surface.corners_at(surface.rest_positions(), f);
                const auto response = tissue.triangle_response(f, surface.corners(f), x);
                Eigen::Matrix3d stress = Eigen::Matrix3d::Zero();  // times the area
                for (std::size_t k = 0; k < 3; ++k) {
                    stress -= Eigen::Vector3d(response.force[k]) * Eigen::Vector3d(rest[k] - rest[0]).transpose();
                }
                sum += stress.transpose() * stress / surface.rest_area(f);
                area += surface.rest_area(f);
            }
            const Eigen::Vector3d normal(surface.rest_normal(tip));
            Eigen::Matrix<double, 3, 2> tangents;
            tangents << normal.unitOrthogonal(), normal.cross(normal.unitOrthogonal());
            const Eigen::Matrix2d in_plane = tangents.transpose() * sum * tangents / area;
            const auto largest = test::largest_eigenpair(in_plane);
            const Eigen::Vector3d direction(states[i].tension_direction);
            CHECK(states[i].tension == Approx(std::sqrt(largest.value)));
            CHECK(std::abs(direction.dot(tangents * largest.vector)) == Approx(1));
        }
    }
}

// Closed form: a strip in pure shear releases its energy density times its height.
TEST_CASE("a tear in pure shear begins at the right stretch, on any grid, and runs straight", "[tear]") {
    const int directions = cases(2, 20), edges = in_full() ? 20 : 6;
    for (int i = 0; i < directions; ++i) {
        const double turn = 60.0 * i / (in_full() ? directions - 1 : 3);
        CAPTURE(turn);
        TornStrip<double> strip({.columns = 48, .turn = turn * degree});
        double off_line = 0;
        const double begins = tear(strip, edges, off_line);
        CAPTURE(begins, strip.pure_shear().critical_stretch(), off_line, strip.balance());
        REQUIRE(strip.torn_edges() >= edges);
        CHECK(begins == Approx(strip.pure_shear().critical_stretch()).epsilon(0.03));
        CHECK(off_line <= 0.7);
        CHECK(strip.balance() == Approx(1).epsilon(0.001));
        CHECK(strip.relaxed > 0);
        CHECK(strip.relaxed < 0.18 * strip.work);  // what a quick tear releases beyond what it takes
        const auto& tip = strip.tear.tips()[0];
        const auto& rest = strip.tear.surface().rest_positions();
        const Vector3<double> edge = point(rest, tip.vertex) - point(rest, tip.behind[0]);
        CHECK(tip.advanced == Approx(norm(edge)));
        CHECK(norm<double>(edge - tip.advanced * tip.heading) < 1e-12);
    }
}

TEST_CASE("a tear in pure shear begins at the right stretch in single precision, and runs straight", "[tear]") {
    for (const double turn : {10.0, 25.0, 50.0}) {
        if (!in_full() && turn != 10) continue;
        CAPTURE(turn);
        TornStrip<float> strip({.turn = turn * degree});
        double off_line = 0;
        const double begins = tear(strip, 6, off_line);
        REQUIRE(strip.torn_edges() >= 6);
        CHECK(begins == Approx(strip.pure_shear().critical_stretch()).epsilon(0.03));
        CHECK(off_line <= 0.7);
    }
}

TEMPLATE_TEST_CASE("the driving force is the energy that is released, whatever the length of the tear", "[tear]",
                   TEST_SCALARS) {
    for (const int notch : {12, 16, 20}) {
        TornStrip<TestType> strip({.notch = notch});
        strip.cut();
        const double stretch = 1.2;
        strip.stretch(stretch);
        strip.tick(0);
        const auto& force = strip.tear.tips()[0].driving_force;
        CAPTURE(notch, force[0], force[1]);
        CHECK(force[0] == Approx(strip.pure_shear().energy_density(stretch) * strip.height()).epsilon(0.05));
        CHECK(std::abs(force[1]) < 0.02 * force[0]);
    }
}

TEMPLATE_TEST_CASE("the driving force is what two equilibria, before and after an advance, differ by", "[tear]",
                   TEST_SCALARS) {
    struct Case {
        int columns, notch;
        bool springs;
        double stretch, drawn;  // by forceps, behind the tip, out of the plane [m]
    };
    for (const Case& scene :
         {Case{40, 16, false, 1.2, 0}, Case{40, 16, true, 1.1, 0}, Case{24, 16, false, 1.2, 0},
          Case{24, 4, false, 1.2, 0}, Case{30, 14, false, 1.15, 3e-3}, Case{30, 14, true, 1.1, 3e-3}}) {
        if (!in_full() && scene.columns == 40) continue;  // fine
        CAPTURE(scene.columns, scene.notch, scene.springs, scene.stretch, scene.drawn);
        struct State {
            double energy, tip, force;
        };
        Vector3<TestType> forceps;  // at the same place in all of them
        const auto at = [&](int edges) {
            TornStrip<TestType> strip({.columns = scene.columns,
                                       .notch = edges,
                                       .springs = scene.springs,
                                       .tolerance = std::is_same_v<TestType, double> ? 3e-6 : 3e-4});
            strip.cut();
            strip.stretch(scene.stretch);
            if (scene.drawn > 0) {
                const Index v = strip.cut_path[static_cast<std::size_t>(scene.notch - 6)];
                if (edges < scene.notch) forceps = point(strip.x, v) + Vector3<TestType>(0, 0, TestType(scene.drawn));
                strip.hold(v, forceps - point(strip.x, v));
            }
            strip.tick(0);
            const auto& tip = strip.tear.tips()[0];
            return State{strip.stored(), static_cast<double>(strip.tear.surface().rest_positions()(0, tip.vertex)),
                         static_cast<double>(tip.driving_force[0])};
        };
        const State before = at(scene.notch - 1), now = at(scene.notch), after = at(scene.notch + 1);
        const double released = (before.energy - after.energy) / (after.tip - before.tip);
        const double force = (before.force + 4 * now.force + after.force) / 6;  // Simpson's rule
        CHECK(force == Approx(released).epsilon(std::is_same_v<TestType, double> ? 0.01 : 0.08));
    }
}

TEMPLATE_TEST_CASE("what the clamps give is stored, or taken by the tear and a fluid's drag", "[tear]", TEST_SCALARS) {
    struct Case {
        double drag, turn;
    };
    for (const auto& [drag, turn] : {Case{1e-2, 0}, Case{3e-2, 17}, Case{1e-1, 40}}) {
        if (!in_full() && turn != 17) continue;
        CAPTURE(turn, drag);
        TornStrip<TestType> strip({.turn = turn * degree, .drag = drag});
        strip.cut();
        strip.stretch(0.98 * strip.pure_shear().critical_stretch());
        for (int tick = 0; tick < 3000 && strip.torn_edges() < 6; ++tick) {
            strip.tick(2e-4 * strip.pure_shear().critical_stretch());
        }
        REQUIRE(strip.torn_edges() >= 6);
        CAPTURE(strip.balance(), strip.damped() / strip.work, strip.relaxed / strip.work);
        CHECK(strip.balance() == Approx(1).epsilon(0.001));
        CHECK(std::abs(strip.relaxed) < (std::is_same_v<TestType, double> ? 0.01 : 0.02) * strip.work);
        CHECK(strip.damped() > 0.02 * strip.work);
        // The last edge may not have opened. What the drag takes of the driving force, the edges do not.
        const double resistance = 1000 * test::torn_material.thickness, torn = strip.tear.torn_length();
        const double least = strip.damped() < 0.16 * strip.work ? 0.9 : 0.6;
        CHECK(strip.tear.dissipated() < resistance * torn * 1.1);
        CHECK(strip.tear.dissipated() > resistance * (torn - 1.2 * strip.edge()) * least);
    }
}

namespace {

constexpr double plane_stress_modulus = 1e6 * 1e-5 / (1 - 0.3 * 0.3);  // of `torn_material` [N/m]

/// A strip on a foundation, whose upper clamp has moved, at equilibrium. With h its height, kappa^2 is the foundation's
/// stiffness per area over the strip's modulus.
template <class Scalar>
struct SupportedStrip {
    SupportedStrip(double kappa_h, double strain) : foundation(strip.mesh, springs(kappa_h / strip.height())) {
        strip.cut(foundation, body);
        for (const Index v : strip.top()) strip.x(1, v) += static_cast<Scalar>(strain * strip.height());
        for (int i = 0; i < 5000 && !(i > 0 && strip.report.converged); ++i) {
            strip.solver.wake_all();
            strip.report = strip.solver.step(strip.x, strip.dt, strip.tissue, foundation, pin(strip.top()));
        }
        REQUIRE(strip.report.converged);
        force = driving_force(foundation);
    }
    FoundationOptions<Scalar> springs(double kappa) const {
        auto stiffness = vertex_areas(strip.mesh);
        for (Scalar& of_vertex : stiffness) of_vertex *= static_cast<Scalar>(kappa * kappa * plane_stress_modulus);
        return {.normal = stiffness, .tangential = stiffness};
    }
    template <class Volume>
    Vector3<double> driving_force(const Volume& volume, std::span<const Index> held = {}) {
        REQUIRE(strip.tear.update(strip.x, strip.dt, strip.tissue, volume, held).empty());
        return strip.tear.tips()[0].driving_force.template cast<double>();
    }

    TornStrip<Scalar> strip{{.notch = 20, .toughness = 1e9}};
    FoundationSprings<Scalar> foundation;
    MovingBody<Scalar> body{strip.mesh};
    Vector3<double> force;
};

}  // namespace

// Closed form at small strain: the clamp at y = h moved by U, a whole strip stores C kappa U^2 coth(kappa h) / 2 per
// length, C its modulus, one that is torn at a distance d from that clamp C kappa U^2 tanh(kappa d) / 2.
TEST_CASE("the driving force counts the energy of a foundation", "[tear]") {
    for (const double kappa_h : {0.25, 1.0, 2.0, 3.0}) {
        CAPTURE(kappa_h);
        SupportedStrip<double> supported(kappa_h, 0.01);
        auto& strip = supported.strip;
        const double kappa = kappa_h / strip.height(), up = 0.01 * strip.height();
        const double arm = strip.height() - strip.notch_end[1];
        const double whole = 1 / std::tanh(kappa * strip.height()), torn = std::tanh(kappa * arm);
        const double released = plane_stress_modulus * kappa * up * up / 2 * (whole - torn);
        CHECK(supported.force[0] == Approx(released).epsilon(0.05));
        // It is that in the frame of the body at rest.
        const RigidFrame<double> pose{.rotation = test::Random(1).rotation(), .origin = {0.1, 0.2, -0.3}};
        REQUIRE(supported.body.move_to(pose, strip.x));
        const auto moved = supported.driving_force(on(supported.body, supported.foundation));
        CHECK(norm<double>(moved - supported.force) < 1e-6 * norm(supported.force));
        // It is hardly less where a tool holds a vertex ahead.
        REQUIRE(supported.body.move_to({}, strip.x));
        const std::array held{strip.tear.surface().nearest_in_direction(strip.tear.tips()[0].vertex, {1, 0, 0})};
        const auto beside_tool = supported.driving_force(supported.foundation, held);
        CHECK(norm<double>(beside_tool - supported.force) < 0.02 * norm(supported.force));
    }
}

// At 1 % strain the forces that single precision leaves unbalanced are as large as the driving force.
TEST_CASE("in single precision the driving force on a foundation is that in double", "[tear]") {
    for (const double kappa_h : {0.25, 1.0, 2.0, 3.0}) {
        CAPTURE(kappa_h);
        const auto expected = SupportedStrip<double>(kappa_h, 0.2).force;
        const auto found = SupportedStrip<float>(kappa_h, 0.2).force;
        CHECK(norm<double>(found - expected) < 0.06 * norm(expected));
    }
}

TEST_CASE("what forceps do near a tip is not taken for the tear's driving force", "[tear]") {
    std::array<double, 3> forces{};
    const std::array<double, 3> patches{2, 5, 5};
    for (std::size_t i = 0; i < 3; ++i) {
        TornStrip<double> strip({.tear = {.patch_radius = patches[i]}});
        strip.cut();
        strip.stretch(0.9 * strip.pure_shear().critical_stretch());
        Index near = 0;  // beyond the smaller patch, within the larger one
        const auto distance = [&](Index v) {
            const auto at = strip.notch_end + Vector3<double>(1.5, 2.2, 0) * strip.edge();
            return norm<double>(point(strip.mesh.positions(), v) - at);
        };
        for (Index v = 0; v < strip.vertices; ++v) near = distance(v) < distance(near) ? v : near;
        strip.hold(near, Vector3<double>(1, 0.5, 0) * (0.3 * strip.edge()));
        const std::array<Index, 1> held{near};
        const auto ignored = i == 1 ? std::span<const Index>(held) : std::span<const Index>();
        REQUIRE(strip.tear.update(strip.x, 1e-3, strip.tissue, NoFoundation(), ignored).empty());
        forces[i] = norm(strip.tear.tips()[0].driving_force);
    }
    CAPTURE(forces[0], forces[1], forces[2]);
    CHECK(forces[1] == Approx(forces[0]).epsilon(0.05));
    CHECK(forces[2] != Approx(forces[0]).epsilon(0.2));
}

TEST_CASE("an edge that the load does not draw apart does not hold the tip", "[tear]") {
    TornStrip<double> strip({});
    strip.cut();
    strip.stretch(0.98 * strip.pure_shear().critical_stretch());
    const double resistance = 1000 * test::torn_material.thickness;
    double largest = 0;
    bool is_held = false;
    for (int tick = 0; tick < 400 && strip.torn_edges() < 3; ++tick) {
        strip.tick(strip.at_rest() ? 1e-3 : 0.0);
        REQUIRE(strip.report.status == StepStatus::advanced);
        const auto opening = strip.tear.ligaments().ligaments;
        if (!is_held && !opening.empty()) {
            strip.hands[0].insert(strip.hands[0].end(), {opening[0].vertex, opening[0].copy});
            is_held = true;
        }
        largest = std::max(largest, norm(strip.tear.tips()[0].driving_force) / resistance);
    }
    CHECK(is_held);
    CHECK(strip.torn_edges() >= 3);
    CHECK(largest > 1.9);  // it has taken next to nothing: an advance has to pay for two edges
    CHECK(largest < 2.1);
}

// It keeps to the edges of a turned grid.
TEST_CASE("without moved vertices the grid steers the tear", "[tear]") {
    TornStrip<double> strip({.turn = 20 * degree, .tear = {.move_vertices = false}});
    double off_line = 0;
    static_cast<void>(tear(strip, 12, off_line));
    CHECK(off_line > 0.7);
}

TEMPLATE_TEST_CASE("both ends of a cut in a sheet stretched in both directions go on alike, along it", "[tear]",
                   TEST_SCALARS) {
    for (const double turn : {0.0, 20 * degree, 45 * degree}) {
        CAPTURE(turn);
        const auto found = test::tear_from_centre<TestType>({.rows = 24, .turn = turn}, 2.75);
        CHECK(found.angle < 3 * degree);
        CHECK(found.unlike < 0.05);
        const auto [left, right] = found.advances;
        CHECK(left > 1.5);
        CHECK(right > 1.5);
        CHECK(found.off_line < std::tan(3 * degree) * std::min(left, right));
        CHECK(std::abs(found.lost) < (std::is_same_v<TestType, double> ? 0.001 : 0.01));
    }
}

TEST_CASE("a path that cannot be cut changes nothing", "[tear]") {
    const auto mesh = with_reserve(sheet<double>({.columns = 6, .rows = 6}), 3);
    Tearing tear(mesh, EnergyRelease{1, 1});
    Points<double> x = mesh.positions();
    const Triangles before = tear.surface().triangles();
    // Vertex 24 is in the middle of 7 x 7.
    for (const auto& path : std::vector<std::vector<Index>>{
             {}, {24}, {24, 25}, {24, 24, 25}, {24, 40, 41}, {-1, 24, 25}, {24, 25, 999}, {0, 1, 2}, {23, 24, 23}}) {
        CHECK(tear.cut_along(path, x).empty());
        CHECK_FALSE(tear.reserve_used_up());
    }
    CHECK(tear.cut_along(std::vector<Index>{22, 23, 24, 25, 26, 27}, x).empty());  // needs 5
    CHECK(tear.reserve_used_up());
    CHECK(tear.surface().triangles() == before);
    CHECK(x == mesh.positions());
    CHECK(tear.tips().empty());
    CHECK(tear.cut_along(std::vector<Index>{22, 23, 24, 25}, x).size() == 2);
    CHECK_FALSE(tear.reserve_used_up());
    CHECK(tear.tips().size() == 2);
}

TEST_CASE("a slit is a path of two edges along a direction", "[tear]") {
    const auto mesh = with_reserve(disc<double>({.rings = 6}), 10);
    Tearing tear(mesh, EnergyRelease{1, 1});
    const auto path = tear.slit_at(0, {1, 0, 0});
    REQUIRE(path[1] == 0);
    CHECK(mesh.positions()(0, path[0]) < 0);
    CHECK(mesh.positions()(0, path[2]) > 0);
    Points<double> x = mesh.positions();
    CHECK(tear.cut_along(path, x).size() == 1);
    CHECK(tear.tips().size() == 2);
    CHECK(tear.slit_at(border(mesh)[0], {1, 0, 0})[1] == no_index);
    CHECK(tear.slit_at(-1, {1, 0, 0})[1] == no_index);
}

TEST_CASE("positions in a buffer for drawing tear as those in a matrix, to the bit", "[tear]") {
    const auto mesh = with_reserve(disc<float>({.radius = 1, .rings = 8}), 40);
    const auto tear_in = [&](PointsRef<float> x) {
        auto springs =
            TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0F, .pinned = border(mesh)}));
        Tearing<float> tear(mesh, EnergyRelease{0.02, 1});
        QuasiStaticSolver<float> solver(springs, {.layers = unlimited});
        x = 1.1F * mesh.positions();
        for (const auto& event : tear.cut_along(tear.slit_at(0, {1, 0, 0}), x)) follow(event, springs, solver);
        const Index held = tear.tips()[0].behind[0];
        const Vector3<float> from = point(x, held);
        for (int i = 0; i < 200; ++i) {
            const Vector3<float> to = from + 0.005F * static_cast<float>(i) * Vector3<float>(0, 0.6F, 0.8F);
            const auto report = solver.step(x, 1e-3F, springs, NoFoundation{}, pull(held, to), tear.ligaments());
            REQUIRE(report.status == StepStatus::advanced);
            const auto events = tear.update(x, 1e-3F, springs, NoFoundation{}, {&held, 1});
            for (const auto& event : events) follow(event, springs, solver);
        }
        return tear.torn_length();
    };
    struct Vertex {
        float position[3], normal[3], colour[2];
    };
    std::vector<Vertex> buffer(static_cast<std::size_t>(mesh.vertex_count()));
    using Strided = Eigen::Map<Points<float>, 0, Eigen::OuterStride<>>;
    Strided in_buffer(buffer[0].position, 3, mesh.vertex_count(), Eigen::OuterStride<>(sizeof(Vertex) / sizeof(float)));
    Points<float> matrix = mesh.positions();
    const double torn = tear_in(matrix);
    CHECK(torn > 0.3);
    CHECK(tear_in(in_buffer) == torn);
    CHECK(Points<float>(in_buffer) == matrix);
}

TEMPLATE_TEST_CASE("the next report lists what a tear has placed, also where nothing moves", "[tear]", TEST_SCALARS) {
    using S = TestType;
    const auto mesh = with_reserve(disc<S>({.radius = 1, .rings = 6}), 20);
    auto springs =
        TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(1), .pinned = border(mesh)}));
    Tearing<S> tear(mesh, EnergyRelease{1, 1});
    QuasiStaticSolver<S> solver(springs);
    Points<S> x = mesh.positions();
    std::vector<Index> path{0};
    while (path.size() < 7) path.push_back(tear.surface().nearest_in_direction(path.back(), {1, 0, 0}));
    std::vector<Index> placed;
    for (const auto& event : tear.cut_along(path, x)) {
        follow(event, springs, solver);
        placed.push_back(event.split.copy);
    }
    REQUIRE(placed.size() == 6);
    CHECK(springs.pinned(placed.back()));
    CHECK(solver.step(x, S(-1), springs, NoFoundation{}).moved.empty());  // refused: they are in a later one
    auto report = solver.step(x, S(1e-3), springs, NoFoundation{});
    const std::vector<Index> moved(report.moved.begin(), report.moved.end());
    CHECK_THAT(moved, Catch::UnorderedEquals(placed));
    CHECK(solver.step(x, S(1e-3), springs, NoFoundation{}).moved.empty());

    const Index pinned = path.back();
    solver.reshape(MovedVertex<S>{pinned, point(x, pinned), {}});
    report = solver.step(x, S(1e-3), springs, NoFoundation{});
    CHECK(std::vector<Index>(report.moved.begin(), report.moved.end()) == std::vector<Index>{pinned});
}

TEST_CASE("a snapshot holds the tear: ticks go on with the same bits, and before the tear it is whole", "[tear]") {
    TornStrip<double> strip({.columns = 24, .rows = 12, .notch = 8});
    const InitialState whole(strip.tissue, strip.tear, strip.solver, strip.x);
    std::vector<std::byte> torn(snapshot_capacity(strip.tissue, strip.tear, strip.solver, strip.x));
    const auto save = [&](std::vector<std::byte>& to) {
        return save_snapshot(to, strip.tissue, strip.tear, strip.solver, strip.x);
    };
    const auto restore = [&](std::span<const std::byte> from) {
        return restore_snapshot(from, strip.tissue, strip.tear, strip.solver, strip.x);
    };
    const Triangles triangles = strip.tear.surface().triangles();
    strip.cut();
    strip.stretch(strip.pure_shear().critical_stretch());
    for (int tick = 0; tick < 10; ++tick) strip.tick(1e-3);
    const std::size_t torn_size = save(torn);
    const auto run = [&] {
        for (int tick = 0; tick < 30; ++tick) strip.tick(1e-3);
        return strip.x;
    };
    const Points<double> once = run();
    CHECK(strip.tear.torn_length() > 0);
    REQUIRE(restore(std::span(torn).first(torn_size)));
    CHECK(run() == once);
    CHECK_FALSE(whole.reset(strip.tissue, strip.tear, strip.x, strip.solver));
    CHECK(strip.tear.torn_length() > 0);
    REQUIRE(whole.reset(strip.tissue, strip.tear, strip.solver, strip.x));
    CHECK(strip.tear.surface().triangles() == triangles);
    CHECK(strip.tear.tips().empty());
    CHECK(strip.x == strip.mesh.positions());
}

namespace {

/// Opens each tip with a heading along x of `least` or more, straight on, without energy.
struct Heading {
    double least = -2;  // along x
    bool opens(const auto& tip) const noexcept { return tip.heading[0] >= least; }
    auto direction(const auto& tip) const noexcept { return tip.heading; }
    double resistance() const noexcept { return 0; }
};

/// A sheet of 6 x 6 squares: vertex 7 row + column.
struct TornSquare {
    explicit TornSquare(Index reserve, Heading criterion = {})
        : mesh(with_reserve(sheet<double>({.columns = 6, .rows = 6}), reserve)),
          springs(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0})),
          tear(mesh, criterion),
          x(mesh.positions()) {}

    std::size_t cut(const std::vector<Index>& path) {
        const auto events = tear.cut_along(path, x);
        for (const auto& event : events) follow(event, springs);
        return events.size();
    }
    std::size_t update() {
        const auto events = tear.update(x, 1e-3, springs, NoFoundation());
        for (const auto& event : events) follow(event, springs);
        std::size_t splits = 0;
        for (const auto& event : events) splits += event.split.vertex != no_index ? 1U : 0U;
        return splits;
    }

    TriangleMesh<double> mesh;
    TearableSprings<double, LinearSpring> springs;
    Tearing<double, Heading> tear;
    Points<double> x;
};

}  // namespace

TEST_CASE("tears that meet are one: there is no tip where they join", "[tear]") {
    SECTION("a cut ends at a tip") {
        TornSquare square(9);
        CHECK(square.cut({22, 23, 24}) == 1);
        CHECK(square.tear.tips().size() == 2);
        CHECK(square.cut({27, 26, 25, 24}) == 4);
        REQUIRE(square.tear.tips().size() == 1);
        CHECK(square.tear.tips()[0].vertex == 22);
    }
    SECTION("a cut goes on from a tip") {
        TornSquare square(9);
        CHECK(square.cut({22, 23, 24}) == 1);
        CHECK(square.cut({24, 31, 38}) == 2);
        REQUIRE(square.tear.tips().size() == 2);
        CHECK(square.tear.tips()[0].vertex == 22);
        CHECK(square.tear.tips()[1].vertex == 38);
    }
    SECTION("a tear runs to a tip, and the other one waits for the network") {
        TornSquare square(9);
        CHECK(square.cut({21, 22, 23}) == 2);
        CHECK(square.cut({27, 26, 25}) == 2);
        CHECK(square.update() == 1);  // from 23 to 24; 25 is beside what has changed
        REQUIRE(square.tear.tips().size() == 2);
        CHECK(square.tear.tips()[0].vertex == 24);
        CHECK(square.tear.tips()[1].vertex == 25);
        CHECK(square.update() == 2);
        CHECK(square.tear.tips().empty());
        CHECK(square.update() == 0);
        const double edge = square.mesh.positions()(0, 1) - square.mesh.positions()(0, 0);
        CHECK(square.tear.torn_length() == Approx(2 * edge));
    }
}

TEST_CASE("a cut into the side of a tear leaves its tip the vertices beside it", "[tear]") {
    for (const bool left : {false, true}) {
        CAPTURE(left);
        TornSquare square(9);
        CHECK(square.cut({21, 22, 23, 24}) == 3);  // the copies are above or below
        const auto& surface = square.tear.surface();
        const auto tip = square.tear.tips()[0];
        const Index side = tip.behind[left ? 0 : 1];  // in the place of vertex 23
        Index end = no_index;
        for (Index v = 0; v < 49; ++v) {
            const double off = surface.rest_positions()(0, v) - surface.rest_positions()(0, 23);
            if (std::abs(off) < 1e-9 && surface.has_inner_edge(side, v)) end = v;
        }
        REQUIRE(end != no_index);
        CHECK(square.cut({end, side}) == 1);
        REQUIRE(square.tear.tips().size() == 2);
        for (const Index v : square.tear.tips()[0].behind) {
            bool is_beside = false;
            for (const Index f : surface.adjacency().triangles_of(24)) {
                for (const Index corner : surface.corners(f)) is_beside |= corner == v;
            }
            CHECK(is_beside);
        }
    }
}

TEST_CASE("a reserve too small for one tip is reported, though another one advances", "[tear]") {
    TornSquare square(3, {.least = 0.5});
    CHECK(square.cut({26, 25, 24}) == 1);  // its first tip is next to the border: two would double
    CHECK(square.cut({8, 9, 10}) == 1);
    CHECK(square.update() == 1);
    CHECK(square.tear.reserve_used_up());
    CHECK(square.tear.tips()[0].vertex == 26);
    CHECK(square.tear.tips()[3].vertex == 11);
    CHECK(square.update() == 0);
    CHECK(square.tear.reserve_used_up());
}

TEST_CASE("the driving forces of near tips are those before any of them advances", "[tear]") {
    const auto forces = [](double toughness, std::size_t& splits) {
        TornStrip<double> strip({.columns = 24, .rows = 24, .turn = 0.2, .toughness = toughness});
        const auto& rest = strip.tear.surface().rest_positions();
        Index at = 0;
        for (Index v = 0; v < strip.vertices; ++v) {
            const auto off = [&](Index w) { return (rest.col(w) - Eigen::Vector3d(12e-3, 12e-3, 0)).norm(); };
            if (off(v) < off(at)) at = v;
        }
        for (const auto& event : strip.tear.cut_along(strip.tear.slit_at(at, {1, 0, 0}), strip.x)) {
            follow(event, strip.tissue, strip.solver);
        }
        for (int n = 0; n < 400; ++n) {
            strip.x.row(1) = 1.4 * rest.row(1);
            strip.solver.wake_all();
            static_cast<void>(strip.solver.step(strip.x, 1e-3, strip.tissue, NoFoundation()));
        }
        const auto events = strip.tear.update(strip.x, 1e-3, strip.tissue, NoFoundation());
        for (const auto& event : events) splits += event.split.vertex != no_index ? 1U : 0U;
        REQUIRE(strip.tear.tips().size() == 2);
        return std::array{strip.tear.tips()[0].driving_force, strip.tear.tips()[1].driving_force};
    };
    std::size_t none = 0, both = 0;
    const auto expected = forces(1e9, none), found = forces(1, both);
    CHECK(none == 0);
    CHECK(both == 2);
    CHECK(found[0] == expected[0]);
    CHECK(found[1] == expected[1]);
}

// The next vertex has moved by then, at rest and now, which the network does not know yet.
TEST_CASE("a ligament begins with the force that the membrane transmitted through the vertex", "[tear]") {
    for (const double turn : {10.0, 20.0, 30.0}) {
        CAPTURE(turn);
        TornStrip<double> strip({.turn = turn * degree});
        strip.cut();
        strip.stretch(1.02 * strip.pure_shear().critical_stretch());
        const Points<double> x = strip.x;
        Vector3<double> force = Vector3<double>::Zero();
        bool has_moved = false;
        for (const auto& event : strip.tear.update(strip.x, 1e-3, strip.tissue, NoFoundation())) {
            has_moved |= event.moved.vertex != no_index;
            for (const Index f : event.split.triangles) {
                const auto& corners = event.split.corners_of(f);
                const auto response = strip.tissue.triangle_response(f, corners, x);
                const auto at = std::find(corners.begin(), corners.end(), event.split.vertex) - corners.begin();
                force += response.force[static_cast<std::size_t>(at)];
            }
        }
        CHECK(has_moved);
        const auto forces = strip.tear.ligaments();
        REQUIRE(forces.ligaments.size() == 1);
        CHECK(norm<double>(forces.ligaments[0].force - force) < 0.03 * norm(force));
    }
}

TEST_CASE("options of a tear are checked", "[tear]") {
    const auto mesh = sheet<double>({.columns = 2, .rows = 2});
    const auto with = [&](TearOptions options) {
        return test::refusal([&] { Tearing(mesh, EnergyRelease{1, 1}, options); });
    };
    CHECK(with({.max_tips = 0}) == "Tearing: max_tips must be at least 1, got 0");
    CHECK(with({.patch_radius = 1}) == "Tearing: patch_radius must be 2 to 100 [edges], got 1");
    CHECK(with({.patch_radius = 101}) == "Tearing: patch_radius must be 2 to 100 [edges], got 101");
    CHECK(with({.patch_radius = NAN}) == "Tearing: patch_radius must be 2 to 100 [edges], got nan");
    CHECK(with({.min_angle = -1}) == "Tearing: min_angle must be 0 to 1 [rad], got -1");
    CHECK(with({.min_angle = 1}) == "Tearing: min_angle must be 0 to 1 [rad], got 1");
    CHECK(with({.min_angle = NAN}) == "Tearing: min_angle must be 0 to 1 [rad], got nan");
    CHECK(with({}).empty());
    CHECK(test::refusal([&] {
              Tearing(mesh, EnergyRelease{0, 1});
          }) == "EnergyRelease: toughness must be finite and positive [J/m^2], got 0");
    CHECK(test::refusal([&] { Tearing(mesh, LargestTension{NAN}); }) ==
          "LargestTension: strength must be finite and positive [N/m], got nan");
    CHECK(test::refusal([&] { static_cast<void>(with_reserve(mesh, -1)); }) ==
          "with_reserve: count must not be negative, got -1");
}

namespace {

/// A disc between pinned rims, on which a fine ball presses at its middle, deeper in each tick.
template <class Scalar>
struct PokedDisc {
    explicit PokedDisc(double toughness)
        : mesh(with_reserve(disc<Scalar>({.radius = Scalar(5e-3), .rings = 10}), 100)),
          tissue(
              TearableSprings(
                  mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = Scalar(0), .pinned = border(mesh)})),
              triangular_springs(mesh, {.young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = 1e-5}, Scalar(1.05))),
          tear(mesh, EnergyRelease{toughness, 1e-5}),
          solver(tissue, {.layers = unlimited, .sweeps = 10}),
          tree(mesh),
          tracker(mesh),
          x(mesh.positions()) {}

    /// Presses to a depth until the forces balance, tears nothing; returns the force along the contact's normal.
    double press_to(double depth) {
        for (int i = 0; i < 300; ++i) {
            const Tool<Scalar> tool{
                .position = Vector3<Scalar>(Scalar(1e-4), Scalar(5e-5), static_cast<Scalar>(2e-4 - depth)),
                .radius = Scalar(2e-4)};
            contact = tracker.update(tree, x, tool);
            report = solver.step(x, Scalar(1e-3), tissue, NoFoundation(), press(tool, contact), tear.ligaments());
            REQUIRE(report.status == StepStatus::advanced);
            tree.refit(x, report.moved);
            follow(tear.update(x, Scalar(1e-3), tissue, NoFoundation()));
            if (report.residual < Scalar(1e-5)) break;
        }
        return static_cast<double>(dot<Scalar>(report.reactions[0], contact.normal));
    }
    void follow(std::span<const TearEvent<Scalar>> events) {
        for (const auto& event : events) membrane::follow(event, tissue, solver, tree, tracker);
    }

    TriangleMesh<Scalar> mesh;
    Tissue<TearableSprings<Scalar, LinearSpring>, Elements<Scalar, TriangularSpring<Scalar>>> tissue;
    Tearing<Scalar> tear;
    QuasiStaticSolver<Scalar> solver;
    AabbTree<Scalar> tree;
    ContactTracker<Scalar> tracker;
    Points<Scalar> x;
    Contact<Scalar> contact;
    StepReport<Scalar> report;
};

}  // namespace

TEMPLATE_TEST_CASE(
    "a sharp tool perforates at its force and not before, and the slit tears on if the membrane is brittle", "[tear]",
    TEST_SCALARS) {
    constexpr double perforation = 3e-3;
    for (const double toughness : {1.0, 1e5}) {
        CAPTURE(toughness);
        PokedDisc<TestType> disc(toughness);
        double force = 0, before = 0, depth = 0;
        while (disc.tear.tips().empty() && depth < 3e-3) {
            depth += 2e-5;
            before = force;
            force = disc.press_to(depth);
            const auto path =
                disc.tear.slit_under(disc.contact, disc.report.reactions[0], TestType(perforation), {1, 0, 0});
            disc.follow(disc.tear.cut_along(path, disc.x));
        }
        CAPTURE(depth, before, force);
        CHECK(before < perforation);
        CHECK(force >= perforation);
        REQUIRE(disc.tear.tips().size() == 2);
        const Vector3<TestType> under(TestType(1e-4), TestType(5e-5), 0);
        CHECK(norm<TestType>(point(disc.mesh.positions(), Index(0)) - under) < TestType(2.5e-4));
        const auto behind = disc.tear.tips()[0].behind;
        CHECK((behind[0] == 0 || behind[1] == 0));
        for (int i = 1; i <= 10; ++i) force = disc.press_to(depth + i * 2e-5);
        CHECK(force < perforation / 10);  // the tool is through
        if (toughness > 1) {
            CHECK(disc.tear.torn_length() == 0);
            REQUIRE(disc.tear.tips().size() == 2);
            CHECK(norm<TestType>(point(disc.x, behind[0]) - point(disc.x, behind[1])) > TestType(5e-5));
        } else {
            CHECK(disc.tear.torn_length() > 3e-3);
        }
    }
}

TEST_CASE("a tool that is in no contact, or whose force is no number, does not perforate", "[tear]") {
    PokedDisc<double> disc(1e5);
    REQUIRE(disc.press_to(3e-4) > 0);
    const auto slit = [&](const auto& contact, const Vector3<double>& reaction, double force) {
        return disc.tear.slit_under(contact, reaction, force, {1, 0, 0})[1];
    };
    const Vector3<double> reaction = 1e-3 * disc.contact.normal, aside(1, 0, 0);
    CHECK(slit(disc.contact, reaction, 0.999e-3) == 0);
    CHECK(slit(disc.contact, reaction, 1.001e-3) == no_index);
    CHECK(slit(disc.contact, aside - dot(aside, disc.contact.normal) * disc.contact.normal, 1e-6) == no_index);
    CHECK(slit(Contact<double>::none(), reaction, 0.5e-3) == no_index);
    CHECK(slit(disc.contact, NAN * reaction, 0.5e-3) == no_index);
    CHECK(slit(disc.contact, reaction, NAN) == no_index);
    CHECK(slit(disc.contact, reaction, -INFINITY) == no_index);
}

// Closed form of a slit of length 2a under the same tension in all directions.
TEST_CASE("the driving forces of both ends of a short slit do not cancel", "[tear]") {
    for (const int half : {1, 2, 4}) {
        CAPTURE(half);
        PokedDisc<double> disc(1e5);
        const auto& surface = disc.tear.surface();
        const auto corners = surface.corners(0);
        const auto at = surface.corners_at(disc.x, 0);
        const auto squared =
            squared_tension(RestTriangle<double>(at), at, disc.tissue.triangle_response(0, corners, disc.x));
        std::vector<Index> path{0};
        for (int i = 0; i < half; ++i) path.push_back(surface.nearest_in_direction(path.back(), {1, 0, 0}));
        std::reverse(path.begin(), path.end());
        for (int i = 0; i < half; ++i) path.push_back(surface.nearest_in_direction(path.back(), {-1, 0, 0}));
        disc.follow(disc.tear.cut_along(path, disc.x));
        for (int i = 0; i < 300; ++i) {
            disc.solver.wake_all();
            static_cast<void>(disc.solver.step(disc.x, 1e-3, disc.tissue, NoFoundation()));
        }
        disc.follow(disc.tear.update(disc.x, 1e-3, disc.tissue, NoFoundation()));
        const double length = std::abs(disc.mesh.positions()(0, path[0]));
        const double expected = std::numbers::pi * squared.xx * length / (1e6 * 1e-5);
        const auto tips = disc.tear.tips();
        REQUIRE(tips.size() == 2);
        CHECK(norm(tips[0].driving_force) > (half == 1 ? 0.3 : 0.5) * expected);
        CHECK(norm(tips[0].driving_force) < expected);
        CHECK(norm(tips[1].driving_force) == Approx(norm(tips[0].driving_force)).epsilon(0.01));
        CHECK(tips[0].driving_force[0] > 0);
        CHECK(tips[1].driving_force[0] < 0);
    }
}

namespace {

/// A scene turned, mirrored and with other numbers: `number` of each vertex.
struct OtherView {
    explicit OtherView(Index vertex_count) : number(static_cast<std::size_t>(vertex_count)) {
        std::iota(number.begin(), number.end(), Index{0});
    }
    OtherView(Index vertex_count, test::Random& random) : OtherView(vertex_count) {
        if (random.chance(0.5)) std::shuffle(number.begin(), number.end(), random.engine());
        mirrored = random.chance(0.5);
        rotation = random.rotation();
        if (mirrored) rotation.col(0) *= -1;
    }

    TriangleMesh<double> operator()(const Points<double>& x, const Triangles& triangles) const {
        Points<double> moved(3, x.cols());
        for (Index v = 0; v < x.cols(); ++v) moved.col(number[static_cast<std::size_t>(v)]) = rotation * x.col(v);
        Triangles renamed = triangles.unaryExpr([&](Index v) { return number[static_cast<std::size_t>(v)]; });
        if (mirrored) renamed.row(1).swap(renamed.row(2));
        return {moved, renamed};
    }

    std::vector<Index> number;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    bool mirrored = false;
};

/// A sheet of vertices here and there, slightly bulged, that is cut twice: the tip of one cut is often beside the other
/// one. Then it tears.
struct CutSheet {
    explicit CutSheet(test::Random& random) : x(grid.positions()) {
        for (Index v = 0; v < x.cols(); ++v) x.col(v) += random.vector(-5e-5, 5e-5).eigen();
        const TornSurface<double> surface(TriangleMesh<double>(x, grid.triangles()));
        const auto from_border = border(grid);
        for (auto& path : cuts) {
            path.push_back(from_border[static_cast<std::size_t>(random.index(static_cast<Index>(from_border.size())))]);
            const Vector3<double> inward = random.vector(-1e-3, 1e-3) - point(x, path[0]);
            const auto length = static_cast<std::size_t>(5 + random.index(5));
            while (path.size() < length) {
                const Index next = surface.nearest_in_direction(path.back(), inward);
                const bool meets = std::find(cuts[0].begin(), cuts[0].end(), next) != cuts[0].end();
                if (next == no_index || meets || surface.adjacency().on_border(next)) break;
                path.push_back(next);
            }
        }
    }

    /// The driving force at each tip at equilibrium, then places where vertices have doubled, as seen from here.
    struct Seen {
        std::vector<double> forces;
        std::vector<Vector3<double>> doubled;
    };
    Seen tears(const OtherView& view, double toughness) const {
        const auto mesh = with_reserve(view(x, grid.triangles()), 60);
        auto net = Tissue(TearableSprings(
            mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 10.0, .pinned = border(mesh)})));
        QuasiStaticSolver solver(net, {.layers = unlimited, .sweeps = 20000, .force_tolerance = 1e-11});
        Tearing tear(mesh, EnergyRelease{.toughness = toughness, .thickness = 1e-5});
        Points<double> now = 1.2 * mesh.positions();
        Seen seen;
        const auto follow_all = [&](const auto& events) {
            for (const auto& event : events) follow(event, net, solver);
        };
        for (auto path : cuts) {
            for (Index& v : path) v = view.number[static_cast<std::size_t>(v)];
            follow_all(tear.cut_along(path, now));
        }
        for (int tick = 0; tick < 4; ++tick) {
            solver.wake_all();
            REQUIRE(solver.step(now, 1e-3, net, NoFoundation(), tear.ligaments()).status == StepStatus::advanced);
            const auto events = tear.update(now, 1e-3, net, NoFoundation());
            for (const auto& event : events) {
                if (event.split.vertex == no_index) continue;
                const Vector3<double> at = point(tear.surface().rest_positions(), event.split.vertex);
                seen.doubled.push_back(view.rotation.transpose() * at.eigen());
            }
            follow_all(events);
            for (const auto& tip : tear.tips()) seen.forces.push_back(norm(tip.driving_force));
        }
        return seen;
    }

    TriangleMesh<double> grid = sheet({.width = 0.014, .height = 0.014, .columns = 14, .rows = 14});
    Points<double> x;
    std::array<std::vector<Index>, 2> cuts;
};

}  // namespace

// Folds beside a cut may have two equilibria, whose forces differ by less than 1e-3.
TEST_CASE("a sheet turned, mirrored and numbered otherwise has the same driving forces and tears along the same edges",
          "[tear]") {
    int torn = 0;
    for (int seed = 1; seed <= cases(4, 400); ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const CutSheet sheet(random);
        const auto expected = sheet.tears(OtherView(static_cast<Index>(sheet.x.cols())), 600);
        torn += expected.doubled.empty() ? 0 : 1;
        for (int i = 0; i < 3; ++i) {
            const auto seen = sheet.tears(OtherView(static_cast<Index>(sheet.x.cols()), random), 600);
            REQUIRE(seen.forces.size() == expected.forces.size());
            for (std::size_t k = 0; k < seen.forces.size(); ++k) {
                CHECK(seen.forces[k] == Approx(expected.forces[k]).epsilon(1e-3));
            }
            REQUIRE(seen.doubled.size() == expected.doubled.size());
            for (std::size_t k = 0; k < seen.doubled.size(); ++k) {
                CHECK(norm<double>(seen.doubled[k] - expected.doubled[k]) < 1e-9);
            }
        }
    }
    CHECK(torn > cases(4, 400) / 4);
}

// A user forgets one part in `follow`.
TEST_CASE("a part that has missed a split is refused by name, and nothing moves", "[tear]") {
    enum class Part { none, network, foundation, solver, tree, tracker, all };
    const auto status_without = [](Part missing) {
        const auto mesh = with_reserve(disc<double>({.radius = 0.01, .rings = 6}), 20);
        auto net =
            Tissue(TearableSprings(mesh, MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 20.0, .pinned = {0}})));
        VirtualVolumeSprings foundation(mesh, {.stiffness = 5.0});
        QuasiStaticSolver solver(net);
        AabbTree tree(mesh);
        ContactTracker tracker(mesh);
        Tearing tear(mesh, EnergyRelease{.toughness = 1, .thickness = 1e-4});
        Points<double> x = mesh.positions();
        const std::array path{Index{1}, Index{0}, Index{4}};
        for (const auto& event : tear.cut_along(path, x)) {
            const auto follow_unless = [&](Part part, auto& of) {
                if (missing != part && missing != Part::all) follow(event, of);
            };
            follow_unless(Part::network, net);
            follow_unless(Part::foundation, foundation);
            follow_unless(Part::solver, solver);
            follow_unless(Part::tree, tree);
            follow_unless(Part::tracker, tracker);
        }
        const Points<double> before = x;
        const Tool<double> tool{.position = {0.004, 0, 0.0008}, .radius = 1e-3};
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, net, foundation, press(tool, contact), tear.ligaments());
        CHECK((report.status == StepStatus::advanced) == (x != before));
        return report.status;
    };
    CHECK(status_without(Part::none) == StepStatus::advanced);
    CHECK(status_without(Part::network) == StepStatus::network_missed_split);
    CHECK(status_without(Part::foundation) == StepStatus::foundation_missed_split);
    CHECK(status_without(Part::solver) == StepStatus::solver_missed_split);
    CHECK(status_without(Part::tree) == StepStatus::contact_missed_split);
    CHECK(status_without(Part::tracker) == StepStatus::contact_missed_split);
    CHECK(status_without(Part::all) == StepStatus::solver_missed_split);
}

TEST_CASE("a cut that is none says why", "[tear]") {
    const auto flat = sheet({.width = 4, .height = 4, .columns = 4, .rows = 4});  // 5 vertices in a row
    const auto status = [&](Index reserve, const std::vector<Index>& path) {
        const auto mesh = with_reserve(flat, reserve);
        Tearing tear(mesh, EnergyRelease{.toughness = 1, .thickness = 1});
        Points<double> x = mesh.positions();
        const auto cut = tear.cut_along(path, x);
        CHECK(cut.empty() == (cut.status != CutStatus::cut));
        CHECK(tear.reserve_used_up() == (cut.status == CutStatus::reserve_too_small));
        return cut.status;
    };
    CHECK(status(2, {11, 12, 13}) == CutStatus::cut);
    CHECK(status(2, {12}) == CutStatus::no_path);
    CHECK(status(2, {12, 99}) == CutStatus::no_path);
    CHECK(status(2, {11, 12, 11}) == CutStatus::no_path);
    CHECK(status(2, {11, 13}) == CutStatus::not_joined);
    CHECK(status(2, {10, 15}) == CutStatus::not_joined);  // a border edge
    CHECK(status(2, {12, 11, 10, 6}) == CutStatus::crosses_border);
    CHECK(status(2, {11, 12}) == CutStatus::one_edge_within);
    CHECK(status(1, {10, 11, 12, 13}) == CutStatus::reserve_too_small);
}

TEST_CASE("a status of a cut has the name that it has in a program", "[tear]") {
    CHECK(to_string(membrane::CutStatus::cut) == "cut");
    CHECK(to_string(membrane::CutStatus::no_path) == "no_path");
    CHECK(to_string(membrane::CutStatus::not_joined) == "not_joined");
    CHECK(to_string(membrane::CutStatus::crosses_border) == "crosses_border");
    CHECK(to_string(membrane::CutStatus::one_edge_within) == "one_edge_within");
    CHECK(to_string(membrane::CutStatus::reserve_too_small) == "reserve_too_small");
}
